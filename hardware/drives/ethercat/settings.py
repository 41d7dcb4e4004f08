"""``[drives.ethercat]`` of a rig file: the cable, the devices along it, and what is written into them at the start."""

from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, PositiveInt, model_validator

from hardware.drives.ethercat.presets import Preset
from hardware.frozen import FrozenFinite


class Device(StrEnum):
    """What stands along the cable."""

    ARM1 = "arm1"
    ARM2 = "arm2"
    ARM3 = "arm3"
    GRIPPER = "gripper"
    FORCES = "forces"
    """The analog input terminal of the force sensors, of two channels like an EL3102."""
    OTHER = "other"
    """Anything without process data for us, as a bus coupler in front of a terminal."""


ARMS = (Device.ARM1, Device.ARM2, Device.ARM3)
_CHAIN = (*ARMS, Device.GRIPPER, Device.OTHER, Device.FORCES)


class SdoWrite(FrozenFinite):
    """A value that is written into a device in PRE-OP, after the preset's own."""

    device: Device
    index: Annotated[int, Field(ge=0x1000, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=255)] = 0
    bits: Literal[8, 16, 32]
    value: int


class EtherCatSettings(FrozenFinite):
    """Where the EtherCAT devices are, and how they are run."""

    interface: Annotated[str, Field(pattern=r"^[\w.:-]{1,15}$")] = "eth1"
    """Network interface of the cable, for these devices alone."""
    preset: Preset = Preset.GENERIC
    """Of the three servo drives."""
    gripper_preset: Preset = Preset.GENERIC
    """Of the gripper's drive."""
    chain: tuple[Device, ...] = _CHAIN
    """The devices in the order in which the cable passes them."""
    encoder_counts: PositiveInt | None = None
    """For a turn of a servomotor; as the drive says (0x608F) if left out."""
    gripper_counts: PositiveInt | None = None
    """For a turn of the gripper's motor; likewise."""
    distributed_clocks: bool = True
    """The drives take their torques at SYNC0, all at once, half a period after the frame; False: as frames come."""
    sdo: tuple[SdoWrite, ...] = ()
    """What else the devices are told at the start."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for device in (*ARMS, Device.GRIPPER):
            if self.chain.count(device) != 1:
                raise ValueError(f"chain has {device} {self.chain.count(device)} times: name it once, in its place")
        if self.chain.count(Device.FORCES) > 1:
            raise ValueError("chain has forces more than once: one terminal has both channels")
        return self

    @property
    def has_forces(self) -> bool:
        """Whether a terminal for force sensors is there."""
        return Device.FORCES in self.chain

    def place(self, device: Device) -> int:
        """Where a device stands along the cable, from 0."""
        return self.chain.index(device)
