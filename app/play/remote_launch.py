"""Games against opponents elsewhere from their settings, and going on with one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import chess

from app import UserError
from app.game import Position
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.play.game_setup import RigSetup, rig_setup_of, start_board
from app.play.launch import (
    NO_OTHERS,
    completed,
    decided,
    filming_of,
    human_of,
    is_over,
    opening_rig,
    person_side,
    require_world,
    show_session,
    start_fen,
    table_setup_of,
)
from app.play.match import Match, Start, last_round, match_of
from app.play.player_selection import engine_of_both
from app.play.remote_games import ENDLESS, OpponentSource, RemoteSchedule, RemoteSeries, SeatedInterface
from app.play.session import SessionResult, run_session
from app.play.vision_setup import session_vision
from app.players.person import Human, Lines
from app.players.players import Players
from app.records import EVENTS_FILE, GameRecord, new_folder, read_history, utc_now
from app.records.files import GAMES, make_folder
from app.rig.simulation.ahead import RigAhead
from app.settings.defaults import BOARD, Settings
from app.settings.files import keep_settings, kept_settings
from app.terminal.game_display import UserInterface


def run_remote_games(
    settings: Settings, ui: UserInterface, lines: Lines, source: OpponentSource, ahead: RigAhead | None = None, *,
    plies: int = ENDLESS, players: Callable[[ExitStack], Players] | None = None,
) -> SessionResult:  # fmt: skip
    """Play against opponents who sit somewhere else: a person here, if one plays, else the engine of White's settings.

    Args:
        settings: as of ``run_games``; where all games begin, too.
        ui: as of ``run_games``.
        lines: what is said here.
        source: of opponents.
        ahead: as of ``run_games``.
        plies: each game ends after so many in any case.
        players: makes whoever plays here, where no person does; None: the engine.

    Raises:
        UserError: as ``run_games``, or no opponent was found.
        EngineProblem: as ``run_games``.
    """
    settings = decided(settings)
    rig_setup = replace(rig_setup_of(settings.rig, settings.vision.calibration), ahead=ahead)
    settings = completed(settings, rig_setup)
    folder = settings.out or (ahead and ahead.folder) or new_folder(GAMES, utc_now())
    ui = SeatedInterface(ui)
    with ExitStack() as stack:
        human = human_of(settings, rig_setup, folder, lines, stack)
        shown = show_session(settings, rig_setup, folder, human, ui, start_fen(settings))
        ui.wait()
        match, board = _remote_match(
            settings, rig_setup, folder, ui, lines, human, source, stack, plies, players
        )  # fmt: skip
        make_folder(folder)
        keep_settings(folder, settings)

        def begin(now: float) -> None:
            match.start(lambda board: Inventory.of(start_layout(board, rig_setup.table), rig_setup.table), None, 1, now)

        rig = rig_setup.rig(folder, board, person_side(settings) or settings.rig.person)
        return run_session(
            folder, opening_rig(rig_setup, rig, ui, shown, stack, new=True), RemoteSchedule(match, begin),
            rig_setup.parameters.drive.tick, filming_of(rig_setup, folder), ui,
            session_vision(settings, rig_setup, human, ui),
        )  # fmt: skip


def resume_remote_games(
    folder: Path, ui: UserInterface, lines: Lines, source: OpponentSource, *, plies: int = ENDLESS,
    players: Callable[[ExitStack], Players] | None = None, engines: Mapping[str, str] = NO_OTHERS,
) -> SessionResult:  # fmt: skip
    """Go on with a game against somebody elsewhere, whom ``source`` finds again; arguments as of ``run_remote_games``
    and ``resume_games``, raises as the latter.
    """
    folder = match_of(folder)
    settings = decided(kept_settings(folder).with_changes(engines))
    rig_setup = rig_setup_of(settings.rig, settings.vision.calibration)
    path, number, sets_up = last_round(folder)
    history = read_history(path / EVENTS_FILE, rig_setup.table, ui.say)
    position = Position.of(history)
    if settings.rig.name == BOARD:
        position = position.from_the_start()
    if not sets_up and is_over(history, plies):
        raise UserError(f"the game in {path} is over after {len(history.plies)} plies: start a new one")
    ui = SeatedInterface(ui)
    with ExitStack() as stack:
        human = human_of(settings, rig_setup, folder, lines, stack)
        shown = show_session(settings, rig_setup, folder, human, ui)
        ui.wait()
        match, _ = _remote_match(settings, rig_setup, folder, ui, lines, human, source, stack, plies, players)
        start = Start(number, sets_up, GameRecord.go_on(path, history), position)
        require_world(rig_setup, folder, history)

        def go_on(_now: float) -> None:
            match.go_on(start)
            if engines:  # they have started
                keep_settings(folder, settings)

        return run_session(
            folder, opening_rig(rig_setup, rig_setup.rig(folder), ui, shown, stack, new=False),
            RemoteSchedule(match, go_on), rig_setup.parameters.drive.tick, None, ui,
            session_vision(settings, rig_setup, human, ui),
        )  # fmt: skip


def _remote_match(
    settings: Settings, rig_setup: RigSetup, folder: Path, ui: SeatedInterface, lines: Lines, human: Human | None,
    source: OpponentSource, stack: ExitStack, plies: int, chosen: Callable[[ExitStack], Players] | None,
) -> tuple[Match, chess.Board]:  # fmt: skip
    """Games against opponents elsewhere, and where they begin."""
    board = start_board(settings.game.fen, chess960=settings.game.chess960)

    def players(stack: ExitStack) -> Players:
        if chosen is not None and human is None:
            return chosen(stack)
        return stack.enter_context(
            Players(None, None) if human is not None else engine_of_both(settings, stack, ui, rig_setup.pace)
        )

    series = RemoteSeries(source, board, human, players, ui.seat, ui.wait, plies)
    table_setup = table_setup_of(settings, rig_setup, human, lines)
    match = Match(folder, series, table_setup, ui, settings.rig.seed, rig_setup.pace)
    return stack.enter_context(match), board
