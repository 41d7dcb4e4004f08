"""Kinematics: laws before samples, every derivative against one taken numerically."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest

from controller.model.compiled import FloatArray
from controller.model.constants import DISTAL, DeltaModel
from controller.model.kinematics import (
    MAX_ITERATIONS,
    TOLERANCE,
    Status,
    arm_directions,
    arm_tool_point,
    control_jacobian,
    distal_angles,
    elbows,
    forward_kinematics,
    inverse_kinematics,
    newton_step,
    spheres_meet,
    tool_point_near,
    triad,
)
from controller.model.nearest import LEAST_TRANSMISSION, nearest_point, room
from controller.model.reach import Posture, Singular, Unreachable, jacobians_at, posture_at, tool_point_at
from controller.offline import constrained
from hardware.parameters import load_parameters

MODEL = DeltaModel(load_parameters())
COMPLEX_STEP = 1e-30


def workspace() -> list[FloatArray]:
    """Points over the reach of the tool, from the centre to where J_c has a condition number of about 7."""
    around = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False) + 0.1
    return [
        np.array([radius * np.cos(phi), radius * np.sin(phi), depth])
        for depth in (0.35, 0.40, 0.45, 0.50)
        for radius in (0.0, 0.08, 0.16, 0.24, 0.28)
        for phi in around
    ]


def psi(arm: int, q1: complex, q2: complex, q3: complex) -> np.ndarray:
    """(1) as printed, with the arm's rotation; takes complex angles."""
    g = MODEL.parameters.geometry
    turn = (0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)[arm]
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    l0, l1, l2, l3, l4 = g.base_radius, g.proximal_length, g.distal_length, g.flange_radius, g.gripper_height
    local = [
        l2 * np.sin(q2) * np.sin(q3),
        l0 - l3 + l1 * np.cos(q1) + l2 * np.cos(q2),
        l4 + l1 * np.sin(q1) + l2 * np.sin(q2) * np.cos(q3),
    ]
    return rotation @ np.array(local)


def constraint(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(3) in the order of (6)."""
    tips = [psi(arm, y[arm], x[2 * arm], x[2 * arm + 1]) for arm in range(3)]
    return np.concatenate([tips[0] - tips[1], tips[0] - tips[2]])


def complex_step(function, at: FloatArray) -> FloatArray:
    """Jacobian of a function that takes complex arguments, exact to rounding."""
    unit = np.eye(at.size)
    columns = [np.imag(function(at + 1j * COMPLEX_STEP * u)) / COMPLEX_STEP for u in unit]
    return np.stack(columns, axis=1)


def jacobians(y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J_c and J_c⁻¹ of a pose that must be regular."""
    jacobian, inverse = np.empty((3, 3)), np.empty((3, 3))
    d, e = arm_directions(MODEL.constants, y, tuple(z.tolist()))
    status, _, _ = control_jacobian(MODEL.constants, d, e, jacobian, inverse)
    assert status == Status.OK
    return jacobian, inverse


@pytest.mark.parametrize("arm", [0, 1, 2])
def test_all_arms_meet_at_the_tool_point_of_eq_1(arm: int) -> None:
    for z in workspace():
        y, x = posture_at(MODEL, z)
        np.testing.assert_allclose(psi(arm, y[arm], x[2 * arm], x[2 * arm + 1]), z, rtol=0, atol=1e-14)


def whole_workspace() -> list[FloatArray]:
    """Every 30 mm where the flange is below the base and no arm is stretched beyond d_i·e_i = 0.05."""
    side, depth = np.arange(-0.48, 0.481, 0.03), np.arange(0.08, 0.70, 0.03)
    points = (np.array([x, y, z]) for x in side for y in side for z in depth)
    return [p for p in points if room(MODEL.constants, tuple(p.tolist())).min() >= 0.0]


def test_forward_and_inverse_undo_each_other_over_the_whole_workspace() -> None:
    """FK∘IK, IK∘FK and Newton's FK∘IK, up to 0.44 m from the axis and to the stretched poses, to 1e-10."""
    points, worst = whole_workspace(), dict.fromkeys(("z", "y", "Newton"), 0.0)
    for point in points:
        y, x = posture_at(MODEL, point)
        closed = tool_point_at(MODEL, y)
        again = posture_at(MODEL, closed).y
        start = x + 0.01 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
        assert forward_kinematics(MODEL.constants, y, start)[0] == Status.OK
        found = {"z": closed - point, "y": again - y, "Newton": psi(0, y[0], start[0], start[1]) - closed}
        worst = {name: max(worst[name], float(np.abs(found[name]).max())) for name in worst}
    radius = max(float(np.hypot(p[0], p[1])) for p in points)
    print(f"{len(points)} points up to {radius:.2f} m from the axis: z {worst['z']:.1e} m, y {worst['y']:.1e} rad, "
          f"Newton against the closed form {worst['Newton']:.1e} m")  # fmt: skip
    assert len(points) > 2000
    assert radius > 0.42
    assert max(worst["z"], worst["y"]) < 1e-10
    assert worst["Newton"] < 10.0 * TOLERANCE  # which is what it stops at, in |h|


def test_forward_after_inverse_is_the_identity() -> None:
    for z in workspace():
        y, x = posture_at(MODEL, z)
        np.testing.assert_allclose(tool_point_at(MODEL, y), z, rtol=0, atol=1e-10)
        start = x + np.array([0.02, -0.03, 0.01, 0.04, -0.02, 0.03])
        status, _ = forward_kinematics(MODEL.constants, y, start)
        assert status == Status.OK
        np.testing.assert_allclose(psi(0, y[0], start[0], start[1]), z, rtol=0, atol=1e-10)


def test_inverse_after_forward_is_the_identity() -> None:
    angles = np.linspace(-0.3, 1.3, 7)
    checked = 0
    for y in (np.array([a, b, c]) for a in angles for b in angles for c in angles):
        status, z = spheres_meet(MODEL.constants, *y)
        if status != Status.OK:
            continue
        d, e = arm_directions(MODEL.constants, y, z)
        regular, _, transmission = control_jacobian(MODEL.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))
        if regular != Status.OK or transmission < 0.1:
            continue  # an arm stretched or folded inward is not on the outward branch
        checked += 1
        np.testing.assert_allclose(posture_at(MODEL, np.array(z)).y, y, rtol=0, atol=1e-10)
    assert checked > 250


