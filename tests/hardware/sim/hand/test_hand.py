"""The simulated person's hand in physics: what it takes and puts, what it leaves alone, and what it feels."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import chess
import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from app.pieces.layout import start_layout
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.constants import DeltaModel
from hardware.interfaces import Command, Triple
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.referee import PiecePose
from hardware.sim.bodies.finger_world import MASS, STIFFNESS, Finger, build_finger_world, finger_force
from hardware.sim.bodies.hand import JOINTS, SKIN_MASS, STRENGTH, add_hand, parked, seen_from_above
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.hand.actions import (
    Action,
    HandSettings,
    Hesitate,
    Hover,
    Knock,
    Move,
    Put,
    Rest,
    Slide,
    Take,
    Withdraw,
)
from hardware.sim.hand.hand import Hand
from hardware.sim.hand.routines import HandFailed, Routines
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.snapshot import load_snapshot, save_snapshot
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.table import PieceSpec, Place, TableSettings

TABLE = TableSettings()
PARAMETERS = load_parameters()
TICK = PARAMETERS.drive.tick
HOME = (0.0, -0.075, 0.145)
"""The tool between plies, board frame [m]; as ``MotionSettings.home``."""
BRAKED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
TOLERANCE = 0.0075
"""Of where a piece is put down: the person's limit along both axes [m]."""


def xy(place: str) -> tuple[float, float]:
    return TABLE.xy(Place.parse(place))


class Table:
    """A plant with a hand, stepped here; the arm stands on its brakes."""

    def __init__(
        self,
        pieces: tuple[PieceSpec, ...] = (),
        *,
        side: Colour = Colour.WHITE,
        seed: int = 1,
        tool: tuple[float, float, float] = HOME,
        state: Path | None = None,
    ) -> None:
        home = TABLE.base_from_board(np.array(tool))
        world = WorldSettings(pieces=pieces, home=(home[0], home[1], home[2]), seed=seed)
        model = build_model(
            PARAMETERS, TABLE, stand_pieces(world), home, looks=False, add=partial(add_hand, side=side)
        )  # fmt: skip
        self.plant = Plant(model, PARAMETERS, tuple(p.name for p in pieces), load_snapshot(state) if state else None)
        self.plant.apply(BRAKED)
        self.hand = Hand(self.plant, HandSettings(side=side), pieces, TABLE, seed)

    def step(self, ticks: int, each: Callable[[], None] | None = None) -> None:
        for _ in range(ticks):
            self.hand.drive()
            self.plant.step()
            if each is not None:
                each()

    def finish(self, each: Callable[[], None] | None = None) -> str:
        """Until the hand has nothing to do; why it failed."""
        for _ in range(60000):
            if not self.hand.busy:
                return self.hand.failed
            self.step(1, each)
        raise AssertionError("the hand does not come to an end")

    def do(self, *actions: Action, each: Callable[[], None] | None = None) -> str:
        self.hand.perform(actions)
        return self.finish(each)

    def pieces(self) -> dict[str, PiecePose]:
        return {piece.name: piece for piece in self.plant.truth(reset_peak=False).pieces}

    def asleep(self) -> bool:
        return not self.plant.data.tree_awake[tree_of_hand(self.plant)]


def skin_ends(plant: Plant) -> NDArray[np.float64]:
    """Both ends of each capsule of the skin, seen from above, and its radius: (n, 3) [m]."""
    body, rows = plant.model.body("hand_skin").id, []
    for geom in np.flatnonzero(plant.model.geom_bodyid == body):
        half = plant.model.geom_size[geom, 1] * plant.data.geom_xmat[geom].reshape(3, 3)[:2, 2]
        for end in (-half, half):
            rows.append([*(plant.data.geom_xpos[geom, :2] + end), plant.model.geom_size[geom, 0]])
    return np.array(rows)


def tree_of_hand(plant: Plant) -> int:
    return int(plant.model.body_treeid[plant.model.body("hand").id])


def spec(name: str, place: str, kind: Kind = Kind.PAWN) -> PieceSpec:
    return PieceSpec(name, kind, Colour.WHITE, Place.parse(place))


FEW = (spec("pawn", "e2"), spec("king", "e1", Kind.KING), spec("queen", "c5", Kind.QUEEN))


# ------------------------------------------------------------------------------------------------ taking and putting


