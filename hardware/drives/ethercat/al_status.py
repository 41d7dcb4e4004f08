"""States of a slave's application layer, and why it left or refused one (ETG.1000.6, table 11; ETG.1020)."""

from typing import Final

INIT, PREOP, SAFEOP, OP, FAILED = 0x01, 0x02, 0x04, 0x08, 0x10
ACKNOWLEDGE: Final = 0x10
WATCHDOG: Final = 0x001B
_STATES: Final = {INIT: "INIT", PREOP: "PRE-OP", 0x03: "BOOT", SAFEOP: "SAFE-OP", OP: "OP"}
_CODES: Final = {
    0x0001: "unspecified error",
    0x0002: "no memory",
    0x0011: "invalid requested state change",
    0x0012: "unknown requested state",
    0x0014: "no valid firmware",
    0x0016: "invalid mailbox configuration",
    0x0017: "invalid sync manager configuration",
    0x0018: "no valid inputs",
    0x0019: "no valid outputs",
    0x001A: "synchronisation error",
    0x001B: "sync manager watchdog",
    0x001C: "invalid sync manager types",
    0x001D: "invalid output configuration",
    0x001E: "invalid input configuration",
    0x001F: "invalid watchdog configuration",
    0x0020: "needs a cold start",
    0x0021: "needs INIT",
    0x0024: "invalid input mapping",
    0x0025: "invalid output mapping",
    0x0026: "inconsistent settings",
    0x0027: "free run is not supported",
    0x0028: "synchronisation is not supported",
    0x002C: "fatal synchronisation error",
    0x002D: "no SYNC0 or SYNC1",
    0x0030: "invalid configuration of its clock",
    0x0032: "its clock is out of step",
    0x0034: "SYNC0's cycle is not met",
    0x0035: "invalid cycle of SYNC0",
    0x0050: "no access to its EEPROM",
    0x0051: "error of its EEPROM",
}


def state_words(state: int) -> str:
    """A state for people, without its error flag."""
    return _STATES.get(state & 0x0F, f"state {state & 0x0F}")


def code_words(code: int) -> str:
    """An AL status code for people."""
    return f"{_CODES.get(code, 'a code of the manufacturer')}, AL status 0x{code:04X}"
