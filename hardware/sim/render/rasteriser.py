"""Draws a model by OpenGL: what MuJoCo's own renderer shows, in a fraction of its time where no graphics card is.

MuJoCo passes over the whole scene once for the picture and twice more for each lamp that throws shadows, geom by geom
and each corner of each triangle by itself. Here shapes that are alike are drawn together, each vertex once, and light
and shadow of a pixel in one go (``shaders``). What is seen, its colours, its gloss, its lamps and its cameras are still
MuJoCo's abstract scene's.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from mujoco.egl import GLContext
from numpy.typing import NDArray

from hardware.sim.render.gl_objects import (
    GL,
    INSTANCE_FLOATS,
    Canvas,
    ShaderProgram,
    ShadowMap,
    Shape,
    complain,
    texture,
)
from hardware.sim.render.projections import TO_TEXTURE, Matrix, across_from, frustum, looking, orthographic
from hardware.sim.render.quality import PictureQuality
from hardware.sim.render.shaders import (
    DEPTH_PIXEL,
    DEPTH_VERTEX,
    MOST_LAMPS,
    MOST_SHADOWS,
    SKY_PIXEL,
    SKY_VERTEX,
    lit_pixel,
    lit_vertex,
)
from hardware.sim.render.shapes import coarse_shape_of, divisions, shape_of

SPARE_GEOMS: Final = 32
"""Room in the scene for what is drawn beside the model's geoms."""
HIDDEN_GROUP: Final = 3
"""Geoms of this group touch and are not seen."""
_OPAQUE: Final = 0.995
"""From this alpha on a geom is drawn; there is nothing that shows through."""
_GEOM: Final = int(mujoco.mjtObj.mjOBJ_GEOM)
_SIZED: Final = {
    int(mujoco.mjtGeom.mjGEOM_BOX), int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_ELLIPSOID),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE),
}  # fmt: skip
"""Kinds whose shape is of unit size; others are as large as they are."""
_FLAT: Final = 0.0005
"""What is no higher than twice this throws no shadow that anybody sees [m]."""
_SHADOW_SLOPE, _SHADOW_OFFSET = 1.5, 4.0 / 2**24
"""How far a shadow map lies behind what throws it, in slopes from pixel to pixel and in its depth, so that no surface
shades itself; as MuJoCo has it, whose maps have 24 bits. These are of floats, which Mesa reads twice as fast."""


class Batch(NamedTuple):
    """Geoms that are drawn together.

    Attributes:
        shape: with its instances.
        coarse: the same with fewer triangles, where there is such a shape.
        picture: texture; 0: none.
        repeat: of the texture, for each unit of the shape, along x and y.
        ellipsoid: it is stretched so that its normals turn.
        throws: a shadow that can be seen.
        extra: no geoms of the model; MuJoCo gives those no depth.
    """

    shape: Shape
    coarse: Shape
    picture: int
    repeat: tuple[float, float]
    ellipsoid: bool
    throws: bool
    extra: bool


class FreeView(NamedTuple):
    """A view from anywhere, upright.

    Attributes:
        position: of who looks, world frame [m].
        target: what is looked at [m].
        field_of_view: vertical [rad].
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float

    def put(self, camera: mujoco.MjvCamera) -> None:
        """Let MuJoCo's free camera look that way."""
        x, y, z = np.subtract(self.target, self.position).tolist()
        camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        camera.lookat[:], camera.distance = self.target, math.hypot(x, y, z)
        camera.azimuth, camera.elevation = math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


