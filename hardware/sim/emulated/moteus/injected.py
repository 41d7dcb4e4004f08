"""Faults that tests plant in emulated controllers."""

from dataclasses import dataclass


@dataclass(slots=True)
class Injected:
    """Of one controller; all as usual until somebody changes it."""

    lost_replies: int = 0
    """So many answers never come."""
    corrupt_replies: int = 0
    """So many answers have a wrong byte."""
    code: int = 0
    """It switches itself off with this fault code, once."""
    temperature: float | None = None
    """It says so [°C]."""
    voltage: float | None = None
    """It says so [V]."""
    encoder_jump: float = 0.0
    """Its position is off by so much [turns]."""
    torque_share: float = 1.0
    """Of the torque that it was asked for, it gives so much."""
    watchdog_bites: bool = True
