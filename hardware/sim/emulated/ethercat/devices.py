"""The slaves of a whole robot on one segment, as ``EmulatedDevices`` behind a raw socket."""

import contextlib
import socket
import time
from collections.abc import Sequence
from typing import Final

from hardware.drives.ethercat.presets import MAKERS, Preset
from hardware.drives.ethercat.settings import ARMS, Device, EtherCatSettings
from hardware.drives.settings import DriveSettings, JointSettings
from hardware.interfaces import HardwareError
from hardware.parameters import RobotParameters
from hardware.sim.emulated.answer_times import AnswerTimes
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.emulated.ethercat import registers as reg
from hardware.sim.emulated.ethercat.clock import SlaveClock
from hardware.sim.emulated.ethercat.drive import CST, CSV, DriveKind, EmulatedDrive
from hardware.sim.emulated.ethercat.segment import ETHERTYPE, SlaveChain
from hardware.sim.emulated.ethercat.sii import Identity
from hardware.sim.emulated.ethercat.slave import Application, Slave
from hardware.sim.emulated.ethercat.terminals import AnalogTerminal, Coupler
from hardware.sim.emulated.plant_drives import MotorCommand, MotorState
from hardware.sim.process.planted import PlantedKind

_LONGEST_FRAME: Final = 2048
_EXCESS_TEMPERATURE, _UNDER_VOLTAGE, _SYNCHRONISATION_ERROR = 0x4310, 0x3220, 0x001A
"""Error codes of CiA 402, and an AL status code."""
_GRIPPER_COUNTS: Final = 1 << 20
_MAKER: Final = Identity(0x0000_07FF, 0x0402, 0x0001_0000, "CiA402")
"""Of drives that are nobody's: vendor numbers up to 0x7FF are for tests."""
_MR_J4_TM: Final = Identity(0x0A1E, 0x0201, 0x0002_0002, "MR-J4-20TM")


