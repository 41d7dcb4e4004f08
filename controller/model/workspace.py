"""What the robot can do over a table: its workspace there, condition of J_c, torque left over board and trays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia
from controller.model.kinematics import OK, arm_directions, control_jacobian, inverse_kinematics
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import Place, TableSettings, square_place

CLEARANCE: Final = 0.010
"""Of a carried piece over the tallest one [m]."""
LARGEST_CONDITION: Final = 6.0
"""Of J_c: beyond it a torque or encoder error weighs six times more in one direction than in another."""
WORST_CONDITION: Final = 8.0
"""Of J_c at the rim of the workspace, at its bottom: a piece may have fallen, or a hand push the arm there."""
ABOVE_BOARD: Final = 0.120
"""The middle of the workspace box, over the playing surface [m]."""
LEAST_HALF_SIZE: Final[Triple] = (0.300, 0.300, 0.125)
"""Of the workspace box, which has room for larger boards and trays than the smallest ones, and for what has rolled away
from the board, as far as the arm reaches in every direction [m]."""
BESIDE: Final = 0.020
"""The box goes so far beyond the outermost places along the files: boards may be turned a little [m]."""
AZIMUTHS: Final = 72
"""In so many directions the arm's reach is looked for; from one to the next it differs by tenths of a millimetre."""
REACH_STEP: Final = 1e-4
"""How finely; what is found is rounded to a millimetre [m]."""

LEAST_SQUARE: Final = 0.030
MOST_SQUARE: Final = 0.080
SQUARE_STEP: Final = 1e-4
LEAST_DEPTH: Final = 0.34
MOST_DEPTH: Final = 0.56
DEPTH_STEP: Final = 0.01
"""Between which, and how finely, the largest board is looked for [m]."""


class Workspace(NamedTuple):
    """Where the tool may be, base frame: a box, and no farther from the base's axis than ``reach`` [m]."""

    centre: Triple
    half_size: Triple
    reach: float

    def holds(self, point: FloatArray) -> NDArray[np.bool_]:
        """Which of the points (..., 3) lie in it."""
        inside = np.all(np.abs(point - np.array(self.centre)) <= self.half_size, axis=-1)
        within: NDArray[np.bool_] = inside & (np.hypot(point[..., 0], point[..., 1]) <= self.reach)
        return within


class BoardDoesNotFit(ValueError):
    """Somewhere on board or trays the robot cannot work; the message names the squares, ``places`` all that fail."""

    def __init__(self, sentence: str, places: tuple[Place, ...]) -> None:
        super().__init__(sentence)
        self.places = places


class PointSurvey(NamedTuple):
    """What the robot can do at one point."""

    condition: float
    """Condition number of J_c; infinite where the robot cannot work."""
    holding_torque: float
    """Largest servomotor torque that gravity takes [N m]; NaN where the robot cannot work."""
    acceleration: float
    """Tool acceleration that the peak torque still gives in every direction from rest [m/s²]; NaN likewise."""


NO_WORK: Final = PointSurvey(math.inf, math.nan, math.nan)
"""Out of reach, or too near a singularity."""


def workspace(parameters: RobotParameters, table: TableSettings) -> Workspace:
    """Where the tool may be over a table: the controller's limit, and what planners keep to.

    The box ends just below the playing surface. ``reach`` is where, there, J_c in the worst direction comes to be
    conditioned as `WORST_CONDITION` says: with the board nearer to the base the arm reaches farther.
    """
    x, y, surface = table.centre_in_base
    middle, (half_x, half_y, half_z) = surface - ABOVE_BOARD, LEAST_HALF_SIZE
    half_size = max(half_x, table.half_width), max(half_y, table.half_play[1] + BESIDE), half_z
    return Workspace((x, y, middle), half_size, _reach(parameters, middle + half_z))


@lru_cache(maxsize=64)
def _reach(parameters: RobotParameters, depth: float) -> float:
    """By bisection; 0 if nowhere at that depth J_c is conditioned well enough [m]."""
    model = DeltaModel(parameters)
    turns = np.linspace(0.0, 2.0 * math.pi, AZIMUTHS, endpoint=False)
    around = np.column_stack([np.cos(turns), np.sin(turns)])
    low, high = 0.0, parameters.geometry.proximal_length + parameters.geometry.distal_length
    while high - low > REACH_STEP:
        radius = 0.5 * (low + high)
        rim = ((*(radius * way), depth) for way in around)
        good = all(survey_point(model, np.array(point)).condition <= WORST_CONDITION for point in rim)
        low, high = (radius, high) if good else (low, radius)
    return round(low, 3)


