"""Figure ``move``: what a ply asks of the arm over time, by both laws, and where it goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import chess
import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import NDArray
from pydantic import JsonValue

from app import UserError
from app.measure.figures.drawing import DARK, GREY, WITH, WITHOUT, axes, label, picture
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.motion import PROFILES, MotionSettings, Plan, Planner, Profile, contact_speeds
from app.motion.path import Vector
from app.pieces.inventory import Inventory, Ply, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.players.given_line import parse_line
from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings

MOVE: Final = "e2e4"
AXES: Final = (("z₁", WITHOUT), ("z₂", GREY), ("z₃", WITH))
SHADES: Final = {Stage.APPROACH: "#eef3fa", Stage.GRASP: "#f6e3e0", Stage.CARRY: "#e6f1e6", Stage.RELEASE: "#f5f0dd"}
TOLERANCE: Final = 1e-6


def move_figure(move: str, fen: str | None, progress: Progress) -> FigureResult:
    """Plan a ply by both laws and draw it; ``move``: SAN or UCI; ``fen``: the position, None: the usual start.

    Raises:
        UserError: no such position or move, or the plan is refused.
    """
    try:
        board = chess.Board(fen) if fen is not None else chess.Board()
    except ValueError as error:
        raise UserError(f"--fen is not a position: {error}") from error
    line = parse_line(move, board)
    if len(line) != 1:
        raise UserError(
            f"'{move}' is {'no move' if not line else 'a line of moves'}: give one move, such as e4 or e2e4"
        )
    (chosen,) = line
    plans, bars, numbers = {}, dict[str, Bar](), dict[str, JsonValue]()
    for profile in (Profile.DEFAULT, Profile.MINIMUM_JERK):
        progress(f"planning {board.san(chosen)}, {profile.value}")
        plans[profile] = _, plan, _ = plan_ply(board, chosen, PROFILES[profile], contact_speeds(profile), 0.008)
        name = profile.value.replace("-", "_")
        for quantity, worst in _shares(plan, PROFILES[profile]).items():
            bars[f"{name}_{quantity}"] = Bar(worst, "of the bound", high=1.0 + TOLERANCE)
        numbers[f"{name}_s"] = plan.expected
        numbers[f"{name}_by_stage_s"] = {f"{i} {m.label}": m.expected for i, m in enumerate(plan.motions)}
    ply, plan, inventory = plans[Profile.DEFAULT]
    title = f"{ply.san} from home to home: {plan.expected:.2f} s"
    return FigureResult(title, bars, numbers, {"": _over_time(plans, title), "-path": _in_space(ply, plan, inventory)})


def plan_ply(
    board: chess.Board, move: chess.Move, settings: MotionSettings, limits: ContactSpeeds, finger: float
) -> tuple[Ply, Plan, Inventory]:
    """A ply from home, planned with the fingers open so far [m]; and what stands on board and trays before it."""
    table = TableSettings(limits=limits)
    inventory = Inventory.of(start_layout(board, table), table)
    ply = transfers(board, move, inventory)
    planner = Planner.of(settings, load_parameters(), table, np.array(settings.home), finger)
    return ply, planner.ply(ply.san, ply.transfers, inventory), inventory


def until_guard(plan: Plan, *, grips: bool = True) -> list[NDArray[Any]]:
    """Samples of all motions, each that ends by a touch up to where the board should be, and by a grip to its time."""
    found = []
    for index, motion in enumerate(plan.motions):
        samples = motion.samples
        if motion.touches:
            after = plan.motions[index + 1].samples["position"][0, 2]
            samples = samples[: np.flatnonzero(samples["position"][:, 2] < after)[-1] + 1]
        if motion.grips and grips:
            samples = samples[: max(1, round(motion.expected / load_parameters().drive.tick))]
        found.append(samples)
    return found


def _jerk(samples: NDArray[Any]) -> Vector:
    tick = load_parameters().drive.tick
    return np.diff(samples["acceleration"], axis=0, prepend=samples["acceleration"][:1]) / tick


def _shares(plan: Plan, settings: MotionSettings) -> dict[str, float]:
    """Largest speed, acceleration and jerk, as shares of their bounds."""
    samples = [motion.samples for motion in plan.motions]
    return {
        "speed": max(float(np.linalg.norm(s["velocity"], axis=1).max()) for s in samples) / settings.speed,
        "acceleration": max(float(np.abs(s["acceleration"]).max()) for s in samples) / settings.acceleration,
        "jerk": max(float(np.abs(_jerk(s)).max()) for s in samples) / settings.jerk,
    }


def _over_time(plans: dict[Profile, tuple[Ply, Plan, Inventory]], title: str) -> Picture:
    sheet = picture(12.0, 9.5)
    panels = axes(sheet, 5, 2, sharex=True)
    sheet.suptitle(title, fontsize=11)
    for column, (profile, (_, plan, _)) in enumerate(plans.items()):
        parts = until_guard(plan)
        samples = np.concatenate(parts)
        time = load_parameters().drive.tick * np.arange(float(len(samples)))
        rows = panels[column::2]
        label(rows[0], title=f"{profile.value}, {time[-1]:.2f} s")
        home = np.array(PROFILES[profile].home)
        quantities = (
            (1e3 * (samples["position"] - home), "from home [mm]"),
            (samples["velocity"], "velocity [m/s]"),
            (samples["acceleration"], "acceleration [m/s²]"),
            (np.concatenate([_jerk(part) for part in parts]), "jerk [m/s³]"),
            (np.sqrt(samples["stiffness"]), "√k_p [rad/s]"),
        )
        for axis, (values, quantity) in zip(rows, quantities, strict=True):
            _stages(axis, plan, parts)
            for i, (name, colour) in enumerate(AXES):
                axis.plot(time, values[:, i], color=colour, lw=1.1, label=name)
            if column == 0:
                label(axis, ylabel=quantity)
        rows[1].plot(time, np.linalg.norm(samples["velocity"], axis=1), color=DARK, lw=0.8, ls=":", label="|ż|")
        label(rows[-1], xlabel="time [s]")
    sheet.legend(*panels[2].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=4)
    return sheet


def _stages(axis: Axes, plan: Plan, parts: Sequence[NDArray[Any]]) -> None:
    begin, tick = 0.0, load_parameters().drive.tick
    for motion, part in zip(plan.motions, parts, strict=True):
        end = begin + len(part) * tick
        if motion.stage is not None:
            axis.axvspan(begin, end, color=SHADES.get(motion.stage, "white"), lw=0)
        begin = end


def _in_space(ply: Ply, plan: Plan, inventory: Inventory) -> Picture:
    sheet = picture(8.5, 7.0)
    axis = sheet.add_subplot(projection="3d")
    assert isinstance(axis, Axes3D)
    table, around = inventory.table, np.linspace(0.0, 2.0 * np.pi, 24)
    moved = {transfer.name for transfer in ply.transfers}
    for piece in inventory:
        x, y = table.xy(piece.place)
        shape = PIECE_SHAPES[piece.kind]
        colour = WITH if piece.name in moved else GREY
        for radius, height in (
            (shape.foot_radius, 0.0),
            (shape.foot_radius, shape.foot_height),
            (shape.stem_radius, shape.height),
        ):
            ring = 1e3 * (x + radius * np.cos(around)), 1e3 * (y + radius * np.sin(around))
            axis.plot(*ring, np.full(24, 1e3 * height), color=colour, lw=0.7)
        axis.plot([1e3 * x] * 2, [1e3 * y] * 2, [0.0, 1e3 * shape.height], color=colour, lw=0.7)
    for motion, part in zip(plan.motions, until_guard(plan), strict=True):
        way = 1e3 * table.board_from_base(part["position"])
        colours = {Stage.APPROACH: WITHOUT, Stage.CARRY: WITH}
        axis.plot(*way.T, color=colours.get(motion.stage or Stage.RETURN, DARK), lw=2.0)
    edge = 4e3 * table.square
    axis.plot([-edge, edge, edge, -edge, -edge], [-edge, -edge, edge, edge, -edge], 0.0, color=DARK, lw=0.8)
    axis.set_box_aspect((1, 1, 0.5))
    axis.set(xlim=(-170, 170), ylim=(-170, 170), zlim=(0, 170), xlabel="x [mm]", ylabel="y [mm]", zlabel="pads [mm]")
    axis.view_init(elev=22, azim=-62)
    axis.set_title(f"{ply.san}: approach blue, carry red, release black", fontsize=10)
    return sheet
