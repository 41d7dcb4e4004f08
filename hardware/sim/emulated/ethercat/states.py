"""Which changes of state a slave's application layer admits (ETG.1000.6, section 6.4)."""

from typing import Final

from hardware.sim.emulated.ethercat.registers import INIT, INVALID_CHANGE, OP, PREOP, SAFEOP, UNKNOWN_STATE

_NEXT: Final = {INIT: PREOP, PREOP: SAFEOP, SAFEOP: OP}


def may_change(current: int, wanted: int) -> int:
    """0, or the AL status code of a refusal: one step up at a time, any number of steps down."""
    if wanted not in (INIT, PREOP, SAFEOP, OP):
        return UNKNOWN_STATE
    if wanted <= current or _NEXT.get(current) == wanted:
        return 0
    return INVALID_CHANGE
