"""What holds for all tests: pictures without a screen, and a renderer where this machine has OpenGL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported first


@pytest.fixture
def renderer() -> Iterator[Callable[..., Any]]:
    """Makes MuJoCo renderers (model, height, width) and closes them afterwards."""
    import mujoco

    made: list[Any] = []

    def make(model: mujoco.MjModel, height: int, width: int) -> Any:
        try:
            made.append(mujoco.Renderer(model, height, width))
        except Exception as error:
            if os.environ.get("CI"):
                raise
            pytest.skip(f"no OpenGL through EGL here ({error}): apt-get install libegl1 libgl1-mesa-dri")
        return made[-1]

    yield make
    for one in made:
        one.close()
