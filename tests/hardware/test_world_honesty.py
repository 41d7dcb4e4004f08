"""The simulated world does not cheat: pieces are moved by contacts alone, the arm by its motors, under gravity.

Three looks: the compiled model holds nothing but motors, joints and the closures of the arm's loops; no code of the
world writes the plant's state or its forces; and while a plant runs, nothing changes between two steps but what drives
and brakes may change.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import chess
import mujoco
import numpy as np
import pytest

import hardware.sim
from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.interfaces import Command
from hardware.parameters import RobotParameters, load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant import plant as plant_module
from hardware.sim.plant.plant import Plant
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.table import TableSettings

SOURCES = sorted(Path(hardware.sim.__file__).parent.rglob("*.py"))
PIECES = start_layout(chess.Board(), TableSettings())
NAMES = tuple(piece.name for piece in PIECES)
PARAMETERS = load_parameters()


def make_model() -> mujoco.MjModel:
    settings = WorldSettings(pieces=PIECES, home=MotionSettings().home, seed=7)
    return build_model(PARAMETERS, settings.table, stand_pieces(settings), np.array(settings.home))


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return make_model()


@pytest.fixture
def parameters() -> RobotParameters:
    return PARAMETERS


# ------------------------------------------------------------------------------------------------- the compiled model


def test_the_only_equalities_close_the_arms_loops(model: mujoco.MjModel) -> None:
    assert model.neq == 3
    assert (model.eq_type == mujoco.mjtEq.mjEQ_CONNECT).all()
    assert (model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE).all()
    ends = {(model.site(a).name, model.site(b).name) for a, b in zip(model.eq_obj1id, model.eq_obj2id, strict=True)}
    assert ends == {(f"rod_end{arm}", f"flange_joint{arm}") for arm in (1, 2, 3)}
    assert model.eq_active0.all()


def test_the_actuators_are_three_motors_and_a_gripper_in_velocity(
    model: mujoco.MjModel, parameters: RobotParameters
) -> None:
    assert [model.actuator(i).name for i in range(model.nu)] == ["servo1", "servo2", "servo3", "gripper"]
    for i in range(3):  # torque = command, cut at the drive's peak; no feedback inside
        assert model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        assert model.joint(model.actuator_trnid[i, 0]).name == f"servo{i + 1}"
        assert model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
        assert model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
        assert model.actuator_gainprm[i, 0] * model.actuator_gear[i, 0] == 1.0
        assert model.actuator_ctrllimited[i]
        np.testing.assert_array_equal(
            model.actuator_ctrlrange[i], [-parameters.drive.peak_torque, parameters.drive.peak_torque]
        )
    grip, gripper = 3, parameters.gripper
    assert model.actuator_trntype[grip] == mujoco.mjtTrn.mjTRN_TENDON
    assert model.tendon(model.actuator_trnid[grip, 0]).name == "opening"
    gain = model.actuator_gainprm[grip, 0]
    assert gain == 2.0 * gripper.velocity_gain  # both fingers
    np.testing.assert_array_equal(model.actuator_biasprm[grip, :3], [0.0, 0.0, -gain])  # gain × velocity error
    assert model.actuator_forcelimited[grip]
    np.testing.assert_array_equal(model.actuator_forcerange[grip], [-2.0 * gripper.max_force, 2.0 * gripper.max_force])
    np.testing.assert_array_equal(model.actuator_ctrlrange[grip], [-gripper.max_speed, gripper.max_speed])
    assert (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE).all()


def test_nothing_else_can_pull_hold_or_carry(model: mujoco.MjModel) -> None:
    assert model.nmocap == model.nplugin == model.nflex == 0
    assert mujoco.mjtTrn.mjTRN_BODY not in model.actuator_trntype  # adhesion
    assert not model.jnt_stiffness.any()
    assert not model.body_gravcomp.any()
    assert not model.opt.wind.any()
    assert model.opt.density == model.opt.viscosity == 0.0
    np.testing.assert_allclose(model.opt.gravity, [0.0, 0.0, -9.80665])
    assert model.opt.disableflags == 0


def test_tendons_and_friction_are_the_grippers_and_the_motors_alone(model: mujoco.MjModel) -> None:
    wrapped = {model.joint(i).name for i, kind in zip(model.wrap_objid, model.wrap_type, strict=True)
               if kind == mujoco.mjtWrap.mjWRAP_JOINT}  # fmt: skip
    assert (model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT).all()
    assert wrapped == {"finger_right", "finger_left"}
    motors = {int(model.joint(f"servo{i}").dofadr[0]) for i in (1, 2, 3)}
    assert set(np.flatnonzero(model.dof_frictionloss)) == motors
    assert set(np.flatnonzero(model.dof_damping)) == motors


def test_every_piece_is_one_free_body_with_its_mass(model: mujoco.MjModel) -> None:
    assert len(set(NAMES)) == 50
    for piece in PIECES:
        body = model.body(piece.name)
        assert int(body.jntnum[0]) == 1
        joint = int(body.jntadr[0])
        assert model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        assert not model.dof_damping[model.jnt_dofadr[joint] : model.jnt_dofadr[joint] + 6].any()
        assert float(body.mass[0]) == pytest.approx(PIECE_SHAPES[piece.kind].mass)
        assert int(body.parentid[0]) == 0
    others = {model.joint(i).name for i in range(model.njnt)} - set(NAMES)
    robot = {f"servo{i}" for i in (1, 2, 3)} | {f"universal{i}{c}" for i in (1, 2, 3) for c in "ab"}
    assert others == robot | {f"platform_{axis}" for axis in "xyz"} | {"finger_right", "finger_left"}


def test_pieces_touch_the_tool_and_the_deck_by_friction_within_reason(model: mujoco.MjModel) -> None:
    """No contact is sticky: friction as of wood, felt and Delrin, and no contact pulls from a distance."""
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    assert (model.geom_friction[touching, 0] <= 1.0).all()
    assert not model.geom_margin[touching].any()
    tool = {f"{part}_{side}" for part in ("pad_a", "pad_b", "bar") for side in ("right", "left")}
    near = {model.geom(int(i)).name for i in np.flatnonzero((model.geom_gap > 0.0) & touching)}
    assert near == tool | {"gripper_body", "flange"}, "a contact in a gap has no force: it keeps pieces awake"
    pairs = {(model.geom(a).name, model.geom(b).name) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    assert pairs == {
        tuple(sorted(pair, key=lambda name: model.geom(name).id))
        for pair in ((part, "deck") for part in tool | {"gripper_body", "flange"})
    }
    assert (model.pair_friction[:, :2] <= 1.0).all()
    assert not model.pair_margin.any()
    assert not model.pair_gap.any()
    pads = [i for i in range(model.ngeom) if model.geom(i).name.startswith("pad_")]
    assert len(pads) == 4
    assert (model.geom_friction[pads, 0] == PARAMETERS.pads.friction).all()


# ------------------------------------------------------------------------------------------------------- the code


STATE = {
    "qpos", "qvel", "act", "qacc", "qacc_warmstart", "time", "xpos", "xquat", "xmat", "cvel", "qfrc_applied",
    "xfrc_applied", "qfrc_passive", "mocap_pos", "mocap_quat", "eq_active", "userdata", "plugin_state",
}  # fmt: skip
"""State and forces of ``MjData``: what only the simulation itself may change."""

MAY_WRITE = {
    (
        "render.drawing",
        "SceneDrawer.arrange",
        "qpos",
    ),  # the renderer's own copy, in its own process: it is drawn, never stepped
    ("clients.viewer", "watch_world", "qpos"),  # the viewer's likewise
    ("bodies.arm", "start_positions", "qpos"),  # the key frame from which a world starts
    ("bodies.scene", "build_model", "qpos"),
    ("bodies.grasp_world", "build_block_world", "qpos"),
}

MAY_CALL = {
    "mj_step": {("plant.plant", "Plant.step"), ("plant.tick", "step_address"), ("process.journal", "step_alone")},
    "mj_resetDataKeyframe": {("plant.plant", "Plant.__init__")},
    "mj_setState": {("plant.plant", "Plant._restore")},
    "mj_stateSize": {
        ("plant.plant", "Plant._restore"),
        ("plant.snapshot", "save_snapshot"),
        ("plant.live_state", "LiveState.__init__"),
    },
    "mj_getState": {
        ("plant.snapshot", "save_snapshot"),
        ("plant.live_state", "LiveState.__init__"),
        ("plant.live_state", "LiveState.keep"),
    },
    "mj_forward": {("plant.plant", "Plant.__init__"), ("render.drawing", "SceneDrawer.__init__")},
    "mj_kinematics": {
        ("render.drawing", "SceneDrawer.arrange"),
        ("render.rasteriser", "Rasteriser.__init__"),
        ("clients.viewer", "watch_world"),
    },
    "mj_camlight": {
        ("render.drawing", "SceneDrawer.see"),
        ("render.drawing", "SceneDrawer._see_depth"),
        ("render.rasteriser", "Rasteriser.__init__"),
        ("clients.viewer", "watch_world"),
    },
    "mj_name2id": {("render.shapes", "coarse_shape_of")},
    "mj_saveModel": {
        ("process.server", "World.__init__"),
        ("render.still", "StillRenderer.__init__"),
    },
}
"""The only functions of MuJoCo that take a whole simulation, and where they are called."""


def functions(tree: ast.Module) -> Iterator[tuple[str, ast.AST]]:
    """Every statement's innermost function, as ``Class.method`` or ``function`` ("" at the top), with each node."""

    def walk(node: ast.AST, owner: str) -> Iterator[tuple[str, ast.AST]]:
        for child in ast.iter_child_nodes(node):
            inner = owner
            if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                inner = f"{owner}.{child.name}" if owner else child.name
            yield inner, child
            yield from walk(child, inner)

    yield from walk(tree, "")


