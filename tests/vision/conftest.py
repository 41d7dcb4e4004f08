"""A renderer in the tests' own process, where this machine has OpenGL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture
def renderer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Makes MuJoCo renderers (model, height, width) without a screen, and closes them afterwards."""
    import mujoco
    from mujoco.rendering.classic import gl_context

    made: list[Any] = []

    def make(model: mujoco.MjModel, height: int, width: int) -> Any:
        try:
            # the environment's MUJOCO_GL would have to be set before any test imports MuJoCo
            from mujoco.egl import GLContext

            monkeypatch.setattr(gl_context, "GLContext", GLContext)
            made.append(mujoco.Renderer(model, height, width))
        except Exception as error:
            if os.environ.get("CI"):
                raise
            pytest.skip(f"no OpenGL through EGL here ({error}): apt-get install libegl1 libgl1-mesa-dri")
        return made[-1]

    yield make
    for one in made:
        one.close()
