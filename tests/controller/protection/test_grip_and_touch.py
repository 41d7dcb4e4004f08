"""The guards of a motion's samples: what the pads and the tool feel, tick by tick."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from controller.model.compiled import FloatArray
from controller.protection.grip_and_touch import meets
from controller.protocol.datagram_fields import Guard

FORCES = st.floats(0.0, 20.0)


def memory() -> FloatArray:
    """Of a motion that begins."""
    return np.zeros(3)


@given(FORCES, FORCES, FORCES)
def test_a_grip_is_felt_by_both_pads(level: float, right: float, left: float) -> None:
    assert bool(meets(memory(), float(Guard.GRIP), level, (right, left), 0.0)) == (min(right, left) >= level)


@given(st.lists(st.tuples(FORCES, FORCES), max_size=40), st.floats(0.1, 20.0))
def test_a_piece_is_lost_once_a_pad_has_felt_too_little_in_five_ticks_in_a_row(
    felt: list[tuple[float, float]], level: float
) -> None:
    kept, loose = memory(), [min(tick) < level for tick in felt]
    for k, tick in enumerate(felt, start=1):
        assert bool(meets(kept, float(Guard.HELD), level, tick, 0.0)) == (k >= 5 and all(loose[k - 5 : k]))


@given(st.floats(-8.0, 8.0), st.floats(0.5, 8.0), st.integers(1, 60), st.floats(0.0, 0.99) | st.floats(1.15, 2.0))
def test_a_touch_is_told_from_what_the_tool_felt_as_it_began(
    before: float, level: float, ticks: int, share: float
) -> None:
    """Along z3, which points down, a table pushes the tool up to less; an eighth of that is learnt in a first tick."""
    kept = memory()
    for _ in range(ticks):
        assert not meets(kept, float(Guard.TOUCH), level, (0.0, 0.0), before)
    assert bool(meets(kept, float(Guard.TOUCH), level, (0.0, 0.0), before - share * level)) == (share > 1.0)


def test_what_a_touch_is_told_from_is_learnt_at_first_and_no_longer() -> None:
    """An observer that settles by 1.2 N just after a fast way down is no table; one that lies there all along is not
    learnt away."""
    settles = memory()
    for tick in range(40):
        assert not meets(settles, float(Guard.TOUCH), 1.0, (0.0, 0.0), -1.2 * (1.0 - 0.9**tick))
    slow = memory()
    met = [meets(slow, float(Guard.TOUCH), 1.0, (0.0, 0.0), -0.05 * max(0, tick - 24)) for tick in range(60)]
    assert met.index(1) == 24 + 20


@given(FORCES, FORCES, FORCES)
def test_a_sample_without_a_guard_meets_none(level: float, right: float, lift: float) -> None:
    assert not meets(memory(), float(Guard.NONE), level, (right, right), lift)