class EtherCatDevices:
    """A robot's slaves on the cable's far end.

    Attributes:
        segment: the slaves in their order, and faults of the wire.
        drives: of the three arms.
        gripper: its drive.
        slaves: by what they are.
    """

    def __init__(
        self,
        settings: EtherCatSettings,
        drives: DriveSettings,
        robot: RobotParameters,
        interface: str | None,
        times: AnswerTimes | None = None,
    ) -> None:
        """``interface`` is the cable's end in this process's network; None: frames are handed in by ``pass_on``.

        Raises ``HardwareError`` if there is no such end.
        """
        self.drives = [
            EmulatedDrive(_kind(settings.preset, _counts(joint), joint.rated_torque, joint.ratio, robot), CST)
            for joint in drives.joints
        ]
        self.gripper = EmulatedDrive(_kind(settings.gripper_preset, _GRIPPER_COUNTS, None, 1.0, robot), CSV)
        self.terminal = AnalogTerminal()
        applications: dict[Device, Application] = {Device.GRIPPER: self.gripper, Device.FORCES: self.terminal}
        applications.update(zip(ARMS, self.drives, strict=True))
        began, places = time.monotonic_ns(), len(settings.chain)
        chain = [
            Slave(applications.get(device) or Coupler(), SlaveClock(began - 1_234_567 * place, place, places))
            for place, device in enumerate(settings.chain)
        ]
        self.slaves = {device: chain[settings.place(device)] for device in settings.chain}
        self.segment = SlaveChain(chain)
        self._period, self.times = drives.period, times
        self._due: list[Slave] = []
        self._heard, self._complete = -1.0, False
        self._socket = None if interface is None else _open(interface)

    # EmulatedDevices

    @property
    def numbers(self) -> Sequence[int]:
        """See ``EmulatedDevices``."""
        return () if self._socket is None else (self._socket.fileno(),)

    @property
    def prompt(self) -> bool:
        """See ``EmulatedDevices``."""
        return True

    @property
    def complete(self) -> bool:
        """See ``EmulatedDevices``."""
        return self._complete

    @property
    def heard(self) -> float:
        """See ``EmulatedDevices``."""
        return self._heard

    def hear(self) -> None:
        """See ``EmulatedDevices``."""
        assert self._socket is not None
        with contextlib.suppress(BlockingIOError, OSError):  # nothing more, or the cable is pulled
            while True:
                frame = bytearray(self._socket.recv(_LONGEST_FRAME))
                asked = time.monotonic()
                if self.pass_on(frame):
                    self._socket.send(frame)
                    if self.times is not None:
                        self.times.note(asked, time.monotonic())
                self.settle()
                if self.complete:  # what comes after it finds the plant where it is by then
                    return

    def act(self, now: float) -> MotorCommand:
        """See ``EmulatedDevices``."""
        nanoseconds = round(now * 1e9)
        for slave in self.segment.slaves:
            slave.watch(nanoseconds)
        self._complete = False
        one, two, three = self.drives
        running = [drive.enabled for drive in self.drives]
        speed = self.gripper.speed if self.gripper.enabled else None
        torque = tuple(drive.torque if drive.enabled else 0.0 for drive in (one, two, three))
        return MotorCommand(torque, speed, braked=not all(running), powered=any(running))  # type: ignore[arg-type]

    def sense(self, state: MotorState) -> None:
        """See ``EmulatedDevices``."""
        for drive, angle, velocity in zip(self.drives, state.angle, state.velocity, strict=True):
            drive.angle, drive.velocity = angle, velocity
        moved, self.gripper.angle = state.gripper_angle - self.gripper.angle, state.gripper_angle
        self.gripper.velocity = moved / self._period
        self.terminal.volts[:] = state.readings
        for slave in self.segment.slaves:
            slave.offer_inputs()

    def plant(self, kind: PlantedKind, device: int, amount: float) -> None:
        """See ``Faulty``."""
        place, drive = self._place(device), (*self.drives, self.gripper)[device - 1]
        slave = self.segment.slaves[place]
        match kind:
            case PlantedKind.NOT_FOLLOWED:
                drive.flaws.follows = amount
            case PlantedKind.TOO_HOT:
                drive.flaws.cause = _EXCESS_TEMPERATURE
                drive.fault(_EXCESS_TEMPERATURE)
            case PlantedKind.UNDER_VOLTAGE:
                drive.flaws.cause = _UNDER_VOLTAGE
                drive.fault(_UNDER_VOLTAGE)
            case PlantedKind.DROPS_OUT:
                slave.drop(reg.SAFEOP, _SYNCHRONISATION_ERROR)
            case PlantedKind.SILENT:
                self._reach(place)
            case PlantedKind.LOST_FRAMES:
                self.segment.losing = int(amount)
            case PlantedKind.CORRUPT_FRAMES:
                self.segment.damaged_before, self.segment.damaging = place, int(amount)
            case PlantedKind.WATCHDOG_DEAD:
                slave.bites = False
            case _:
                raise ValueError(f"{kind} is not a fault of a device")

    def mend(self, kind: PlantedKind, device: int) -> None:
        """See ``Faulty``. Drives with a fault of their own keep it until they are reset."""
        drive = (*self.drives, self.gripper)[device - 1]
        match kind:
            case PlantedKind.NOT_FOLLOWED:
                drive.flaws.follows = 1.0
            case PlantedKind.TOO_HOT | PlantedKind.UNDER_VOLTAGE:
                drive.flaws.cause = 0
            case PlantedKind.SILENT:
                self._reach(len(self.segment.slaves))
            case PlantedKind.LOST_FRAMES | PlantedKind.CORRUPT_FRAMES:
                self.segment.losing = self.segment.damaging = 0
            case PlantedKind.WATCHDOG_DEAD:
                self.segment.slaves[self._place(device)].bites = True

    def _place(self, device: int) -> int:
        """Where a servomotor's drive, or the gripper's, stands along the cable."""
        return self.segment.slaves.index(self.slaves[(*ARMS, Device.GRIPPER)[device - 1]])

    def _reach(self, slaves: int) -> None:
        self.segment.reach = slaves
        self.segment.link_up()

    def close(self) -> None:
        """See ``EmulatedDevices``."""
        if self._socket is not None:
            self._socket.close()

    # frames

    def pass_on(self, frame: bytearray) -> bool:
        """Let a frame pass through the segment; False: it does not come back. ``settle`` has to follow."""
        written = self.segment.pass_through(frame, time.monotonic_ns())
        if written is None:
            return False
        self._due = written
        self._heard = time.monotonic()
        return True

    def settle(self) -> None:
        """What the last frame has written acts, now that it is on its way back."""
        due, self._due = self._due, []
        if not due:
            return
        now = time.monotonic_ns()
        for slave in due:
            slave.outputs_written(now)
        self._complete = True
        for slave in due:
            slave.offer_inputs()


def _open(interface: str) -> socket.socket:
    try:
        raw = namespace.raw_socket(interface, ETHERTYPE)
    except OSError as error:
        raise HardwareError(
            f"the cable's end {interface} of emulated EtherCAT devices cannot be opened ({error.strerror}): start "
            "their world by 'python -P -m hardware.sim.emulated.ethercat.process', which makes the cable first"
        ) from error
    raw.setblocking(False)
    return raw


def _counts(joint: JointSettings) -> int:
    """Of a motor's turn."""
    return round((1 << joint.encoder_bits) / joint.ratio)


def _kind(preset: Preset, counts: int, rated: float | None, ratio: float, robot: RobotParameters) -> DriveKind:
    maker = MAKERS[preset]
    identity = _MR_J4_TM if preset is Preset.MR_J4_TM else _MAKER
    torque = robot.drive.rated_torque / ratio if rated is None else rated
    step = maker.velocity_step
    if step is None:
        return DriveKind.counting(identity, counts, torque)
    return DriveKind(identity, counts, torque, step, velocity_limit=maker.velocity_limit is not None)
