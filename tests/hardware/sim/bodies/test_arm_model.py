"""The arm as MuJoCo bodies: its loops close, it weighs what the paper says, and the controller's model agrees.

World and controller derive the robot independently from the same parameters; here each checks the other.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.task_space import TaskSpaceController
from controller.model.constants import DeltaModel
from hardware.interfaces import Command
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.sim.bodies.arm import GRIPPER_BODY_CLEARANCE, inverse_kinematics
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings, square_place

PARAMETERS = load_parameters()
CENTRE = np.array([0.0, 0.0, 0.40])
Vector = NDArray[np.float64]


class Arm:
    """The compiled arm with nothing on the table; tool points in the base frame [m]."""

    def __init__(self) -> None:
        self.model = build_model(PARAMETERS, TableSettings(), (), CENTRE, looks=False)
        self.data = mujoco.MjData(self.model)
        self.platform = [int(self.model.joint(f"platform_{axis}").dofadr[0]) for axis in "xyz"]
        self.servos = [int(self.model.joint(f"servo{i}").dofadr[0]) for i in (1, 2, 3)]

    def pose(self, tool: Vector) -> None:
        """Put the arm where inverse kinematics say."""
        joints = inverse_kinematics(PARAMETERS, tool)
        for arm in range(3):
            for name, value in zip(("servo{}", "universal{}a", "universal{}b"), joints[arm], strict=True):
                self.data.joint(name.format(arm + 1)).qpos[0] = value
        for axis, value in zip("xyz", tool, strict=True):
            self.data.joint(f"platform_{axis}").qpos[0] = value
        self.data.qvel[:] = 0.0
        mujoco.mj_kinematics(self.model, self.data)

    def gap(self) -> float:
        """Largest gap of a loop [m]."""
        ends = ((self.data.site(f"rod_end{i}"), self.data.site(f"flange_joint{i}")) for i in (1, 2, 3))
        return max(float(np.linalg.norm(rod.xpos - flange.xpos)) for rod, flange in ends)

    def angles(self) -> tuple[float, float, float]:
        a, b, c = (float(self.data.joint(f"servo{i}").qpos[0]) for i in (1, 2, 3))
        return a, b, c

    def acceleration(self, force: Vector | None = None) -> Vector:
        """Of the tool [m/s²], base frame, under the present torques and a force on the platform [N]."""
        self.data.xfrc_applied[:] = 0.0
        if force is not None:
            self.data.xfrc_applied[self.model.body("platform").id, :3] = force * [1.0, -1.0, -1.0]  # world frame
        mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qacc[self.platform])


@pytest.fixture
def arm() -> Arm:
    return Arm()


@pytest.fixture
def bare(arm: Arm) -> Arm:
    """Without friction and gravity, so that a force accelerates masses and nothing else."""
    arm.model.dof_frictionloss[:] = 0.0
    arm.model.opt.gravity[:] = 0.0
    return arm


@pytest.fixture(scope="module")
def law() -> TaskSpaceController:
    return TaskSpaceController(DeltaModel(PARAMETERS))


def workspace(count: int) -> Iterator[Vector]:
    """Tool points over the board and the trays, from the pieces' feet up."""
    rng = np.random.default_rng(17)
    for _ in range(count):
        yield rng.uniform([-0.22, -0.19, 0.30], [0.22, 0.19, 0.47])


def estimate(law: TaskSpaceController, arm: Arm) -> None:
    law.reset()
    assert law.update(arm.angles(), (0.0, 0.0, 0.0)) == 0


# ------------------------------------------------------------------------------------------------------- geometry


def test_inverse_kinematics_close_the_loops(arm: Arm) -> None:
    for tool in workspace(200):
        arm.pose(tool)
        assert arm.gap() < 1e-9
        np.testing.assert_allclose(TableSettings().base_from_board(arm.data.site("tool").xpos), tool, atol=1e-12)


def test_elbows_lie_outside_the_line_from_servomotor_to_flange(arm: Arm) -> None:
    for tool in workspace(50):
        arm.pose(tool)
        for i in (1, 2, 3):
            shaft = arm.data.joint(f"servo{i}").xanchor
            frame = arm.data.body(f"mount{i}").xmat.reshape(3, 3)  # columns: tangent, outwards, down
            _, out, down = frame.T @ (arm.data.site(f"elbow{i}").xpos - shaft)
            _, out_flange, down_flange = frame.T @ (arm.data.site(f"flange_joint{i}").xpos - shaft)
            assert out * down_flange > out_flange * down


