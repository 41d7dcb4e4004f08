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
    """Without commands it goes into time-out."""
    dead: bool = False
    """It neither hears nor answers, as with its cable cut; what it was told before it goes on with."""
    reset: bool = False
    """It loses its power for a moment, once: it is stopped, and its configuration what it was before."""
    stays: bool = False
    """It never begins to work."""
    keeps: bool = True
    """It keeps what its configuration is set to."""
    home_state: int = 1
    """How well it knows its position; 0: not at all."""
