"""Settings of the controller process."""

from __future__ import annotations

from ipaddress import IPv4Address
from typing import Annotated, Final

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, NonNegativeInt, PositiveFloat, PositiveInt

from hardware.interfaces import LINGER

CONTROLLER_FILE = "controller.json"
"""Written by the controller into the run directory when clients are welcome: host, port, pid, protocol version."""

ANY_PORT: Final = 0
"""A port that is free; clients find it through ``CONTROLLER_FILE``."""
HELD_FORCE: Final = 0.5
"""Pads that feel this hold a piece [N]: the noise of their sensors stays far below, the lightest grasp far above."""


def _ipv4(host: str) -> str:
    try:
        return str(IPv4Address(host))
    except ValueError as error:
        raise ValueError("it must be an IPv4 address such as 192.168.7.2") from error


LOOPBACK: Final = "127.0.0.1"
"""Where nobody but this computer's own programs comes in; so unless told otherwise."""
IPv4 = Annotated[str, AfterValidator(_ipv4)]


class ControllerSettings(BaseModel):
    """How the controller process listens, holds, stops and ends."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    host: IPv4 = LOOPBACK
    """IPv4 address to listen at, and where clients find it."""
    port: Annotated[int, Field(ge=0, le=65535)] = ANY_PORT
    """UDP port; 0 takes a free one, which is written to ``controller.json``."""
    lease: PositiveFloat = 1.0
    """Wall time of silence after which the client counts as lost; in lockstep only once its port is closed [s]."""
    linger: PositiveFloat = LINGER
    """Wall time without a client after which the arm goes on its brakes [s]; ``inf`` never."""
    stays: bool = True
    """What comes after ``linger`` without a client: True, brakes, and it waits for the next one; False, it ends."""
    hold_stiffness: PositiveFloat = 4900.0
    """k_p of each axis until the first motion sets its own: ω = 70 rad/s [1/s²]."""
    hold_damping: PositiveFloat = 140.0
    """k_v of each axis until the first motion sets its own: 2ω [1/s]."""
    stop_stiffness: PositiveFloat = 400.0
    """Least k_p of each axis during and after a controlled stop: ω = 20 rad/s, firm enough to rest, too soft to press
    hard [1/s²]."""
    stop_damping: PositiveFloat = 40.0
    """Least k_v of each axis during and after a controlled stop [1/s]."""
    held_force: PositiveFloat = HELD_FORCE
    """A controller that starts with both pads feeling this has a piece in its fingers [N] …"""
    holding_speed: PositiveFloat = 0.025
    """… and goes on pressing with this velocity of each finger [m/s]: 4 N in stall, a little less than in a game."""
    compliant_damping: PositiveFloat = 40.0
    """k_v of each axis in compliant mode [1/s]: from 0.8 m/s the tool comes to rest within 20 mm, and a finger that
    pushes it away at 0.1 m/s feels 4 N."""
    fence_stiffness: PositiveFloat = 3600.0
    """k_p of each axis in compliant mode outside the workspace: ω = 60 rad/s [1/s²] …"""
    fence_stretch: PositiveFloat = 0.010
    """… times no more than this: 39 N at 1.08 kg, more with a piece, which nobody pushes away in passing [m]."""
    compliant_ticks: PositiveInt = 227
    """Compliant mode lasts at least so long [ticks]: 0.2 s."""
    compliant_speed: PositiveFloat = 0.01
    """A tool slower than this rests, and compliant mode ends [m/s]."""
    letting_go_speed: PositiveFloat = 0.05
    """Of each finger that opens because it pressed too hard [m/s]."""
    letting_go_ticks: PositiveInt = 455
    """For how long at most [ticks]: 0.4 s."""
    stop_acceleration: PositiveFloat = 25.0
    """Bound of the controlled stop [m/s²]; from 0.8 m/s it takes 57 ms and 23 mm."""
    stop_jerk: PositiveFloat = 1000.0
    """Bound of the controlled stop [m/s³]."""
    capacity: PositiveInt = 8192
    """Samples kept ahead [samples]: 7.2 s."""
    max_lead: PositiveInt = 11364
    """How far ahead a motion may be announced [ticks]: 10 s."""
    max_length: PositiveInt = 1_000_000
    """Longest motion [samples]: 15 minutes."""
    boot_ticks: PositiveInt = 200
    """How long the drives may take to come to rest, and then to enable [ticks]."""
    brake_ticks: NonNegativeInt = 34
    """How long the law goes on holding while the brakes close at the end [ticks]: 30 ms."""
    rest_ticks: PositiveInt = 2300
    """How long the arm may take to come to rest on its brakes at the end [ticks]: 2 s."""
    rest_speed: PositiveFloat = 0.02
    """A servomotor slower than this rests [rad/s]; one count of the encoder a tick is 0.0017 rad/s."""
    telemetry_ticks: PositiveInt = 16
    """Telemetry is sent every so many ticks while plant time runs."""
    telemetry_interval: PositiveFloat = 0.020
    """Telemetry is sent at least this often in wall time [s]."""
    datagrams_per_tick: PositiveInt = 4
    """The client's datagrams carried out in one tick of a lockstep bus. On a bus in real time it is one at most: ten
    samples, of which a tick executes one."""
    reading_time: PositiveFloat = 0.0002
    """How long a tick may look for them among what strangers sent [s]: some 60 datagrams, so that a flood delays no
    tick."""
    realtime: bool = True
    """Ask the system for SCHED_FIFO and locked memory, so that no other program delays a tick; without the privileges
    it runs, and says what is missing. Never on a lockstep bus, where nothing can be late."""
    priority: Annotated[int, Field(ge=1, le=98)] = 80
    """Of SCHED_FIFO: above 50, where Linux with PREEMPT_RT handles interrupts; 99 belongs to the kernel itself."""
    core: NonNegativeInt | None = None
    """The only core that the loop runs on, best one kept free by ``isolcpus``; None lets the system choose, which is
    better where no core is kept free."""
    flight_time: PositiveFloat = 30.0
    """What the flight recorder keeps in memory [s]: 13 MB, twice."""
    flight_files: PositiveInt = 8
    """So many of its files stay in the run directory, the newest."""