@pytest.mark.parametrize(
    ("tool", "message"),
    [
        ((0.0, 0.0, 0.80), r"arm 1 cannot reach \[0.0, 0.0, 0.8\] m: 0.733 m away"),
        ((0.0, 0.6, 0.40), r"arm 2 cannot reach \[0.0, 0.6, 0.4\] m: 0.520 m aside"),
        ((0.45, 0.0, 0.40), r"arm 1 cannot reach \[0.45, 0.0, 0.4\] m: 0.450 m aside"),
        ((0.0, 0.1088, 0.075), r"arm 1 cannot reach \[0.0, 0.1088, 0.075\] m: 0.000 m away"),
    ],
)
def test_what_no_arm_reaches_is_refused(tool: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        inverse_kinematics(PARAMETERS, np.array(tool))


def test_a_king_fits_beside_a_gripped_pawn() -> None:
    pawn, king = PIECE_SHAPES[Kind.PAWN], PIECE_SHAPES[Kind.KING]
    assert pawn.grip_height + GRIPPER_BODY_CLEARANCE > king.height


# ------------------------------------------------------------------------------------------------------- weight


def test_the_arm_weighs_what_the_parameters_say(arm: Arm) -> None:
    m, model = PARAMETERS.inertia, arm.model
    moving = sum(float(model.body(name).mass[0]) for name in ("platform", "finger_right", "finger_left"))
    assert moving == pytest.approx(m.moving_platform_mass)
    for i in (1, 2, 3):
        assert float(model.body(f"proximal{i}").mass[0]) == m.proximal_mass
        assert float(model.body(f"distal{i}").mass[0]) == m.distal_pair_mass
    total = m.moving_platform_mass + 3.0 * (m.proximal_mass + m.distal_pair_mass)
    assert float(model.body_subtreemass[0]) == pytest.approx(total)  # what is only seen weighs nothing
    assert (model.dof_armature[arm.servos] == m.rotor_inertia).all()


def test_effective_mass_along_z1_near_the_board_is_that_of_the_papers_figure_5(bare: Arm) -> None:
    """k* = 2 raises the admittance by 10 dB: 1 + 2 m = √10. Measured by a push of 1 N on the free arm."""
    paper = (np.sqrt(10.0) - 1.0) / 2.0
    for x, y in ((0.0, 0.0), (0.14, 0.0), (0.14, 0.14), (-0.14, -0.14)):
        bare.pose(np.array([x, y, 0.44]))
        mass = 1.0 / bare.acceleration(np.array([1.0, 0.0, 0.0]))[0]
        assert mass == pytest.approx(paper, rel=0.10)


# -------------------------------------------------------------------------------------- against the controller's model


def test_the_controllers_forward_kinematics_find_the_tool(arm: Arm, law: TaskSpaceController) -> None:
    for tool in workspace(50):
        arm.pose(tool)
        estimate(law, arm)
        np.testing.assert_allclose(law.state.position, tool, atol=1e-9)


def test_the_controllers_gravity_torque_holds_the_arm(arm: Arm, law: TaskSpaceController) -> None:
    arm.model.dof_frictionloss[:] = 0.0
    for tool in workspace(50):
        arm.pose(tool)
        estimate(law, arm)
        arm.data.ctrl[:3] = law.state.gravity
        held = np.linalg.norm(arm.acceleration())
        arm.data.ctrl[:3] = 0.0
        falling = np.linalg.norm(arm.acceleration())
        assert falling > 5.0
        assert held < 0.002 * falling


@pytest.mark.parametrize("height", [0.019, 0.06, 0.104])
def test_gravity_compensation_alone_holds_the_tool_still_over_board_and_trays(
    arm: Arm, law: TaskSpaceController, height: float
) -> None:
    """Without friction it begins to fall by less than 2 mm/s²."""
    arm.model.dof_frictionloss[:] = 0.0
    table = TableSettings()
    for place in (*map(square_place, range(64)), *table.tray_places()):
        arm.pose(table.base_from_board(np.array([*table.xy(place), height])))
        estimate(law, arm)
        arm.data.ctrl[:3] = law.state.gravity
        assert np.linalg.norm(arm.acceleration()) < 0.002


@pytest.mark.slow
def test_with_friction_gravity_compensation_alone_keeps_the_tool_for_ten_seconds(law: TaskSpaceController) -> None:
    table = TableSettings()
    for place in (0, 7, 27, 36, 56, 63):
        tool = table.base_from_board(np.array([*table.xy(square_place(place)), 0.06]))
        plant = Plant(build_model(PARAMETERS, table, (), tool, looks=False), PARAMETERS, ())
        start = np.array(plant.truth(reset_peak=False).tool)
        law.reset()
        for _ in range(round(10.0 / PARAMETERS.drive.tick)):
            measured = plant.measure(standing=False)
            law.update(measured.angle, measured.velocity)
            u1, u2, u3 = law.state.gravity.tolist()
            plant.apply(Command((u1, u2, u3), 0.0, brake=False, enable=True, busy=True))
            plant.step()
        assert np.linalg.norm(np.array(plant.truth(reset_peak=False).tool) - start) < 1e-4


def test_the_controllers_task_inertia_is_the_worlds(bare: Arm, law: TaskSpaceController) -> None:
    for tool in workspace(30):
        bare.pose(tool)
        estimate(law, bare)
        mobility = np.column_stack([bare.acceleration(push) for push in np.eye(3)])
        np.testing.assert_allclose(mobility @ law.state.task_inertia, np.eye(3), atol=0.01)


def test_the_controllers_jacobian_is_the_worlds(bare: Arm, law: TaskSpaceController) -> None:
    """A torque on one shaft accelerates the tool by J_c M_y⁻¹ u."""
    for tool in workspace(30):
        bare.pose(tool)
        estimate(law, bare)
        for i in range(3):
            bare.data.ctrl[:3] = np.eye(3)[i]
            expected = law.state.jacobian @ np.linalg.inv(law.state.inertia)[:, i]
            np.testing.assert_allclose(bare.acceleration(), expected, atol=0.01 * float(np.linalg.norm(expected)))
