"""Pictures as MuJoCo's own renderer draws them: two programs that know nothing of each other show the same."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from functools import partial
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.rendering.classic import gl_context

from hardware.parameters import load_parameters
from hardware.piece_set import Colour
from hardware.sim.bodies.hand import add_hand
from hardware.sim.bodies.scene import build_model
from hardware.sim.process.settings import stand_pieces
from hardware.sim.render.drawing import draw_rods
from hardware.sim.render.lamps import KEY_LAMPS, set_lamps
from hardware.sim.render.quality import FILM, LOOK, PictureQuality
from hardware.sim.render.rasteriser import HIDDEN_GROUP, Rasteriser
from hardware.sim.render.settings import LightSettings
from hardware.sim.render.shapes import shape_of
from hardware.table import TableSettings
from tests.hardware.sim.process.test_world import settings_for

WIDTH, HEIGHT = 640, 480
SHADOW_EDGES = 0.0025
"""A pixel here and there at the edge of a lamp's shadows differs, and where two walls' ends coincide: part of all."""


class Scene:
    """Pieces, boxes, the arm and a hand; drawn by both."""

    def __init__(self) -> None:
        settings = settings_for()
        table = TableSettings(captured="box")
        self.model = build_model(
            load_parameters(), table, stand_pieces(settings), np.array(settings.home),
            add=partial(add_hand, side=Colour.WHITE),
        )  # fmt: skip
        self.model.vis.quality.offsamples = LOOK.samples
        self.model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = self.model.key_qpos[0]
        self._theirs = mujoco.Renderer(self.model, HEIGHT, WIDTH)
        self.model.vis.quality.offsamples = 0  # of several samples mixed, depth lies between two surfaces
        self._their_depth = mujoco.Renderer(self.model, HEIGHT, WIDTH)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[HIDDEN_GROUP] = 0
        self.ours = Rasteriser(self.model, draw_rods)
        self.light(LightSettings())

    def light(self, settings: LightSettings) -> None:
        set_lamps(self.model, settings)
        mujoco.mj_forward(self.model, self.data)

    def theirs(self, view: str) -> np.ndarray:
        return self._render(self._theirs, view)

    def their_depth(self, view: str) -> np.ndarray:
        self._their_depth.enable_depth_rendering()
        return self._render(self._their_depth, view)

    def _render(self, renderer: mujoco.Renderer, view: str) -> np.ndarray:
        renderer.update_scene(self.data, camera=view, scene_option=self._option)
        draw_rods(renderer.scene, self.data)
        return np.array(renderer.render())

    def close(self) -> None:
        self.ours.close()
        self._theirs.close()
        self._their_depth.close()


@pytest.fixture(scope="module")
def scene() -> Iterator[Scene]:
    with pytest.MonkeyPatch.context() as patch:
        try:
            # the environment's MUJOCO_GL would have to be set before any test imports MuJoCo
            patch.setattr(gl_context, "GLContext", importlib.import_module("mujoco.egl").GLContext)
            one = Scene()
        except Exception as error:
            if os.environ.get("CI"):
                raise
            pytest.skip(f"no OpenGL through EGL here ({error}): apt-get install libegl1 libgl1-mesa-dri")
        yield one
        one.close()


@pytest.mark.parametrize("view", ["camera", "film"])
@pytest.mark.parametrize(
    "light",
    [{}, {"shadows": False}, {"radius": 0.1}, {"brightness": 1.2, "direction": (-1.0, 0.3, 0.8), "ambient": 0.1}],
    ids=["usual", "no shadows", "soft shadows", "harsh"],
)
def test_picture_is_as_mujoco_draws_it(scene: Scene, view: str, light: dict[str, Any]) -> None:
    scene.light(LightSettings(**light))
    theirs = scene.theirs(view).astype(np.int16)
    scene.ours.aim(scene.data, view)
    off = np.abs(theirs - scene.ours.colour(WIDTH, HEIGHT, LOOK)).max(axis=2)
    throwing = KEY_LAMPS if "radius" in light else 1
    assert off.mean() < (0.1 if throwing == 1 else 0.9)  # both round once a lamp, to 256 levels
    assert np.mean(off > 3) < SHADOW_EDGES * throwing


def test_pictures_differ_where_something_moved(scene: Scene) -> None:
    """The comparison above would notice pieces off by a few millimetres."""
    scene.light(LightSettings())
    before = scene.theirs("camera").astype(np.int16)
    starts = [scene.model.joint(name).qposadr[0] for name in ("king", "pawn", "rook")]
    scene.data.qpos[starts] += 0.005
    mujoco.mj_forward(scene.model, scene.data)
    scene.ours.aim(scene.data, "camera")
    moved = scene.ours.colour(WIDTH, HEIGHT, LOOK)
    scene.data.qpos[starts] -= 0.005
    mujoco.mj_forward(scene.model, scene.data)
    assert np.mean(np.abs(before - moved).max(axis=2) > 3) > 2.0 * SHADOW_EDGES


@pytest.mark.parametrize("number", [2, 3])
def test_fewer_lamps_with_shadows_shine_as_bright(scene: Scene, number: int) -> None:
    """The four of a window stand side by side: what differs is how soft the edges of their shadows are."""
    scene.light(LightSettings(radius=0.1))
    scene.ours.aim(scene.data, "film")
    soft = scene.ours.colour(WIDTH, HEIGHT, LOOK).astype(float)
    hard = scene.ours.colour(WIDTH, HEIGHT, LOOK.model_copy(update={"lamps": number})).astype(float)
    dark = scene.ours.colour(WIDTH, HEIGHT, LOOK.model_copy(update={"shadow_side": 0})).astype(float)
    assert abs(hard.mean() - soft.mean()) < 0.01 * soft.mean()
    assert np.abs(hard - soft).mean() < 0.5 * np.abs(dark - soft).mean(), "there are shadows where there were"


@pytest.mark.parametrize("view", ["camera", "film"])
def test_depth_is_as_mujoco_measures_it(scene: Scene, view: str) -> None:
    theirs = scene.their_depth(view)
    scene.ours.aim(scene.data, view)
    off = np.abs(theirs - scene.ours.depth(WIDTH, HEIGHT)) / theirs
    assert np.quantile(off[theirs < 3.0], 0.9999) < 2e-6
    assert np.max(off[theirs >= 3.0], initial=0.0) < 0.01  # far away the last bit is some mm


def test_picture_depends_on_the_scene_alone(scene: Scene) -> None:
    """Whatever was drawn before, of whatever size and view: the same to the last bit."""
    scene.ours.aim(scene.data, "camera")
    first = scene.ours.colour(WIDTH, HEIGHT, LOOK), scene.ours.depth(848, 480)
    scene.ours.colour(320, 240, PictureQuality(samples=0, shadow_side=512))
    scene.ours.aim(scene.data, "film")
    scene.ours.colour(1280, 720, FILM)
    scene.ours.aim(scene.data, "camera")
    assert np.array_equal(first[0], scene.ours.colour(WIDTH, HEIGHT, LOOK))
    assert np.array_equal(first[1], scene.ours.depth(848, 480))


def test_what_cannot_be_drawn_is_told() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(ValueError, match=r"not drawn: take a plane, box"):
        shape_of(model, mujoco.mjtGeom.mjGEOM_HFIELD, -1, (0, 0))


@pytest.mark.parametrize("kind", ["BOX", "SPHERE", "CYLINDER", "CAPSULE"])
def test_shapes_are_closed_and_face_outwards(kind: str) -> None:
    """Each edge belongs to two triangles, once in each direction; normals and faces point away from the middle."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    places, normals, faces = shape_of(model, getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), -1, (3, 2))
    points = places[:, :3] + np.outer(places[:, 3], [0.0, 0.0, 1.0])
    names = {tuple(key): number for number, key in enumerate(np.unique(np.round(points, 5) + 0.0, axis=0).tolist())}
    corners = [names[tuple(point)] for point in (np.round(points, 5) + 0.0).tolist()]
    edges = [(corners[a], corners[b]) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)]
    assert len(set(edges)) == len(edges)
    assert all((b, a) in set(edges) for a, b in edges)
    a, b, c = points[faces].transpose(1, 0, 2)
    outward = np.cross(b - a, c - a)
    assert (np.einsum("fk,fk->f", outward, (a + b + c) / 3.0) > 0.0).all()
    assert (np.einsum("fk,fk->f", outward, normals[faces].mean(axis=1)) > 0.0).all()
