"""Where the time of a ply goes: by part, from what the controller executed."""

from __future__ import annotations

import math
from collections import Counter
from enum import StrEnum

import numpy as np

from app.motion import Motion
from app.pieces.inventory import Stage
from controller.loop.admission import Ended
from controller.protocol import Guard


class Part(StrEnum):
    """Of a ply, in the order in which a quiet one has them."""

    HAND_OVER = "hand_over"
    """From one motion to the next one: announced, not yet begun; a reference that a touch ended comes to rest."""
    APPROACH = "approach"
    """From home, or from the piece before, down to a piece."""
    GRASP = "grasp"
    """The fingers close until both pads feel the piece."""
    FIRMING = "firming"
    """The grip becomes firm before the piece is lifted."""
    CARRY = "carry"
    """Up, over, and down to just above the board."""
    TOUCH_DOWN = "touch_down"
    """Slowly until the piece stands."""
    LETTING_GO = "letting_go"
    """The fingers open before the arm rises."""
    RETURN = "return"
    """Up and home."""


def time_by_part(motion: Motion, begun: int, ended: Ended, tick: float) -> Counter[Part]:
    """How long each part of a motion took, by its samples [s].

    Args:
        motion: of a ply.
        begun: tick in which it was announced.
        ended: how the controller says it ended.
        tick: of the loop [s].
    """
    assert motion.route is not None
    executed = ended.end_tick - ended.first_tick + 1
    waited = min(executed, 1 + math.ceil(motion.route.wait / tick - 1e-9))
    guarded = int(np.count_nonzero(motion.samples["guard"][:executed] == Guard.TOUCH))
    ticks = Counter({Part.HAND_OVER: ended.first_tick - 1 - begun})
    match motion.stage:
        case Stage.GRASP:
            ticks[Part.GRASP] = executed
        case Stage.CARRY:
            ticks |= {Part.FIRMING: waited, Part.TOUCH_DOWN: guarded, Part.CARRY: executed - waited - guarded}
        case Stage.RELEASE:
            onwards = Part.RETURN if motion.route.closes is None else Part.APPROACH
            ticks |= {Part.LETTING_GO: waited, onwards: executed - waited}
        case _:
            ticks[Part.APPROACH] = executed
    return Counter({part: count * tick for part, count in ticks.items()})
