"""The demo: two engine players, or a given line, on one arm."""

from __future__ import annotations

import random
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Final

import chess
from pydantic import BaseModel, ConfigDict, ValidationError

from app import UserError
from app.config import SIMULATED, RigFile, load_randomisation
from app.faces import Face
from app.game import Game, Position
from app.layout import start_layout
from app.lines import parse_line
from app.manipulation import Inventory
from app.motion import PROFILES, Profile, contact_limits
from app.players import EnginePlayer, LinePlayer, Player, Players
from app.processes import GAMES
from app.records import EVENTS_FILE, GameRecord, GameSetup, PlyEvent, new_folder, read_history, utc_now
from app.records.files import write_atomically
from app.rig import choose_rig, open_rig
from app.session import Filming, SessionResult, run_session
from app.sim_rig import SimRigSettings
from controller.model.constants import DeltaModel
from controller.model.workspace import BoardDoesNotFit, seated
from controller.settings import ControllerSettings
from engine.openings import opening_engine, varied_opening
from engine.stockfish import Engine, EngineSettings
from hardware.parameters import DEFAULT_FILE, FLAT_PADS_FILE, load_parameters
from hardware.sim.randomisation import Randomisation
from hardware.sim.settings import Pace, WorldSettings
from hardware.table import PIECE_SHAPES, Captured, TableSettings

OPENING_PLIES = 8
HASH_MB = 16
OPTIONS_FILE: Final = "demo.json"
"""In the folder of a game: what it was started with."""


class PadKind(StrEnum):
    """What the fingers of a simulation of our own end in."""

    GROOVED = "grooved"
    """V-grooves, which centre round stems."""
    FLAT = "flat"
    """Flat rubber."""


_ROBOTS: Final = {PadKind.GROOVED: DEFAULT_FILE, PadKind.FLAT: FLAT_PADS_FILE}


class DemoOptions(BaseModel):
    """What ``touchmove demo`` was asked for; units as on the command line. Kept in the folder of the game."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    plies: int = 300
    pace: Pace | None = None
    """Of a simulation of our own; None: real. A rig file says its own."""
    seed: int = 1
    fen: str | None = None
    moves: str | None = None
    white_elo: int | None = None
    black_elo: int | None = None
    move_time: float | None = 0.2
    nodes: int | None = None
    engine: str | None = None
    out: Path | None = None
    video: bool = True
    video_length: float = 40.0
    linger: float = 30.0
    port: int = 0
    rig: str = SIMULATED
    profile: Profile = Profile.DEFAULT
    square: float | None = None
    """Side of a square of a simulation of our own [mm]; None: the default one."""
    pads: PadKind = PadKind.GROOVED
    randomise: Path | None = None
    """File that says how a simulation of our own differs from what the game believes."""
    captured: Captured | None = None
    """Where captured pieces go on the table of a simulation of our own; None: to trays. A rig file says its own."""
    journal: bool = False
    """A simulation of our own keeps every command, so that it can be done again."""


def run_demo(options: DemoOptions, face: Face) -> SessionResult:
    """Play one game.

    Raises:
        UserError: bad options, something missing on this machine, or no space for the record.
        EngineProblem: Stockfish is missing or fails for good.
    """
    rig = choose_rig(options.rig)
    if rig is not None and options.pace not in (None, rig.pace):
        raise UserError(f"rig {options.rig} runs in pace {rig.pace}: leave --pace out, or change its file")
    if rig is not None and options.captured not in (None, rig.table.captured):
        raise UserError(
            f"on the table of rig {options.rig} captured pieces go to a {rig.table.captured}: leave --captured out, or "
            "change its file"
        )
    if rig is not None and rig.simulated and options.fen is None:
        options = options.model_copy(update={"fen": rig.world_section.fen})
    pace = rig.pace if rig is not None else options.pace or Pace.REAL
    board = _start_board(options.fen)
    line = parse_line(options.moves, board) if options.moves is not None else None
    table = _table(options) if rig is None else rig.table
    inventory = Inventory.of(start_layout(board, table), table)
    with ExitStack() as stack:
        players = _players(options, board, line, stack, face, pace)
        folder = options.out if options.out is not None else new_folder(GAMES, utc_now())
        setup = GameSetup(players.name(chess.WHITE), players.name(chess.BLACK), options.seed, pace.value)
        record = stack.enter_context(GameRecord.begin(folder, setup, board, inventory, 0.0))
        kept = options if rig is None else options.model_copy(update={"rig": str(Path(options.rig).absolute())})
        write_atomically(folder / OPTIONS_FILE, kept.model_dump_json(indent=2) + "\n")
        world = _simulation(options, inventory, pace) if rig is None else None
        return _play(options, rig, world, players, record, Position(board, inventory), face)


def resume_demo(folder: Path, face: Face) -> SessionResult:
    """Go on with a game that was interrupted, or whose program or controller died: first with the ply under way.

    Raises:
        UserError: the folder holds no such game, or the game is over; or as ``run_demo``.
        EngineProblem: as ``run_demo``.
    """
    options = _read_options(folder)
    rig = choose_rig(options.rig)
    table = _table(options) if rig is None else rig.table
    history = read_history(folder / EVENTS_FILE, table)
    if any(isinstance(event, PlyEvent) and event.physical_ok is False for event in history.events):
        raise UserError(f"a ply of the game in {folder} left the board wrong, see its report: start a new one")
    board = _start_board(options.fen)
    line = parse_line(options.moves, board) if options.moves is not None else None
    most = options.plies if line is None else min(options.plies, len(line))
    if history.plies >= most or history.board.is_game_over(claim_draw=True):
        raise UserError(f"the game in {folder} is over, after {history.plies} plies: start a new one")
    with ExitStack() as stack:
        pace = rig.pace if rig is not None else options.pace or Pace.REAL
        players = _players(options, board, line, stack, face, pace, opened=history.plies > 0)
        record = stack.enter_context(GameRecord.go_on(folder, history))
        position = Position(history.board, history.inventory, True, history.unfinished)
        return _play(options, rig, None, players, record, position, face)


def _play(
    options: DemoOptions,
    rig: RigFile | None,
    world: SimRigSettings | None,
    players: Players,
    record: GameRecord,
    position: Position,
    face: Face,
) -> SessionResult:
    """On the rig, from a position on; ``world`` None: what runs, or was left, in the folder's run directory."""
    run_dir = record.folder / "run"
    parameters = load_parameters(_ROBOTS[options.pads] if rig is None else rig.parameters)
    filmed = options.video and not position.begun and (rig is None or rig.simulated)
    pace = Pace(record.start.pace)
    at = run_dir if rig is None else rig.run_dir
    filming = Filming(at, record.folder / "game.webm", options.video_length, pace) if filmed else None
    motion = PROFILES[options.profile].at(position.inventory.table)
    return run_session(
        lambda listener: open_rig(rig, run_dir, world, face.phase, listener),
        lambda devices: Game(position, players, devices, record, face, motion, parameters),
        options.plies, record, parameters.drive.tick, filming, face,
    )  # fmt: skip


