"""What can go wrong between a client and the controller; each message is one sentence with the next step.

```
ControllerError
├── ControllerUnavailable   nobody answers, or not in this version of the protocol
├── ControllerBusy          another client holds the lease
├── ControllerLost          it answered once and does no more
├── StopUnanswered          nobody says that a listener's STOP was carried out
├── CommandFailed           a command has no effect in the controller's present state
├── MotionRefused           the motion was not begun
└── MotionStopped           the motion was begun and not finished
```
"""

from __future__ import annotations

from controller.protocol.causes import Cause
from controller.protocol.messages import Busy, Telemetry
from controller.protocol.states import State


class ControllerError(Exception):
    """Something about the controller; the message is one sentence with the next step."""


class ControllerUnavailable(ControllerError):
    """Nobody answers, or in another version of the protocol."""


class ControllerBusy(ControllerError):
    """Another client holds the lease."""

    def __init__(self, where: str, busy: Busy) -> None:
        super().__init__(
            f"the controller at {where} is held by {busy.name} ({busy.address}:{busy.port}, heard {busy.silence:.2f} s "
            "ago): end that program or wait until it is done"
        )


class ControllerLost(ControllerError):
    """The controller answered once and does no more."""


class StopUnanswered(ControllerError):
    """A listener pressed STOP, and no telemetry says that it was carried out."""

    def __init__(self, where: str, timeout: float) -> None:
        super().__init__(
            f"{where} has not answered STOP within {timeout:g} s: "
            "stop the arm by its own switch, then check whether the controller is running"
        )


class CommandFailed(ControllerError):
    """A command had no effect."""


class MotionRefused(ControllerError):
    """The motion was not begun."""

    def __init__(self, telemetry: Telemetry) -> None:
        braked = telemetry.reason is Cause.NOT_HOLDING and telemetry.state is State.FAULT
        why = f"the arm is on its brakes: {telemetry.explain_cause()}" if braked else telemetry.explain_reason()
        super().__init__(f"the controller refused motion {telemetry.ended_motion}: {why}")
        self.cause = telemetry.reason


class MotionStopped(ControllerError):
    """The motion was begun and not finished; the arm is at rest or comes to rest."""

    def __init__(self, telemetry: Telemetry) -> None:
        super().__init__(
            f"the controller stopped motion {telemetry.ended_motion} at tick {telemetry.end_tick}: "
            f"{telemetry.explain_reason()}"
        )
        self.cause = telemetry.reason
