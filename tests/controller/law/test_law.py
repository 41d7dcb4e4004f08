"""The law in closed loop with the paper's constrained dynamics, and the controller as the server sees it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba.core.runtime import _nrt_python

from controller.law import task_space as law
from controller.law.settings import LawSettings
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import PAIR, ROW, STATUS, TABLE, VECTOR, FloatArray, Vector, compiled_as
from controller.model.constants import DeltaModel
from controller.model.demand import torque_demand
from controller.model.kinematics import Status
from controller.model.reach import posture_at
from controller.model.state import REFERENCE_SIZE, blank_state, load_model
from controller.offline import constrained
from hardware.parameters import load_parameters

MODEL = DeltaModel(load_parameters())
TICK = MODEL.parameters.drive.tick
CENTRE = (0.0, 0.0, 0.45)
STILL = (0.0, 0.0, 0.0)


def triple(values: FloatArray) -> tuple[float, float, float]:
    a, b, c = values.tolist()
    return a, b, c


class Plant:
    """The robot of (2) with friction in its shafts, RK4 with one step a tick, torque held during it."""

    def __init__(self, model: DeltaModel, point: tuple[float, float, float], friction_speed: float = 0.05) -> None:
        self.model, self.friction_speed = model, friction_speed
        self.state = np.concatenate([constrained.coordinates(*posture_at(model, np.array(point))), np.zeros(9)])

    @property
    def angle(self) -> tuple[float, float, float]:
        return triple(self.state[:9][constrained.MEASURED])

    @property
    def velocity(self) -> tuple[float, float, float]:
        return triple(self.state[9:][constrained.MEASURED])

    @property
    def tool(self) -> FloatArray:
        return constrained.tool_points(self.model, self.state[:9]).mean(axis=0)

    def rates(self, state: FloatArray, torque: tuple[float, float, float], force: FloatArray) -> FloatArray:
        q, v = state[:9], state[9:]
        applied = constrained.input_matrix() @ np.array(torque) + constrained.virtual_jacobian(self.model, q).T @ force
        applied -= constrained.friction_torque(self.model, v, self.friction_speed)
        return np.concatenate([v, constrained.acceleration(self.model, q, v, applied, (4e4, 4e2))])

    def tick(self, torque: tuple[float, float, float], force: tuple[float, float, float] = STILL) -> None:
        push = np.array(force)
        k1 = self.rates(self.state, torque, push)
        k2 = self.rates(self.state + TICK / 2 * k1, torque, push)
        k3 = self.rates(self.state + TICK / 2 * k2, torque, push)
        k4 = self.rates(self.state + TICK * k3, torque, push)
        self.state = self.state + TICK / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def run(plant: Plant, controller: TaskSpaceController, reference: Callable[[float], FloatArray], ticks: int) -> Any:
    """Tool points at the start of each tick, shape (ticks, 3)."""
    found = np.empty((ticks, 3))
    for k in range(ticks):
        assert controller.update(plant.angle, plant.velocity) is Status.OK
        found[k] = controller.state.position
        plant.tick(controller.torque(reference(k * TICK)))
    return found


def test_estimate_agrees_with_the_plant() -> None:
    plant, controller = Plant(MODEL, (0.1, 0.05, 0.42)), TaskSpaceController(MODEL)
    before = plant.tool
    for _ in range(20):
        plant.tick((0.4, -0.8, 0.1))
    assert controller.update(plant.angle, plant.velocity) is Status.OK
    state = controller.state
    np.testing.assert_allclose(state.position, plant.tool, rtol=0, atol=1e-7)
    expected = constrained.virtual_jacobian(MODEL, plant.state[:9]) @ plant.state[9:]
    np.testing.assert_allclose(state.velocity, expected, rtol=0, atol=1e-5)
    x = posture_at(MODEL, state.position).x
    np.testing.assert_allclose(x, plant.state[:9][constrained.UNMEASURED], rtol=0, atol=1e-6)
    assert np.linalg.norm(plant.tool - before) > 1e-3


def test_a_step_in_z1_follows_the_linear_law_and_leaves_the_others() -> None:
    """What (23) neglects, the velocity terms, shows as a few per cent; so does holding the torque for a tick."""
    omega, size = 30.0, 0.01
    reference = pack_reference((size, 0.0, 0.45), stiffness=(omega**2,) * 3, damping=(2 * omega,) * 3)
    plant, controller = Plant(MODEL, CENTRE), TaskSpaceController(MODEL)
    found = run(plant, controller, lambda _: reference, 400)
    time_ = np.arange(400) * TICK
    linear = size * (1.0 - (1.0 + omega * time_) * np.exp(-omega * time_))
    error = np.abs(found[:, 0] - linear).max() / size
    aside = np.abs(found[:, 1:] - CENTRE[1:]).max() / size
    print(f"10 mm step: {100 * error:.2f} % from the linear law, {100 * aside:.2f} % into z2 and z3")
    assert error < 0.02
    assert aside < 0.02
    np.testing.assert_allclose(found[-1], (size, 0.0, 0.45), atol=1e-5)


def test_each_direction_has_its_own_impedance() -> None:
    """Off the centre, where the joint inertia is far from diagonal: each error decays by its own law."""
    omega = np.array([20.0, 35.0, 50.0])
    start, goal = np.array([0.12, -0.1, 0.45]), np.array([0.125, -0.105, 0.445])
    reference = pack_reference(triple(goal), stiffness=triple(omega**2), damping=triple(2.0 * omega))
    found = run(Plant(MODEL, triple(start)), TaskSpaceController(MODEL), lambda _: reference, 400)
    t = np.arange(400)[:, None] * TICK
    linear = goal + (start - goal) * (1.0 + omega * t) * np.exp(-omega * t)
    error = np.abs(found - linear).max(axis=0) / 0.005
    print(f"5 mm step in three directions: {(100 * error).round(2)} % from the linear laws")
    assert error.max() < 0.03


def test_a_fast_circle_is_tracked_within_the_neglected_terms() -> None:
    """0.8 m/s on a circle of 0.1 m: 6.4 m/s² of acceleration is asked and fed forward."""
    omega, radius, speed = 70.0, 0.1, 0.8
    gains: dict[str, Any] = {"stiffness": (omega**2,) * 3, "damping": (2 * omega,) * 3}

    def reference(t: float) -> FloatArray:
        # the angle starts from rest with continuous acceleration and reaches its speed after 0.3 s
        ramp, rate = 0.3, speed / radius
        s = min(t / ramp, 1.0)
        phi = rate * ramp * (s**3 - s**4 / 2.0) + rate * max(t - ramp, 0.0)
        phi_1, phi_2 = rate * (3 * s**2 - 2 * s**3), rate * (6 * s - 6 * s**2) / ramp
        along, inward = np.array([-np.sin(phi), np.cos(phi), 0.0]), np.array([-np.cos(phi), -np.sin(phi), 0.0])
        position = np.array([0.0, 0.0, 0.45]) - radius * inward
        acceleration = radius * (phi_2 * along + phi_1**2 * inward)
        return pack_reference(
            triple(position), velocity=triple(radius * phi_1 * along), acceleration=triple(acceleration), **gains
        )

    found = run(Plant(MODEL, (radius, 0.0, 0.45)), TaskSpaceController(MODEL), reference, 900)
    wanted = np.array([reference(k * TICK)[:3] for k in range(900)])
    worst = np.linalg.norm(found - wanted, axis=1).max()
    print(f"circle of 0.1 m at 0.8 m/s: {1e3 * worst:.3f} mm at worst")
    assert worst < 0.5e-3


@pytest.mark.parametrize("pad", ["right", "left"])
def test_a_pushed_finger_yields_in_the_direction_of_the_push(pad: str) -> None:
    """An object on the right pad pushes the tool to +z1, on the left one to -z1: by (1/m + k*) F."""
    force, gain = 0.5, 2.0
    sign = 1.0 if pad == "right" else -1.0
    tactile = (force, 0.0) if pad == "right" else (0.0, force)
    plant, controller = Plant(MODEL, CENTRE), TaskSpaceController(MODEL)
    assert controller.update(plant.angle, plant.velocity) is Status.OK
    torque = controller.torque(pack_reference(CENTRE, tactile_gain=gain), tactile)
    rates = plant.rates(plant.state, torque, np.array([sign * force, 0.0, 0.0]))[9:]
    accelerated = controller.state.jacobian @ rates[constrained.MEASURED]
    expected = sign * force * (gain + 1.0 / controller.state.task_inertia[0, 0])
    np.testing.assert_allclose(accelerated, (expected, 0.0, 0.0), rtol=0, atol=1e-9)
    assert controller.state.asked[0] == pytest.approx(sign * gain * force)


def test_equal_forces_on_both_pads_move_nothing() -> None:
    controller = TaskSpaceController(MODEL)
    controller.update(triple(posture_at(MODEL, np.array(CENTRE)).y), STILL)
    torque = controller.torque(pack_reference(CENTRE, tactile_gain=2.0), (5.0, 5.0))
    np.testing.assert_allclose(torque, controller.holding_torque(), rtol=0, atol=1e-15)


def test_friction_is_compensated_when_asked_for() -> None:
    """A push against the low stiffness of a soft axis: friction pulls it off its law, the compensation mends that."""
    reference = pack_reference((0.02, 0.0, 0.45), stiffness=(100.0,) * 3, damping=(20.0,) * 3)
    t = np.arange(500) * TICK
    linear = 0.02 * (1.0 - (1.0 + 10.0 * t) * np.exp(-10.0 * t))
    errors = {}
    for switch in (True, False):
        controller = TaskSpaceController(MODEL, LawSettings(friction_compensation=switch))
        found = run(Plant(MODEL, CENTRE), controller, lambda _: reference, 500)
        errors[switch] = np.abs(found[:, 0] - linear).max()
    print(f"soft step: {1e3 * errors[True]:.3f} mm off with compensation, {1e3 * errors[False]:.3f} mm without")
    assert errors[True] < 0.2e-3
    assert errors[False] > 5.0 * errors[True]


def test_friction_switched_off_is_zero() -> None:
    controller = TaskSpaceController(MODEL, LawSettings(friction_compensation=False))
    y = triple(posture_at(MODEL, np.array(CENTRE)).y)
    controller.update(y, (1.0, -1.0, 2.0))
    assert not controller.state.friction.any()
    controller = TaskSpaceController(MODEL)
    controller.update(y, (1.0, -1.0, 2.0))
    np.testing.assert_allclose(controller.state.friction, (0.024, -0.024, 0.028), rtol=1e-6)


def test_a_payload_is_carried_without_sag() -> None:
    loaded = DeltaModel(load_parameters(), payload=0.03)
    reference = pack_reference(CENTRE, stiffness=(400.0,) * 3, damping=(40.0,) * 3)
    sag = {}
    for name, known in (("known", loaded), ("unknown", MODEL)):
        controller = TaskSpaceController(MODEL)
        controller.use(known)
        sag[name] = run(Plant(loaded, CENTRE), controller, lambda _: reference, 500)[-1, 2] - CENTRE[2]
    assert sag["known"] == pytest.approx(0.0, abs=1e-6)
    assert sag["unknown"] == pytest.approx(0.03 * 9.80665 / (400.0 * 1.23), rel=0.05)


def test_holding_torque_is_gravity_alone() -> None:
    plant, controller = Plant(MODEL, (0.14, -0.14, 0.45)), TaskSpaceController(MODEL)
    controller.update(plant.angle, plant.velocity)
    assert controller.holding_torque() == triple(controller.state.gravity)
    for _ in range(50):
        plant.tick(controller.holding_torque())
    np.testing.assert_allclose(plant.tool, (0.14, -0.14, 0.45), atol=1e-9)


def test_a_bad_measurement_is_reported_and_the_next_one_starts_cold() -> None:
    controller = TaskSpaceController(MODEL)
    y = triple(posture_at(MODEL, np.array(CENTRE)).y)
    assert controller.update(y, STILL) is Status.OK
    assert controller.update((y[0], float("nan"), y[2]), STILL) is Status.NOT_CONVERGED
    np.testing.assert_allclose(controller.state.position, CENTRE, atol=1e-12)  # stale, not spoiled
    assert controller.update(y, STILL) is Status.OK
    assert controller.update((-2.5, -1.0, 0.0), STILL) in (Status.NOT_CONVERGED, Status.SINGULAR)
    assert controller.update((-2.5, -1.0, 0.0), STILL) is Status.UNREACHABLE
    assert controller.update(y, STILL) is Status.OK
    assert controller.state.quality[2] == 0.0  # the closed form left Newton nothing to do
    np.testing.assert_allclose(controller.state.position, CENTRE, atol=1e-12)


def test_a_jump_beyond_the_warm_start_is_found_after_reset() -> None:
    controller = TaskSpaceController(MODEL)
    controller.update(triple(posture_at(MODEL, np.array(CENTRE)).y), STILL)
    controller.reset()
    far = np.array([0.15, -0.15, 0.38])
    assert controller.update(triple(posture_at(MODEL, far).y), STILL) is Status.OK
    np.testing.assert_allclose(controller.state.position, far, atol=1e-10)
    assert controller.state.quality[2] == 0.0


def test_reference_layout_and_longer_rows() -> None:
    reference = pack_reference(
        (1.0, 2.0, 3.0),
        velocity=(4.0, 5.0, 6.0),
        acceleration=(7.0, 8.0, 9.0),
        stiffness=(10.0, 11.0, 12.0),
        damping=(13.0, 14.0, 15.0),
        tactile_gain=16.0,
    )
    assert reference.tolist() == list(range(1, REFERENCE_SIZE + 1))
    controller = TaskSpaceController(MODEL)
    controller.update(triple(posture_at(MODEL, np.array(CENTRE)).y), (0.1, 0.2, 0.3))
    rows = np.full((3, 19), np.nan)
    rows[1, :16] = reference
    assert controller.torque(rows[1], (0.3, 0.1)) == controller.torque(reference, (0.3, 0.1))


def moving_controller() -> tuple[TaskSpaceController, FloatArray]:
    controller = TaskSpaceController(MODEL)
    assert controller.update(triple(posture_at(MODEL, np.array((0.1, -0.05, 0.42))).y), (1.0, -2.0, 0.5)) is Status.OK
    reference = pack_reference(
        (0.11, -0.05, 0.41),
        acceleration=(1.0, 2.0, -1.0),
        stiffness=(400.0,) * 3,
        damping=(40.0,) * 3,
        tactile_gain=2.0,
    )
    return controller, reference


def test_exact_task_law_adds_to_the_approximate_one_just_what_that_neglects() -> None:
    """In the tool's acceleration: u - u' = M_y J_c⁻¹ residual; at rest they are one law."""
    controller, reference = moving_controller()
    approximate, exact = (np.array(u) for u in (controller.torque(reference), controller.exact_task_torque(reference)))
    state = controller.state
    missed = state.inertia @ state.jacobian_inverse @ np.array(controller.residual())
    np.testing.assert_allclose(approximate - exact, missed, rtol=0, atol=1e-13)
    assert np.abs(missed).max() > 0.01
    controller.update(triple(posture_at(MODEL, np.array(CENTRE)).y), STILL)
    np.testing.assert_allclose(controller.exact_task_torque(reference), controller.torque(reference), atol=1e-13)
    assert controller.residual() == (0.0, 0.0, 0.0)


def test_exact_laws_are_pure_functions_of_state_and_reference() -> None:
    controller, reference = moving_controller()
    controller.torque(reference)
    before = {name: getattr(controller.state, name).copy() for name in controller.state.__slots__}
    joints = np.concatenate([controller.state.angle, np.zeros(6), np.full(3, 100.0), np.full(3, 20.0), [9.0]])
    first = (
        controller.exact_joint_torque(joints),
        controller.exact_task_torque(reference, (0.5, 0.1)),
        controller.residual(),
    )
    again = (
        controller.exact_joint_torque(joints),
        controller.exact_task_torque(reference, (0.5, 0.1)),
        controller.residual(),
    )
    assert first == again
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(controller.state, name), values)
    pushed, free = (np.array(controller.exact_task_torque(reference, pads)) for pads in ((0.5, 0.1), (0.0, 0.0)))
    along = controller.state.inertia @ controller.state.jacobian_inverse[:, 0]
    np.testing.assert_allclose(pushed - free, 2.0 * 0.4 * along, rtol=0, atol=1e-14)


def test_settings_refuse_what_they_do_not_know() -> None:
    with pytest.raises(ValueError, match="Extra inputs are not permitted"):
        LawSettings.model_validate({"friction": True})


@compiled_as(STATUS(TABLE, VECTOR, VECTOR))
def idle(state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Takes what `estimate` takes: Numba allocates a handle for each array passed in."""
    return 0


