"""A touch-down in the simulated world: the guard ends it at the force asked for, told without a sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.measure.bench.beds.bed import Bed, plant_of
from app.motion import PROFILES, Profile
from app.motion.fallen.lying import Lying
from app.motion.fallen.stand_up import plan_upright
from app.motion.gain_schedule import critical
from app.motion.timing.reference import Bounds, Vector, dwell, join, line, to_samples
from controller.protocol import Guard, Result
from controller.protocol.states import State
from hardware.parameters import load_parameters
from hardware.piece_set import Kind
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws, Imperfections
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

PARAMETERS = load_parameters()
TABLE = TableSettings()
TICK = PARAMETERS.drive.tick
LEVEL = 3.0
SOFT = (70.0, 70.0, 20.0)


def way(start: Vector, end: Vector, speed: float) -> NDArray[Any]:
    """Samples of a straight line, soft downwards [m, m/s]."""
    path = join([dwell(start, 1), line(start, end, Bounds(speed, 5.0, 200.0), TICK)])
    return to_samples(path, critical(SOFT, len(path)), np.zeros(len(path)))


def push(plant: Plant) -> float:
    """Vertical force of the table on fingers and gripper, upward positive [N]."""
    return -sum(float(plant.data.sensor(f"force_{part}").data[2]) for part in ("right", "left", "body"))


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.14, 0.14), (-0.14, 0.06), (0.1, -0.14)])
def test_a_touch_ends_the_motion_at_its_force(place: tuple[float, float]) -> None:
    above = TABLE.base_from_board(np.array([*place, 0.010]))
    plant = Plant(build_model(PARAMETERS, TABLE, (), above, looks=False), PARAMETERS, ())
    bed = Bed(plant, TABLE)
    start = bed.supervisor.reference.position.copy()
    samples = way(start, start + np.array([0.0, 0.0, 0.014]), 0.010)
    samples["guard"], samples["guard_level"] = int(Guard.TOUCH), LEVEL
    bed.begin(samples)
    largest = 0.0
    while bed.supervisor.admission.motion.announced is not None:
        bed.tick()
        largest = max(largest, abs(bed.supervisor.force[2]))
    assert bed.supervisor.admission.ended.result is Result.TOUCHED
    assert LEVEL < largest < LEVEL + 0.3  # in the very tick in which the estimate crosses its level
    for _ in range(200):
        bed.tick()
    print(f"at {place} m: told {largest:.2f} N, pressing {push(plant):.2f} N")
    assert push(plant) == pytest.approx(LEVEL, abs=1.0)
    assert bed.supervisor.state is State.HOLD


def test_a_touch_that_does_not_come_is_no_touch() -> None:
    above = TABLE.base_from_board(np.array([0.0, 0.0, 0.060]))
    plant = Plant(build_model(PARAMETERS, TABLE, (), above, looks=False), PARAMETERS, ())
    bed = Bed(plant, TABLE)
    start = bed.supervisor.reference.position.copy()
    samples = way(start, start + np.array([0.0, 0.0, 0.030]), 0.20)
    samples["guard"], samples["guard_level"] = int(Guard.TOUCH), LEVEL
    assert bed.execute(samples).result is Result.DONE


@pytest.mark.parametrize("profile", [Profile.DEFAULT, Profile.FAST, Profile.SEPARATION])
@pytest.mark.parametrize("seed", range(3))
def test_the_end_of_a_fast_way_down_is_no_touch(profile: Profile, seed: int) -> None:
    """Where nothing lies, the fingers go down to the end, also of robots far from what the controller believes."""
    rng, settings = np.random.default_rng([seed, 0x70C]), PROFILES[profile]
    flaws = Flaws(Imperfections(torque_ripple=0.04, cogging=0.02, friction=0.6, encoder_noise=1.5e-6), seed)
    bed = Bed(plant_of((), TABLE, settings, flaws), TABLE, settings)
    for _ in range(3):
        x, y = rng.uniform((-0.16, -0.19), (0.16, 0.19)).tolist()
        lying = Lying(Kind.ROOK, (x, y), float(rng.uniform(-np.pi, np.pi)), "rook")
        down, *_ = plan_upright(bed.planner(), lying, (), ()).plan.motions
        assert bed.execute(down.samples).result is Result.DONE
        bed.execute_plan(bed.planner().home(Kind.ROOK))