def check_moves(side: Colour, seed: int, count: int) -> None:
    """Random pieces to random free places of a full table: each ends where it shall, and nothing else has moved."""
    rng = np.random.default_rng(seed)
    pieces = start_layout(chess.Board("r1bq1rk1/pp2ppbp/2np1np1/8/3NP3/2N1BP2/PPPQ2PP/R3KB1R w KQ - 3 9"), TABLE)
    table, where = Table(pieces, side=side, seed=seed), {piece.name: piece.place for piece in pieces}
    table.step(200)
    places = [*(Place("board", i) for i in range(64)), *TABLE.tray_places()]
    kinds = [piece.name for kind in Kind for piece in rng.permutation([p for p in pieces if p.kind is kind])]  # type: ignore[arg-type]
    chosen = [kinds[0], *rng.permutation(kinds)[: count - 1].tolist()]
    for name in chosen:
        free = [place for place in places if place not in where.values()]
        target = free[int(rng.integers(len(free)))]
        before = table.pieces()
        failed = table.do(Move(start=TABLE.xy(where[name]), to=TABLE.xy(target)))
        table.step(120)
        what, after = f"{name} from {where[name]} to {target}", table.pieces()
        assert not failed, what
        assert math.dist((after[name].x, after[name].y), TABLE.xy(target)) < TOLERANCE, what
        assert after[name].tilt < 0.005, what
        moved = {n: math.dist((before[n].x, before[n].y), (after[n].x, after[n].y)) for n in after if n != name}
        worst = max(moved, key=moved.__getitem__)
        assert moved[worst] < 0.001, f"{what} moved {worst}"
        where[name] = target
    assert not table.do(Withdraw())


@pytest.mark.slow
@pytest.mark.parametrize("side", list(Colour))
def test_any_piece_is_taken_and_put_between_its_neighbours(side: Colour) -> None:
    check_moves(side, seed=11, count=5)


@pytest.mark.parametrize("kind", list(Kind))
def test_each_kind_is_held_upright_and_does_not_slip(kind: Kind) -> None:
    table = Table((spec("piece", "d4", kind),))
    table.step(100)
    assert not table.do(Take(at=xy("d4")))
    held = table.pieces()["piece"]
    assert 0.009 < held.z < 0.014
    assert table.hand.holding
    assert not table.do(Hover(at=(0.08, 0.05), height=0.12, duration=0.3))
    assert not table.do(Put(at=xy("f6")))
    assert not table.hand.holding
    put = table.pieces()["piece"]
    assert math.dist((put.x, put.y), xy("f6")) < TOLERANCE
    assert put.tilt < 0.005


def test_people_miss_by_some_millimetres_and_never_by_more_than_their_limit() -> None:
    person = HandSettings(placement_sigma=0.002, placement_limit=0.004)
    table = Table()
    routines = Routines(table.hand._look, lambda: table.hand._pose, person, TABLE, np.random.default_rng(3))
    slips = np.array([routines._slip() for _ in range(2000)])
    assert np.std(slips) == pytest.approx(0.00195, abs=0.0001)  # a normal distribution, cut at two sigma
    assert np.abs(slips).max() == 0.004
    np.testing.assert_allclose(slips.mean(axis=0), 0.0, atol=0.0002)


def test_a_neighbour_that_is_too_near_is_not_stood_upon() -> None:
    table = Table(FEW)
    table.step(50)
    assert not table.do(Take(at=xy("e2")))
    assert "another piece stands at" in table.do(Put(at=(0.02, -0.135)))
    assert "is not on the board or its trays" in table.do(Put(at=(0.0, -0.35)))
    assert "holds a piece already" in table.do(Take(at=xy("c5")))
    assert table.hand.holding
    assert not table.do(Withdraw())  # puts the pawn down where there is room
    assert not table.hand.holding
    assert all(abs(piece.z) < 1e-4 and piece.tilt < 0.005 for piece in table.pieces().values())


# ---------------------------------------------------------------------------------------------------------- trouble


def test_sliding_keeps_a_piece_on_the_board() -> None:
    table, heights = Table((spec("queen", "d4", Kind.QUEEN),)), []
    table.step(50)
    assert not table.do(Slide(start=xy("d4"), to=(-0.008, -0.006)), each=lambda: heights.append(max_height(table)))
    queen = table.pieces()["queen"]
    assert math.dist((queen.x, queen.y), (-0.008, -0.006)) < 0.002
    assert queen.tilt < 0.005
    assert max(heights) < 0.001