def test_newton_agrees_with_the_closed_form() -> None:
    for z in workspace():
        y, x = posture_at(MODEL, z)
        status, tool = spheres_meet(MODEL.constants, *y)
        assert status == Status.OK
        closed = np.concatenate([distal_angles(MODEL.constants, arm, y[arm], tool) for arm in range(3)])
        newton = x + 0.05
        assert forward_kinematics(MODEL.constants, y, newton)[0] == Status.OK
        np.testing.assert_allclose(newton, closed, rtol=0, atol=1e-9)
        np.testing.assert_allclose(closed, x, rtol=0, atol=1e-10)


def test_newton_step_is_the_step_of_eq_7() -> None:
    shift = np.array([0.05, -0.04, 0.03, 0.06, -0.02, 0.05])
    for z in workspace():
        y, x = posture_at(MODEL, z)
        start = x + shift
        h_x = complex_step(lambda w, y=y: constraint(y, w), start)
        expected = start + np.linalg.solve(h_x, -constraint(y, start))
        stepped = start.copy()
        status, residual = newton_step(MODEL.constants, y, stepped)
        assert status == Status.OK
        assert residual == pytest.approx(np.abs(constraint(y, start)).max(), abs=1e-15)
        np.testing.assert_allclose(stepped, expected, rtol=0, atol=1e-12)


def test_newton_converges_quadratically() -> None:
    y, x = posture_at(MODEL, np.array([0.1, -0.05, 0.45]))
    x += 0.1
    residuals = []
    while not residuals or residuals[-1] > TOLERANCE:
        residuals.append(newton_step(MODEL.constants, y, x)[1])
    orders = [np.log(b) / np.log(a) for a, b in pairwise(residuals[1:]) if b > 1e-15]
    assert len(residuals) <= 6
    assert min(orders) > 1.5


def test_warm_start_takes_at_most_two_steps_at_the_practical_top_speed() -> None:
    y, x = posture_at(MODEL, np.array([0.15, 0.0, 0.45]))
    tick, most = MODEL.parameters.drive.tick, 0
    for k in range(300):
        y = y + 5.0 * tick * np.cos(0.05 * k + np.array([0.0, 2.0, 4.0]))
        status, steps = forward_kinematics(MODEL.constants, y, x)
        assert status == Status.OK
        most = max(most, steps)
    assert most == 2