def _table(options: DemoOptions) -> TableSettings:
    """Of a simulation of our own; with larger squares it stands nearer to the robot.

    Raises:
        UserError: the arm does not reach a board of such squares anywhere.
    """
    table = TableSettings(limits=contact_limits(options.profile), captured=options.captured or Captured.TRAY)
    if options.square is None:
        return table
    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    robot = DeltaModel(load_parameters(_ROBOTS[options.pads]), heaviest)
    try:
        return seated(robot, table.model_copy(update={"square": 1e-3 * options.square}))
    except BoardDoesNotFit as error:
        raise UserError(f"--square: {error}") from error


def _simulation(options: DemoOptions, inventory: Inventory, pace: Pace) -> SimRigSettings:
    randomisation = Randomisation() if options.randomise is None else load_randomisation(options.randomise)
    home = PROFILES[options.profile].at(inventory.table).home
    return SimRigSettings(
        world=WorldSettings(
            pieces=tuple(inventory), home=home, table=inventory.table, pace=pace, seed=options.seed,
            randomisation=randomisation, parameters_file=_ROBOTS[options.pads], linger=options.linger,
            journal=options.journal,
        ),
        controller=ControllerSettings(linger=max(options.linger, 1e-3), port=options.port),
    )  # fmt: skip


def _read_options(folder: Path) -> DemoOptions:
    path = folder / OPTIONS_FILE
    try:
        return DemoOptions.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): name the folder of a game") from error
    except ValidationError as error:
        raise UserError(f"{path} is of another version: go on with the version that wrote it") from error


def _start_board(fen: str | None) -> chess.Board:
    try:
        board = chess.Board(fen) if fen is not None else chess.Board()
    except ValueError as error:
        raise UserError(f"--fen is no position: {error}") from error
    if not board.is_valid():
        problems = ", ".join(str(flag.name).lower().replace("_", " ") for flag in board.status())
        raise UserError(f"--fen is no legal position ({problems}): {fen}: set it up in any chess program and copy it")
    return board


def _players(
    options: DemoOptions,
    board: chess.Board,
    line: tuple[chess.Move, ...] | None,
    stack: ExitStack,
    face: Face,
    pace: Pace,
    *,
    opened: bool = False,
) -> Players:
    """Who plays which colour; ``opened``: the opening is not chosen any more."""
    if line is not None:
        follower = LinePlayer(board, line)
        return stack.enter_context(Players(follower, follower))
    engines = {chess.WHITE: options.white_elo, chess.BLACK: options.black_elo}
    if options.nodes is not None and any(elo is not None for elo in engines.values()):
        raise UserError("--nodes is for repeatable games at full strength: leave --white-elo and --black-elo out")
    face.phase("starting Stockfish")
    opening = () if opened or options.fen is not None else _opening(options, board)
    players = dict[chess.Color, Player]()
    for colour, elo in engines.items():
        engine = stack.enter_context(Engine(_engine_settings(options, elo)))
        name = "Stockfish" if elo is None else f"Stockfish (Elo {elo})"
        players[colour] = LinePlayer(board, opening, EnginePlayer(engine, name))
    return stack.enter_context(Players(players[chess.WHITE], players[chess.BLACK], ahead=pace is Pace.REAL))


def _engine_settings(options: DemoOptions, elo: int | None) -> EngineSettings:
    move_time = None if options.nodes is not None else options.move_time
    return EngineSettings(path=options.engine, elo=elo, hash_mb=HASH_MB, move_time=move_time, nodes=options.nodes)


def _opening(options: DemoOptions, board: chess.Board) -> tuple[chess.Move, ...]:
    with opening_engine(_engine_settings(options, None)) as engine:
        return varied_opening(engine, board, min(OPENING_PLIES, options.plies), random.Random(options.seed))
