"""From transfers of pieces to timed references with gains: ways, paths, time laws, plans.

A `Planner` decides where to go (with ``obstacles``), ``route`` says it as data, ``path`` draws it, ``timing`` times and
samples it and asks whether the drives can, ``gains`` says how firmly. Each motion of a plan carries its
``continuation``: how it goes where a touch ended the one before it.

Names are loaded when they are first asked for, as what plans takes seconds to load.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.motion.plan import Motion, Plan, PlanRefused
    from app.motion.planner import Planner
    from app.motion.settings import PROFILES, MotionSettings, Profile, contact_speeds

__all__ = [
    "PROFILES", "Motion", "MotionSettings", "Plan", "PlanRefused", "Planner", "Profile", "contact_speeds",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The name, from the module below that has it."""
    if name in ("PROFILES", "MotionSettings", "Profile", "contact_speeds"):
        from app.motion import settings

        return getattr(settings, name)
    if name in ("Motion", "Plan", "PlanRefused"):
        from app.motion import plan

        return getattr(plan, name)
    if name == "Planner":
        from app.motion import planner

        return getattr(planner, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
