"""OpenGL's objects as far as pictures need them: programs, shapes with their instances, what is drawn into, textures.

All need OpenGL's context to be current, and live as long as that does.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any, Final

import cv2
import mujoco
import mujoco.egl  # says which OpenGL there is to be, before any is loaded
import numpy as np
import OpenGL
from numpy.typing import NDArray

from hardware.interfaces import HardwareError
from hardware.sim.render.shaders import ATTRIBUTES
from hardware.sim.render.shapes import Triangles

OpenGL.ERROR_CHECKING = False  # not after each of some hundred calls: asked for once a picture, by complain
from OpenGL import GL  # noqa: E402  # reads that as it is loaded

__all__ = ["GL", "INSTANCE_FLOATS", "Canvas", "ShaderProgram", "ShadowMap", "Shape", "complain", "texture"]

INSTANCE_FLOATS: Final = 24
"""Of an instance: the attributes after a vertex's own, four each."""
_FLOAT: Final = 4
"""[bytes]"""


def complain() -> None:
    """Raise ``HardwareError`` where OpenGL has refused something since it was asked last."""
    if (code := GL.glGetError()) != GL.GL_NO_ERROR:
        raise HardwareError(f"OpenGL refuses to draw (error {code:#x}): update the graphics driver")


class ShaderProgram:
    """A vertex's and a pixel's program, linked, and the places of its uniforms."""

    def __init__(self, vertex: str, pixel: str) -> None:
        self._number = GL.glCreateProgram()
        shaders = []
        for kind, text in ((GL.GL_VERTEX_SHADER, vertex), (GL.GL_FRAGMENT_SHADER, pixel)):
            shader = GL.glCreateShader(kind)
            GL.glShaderSource(shader, text)
            GL.glCompileShader(shader)
            if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
                raise HardwareError(f"OpenGL does not take a program: {_said(GL.glGetShaderInfoLog(shader))}")
            GL.glAttachShader(self._number, shader)
            shaders.append(shader)
        for place, name in enumerate(ATTRIBUTES):
            GL.glBindAttribLocation(self._number, place, name)
        GL.glLinkProgram(self._number)
        if not GL.glGetProgramiv(self._number, GL.GL_LINK_STATUS):
            raise HardwareError(f"OpenGL does not take a program: {_said(GL.glGetProgramInfoLog(self._number))}")
        for shader in shaders:
            GL.glDeleteShader(shader)
        self._places = dict[str, int]()

    def use(self, uniforms: Mapping[str, Any]) -> None:
        """Draw by it from now on; matrices (…, 4, 4), vectors (…, n), numbers, by their names."""
        GL.glUseProgram(self._number)
        for name, value in uniforms.items():
            self.put(name, value)

    def put(self, name: str, value: Any) -> None:
        """Set a uniform of the program in use; one that its text does not need is left out."""
        if name not in self._places:
            self._places[name] = GL.glGetUniformLocation(self._number, name)
        place = self._places[name]
        if place < 0:
            return
        if isinstance(value, int):
            GL.glUniform1i(place, value)
            return
        if isinstance(value, float):
            GL.glUniform1f(place, value)
            return
        array = np.ascontiguousarray(value, dtype=np.int32 if value.dtype.kind == "i" else np.float32)
        if array.dtype == np.int32:
            GL.glUniform1iv(place, array.size, array)
        elif array.shape[-2:] == (4, 4):
            GL.glUniformMatrix4fv(place, array.size // 16, GL.GL_TRUE, array)
        else:
            setter = {2: GL.glUniform2fv, 3: GL.glUniform3fv, 4: GL.glUniform4fv}[array.shape[-1]]
            setter(place, array.size // array.shape[-1], array)


class Shape:
    """Triangles, and where the instances of them begin in a buffer that others share."""

    def __init__(self, triangles: Triangles, instances: int, first: int, count: int) -> None:
        self._corners, self._count = triangles.faces.size, count
        self._array = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._array)
        vertices = np.concatenate([triangles.places, triangles.normals], axis=1).astype(np.float32)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, GL.glGenBuffers(1))
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STATIC_DRAW)
        _attribute(0, 4, vertices.shape[1], 0)
        _attribute(1, 3, vertices.shape[1], 4)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, GL.glGenBuffers(1))
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, triangles.faces.nbytes, triangles.faces, GL.GL_STATIC_DRAW)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, instances)
        for number in range(INSTANCE_FLOATS // 4):
            _attribute(2 + number, 4, INSTANCE_FLOATS, first * INSTANCE_FLOATS + 4 * number)
            GL.glVertexAttribDivisor(2 + number, 1)
        GL.glBindVertexArray(0)

    def draw(self) -> None:
        """Draw all instances by the program in use."""
        GL.glBindVertexArray(self._array)
        GL.glDrawElementsInstanced(GL.GL_TRIANGLES, self._corners, GL.GL_UNSIGNED_INT, None, self._count)


def _attribute(place: int, numbers: int, stride: int, offset: int) -> None:
    GL.glEnableVertexAttribArray(place)
    GL.glVertexAttribPointer(
        place, numbers, GL.GL_FLOAT, GL.GL_FALSE, _FLOAT * stride, ctypes.c_void_p(_FLOAT * offset)
    )


class Canvas:
    """What a picture is drawn into: colour of so many samples a pixel (0: one, unsmoothed), and depth."""

    def __init__(self, width: int, height: int, samples: int) -> None:
        self.width, self.height = width, height
        self._smooth = samples > 0
        self._drawn = _frame(width, height, samples)
        self._read = _frame(width, height, 0) if self._smooth else self._drawn
        complain()

    def begin(self) -> None:
        """Draw into it from now on, from nothing."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._drawn)
        GL.glViewport(0, 0, self.width, self.height)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def colour(self) -> NDArray[np.uint8]:
        """What was drawn, RGB, shape (height, width, 3)."""
        size = self.width, self.height
        if self._smooth:
            GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._drawn)
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._read)
            GL.glBlitFramebuffer(0, 0, *size, 0, 0, *size, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._read)
        pixels = np.empty((self.height, self.width, 4), dtype=np.uint8)  # as they lie: OpenGL rearranges none
        GL.glReadPixels(0, 0, *size, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, pixels)
        upright = cv2.flip(cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB), 0)  # its rows begin below
        return np.asarray(upright, dtype=np.uint8)

    def depth(self) -> NDArray[np.float32]:
        """What the depth buffer holds, shape (height, width); unsmoothed alone."""
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._read)
        depth = np.empty((self.height, self.width), dtype=np.float32)
        GL.glReadPixels(0, 0, self.width, self.height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, depth)
        return depth[::-1]


def _frame(width: int, height: int, samples: int) -> int:
    number: int = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, number)
    parts = ((GL.GL_COLOR_ATTACHMENT0, GL.GL_RGBA8), (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F))
    for place, kind in parts:
        buffer = GL.glGenRenderbuffers(1)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, kind, width, height)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, buffer)
    return number


class ShadowMap:
    """Depth as a lamp sees it; ``number`` is of the texture."""

    def __init__(self, side: int) -> None:
        self._side = side
        self.number = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.number)
        GL.glTexImage2D(
            GL.GL_TEXTURE_2D, 0, GL.GL_DEPTH_COMPONENT32F, side, side, 0, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, None
        )
        for name, value in (
            (GL.GL_TEXTURE_MIN_FILTER, GL.GL_NEAREST), (GL.GL_TEXTURE_MAG_FILTER, GL.GL_NEAREST),
            (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_EDGE), (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE),
            (GL.GL_TEXTURE_COMPARE_MODE, GL.GL_COMPARE_REF_TO_TEXTURE), (GL.GL_TEXTURE_COMPARE_FUNC, GL.GL_GEQUAL),
        ):  # fmt: skip
            GL.glTexParameteri(GL.GL_TEXTURE_2D, name, value)
        self._frame = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glFramebufferTexture2D(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_TEXTURE_2D, self.number, 0)
        GL.glDrawBuffer(GL.GL_NONE)
        GL.glReadBuffer(GL.GL_NONE)
        complain()

    def begin(self) -> None:
        """Draw into it from now on; its border stays lit, so that what lies beyond is not in the shadow."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glViewport(0, 0, self._side, self._side)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        GL.glViewport(1, 1, self._side - 2, self._side - 2)


def texture(model: mujoco.MjModel, number: int) -> int:
    """A model's texture, flat or of a room; raises ``ValueError`` where it is neither RGB nor RGBA."""
    channels = int(model.tex_nchannel[number])
    if channels not in (3, 4):
        raise ValueError(f"a texture with {channels} channels is not drawn: take one with 3 or 4")
    width, height = int(model.tex_width[number]), int(model.tex_height[number])
    start = int(model.tex_adr[number])
    pixels = np.ascontiguousarray(model.tex_data[start : start + width * height * channels])
    format_ = GL.GL_RGB if channels == 3 else GL.GL_RGBA
    srgb = model.tex_colorspace[number] == mujoco.mjtColorSpace.mjCOLORSPACE_SRGB
    kept = GL.GL_SRGB8_ALPHA8 if srgb else GL.GL_RGBA8
    flat = model.tex_type[number] == mujoco.mjtTexture.mjTEXTURE_2D
    kind, wrap = (GL.GL_TEXTURE_2D, GL.GL_REPEAT) if flat else (GL.GL_TEXTURE_CUBE_MAP, GL.GL_CLAMP_TO_EDGE)
    made: int = GL.glGenTextures(1)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    GL.glBindTexture(kind, made)
    if flat:
        GL.glTexImage2D(kind, 0, kept, width, height, 0, format_, GL.GL_UNSIGNED_BYTE, pixels)
    else:
        faces = pixels.reshape(-1, width, width, channels)
        for side in range(6):
            face = np.ascontiguousarray(faces[side % len(faces)])
            target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + side
            GL.glTexImage2D(target, 0, kept, width, width, 0, format_, GL.GL_UNSIGNED_BYTE, face)
    for name, value in (
        (GL.GL_TEXTURE_WRAP_S, wrap), (GL.GL_TEXTURE_WRAP_T, wrap), (GL.GL_TEXTURE_WRAP_R, wrap),
        (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR), (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR),
    ):  # fmt: skip
        GL.glTexParameteri(kind, name, value)
    GL.glGenerateMipmap(kind)
    complain()
    return made


def _said(log: bytes | str) -> str:
    text = log.decode(errors="replace") if isinstance(log, bytes) else log
    return text.strip().splitlines()[0] if text.strip() else "it does not say why"