def near_in_the_loop(y: FloatArray, z: FloatArray) -> tuple[int, int, FloatArray, FloatArray]:
    a, b, c = z.tolist()
    status, steps, point, d = tool_point_near(MODEL.constants, elbows(MODEL.constants, y)[0], (a, b, c))
    return status, steps, np.array(point), np.array(d)


def test_newton_without_angles_takes_the_step_of_eq_7() -> None:
    """From angles that point at a point nearby one step of (7) leads all three linearised tips to the same place."""
    l2 = MODEL.constants[DISTAL]
    for z in workspace():
        y, _ = posture_at(MODEL, z)
        a, b, c = (z + np.array([2e-6, -1e-6, 1.5e-6])).tolist()
        x = np.array([distal_angles(MODEL.constants, arm, y[arm], (a, b, c)) for arm in range(3)]).reshape(6)
        step = -np.linalg.solve(complex_step(lambda w, y=y: constraint(y, w), x), constraint(y, x))
        status, steps, point, _ = near_in_the_loop(y, np.array([a, b, c]))
        assert (status, steps) == (Status.OK, 1)
        for arm in range(3):
            d, across, around = (np.array(w) for w in triad(arm, x[2 * arm], x[2 * arm + 1]))
            bent = d + step[2 * arm] * across + step[2 * arm + 1] * np.sin(x[2 * arm]) * around
            linear = np.array(elbows(MODEL.constants, y)[0][arm]) + l2 * bent
            np.testing.assert_allclose(point, linear, rtol=0, atol=1e-14)


def test_newton_without_angles_finds_the_tool_and_the_rods() -> None:
    for z in workspace():
        y, x = posture_at(MODEL, z)
        for shift in (1e-2, 1e-3, 1e-6):
            status, steps, point, d = near_in_the_loop(y, z + shift * np.array([0.6, -0.5, 0.6]))
            assert status == Status.OK
            assert 1 <= steps <= 4
            np.testing.assert_allclose(point, z, rtol=0, atol=2e-10)
            for arm in range(3):
                along = triad(arm, x[2 * arm], x[2 * arm + 1])[0]
                np.testing.assert_allclose(d[arm], along, rtol=0, atol=1e-9)


@pytest.mark.parametrize("arm", [0, 1, 2])
def test_newton_never_calls_a_nan_closed(arm: int) -> None:
    y, x = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    y[arm] = np.nan
    assert near_in_the_loop(y, np.array([0.0, 0.0, 0.45]))[0] != Status.OK
    assert forward_kinematics(MODEL.constants, y, x)[0] != Status.OK


def test_newton_without_angles_says_where_it_cannot() -> None:
    y, _ = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    level = np.array(elbows(MODEL.constants, y)[0][0])[2]
    assert near_in_the_loop(y, np.array([0.0, 0.0, level]))[0] == Status.SINGULAR
    apart = np.array([-2.5, -1.0, 0.0])  # no point is near enough to all three elbows
    assert near_in_the_loop(apart, np.array([0.0, 0.0, 0.45]))[0] in (Status.NOT_CONVERGED, Status.SINGULAR)


def test_a_solved_posture_needs_no_step() -> None:
    y, x = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    assert forward_kinematics(MODEL.constants, y, x.copy()) == (Status.OK, 0)
    assert near_in_the_loop(y, np.array([0.0, 0.0, 0.45]))[:2] == (Status.OK, 0)


def test_elbows_point_outward() -> None:
    for z in workspace():
        y, _ = posture_at(MODEL, z)
        d, e = arm_directions(MODEL.constants, y, tuple(z.tolist()))
        assert min(np.dot(d[i], e[i]) for i in range(3)) > 0.0
        np.testing.assert_allclose([np.linalg.norm(d[i]) for i in range(3)], 1.0, atol=1e-12)


def test_arm_1_lies_along_y_and_arm_2_towards_positive_x() -> None:
    base = posture_at(MODEL, np.array([0.0, 0.0, 0.45])).y
    assert posture_at(MODEL, np.array([0.0, -0.05, 0.45])).y[0] > base[0]  # left behind, arm 1 swings in and down
    assert np.argmax(posture_at(MODEL, np.array([-0.05, 0.0, 0.45])).y) == 1


