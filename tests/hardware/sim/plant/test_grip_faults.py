"""A gripper that lets go by itself: in the holds that were named or drawn, for as long as was said, and never else."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from hardware.sim.plant.grip_faults import NEVER, GripFault, GripFaults
from hardware.sim.plant.imperfections import Imperfections

TICK = 0.00088
CLOSING = -0.03
HOLD = round(1.5 / TICK)


def run(fault: GripFault, holds: int, start: int = 0) -> list[list[float]]:
    """Velocities during so many holds, each 1.5 s of force with half a second without between them."""
    made, tick = [], start
    for _ in range(holds):
        velocities = []
        for at in range(HOLD + round(0.5 / TICK)):
            felt = 4.0 if at < HOLD else 0.0
            velocities.append(fault.velocity(tick, TICK, CLOSING, felt, felt))
            tick += 1
        made.append(velocities)
    return made


def test_by_default_nothing_is_lost() -> None:
    fault = GripFault(NEVER, 3)
    assert not fault.possible
    assert run(fault, 5) == [[CLOSING] * len(one) for one in run(GripFault(NEVER, 4), 5)]


def test_the_named_holds_are_lost_for_the_time_that_was_said() -> None:
    faults = GripFaults(holds=(2, 4), earliest=0.2, latest=0.8)
    fault = GripFault(faults, 1)
    opened = [[i for i, velocity in enumerate(one) if velocity > 0.0] for one in run(fault, 5)]
    assert [bool(ticks) for ticks in opened] == [False, True, False, True, False]
    assert fault.lost == 2
    for ticks in (opened[1], opened[3]):
        assert 0.2 <= ticks[0] * TICK <= 0.8 + TICK
        assert len(ticks) * TICK == pytest.approx(faults.duration, abs=TICK)
        assert ticks == list(range(ticks[0], ticks[-1] + 1))


@settings(max_examples=8)
@given(seed=st.integers(0, 10_000))
def test_a_seed_repeats_itself(seed: int) -> None:
    first, again = (run(GripFault(GripFaults(share=0.5), seed), 1) for _ in range(2))
    assert first == again


forces = st.lists(st.tuples(st.sampled_from([0.0, 0.2, 0.3, 1.0, 1.1, 4.0]), st.integers(1, 90)), max_size=30)


@given(
    seed=st.integers(0, 10_000), felt=forces, share=st.sampled_from([0.0, 0.5, 1.0]),
    holds=st.sets(st.integers(1, 4)), earliest=st.floats(0.001, 0.03), longer=st.floats(0.0, 0.05),
    duration=st.floats(0.001, 0.05),
)  # fmt: skip
def test_while_it_obeys_it_need_not_be_asked(
    seed: int, felt: list[tuple[float, int]], share: float, holds: set[int], earliest: float, longer: float,
    duration: float,
) -> None:  # fmt: skip
    """Whoever asks in the ticks beyond alone is told the same as who asks in each."""
    faults = GripFaults(
        share=share, holds=tuple(sorted(holds)), earliest=earliest, latest=earliest + longer, duration=duration
    )
    always, seldom = GripFault(faults, seed), GripFault(faults, seed)
    ticks = [force for force, times in felt for _ in range(times)]
    bounds, asked = seldom.obeys(0), 0
    for tick, force in enumerate(ticks):
        told = always.velocity(tick, TICK, CLOSING, force, force + 0.5)
        if bounds.above < force <= bounds.up_to and tick < bounds.before:
            assert told == CLOSING
            continue
        asked += 1
        assert seldom.velocity(tick, TICK, CLOSING, force, force + 0.5) == told
        bounds = seldom.obeys(tick + 1)
    assert seldom.lost == always.lost
    assert asked <= 2 * len(felt) + (duration / TICK + 2) * (always.lost + 1), "at changes, and while it lets go"


def test_a_share_is_lost() -> None:
    faults = GripFaults(share=0.25, earliest=0.001, latest=0.001, duration=0.002)
    fault = GripFault(faults, 5)
    for hold in range(800):
        for at in range(8):
            felt = 4.0 if at < 5 else 0.0
            fault.velocity(8 * hold + at, TICK, CLOSING, felt, felt)
    assert 160 <= fault.lost <= 240


def test_a_piece_that_was_let_go_in_time_is_not_lost() -> None:
    fault = GripFault(GripFaults(holds=(1,), earliest=0.5, latest=0.5), 1)
    for tick in range(round(1.0 / TICK)):
        felt = 4.0 if tick < round(0.3 / TICK) else 0.0
        assert fault.velocity(tick, TICK, 0.05, felt, felt) == 0.05
    assert fault.lost == 0


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValidationError, match="exchange them"):
        GripFaults(earliest=0.5, latest=0.1)
    with pytest.raises(ValidationError, match="often"):
        Imperfections.model_validate({"grip": {"often": 1}})