class Rasteriser:
    """Draws one model at whatever positions its data have.

    Args:
        model: with what is seen of it.
        extra: puts into the scene what is seen and is no geom of the model, as capsules; the same number each time.

    Raises:
        HardwareError: there is no OpenGL that can do it.
        ValueError: the model has something that is not drawn: see ``shape_of``.
    """

    def __init__(self, model: mujoco.MjModel, extra: Callable[[mujoco.MjvScene, mujoco.MjData], None]) -> None:
        self._model, self._extra = model, extra
        self._context: GLContext | None = GLContext(64, 64)
        self._context.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + SPARE_GEOMS)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._option.geomgroup[HIDDEN_GROUP] = 0
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        self._own = self._update(data)
        self._batches = self._batched()
        self._programs = dict[tuple[bool, int], ShaderProgram]()
        self._depth_program, self._sky_program = (
            ShaderProgram(DEPTH_VERTEX, DEPTH_PIXEL),
            ShaderProgram(SKY_VERTEX, SKY_PIXEL),
        )
        self._nothing = GL.glGenVertexArrays(1)
        rooms = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
        self._room = texture(model, int(rooms[0])) if rooms.size else 0
        self._canvases = dict[tuple[int, int, int], Canvas]()
        self._shadow_maps = dict[tuple[int, int], ShadowMap]()
        _settle()
        complain()

    def aim(self, data: mujoco.MjData, view: str | FreeView) -> None:
        """Take over what stands where, and look from a camera; kinematics, cameras and lamps of ``data`` are ready."""
        self._current()
        if isinstance(view, str):
            self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
            self._camera.fixedcamid = self._model.camera(view).id
        else:
            view.put(self._camera)
            self._model.vis.global_.fovy = math.degrees(view.field_of_view)
        self._update(data)
        self._place(data)

    def _current(self) -> None:
        assert self._context is not None, "it was closed"
        self._context.make_current()

    def colour(self, width: int, height: int, quality: PictureQuality) -> NDArray[np.uint8]:
        """The picture, RGB (height, width, 3), of so many pixels."""
        self._current()
        shadow_side = quality.shadow_side
        lamps = list(self._scene.lights[: self._scene.nlight])
        throwing = [lamp for lamp in lamps if lamp.castshadow and shadow_side][:MOST_SHADOWS]
        steady = [lamp for lamp in lamps if not (lamp.castshadow and shadow_side)]
        kept = throwing[:: -(-len(throwing) // quality.lamps)] if throwing else []
        uniforms = _lamp_uniforms(kept, steady, len(throwing) / max(len(kept), 1))
        maps = [self._shadow(lamp, number, quality) for number, lamp in enumerate(kept)]
        eye, towards, projection = self._seen_by(width / height)
        if maps:
            uniforms["shadow_view"] = np.stack([TO_TEXTURE @ view for view in maps])
            uniforms["shadow"] = 1 + np.arange(len(maps), dtype=np.int32)
        uniforms |= {"view": projection @ towards, "eye": eye, "picture": 0}
        canvas = self._canvas(width, height, quality.samples)
        canvas.begin()
        for number in range(len(maps)):
            GL.glActiveTexture(GL.GL_TEXTURE1 + number)
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._shadow_maps[number, shadow_side].number)
        GL.glActiveTexture(GL.GL_TEXTURE0)
        for textured in (False, True):
            program = self._program(textured, len(maps))
            program.use(uniforms)
            for batch in self._batches:
                if bool(batch.picture) == textured:
                    program.put("ellipsoid", float(batch.ellipsoid))
                    if textured:
                        GL.glBindTexture(GL.GL_TEXTURE_2D, batch.picture)
                        program.put("repeat", np.array(batch.repeat))
                    (batch.coarse if quality.coarse else batch.shape).draw()
        if self._room:
            self._sky(projection, towards)
        picture = canvas.colour()
        complain()
        return picture

    def depth(self, width: int, height: int, *, coarse: bool = False) -> NDArray[np.float32]:
        """How far everything is along the view [m], shape (height, width); ``coarse`` as of ``PictureQuality``."""
        self._current()
        _, towards, projection = self._seen_by(width / height)
        canvas = self._canvas(width, height, 0)
        canvas.begin()
        GL.glColorMask(False, False, False, False)
        self._depth_program.use({"view": projection @ towards})
        for batch in self._batches:
            if not batch.extra:
                (batch.coarse if coarse else batch.shape).draw()
        GL.glColorMask(True, True, True, True)
        told = canvas.depth()
        complain()
        near, far = self._near_and_far()
        # the buffer tells near / z, but for a trace: 1 at the near end and 0 at the far one
        return np.float32(near * far) / (told * np.float32(far - near) + np.float32(near))

    def close(self) -> None:
        """Give OpenGL back; a second call does nothing."""
        if self._context is not None:
            self._context.free()
            self._context = None

    # the scene

    def _update(self, data: mujoco.MjData) -> int:
        """The abstract scene anew; how many of its geoms are the model's."""
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, everything, self._scene)
        own: int = self._scene.ngeom
        self._extra(self._scene, data)
        return own

    def _batched(self) -> list[Batch]:
        """Sort what is seen by shape and texture, and make the buffer of all instances."""
        scene, groups = self._scene, defaultdict[tuple[Any, ...], list[int]](list)
        for number in range(scene.ngeom):
            geom = scene.geoms[number]
            if geom.rgba[3] >= _OPAQUE and (number >= self._own or geom.objtype == _GEOM):
                groups[(*self._key(geom), number >= self._own)].append(number)
        order = [number for members in groups.values() for number in members]
        seen = [scene.geoms[number] for number in order]
        self._instances = np.zeros((len(seen), INSTANCE_FLOATS), dtype=np.float32)
        for row, geom in zip(self._instances, seen, strict=True):
            row[12:15] = geom.size if geom.type in _SIZED else 1.0
            row[16:20] = geom.rgba
            row[20:23] = geom.specular, 128.0 * geom.shininess, geom.emission
        numbers = np.array(order)
        self._moved = np.flatnonzero(numbers < self._own)
        self._geoms = np.array([scene.geoms[number].objid for number in numbers[self._moved]])
        self._extras = [(row, number) for row, number in enumerate(order) if number >= self._own]
        self._buffer = GL.glGenBuffers(1)
        batches, first = [], 0
        for (kind, data, divided, picture, repeat, throws, extra), members in groups.items():
            shape = Shape(shape_of(self._model, kind, data, divided), self._buffer, first, len(members))
            simpler = coarse_shape_of(self._model, kind, data, divided)
            coarse = shape if simpler is None else Shape(simpler, self._buffer, first, len(members))
            made = texture(self._model, picture) if picture >= 0 else 0
            batches.append(Batch(shape, coarse, made, repeat, kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID, throws, extra))
            first += len(members)
        # what lies below everything comes last, so that no pixel of it is lit in vain
        return sorted(batches, key=lambda batch: not batch.throws)

    def _key(self, geom: mujoco.MjvGeom) -> tuple[int, int, tuple[int, int], int, tuple[float, float], bool]:
        """Kind, mesh or plane, divisions, texture and how it repeats, whether it throws a shadow: geoms that have all
        in common are drawn together.
        """
        picture, repeat = -1, (1.0, 1.0)
        if geom.matid >= 0:
            material = geom.matid
            picture = int(self._model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
            if picture >= 0:
                if geom.texcoord or self._model.tex_type[picture] != mujoco.mjtTexture.mjTEXTURE_2D:
                    raise ValueError("a texture with coordinates of its own is not drawn: take a flat one on a shape")
                scale = np.array(self._model.mat_texrepeat[material])
                scale = scale / geom.size[:2] if geom.dataid >= 0 else scale
                scale = scale * geom.size[:2] if self._model.mat_texuniform[material] else scale
                repeat = float(scale[0]), float(scale[1])
        kind = int(geom.type)
        flat = kind == mujoco.mjtGeom.mjGEOM_PLANE or (kind in _SIZED and float(geom.size[2]) < _FLAT)
        return kind, int(geom.dataid), divisions(self._model, kind, geom.size), picture, repeat, not flat

    def _place(self, data: mujoco.MjData) -> None:
        """Put all instances where they are."""
        poses = self._instances[:, :12].reshape(-1, 3, 4)
        poses[self._moved, :, :3] = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        poses[self._moved, :, 3] = data.geom_xpos[self._geoms]
        for row, number in self._extras:
            geom = self._scene.geoms[number]
            poses[row, :, :3], poses[row, :, 3] = geom.mat, geom.pos
            self._instances[row, 12:15] = geom.size
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, self._instances.nbytes, self._instances, GL.GL_STREAM_DRAW)

    def _seen_by(self, aspect: float) -> tuple[NDArray[np.float64], Matrix, Matrix]:
        """Where the camera is, the world in its frame, and its projection, for pictures of an aspect."""
        left, right = self._scene.camera[0], self._scene.camera[1]  # two eyes; the picture is from between them
        position = 0.5 * (np.array(left.pos, dtype=np.float64) + np.array(right.pos))
        towards = looking(position, np.array(left.forward), np.array(left.up))
        top, bottom = float(left.frustum_top), float(left.frustum_bottom)
        half = float(left.frustum_width) or 0.5 * aspect * (top - bottom)
        centre = 0.5 * (float(left.frustum_center) + float(right.frustum_center))
        return position, towards, frustum(centre - half, centre + half, bottom, top, *self._near_and_far())

    def _near_and_far(self) -> tuple[float, float]:
        camera = self._scene.camera[0]
        return float(camera.frustum_near), float(camera.frustum_far)

    # passes

    def _shadow(self, lamp: mujoco.MjvLight, number: int, quality: PictureQuality) -> Matrix:
        """Draw what a lamp sees into its shadow map; its view, projection and all."""
        side = quality.shadow_side
        if (number, side) not in self._shadow_maps:
            self._shadow_maps[number, side] = ShadowMap(side)
        depths, near_far, chart = self._shadow_maps[number, side], self._near_and_far(), self._model.vis.map
        direction = np.array(lamp.dir, dtype=np.float64)
        if lamp.type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
            half = chart.shadowclip * self._model.stat.extent
            projection = orthographic(half, *near_far)
        else:
            angle = math.radians(min(2.0 * lamp.cutoff * chart.shadowscale, 160.0))
            half = math.tan(0.5 * angle) * near_far[0]
            projection = frustum(-half, half, -half, half, *near_far)
        view = projection @ looking(np.array(lamp.pos, dtype=np.float64), direction, across_from(direction))
        depths.begin()
        GL.glEnable(GL.GL_POLYGON_OFFSET_FILL)
        further = np.array(view)
        further[2] -= _SHADOW_OFFSET * view[3]
        self._depth_program.use({"view": further})
        for batch in self._batches:
            if batch.throws:
                (batch.coarse if quality.coarse else batch.shape).draw()
        GL.glDisable(GL.GL_POLYGON_OFFSET_FILL)
        return view

    def _sky(self, projection: Matrix, towards: Matrix) -> None:
        turned = np.array(towards)
        turned[:3, 3] = 0.0
        back = np.linalg.inv(projection @ turned)
        GL.glBindVertexArray(self._nothing)
        GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, self._room)
        self._sky_program.use({"back": back, "room": 0})
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)

    def _program(self, textured: bool, shadows: int) -> ShaderProgram:
        if (textured, shadows) not in self._programs:
            texts = lit_vertex(textured=textured, shadows=shadows), lit_pixel(textured=textured, shadows=shadows)
            self._programs[textured, shadows] = ShaderProgram(*texts)
        return self._programs[textured, shadows]

    def _canvas(self, width: int, height: int, samples: int) -> Canvas:
        if (width, height, samples) not in self._canvases:
            self._canvases[width, height, samples] = Canvas(width, height, samples)
        return self._canvases[width, height, samples]


