"""The telemetry: what a client is told of the controller."""

from __future__ import annotations

from collections.abc import Sequence

from controller.loop.supervisor import Supervisor
from controller.protocol.datagram_fields import Flag
from controller.protocol.messages import Telemetry
from controller.records.loop_statistics import LoopStatistics
from hardware.interfaces import DriveStatus, Triple

_STANDING = int(DriveStatus.STANDING)


def report(
    supervisor: Supervisor, lockstep: bool, echo: int, command: int, statistics: LoopStatistics, dropped: Sequence[int]
) -> Telemetry:
    """The present state of a controller.

    Args:
        supervisor: whose state.
        lockstep: whether plant time waits for the controller.
        echo: newest ping answered.
        command: sequence of the newest command carried out.
        statistics: how regularly the loop ticks.
        dropped: datagrams dropped, by ``Drop``.
    """
    measured, motion, ended = supervisor.measurement, supervisor.admission.motion, supervisor.admission.ended
    pose = supervisor.law.state
    reference: list[float] = supervisor.reference.position.tolist()
    return Telemetry(
        max(0, measured.tick),
        echo,
        command,
        supervisor.admission.latch.presses,
        supervisor.state,
        _flags(supervisor, lockstep),
        *supervisor.cause[:3],
        measured.status,
        measured.angle,
        measured.velocity,
        _triple(pose.position.tolist()),
        _triple(pose.velocity.tolist()),
        _triple(reference),
        supervisor.torque,
        measured.finger_position,
        measured.tactile,
        supervisor.force,
        0 if motion.announced is None else motion.announced.motion,
        motion.received,
        motion.executed,
        ended.motion,
        ended.result,
        *ended.reason[:3],
        ended.first_tick,
        ended.end_tick,
        ended.position,
        ended.finger_position,
        supervisor.admission.peak_torque,
        supervisor.admission.peak_tactile,
        supervisor.clamped,
        statistics.skipped,
        statistics.period,
        statistics.lateness,
        statistics.work,
        *dropped,
    )


def _flags(supervisor: Supervisor, lockstep: bool) -> Flag:
    flags = 0
    if supervisor.measurement.status & _STANDING:
        flags |= Flag.STANDING
    if not supervisor.may_exchange:
        flags |= Flag.WAITING
    if lockstep:
        flags |= Flag.LOCKSTEP
    if supervisor.admission.admitting:
        flags |= Flag.ADMITTING
    if supervisor.admission.latch.closed:
        flags |= Flag.LATCHED
    if supervisor.busy:
        flags |= Flag.BUSY
    if supervisor.warm:
        flags |= Flag.WARM
    return Flag(flags)


def _triple(values: list[float]) -> Triple:
    a, b, c = values
    return a, b, c
