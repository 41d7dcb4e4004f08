"""``[drives.moteus]`` of a rig file: where the adapter is, and which controllers hang on its bus."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from hardware.frozen import FrozenFinite

Id = Annotated[int, Field(ge=1, le=126)]


class PinSettings(FrozenFinite):
    """A pin of a controller's auxiliary port."""

    id: Id
    """Of the controller."""
    aux: Literal[1, 2]
    """Which port."""
    pin: Annotated[int, Field(ge=0, le=4)]
    """As ``aux?.pins.X`` counts them."""


class MoteusSettings(FrozenFinite):
    """Three servomotors and the gripper on one CAN bus, behind an adapter at a serial port."""

    port: Path | None = None
    """Serial port of the adapter, best by its name in /dev/serial/by-id; emulated drives have one of their own."""
    ids: tuple[Id, Id, Id, Id] = (1, 2, 3, 4)
    """Of servomotors 1, 2, 3 and of the gripper."""
    check_sums: bool = False
    """Whether lines to and from the adapter bear check sums; wanted on a UART, USB has its own."""
    brakes: PinSettings | None = None
    """A digital output that opens power-off brakes while it changes in every exchange, through a relay that wants to
    see that (a charge pump): when this computer falls silent they close. Left out: there are no brakes, and the
    controllers hold the arm by their own position loops."""
    forces: tuple[PinSettings, PinSettings] | None = None
    """Analog inputs of the right and the left force sensor; scaled by ``drives.forces``."""
    reply_time: Annotated[float, Field(gt=0.0, le=0.02)] = 0.008
    """How long an exchange waits for answers [s]. They take 0.3 ms; a computer without real time may be held up."""
    lost_replies: PositiveInt = 3
    """So many exchanges in a row may go without a device's answer; one more is a fault. Meanwhile it is taken to move
    on as it did."""
    hold_stiffness: PositiveFloat = 200.0
    """Of a joint that its controller holds by itself, without commands or brakes [N m/rad] …"""
    hold_damping: PositiveFloat = 5.0
    """… and its damping [N m s/rad]."""
    lowest_voltage: PositiveFloat = 12.0
    """Of the supply [V]; below it is a fault. The controllers themselves go on down to 10 V …"""
    highest_voltage: PositiveFloat = 44.0
    """… and up to this one, above which they break [V]."""

    @model_validator(mode="after")
    def _different_ids(self) -> Self:
        if len(set(self.ids)) < len(self.ids):
            raise ValueError(f"two of the ids {self.ids} are the same: give each controller its own with moteus_tool")
        known = [self.brakes, *(self.forces or ())]
        strange = [pin.id for pin in known if pin is not None and pin.id not in self.ids]
        if strange:
            raise ValueError(f"a pin of controller {strange[0]} is named, and there are {self.ids}: correct its id")
        if self.lost_replies * self.reply_time > 0.2:
            raise ValueError(
                f"{self.lost_replies} answers of {self.reply_time:g} s each may be missing, together at most 0.2 s are "
                "accepted: lower one of them"
            )
        return self
