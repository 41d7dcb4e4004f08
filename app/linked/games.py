"""Games of two robots from their settings, and going on with one: the link first, then the rig, then the games."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Final

from app import UserError
from app.execution.state import LEFT
from app.game import GameEnd
from app.linked.link import RobotLink, open_link
from app.linked.log import LinkedState
from app.linked.messages import LONGEST_NAME, MOST_PLIES, printable
from app.linked.secret import LinkSecret
from app.play.game_setup import rig_setup_of, start_board
from app.play.launch import NO_OTHERS, completed
from app.play.match import PERSON, match_of
from app.play.player_selection import MOVE_TIME, line_players, start_clock
from app.play.remote_launch import resume_remote_games, run_remote_games
from app.play.session import SessionResult
from app.players.given_line import given_line
from app.players.person import Lines, PersonGone
from app.players.players import Players
from app.players.remote import Notice, Offer, OfferAnswered, Offered, RemoteOpponent
from app.players.typed_commands import Word, word_of
from app.records import new_folder, utc_now
from app.records.files import GAMES, make_folder
from app.rig.simulation.ahead import RigAhead
from app.settings.defaults import LinkRole, Settings
from app.settings.files import kept_settings
from app.settings.time_control import ArmTime
from app.terminal.game_display import UserInterface

POLL: Final = 0.2
"""[s, wall]"""
QUESTION: Final = 120.0
"""How long an engine's robot waits for a person elsewhere who may want a rematch [s, wall]."""


class LinkedSource:
    """``OpponentSource``: the other robot's player, and no other.

    Args:
        link: to the other robot.
        ui: shown what is asked.
        lines: what the person here says; None: an engine plays here.
    """

    def __init__(self, link: RobotLink, ui: UserInterface, lines: Lines | None) -> None:
        self._link, self._ui, self._lines = link, ui, lines

    def find(self) -> RemoteOpponent | None:
        """See ``OpponentSource.find``."""
        return self._link.opponent

    def again(self, end: GameEnd) -> bool:
        """See ``OpponentSource.again``: a person here or there may propose a rematch; an engine agrees to one."""
        peer, opponent = self._link.peer, self._link.opponent
        asks = self._lines is not None
        if end is LEFT or not end.complete or not peer.log.state.ended_by_players:
            return False
        peer.rematch(asks=asks)
        if asks:
            question = f"a rematch, with the colours changed? say '{Word.NEW}' or '{Word.QUIT}'"
            self._ui.prompt(question, (Word.NEW, Word.QUIT), ())
        until = time.monotonic() + QUESTION
        while peer.there and (asks or (peer.they_ask is not False and time.monotonic() < until)):
            match opponent.next(POLL):
                case OfferAnswered(what=Offer.REMATCH, accepted=True):
                    self._ui.answered()
                    return True
                case OfferAnswered(what=Offer.REMATCH):
                    self._ui.say(f"{opponent.name} wants no rematch")
                    return False
                case Offered(what=Offer.REMATCH):
                    if asks:
                        self._ui.say(f"{opponent.name} proposes a rematch: say '{Word.NEW}' to accept")
                    else:
                        opponent.offer(Offer.REMATCH)
                case Notice(sentence):
                    self._ui.say(sentence)
                case _:
                    pass
            if asks and (answer := self._answer()) is not None:
                if answer is Word.QUIT:
                    opponent.decline(Offer.REMATCH)
                    return False
                opponent.offer(Offer.REMATCH)
                self._ui.phase("waiting for the other robot's answer")
        return False

    def _answer(self) -> Word | None:
        """What the person here wants, if they have said it; who is gone wants nothing more."""
        assert self._lines is not None
        try:
            line = self._lines.next(0.0)
        except PersonGone:
            return Word.QUIT
        word = None if line is None else word_of(line)
        if line is not None and word not in (Word.NEW, Word.QUIT):
            self._ui.say(f"say '{Word.NEW}' for a rematch, or '{Word.QUIT}'")
            return None
        return word


def run_linked_games(
    settings: Settings, ui: UserInterface, lines: Lines, secret: LinkSecret, ahead: RigAhead | None = None
) -> SessionResult:
    """Play against another robot: the host's settings say what, the guest's how it is played there.

    Args:
        settings: with the role of this robot.
        ui: shown what happens.
        lines: what is said here.
        secret: of both robots.
        ahead: the rig's processes, where they were started before all else.

    Raises:
        UserError: as ``run_games``, or the link cannot be made.
        EngineProblem: as ``run_games``.
    """
    folder = settings.out or (ahead and ahead.folder) or new_folder(GAMES, utc_now())
    settings = _prepared(settings).with_changes({"out": folder})
    make_folder(folder)
    with open_link(settings, folder, secret, _name(settings), ui.say) as link:
        ui.phase("waiting for the other robot")
        settings = agreed(settings, link.wait_for_game(ui.say))
        return _played(settings, link, ui, lines, lambda source, plies, players: run_remote_games(
            settings, ui, lines, source, ahead, plies=plies, players=players
        ))  # fmt: skip


