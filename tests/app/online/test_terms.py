"""Terms that server or arm do not allow are refused with the figures, before anybody is asked for a game."""

from __future__ import annotations

import pytest

from app import UserError
from app.online.messages import Challenge
from app.online.terms import TablePace, Terms, of_challenge, pace_of, require_kept, terms_of
from app.settings.defaults import Settings
from app.settings.files import settings_of


def asked(use: str = "person", **more: object) -> Settings:
    return settings_of({"online.use": use, **{name.replace("__", "."): value for name, value in more.items()}})


def test_what_is_asked_for_is_said_in_the_servers_words() -> None:
    terms = terms_of(asked(clock__time="10+5", online__rated=True, online__color="black"))
    assert terms.for_seek() == {
        "time": "10", "increment": "5", "rated": "true", "color": "black", "variant": "standard",
    }  # fmt: skip
    assert terms.for_challenge() == {
        "clock.limit": "600", "clock.increment": "5", "rated": "true", "color": "black", "variant": "standard",
    }  # fmt: skip
    days = terms_of(asked(online__days=3))
    assert days.for_seek() == {"days": "3", "rated": "false", "variant": "standard"}
    assert days.for_challenge()["days"] == "3"
    assert (str(terms), str(days)) == ("10+5, rated", "3 days per move, casual")
    assert str(terms_of(asked())) == "15+10, casual"


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        ({"clock__time": "3+2"}, "3\\+2, casual is blitz, .* challenge somebody with --opponent"),
        ({"clock__time": "1+0", "online__opponent": "anna"}, "allows no game as fast as 1\\+0"),
        ({"clock__time": "7:30+5"}, "whole minutes"),
        ({"clock__time": "15+90"}, "whole seconds up to 60"),
        ({"clock__time": "40/90,30"}, "whole minutes"),
        ({"clock__time": "10d5"}, "whole minutes"),
        ({"clock__time": "10+5", "online__days": 3}, "leave one of them out"),
    ],
)
def test_what_lichess_does_not_have_is_refused(said: dict[str, object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        terms_of(asked(**said))


def test_blitz_is_for_a_challenge_and_anything_for_a_bot() -> None:
    assert terms_of(asked(clock__time="5+3", online__accept=True)).limit == 300
    assert terms_of(asked(clock__time="5+3", online__opponent="anna")).limit == 300
    assert terms_of(asked("bot", clock__time="1+0")).limit == 60


def test_what_the_arm_cannot_keep_is_refused_with_the_figure() -> None:
    with pytest.raises(UserError) as caught:
        require_kept(Terms(180, 0, None, False), TablePace(2.0, person=False, latency=0.1))
    assert str(caught.value) == (
        "3+0, casual gives each side 3:00 for 40 moves, of which the table needs 2:44: 4.1 s a move for arm and link; "
        "choose a longer --clock"
    )
    require_kept(Terms(180, 2, None, False), TablePace(2.0, person=False, latency=0.1))
    require_kept(Terms(None, 0, 1, False), TablePace(60.0, person=True))
    with pytest.raises(UserError, match="for arm, hand and link"):
        require_kept(Terms(300, 0, None, False), TablePace(6.0, person=True))


def test_a_table_without_an_arm_takes_no_time() -> None:
    assert pace_of(asked(rig__name="board"), 0.0).per_move == 0.0
    assert pace_of(asked(), 0.0).per_move == 4.0
    assert pace_of(asked("bot", online__arm_seconds=1.5), 0.2).per_move == pytest.approx(3.2)


def test_a_challenge_is_read() -> None:
    said = {
        "id": "abcd1234", "challenger": {"id": "anna", "name": "Anna"}, "variant": {"key": "standard"}, "rated": True,
        "speed": "rapid", "timeControl": {"type": "clock", "limit": 300, "increment": 3},
    }  # fmt: skip
    assert of_challenge(Challenge.model_validate(said)) == Terms(300, 3, None, True)
    said["timeControl"] = {"type": "correspondence", "daysPerTurn": 2}
    assert of_challenge(Challenge.model_validate(said)) == Terms(None, 0, 2, True)
    said["timeControl"] = {"type": "unlimited"}
    assert str(of_challenge(Challenge.model_validate(said))) == "no clock, rated"
