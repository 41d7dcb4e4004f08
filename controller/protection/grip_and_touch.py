"""Whether the pads or the tool feel what a motion waits for, or have lost what they hold: the guards of its samples."""

from typing import Final

from controller.model.compiled import PAIR, ROW, SCALAR, STATUS, FloatArray, compiled_as
from controller.protocol.datagram_fields import Guard

_LOOSE_TICKS: Final = 5
"""A piece that swings in the fingers may leave a pad for less: 4.4 ms."""
_SETTLING_TICKS: Final = 24
"""What a TOUCH is told from is learnt for 21 ms: just after a fast way down the force told is off by up to 1.2 N."""
_LEARNT: Final = 0.125
"""Share of a tick in it."""
_GRIP, _TOUCH, _HELD = int(Guard.GRIP), int(Guard.TOUCH), int(Guard.HELD)


@compiled_as(STATUS(ROW, SCALAR, SCALAR, PAIR, SCALAR))
def meets(memory: FloatArray, guard: float, level: float, tactile: tuple[float, float], lift: float) -> int:
    """Whether a tick meets the guard of its sample, which for HELD is bad news.

    Args:
        memory: shape (3,), in and out: ticks since a TOUCH guard has begun, force along z3 then [N], ticks for which a
            pad has felt too little of what is HELD.
        guard: of `Guard`, as the sample has it.
        level: its force [N].
        tactile: what both pads feel [N].
        lift: force on the tool along z3 [N].
    """
    if guard == _GRIP:
        return int(tactile[0] >= level and tactile[1] >= level)
    if guard == _TOUCH:  # the table pushes the tool up, to -z3, by so much more than when the guard began
        if memory[0] == 0.0:
            memory[1] = lift
        elif memory[0] <= _SETTLING_TICKS:
            memory[1] += _LEARNT * (lift - memory[1])
        memory[0] += 1.0
        return int(memory[1] - lift >= level)
    if guard == _HELD:
        memory[2] = memory[2] + 1.0 if min(tactile[0], tactile[1]) < level else 0.0
        return int(memory[2] >= _LOOSE_TICKS)
    return 0
