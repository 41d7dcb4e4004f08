"""What can be said in a game against somebody elsewhere is told from one list, and who played each move by its name."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from app.play.remote_launch import resume_remote_games, run_remote_games
from app.players.remote import Offer, OfferAnswered, Offered, RemoteEvent
from app.players.typed_commands import Word, help_text
from app.terminal.game_display import Conversation, Together, UserInterface
from app.terminal.shown import RemoteShown
from hardware.piece_set import Colour
from tests.app.game.scripted_opponent import ScriptedOpponent, Source, ends_when_asked, line_of
from tests.app.game.test_remote_turn import MATE, Told, TypedWhenAsked, at, ended, made, play, settings

ALWAYS = ("draw", "resign", "quit", "help", "fix")


def offered(ui: Told) -> list[tuple[str, ...]]:
    """The words that were told one after the other, sorted."""
    return [tuple(sorted(one.words)) for one in ui.remotes]


def words(*more: str) -> tuple[str, ...]:
    return tuple(sorted((*ALWAYS, *more)))


def test_before_anybody_is_found_and_after_the_game_one_can_only_leave(tmp_path: Path) -> None:
    _, ui = play(tmp_path, ScriptedOpponent(True, [ends_when_asked]), "resign")
    assert ui.remotes == [
        RemoteShown(None, None, (Word.QUIT,)),
        RemoteShown("Ada", Colour.WHITE, ui.remotes[1].words),
        RemoteShown("Ada", Colour.WHITE, (Word.QUIT,)),
    ]


def test_a_game_is_aborted_until_both_have_moved_and_a_move_taken_back_once_there_is_one(tmp_path: Path) -> None:
    over = at("stands 4", ended("0-1", "checkmate"))
    _, ui = play(tmp_path, ScriptedOpponent(False, [line_of(*MATE), over]), "f3", "g4")
    assert offered(ui) == [("quit",), words("abort"), words("abort", "takeback"), words("takeback"), ("quit",)]


def test_an_offer_is_declined_only_while_it_stands(tmp_path: Path) -> None:
    offers = at("stands 0", Offered(Offer.DRAW), Offered(Offer.TAKE_BACK, 1))
    opponent = ScriptedOpponent(True, [offers, ends_when_asked])
    _, ui = play(tmp_path, opponent, "decline", "resign")
    assert offered(ui) == [
        ("quit",), words("abort"), words("abort", "decline"), words("abort", "decline", "takeback"), words("abort"),
        ("quit",),
    ]  # fmt: skip
    withdrawn = OfferAnswered(Offer.DRAW, accepted=False, withdrawn=True)
    _, ui = play(tmp_path / "again", ScriptedOpponent(True, [at("stands 0", Offered(Offer.DRAW), withdrawn,
                 ended("*", "aborted"))]))  # fmt: skip
    assert offered(ui)[2:4] == [words("abort", "decline"), words("abort")]


class Leaving(ScriptedOpponent):
    """Has left as soon as it was asked for something to happen."""

    def next(self, timeout: float) -> RemoteEvent | None:
        self.claimable = True
        return super().next(timeout)

    def claim(self) -> None:
        super().claim()
        self.events.append(ended("1-0", "Black has left the game"))


def test_a_game_is_claimed_once_that_is_possible(tmp_path: Path) -> None:
    opponent = Leaving(False, [])
    done, ui = play(tmp_path, opponent, "claim")
    assert done.report.exit_reason == "Black has left the game"
    assert offered(ui)[2] == words("abort", "claim")


def test_the_terminal_names_and_explains_the_same_words(tmp_path: Path) -> None:
    opponent = ScriptedOpponent(True, [ends_when_asked])
    _, ui = play(tmp_path, opponent, "e5", "help", "resign")
    now = ui.remotes[1].words
    assert ui.said[0].endswith("you can say " + ", ".join(f"'{word}'" for word in now))
    explained = [line.split()[0] for line in ui.said[1].splitlines()[1:]]
    assert explained == list(now)
    assert "its own" not in ui.said[1], "that is what a robot takes back that plays here"


def test_help_names_every_word_of_a_game_against_the_robot() -> None:
    assert [line.split()[0] for line in help_text().splitlines()[1:]] == list(Word)


@pytest.mark.parametrize("colour", [True, False], ids=["white", "black"])
def test_the_terminal_says_who_played(tmp_path: Path, colour: bool) -> None:
    out = io.StringIO()
    over = at("stands 4", ended("0-1", "checkmate"))
    opponent = ScriptedOpponent(colour, [line_of(*MATE), over])
    lines = ("e5", "Qh4") if colour else ("f3", "g4")
    shown = Conversation(Console(file=out, width=60))
    run_remote_games(settings(tmp_path), shown, TypedWhenAsked(*lines), Source(opponent))
    ours, theirs = "you played", "Ada played"
    white, black = (theirs, ours) if colour else (ours, theirs)
    assert [line for line in out.getvalue().splitlines() if " played)" in line] == [
        f"1. f3  ({white})", f"1… e5  ({black})", f"2. g4  ({white})", f"2… Qh4#  ({black})",
    ]  # fmt: skip


def test_a_move_of_ours_that_the_arm_makes_up_for_is_ours(tmp_path: Path) -> None:
    first = ScriptedOpponent(False, [line_of(*MATE)])
    play(tmp_path, first, "f3", "quit")
    out = io.StringIO()
    moves = at("stands 2", made(2, "g2g4"), made(3, "d8h4"), ended("0-1", "checkmate", 4))
    shown = Together(UserInterface(), Conversation(Console(file=out, width=60)))
    resume_remote_games(tmp_path, shown, TypedWhenAsked(), Source(ScriptedOpponent(False, [moves])))
    assert "2. g4  (you played)" in out.getvalue()
    assert "2… Qh4#  (Ada played)" in out.getvalue()


def test_an_engine_s_own_moves_are_said_as_such(tmp_path: Path) -> None:
    out = io.StringIO()
    opponent = ScriptedOpponent(True, [line_of("e4"), at("stands 2", ended("1-0", "Black resigns"))])
    shown = Conversation(Console(file=out, width=60))
    run_remote_games(settings(tmp_path, person=False), shown, TypedWhenAsked(), Source(opponent))
    played = [line.rpartition("(")[2] for line in out.getvalue().splitlines() if " played)" in line]
    assert played == ["Ada played)", "I played)"]
