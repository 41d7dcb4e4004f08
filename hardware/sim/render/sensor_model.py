"""What the sensors of a RealSense D435 make of a scene: depth from two imagers, and a colour picture.

Pure functions of ideal pictures and a random generator; the renderer draws the ideal ones.

Sources:
    [D] Intel, RealSense D400 series datasheet (337029): fields of view, baseline, distance of the colour sensor,
        invalid band of depth, least distance.
    [B] Grunnet-Jepsen, Sweetser, Woodfill: Best-known methods for tuning RealSense D400 depth cameras. Error of
        depth is z² σ_d / (f b); with projector and good light the sub-pixel error σ_d is 0.08 px or better; 126
        disparities are searched; 848×480 is the D435's best depth mode.
    [K] Keselman, Woodfill, Grunnet-Jepsen, Bhowmik: Intel RealSense stereoscopic depth cameras, CVPR workshops 2017.
        Census matching over windows of 7×7, disparity in 1/32 px, invalid where the imagers disagree.
    [H] Handa, Whelan, McDonald, Davison: A benchmark for RGB-D visual odometry, ICRA 2014: pixels at edges take the
        disparity of a neighbour, shifted by a Gaussian amount.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Intrinsics
from hardware.sim.render.d435 import GLANCE, depth_intrinsics

Image = NDArray[np.uint8]
Field = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class StereoSensor:
    """Two infrared imagers side by side and the matching between them; depth is seen from the left one."""

    intrinsics: Intrinsics
    baseline: float = 0.050
    """From the left to the right imager [m] [D]."""
    subpixel: float = 0.08
    """Standard deviation of the disparity [px] [B]."""
    correlation: float = 1.5
    """The error is alike over so many pixels (Gaussian, standard deviation): neighbours share most of their windows of
    7×7 [K]."""
    step: float = 1.0 / 32.0
    """Disparities are whole multiples of this [px] [K]."""
    search: float = 126.0
    """Largest disparity that is looked for [px] [B]."""
    fattening: int = 2
    """At an edge the nearer surface wins over so many pixels: a matching window sees both [px] (assumed from the
    window of 7×7, of which the middle counts most)."""
    raggedness: float = 0.7
    """Standard deviation of the shift that makes edges ragged [px] [H]."""
    dropout: float = 3.2
    """Patches whose field of luck exceeds so many standard deviations do not match at all (assumed: 0.07 %)."""
    glare: float = 0.96
    """Brighter than this part of full scale the pattern drowns: patches of glare do not match (assumed)."""

    @property
    def scale(self) -> float:
        """Disparity times depth, f b [px m]."""
        return self.intrinsics.fx * self.baseline

    @property
    def nearest(self) -> float:
        """Nearer than this there is no depth [m]."""
        return self.scale / self.search

    edge: float = 1.0
    """Disparities that differ by more than this within one matching window belong to two surfaces [px]."""

    def decimated(self, intrinsics: Intrinsics, factor: int) -> StereoSensor:
        """As seen with so many times fewer pixels along each axis: whatever is said in pixels is that much less.

        The median that librealsense's filter takes over each block is left out: errors of neighbours are alike.
        """
        return replace(
            self, intrinsics=intrinsics, subpixel=self.subpixel / factor, correlation=self.correlation / factor,
            step=self.step / factor, search=self.search / factor, fattening=max(1, self.fattening // factor),
            raggedness=self.raggedness / factor, edge=self.edge / factor,
        )  # fmt: skip

    def noisier(self, factor: float) -> StereoSensor:
        """One whose disparities are so many times as uncertain."""
        return replace(self, subpixel=self.subpixel * factor, raggedness=self.raggedness * factor)


@dataclass(frozen=True, slots=True)
class ColourSensor:
    """A small colour sensor with a rolling shutter, as far as noise is concerned (assumed, as of 1.4 µm pixels)."""

    full_well: float = 5000.0
    """Electrons of a white pixel at full scale."""
    read_noise: float = 4.0
    """Standard deviation of reading a pixel [electrons]."""
    blur: float = 0.55
    """Standard deviation of the lens's point spread, with what the colour mosaic adds [px]."""
    vignetting: float = 0.22
    """Light lost in the corners, as part of what the middle has."""

    def noisier(self, factor: float) -> ColourSensor:
        """One with so many times the noise: of fewer electrons."""
        return replace(self, full_well=self.full_well / factor**2, read_noise=self.read_noise / factor)


STEREO: Final = StereoSensor(depth_intrinsics())
GLANCING: Final = STEREO.decimated(depth_intrinsics(GLANCE), GLANCE)
COLOUR: Final = ColourSensor()