def max_height(table: Table) -> float:
    return max(float(table.plant.data.body(name).xpos[2]) for name in table.plant._piece_q)


@pytest.mark.parametrize("kind", [Kind.PAWN, Kind.KING])
@pytest.mark.parametrize("direction", [0.0, 2.0])
def test_a_knock_makes_a_piece_fall(kind: Kind, direction: float) -> None:
    table = Table((spec("piece", "d4", kind),))
    table.step(50)
    assert not table.do(Knock(at=xy("d4"), direction=direction))
    table.step(500)
    piece = table.pieces()["piece"]
    assert piece.tilt > 1.0
    failed = table.do(Take(at=(piece.x, piece.y)))
    assert "lies on its side" in failed


def test_who_only_hovers_hesitates_or_rests_touches_nothing() -> None:
    table = Table(FEW)
    table.step(300)
    before = table.plant.truth(reset_peak=True)
    over, down = Hesitate(at=xy("c5"), duration=0.5), Rest(at=(-0.18, 0.1), duration=0.3)
    assert not table.do(Hover(at=xy("e2"), duration=0.2), over, down, Withdraw())
    after = table.plant.truth(reset_peak=False)
    for old, new in zip(before.pieces, after.pieces, strict=True):
        assert math.dist((old.x, old.y), (new.x, new.y)) < 1e-6
    assert after.hand_force == 0.0


def test_a_hand_that_rests_presses_lightly_and_stays_below_its_strength() -> None:
    table = Table()
    peak = 0.0

    def watch() -> None:
        nonlocal peak
        peak = max(peak, float(np.abs(table.plant.data.actuator("hand_z").force[0] - MASS * 9.81)))

    assert not table.do(Rest(at=(0.1, 0.1), duration=0.5), each=watch)
    assert 1.0 < table.plant.truth(reset_peak=False).peak_contact_force < 15.0
    assert peak <= STRENGTH


def test_what_is_not_there_cannot_be_taken() -> None:
    table = Table(FEW)
    assert "no piece stands within 20 mm of (0.100, 0.100) m" in table.do(Take(at=(0.1, 0.1)))
    assert "the hand holds nothing to put down" in table.do(Put(at=(0.1, 0.1)))
    table.hand.perform((Hover(at=(0.1, 0.1)),))
    with pytest.raises(HandFailed, match="the hand is busy"):
        table.hand.perform((Withdraw(),))


# ------------------------------------------------------------------------------------------------- rest and repetition


def test_a_parked_hand_sleeps_and_lets_time_stand() -> None:
    table = Table(FEW)
    table.step(300)
    assert table.asleep()
    assert table.plant.resting
    assert not table.do(Hover(at=(0.1, 0.1), duration=0.5))
    assert not table.do(Withdraw())
    table.step(600)
    assert table.asleep()
    assert table.plant.resting
    for name, value in zip(JOINTS, parked(Colour.WHITE), strict=False):
        assert float(table.plant.data.joint(name).qpos[0]) == pytest.approx(value, abs=1e-3)


def test_a_sleeping_hand_wakes_up_when_it_is_asked() -> None:
    table = Table()
    table.step(300)
    table.hand.perform((Hover(at=(0.0, 0.1)),))
    table.step(3)
    assert not table.asleep()


def test_the_same_seed_gives_the_same_state_and_another_one_another() -> None:
    def final(seed: int) -> str:
        table = Table(FEW, seed=seed)
        table.step(50)
        assert not table.do(Move(start=xy("e2"), to=xy("e4")))
        return table.plant.digest()

    assert final(3) == final(3)
    assert final(3) != final(4)


def test_a_world_that_goes_on_from_a_snapshot_has_its_hand_put_down_and_withdraw(tmp_path: Path) -> None:
    table = Table(FEW)
    table.step(50)
    assert not table.do(Take(at=xy("e2")))
    table.hand.perform((Put(at=xy("e5")),))
    table.step(250)
    path, plant = tmp_path / "state.npz", table.plant
    save_snapshot(path, plant.model, plant.data, plant.tick)
    again = Table(FEW, state=path)
    assert again.hand.busy
    assert again.plant.tick == plant.tick
    assert again.pieces()["pawn"].z > 0.005
    assert not again.finish()
    pawn = again.pieces()["pawn"]
    assert abs(pawn.z) < 1e-4
    assert pawn.tilt < 0.005
    assert again.hand._measured()[:3] == pytest.approx(parked(Colour.WHITE)[:3], abs=1e-3)


