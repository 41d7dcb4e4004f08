"""The dynamics linear in base parameters say what the inverse dynamics say, for robots of all kinds; and all count."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from controller.model.base_parameters import NAMES, UNITS, base_of, regressor, robot_with
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.demand import torque_demand
from controller.model.kinematics import OK, arm_directions, control_jacobian, spheres_meet
from controller.model.second_order import tool_drift
from controller.offline import constrained
from controller.offline.simulation import ConstrainedArm
from hardware.parameters import RobotParameters, load_parameters
from hardware.sim.process.randomisation import Randomisation, uneven, weighed

NO_FRICTION = np.zeros(3)


def robot(seed: int) -> RobotParameters:
    ranges = Randomisation(arm_mass=0.3, arm_inertia=0.3, arm_friction=0.5)
    rng = np.random.default_rng(seed)
    drawn = uneven(ranges, weighed(0.3, load_parameters(), rng), rng)
    return drawn.with_arms([drawn.arm(number)._replace(viscous=0.0, coulomb=0.0) for number in range(3)])


class States(NamedTuple):
    """Of one robot: q and v of all nine coordinates, and the change of the servomotors' rates."""

    q: FloatArray  # (n, 9) [rad]
    v: FloatArray  # (n, 9) [rad/s]
    change: FloatArray  # (n, 3) [rad/s²]

    @property
    def motion(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of the servomotors."""
        return self.q[:, constrained.MEASURED], self.v[:, constrained.MEASURED], self.change


def states(model: DeltaModel, number: int) -> States:
    rng, arm = np.random.default_rng(5), ConstrainedArm(model)
    places = rng.uniform((-0.17, -0.17, 0.3), (0.17, 0.17, 0.42), (number, 3))
    motions = [arm.at(place, rng.uniform(-1.0, 1.0, 3)) for place in places]
    q, v = (np.array([getattr(one, name) for one in motions]) for name in ("q", "v"))
    return States(q, v, rng.uniform(-80.0, 80.0, (number, 3)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_torques_are_linear_in_the_base_parameters(seed: int) -> None:
    """Against the constrained dynamics in nine coordinates, which Pinocchio confirms."""
    parameters = robot(seed)
    model = DeltaModel(parameters)
    arm, at = ConstrainedArm(model), states(model, 100)
    wanted = np.array([arm.torques(*row).torque for row in zip(*at, strict=True)])
    found = regressor(model.constants, *at.motion) @ base_of(parameters)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)


def test_they_are_those_that_the_planner_expects() -> None:
    parameters = robot(4)
    model = DeltaModel(parameters)
    at = states(model, 50)
    rows = []
    for y, rate, change in zip(*at.motion, strict=True):
        status, z = spheres_meet(model.constants, *y.tolist())
        assert status == OK
        d, e = arm_directions(model.constants, y, z)
        jacobian, inverse = np.empty((3, 3)), np.empty((3, 3))
        control_jacobian(model.constants, d, e, jacobian, inverse)
        drift = tool_drift(model.constants, y, rate, d, e, jacobian)
        rows.append(np.concatenate((z, jacobian @ rate, jacobian @ change + drift)))
    status, _, wanted, _ = torque_demand(model.constants, 0.05, np.array(rows))
    assert status == OK
    np.testing.assert_allclose(regressor(model.constants, *at.motion) @ base_of(parameters), wanted, rtol=0, atol=1e-9)


def test_no_base_parameter_can_be_told_by_the_others() -> None:
    """By singular values; a robot's lengths alone decide."""
    model = DeltaModel(load_parameters())
    columns = regressor(model.constants, *states(model, 200).motion).reshape(-1, len(NAMES))
    scaled = columns / np.linalg.norm(columns, axis=0)
    values = np.linalg.svd(scaled, compute_uv=False)
    assert values[-1] / values[0] > 0.02
    assert len(UNITS) == len(NAMES)


def test_a_robot_is_made_again_from_its_base_parameters() -> None:
    drawn = robot(9)
    made = robot_with(load_parameters(), base_of(drawn), NO_FRICTION, NO_FRICTION)
    np.testing.assert_allclose(base_of(made), base_of(drawn), rtol=1e-12)
    for number in range(3):
        assert made.arm(number) == pytest.approx(drawn.arm(number))


def test_numbers_of_no_robot_are_refused() -> None:
    base = base_of(load_parameters())
    base[6] = -0.01
    with pytest.raises(ValueError, match="positive mass"):
        robot_with(load_parameters(), base, NO_FRICTION, NO_FRICTION)
