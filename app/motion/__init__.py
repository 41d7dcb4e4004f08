"""From transfers of pieces to timed references with gains: ways, paths, time laws, plans.

``planner`` decides where to go (with ``obstacles``), ``route`` says it as data, ``path`` draws it, ``time_law`` (with
``refine``) times it, ``torque`` asks whether the drives can, ``reference`` and ``gains`` sample it.

Names are loaded when they are first asked for: what plans takes seconds to load, and who only needs settings, or has
not planned anything yet, need not wait for it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from app.motion.plan import Motion, Plan, PlanRefused
    from app.motion.planner import plan_ply, plan_return
    from app.motion.settings import PROFILES, MotionSettings, Profile, contact_limits

__all__ = [
    "PROFILES", "Motion", "MotionSettings", "Plan", "PlanRefused", "Profile", "contact_limits", "plan_ply",
    "plan_return",
]  # fmt: skip

_WHERE: Final = {
    "Motion": "plan", "Plan": "plan", "PlanRefused": "plan", "plan_ply": "planner", "plan_return": "planner",
    "PROFILES": "settings", "MotionSettings": "settings", "Profile": "settings", "contact_limits": "settings",
}  # fmt: skip


def __getattr__(name: str) -> Any:
    """The name of a module below."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
