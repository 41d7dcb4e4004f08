"""What a game is played on: rig, table, robot and how it moves, as the settings say; and opening it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import chess

from app import UserError
from app.motion import PROFILES, MotionSettings, Profile, contact_speeds
from app.rig.board import BoardRig
from app.rig.devices import Rig
from app.rig.rig_file import RigFile, load_rig
from app.rig.simulation.ahead import RigAhead
from app.rig.simulation.settings import rig_for_game
from app.settings.defaults import BOARD, SIMULATED, PadKind, RigSection
from controller.wire.link import Listener
from hardware.interfaces import Pace
from hardware.parameters import DEFAULT_FILE, FLAT_PADS_FILE, RobotParameters, load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour
from hardware.table import Captured, TableSettings

if TYPE_CHECKING:
    from app.settings.calibration import Calibration

Opener = Callable[[Listener | None], Rig]
"""Opens a rig, given a listener of the controller's telemetry, which is called in a thread of its own."""
_ROBOTS: Final = {PadKind.GROOVED: DEFAULT_FILE, PadKind.FLAT: FLAT_PADS_FILE}


@dataclass(frozen=True, slots=True)
class RigSetup:
    """A rig, not open yet, and what is known of it.

    Attributes:
        section: the settings it follows from.
        file: the rig file; that of a simulation of our own is finished by ``rig``; None for the rig ``board``.
        table: board and trays, where they were found.
        parameters: of the robot.
        motion: how the arm moves there.
        pace: how plant time goes.
        calibration: of the camera; None: there is none.
        meant: where the table is meant to stand: that of a simulation of our own.
        ahead: its processes, where they were started before all else.
    """

    section: RigSection
    file: RigFile | None
    table: TableSettings
    parameters: RobotParameters
    motion: MotionSettings
    pace: Pace
    calibration: Calibration | None
    meant: TableSettings
    ahead: RigAhead | None = None

    @property
    def own(self) -> bool:
        """Whether it is a simulation of our own, started with the game and ended with it."""
        return self.section.name == SIMULATED

    @property
    def simulated(self) -> bool:
        """Whether a simulated world, whosever, is behind it."""
        return self.file is not None and self.file.simulated

    @property
    def sees(self) -> bool:
        """Whether it has a camera."""
        return self.file is not None and self.file.sees

    @property
    def fen(self) -> str | None:
        """What stands on the board if nobody says otherwise; None: the usual position."""
        return self.file.world_section.fen if self.file is not None and self.file.simulated else None

    def run_dir(self, folder: Path) -> Path:
        """Run directory of the world and the controller, for a game in this folder."""
        return folder / "run" if self.file is None or self.own else self.file.run_dir

    def rig(self, folder: Path, board: chess.Board | None = None, person: Colour | None = None) -> RigFile | None:
        """The rig file for a game in a folder; None for the rig ``board``.

        Args:
            folder: of the game.
            board: what a simulation of our own sets up; None: the pieces stand there already.
            person: whose simulated hand plays; None: nobody sits there.

        Raises:
            UserError: the file of ``randomise`` is wrong.
        """
        if self.file is None or not self.own:
            return self.file
        return rig_for_game(self.section, self.run_dir(folder), board, self.meant, self.file.parameters, person)

    def begin(self, rig: RigFile | None, progress: Callable[[str], None], stack: ExitStack, *, new: bool) -> Opener:
        """Have the rig's processes start, and say how to open it.

        Args:
            rig: its file, for this game.
            progress: told what is being waited for.
            stack: ends what has begun, whether it was opened or not.
            new: False takes over what runs, or was left, of a simulation of our own.

        Returns:
            Given a listener of the controller's telemetry, which is called in a thread of its own, the rig as soon as
            the arm holds.

        Raises:
            RigFailed: something did not start or answer, then or now.
        """
        if rig is None:
            return lambda _listener: BoardRig(self.motion.home, self.parameters)
        if not self.own:
            return lambda listener: _open_remote(rig, progress, listener)
        from app.rig.simulation.sim import SimRig

        begun = SimRig.begin(rig, progress, new=new, ahead=self.ahead)
        stack.callback(begun.close)
        # where nothing is compiled yet, what is for this process alone goes first: the controller's compiles the rest
        import app.motion.timing.time_law  # noqa: F401

        if self.sees:
            import vision.loops  # noqa: F401

        def connected(listener: Listener | None) -> Rig:
            import app.execution.recovery
            import app.motion.planner  # noqa: F401

            return begun.connect(progress, listener)

        return connected


