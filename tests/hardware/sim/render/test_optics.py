"""The sensors' errors are those that their sources state."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.interfaces import Intrinsics
from hardware.sim.render.d435 import LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.sim.render.sensor_model import (
    COLOUR,
    STEREO,
    ColourSensor,
    colour_picture,
    correlated,
    depth_picture,
    occluded,
    seen_from_left,
    whole_units,
)

UNIT = 1e-4
SHAPE = (480, 848)


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def plane(distance: float) -> np.ndarray:
    return np.full(SHAPE, distance, np.float32)


def test_the_camera_has_the_fields_of_view_of_its_datasheet() -> None:
    wide, narrow, depth = colour_intrinsics(1280, 720), colour_intrinsics(640, 480), depth_intrinsics()

    def angles(pinhole: Intrinsics) -> tuple[float, float]:
        across, down = pinhole.width / pinhole.fx, pinhole.height / pinhole.fy
        return math.degrees(2.0 * math.atan(across / 2.0)), math.degrees(2.0 * math.atan(down / 2.0))

    assert angles(wide) == pytest.approx((69.4, 42.5), abs=0.3)
    assert angles(narrow)[1] == pytest.approx(42.5, abs=0.01)
    assert angles(depth) == pytest.approx((87.0, 58.0), abs=2.0)  # the sheet rounds, and 848×480 cuts a little off
    assert STEREO.nearest == pytest.approx(0.17, abs=0.02)


@pytest.mark.parametrize("distance", [0.3, 0.6, 1.2])
def test_depth_errs_as_the_square_of_the_distance(distance: float) -> None:
    units = depth_picture(plane(distance), None, STEREO, UNIT, rng())
    valid = units[units > 0] * UNIT
    quantised = STEREO.step / math.sqrt(12.0)
    expected = distance**2 * math.hypot(STEREO.subpixel, quantised) / STEREO.scale
    assert valid.std() == pytest.approx(expected, rel=0.05)
    assert valid.mean() == pytest.approx(distance, abs=0.1 * expected)


def test_errors_of_neighbours_are_alike_and_of_others_not() -> None:
    field = correlated(rng(), SHAPE, STEREO.correlation)
    assert field.std() == pytest.approx(1.0, rel=0.02)
    assert abs(field.mean()) < 0.02

    def alike(pixels: int) -> float:
        return float((field[:, pixels:] * field[:, :-pixels]).mean())

    assert alike(1) == pytest.approx(math.exp(-1.0 / (4.0 * STEREO.correlation**2)), abs=0.02)
    assert abs(alike(12)) < 0.02


def test_disparities_are_whole_steps() -> None:
    units = depth_picture(plane(0.5), None, STEREO, 1e-4, rng())
    steps = STEREO.scale / (units[units > 0] * 1e-4) / STEREO.step
    assert np.abs(steps - np.rint(steps)).max() < 0.5 * 0.0004 * STEREO.scale / (0.5**2 * STEREO.step)
    assert 4 < np.unique(units).size < 40


def test_the_left_border_is_as_blind_as_the_right_imager_is_far() -> None:
    for distance in (0.4, 0.8):
        units = depth_picture(plane(distance), None, STEREO, UNIT, rng())
        blind = (units == 0).mean()
        assert blind == pytest.approx(STEREO.scale / distance / SHAPE[1], abs=0.003)
        assert not units[:, : int(STEREO.scale / distance) - 3].any()


def test_left_of_an_edge_the_background_is_hidden_from_the_right_imager() -> None:
    """By the difference of the disparities, in pixels; right of an edge nothing is hidden."""
    near, far = 0.4, 0.8
    depth = plane(far)
    depth[:, 400:500] = near
    hidden = occluded((STEREO.scale / depth).astype(np.float32))
    expected = STEREO.scale * (1.0 / near - 1.0 / far)
    assert hidden[240, 200:400].sum() == pytest.approx(expected, abs=1.0)
    assert hidden[240, 400 - int(expected) : 400].all()
    assert not hidden[240, 400:].any()
    lost = (depth_picture(depth, None, STEREO, UNIT, rng())[:, 200:400] == 0).mean()
    assert lost * 200 == pytest.approx(expected, abs=1.5)


def test_edges_grow_by_the_reach_of_the_window() -> None:
    depth = plane(0.8)
    depth[:, 400:500] = 0.7
    units = depth_picture(depth, None, STEREO, UNIT, rng())
    near = np.abs(units * UNIT - 0.7) < 0.02
    assert near.mean() * SHAPE[1] == pytest.approx(100 + 2 * STEREO.fattening, abs=1.5)
    outline = np.argmax(near[:, 300:], axis=1)
    assert outline.std() > 0.3, "the outline is ragged"


def test_what_is_too_near_or_glares_has_no_depth() -> None:
    assert not depth_picture(plane(0.95 * STEREO.nearest), None, STEREO, UNIT, rng()).any()
    assert (depth_picture(plane(1.1 * STEREO.nearest), None, STEREO, UNIT, rng()) > 0).mean() > 0.8
    grey = np.zeros(SHAPE, np.float32)
    grey[200:300, 400:500] = 1.0
    units = depth_picture(plane(0.6), grey, STEREO, UNIT, rng())
    assert (units[200:300, 400:500] == 0).mean() > 0.95
    assert (units[:150, 100:] == 0).mean() < 0.005


def test_depth_beyond_sixteen_bits_is_none() -> None:
    assert whole_units(np.array([0.0, 6.5535, 6.5536, 80.0]), 1e-4).tolist() == [0, 65535, 0, 0]
    assert not depth_picture(plane(50.0), None, STEREO, 1e-4, rng()).any()


def test_the_same_generator_gives_the_same_picture() -> None:
    grey = np.full((480, 640, 3), 90, np.uint8)
    for seed, same in ((1, True), (2, False)):
        one = depth_picture(plane(0.6), None, STEREO, UNIT, rng(1))
        other = depth_picture(plane(0.6), None, STEREO, UNIT, rng(seed))
        assert (one == other).all() == same
        assert (take(grey) == take(grey, seed=seed)).all() == same


# -------------------------------------------------------------------------------------------------------------- colour


def take(
    ideal: np.ndarray, sensor: ColourSensor | None = COLOUR, *, time: float = 1.0, gain: float = 1.0, seed: int = 1
) -> np.ndarray:
    return colour_picture(ideal, sensor, exposure=time, gain=gain, white_balance=(1.0, 1.0, 1.0), rng=rng(seed))


def test_an_ideal_sensor_changes_nothing() -> None:
    ideal = rng().integers(0, 256, (48, 64, 3), dtype=np.uint8)
    off = np.abs(take(ideal, None).astype(int) - ideal)
    assert off[ideal >= 32].max() <= 1
    assert off.max() <= 8, "near black a step of the converter is a few of the display's"


@pytest.mark.parametrize(("time", "gain"), [(1.0, 1.0), (0.25, 4.0)])
def test_noise_is_that_of_electrons(time: float, gain: float) -> None:
    """√N and the reading's, whatever the gain: a shorter exposure with more gain is as bright and noisier."""
    flat = ColourSensor(blur=0.3, vignetting=0.0)
    level = 128
    picture = take(np.full((200, 200, 3), level, np.uint8), flat, time=time, gain=gain).astype(float)
    light = (level / 255.0) ** 2.2
    electrons = flat.full_well * light * time
    linear = math.hypot(math.sqrt(electrons), flat.read_noise) / electrons * light
    expected = 255.0 / 2.2 * light ** (1.0 / 2.2 - 1.0) * linear
    assert picture.std() == pytest.approx(math.hypot(expected, 1.0 / math.sqrt(12.0)), rel=0.05)
    assert picture.mean() == pytest.approx(level, abs=1.0)


