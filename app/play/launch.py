"""GameSeries from their settings: the demo of two engines, a game against a person, and going on with either."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import chess

from app import UserError
from app.game import Position
from app.motion import Profile
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.play.from_board import FromBoard
from app.play.game_setup import Opener, RigSetup, rig_setup_of, start_board
from app.play.games import GameSeries, first_board, from_found
from app.play.match import Match, Start, last_round, match_of, next_number
from app.play.session import Filming, Schedule, SessionResult, run_session
from app.play.simulated_hand import SimHands
from app.play.table_setup import TableSetup
from app.play.vision_setup import believed_camera, believed_view, looks, session_vision
from app.players.advice import Adviser, Advisers
from app.players.game_end import plies_in_words
from app.players.person import Human, Lines
from app.practice.coach import Coach
from app.practice.repertoire import RepertoireAdviser, load_repertoire
from app.records import EVENTS_FILE, GameRecord, History, new_folder, read_history, utc_now
from app.records.events import EndEvent
from app.records.files import GAMES, make_folder
from app.rig.devices import Rig
from app.rig.rig_file import RigFile
from app.rig.simulation.ahead import RigAhead
from app.settings.defaults import BOARD, SIMULATED, PlayerKind, Settings
from app.settings.files import keep_settings, kept_settings
from app.terminal.game_display import UserInterface
from app.terminal.shown import RigKind, SessionShown
from controller.wire.link import Listener
from hardware.piece_set import Colour

NO_OTHERS: Final[Mapping[str, str]] = MappingProxyType({})
"""The engines that a match began with."""


def run_games(
    settings: Settings, ui: UserInterface, lines: Lines | None = None, ahead: RigAhead | None = None
) -> SessionResult:
    """Play as the settings say.

    Args:
        settings: of rig, games and players.
        ui: shown what happens.
        lines: what the person at the board says; needed where one plays.
        ahead: the rig's processes, where they were started before all else.

    Raises:
        UserError: bad settings, something missing on this machine, or no space for the record.
        EngineProblem: Stockfish is missing or fails for good.
    """
    settings = decided(settings)
    rig_setup = replace(rig_setup_of(settings.rig, settings.vision.calibration), ahead=ahead)
    settings = completed(settings, rig_setup)
    folder = settings.out or (ahead and ahead.folder) or new_folder(GAMES, utc_now())
    with ExitStack() as stack:
        human = human_of(settings, rig_setup, folder, lines, stack)
        if settings.game.from_board:
            return _play_from_board(settings, rig_setup, folder, ui, human, stack, new=True)
        shown = show_session(settings, rig_setup, folder, human, ui, start_fen(settings))
        games = GameSeries(settings, rig_setup, ui, human, folder)
        match = stack.enter_context(_match(settings, rig_setup, games, folder, ui, lines))
        standing = None if settings.game.standing is None else start_board(settings.game.standing, option="--standing")
        board = match.start(lambda board: Inventory.of(start_layout(board, rig_setup.table), rig_setup.table), standing)
        keep_settings(folder, settings)
        rig = rig_setup.rig(folder, board, person_side(settings) or settings.rig.person)
        return run_session(
            folder,
            opening_rig(rig_setup, rig, ui, shown, stack, new=True),
            _keepable(settings, rig_setup, folder, ui, stack, human, match, games), rig_setup.parameters.drive.tick,
            filming_of(rig_setup, folder), ui,
            session_vision(settings, rig_setup, human, ui),
        )  # fmt: skip


def resume_games(
    folder: Path, ui: UserInterface, lines: Lines | None = None, engines: Mapping[str, str] = NO_OTHERS
) -> SessionResult:
    """Go on with what was interrupted, or whose program or controller died: first with the ply under way.

    Args:
        folder: of the match, or of one of its games.
        ui: as of ``run_games``.
        lines: as of ``run_games``.
        engines: other ones than before, by the dotted name of the setting; kept for whoever goes on later.

    Raises:
        UserError: the folder holds no such game, or the game is over; or as ``run_games``.
        EngineProblem: as ``run_games``.
    """
    folder = match_of(folder)
    settings = decided(kept_settings(folder).with_changes(engines))
    rig_setup = rig_setup_of(settings.rig, settings.vision.calibration)
    path, number, sets_up = last_round(folder)
    history = read_history(path / EVENTS_FILE, rig_setup.table, ui.say)
    if any(event.physical_ok is False for event in history.plies):
        raise UserError(f"a ply of the game in {path} left the board wrong, see its report: start a new one")
    sets_up = sets_up or not settings.game.plies
    position = Position.of(history)
    if settings.rig.name == BOARD:  # nothing stands anywhere: what was under way is done over
        position = position.from_the_start()
    with ExitStack() as stack:
        human = human_of(settings, rig_setup, folder, lines, stack)
        shown = show_session(settings, rig_setup, folder, human, ui)
        games = GameSeries(settings, rig_setup, ui, human, folder, begun=number)
        if not sets_up and is_over(history, games.most(number)) and games(number + 1, None) is None:
            raise UserError(f"the game in {path} is over after {plies_in_words(len(history.plies))}: start a new one")
        match = stack.enter_context(_match(settings, rig_setup, games, folder, ui, lines))
        match.go_on(Start(number, sets_up, GameRecord.go_on(path, history), position))
        if engines:  # they have started
            keep_settings(folder, settings)
        require_world(rig_setup, folder, history)
        return run_session(
            folder,
            opening_rig(rig_setup, rig_setup.rig(folder), ui, shown, stack, new=False),
            _keepable(settings, rig_setup, folder, ui, stack, human, match, games), rig_setup.parameters.drive.tick,
            None, ui, session_vision(settings, rig_setup, human, ui),
        )  # fmt: skip


def require_world(rig_setup: RigSetup, folder: Path, history: History) -> None:
    """Make sure that a world of our own is at least as old as the record."""
    if rig_setup.own:
        from app.rig.simulation.sim import require_present  # devices take seconds to load

        require_present(rig_setup.run_dir(folder), history.events[-1].plant_time, rig_setup.parameters.drive.tick)


def resume_from_board(
    folder: Path, ui: UserInterface, lines: Lines | None = None, engines: Mapping[str, str] = NO_OTHERS
) -> SessionResult:
    """Go on from whatever stands on the board, with another game in the same folder; its record need not be readable.

    Arguments as of ``resume_games``.

    Raises:
        UserError: the folder holds no game against a person, or as ``run_games``.
        EngineProblem: as ``run_games``.
    """
    folder = match_of(folder)
    settings = decided(kept_settings(folder).with_changes(engines))
    rig_setup = rig_setup_of(settings.rig, settings.vision.calibration)
    with ExitStack() as stack:
        human = human_of(settings, rig_setup, folder, lines, stack)
        return _play_from_board(settings, rig_setup, folder, ui, human, stack, new=False)


def _play_from_board(
    settings: Settings, rig_setup: RigSetup, folder: Path, ui: UserInterface, human: Human | None, stack: ExitStack, *,
    new: bool,
) -> SessionResult:  # fmt: skip
    """Ask what stands on the board, and play from there; not ``new``: in a world that is there already."""
    if human is None:
        raise UserError("--from-board is for games against a person, who says whose move it is: use 'touchmove play'")
    if not rig_setup.sees:
        raise UserError("--from-board needs a camera, and this rig has none: give the position with --fen")
    _require_players(settings, rig_setup, ui, human, folder)
    if new:
        make_folder(folder)
    else:
        keep_settings(folder, settings)  # the engines may be others than before
    standing = start_board(settings.game.standing, option="--standing") if new else None
    rig = rig_setup.rig(folder, standing, person_side(settings) or settings.rig.person)
    shown = show_session(settings, rig_setup, folder, human, ui)
    return run_session(
        folder,
        opening_rig(rig_setup, rig, ui, shown, stack, new=new),
        _from_board(settings, rig_setup, folder, ui, human, stack), rig_setup.parameters.drive.tick, None, ui,
        session_vision(settings, rig_setup, human, ui),
    )  # fmt: skip


def _from_board(
    settings: Settings, rig_setup: RigSetup, folder: Path, ui: UserInterface, human: Human, stack: ExitStack,
    match: Match | None = None, games: GameSeries | None = None,
) -> FromBoard:  # fmt: skip
    """Games from what stands on the board; after a match of ``games``, where a person keeps that."""

    def begin(board: chess.Board, inventory: Inventory, now: float) -> Match:
        nonlocal match, games
        before, person = settings if games is None else games.settings, None if match is None else match.person
        found, number = from_found(before, board, person), next_number(folder)
        games = GameSeries(
            found, rig_setup, ui, replace(human, colour=person_side(found) is Colour.WHITE), folder, begun=number
        )  # fmt: skip
        match = stack.enter_context(_match(found, rig_setup, games, folder, ui, human.lines))
        match.start(lambda _: inventory, None, number, now)
        keep_settings(folder, found)
        return match

    return FromBoard(human, ui, table_setup_of(settings, rig_setup, human, human.lines), rig_setup.table, begin, match)


def _keepable(
    settings: Settings, rig_setup: RigSetup, folder: Path, ui: UserInterface, stack: ExitStack, human: Human | None,
    match: Match, games: GameSeries,
) -> Schedule:  # fmt: skip
    """A match that a person may leave for a game from what stands on the board, where somebody sees that."""
    if human is None or not rig_setup.sees:
        return match
    return _from_board(settings, rig_setup, folder, ui, human, stack, match, games)


def _require_players(settings: Settings, rig_setup: RigSetup, ui: UserInterface, human: Human, folder: Path) -> None:
    """Find out before anything moves whether there are engines that can play."""
    fixture = GameSeries(settings, rig_setup, ui, human, folder)(1, None)
    assert fixture is not None, "a match has at least one game"
    with ExitStack() as stack:
        fixture.players(stack)


def is_over(history: History, most: int) -> bool:
    """Whether a game had its result, or as many plies as it may have."""
    last = history.events[-1]
    decided = isinstance(last, EndEvent) and last.result != "*"
    return history.ended and history.unfinished is None and (decided or len(history.plies) >= most)


def _match(
    settings: Settings, rig_setup: RigSetup, games: GameSeries, folder: Path, ui: UserInterface, lines: Lines | None
) -> Match:
    table_setup = table_setup_of(settings, rig_setup, games.human, lines)
    return Match(folder, games, table_setup, ui, settings.rig.seed, rig_setup.pace)


def table_setup_of(settings: Settings, rig_setup: RigSetup, human: Human | None, lines: Lines | None) -> TableSetup:
    """What all tables of a rig have in common, whoever plays there and says something."""
    follows = looks(settings, rig_setup, human)
    return TableSetup(
        rig_setup.motion,
        rig_setup.parameters,
        follows,
        lambda intrinsics: believed_view(rig_setup, intrinsics),
        lambda: believed_camera(rig_setup),
        lines,
    )


def decided(settings: Settings) -> Settings:
    """With what was left out about safety: whether hands are watched for, and how fast the arm then moves."""
    rig, guard, own = settings.rig, settings.vision.guard, settings.rig.name == SIMULATED
    if guard is None and own:
        guard = rig.cameras and person_side(settings) is not None
    watched = Profile.SEPARATION if own and guard else Profile.DEFAULT
    return settings.with_changes({"vision.guard": guard, "rig.profile": rig.profile or watched})


def completed(settings: Settings, rig_setup: RigSetup) -> Settings:
    """With what the rig says, and with paths that hold for any working directory."""
    if settings.game.fen is None and rig_setup.fen is not None:
        settings = settings.with_changes({"game.fen": rig_setup.fen})
    paths = {
        "game.replay": settings.game.replay, "vision.calibration": settings.vision.calibration,
        "rig.randomise": settings.rig.randomise, "engine.book": settings.engine.book,
        "white.book": settings.white.book, "black.book": settings.black.book, "page.password": settings.page.password,
        "practice.repertoire": settings.practice.repertoire, "practice.puzzles": settings.practice.puzzles,
        "engine.syzygy": settings.engine.syzygy,
    }  # fmt: skip
    settings = settings.with_changes({name: path.absolute() for name, path in paths.items() if path is not None})
    engines = {
        "engine.path": settings.engine.path,
        "white.path": settings.white.path,
        "black.path": settings.black.path,
    }
    settings = settings.with_changes(
        {name: engine_from_anywhere(path) for name, path in engines.items() if path is not None}
    )
    if rig_setup.file is not None and not rig_setup.own:
        settings = settings.with_changes({"rig.name": str(Path(settings.rig.name).absolute())})
    return settings


def engine_from_anywhere(path: str) -> str:
    """The path of an engine, for any working directory; a name alone is looked for on PATH."""
    return str(Path(path).absolute()) if "/" in path else path


def person_side(settings: Settings) -> Colour | None:
    """The side that a person plays; of two people that of the hand which moves all pieces."""
    humans = [colour for colour in Colour if settings.side(colour is Colour.WHITE).player is PlayerKind.HUMAN]
    return humans[0] if humans else None


def human_of(
    settings: Settings, rig_setup: RigSetup, folder: Path, lines: Lines | None, stack: ExitStack
) -> Human | None:
    """The person who plays here by the settings; a simulated hand of theirs is closed with the stack.

    Raises:
        UserError: they could not say anything, or there are two.
    """
    colour = person_side(settings)
    if colour is None:
        return None
    if lines is None:
        raise UserError("a person plays with 'touchmove play': use that, or let an engine play both sides")
    hands = None
    if rig_setup.own:
        hands = SimHands(rig_setup.run_dir(folder))
        stack.callback(hands.close)
    return Human(colour is Colour.WHITE, lines, hands, adviser=_adviser(settings, stack), both=settings.two_people)


def _adviser(settings: Settings, stack: ExitStack) -> Adviser | None:
    """Who says something of the person's moves.

    Raises:
        UserError: the repertoire cannot be read.
        EngineProblem: a coach needs an engine, and there is none.
    """
    practice = settings.practice
    advisers = list[Adviser]()
    if practice.repertoire is not None:
        advisers.append(RepertoireAdviser(load_repertoire(practice.repertoire)))
    if practice.coach:
        advisers.append(stack.enter_context(Coach(settings.engine.path)))
    return Advisers(advisers) if advisers else None


def opening_rig(
    rig_setup: RigSetup, rig: RigFile | None, ui: UserInterface, shown: SessionShown, stack: ExitStack, *, new: bool
) -> Opener:
    """Opens the rig, which begins to start now, and shows what it is; arguments as of ``RigSetup.begin``."""
    opener = rig_setup.begin(rig, ui.phase, stack, new=new)

    def opened(listener: Listener | None) -> Rig:
        found = opener(listener)
        ui.session(replace(shown, controller=found.controller, live=found.film))
        sees = "looks at the board" if found.camera is not None else "there is none: moves are typed, not seen"
        ui.device("camera", None if found.camera is None else True, sees)
        return found

    return opened


def show_session(
    settings: Settings,
    rig_setup: RigSetup,
    folder: Path,
    human: Human | None,
    ui: UserInterface,
    start: str | None = None,
) -> SessionShown:
    """Show what is going to be played, before anything slow; ``start``: FEN, where that is known."""
    kind: RigKind = "board" if rig_setup.file is None else "sim" if rig_setup.own else "lab"
    shown = SessionShown(
        folder, kind, rig_setup.pace, rig_setup.parameters.drive.tick, person_side(settings),
        human is not None and human.hands is not None, rig_setup.sees, start=start,
    )  # fmt: skip
    ui.session(shown)
    return shown


def start_fen(settings: Settings) -> str | None:
    """What the first game begins from, where the settings say it."""
    game = settings.game
    unknown = game.replay is not None or settings.practice.puzzles is not None
    return None if unknown else first_board(settings).fen()


def filming_of(rig_setup: RigSetup, folder: Path) -> Filming | None:
    """The film of a simulated world, as the settings say; None: none is made."""
    section = rig_setup.section
    filmed = section.video and section.cameras
    if not (rig_setup.simulated and (filmed or section.positions)):
        return None
    return Filming(folder, section.video_length if filmed else None)
