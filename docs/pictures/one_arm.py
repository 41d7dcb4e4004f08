"""Draws one-arm.png, the vectors of docs/derivations.md, from the model itself.

Run from the top of the repository: python docs/pictures/one_arm.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from controller.model.constants import DeltaModel
from controller.model.kinematics import elbow, triad
from controller.model.reach import posture_at
from controller.model.second_order import proximal_direction
from hardware.parameters import load_parameters

Point = NDArray[np.float64]

TOOL = np.array([0.09, 0.06, 0.44])
DOWN = np.array([0.0, 0.0, 1.0])
INK, GREY, ROD, VECTOR, ANGLE = "#22262b", "#9aa0a8", "#2b5fa8", "#c23b2e", "#2e7d4f"


def project(point: Point) -> tuple[float, float]:
    """Page coordinates: seen from the side of +z1, a little from above; z3 points down the page."""
    turn, tilt = np.radians(-48.0), np.radians(16.0)
    across = np.cos(turn) * point[0] - np.sin(turn) * point[1]
    depth = np.sin(turn) * point[0] + np.cos(turn) * point[1]
    return float(across), float(-np.cos(tilt) * point[2] - np.sin(tilt) * depth)


def line(page: Axes, points: list[Point], colour: str, width: float, style: str = "-") -> None:
    """A polyline in space."""
    page.plot(*zip(*map(project, points), strict=True), style, color=colour, lw=width, solid_capstyle="round")


def name(page: Axes, at: Point, label: str, colour: str, shift: tuple[float, float]) -> None:
    """A label beside a point, moved by so many points of print."""
    page.annotate(label, project(at), xytext=shift, textcoords="offset points", color=colour, fontsize=12)


def arrow(page: Axes, start: Point, end: Point, colour: str, label: str, shift: tuple[float, float]) -> None:
    """A labelled vector."""
    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0.0, "shrinkB": 0.0}
    page.annotate("", project(end), xytext=project(start), arrowprops=look)
    name(page, end, label, colour, shift)


def vectors(page: Axes, model: DeltaModel, shoulder: Point, at: Point, outward: Point, q: Point) -> None:
    """What stands at the elbow of arm 1, and its angles."""
    d, a, n = (np.array(w) for w in triad(0, float(q[1]), float(q[2])))
    e = np.array(elbow(model.constants, 0, float(q[0]))[1])
    p = np.array(proximal_direction(0, float(q[0])))
    for unit, label, shift in (
        (p, "$p_1$", (3, 2)),
        (e, "$e_1$", (4, -12)),
        (a, "$a_1$", (3, 5)),
        (n, "$n_1$", (4, -4)),
    ):
        arrow(page, at, at + 0.085 * unit, VECTOR, label, shift)
    arrow(page, at, at + 0.15 * d, VECTOR, "$d_1$", (-20, 4))
    aside = d - (outward @ d) * outward
    for corner, size, across, sweep, label in (
        (shoulder, 0.075, DOWN, float(q[0]), "$q_{11}$"),
        (at, 0.055, aside / np.linalg.norm(aside), float(q[1]), "$q_{12}$"),
    ):
        line(page, [corner, corner + 0.15 * outward], GREY, 1.0, "--")
        arc = [corner + size * (np.cos(t) * outward + np.sin(t) * across) for t in np.linspace(0.0, sweep, 30)]
        line(page, arc, ANGLE, 1.5)
        name(page, arc[15], label, ANGLE, (7, -7))
    name(page, 0.45 * shoulder + 0.55 * at, "$l_1$", INK, (-12, -16))
    name(page, at + 0.27 * d, "$l_2$", ROD, (8, -2))


def draw() -> Figure:
    """The picture."""
    model = DeltaModel(load_parameters())
    figure = Figure(figsize=(6.4, 5.2), dpi=110, layout="constrained")
    page = figure.subplots()
    page.set_aspect("equal")
    page.axis("off")
    g = model.parameters.geometry
    y, x = posture_at(model, TOOL)
    circle = [np.array([np.cos(t), np.sin(t), 0.0]) for t in np.linspace(0.0, 2.0 * np.pi, 61)]
    wrist = TOOL - g.gripper_height * DOWN
    line(page, [g.base_radius * c for c in circle], GREY, 1.2)
    line(page, [wrist + g.flange_radius * c for c in circle], GREY, 1.2)
    line(page, [wrist, TOOL], GREY, 5.0)
    for arm in (1, 2, 0):
        outward = np.array(proximal_direction(arm, 0.0))
        # the model's elbow is moved by flange and gripper, so that the rod ends in the tool point: moved back here
        at = (
            np.array(elbow(model.constants, arm, float(y[arm]))[0])
            - g.gripper_height * DOWN
            + g.flange_radius * outward
        )
        shoulder = at - g.proximal_length * np.array(proximal_direction(arm, float(y[arm])))
        end = at + g.distal_length * np.array(triad(arm, float(x[2 * arm]), float(x[2 * arm + 1]))[0])
        line(page, [shoulder, at], INK if arm == 0 else GREY, 5.0 if arm == 0 else 3.0)
        line(page, [at, end], ROD if arm == 0 else GREY, 3.0 if arm == 0 else 2.0)
        if arm == 0:
            vectors(page, model, shoulder, at, outward, np.array([y[0], x[0], x[1]]))
    for axis, label, shift in zip(np.eye(3), ("$z_1$", "$z_2$", "$z_3$"), ((-2, 5), (4, -4), (4, -2)), strict=True):
        arrow(page, np.zeros(3), 0.09 * axis, INK, label, shift)
    page.plot(*project(TOOL), "o", color=INK, ms=7)
    name(page, TOOL, "tool point $z$", INK, (9, -4))
    return figure


if __name__ == "__main__":
    draw().savefig(Path(__file__).with_name("one-arm.png"), metadata={"Software": None})
