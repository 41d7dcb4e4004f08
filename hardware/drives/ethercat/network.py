"""The EtherCAT network behind pysoem's master: opened, identified, configured, brought to OP, and asked how it is."""

import contextlib
import os
import select
import socket
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from hardware.drives.ethercat import al_status
from hardware.drives.ethercat.axis import Facts
from hardware.drives.ethercat.configuration import DriveRefused, configure
from hardware.drives.ethercat.presets import (
    DRIVE_INPUTS,
    MAKERS,
    TERMINAL_INPUTS,
    TORQUE_OUTPUTS,
    VELOCITY_OUTPUTS,
    Maker,
)
from hardware.drives.ethercat.settings import ARMS, Device, EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import HardwareError
from hardware.parameters import RobotParameters

INSTALL: Final = "EtherCAT drives need pysoem, which is not installed: pip install 'touchmove[ethercat]'"
_STATE_TIME: Final = 3.0
"""Within which all devices reach a state [s]; MR-J4 and its like take some tenths."""
_ACTIVE: Final = 300e-6
"""So long a frame is waited for without sleeping [s]; it takes some 100 µs."""
_WATCHDOG_OFF: Final = 0.0002
"""A watchdog that differs by more from what was asked for has not been set [s]; its steps are 0.1 ms."""
_ATTEMPTS: Final = 3
"""To set the devices up: a frame or an answer may have been lost meanwhile."""
_TRIES: Final = 10
"""A register is asked for so often: where every third frame is lost, one of 60,000 is not read."""
_OUTPUT_CONTROL, _TRIGGER, _RX_ERRORS = 0x0814, 0x40, 0x0300
Result = TypeVar("Result")
Enter = Callable[[Callable[[], Result]], Result]


class Health(NamedTuple):
    """How a device stands: its state, and its AL status code; state 0: it does not answer."""

    device: Device
    place: int
    state: int
    code: int

    @property
    def well(self) -> bool:
        """In OP, without an error."""
        return self.state == al_status.OP

    @property
    def words(self) -> str:
        """For people."""
        if not self.state:
            return f"device {self.place + 1} on the cable"
        reason = f", {al_status.code_words(self.code)}" if self.code else ""
        return f"device {self.place + 1} on the cable is in {al_status.state_words(self.state)}{reason}"


def directly(work: Callable[[], Result]) -> Result:
    """Open the interface from where this program is."""
    return work()


def load_pysoem() -> Any:
    """The module; ``HardwareError`` with the remedy where it is not installed."""
    try:
        import pysoem  # noqa: PLC0415 - an extra: only who has EtherCAT drives needs it
    except ImportError as error:
        raise HardwareError(INSTALL) from error
    return pysoem


