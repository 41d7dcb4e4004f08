"""UCI options: what is to be set, each checked against what the engine says of itself."""

import difflib
import sys

import chess.engine

from engine.errors import EngineRefused
from engine.levels import STRONGEST, WEAKEST
from engine.settings import HASH_MB, THREADS, EngineSettings, OptionValue

_BY_SETTING = {
    "threads": "threads",
    "hash": "hash_mb",
    "uci_elo": "elo",
    "uci_limitstrength": "elo",
    "skill level": "skill",
    "ponder": "ponder",
}
"""Options that have a setting of their own."""
Configuration = dict[str, chess.engine.ConfigValue]


def configuration(settings: EngineSettings, uci: chess.engine.UciProtocol) -> Configuration:
    """Options to set; raises ``EngineRefused`` if an option is not offered, or not with that value: says what is."""
    wanted: Configuration = {}
    if settings.threads > 1 or "Threads" in uci.options:
        wanted["Threads"] = _within(uci, "Threads", settings.threads, unless=THREADS)
    if "Hash" in uci.options:  # an engine without the option has a fixed table, or none
        wanted["Hash"] = _within(uci, "Hash", settings.hash_mb, unless=HASH_MB)
    if settings.elo is not None and not plays_below(settings, uci):
        wanted["UCI_Elo"] = settings.elo
        if "UCI_LimitStrength" in uci.options:  # some engines have the other one alone
            wanted["UCI_LimitStrength"] = True
    if settings.skill is not None:
        wanted["Skill Level"] = _within(uci, "Skill Level", settings.skill)
    for name, value in settings.options.items():
        wanted[name] = _checked(uci, name, value)
    return wanted


def plays_below(settings: EngineSettings, uci: chess.engine.UciProtocol) -> bool:
    """Whether a level is below the lowest Elo that the engine offers (or it offers none), so that ``levels`` makes it.

    Raises ``EngineRefused`` where there is no such level, by either.
    """
    elo, option = settings.elo, uci.options.get("UCI_Elo")
    if elo is None:
        return False
    low, high = (STRONGEST + 1, STRONGEST) if option is None else (option.min or 0, option.max or sys.maxsize)
    if low <= elo <= high:
        return False
    if WEAKEST <= elo <= STRONGEST and elo < low:
        return True
    choices = f"{min(WEAKEST, low)} to {high}"
    if STRONGEST < low <= high:
        choices = f"{WEAKEST} to {STRONGEST} or {low} to {high}"
    raise EngineRefused(f"Elo {elo} is outside what {_name(uci)} can play: choose {choices}, or leave it out")


def at_full_strength(uci: chess.engine.UciProtocol) -> Configuration:
    """Options that lift every limit of strength, as far as the engine offers them."""
    lifted: Configuration = {}
    if "UCI_LimitStrength" in uci.options:
        lifted["UCI_LimitStrength"] = False
    elif "UCI_Elo" in uci.options and (most := uci.options["UCI_Elo"].max) is not None:
        lifted["UCI_Elo"] = most
    if "Skill Level" in uci.options and (most := uci.options["Skill Level"].max) is not None:
        lifted["Skill Level"] = most
    return lifted


def _checked(uci: chess.engine.UciProtocol, name: str, value: OptionValue) -> chess.engine.ConfigValue:
    """The value in the type of the option."""
    option = uci.options.get(name)
    if option is None:
        raise _unknown(uci, name)
    if (setting := _BY_SETTING.get(name.lower())) is not None:
        raise EngineRefused(f"option {name} has its own setting: set {setting} instead")
    if option.is_managed():
        raise EngineRefused(f"option {name} is set by the game itself: leave it out")
    match option.type:
        case "spin":
            return _within(uci, name, _integer(uci, name, value))
        case "check":
            return _truth(uci, name, value)
        case "combo":
            return _choice(uci, name, value, option.var or [])
        case "button":
            _check_press(uci, name, value)
            return None
        case _:
            return str(value)


def _unknown(uci: chess.engine.UciProtocol, name: str) -> EngineRefused:
    by_lower = {known.lower(): known for known in uci.options}
    near = difflib.get_close_matches(name.lower(), by_lower, n=1)
    names = ", ".join(sorted(uci.options)) or "none at all"
    said = f"did you mean {by_lower[near[0]]}?" if near else f"it offers {names}"
    return EngineRefused(f"{_name(uci)} does not offer an option {name}: {said}")


def _integer(uci: chess.engine.UciProtocol, name: str, value: OptionValue) -> int:
    try:
        if isinstance(value, bool):
            raise ValueError
        return int(value)
    except ValueError:
        raise EngineRefused(f"{name} of {_name(uci)} is a number, not {value!r}: give it an integer") from None


def _truth(uci: chess.engine.UciProtocol, name: str, value: OptionValue) -> bool:
    truths = {"true": True, "false": False}
    if (truth := truths.get(str(value).lower())) is None:
        raise EngineRefused(f"{name} of {_name(uci)} is a switch, not {value!r}: give it true or false")
    return truth


def _choice(uci: chess.engine.UciProtocol, name: str, value: OptionValue, choices: list[str]) -> str:
    if str(value) not in choices:
        raise EngineRefused(f"{name} of {_name(uci)} cannot be {value!r}: choose {', '.join(choices)}")
    return str(value)


def _check_press(uci: chess.engine.UciProtocol, name: str, value: OptionValue) -> None:
    if value is not True and str(value).lower() != "true":
        raise EngineRefused(f"{name} of {_name(uci)} is a button, not {value!r}: give it true to press it at the start")


def _within(uci: chess.engine.UciProtocol, name: str, value: int, *, unless: int | None = None) -> int:
    """The value, if the engine offers the option with it; of ``unless``, which nobody has asked for, the nearest."""
    option = uci.options.get(name)
    if option is None:
        raise EngineRefused(f"{_name(uci)} does not offer {name}, so that {value} cannot be set: leave it out")
    low, high = option.min, option.max
    if value == unless:
        value = max(value if low is None else low, min(value, value if high is None else high))
    if (low is not None and value < low) or (high is not None and value > high):
        raise EngineRefused(
            f"{name} = {value} is outside what {_name(uci)} offers: choose {low} to {high}, or leave it out"
        )
    return value


def _name(uci: chess.engine.UciProtocol) -> str:
    return uci.id.get("name", "this engine")
