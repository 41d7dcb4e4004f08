"""From transfers of pieces to timed references with gains: ways, paths, time laws, plans.

``planner`` decides where to go (with ``obstacles``), ``route`` says it as data, ``path`` draws it, ``time_law`` (with
``refine``) times it, ``torque`` asks whether the drives can, ``reference`` and ``gains`` sample it.
"""

from app.motion.plan import Motion, Plan, PlanRefused
from app.motion.planner import plan_ply, plan_return
from app.motion.settings import PROFILES, MotionSettings, Profile, contact_limits

__all__ = [
    "PROFILES", "Motion", "MotionSettings", "Plan", "PlanRefused", "Profile", "contact_limits", "plan_ply",
    "plan_return",
]  # fmt: skip
