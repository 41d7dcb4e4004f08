"""How fast the tool may move where it can meet a person, by how the arm moves."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from pydantic import PositiveFloat

from hardware.frozen import FrozenFinite


class ContactSpeeds(FrozenFinite):
    """How fast the tool may move where it can meet a hand or a piece.

    Source: force measurements with the full arm against a 75 N/mm, 0.6 kg finger; ISO/TS 15066 allows 140 N
    quasi-static. Speed decides the peak: 0.45 m/s clamps with 138 N, 0.23 m/s with 70 N.
    """

    tool_speed: PositiveFloat = 0.8
    shared_tool_speed: PositiveFloat | None = None
    """Where it is not known that nobody is near; None: the same [m/s]."""
    downward_speed: PositiveFloat = 0.45
    """Within ``near_height`` of the playing surface [m/s]."""
    near_height: PositiveFloat = 0.090


CONTACT_PROFILES: Final[Mapping[str, ContactSpeeds]] = MappingProxyType({
    "default": ContactSpeeds(),
    "gentle": ContactSpeeds(tool_speed=0.4, downward_speed=0.22),
    "fast": ContactSpeeds(tool_speed=1.5),
    "separation": ContactSpeeds(tool_speed=1.5, shared_tool_speed=ContactSpeeds().tool_speed),
})  # fmt: skip
"""By how the arm moves: ``gentle`` with children in reach (70 N), ``fast`` with nobody (263 N on a free finger),
``separation`` as fast where and while nobody is seen, else as the default."""