class Network:
    """All devices of a cable, in OP; raises ``HardwareError`` where one is not as the settings say.

    Attributes:
        facts: what the drives have said of themselves, by device.
        expected: the working counter of a frame that everybody has served.
    """

    def __init__(
        self, settings: EtherCatSettings, drives: DriveSettings, parameters: RobotParameters, enter: Any = directly
    ) -> None:
        """``enter`` calls what opens the interface, from within the network that has it."""
        self._settings, self._drives = settings, drives
        self._soem = load_pysoem()
        self._master = self._soem.Master()
        try:
            self._socket: int = enter(self._open)
            self._arrival = select.poll()
            self._arrival.register(self._socket, select.POLLIN)
        except ConnectionError as error:
            raise HardwareError(
                f"the network interface {settings.interface} cannot be opened for EtherCAT: does it exist, and may "
                "this program send raw frames ('sudo setcap cap_net_raw,cap_net_admin+ep' the Python binary)?"
            ) from error
        try:
            self._set_up(parameters)
        except BaseException:
            self._master.close()
            raise

    # the start

    def _set_up(self, parameters: RobotParameters) -> None:
        """From wherever the devices are to OP: from the beginning again, whatever is amiss.

        Where a frame or an answer was lost, it may show late and as something else: a device without a mailbox's sync
        manager refuses PRE-OP, and one whose answer about its mapping was lost is mapped as its EEPROM says.
        """
        for left in reversed(range(_ATTEMPTS)):
            try:
                self._find()
                self._configure(parameters)
                self._start()
                return
            except HardwareError:
                if not left:
                    raise
            except self._soem.WkcError as error:
                if left:
                    continue
                raise HardwareError(
                    f"a device at {self._settings.interface} stopped answering during set-up: check the cables and the "
                    "devices' power, then start again"
                ) from error

    def _open(self) -> int:
        """Open the interface; the number of its socket, which pysoem does not tell."""
        before = _raw_sockets()
        self._master.open(self._settings.interface)
        (number,) = _raw_sockets() - before
        return number

    def _find(self) -> None:
        """Who is there, against who should be."""
        settings, master = self._settings, self._master
        found = master.config_init()
        if found <= 0:
            raise HardwareError(
                f"no EtherCAT device answers at {settings.interface}: check the cable, the devices' power, and "
                "whether the interface is up"
            )
        names = ", ".join(slave.name for slave in master.slaves)
        if len(master.slaves) != len(settings.chain):
            chain = ", ".join(settings.chain)
            raise HardwareError(
                f"{len(master.slaves)} devices answer at {settings.interface} ({names}), drives.ethercat.chain names "
                f"{len(settings.chain)} ({chain}): correct the chain, or check the cable behind the last device"
            )
        for device in (*ARMS, Device.GRIPPER):
            slave, maker = self._slave(device), self._maker(device)
            if maker.vendor is not None and (slave.man, slave.id) != (maker.vendor, maker.product):
                preset = settings.gripper_preset if device is Device.GRIPPER else settings.preset
                raise HardwareError(
                    f"{device} is {slave.name} (vendor 0x{slave.man:04X}, product 0x{slave.id:04X}), and preset "
                    f"{preset} does not fit it: choose another preset, or correct the chain"
                )

    def _configure(self, parameters: RobotParameters) -> None:
        """In PRE-OP: by SDO, mapping, clocks, watchdogs."""
        settings, master = self._settings, self._master
        self._await(al_status.PREOP)
        self.facts: dict[Device, Facts] = {}
        for device in (*ARMS, Device.GRIPPER):
            try:
                self.facts[device] = configure(
                    self._slave(device), device, settings, self._drives, parameters, self._maker(device)
                )
            except DriveRefused as error:
                raise HardwareError(f"{device} (device {settings.place(device) + 1} on the cable): {error}") from error
            except (self._soem.SdoError, self._soem.MailboxError, self._soem.PacketError) as error:
                raise HardwareError(
                    f"{device} (device {settings.place(device) + 1} on the cable) aborted its configuration: "
                    f"{_mailbox_words(error)}: check drives.ethercat.sdo against its manual"
                ) from error
        try:
            master.config_map()
        except self._soem.ConfigMapError as error:
            reasons = "; ".join(_mailbox_words(one) for one in error.error_list)
            raise HardwareError(
                f"process data cannot be mapped: {reasons}: check the preset and drives.ethercat.sdo"
            ) from error
        self._check_sizes()
        if settings.distributed_clocks and master.config_dc():
            period = round(self._drives.period * 1e9)
            for device in (*ARMS, Device.GRIPPER):
                self._slave(device).dc_sync(act=True, sync0_cycle_time=period, sync0_shift_time=period // 2)
        self._set_watchdogs()

    def _check_sizes(self) -> None:
        outputs = {Device.GRIPPER: VELOCITY_OUTPUTS.packed.size, Device.FORCES: 0, Device.OTHER: None}
        inputs = {Device.FORCES: TERMINAL_INPUTS.packed.size, Device.OTHER: None}
        for place, device in enumerate(self._settings.chain):
            slave = self._master.slaves[place]
            for what, wanted, found in (
                ("takes", outputs.get(device, TORQUE_OUTPUTS.packed.size), len(slave.output)),
                ("gives", inputs.get(device, DRIVE_INPUTS.packed.size), len(slave.input)),
            ):
                if wanted is not None and wanted != found:
                    raise HardwareError(
                        f"{device} ({slave.name}, device {place + 1} on the cable) {what} {found} bytes of process "
                        f"data, {wanted} are needed: correct the chain, or choose another preset"
                    )

    def _set_watchdogs(self) -> None:
        """The drives' own: what it was set to is read back."""
        wanted = self._drives.watchdog
        for device in (*ARMS, Device.GRIPPER):
            slave = self._slave(device)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # that it was rounded: read back below
                slave.set_watchdog("processdata", round(wanted * 1e4) / 10.0)
            found = slave.get_watchdog("processdata") * 1e-3
            feeds = slave._fprd(_OUTPUT_CONTROL, 1)[0] & _TRIGGER
            if abs(found - wanted) > _WATCHDOG_OFF or not feeds:
                seen = f"stands at {found * 1e3:.1f} ms" if feeds else "is not reset by its process data"
                raise HardwareError(
                    f"the watchdog of {device} ({slave.name}) {seen}, {wanted * 1e3:.1f} ms are needed: without it "
                    "nothing brakes if this computer stops: choose another watchdog time, or another drive"
                )

    def _start(self) -> None:
        """SAFE-OP, process data, OP."""
        master = self._master
        self._await(al_status.SAFEOP)
        self.expected = int(master.expected_wkc)
        for slave in master.slaves:
            slave.output = bytes(len(slave.output))
        self.send()
        self.receive(0.01)
        master.state = al_status.OP
        master.write_state()
        self._await(al_status.OP)
        self.forget_receive_errors()

    def _await(self, state: int) -> None:
        """Until all devices are in a state, with process data under way; who is not is named."""
        deadline = time.monotonic() + _STATE_TIME
        while self._master.state_check(state, 5_000) != state and time.monotonic() < deadline:
            if state == al_status.OP:
                self.send()
                self.receive(0.01)
        late = [one for one in self.health() if one.state & 0x0F != state]
        if late:
            words = "; ".join(f"{one.device}: {one.words}" for one in late)
            raise HardwareError(
                f"not all EtherCAT devices reach {al_status.state_words(state)} within {_STATE_TIME:.0f} s ({words}): "
                "check their displays and drives.ethercat in the rig file"
            )

    # while it runs

    def output(self, device: Device, data: bytes) -> None:
        """Process data of a device for the next frame."""
        self._slave(device).output = data

    def input(self, device: Device) -> bytes:
        """Process data of a device, as the last frame brought them."""
        data: bytes = self._slave(device).input
        return data

    def send(self) -> None:
        """A frame sets out."""
        self._master.send_processdata()

    def receive(self, patience: float) -> int:
        """Wait for the frame [s]; its working counter, negative if it did not come back.

        Actively at first: to be woken up costs as much as the frame takes. SOEM waits by the socket's own time-out,
        which the kernel rounds up to its jiffies: up to 12 ms.
        """
        arrived, until = self._arrival.poll(0), time.monotonic() + min(patience, _ACTIVE)
        while not arrived and time.monotonic() < until:
            arrived = self._arrival.poll(0)
        if arrived or self._arrival.poll(patience * 1e3):
            return int(self._master.receive_processdata(round(patience * 1e6)))
        os.set_blocking(self._socket, False)
        try:
            return int(self._master.receive_processdata(0))  # so that it forgets the frame
        finally:
            os.set_blocking(self._socket, True)

    @property
    def reference_time(self) -> int:
        """Of the reference clock, as the last frame has read it [ns]; 0: there is none."""
        return int(self._master.dc_time)

    def health(self) -> list[Health]:
        """How all devices stand; asks each, which takes one to three frames."""
        self._master.read_state()
        return [
            Health(device, place, int(slave.state), int(slave.al_status))
            for place, (device, slave) in enumerate(zip(self._settings.chain, self._master.slaves, strict=True))
        ]

    def lift(self, one: Health) -> None:
        """Ask a device for its next step towards OP; an error is acknowledged first."""
        slave = self._master.slaves[one.place]
        if one.state & al_status.FAILED:
            slave.state = one.state & 0x0F | al_status.ACKNOWLEDGE
        else:
            slave.state = al_status.OP
        slave.write_state()

    def receive_errors(self) -> list[int]:
        """Damaged frames that each device has counted at its first port, up to 255; -1: it does not answer.

        Takes up to 12 ms for each frame that is lost meanwhile, see ``receive``.
        """
        said = [self._patiently(partial(slave._fprd, _RX_ERRORS, 2)) for slave in self._master.slaves]
        return [-1 if one is None else int(one[0]) for one in said]

    def forget_receive_errors(self) -> None:
        """All devices count from 0 again; those that do not answer go on counting."""
        for slave in self._master.slaves:
            self._patiently(partial(slave._fpwr, _RX_ERRORS, bytes(8)))

    def _patiently(self, ask: Callable[[], Result]) -> Result | None:
        """What a device says on a cable that loses frames; None: nothing."""
        for _ in range(_TRIES):
            try:
                return ask()
            except self._soem.WkcError:
                continue
        return None

    def close(self) -> None:
        """All devices back to INIT, whose brakes close, and the interface given up."""
        try:
            self._master.state = al_status.INIT
            self._master.write_state()
        finally:
            self._master.close()

    def _slave(self, device: Device) -> Any:
        return self._master.slaves[self._settings.place(device)]

    def _maker(self, device: Device) -> Maker:
        settings = self._settings
        return MAKERS[settings.gripper_preset if device is Device.GRIPPER else settings.preset]


def _raw_sockets() -> set[int]:
    """Numbers of this process's open packet sockets."""
    found = set()
    for number in [int(entry.name) for entry in Path("/proc/self/fd").iterdir()]:
        with contextlib.suppress(OSError):  # it is no socket, or was this listing itself
            one = socket.socket(fileno=number)
            one.detach()
            if one.family == socket.AF_PACKET:
                found.add(number)
    return found


def _mailbox_words(error: Exception) -> str:
    """An exception of pysoem for people: they have no words of their own."""
    words = str(getattr(error, "desc", None) or "no answer from its mailbox")
    code = getattr(error, "abort_code", None)
    return words if code is None else f"{words} (SDO abort 0x{code & 0xFFFFFFFF:08X})"
