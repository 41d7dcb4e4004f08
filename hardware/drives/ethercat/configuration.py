"""What a drive is told by SDO in PRE-OP, and what it is asked: mapping, mode, limits; counts, rated torque."""

import math
import struct
from typing import Any, Final

from hardware.drives.ethercat.axis import Facts
from hardware.drives.ethercat.cia402 import MODE_TORQUE, MODE_VELOCITY
from hardware.drives.ethercat.layout import PdoLayout
from hardware.drives.ethercat.presets import (
    DRIVE_INPUTS,
    INPUT_ASSIGNMENT,
    INPUT_PDO,
    OUTPUT_ASSIGNMENT,
    OUTPUT_PDO,
    TORQUE_OUTPUTS,
    VELOCITY_OUTPUTS,
    Maker,
)
from hardware.drives.ethercat.settings import ARMS, Device, EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.parameters import RobotParameters

_MODE, _SUPPORTED, _RATED_TORQUE, _MAX_TORQUE = 0x6060, 0x6502, 0x6076, 0x6072
_RESOLUTION, _INTERPOLATION = 0x608F, 0x60C2
_FORMATS: Final = {8: "B", 16: "H", 32: "I"}


class DriveRefused(Exception):
    """A drive cannot do what is needed; the message is what it said."""


def configure(
    slave: Any, device: Device, settings: EtherCatSettings, drives: DriveSettings, robot: RobotParameters, maker: Maker
) -> Facts:
    """Configure a drive; raises ``DriveRefused``, and what pysoem raises."""
    arm = device in ARMS
    mode = MODE_TORQUE if arm else MODE_VELOCITY
    _require_mode(slave, mode)
    _map(slave, OUTPUT_PDO, OUTPUT_ASSIGNMENT, TORQUE_OUTPUTS if arm else VELOCITY_OUTPUTS)
    _map(slave, INPUT_PDO, INPUT_ASSIGNMENT, DRIVE_INPUTS)
    slave.sdo_write(_MODE, 0, struct.pack("<b", mode))
    value, power = interpolation(drives.period)
    slave.sdo_write(_INTERPOLATION, 1, bytes([value]))
    slave.sdo_write(_INTERPOLATION, 2, struct.pack("<b", power))
    facts = _facts(slave, device, settings, drives, maker)
    if arm:
        joint = drives.joints[ARMS.index(device)]
        most = joint.peak(robot.drive) / joint.ratio / facts.rated_torque * 1000.0
        slave.sdo_write(_MAX_TORQUE, 0, struct.pack("<H", min(65535, math.ceil(most))))
        if maker.velocity_limit is not None:
            fastest = round(robot.drive.max_speed * joint.ratio / facts.velocity_step)
            slave.sdo_write(maker.velocity_limit, 0, struct.pack("<I", fastest))
    for write in settings.sdo:
        if write.device is device:
            data = struct.pack("<" + _FORMATS[write.bits], write.value & (1 << write.bits) - 1)
            slave.sdo_write(write.index, write.subindex, data)
    return facts


def interpolation(period: float) -> tuple[int, int]:
    """A period [s] as 0x60C2 wants it: a number up to 255, and the power of ten of its unit."""
    for power in range(-3, -7, -1):
        value = period * 10.0**-power
        if abs(value - round(value)) < 1e-6 and 1 <= round(value) <= 255:
            return round(value), power
    raise DriveRefused(f"a period of {period:g} s cannot be set (0x60C2): choose 0.0005, 0.001 or 0.002 s")


def _require_mode(slave: Any, mode: int) -> None:
    modes = _read(slave, _SUPPORTED, 0)
    if not modes >> (mode - 1) & 1:
        name = "cyclic synchronous torque" if mode == MODE_TORQUE else "cyclic synchronous velocity"
        raise DriveRefused(f"it does not support {name} (its modes 0x6502 are 0x{modes:04X}): use another drive")


def _map(slave: Any, pdo: int, assignment: int, layout: PdoLayout) -> None:
    """Map a PDO anew, and make it the only one of its direction (ETG.1000.6, section 5.6.7)."""
    slave.sdo_write(assignment, 0, b"\x00")
    slave.sdo_write(pdo, 0, b"\x00")
    for place, one in enumerate(layout.objects, 1):
        slave.sdo_write(pdo, place, one.mapped)
    slave.sdo_write(pdo, 0, bytes([len(layout.objects)]))
    slave.sdo_write(assignment, 1, struct.pack("<H", pdo))
    slave.sdo_write(assignment, 0, b"\x01")


def _facts(slave: Any, device: Device, settings: EtherCatSettings, drives: DriveSettings, maker: Maker) -> Facts:
    arm = device in ARMS
    counts = settings.encoder_counts if arm else settings.gripper_counts
    if counts is None:
        counts, turns = _read(slave, _RESOLUTION, 1), _read(slave, _RESOLUTION, 2)
        if not counts or turns != 1:
            name = "encoder_counts" if arm else "gripper_counts"
            raise DriveRefused(
                f"its encoder has {counts} counts for {turns} turns (0x608F), one turn is needed: give "
                f"drives.ethercat.{name}"
            )
    rated = drives.joints[ARMS.index(device)].rated_torque if arm else None
    if rated is None:
        rated = _read(slave, _RATED_TORQUE, 0) * 1e-3
        if arm and not rated:
            raise DriveRefused("it does not report its rated torque (0x6076 is 0): give rated_torque of its joint")
    return Facts(counts, rated, maker.velocity_step or math.tau / counts)


def _read(slave: Any, index: int, subindex: int) -> int:
    return int.from_bytes(slave.sdo_read(index, subindex), "little")
