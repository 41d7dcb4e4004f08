"""The demo: two engine players, or a given line, on one arm."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import chess
from pydantic import JsonValue

from app import UserError
from app.faces import Face
from app.game import EXPECTED_FAILURES, Devices, Game, GameEnd
from app.layout import start_layout
from app.lines import parse_line
from app.manipulation import Inventory
from app.motion import MotionSettings
from app.players import EnginePlayer, LinePlayer, Player
from app.records import GameRecord, GameSetup, RecordError, Report, new_folder, utc_now
from app.records.telemetry import TELEMETRY_FILE, TelemetryRecorder
from app.rig import SimRig, SimRigSettings
from app.video import Film
from controller.settings import ControllerSettings
from engine.errors import EngineProblem
from engine.openings import opening_engine, varied_opening
from engine.stockfish import Engine, EngineSettings
from hardware.parameters import load_parameters
from hardware.sim.settings import Pace, WorldSettings
from hardware.table import TableSettings

OPENING_PLIES = 8
HASH_MB = 16


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """What ``touchmove demo`` was asked for; units as on the command line."""

    plies: int
    pace: Pace
    seed: int
    fen: str | None
    moves: str | None
    white_elo: int | None
    black_elo: int | None
    move_time: float | None
    nodes: int | None
    engine: str | None
    out: Path | None
    video: bool
    video_length: float
    linger: float
    port: int


@dataclass(frozen=True, slots=True)
class DemoResult:
    """The report, where it lies, and whether everything held."""

    report: Report
    folder: Path
    holds: bool


def run_demo(options: DemoOptions, face: Face) -> DemoResult:
    """Play one game.

    Raises:
        UserError: bad options, something missing on this machine, or no space for the record.
        EngineProblem: Stockfish is missing or fails for good.
    """
    board = _start_board(options.fen)
    line = parse_line(options.moves, board) if options.moves is not None else None
    table = TableSettings()
    inventory = Inventory.of(start_layout(board, table), table)
    with ExitStack() as stack:
        players = _players(options, board, line, stack, face)
        folder = options.out if options.out is not None else new_folder(Path("games"), utc_now())
        setup = GameSetup(players[chess.WHITE].name, players[chess.BLACK].name, options.seed, options.pace.value)
        record = stack.enter_context(GameRecord(folder, setup, board, inventory, 0.0))
        motion = MotionSettings()
        settings = SimRigSettings(
            world=WorldSettings(
                pieces=tuple(inventory), home=motion.home, table=table, pace=options.pace, seed=options.seed,
                linger=options.linger,
            ),
            controller=ControllerSettings(linger=max(options.linger, 1e-3), port=options.port),
        )  # fmt: skip
        return _on_rig(options, board, inventory, players, record, settings, motion, face)


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
    options: DemoOptions, board: chess.Board, line: tuple[chess.Move, ...] | None, stack: ExitStack, face: Face
) -> dict[chess.Color, Player]:
    if line is not None:
        follower = LinePlayer(board, line)
        return {chess.WHITE: follower, chess.BLACK: follower}
    engines = {chess.WHITE: options.white_elo, chess.BLACK: options.black_elo}
    if options.nodes is not None and any(elo is not None for elo in engines.values()):
        raise UserError("--nodes is for repeatable games at full strength: leave --white-elo and --black-elo out")
    face.phase("starting Stockfish")
    opening = () if options.fen is not None else _opening(options, board)
    players: dict[chess.Color, Player] = {}
    for colour, elo in engines.items():
        engine = stack.enter_context(Engine(_engine_settings(options, elo)))
        name = "Stockfish" if elo is None else f"Stockfish (Elo {elo})"
        players[colour] = LinePlayer(board, opening, EnginePlayer(engine, name))
    return players


def _engine_settings(options: DemoOptions, elo: int | None) -> EngineSettings:
    move_time = None if options.nodes is not None else options.move_time
    return EngineSettings(path=options.engine, elo=elo, hash_mb=HASH_MB, move_time=move_time, nodes=options.nodes)


def _opening(options: DemoOptions, board: chess.Board) -> tuple[chess.Move, ...]:
    with opening_engine(_engine_settings(options, None)) as engine:
        return varied_opening(engine, board, min(OPENING_PLIES, options.plies), random.Random(options.seed))


FAILED = GameEnd("*", "failed", complete=False)


@dataclass(slots=True)
class _Course:
    """How a game went so far, whatever ends it."""

    end: GameEnd = FAILED
    failures: list[str] = field(default_factory=list)
    interrupted: bool = False
    plant_time: float = 0.0
    speed: float | None = None
    world_state: str | None = None


def _on_rig(
    options: DemoOptions,
    board: chess.Board,
    inventory: Inventory,
    players: dict[chess.Color, Player],
    record: GameRecord,
    settings: SimRigSettings,
    motion: MotionSettings,
    face: Face,
) -> DemoResult:
    course = _Course()
    run_dir = record.folder / "run"
    parameters = load_parameters(settings.world.parameters_file)
    telemetry = TelemetryRecorder(record.folder / TELEMETRY_FILE, parameters.drive.tick)
    with telemetry, SimRig(run_dir, settings, face.phase, telemetry.take) as rig:
        devices = Devices(rig.arm, rig.clock, rig.camera, rig.referee)
        game = Game(board, inventory, players, devices, record, face, motion, parameters)
        try:
            with _filming(options, run_dir, record.folder, parameters.drive.tick):
                course.end = game.play(options.plies)
            _take_stock(rig, course)
        except KeyboardInterrupt:
            course.end, course.interrupted = GameEnd("*", "interrupted", complete=False), True
        except RecordError:
            raise
        except (*EXPECTED_FAILURES, EngineProblem) as error:
            course.failures.append(rig.failure() or str(error))
        face.phase("the arm goes to rest")
        last = rig.close()
    if last is None or not last.at_rest:
        course.failures.append("the arm did not come to rest on its brakes")
    details: dict[str, JsonValue] = {"thinking_s": round(game.thinking, 3)}
    report = record.end(
        course.end.result, course.end.reason, course.plant_time, failures=course.failures, speed=course.speed,
        world_state=course.world_state, details=details,
    )  # fmt: skip
    if course.interrupted:
        raise KeyboardInterrupt
    holds = course.end.complete and not course.failures and report.physical_ok is not False
    return DemoResult(report, record.folder, holds)


def _take_stock(rig: SimRig, course: _Course) -> None:
    """The world's last state; once plant time stands, so that a repeated run ends in the same tick."""
    rig.arm.state()
    truth, run = rig.referee.look()
    course.speed, course.world_state, course.plant_time = run.ratio, truth.state_sha256, rig.clock.now()


@contextmanager
def _filming(options: DemoOptions, run_dir: Path, folder: Path, tick: float) -> Iterator[None]:
    length, path = options.video_length, folder / "game.webm"
    film = Film(run_dir, path, length, options.pace, tick) if options.video else None
    try:
        yield
    finally:
        if film is not None:
            film.finish()
