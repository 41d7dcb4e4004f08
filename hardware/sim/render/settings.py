"""How the simulated world looks: the light over the table, and how its camera hangs and exposes.

What a lab's app cannot know stays unknown here, too: a camera hangs off its nominal pose, a lamp stands where it likes.
Frame of all positions: the board frame, z up [m].
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from hardware.frozen import FrozenFinite

Vector = tuple[float, float, float]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Tint = tuple[Fraction, Fraction, Fraction]
"""Red, green, blue, each 0 to 1."""


class LightSettings(FrozenFinite):
    """A lamp (the key light), a weaker one across from it that throws no shadow, and light from all around."""

    direction: Vector = (0.9, 0.5, 1.0)
    """From the middle of the board towards the lamp; its length does not matter."""
    distance: PositiveFloat = 1.44
    """From the middle of the board to the lamp [m]."""
    brightness: NonNegativeFloat = 0.6
    """Of the lamp: what a white surface that faces it gives of a picture's full scale at exposure 1."""
    colour: Tint = (1.0, 1.0, 0.97)
    fill: NonNegativeFloat = 0.35
    """Brightness of the light across from the lamp."""
    ambient: NonNegativeFloat = 0.3
    """Brightness of the light from everywhere."""
    shadows: bool = True
    """Whether the lamp throws shadows."""
    radius: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Of the lamp [m]; above 0 its shadows have soft edges. It is drawn as four lamps then, which takes longer."""

    @model_validator(mode="after")
    def _above_the_table(self) -> LightSettings:
        if self.direction[2] <= 0.0:
            raise ValueError(
                f"a lamp towards {self.direction} lies below the table: give a direction whose third number is above 0"
            )
        return self


class ExposureSettings(FrozenFinite):
    """How the colour sensor exposes; it does not adjust itself."""

    time: PositiveFloat = 1.0
    """Exposure relative to one in which full scale is what the light's brightness calls 1."""
    gain: Annotated[float, Field(ge=1.0, le=16.0)] = 1.0
    """Analogue gain: makes the picture brighter, and its noise with it."""
    white_balance: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = (1.0, 1.0, 1.0)
    """Factors by which red, green and blue come out wrong."""


class MountSettings(FrozenFinite):
    """How the camera really hangs, compared with the nominal pose that is all the app knows of."""

    shift: Vector = (0.0, 0.0, 0.0)
    """Of the colour sensor, in the board frame [m]."""
    turn: Vector = (0.0, 0.0, 0.0)
    """Rotation vector about the camera's own axes (x right, y down, z along the view) [rad]."""


class SceneState(FrozenFinite):
    """What can change while a world runs: somebody moves the lamp, the exposure steps, the camera is knocked."""

    light: LightSettings = LightSettings()
    exposure: ExposureSettings = ExposureSettings()
    mount: MountSettings = MountSettings()


class CameraSettings(FrozenFinite):
    """The board's simulated RGB-D camera, after a RealSense D435."""

    size: Literal["640x480", "1280x720"] = "640x480"
    """Of colour pictures, and of depth once it is aligned to them [px]."""
    noise: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    """Of both sensors, in a D435's own. 0: what ideal sensors would see, still from their own places and in whole
    depth units."""
    depth_unit: Annotated[float, Field(ge=1e-4, le=1e-3)] = 1e-3
    """Depth is a whole number of these [m]. The camera's default is 1 mm; 0.1 mm reaches 6.5 m and hides less."""
    exposure: ExposureSettings = ExposureSettings()
    mount: MountSettings = MountSettings()

    @property
    def width(self) -> int:
        """Of colour pictures [px]."""
        return int(self.size.split("x")[0])

    @property
    def height(self) -> int:
        """Of colour pictures [px]."""
        return int(self.size.split("x")[1])