def test_control_jacobian_is_eq_13_and_its_inverse_is_the_inverse() -> None:
    for z in workspace():
        y, x = posture_at(MODEL, z)
        jacobian, inverse = jacobians(y, z)
        h_x = complex_step(lambda w, y=y: constraint(y, w), x)
        h_y = complex_step(lambda w, x=x: constraint(w, x), y)
        g_y = -np.linalg.solve(h_x, h_y)
        psi_x = complex_step(lambda w, y=y: psi(0, y[0], w[0], w[1]), x)
        psi_y = complex_step(lambda w, x=x: psi(0, w[0], x[0], x[1]), y)
        np.testing.assert_allclose(jacobian, psi_x @ g_y + psi_y, rtol=0, atol=1e-12)
        np.testing.assert_allclose(jacobian @ inverse, np.eye(3), rtol=0, atol=1e-12)
        rates = constrained.tangent(MODEL, constrained.coordinates(y, x))[constrained.UNMEASURED]
        np.testing.assert_allclose(rates, g_y, rtol=0, atol=1e-11)


def test_control_jacobian_against_finite_differences_of_the_closed_form() -> None:
    step = 1e-5
    for z in workspace()[::5]:
        y, _ = posture_at(MODEL, z)
        jacobian, _ = jacobians(y, z)
        columns = [
            (tool_point_at(MODEL, y + step * u) - tool_point_at(MODEL, y - step * u)) / (2 * step) for u in np.eye(3)
        ]
        np.testing.assert_allclose(jacobian, np.stack(columns, axis=1), rtol=0, atol=2e-7)


def test_reach_matches_the_table_of_condition_numbers() -> None:
    """The worst condition number on circles, known from a separate computation."""
    for depth, radius, known in [(0.35, 0.10, 1.5), (0.40, 0.20, 1.9), (0.45, 0.25, 2.8), (0.50, 0.20, 2.6)]:
        worst = 0.0
        for phi in np.linspace(0.0, 2.0 * np.pi, 72):
            z = np.array([radius * np.cos(phi), radius * np.sin(phi), depth])
            worst = max(worst, float(np.linalg.cond(jacobians(posture_at(MODEL, z).y, z)[0])))
        assert worst == pytest.approx(known, abs=0.06)


def test_newton_reports_a_singular_pose() -> None:
    y, x = np.zeros(3), np.array([np.pi, 0.0, np.pi, 0.0, np.pi, 0.0])  # rods along the arms: sin q2 = 0
    assert forward_kinematics(MODEL.constants, y, x)[0] == Status.SINGULAR
    x = np.full(6, np.pi / 2)  # rods in one plane with the base
    assert forward_kinematics(MODEL.constants, y, x)[0] == Status.SINGULAR


def test_newton_gives_up_where_the_chain_cannot_close() -> None:
    _, x = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    apart = np.array([-2.5, -1.0, 0.0])
    assert spheres_meet(MODEL.constants, *apart)[0] == Status.UNREACHABLE
    assert forward_kinematics(MODEL.constants, apart, x)[0] in (Status.NOT_CONVERGED, Status.SINGULAR)
    _, x = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    status, steps = forward_kinematics(MODEL.constants, np.full(3, np.nan), x)
    assert (status, steps) == (Status.NOT_CONVERGED, MAX_ITERATIONS)


def test_jacobian_reports_the_wrong_side_and_stretched_arms() -> None:
    y = np.full(3, np.pi / 2)  # arms straight down, tool pulled up between them
    above = (0.0, 0.0, 0.275 - np.sqrt(0.4**2 - 0.1088**2))
    d, e = arm_directions(MODEL.constants, y, above)
    status, volume, transmission = control_jacobian(MODEL.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))
    assert status == Status.SINGULAR
    assert volume < -0.1
    assert transmission > 0.1
    stretched = np.array([0.0, 0.0, 0.075 + np.sqrt(0.6**2 - 0.1088**2) - 1e-6])
    y, _ = posture_at(MODEL, stretched)
    d, e = arm_directions(MODEL.constants, y, tuple(stretched.tolist()))
    status, _, transmission = control_jacobian(MODEL.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))
    assert status == Status.SINGULAR
    assert 0.0 < transmission < 0.01


def test_compiled_inverse_names_the_arm() -> None:
    status, arm = inverse_kinematics(MODEL.constants, (0.0, -0.6, 0.3), np.empty(3), np.empty(6))
    assert (status, arm) == (Status.UNREACHABLE, 0)