def _settle() -> None:
    """What stays as it is for all pictures: depth counts from 1, near, down to 0, where floats are finest."""
    for one in (GL.GL_DEPTH_TEST, GL.GL_CULL_FACE, GL.GL_MULTISAMPLE):
        GL.glEnable(one)
    GL.glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
    GL.glDepthFunc(GL.GL_GEQUAL)
    GL.glClearDepth(0.0)
    GL.glClearColor(0.0, 0.0, 0.0, 1.0)
    GL.glCullFace(GL.GL_BACK)
    GL.glFrontFace(GL.GL_CCW)
    GL.glPolygonOffset(-_SHADOW_SLOPE, 0.0)
    GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)


def _lamp_uniforms(throwing: list[mujoco.MjvLight], steady: list[mujoco.MjvLight], share: float) -> dict[str, Any]:
    """Lamps as the programs take them: those with shadows, which shine for ``share`` lamps each, then the others.

    A directional lamp that nothing shines of is matt: it costs a tenth of another one.
    """
    place, axis, fading = np.zeros((MOST_LAMPS, 4)), np.zeros((MOST_LAMPS, 4)), np.zeros((MOST_LAMPS, 4))
    colours, matt, ambient = np.zeros((3, MOST_LAMPS, 3)), np.zeros((2, MOST_LAMPS, 3)), np.zeros(3)
    full = matts = 0
    for number, lamp in enumerate([*throwing, *steady][:MOST_LAMPS]):
        direction = np.array(lamp.dir, dtype=np.float64)
        direction /= max(float(np.linalg.norm(direction)), 1e-12)
        directional = lamp.type == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        if directional and not lamp.castshadow and not np.any(lamp.specular):
            ambient += lamp.ambient
            if np.any(lamp.diffuse):
                matt[:, matts], matts = (-direction, lamp.diffuse), matts + 1
            continue
        if directional:
            place[full, :3], fading[full] = -direction, (1.0, 0.0, 0.0, 0.0)
        else:
            place[full, :3], place[full, 3] = lamp.pos, 1.0
            fading[full, :3], fading[full, 3] = lamp.attenuation, lamp.exponent
        axis[full, :3], axis[full, 3] = direction, math.cos(math.radians(lamp.cutoff))
        colours[:, full] = lamp.ambient, lamp.diffuse, lamp.specular
        colours[:, full] *= share if number < len(throwing) else 1.0
        full += 1
    return {
        "lamps": full, "lamp_place": place, "lamp_axis": axis, "lamp_fading": fading, "lamp_ambient": colours[0],
        "lamp_diffuse": colours[1], "lamp_specular": colours[2], "matt_lamps": matts, "matt_towards": matt[0],
        "matt_diffuse": matt[1], "ambient": ambient,
    }  # fmt: skip