def test_between_two_steps_a_hand_changes_nothing_but_its_servos_targets_and_whether_it_may_sleep() -> None:
    table = Table(FEW)
    model, data = table.plant.model, table.plant.data
    policy = model.tree_sleep_policy.copy()
    before = [part.tobytes() for part in (data.qpos, data.qvel, data.qacc_warmstart)]
    robot = data.ctrl[:4].copy()
    table.hand.perform((Hover(at=(0.1, 0.1)),))
    table.hand.drive()
    assert [part.tobytes() for part in (data.qpos, data.qvel, data.qacc_warmstart)] == before
    np.testing.assert_array_equal(data.ctrl[:4], robot)
    assert not data.xfrc_applied.any()
    assert not data.qfrc_applied.any()
    changed = np.flatnonzero(model.tree_sleep_policy != policy)
    assert changed.tolist() == [tree_of_hand(table.plant)]


def test_a_hand_is_moved_by_servos_alone_and_weighs_what_the_standard_says() -> None:
    model = Table().plant.model
    assert model.neq == 3  # the arm's closures
    assert model.nmocap == 0
    assert not model.body_gravcomp.any()
    hand = [i for i in range(model.nbody) if model.body(i).rootid[0] == model.body("hand").id]
    assert model.body_mass[hand].sum() == pytest.approx(MASS)
    stiff = {model.joint(i).name for i in np.flatnonzero(model.jnt_stiffness)}
    assert stiff == {"skin_x", "skin_y", "skin_z"}
    assert model.joint("skin_z").stiffness[0] == STIFFNESS
    assert math.sqrt(STIFFNESS / SKIN_MASS) * model.opt.timestep < 1.0
    for name in JOINTS[:3]:
        servo = model.actuator(name)
        assert servo.forcerange[1] - servo.forcerange[0] == pytest.approx(2.0 * STRENGTH)


# ------------------------------------------------------------------------------------------------------------ forces


class Press:
    """Drives the tool down by the task-space law and comes to rest there."""

    def __init__(self, plant: Plant, top: tuple[float, float, float]) -> None:
        self.plant, self._top, self._law = plant, np.array(top), TaskSpaceController(DeltaModel(PARAMETERS))

    def down(self, height: float, speed: float, each: Callable[[], object] = lambda: None) -> None:
        way = np.array([0.0, 0.0, height - self._top[2]])
        ticks = round(-float(way[2]) / speed / TICK)
        torque: Triple = (0.0, 0.0, 0.0)
        for i in range(ticks + 60):
            each()
            measured = self.plant.measure(standing=False)
            self.plant.apply(Command(torque, 0.0, brake=False, enable=True, busy=True))
            self.plant.step()
            assert self._law.update(measured.angle, measured.velocity) == 0
            share = min(1.0, (i + 1) / ticks)
            x, y, z = TABLE.base_from_board(self._top + share * share * (3.0 - 2.0 * share) * way).tolist()
            reference = pack_reference((x, y, z), stiffness=(70.0**2,) * 3, damping=(140.0,) * 3)
            torque = self._law.torque(reference, measured.tactile)


PAD = 0.016
"""From the tool's centre to under the middle of a pad and its finger [m]."""


def force_of_finger_world(finger: Finger, top: tuple[float, float, float], height: float, speed: float) -> float:
    model = build_finger_world(PARAMETERS, TABLE, TABLE.base_from_board(np.array(top)), finger)
    plant, peak = Plant(model, PARAMETERS, ()), 0.0

    def watch() -> None:
        nonlocal peak
        peak = max(peak, finger_force(model, plant.data))

    plant.watch_step = watch
    Press(plant, top).down(height, speed)
    return peak