@pytest.mark.parametrize(
    ("point", "message"),
    [
        (
            (0.0, 0.0, 0.9),
            "point (0.0000, 0.0000, 0.9000) m is out of reach of arm 1: the elbow gets no closer to it than 0.6321 m "
            "while the distal link is 0.4000 m long; the nearest point to work at is (0.0000, 0.0000, 0.6649) m",
        ),
        (
            (0.0, 0.1, 0.1),
            "point (0.0000, 0.1000, 0.1000) m is out of reach of arm 1: the elbow gets no farther from it than "
            "0.2265 m while the distal link is 0.4000 m long; the nearest point to work at is "
            "(0.0000, 0.0422, 0.2641) m",
        ),
        (
            (0.0, float("nan"), 0.1),
            "point (0.0000, nan, 0.1000) m is not finite: give three finite coordinates in the base frame",
        ),
    ],
)
def test_unreachable_points_are_named(point: tuple[float, float, float], message: str) -> None:
    with pytest.raises(Unreachable, match=f"^{re.escape(message)}$"):
        posture_at(MODEL, np.array(point))


def test_an_error_carries_value_limit_and_the_nearest_point() -> None:
    with pytest.raises(Unreachable) as caught:
        posture_at(MODEL, np.array([0.0, 0.0, 0.9]))
    assert caught.value.value == pytest.approx(0.6321, abs=1e-4)
    assert caught.value.limit == 0.4
    assert caught.value.nearest is not None
    jacobians_at(MODEL, caught.value.nearest)
    jacobians_at(MODEL, caught.value.nearest.round(4))  # the printed one serves too
    with pytest.raises(Unreachable) as caught:
        posture_at(MODEL, np.array([np.inf, 0.0, 0.4]))
    assert caught.value.nearest is None


def test_the_nearest_point_is_the_nearest() -> None:
    """No point of the whole workspace is nearer than the one offered, and one of its limits is just met."""
    cloud = np.array(whole_workspace())
    random = np.random.default_rng(6)
    targets = [(0.0, 0.0, 0.9), (0.5, 0.5, 0.5), (2.0, 0.0, 0.4), (0.0, 0.0, -0.5), (0.0, 0.0, 0.1)]
    targets += [tuple(p) for p in random.uniform((-0.6, -0.6, 0.0), (0.6, 0.6, 0.8), (15, 3)).tolist()]
    moved = 0
    for target in targets:
        found = nearest_point(MODEL.constants, target)
        assert found is not None
        away = float(np.linalg.norm(found - target))
        assert room(MODEL.constants, tuple(found.tolist())).min() >= 0.0
        assert away <= np.linalg.norm(cloud - target, axis=1).min() + 1e-9
        if away > 0.0:
            moved += 1
            assert room(MODEL.constants, tuple(found.tolist())).min() < 1e-4
    assert moved > 10


def test_a_point_to_work_at_is_its_own_nearest() -> None:
    point = np.array([0.1, -0.05, 0.42])
    np.testing.assert_array_equal(nearest_point(MODEL.constants, tuple(point.tolist())), point)


def test_singular_poses_are_named_with_value_limit_and_nearest_point() -> None:
    stretched = np.array([0.0, 0.0, 0.075 + np.sqrt(0.6**2 - 0.1088**2) - 1e-6])
    with pytest.raises(
        Singular,
        match=r"^point \(0\.0000, 0\.0000, 0\.6651\) m leaves an arm stretched: its elbow passes on "
        r"0\.00\d\d of its speed along the distal link, at least 0\.0100 is needed; the nearest point to work at is "
        r"\(0\.0000, 0\.0000, 0\.6649\) m$",
    ) as caught:
        jacobians_at(MODEL, stretched)
    assert 0.0 < caught.value.value < caught.value.limit == 0.01
    with pytest.raises(
        Singular,
        match=r"lies in or above the plane of the elbows: the distal links span a volume of -\d\.\d{4}, at least "
        r"0\.0010 is needed; the nearest point to work at is \(",
    ) as caught:
        jacobians_at(MODEL, np.array([-0.20, -0.08, -0.28]))
    assert caught.value.value < caught.value.limit
    assert caught.value.nearest is not None
    jacobians_at(MODEL, caught.value.nearest)


def test_transmission_in_the_room_is_that_of_the_jacobian() -> None:
    """The polynomial in the wrist's place is (d_i·e_i)²."""
    for z in workspace():
        y = posture_at(MODEL, z).y
        d, e = arm_directions(MODEL.constants, y, tuple(z.tolist()))
        squares = room(MODEL.constants, tuple(z.tolist()))[:3] + LEAST_TRANSMISSION**2
        np.testing.assert_allclose(squares, [np.dot(d[i], e[i]) ** 2 for i in range(3)], rtol=0, atol=1e-12)


