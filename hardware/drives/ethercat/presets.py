"""What makers' drives have in common, and in what they differ.

**generic**: any drive that keeps to CiA 402 and ETG.6010: torques in ‰ of the rated torque (0x6076, in mN m),
velocities (0x606C, 0x60FF) in counts of the encoder a second, 0x608F says how many counts a turn has, PDOs can be
mapped.

**mr-j4-tm**: Mitsubishi MR-J4-TM, the EtherCAT sister of the paper's MR-J4-B. What is known, and whence:

- identity 0x0A1E / 0x0201 (MR-J4-20TM), one PDO of each direction with 12 and 14 objects as shipped, 0x2D20 *velocity
  limit value* among them, 0x6502 = 0x03AD (pp, pv, tq, hm, csp, csv, cst): read from a drive, linuxcnc-ethercat #517.
- torques 0x6071, 0x6077 in 0.1 % of the rated torque, velocity 0x606C in 0.01 r/min, torque limits 0x60E0, 0x60E1,
  0x6072: manual of SMC's LECSN-T, section 18.5.4.5. Assumed: that drive looks like a sister of the MR-J4, with the
  same objects.

Not verified, since neither an ESI file nor a drive was at hand: that cst needs 0x2D20 above zero (this preset sets it
to the speed limit), that 0x603F can be mapped, how SYNC0 has to lie to the frames, and that it reaches OP with any open
master. Nobody has run this program on one.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from hardware.drives.ethercat.layout import Object, PdoLayout, gap

OUTPUT_PDO, INPUT_PDO, OUTPUT_ASSIGNMENT, INPUT_ASSIGNMENT = 0x1600, 0x1A00, 0x1C12, 0x1C13
_CONTROL = Object("control", 0x6040, "u16")
_MODE = Object("mode", 0x6060, "i8")
_STATUS = (
    Object("status", 0x6041, "u16"),
    Object("position", 0x6064, "i32"),
    Object("velocity", 0x606C, "i32"),
    Object("torque", 0x6077, "i16"),
    Object("error", 0x603F, "u16"),
)
TORQUE_OUTPUTS: Final = PdoLayout((_CONTROL, Object("torque", 0x6071, "i16"), _MODE, gap("u8")))
"""Of a servomotor in cyclic synchronous torque."""
VELOCITY_OUTPUTS: Final = PdoLayout((_CONTROL, Object("velocity", 0x60FF, "i32"), _MODE, gap("u8")))
"""Of the gripper in cyclic synchronous velocity."""
DRIVE_INPUTS: Final = PdoLayout(_STATUS)
"""Of either."""
TERMINAL_INPUTS: Final = PdoLayout(
    (
        Object("status1", 0x6000, "u16", 1), Object("value1", 0x6000, "i16", 17),
        Object("status2", 0x6010, "u16", 1), Object("value2", 0x6010, "i16", 17),
    )
)  # fmt: skip
"""Of an EL3102 as it is shipped (PDOs 0x1A00 and 0x1A02, standard), and of its like."""
TERMINAL_VOLT: Final = 0x7FFF / 10.0
"""Counts for a volt: 10 V are 0x7FFF (EL31xx documentation, process data)."""
TERMINAL_ERROR: Final = 0x0040
"""In the status of a channel: its value is not valid."""


class Preset(StrEnum):
    """Makers' drives that are known, see the module."""

    GENERIC = "generic"
    MR_J4_TM = "mr-j4-tm"


@dataclass(frozen=True, slots=True)
class Maker:
    """What differs between makers."""

    vendor: int | None
    """That the drives have to be of; None: any."""
    product: int | None
    velocity_step: float | None
    """Unit of 0x606C and 0x60FF [rad/s]; None: counts of the encoder a second."""
    velocity_limit: int | None
    """Object that limits the speed in torque mode, in units of velocity; None: there is none."""


MAKERS: Final = {
    Preset.GENERIC: Maker(None, None, None, None),
    Preset.MR_J4_TM: Maker(0x0A1E, 0x0201, 0.01 * math.tau / 60.0, 0x2D20),
}
