"""UCI options: what reaches the engine, and what is refused with the next step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import chess
import chess.engine
import pytest

from engine.errors import EngineRefused
from engine.stockfish import Engine, EngineSettings

OPTIONS = """
say("id name Fake 1.0")
say("option name Threads type spin default 1 min 1 max 4")
say("option name Hash type spin default 16 min 1 max 1024")
say("option name Skill Level type spin default 20 min 0 max 20")
say("option name UCI_LimitStrength type check default false")
say("option name UCI_Elo type spin default 1500 min 1400 max 2000")
say("option name Contempt type spin default 0 min -100 max 100")
say("option name Use Book type check default true")
say("option name Style type combo default Normal var Solid var Normal var Risky Business")
say("option name SyzygyPath type string default <empty>")
say("option name Clear Hash type button")
say("option name MultiPV type spin default 1 min 1 max 5")
say("uciok")
"""


def opened(fake: Callable[..., Any], on_uci: str = OPTIONS, **changes: object) -> list[str]:
    """What an engine is told that is opened with these settings and asked for a move."""
    made = fake(on_uci=on_uci)
    with Engine(EngineSettings.model_validate({"path": made.path, "nodes": 5, **changes})) as engine:
        engine.choose(chess.Board())
    return [line.removeprefix("setoption name ") for line in made.heard if line.startswith("setoption")]


def test_every_kind_of_option_reaches_the_engine(fake: Callable[..., Any]) -> None:
    options = {
        "Contempt": -12, "use book": "false", "Style": "Risky Business", "SyzygyPath": "/tables", "Clear Hash": True,
    }  # fmt: skip
    told = opened(fake, options=options, skill=7)
    assert {
        "Contempt value -12", "use book value false", "Style value Risky Business", "SyzygyPath value /tables",
        "Clear Hash", "Skill Level value 7",
    } <= set(told)  # fmt: skip


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"Contemt": 3}, "Fake 1.0 does not offer an option Contemt: did you mean Contempt?"),
        ({"use boook": 3}, "Fake 1.0 does not offer an option use boook: did you mean Use Book?"),
        ({"Contempt": 101}, "Contempt = 101 is outside what Fake 1.0 offers: choose -100 to 100, or leave it out"),
        ({"Contempt": "much"}, "Contempt of Fake 1.0 is a number, not 'much': give it an integer"),
        ({"Contempt": True}, "Contempt of Fake 1.0 is a number, not True: give it an integer"),
        ({"Use Book": "perhaps"}, "Use Book of Fake 1.0 is a switch, not 'perhaps': give it true or false"),
        ({"Style": "Wild"}, "Style of Fake 1.0 cannot be 'Wild': choose Solid, Normal, Risky Business"),
        ({"Clear Hash": 3}, "Clear Hash of Fake 1.0 is a button, not 3: give it true to press it at the start"),
        ({"Threads": 2}, "option Threads has its own setting: set threads instead"),
        ({"uci_elo": 1500}, "option uci_elo has its own setting: set elo instead"),
        ({"MultiPV": 2}, "option MultiPV is set by the game itself: leave it out"),
    ],
)
def test_what_cannot_be_set_is_refused(fake: Callable[..., Any], options: dict[str, object], sentence: str) -> None:
    with pytest.raises(EngineRefused) as caught:
        opened(fake, options=options)
    assert str(caught.value) == sentence


def test_an_option_that_resembles_none_is_refused_with_all(fake: Callable[..., Any]) -> None:
    with pytest.raises(EngineRefused, match=r"option Xyz: it offers Clear Hash, Contempt, Hash, .*, Use Book$"):
        opened(fake, options={"Xyz": 1})
    with pytest.raises(EngineRefused, match=r"^this engine does not offer an option Xyz: it offers none at all$"):
        opened(fake, on_uci='say("uciok")', options={"Xyz": 1})


def test_skill_is_refused_outside_the_engines_limits(fake: Callable[..., Any]) -> None:
    with pytest.raises(EngineRefused, match=r"^Skill Level = 21 is outside what Fake 1.0 offers: choose 0 to 20, or"):
        opened(fake, skill=21)
    with pytest.raises(EngineRefused, match=r"^this engine does not offer Skill Level, so that 3 cannot be set"):
        opened(fake, on_uci='say("uciok")', skill=3)


def test_elo_and_skill_are_not_set_both() -> None:
    with pytest.raises(ValueError, match="elo and skill both set the strength: leave one of them out"):
        EngineSettings(elo=1500, skill=3)


def test_a_hint_is_at_full_strength_and_the_next_move_is_not(fake: Callable[..., Any]) -> None:
    made = fake(on_uci=OPTIONS)
    with Engine(EngineSettings(path=made.path, nodes=5, elo=1600)) as engine:
        engine.choose(chess.Board())
        engine.hint(chess.Board())
        engine.choose(chess.Board())
    told = [line.removeprefix("setoption name ") for line in made.heard if "LimitStrength" in line or "go" in line[:2]]
    on, off = "UCI_LimitStrength value true", "UCI_LimitStrength value false"
    assert told == [on, "go nodes 5", off, "go nodes 5", on, "go nodes 5"]


@pytest.mark.parametrize(("low", "high", "set_to"), [(1, 1024, None), (32, 1024, 32), (1, 8, 8)])
def test_a_table_that_nobody_asked_for_is_as_near_as_the_engine_has_it(
    fake: Callable[..., Any], low: int, high: int, set_to: int | None
) -> None:
    offers = f"""
say("option name Hash type spin default {max(low, min(16, high))} min {low} max {high}")
say("uciok")
"""
    told = [line for line in opened(fake, on_uci=offers) if line.startswith("Hash")]
    assert set(told) <= {f"Hash value {set_to}"}
    with pytest.raises(EngineRefused, match=f"^Hash = 2000 is outside what this engine offers: choose {low} to {high}"):
        opened(fake, on_uci=offers, hash_mb=2000)


def test_an_engine_with_an_elo_alone_plays_by_it_and_hints_at_its_highest(fake: Callable[..., Any]) -> None:
    made = fake(on_uci='say("option name UCI_Elo type spin default 2000 min 1400 max 2400"); say("uciok")')
    with Engine(EngineSettings(path=made.path, nodes=5, elo=1600)) as engine:
        engine.choose(chess.Board())
        engine.hint(chess.Board())
        engine.choose(chess.Board())
    told = [line.removeprefix("setoption name ") for line in made.heard if "Elo" in line or "go" in line[:2]]
    assert told == [f"UCI_Elo value {elo}" if elo else "go nodes 5" for elo in (1600, 0, 2400, 0, 1600, 0)]


def test_limits_by_a_clock() -> None:
    clock = chess.engine.Limit(white_clock=60.0, black_clock=50.0, white_inc=1.0, black_inc=2.0, remaining_moves=9)
    assert EngineSettings().limit_by(clock) == clock
    assert EngineSettings(move_time=3.0).limit_by(clock).time == 3.0
    assert EngineSettings(nodes=9).limit_by(clock) == chess.engine.Limit(nodes=9)
    assert EngineSettings(move_time=3.0).limit_by(None) == chess.engine.Limit(time=3.0)
    assert EngineSettings(ponder=True).ponders
    assert not EngineSettings(ponder=True, nodes=9).ponders
