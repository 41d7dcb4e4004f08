"""``touchmove controller ACTION``: look at a running controller, or give it one of its commands."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Final

from rich.table import Table

from app import UserError
from app.rig.rig_file import load_rig
from app.settings.defaults import SIMULATED
from controller.protocol.key import KeyFileError
from controller.protocol.messages import Telemetry
from controller.protocol.states import BRAKED
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerBusy, ControllerError
from controller.wire.listener import TelemetryWatch

_ORDERS: Final[dict[str, Callable[[ControllerClient], None]]] = {
    "enable": ControllerClient.enable,
    "hold": ControllerClient.hold,
    "resume": ControllerClient.resume,
    "stop": ControllerClient.stop,
    "release": ControllerClient.release,
    "clear-fault": ControllerClient.clear_fault,
    "shutdown": ControllerClient.shutdown,
}
STATUS: Final = "status"
PRESS_STOP: Final = "press-stop"
ACTIONS: Final = (STATUS, PRESS_STOP, *_ORDERS)

_LEAVING: Final = 1.5
"""A program that has just ended still holds the lease for a second: an order waits that long for it [s, wall]."""
_AGAIN: Final = 0.2  # until it tries again [s, wall]


def operate(action: str, rig: str) -> Telemetry:
    """Carry one of ``ACTIONS`` out on the controller of a rig file, and return what it says after that.

    ``status`` only listens, and so does ``press-stop``, which stops the arm whoever moves it. All others need the
    lease, so that a game is not interfered with.

    Raises:
        UserError: no such action or rig, or the controller does not answer, is in use, or did not obey.
    """
    if action not in ACTIONS:
        raise UserError(f"a controller cannot '{action}': choose run, {', '.join(ACTIONS)}")
    if rig == SIMULATED:
        raise UserError("which controller? Give --rig the file that the controller named when it started")
    file = load_rig(Path(rig))
    try:
        address = file.address()
        if action in (STATUS, PRESS_STOP):
            with TelemetryWatch(*address) as watch:
                return watch.telemetry if action == STATUS else watch.stop()
        deadline = time.monotonic() + _LEAVING
        while True:
            try:
                return _order(address, action)
            except ControllerBusy:
                if time.monotonic() > deadline:
                    raise
                time.sleep(_AGAIN)
    except (ControllerError, KeyFileError) as error:
        raise UserError(str(error)) from error


def _order(address: tuple[str, int, bytes], action: str) -> Telemetry:
    with ControllerClient(*address, name=f"touchmove controller {action}") as client:
        telemetry = client.telemetry
        _ORDERS[action](client)
        return telemetry if action == "shutdown" else client.telemetry


def status_table(telemetry: Telemetry) -> Table:
    """One screen for people."""
    table = Table(show_header=False, box=None)
    table.add_row("state", f"{telemetry.state.name}{' (on its brakes)' if telemetry.state in BRAKED else ''}")
    table.add_row("cause", telemetry.explain_cause())
    table.add_row("flags", (telemetry.flags.name or "none").replace("|", ", ").lower())
    table.add_row("tool, base frame", ", ".join(f"{value * 1e3:.2f}" for value in telemetry.position) + " mm")
    table.add_row("fingers", f"{telemetry.finger_position * 1e3:.1f} mm from the middle")
    table.add_row("pads feel", f"{telemetry.tactile[0]:.2f} N right, {telemetry.tactile[1]:.2f} N left")
    table.add_row("torques", ", ".join(f"{torque:.2f}" for torque in telemetry.torque) + " N m")
    table.add_row("drives", (telemetry.drive_status.name or "OK").replace("|", ", ").lower())
    table.add_row("tick", f"{telemetry.tick}, {telemetry.skipped} passed without an exchange")
    table.add_row("work of a tick", f"up to {telemetry.work * 1e6:.0f} µs in the last second")
    return table


def status_json(telemetry: Telemetry) -> dict[str, object]:
    """The telemetry with its enums by name and its sentence: units as in the layout TELEMETRY."""
    plain = {name: _named(value) for name, value in telemetry._asdict().items()}
    return {**plain, "why": telemetry.explain_cause()}


def _named(value: object) -> object:
    if isinstance(value, IntFlag):
        return [flag.name for flag in type(value) if flag and flag in value]
    return value.name if isinstance(value, IntEnum) else value