@compiled_as(STATUS(TABLE, VECTOR, VECTOR))
def wasteful(state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Makes an array."""
    made = state * 2.0
    made[0, 0] += np.sum(made)
    return int(made[0, 0])


@compiled_as(VECTOR(TABLE, ROW, PAIR))
def idle_law(state: FloatArray, reference: FloatArray, tactile: tuple[float, float]) -> Vector:
    """Takes what `task_space_law` takes."""
    return 0.0, 0.0, 0.0


def test_the_loop_allocates_no_array() -> None:
    def allocations(call: Callable[[], object]) -> int:
        call()
        before = int(_nrt_python.memsys_get_stats_alloc())
        call()
        return int(_nrt_python.memsys_get_stats_alloc()) - before

    state, reference = blank_state(), pack_reference(CENTRE)
    load_model(state, MODEL)
    inputs = (state, (0.5, 0.5, 0.5), STILL)
    _nrt_python.memsys_enable_stats()
    try:
        least = allocations(lambda: idle(*inputs))
        assert allocations(lambda: wasteful(*inputs)) > least
        assert allocations(lambda: law.estimate(*inputs)) == least
        least = allocations(lambda: idle_law(state, reference, (0.0, 0.0)))
        assert allocations(lambda: law.task_space_law(state, reference, (0.0, 0.0))) == least
    finally:
        _nrt_python.memsys_disable_stats()


def test_the_loop_never_compiles() -> None:
    compiled: Any = (law.estimate, law.task_space_law)
    controller = TaskSpaceController(MODEL)
    assert controller.update((0, 1, 0), (0, 0, 0)) is Status.OK  # integers would be another type to Numba
    controller.torque(pack_reference((0, 0, 0)), (0, 0))
    assert [len(function.signatures) for function in compiled] == [1, 1]


def test_the_demand_of_a_motion_is_what_the_exact_law_gives_on_it() -> None:
    """With the reference's acceleration and no error: row by row what `exact_task_law` computes from the same state."""
    rng = np.random.default_rng(2)
    motion = np.column_stack(
        [
            rng.uniform((-0.2, -0.2, 0.30), (0.2, 0.2, 0.46), (40, 3)),
            rng.normal(0.0, 0.7, (40, 3)),
            rng.normal(0.0, 10.0, (40, 3)),
        ]
    )
    status, _, torque, holding = torque_demand(MODEL.constants, LawSettings().coulomb_speed, motion)
    assert status == Status.OK
    controller = TaskSpaceController(MODEL)
    for row, asked, held in zip(motion, torque, holding, strict=True):
        controller.reset()
        angles = triple(posture_at(MODEL, row[:3]).y)
        assert controller.update(angles, STILL) is Status.OK
        controller.update(angles, triple(controller.state.jacobian_inverse @ row[3:6]))
        reference = pack_reference(triple(row[:3]), acceleration=triple(row[6:9]))
        np.testing.assert_allclose(asked, controller.exact_task_torque(reference), rtol=0, atol=1e-9)
        np.testing.assert_allclose(held, controller.holding_torque(), rtol=0, atol=1e-9)


def test_a_motion_out_of_reach_is_said_to_be_so_with_its_row() -> None:
    motion = np.zeros((5, 9))
    motion[:, 2], motion[3, 0] = 0.4, 2.0
    status, row, _, _ = torque_demand(MODEL.constants, 0.05, motion)
    assert (status, row) == (Status.UNREACHABLE, 3)
