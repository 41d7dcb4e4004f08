"""The light over the table as MuJoCo has it: lamps, each a spot that shines on the middle of the board."""

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hardware.sim.render.settings import LightSettings, Vector

KEY_LAMPS = 4
"""One lamp is drawn as so many of a fourth of its brightness where its shadows are soft."""
FILL_POSITION = (-0.8, -0.4, 1.2)
GLOSS = 0.36
"""Brightness of what a lamp shows of itself in a shiny surface, as part of its own."""


@dataclass(frozen=True, slots=True)
class Lamp:
    """One of MuJoCo's lights, under the names of its attributes."""

    name: str
    type: mujoco.mjtLightType
    active: bool
    pos: Vector
    dir: Vector
    diffuse: Vector
    specular: Vector
    castshadow: bool


def lamps(light: LightSettings) -> tuple[Lamp, ...]:
    """All lamps, also those that are off: how many there are is compiled into a model."""
    return (*(_key(light, number) for number in range(KEY_LAMPS)), _fill(light))


def set_lamps(model: mujoco.MjModel, light: LightSettings) -> None:
    """Put the lamps of a model where they are."""
    for lamp in lamps(light):
        there = model.light(lamp.name)
        there.active[:], there.castshadow[:] = lamp.active, lamp.castshadow
        there.pos[:], there.dir[:] = lamp.pos, lamp.dir
        there.diffuse[:], there.specular[:] = lamp.diffuse, lamp.specular
    set_ambient(model.vis.headlight, light)


def set_ambient(headlight: Any, light: LightSettings) -> None:
    """Light from everywhere: all that MuJoCo's headlight, which nothing shades, gives; the camera bears no lamp."""
    headlight.ambient = [light.ambient] * 3
    headlight.diffuse = headlight.specular = [0.0, 0.0, 0.0]


def _key(light: LightSettings, number: int) -> Lamp:
    """A part of the lamp; the parts stand in a ring as large as the lamp. Part 0 stands for all where it is a point."""
    towards = np.asarray(light.direction) / np.linalg.norm(light.direction)
    across = np.cross(towards, [0.0, 1.0, 0.0] if abs(towards[1]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    angle = math.pi * (0.25 + 0.5 * number)
    ring = math.cos(angle) * across + math.sin(angle) * np.cross(towards, across)
    x, y, z = (light.distance * towards + light.radius * ring).tolist()
    parts = KEY_LAMPS if light.radius > 0.0 else 1
    r, g, b = (light.brightness / parts * part for part in light.colour)
    return Lamp(
        f"key{number}", mujoco.mjtLightType.mjLIGHT_SPOT, number < parts, (x, y, z), (-x, -y, -z), (r, g, b),
        (GLOSS * r, GLOSS * g, GLOSS * b), light.shadows,
    )  # fmt: skip


def _fill(light: LightSettings) -> Lamp:
    x, y, z = FILL_POSITION
    grey = (light.fill, light.fill, light.fill)
    from_all_over = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    return Lamp("fill", from_all_over, True, FILL_POSITION, (-x, -y, -z), grey, (0.0, 0.0, 0.0), False)