def test_corners_are_darker_and_edges_blurred() -> None:
    quiet = ColourSensor(full_well=1e9, read_noise=0.0)
    picture = take(np.full((480, 640, 3), 200, np.uint8), quiet).astype(float)
    corner = (picture[0, 0, 0] / picture[240, 320, 0]) ** 2.2
    assert corner == pytest.approx(1.0 - quiet.vignetting, abs=0.01)
    step = np.zeros((48, 64, 3), np.uint8)
    step[:, 32:] = 255
    edge = take(step, ColourSensor(full_well=1e9, read_noise=0.0, vignetting=0.0))[24, :, 0]
    assert edge[30] < 60
    assert 60 < edge[31] < edge[32] < 255


def test_exposure_and_white_balance_are_factors_of_light() -> None:
    ideal = np.full((8, 8, 3), 128, np.uint8)
    picture = colour_picture(ideal, None, exposure=0.5, gain=1.0, white_balance=(2.0, 1.0, 0.5), rng=rng())
    assert picture[0, 0].tolist() == pytest.approx([128, 128 * 0.5 ** (1 / 2.2), 128 * 0.25 ** (1 / 2.2)], abs=1.0)
    assert take(ideal, None, time=100.0).min() == 255


def test_the_left_imager_sees_what_is_in_front_of_it() -> None:
    """A bright line in the colour picture is found where the other sensor's projection puts it."""
    pinhole, distance, column = colour_intrinsics(640, 480), 0.6, 400
    colour = np.zeros((480, 640, 3), np.uint8)
    colour[:, column - 1 : column + 2] = 255
    grey = seen_from_left(colour, pinhole, plane(distance), STEREO.intrinsics, LEFT_IMAGER)
    x = (column - pinhole.cx) / pinhole.fx * distance - LEFT_IMAGER
    expected = x / distance * STEREO.intrinsics.fx + STEREO.intrinsics.cx
    assert np.average(np.arange(848), weights=grey[240]) == pytest.approx(expected, abs=0.2)