def test_impossible_angles_are_named() -> None:
    message = (
        "servomotor angles (-2.5000, -1.0000, 0.0000) rad allow no pose of the tool: no point is nearer "
        "than 0.4054 m to all three elbows while the distal links are 0.4000 m long; choose angles closer to each other"
        ""
    )
    with pytest.raises(Unreachable, match=f"^{re.escape(message)}$") as caught:
        tool_point_at(MODEL, np.array([-2.5, -1.0, 0.0]))
    assert caught.value.value > caught.value.limit == 0.4
    with pytest.raises(Unreachable, match=r"\(nan, 0\.0000, 0\.0000\) rad are not finite: give three finite angles$"):
        tool_point_at(MODEL, np.array([np.nan, 0.0, 0.0]))


def test_tipped_elbows_have_a_pose_too() -> None:
    """Angles at which the elbows' plane stands upright: the pose is the one that Newton follows."""
    y = np.array([2.5, -1.6, -1.6])
    z = tool_point_at(MODEL, y)
    d, e = arm_directions(MODEL.constants, y, tuple(z.tolist()))
    assert control_jacobian(MODEL.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))[1] > 0.0
    np.testing.assert_allclose(near_in_the_loop(y, z + 1e-3)[2], z, atol=1e-9)


def test_payload_must_be_a_mass() -> None:
    with pytest.raises(ValueError, match=r"^payload is -0\.1 kg, it must be a finite mass of at least 0 kg$"):
        DeltaModel(load_parameters(), payload=-0.1)


def test_constants_are_frozen() -> None:
    with pytest.raises(ValueError, match="read-only"):
        MODEL.constants[DISTAL] = 1.0


def test_posture_is_named() -> None:
    posture = posture_at(MODEL, np.array([0.0, 0.0, 0.45]))
    assert isinstance(posture, Posture)
    assert posture.y.shape == (3,)
    assert posture.x.shape == (6,)


def test_13_as_printed_is_three_times_the_control_jacobian() -> None:
    """(12) lost the 1/3 that (8) and (9) have."""
    for z in workspace():
        y, x = posture_at(MODEL, z)
        q = constrained.coordinates(y, x)
        printed = 3.0 * constrained.virtual_jacobian(MODEL, q) @ constrained.tangent(MODEL, q)
        rows = [arm_tool_rates(arm, q) for arm in range(3)]
        by_hand = np.hstack(rows) @ constrained.tangent(MODEL, q)
        np.testing.assert_allclose(by_hand, printed, atol=1e-12)
        np.testing.assert_allclose(by_hand, 3.0 * jacobians_at(MODEL, z).control, atol=1e-12)


def arm_tool_rates(arm: int, q: FloatArray) -> FloatArray:
    """∂ψ_i/∂q_i, shape (3, 3), by complex-free central differences [m/rad]."""
    h, own = 1e-6, q[3 * arm : 3 * arm + 3]
    columns = []
    for unit in np.eye(3):
        ahead, behind = (
            np.array(arm_tool_point(MODEL.constants, arm, *(own + sign * h * unit).tolist())) for sign in (1.0, -1.0)
        )
        columns.append((ahead - behind) / (2.0 * h))
    return np.stack(columns, axis=1)


def test_the_closed_form_and_newton_stay_on_one_side_however_the_elbows_are_tipped() -> None:
    """Every point at which the Jacobians are sound comes back, also far outside the board's region."""
    random = np.random.default_rng(5)
    came_back, y = 0, np.empty(3)
    for z in random.uniform([-0.5, -0.5, -0.3], [0.5, 0.5, 0.7], (3000, 3)):
        point = tuple(z.tolist())
        if inverse_kinematics(MODEL.constants, point, y, np.empty(6))[0] != Status.OK:
            continue
        d, e = arm_directions(MODEL.constants, y, point)
        if control_jacobian(MODEL.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))[0] != Status.OK:
            continue
        assert (np.abs(y) <= np.pi).all()
        np.testing.assert_allclose(tool_point_at(MODEL, y), z, rtol=0, atol=1e-9)
        came_back += 1
    assert came_back > 300


def test_a_point_behind_the_base_is_no_pose() -> None:
    with pytest.raises(Singular, match=r"lies in or above the plane of the elbows"):
        posture_at(MODEL, np.array([0.0, 0.0, -0.3]))
    with pytest.raises(Unreachable, match="out of reach of arm 1"):
        posture_at(MODEL, np.array([1e160, 0.0, 0.0]))
