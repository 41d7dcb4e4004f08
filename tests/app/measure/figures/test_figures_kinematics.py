"""Figures ``newton``, ``encoder`` and ``workspace``: their bars, and each number by another way."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.figures.drawing import TableGrid, table_grid
from app.measure.figures.encoder import encoder, resolutions
from app.measure.figures.newton import DECIMALS, ENOUGH, counted, fast_way, newton, newton_along
from app.measure.figures.workspace import maps, workspace
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at, tool_point_at
from controller.model.workspace import survey
from controller.offline import constrained
from hardware.parameters import load_parameters
from hardware.table import TableSettings

MODEL = DeltaModel(load_parameters())


def test_newton_takes_one_or_two_steps_on_a_fast_move() -> None:
    result = newton(print)
    assert result.holds
    numbers = result.numbers
    assert numbers["tool_speed_max_m_s"] == pytest.approx(1.5, abs=0.01), "the move is fast"
    by_steps = numbers["ticks_by_steps_to_1e-8_m"]
    assert isinstance(by_steps, dict)
    assert sum(v for v in by_steps.values() if isinstance(v, int)) == numbers["ticks_moving"]
    assert by_steps["1"]
    assert by_steps["2"]


def test_the_counted_steps_are_those_of_the_papers_own_system() -> None:
    """(7) with ∂h/∂x of six rows and columns, in NumPy."""
    way = fast_way()[100:140]
    angles = counted(MODEL, way)
    start = posture_at(MODEL, way[0]).x
    steps = newton_along(MODEL, angles, start)
    x = start.copy()
    for k, y in enumerate(angles):
        taken = 0
        for _ in range(ENOUGH):
            q = constrained.coordinates(y, x)
            h = constrained.constraint(MODEL, q)
            residual = np.abs(h.reshape(2, 3)).max()
            if residual <= 1e-10:
                break
            taken += residual > DECIMALS
            x = x - np.linalg.solve(constrained.constraint_jacobian(MODEL, q)[:, constrained.UNMEASURED], h)
        assert taken == steps.to_decimals[k]


def test_the_encoder_resolves_less_than_5_um_over_the_board() -> None:
    result = encoder(print)
    assert result.holds
    assert 0.1 < result.bars["worst_resolution"].value < 1.0


def test_the_resolution_is_what_a_count_really_moves() -> None:
    table = TableSettings()
    grid = TableGrid([0.0, 0.22], [-0.15], table)
    single, combined = resolutions(MODEL, grid, 0.0)
    count = 2.0 * np.pi / 2**22
    for (row, column), point in grid.points(0.0):
        y = posture_at(MODEL, point).y
        ways = [tool_point_at(MODEL, y + count * one) - tool_point_at(MODEL, y) for one in np.eye(3)]
        assert single[row, column] == pytest.approx(max(np.linalg.norm(w) for w in ways), rel=1e-4)
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        worst = max(np.linalg.norm(sign @ np.array(ways)) for sign in signs)
        assert combined[row, column] == pytest.approx(worst, rel=1e-4)


def test_the_grid_covers_squares_and_trays() -> None:
    table = TableSettings()
    grid = table_grid(table)
    x, y = np.array([table.xy(place) for place in table.tray_places()]).T
    assert min(grid.x) <= min(x.min(), -0.16)
    assert max(grid.x) >= max(x.max(), 0.16)
    assert min(grid.y) <= min(y.min(), -0.16)
    assert np.diff(grid.x).max() <= 0.010 + 1e-12
    assert len(list(grid.points(0.1))) == grid.shape[0] * grid.shape[1]


def test_the_arm_reaches_every_place_with_torque_to_spare() -> None:
    result = workspace(print)
    assert result.holds
    assert result.numbers["places"] == 64 + 48


def test_the_maps_agree_with_the_survey_and_are_blank_out_of_reach() -> None:
    table = TableSettings()
    found = survey(MODEL, table, (0.02,))
    index = [str(place) for place in found.places].index("h1")
    x, y = table.xy(found.places[index])
    here = maps(MODEL, TableGrid([x, 0.6], [y], table), 0.02)
    assert here.condition[0, 0] == pytest.approx(found.condition[index, 0])
    assert here.margin[0, 0] == pytest.approx(found.torque_margin[index, 0])
    assert here.acceleration[0, 0] == pytest.approx(found.acceleration[index, 0])
    assert np.isnan([here.condition[0, 1], here.margin[0, 1], here.acceleration[0, 1]]).all()