@pytest.mark.parametrize("speed", [0.2, 0.45])
def test_a_hand_in_the_air_feels_what_a_finger_in_the_air_feels(speed: float) -> None:
    top = (0.0, 0.0, 0.18)
    table = Table(tool=top)
    assert not table.do(Hover(at=(PAD - 0.0875 * 0.25, 0.0875 * 0.97), height=0.02, duration=0.0))
    palm = highest_skin(table.plant, "palm")
    table.plant.truth(reset_peak=True)
    Press(table.plant, top).down(0.118, speed)
    felt = table.plant.truth(reset_peak=False).hand_force
    expected = force_of_finger_world(Finger((PAD, 0.0, palm - 0.008), clamped=False), top, 0.118, speed)
    assert felt == pytest.approx(expected, rel=0.12)
    assert expected > 40.0


def test_a_finger_on_the_board_feels_what_a_clamped_finger_feels() -> None:
    top = (0.0, 0.0, 0.10)
    table = Table(tool=top)
    table.hand.perform((Rest(at=(PAD, 0.0), duration=20.0),))
    table.step(4000)
    finger = highest_skin(table.plant, "finger")
    assert table.plant.truth(reset_peak=True).hand_force == 0.0
    Press(table.plant, top).down(0.05, 0.2, each=table.hand.drive)
    felt = table.plant.truth(reset_peak=False).hand_force
    expected = force_of_finger_world(Finger((PAD, 0.0, finger - 0.008), clamped=True), top, 0.05, 0.2)
    assert felt == pytest.approx(expected, rel=0.12)
    assert expected > 50.0


def highest_skin(plant: Plant, part: str) -> float:
    """Top of what the robot would meet first, of the palm or of the fingers' upright ends [m]."""
    model = plant.model
    skins = np.flatnonzero(model.geom_bodyid == model.body("hand_skin").id)
    geom = skins[4] if part == "palm" else skins[1]
    if part == "palm":
        return float(plant.data.geom_xpos[geom][2] + model.geom_size[geom][0])
    return float(plant.data.body("hand_skin").xpos[2]) + 0.040 + float(model.geom_size[geom][0])


def test_a_hand_gives_way_to_the_arm_and_comes_back() -> None:
    top = (0.0, 0.0, 0.18)
    table = Table(tool=top)
    assert not table.do(Hover(at=(PAD - 0.0875 * 0.25, 0.0875 * 0.97), height=0.05, duration=0.0))
    start = table.hand._measured().z
    press = Press(table.plant, top)
    press.down(0.13, 0.2)
    assert table.hand._measured().z < start - 0.015
    assert abs(table.plant.data.actuator("hand_z").force[0] - MASS * 9.81) < STRENGTH + 0.01


def test_pieces_of_other_worlds_are_those_of_worlds_with_a_hand() -> None:
    """A hand adds bodies after all others, so that names, joints and motors of the rest stay where they are."""
    home = TABLE.base_from_board(np.array(HOME))
    standing = tuple(StandingPiece(piece, *TABLE.xy(piece.place)) for piece in FEW)
    without: mujoco.MjModel = build_model(PARAMETERS, TABLE, standing, home, looks=False)
    with_hand = build_model(PARAMETERS, TABLE, standing, home, looks=False, add=partial(add_hand, side=Colour.WHITE))
    np.testing.assert_array_equal(with_hand.key_qpos[0][: without.nq], without.key_qpos[0])
    np.testing.assert_array_equal(with_hand.actuator_gainprm[: without.nu], without.actuator_gainprm)
    np.testing.assert_array_equal(with_hand.dof_frictionloss[: without.nv], without.dof_frictionloss)


@pytest.mark.parametrize("side", list(Colour))
def test_the_referee_knows_which_part_of_the_table_the_hand_is_over(side: Colour) -> None:
    table = Table(side=side)
    assert not table.do(Hover(at=(0.06, -0.03), duration=0.0))
    hand = table.plant.truth(reset_peak=False).hand
    assert hand is not None
    centres, radii = seen_from_above(hand[0], hand[1], hand[3])
    for x, y, radius in skin_ends(table.plant):
        within = np.hypot(centres[:, 0] - x, centres[:, 1] - y) + radius - radii
        assert within.min() < 0.004, "this end of a capsule is covered by no disc"
    sleeve = centres[radii == radii.max(), 1] - hand[1]
    assert (sleeve < 0.0).all() if side is Colour.WHITE else (sleeve > 0.0).all()