def written(node: ast.AST) -> set[str]:
    """Attributes that a statement writes, whole or in part: targets of assignments, in-place methods, ``out=``."""
    targets: list[ast.expr] = []
    if isinstance(node, ast.Assign | ast.Delete):
        targets = node.targets
    elif isinstance(node, ast.AugAssign | ast.AnnAssign | ast.For | ast.NamedExpr):
        targets = [node.target]
    elif isinstance(node, ast.With):
        targets = [item.optional_vars for item in node.items if item.optional_vars is not None]
    elif isinstance(node, ast.Call):
        targets = [keyword.value for keyword in node.keywords if keyword.arg == "out"]
        if isinstance(node.func, ast.Attribute) and node.func.attr in {"fill", "put", "sort", "itemset", "setfield"}:
            targets.append(node.func.value)
        if isinstance(node.func, ast.Attribute) and node.func.attr in {"copyto", "put", "place", "putmask"}:
            targets += node.args[:1]
    return {name for target in targets for name in _written_names(target)}


def _written_names(target: ast.expr) -> Iterator[str]:
    """Attributes written; and variables of which a part is written, since they may be a second name of the state."""
    if isinstance(target, ast.Tuple | ast.List):
        for element in target.elts:
            yield from _written_names(element)
    elif isinstance(target, ast.Attribute):
        yield target.attr
        yield from _written_names(target.value)
    elif isinstance(target, ast.Subscript | ast.Starred):
        yield from _written_names(target.value)
        if isinstance(target.value, ast.Name):
            yield target.value.id