def _open_remote(rig: RigFile, progress: Callable[[str], None], listener: Listener | None) -> Rig:
    # what plans takes seconds to load, or to compile the first time: later, that would hold heartbeats up
    import app.motion.planner  # noqa: F401
    from app.rig.factory import open_rig  # devices take seconds to load

    return open_rig(rig, progress, listener)


def rig_setup_of(section: RigSection, calibration_file: Path | None = None) -> RigSetup:
    """Find out what a rig is made of.

    Args:
        section: of the settings.
        calibration_file: how the camera hangs; None: as the rig file says, where it has been calibrated.

    Raises:
        UserError: there is no such rig, something in its file or its calibration is wrong, it contradicts the other
            settings, or the arm does not reach a board of such squares anywhere.
    """
    robot, own = _ROBOTS[section.pads], section.name == SIMULATED
    file: RigFile | None = None
    if section.name == BOARD:
        meant, pace = _own_table(section), section.pace or Pace.FAST
    else:
        file = rig_for_game(section, Path("run"), None, _own_table(section), robot) if own else _rig_file(section)
        meant, pace = file.table, file.pace
        if calibration_file is None and not own and file.calibration.exists():
            calibration_file = file.calibration
    calibration, table = None, meant
    if calibration_file is not None:
        from app.settings.calibration import load_calibration  # what sees takes a second to load

        calibration = load_calibration(calibration_file)
        table = calibration.table(meant)
    # home stays where it is meant to be: a simulation of our own begins there
    motion = PROFILES[section.profile or Profile.DEFAULT].at(meant)
    parameters = load_parameters(robot) if file is None else file.robot()
    return RigSetup(section, file, table, parameters, motion, pace, calibration, meant)


def _rig_file(section: RigSection) -> RigFile:
    rig = load_rig(Path(section.name))
    if section.pace not in (None, rig.pace):
        raise UserError(f"rig {section.name} runs in pace {rig.pace}: leave --pace out, or change its file")
    if section.captured not in (None, rig.table.captured):
        raise UserError(
            f"on the table of rig {section.name}, captured pieces go to a {rig.table.captured}: leave --captured out, "
            "or change its file"
        )
    return rig


def start_board(fen: str | None, *, chess960: bool = False, option: str = "--fen") -> chess.Board:
    """The position a game starts from.

    Args:
        fen: None: the usual one.
        chess960: castling from any squares.
        option: that gives it, for people.

    Raises:
        UserError: it is no position, or no legal one.
    """
    try:
        board = chess.Board(fen if fen is not None else chess.STARTING_FEN, chess960=chess960)
    except ValueError as error:
        raise UserError(
            f"{option} is not a position ({error}): give a FEN as any chess program copies it, or leave {option} out"
        ) from error
    if not board.is_valid():
        problems = ", ".join(str(flag.name).lower().replace("_", " ") for flag in board.status())
        raise UserError(
            f"{option} is not a legal position ({problems}): {fen}: set it up in any chess program and copy it"
        )
    return board


def _own_table(section: RigSection) -> TableSettings:
    """With larger squares it stands nearer to the robot."""
    limits = contact_speeds(section.profile or Profile.DEFAULT)
    table = TableSettings(limits=limits, captured=section.captured or Captured.TRAY)
    if section.square is None:
        return table
    from controller.model.constants import DeltaModel
    from controller.model.workspace import BoardDoesNotFit, seated

    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    robot = DeltaModel(load_parameters(_ROBOTS[section.pads]), heaviest)
    try:
        return seated(robot, table.model_copy(update={"square": 1e-3 * section.square}))
    except BoardDoesNotFit as error:
        raise UserError(f"--square: {error}") from error
