"""Taking an arm over: from the lease to an arm that holds and admits motions."""

import time
from collections.abc import Callable

from app.rig.devices import RigFailed
from controller.protocol.cause_sentences import explain
from controller.protocol.datagram_fields import Flag
from controller.protocol.messages import Telemetry
from controller.protocol.states import BRAKED, State
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerBusy

PATIENCE = 3.0
"""A client that was killed keeps its lease until it has been silent for a second; so long we wait for it [s, wall]."""
_AGAIN = 0.1


def attach(client: ControllerClient, progress: Callable[[str], None], *, forgive: bool) -> Telemetry:
    """Take the lease, and bring the arm into the state HOLD, admitting motions; its telemetry as it holds.

    ``forgive`` clears a fault, and ends a hold; only where a person has asked to go on after it. Raises ``RigFailed``
    if one is in force, and must not be forgiven, and ``ControllerError`` if the controller does not answer, or another
    client keeps the lease.
    """
    _connect(client, progress)
    telemetry = client.telemetry
    why = explain(telemetry.cause, telemetry.cause_value, telemetry.cause_limit)
    if telemetry.state is State.FAULT:
        if not forgive:
            raise RigFailed(
                f"the arm is on its brakes after a fault: {why}: fix it, then 'touchmove controller clear-fault'"
            )
        progress(f"clearing the controller's fault: {why}")
        client.clear_fault()
    if (state := client.telemetry.state) is not State.HOLD:
        if state in BRAKED:
            progress("the brakes open")
        client.enable()
    if not client.telemetry.flags & Flag.ADMITTING:
        if not forgive:
            raise RigFailed(
                "the arm admits no motion, because it was told to hold or something was in its way: make sure the way "
                "is clear, then run 'touchmove controller resume'"
            )
        progress(f"continuing after: {why}")
        client.resume()
    return client.wait_standing()


def _connect(client: ControllerClient, progress: Callable[[str], None]) -> None:
    deadline, told = time.monotonic() + PATIENCE, False
    while True:
        try:
            client.connect()
            return
        except ControllerBusy:
            if time.monotonic() > deadline:
                raise
            if not told:
                progress("waiting for the previous client's lease")
                told = True
            time.sleep(_AGAIN)