def second_names(owner: str, tree: ast.Module) -> set[str]:
    """Variables of a function that are bound to a view of the state."""
    names = set()
    for function, node in functions(tree):
        if function == owner and isinstance(node, ast.Assign):
            values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
            if any(isinstance(value, ast.Attribute) and value.attr in STATE for value in values):
                names |= {n.id for target in node.targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return names


def state_written(tree: ast.Module) -> set[tuple[str, str]]:
    """Each function that writes state or forces, and under which name."""
    return {
        (owner, name)
        for owner, node in functions(tree)
        for name in written(node)
        if name in STATE | second_names(owner, tree)
    }


@cache
def parsed() -> dict[str, ast.Module]:
    room = Path(hardware.sim.__file__).parent
    names = {path: ".".join(path.relative_to(room).with_suffix("").parts) for path in SOURCES}
    return {name: ast.parse(path.read_text(encoding="utf-8")) for path, name in names.items()}


@pytest.mark.parametrize(
    "text",
    [
        "self.data.qpos[3] = 1.0", "data.qvel[:] += 2", "a, d.xfrc_applied[0] = 1, 2", "d.qpos.fill(0)", "d.qpos = q",
        "np.copyto(d.qpos, q)", "np.add(a, b, out=d.qvel)", "d.eq_active[0] = 0", "d.mocap_pos[0, 2:] = z",
        "for d.qpos[0] in range(3): pass", "def f():\n    q = d.qpos\n    q[0] = 1.0",
        "q, v = d.qpos, d.qvel\nv += 1\nq[:] = 0",
    ],
)  # fmt: skip
def test_the_search_sees_every_way_to_write(text: str) -> None:
    assert state_written(ast.parse(text))


@pytest.mark.parametrize("text", ["q = d.qpos\nx = q[0]", "p = np.array(d.qpos)\np[0] = 1.0", "d.ctrl[0] = d.qpos[0]"])
def test_reading_is_no_writing(text: str) -> None:
    assert not state_written(ast.parse(text))


def test_no_code_of_the_world_writes_state_or_forces() -> None:
    assert len(parsed()) > 50, "the search sees the whole room"
    found = {(module, owner, name) for module, tree in parsed().items() for owner, name in state_written(tree)}
    assert found == MAY_WRITE


def test_simulations_are_stepped_and_reset_in_one_place_only() -> None:
    allowed = {name: set(places) for name, places in MAY_CALL.items()}
    for module, tree in parsed().items():
        for owner, node in functions(tree):
            if isinstance(node, ast.Attribute | ast.Name):
                name = node.attr if isinstance(node, ast.Attribute) else node.id
                if name.startswith(("mj_", "set_mjcb")):
                    assert (module, owner) in allowed.get(name, set()), f"{name} in {module}: {owner}"


# ------------------------------------------------------------------------------------------------------ a running plant


class Watch:
    """Stands between plant and MuJoCo: notes whether anything was changed since the step before."""

    def __init__(self, step: Callable[..., None]) -> None:
        self._step = step
        self._state: tuple[bytes, ...] | None = None
        self.steps = 0

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        now = self._snapshot(data)
        assert self._state is None or now == self._state, "something wrote the state between two steps"
        assert not data.xfrc_applied.any()
        assert not data.qfrc_applied.any()
        self._step(model, data)
        self._state = self._snapshot(data)
        self.steps += 1

    @staticmethod
    def _snapshot(data: mujoco.MjData) -> tuple[bytes, ...]:
        parts = (data.qpos, data.qvel, data.act, data.qacc_warmstart, data.eq_active, np.array([data.time]))
        return tuple(part.tobytes() for part in parts)


def model_bytes(model: mujoco.MjModel) -> Any:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer


def run_hard(plant: Plant) -> None:
    """Brakes, free fall, torques at random up to beyond the peak, both ways of the fingers, watchdog, questions."""
    rng = np.random.default_rng(5)
    for tick in range(600):
        u = tuple(float(t) for t in rng.uniform(-12.0, 12.0, 3))
        finger = 0.05 if tick % 200 < 100 else -0.05
        plant.apply(Command((u[0], u[1], u[2]), finger, brake=tick < 30, enable=tick % 150 > 20, busy=True))
        if tick == 400:
            plant.trip_watchdog()
        plant.step()
        plant.measure(standing=False)
        if tick % 50 == 0:
            plant.truth(reset_peak=True)
            plant.digest()
            plant.positions()[:] = 0.0


def test_between_two_steps_nothing_changes_but_commands_and_brakes(monkeypatch: pytest.MonkeyPatch) -> None:
    model = make_model()
    before = model_bytes(model)
    plant = Plant(model, PARAMETERS, NAMES)
    watch = Watch(mujoco.mj_step)
    monkeypatch.setattr(plant_module.mujoco, "mj_step", watch)
    plant.watch_step = lambda: None  # every step by Python: to the last bit as by the compiled tick, see below
    start = plant.positions()
    run_hard(plant)
    assert watch.steps >= 600
    assert np.abs(plant.positions() - start).max() > 0.05  # it moved, and by torques alone
    motors = [int(model.joint(f"servo{i}").dofadr[0]) for i in (1, 2, 3)]
    model.dof_frictionloss[motors] = PARAMETERS.friction.coulomb  # the brakes
    assert (model_bytes(model) == before).all()


def test_the_compiled_tick_does_what_mujocos_step_does() -> None:
    model = make_model()
    compiled, stepped = Plant(model, PARAMETERS, NAMES), Plant(make_model(), PARAMETERS, NAMES)
    stepped.watch_step = lambda: None
    run_hard(compiled)
    run_hard(stepped)
    assert compiled.digest() == stepped.digest()
    assert compiled.measure(standing=False) == stepped.measure(standing=False)
    assert compiled.truth(reset_peak=False) == stepped.truth(reset_peak=False)


def test_the_watch_would_notice(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = Plant(make_model(), PARAMETERS, NAMES)
    monkeypatch.setattr(plant_module.mujoco, "mj_step", Watch(mujoco.mj_step))
    plant.watch_step = lambda: None
    plant.step()
    plant.data.qpos[-1] += 1e-9
    with pytest.raises(AssertionError, match="something wrote the state between two steps"):
        plant.step()
