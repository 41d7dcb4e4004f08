"""From transfers of pieces to timed references with gains: waypoints, straight jerk-limited segments, plans."""

from app.motion.plan import Motion, Plan, PlanRefused
from app.motion.planner import plan_ply, plan_return
from app.motion.settings import MotionSettings

__all__ = ["Motion", "MotionSettings", "Plan", "PlanRefused", "plan_ply", "plan_return"]