def resume_linked_games(
    folder: Path, ui: UserInterface, lines: Lines, secret: LinkSecret, engines: Mapping[str, str] = NO_OTHERS
) -> SessionResult:
    """Go on with a game of two robots; what one has missed it hears from the other. Raises as ``run_linked_games``;
    engines as of ``resume_games``.
    """
    folder = match_of(folder)
    settings = kept_settings(folder)
    with open_link(settings, folder, secret, _name(settings), ui.say) as link:
        if link.peer.log.state.begin is None:
            raise UserError(f"the game in {folder} has not begun: start a new one")
        return _played(settings, link, ui, lines, lambda source, plies, players: resume_remote_games(
            folder, ui, lines, source, plies=plies, players=players, engines=engines
        ))  # fmt: skip


def agreed(settings: Settings, state: LinkedState) -> Settings:
    """The settings of this robot with what the host has begun."""
    begin, role = state.begin, settings.link.role
    assert begin is not None
    assert role is not None
    ours = "white" if state.colour(role) else "black"
    player = {f"{ours}.player": "human"} if settings.link.person else {}
    return settings.with_changes({
        "game.fen": begin.fen, "game.chess960": begin.chess960, "game.plies": begin.plies, "clock.time": begin.clock,
        **player,
    })  # fmt: skip


Playing = Callable[[LinkedSource, int, Callable[[ExitStack], Players] | None], SessionResult]


def _played(settings: Settings, link: RobotLink, ui: UserInterface, lines: Lines, play: Playing) -> SessionResult:
    """Play, and take leave of the other robot once it has all of it."""
    source = LinkedSource(link, ui, lines if settings.link.person else None)
    result = play(source, settings.game.plies, _line(settings))
    link.take_leave(
        result.report.exit_reason,
        lambda: ui.phase("waiting for the other robot to have the last move; Ctrl-C leaves at once"),
    )
    return result


def _line(settings: Settings) -> Callable[[ExitStack], Players] | None:
    """Whoever follows the line of the settings, if there is one."""
    if settings.game.moves is None or settings.link.person:
        return None
    board = start_board(settings.game.fen, chess960=settings.game.chess960)
    line = given_line(settings.game.moves, board)
    return lambda stack: stack.enter_context(line_players(board, line))


def _prepared(settings: Settings) -> Settings:
    """With what can be known before the other robot is there; the host's say exactly what is played.

    Raises:
        UserError: the settings cannot be those of two robots.
    """
    link = settings.link
    if settings.clock.arm_time is ArmTime.OWN:
        raise UserError("in a game of two robots nobody's clock runs while an arm moves: leave clock.arm_time out")
    if settings.game.from_board or settings.game.replay is not None:
        raise UserError("two robots begin with a position that both know: give it with --fen")
    if settings.game.plies > MOST_PLIES:
        raise UserError(f"--plies is {settings.game.plies}: two robots play at most {MOST_PLIES}")
    start_clock(settings)
    rig_setup = rig_setup_of(settings.rig, settings.vision.calibration)
    settings = completed(settings, rig_setup)
    changes: dict[str, object] = {
        "link.secret": None if link.secret is None else link.secret.absolute(),
        "link.identity": None if link.identity is None else link.identity.absolute(),
    }
    if settings.engine.nodes is None and settings.engine.move_time is None and settings.clock.time is None:
        changes["engine.move_time"] = MOVE_TIME
    if link.role is LinkRole.HOST:
        board = start_board(settings.game.fen, chess960=settings.game.chess960)
        changes["game.fen"] = board.fen()
        if settings.game.moves is not None:
            line = given_line(settings.game.moves, board)
            changes["game.plies"] = min(settings.game.plies, len(line))
    return settings.with_changes(changes)


def _name(settings: Settings) -> str:
    """Who plays here, for the records of both."""
    return printable(_full_name(settings), LONGEST_NAME)


def _full_name(settings: Settings) -> str:
    if settings.link.name is not None:
        return settings.link.name
    if settings.link.person:
        return PERSON
    if settings.game.moves is not None:
        return "line"
    name = "Stockfish" if settings.engine.path is None else Path(settings.engine.path).stem
    return name if settings.white.elo is None else f"{name} (Elo {settings.white.elo})"