@dataclass(frozen=True, eq=False)
class Survey:
    """Board, trays and boxes at several heights of the tool point."""

    places: tuple[Place, ...]
    """n of them, the 64 squares first; of a box, its drop points."""
    height: FloatArray
    """Shape (h,), of the tool point above the playing surface [m]."""
    point: FloatArray
    """Shape (n, h, 3), base frame [m]."""
    reachable: NDArray[np.bool_]
    """Shape (n, h), whether the robot can work there: within reach, and no singularity near."""
    condition: FloatArray
    """Shape (n, h), of J_c; infinite where not reachable."""
    holding_torque: FloatArray
    """Shape (n, h), largest servomotor torque that gravity takes [N m]; NaN where not reachable."""
    torque_margin: FloatArray
    """Shape (n, h), rated torque less the holding torque [N m]."""
    acceleration: FloatArray
    """Shape (n, h), tool acceleration that the peak torque still gives in every direction [m/s²]."""


def working_heights() -> tuple[float, float]:
    """Of the tool point above the playing surface: gripping the lowest stem, carrying over the tallest piece [m]."""
    shapes = PIECE_SHAPES.values()
    carrying = max(s.grip_height for s in shapes) + max(s.height for s in shapes) + CLEARANCE
    return min(s.grip_height for s in shapes), carrying


def survey_point(model: DeltaModel, point: FloatArray) -> PointSurvey:
    """Condition number, holding torque and what is left for acceleration at a tool point, shape (3,) [m].

    From rest u = M_y J_c⁻¹ z̈ + τ_g. A servomotor's share of the worst z̈ of size a is |row of M_y J_c⁻¹| a.
    """
    z = (float(point[0]), float(point[1]), float(point[2]))
    y, jacobian, inverse = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    if inverse_kinematics(model.constants, z, y, np.empty(6))[0] != OK:
        return NO_WORK
    d, e = arm_directions(model.constants, y, z)
    if control_jacobian(model.constants, d, e, jacobian, inverse)[0] != OK:
        return NO_WORK
    inertia, gravity = np.empty((3, 3)), np.empty(3)
    joint_inertia(model.constants, e, jacobian, inertia)
    gravity_torque(model.constants, e, jacobian, gravity)
    left = model.parameters.drive.peak_torque - np.abs(gravity)
    acceleration = float((left / np.linalg.norm(inertia @ inverse, axis=1)).min())
    return PointSurvey(float(np.linalg.cond(jacobian)), float(np.abs(gravity).max()), acceleration)


def survey(model: DeltaModel, table: TableSettings, heights: Sequence[float] | None = None) -> Survey:
    """What the robot, with what it carries, can do over every square, tray place and drop point of a box.

    Heights are of the tool point above the playing surface [m]; default `working_heights`.
    """
    places = tuple(square_place(square) for square in range(64)) + table.tray_places()
    places += table.drop_points()
    height = np.array(working_heights() if heights is None else heights, dtype=np.float64)
    on_board = np.array([[(*table.xy(place), h) for h in height] for place in places])
    point = table.base_from_board(on_board)
    found = np.array([[survey_point(model, p) for p in row] for row in point])
    condition, holding, acceleration = np.moveaxis(found, 2, 0)
    margin = model.parameters.drive.rated_torque - holding
    return Survey(places, height, point, np.isfinite(condition), condition, holding, margin, acceleration)


def require_fit(model: DeltaModel, table: TableSettings, heights: Sequence[float] | None = None) -> Survey:
    """The survey of a table at which the robot, with the heaviest thing it carries, can play; heights as for `survey`.

    Raises ``BoardDoesNotFit`` if at some height a place is out of reach, J_c is conditioned worse than
    `LARGEST_CONDITION`, it lies outside the workspace, or holding there takes more than the rated torque.
    """
    found = survey(model, table, heights)
    _refuse(found, table, ~found.reachable, "out of reach")
    worst = float(found.condition.max())
    _refuse(
        found, table, found.condition > LARGEST_CONDITION,
        f"too near a singularity (condition of J_c {worst:.1f} at worst, at most {LARGEST_CONDITION:.1f} is allowed)",
    )  # fmt: skip
    room = workspace(model.parameters, table)
    _refuse(
        found, table, ~room.holds(found.point),
        f"outside the workspace, which ends {1e3 * room.reach:.0f} mm from the base's axis",
    )  # fmt: skip
    rated = model.parameters.drive.rated_torque
    most = float(found.holding_torque.max())
    _refuse(
        found, table, found.torque_margin < 0.0,
        f"too heavy to hold (up to {most:.2f} N m, the servomotors are rated for {rated:.2f} N m)",
    )  # fmt: skip
    return found


class LargestBoard(NamedTuple):
    """The largest squares on which the robot can play, and how deep that board lies."""

    square: float
    """Side of a square [m]."""
    depth: float
    """Of the playing surface below the base, z₃ [m]."""
    by_depth: FloatArray
    """The largest square at each depth looked at, (n, 2): depth, square [m]; 0 where none fits."""