def depth_picture(
    depth: Field, grey: Field | None, sensor: StereoSensor, unit: float, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """What the stereo sensor reports: depth in units [m], shape (h, w); 0 where there is none.

    ``depth`` is the true distance along the view from the left imager, shape (h, w) [m], ``grey`` the brightness of the
    scene from there as part of full scale, shape (h, w); None: no glare. ``rng`` decides all errors.
    """
    shape = depth.shape
    disparity: Field = np.maximum(depth, np.float32(1e-3))
    np.divide(np.float32(sensor.scale), disparity, out=disparity)
    _fatten(disparity, sensor, rng)
    lost = occluded(disparity)
    lost |= disparity > sensor.search
    luck = correlated(rng, shape, sensor.correlation)
    lost |= luck > sensor.dropout
    if grey is not None:
        lost |= grey > sensor.glare + 0.01 * luck
    error = correlated(rng, shape, sensor.correlation)
    error *= np.float32(sensor.subpixel)
    disparity += error
    disparity /= np.float32(sensor.step)
    np.rint(disparity, out=disparity)
    disparity *= np.float32(sensor.step)
    lost |= disparity <= 0.0
    np.divide(np.float32(sensor.scale), np.maximum(disparity, np.float32(sensor.step), out=disparity), out=disparity)
    disparity[lost] = 0.0
    return whole_units(disparity, unit)


def whole_units(depth: NDArray[np.floating], unit: float) -> NDArray[np.uint16]:
    """Depth [m] in whole units; 0 where it is out of reach of 16 bits."""
    units = np.rint(depth / unit)
    return np.where(units < 65536.0, units, 0.0).astype(np.uint16)


def occluded(disparity: Field) -> NDArray[np.bool_]:
    """Where the right imager does not see what the left one does, for disparities of shape (h, w) [px].

    Pixel u of the left imager is at u − d in the right one. It is hidden there where something to the right of it in
    the left picture comes out as far left or further, and it is not in the picture at all where u − d is negative: the
    invalid band at the left border [D].
    """
    right = np.arange(disparity.shape[1], dtype=np.float32) - disparity
    beyond = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(disparity.shape, dtype=np.bool_)
    hidden[:, :-1] = beyond[:, 1:] < right[:, :-1]
    return hidden | (right < 0.0)


def correlated(rng: np.random.Generator, shape: tuple[int, ...], length: float) -> Field:
    """Gaussian field (h, w), mean 0, standard deviation 1: white noise, blurred by a Gaussian of a ``length`` [px]."""
    noise = _white(rng, shape)
    reach = max(1, math.ceil(3.0 * length))
    gaussian = np.asarray(cv2.getGaussianKernel(2 * reach + 1, length, cv2.CV_32F), dtype=np.float32)
    kernel = gaussian / np.linalg.norm(gaussian)  # of unit energy, so that the variance stays 1
    field: Field = np.asarray(cv2.sepFilter2D(noise, cv2.CV_32F, kernel, kernel, borderType=cv2.BORDER_REFLECT_101))
    return field


_NORMAL: Final = np.array([NormalDist().inv_cdf((k + 0.5) / 65536.0) for k in range(65536)], dtype=np.float32)
"""The normal distribution in 65536 equally likely values, up to 4.3 standard deviations."""


def _white(rng: np.random.Generator, shape: tuple[int, ...]) -> Field:
    """White Gaussian noise; looked up, which takes a fifth of the time that computing it does.

    The generator's own words, 64 bits at a time: asking it for bytes takes three times as long, for the same.
    """
    size = math.prod(shape)
    words = np.asarray(rng.bit_generator.random_raw(-(-size // 4)), dtype="<u8")
    field: Field = _NORMAL.take(words.view(np.uint16)[:size]).reshape(shape)
    return field


def _fatten(disparity: Field, sensor: StereoSensor, rng: np.random.Generator) -> None:
    """Edges as block matching sees them, in place: the nearer surface grows, and its outline is ragged."""
    side = 2 * sensor.fattening + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    fat = np.asarray(cv2.dilate(disparity, kernel), dtype=np.float32)
    # on a slope the largest of the neighbours would be a bias: only where the window holds an edge does it win
    edge = np.asarray(cv2.subtract(fat, cv2.erode(disparity, kernel)), dtype=np.float32) > sensor.edge
    h, w = disparity.shape
    right, down = (correlated(rng, (h, w), sensor.correlation) for _ in "uv")
    # few pixels are near an edge: only those are asked where they come from
    v, u = np.nonzero(cv2.dilate(edge.view(np.uint8), kernel))
    ragged = np.float32(sensor.raggedness)
    u_from = np.rint(u.astype(np.float32) + ragged * right[v, u]).astype(np.intp).clip(0, w - 1)
    v_from = np.rint(v.astype(np.float32) + ragged * down[v, u]).astype(np.intp).clip(0, h - 1)
    grown = edge[v_from, u_from]
    disparity[v, u] = np.where(grown, fat[v_from, u_from], disparity[v_from, u_from])


_DISPLAY_GAMMA: Final = 2.2
_LEVELS: Final = 4096
_BAND: Final = 32
"""Rows that are worked on at a time; of as many pixels that their noise is a whole number of the generator's words."""
_LINEAR: Final = (np.arange(256) / 255.0) ** _DISPLAY_GAMMA
_ENCODED: Final = np.rint(255.0 * (np.arange(_LEVELS) / (_LEVELS - 1)) ** (1.0 / _DISPLAY_GAMMA)).astype(np.uint8)


def colour_picture(
    ideal: Image,
    sensor: ColourSensor | None,
    *,
    exposure: float,
    gain: float,
    white_balance: tuple[float, float, float],
    rng: np.random.Generator,
) -> Image:
    """What the colour sensor delivers of an ideal picture, both RGB, shape (h, w, 3).

    Light is added up and cut off in a linear scale; the picture itself is encoded for displays (gamma 2.2). The noise
    of a pixel that gathers N electrons is √N, and that of reading it is added; gain amplifies both. Exposure is the
    time as a factor, white balance the factors of red, green and blue. Of an ideal ``sensor``, None, these and gain
    alone are felt.
    """
    curves = (_LINEAR[:, None] * exposure * np.asarray(white_balance)).astype(np.float32)
    light: Field = np.asarray(cv2.LUT(ideal, curves[None]), dtype=np.float32)
    if sensor is not None:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), sensor.blur), dtype=np.float32)
    picture: Image = np.empty(ideal.shape, dtype=np.uint8)
    for first in range(0, len(light), _BAND):  # what is worked on stays in the processor's cache: a third less time
        rows = slice(first, first + _BAND)
        band = light[rows]
        if sensor is not None:
            _expose(band, _vignette(*light.shape[:2], sensor.vignetting)[rows], sensor, rng)
        band *= np.float32(gain * (_LEVELS - 1))
        np.clip(band, 0.0, _LEVELS - 1, out=band)
        band += np.float32(0.5)
        _ENCODED.take(band.astype(np.uint16), out=picture[rows], mode="clip")
    return picture


def _expose(light: Field, vignette: Field, sensor: ColourSensor, rng: np.random.Generator) -> None:
    """Pixels behind a lens, in place: vignetting, shot noise and read noise; linear, part of full scale at gain 1."""
    light *= vignette[..., None]
    deviation = light / np.float32(sensor.full_well)
    deviation += np.float32((sensor.read_noise / sensor.full_well) ** 2)
    np.sqrt(deviation, out=deviation)
    deviation *= _white(rng, light.shape)
    light += deviation


@cache
def _vignette(h: int, w: int, corner: float) -> Field:
    """Light of each pixel as part of the middle's, falling with the square of the distance from it."""
    v, u = np.arange(h) - 0.5 * (h - 1), np.arange(w) - 0.5 * (w - 1)
    square = (v[:, None] ** 2 + u[None, :] ** 2) / (0.25 * (h * h + w * w))
    light: Field = (1.0 - corner * square).astype(np.float32)
    light.setflags(write=False)
    return light


def seen_from_left(
    colour: Image, colour_pinhole: Intrinsics, depth: Field, pinhole: Intrinsics, offset: float
) -> Field:
    """Brightness as the left imager sees it, part of full scale, shape (h', w'); 0 outside the colour picture.

    It is taken from the colour sensor's ideal picture, RGB (h, w, 3), by the depth from the left imager, (h', w') [m],
    which stands an ``offset`` to the right of it [m]; each with its pinhole.
    """
    h, w = depth.shape
    grey = np.maximum(np.maximum(colour[..., 0], colour[..., 1]), colour[..., 2])
    ratio = colour_pinhole.fx / pinhole.fx
    columns = (np.arange(w, dtype=np.float32) - np.float32(pinhole.cx)) * np.float32(ratio) + np.float32(
        colour_pinhole.cx
    )
    rows = (np.arange(h, dtype=np.float32) - np.float32(pinhole.cy)) * np.float32(ratio) + np.float32(colour_pinhole.cy)
    u = columns[None, :] + np.float32(colour_pinhole.fx * offset) / np.maximum(depth, np.float32(1e-3))
    v = np.broadcast_to(rows[:, None], (h, w)).astype(np.float32)
    seen = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(0.0,))
    brightness: Field = np.asarray(seen, dtype=np.float32) / np.float32(255.0)
    return brightness