def largest_board(model: DeltaModel, table: TableSettings, *, trays: bool = True) -> LargestBoard:
    """The largest board below the base's centre that `require_fit` accepts; trays keep their size and their distance
    from it.

    ``trays``: they and boxes have to be in reach, too; without them captured pieces need another place.
    """
    depths = np.arange(LEAST_DEPTH, MOST_DEPTH + 1e-9, DEPTH_STEP)
    squares = np.array([_largest_square(model, table, float(depth), trays) for depth in depths])
    best = int(squares.argmax())
    return LargestBoard(float(squares[best]), float(depths[best]), np.column_stack([depths, squares]))


def seated(model: DeltaModel, table: TableSettings) -> TableSettings:
    """The table as it is where it fits the robot with the heaviest thing it carries; else moved up, no further than it
    must.

    Raises ``BoardDoesNotFit`` if it fits nowhere below the base's centre, or its squares are smaller than any that are
    looked for; the message says how large squares may be.
    """
    least = f"{1e3 * LEAST_SQUARE:.0f}"
    if table.square < LEAST_SQUARE:
        raise BoardDoesNotFit(f"squares of {1e3 * table.square:g} mm are too small: choose at least {least} mm", ())
    x, y, depth = table.centre_in_base
    for height in np.arange(0.0, depth - LEAST_DEPTH + 1e-9, DEPTH_STEP).tolist():
        tried = table.model_copy(update={"centre_in_base": (x, y, round(depth - height, 4))})
        if _fits(model, tried):
            return tried
    largest = largest_board(model, table)
    raise BoardDoesNotFit(
        f"a board of {1e3 * table.square:.1f} mm squares with its trays fits nowhere below the base: choose squares of "
        f"{least} to {math.floor(1e3 * largest.square)} mm",
        (),
    )


def _largest_square(model: DeltaModel, table: TableSettings, depth: float, trays: bool) -> float:
    """By bisection, to a tenth of a millimetre; 0 where not even the smallest fits [m]."""
    low, high = LEAST_SQUARE, MOST_SQUARE

    def fits(square: float) -> bool:
        tried = table.model_copy(update={"square": square, "centre_in_base": (0.0, 0.0, depth)})
        return _fits(model, tried, trays=trays)

    if not fits(low):
        return 0.0
    while high - low > SQUARE_STEP:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return math.floor(low / SQUARE_STEP) * SQUARE_STEP


def _fits(model: DeltaModel, table: TableSettings, *, trays: bool = True) -> bool:
    """Also whether the tool can be held in the middle of its workspace, which is higher than any place."""
    places = [square_place(square) for square in range(64)]
    places += [place for place in table.tray_places() + table.drop_points() if trays]
    points = table.base_from_board(np.array([(*table.xy(place), h) for place in places for h in working_heights()]))
    room, rated = workspace(model.parameters, table), model.parameters.drive.rated_torque
    # the last ones are the farthest out, and tell the soonest
    surveys = (survey_point(model, point) for point in (np.array(room.centre), *points[::-1]))
    return bool(room.holds(points).all()) and all(
        here.condition <= LARGEST_CONDITION and here.holding_torque <= rated for here in surveys
    )


def _remedy(found: Survey, fails: NDArray[np.bool_]) -> str:
    """What would help, from where the places that fail lie: farther out, deeper or higher than those that do not."""
    good, bad = found.point[~fails], found.point[fails]
    if good.size == 0:
        return "put the board below the base, near its axis: the arm works some 0.3 to 0.5 m below it"
    out, in_ = (float(np.hypot(p[:, 0], p[:, 1]).mean()) for p in (bad, good))
    deeper = float(bad[:, 2].mean() - good[:, 2].mean())
    if abs(deeper) > out - in_:
        return f"move the board {'up, towards' if deeper > 0.0 else 'down, away from'} the base"
    return "use smaller squares or trays, or move the board towards the base's axis"


def _refuse(found: Survey, table: TableSettings, fails: NDArray[np.bool_], why: str) -> None:
    """One sentence if any place fails."""
    places = tuple(place for place, bad in zip(found.places, fails, strict=True) if bad.any())
    if not places:
        return
    squares = [str(place) for place in places if place.on_board]
    trays = [str(place) for place in places if not place.on_board and not place.in_box]
    drops = [str(place) for place in places if place.in_box]
    named = [f"{len(squares)} of 64 squares ({', '.join(squares)})"] if squares else []
    named += [f"{len(trays)} tray places ({', '.join(trays)})"] if trays else []
    named += [f"{len(drops)} drop points of the boxes ({', '.join(drops)})"] if drops else []
    heights = ", ".join(f"{1e3 * h:.0f}" for h in found.height[fails.any(axis=0)])
    x, y, z = table.centre_in_base
    raise BoardDoesNotFit(
        f"a board of {1e3 * table.square:.1f} mm squares centred at ({x:.3f}, {y:.3f}, {z:.3f}) m does not fit: "
        f"{' and '.join(named)} {'are' if len(places) > 1 else 'is'} {why} with the tool {heights} mm above the "
        f"board; {_remedy(found, fails)}",
        places,
    )
