"""Frames, solids, lines and pictures as messages of Foxglove's schemas, in JSON."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

from pydantic_core import to_json

from app.scene.frames import UNTURNED, FramePose, Quaternion, turned_by
from app.scene.solids import Cuboid, Finish, RoundBar, Solid
from controller.model.vectors import combine, cross, dot, minus, scaled
from hardware.interfaces import Triple

COLOURS: Final[dict[Finish, tuple[float, float, float]]] = {
    Finish.METAL: (0.36, 0.37, 0.40),
    Finish.ALUMINIUM: (0.76, 0.77, 0.80),
    Finish.CARBON: (0.12, 0.13, 0.15),
    Finish.PLASTIC: (0.18, 0.19, 0.22),
    Finish.PAD: (0.95, 0.95, 0.92),
    Finish.WOOD: (0.36, 0.25, 0.16),
    Finish.LIGHT_SQUARE: (0.87, 0.77, 0.60),
    Finish.DARK_SQUARE: (0.45, 0.30, 0.18),
    Finish.WHITE_PIECE: (0.93, 0.87, 0.74),
    Finish.BLACK_PIECE: (0.17, 0.13, 0.11),
}
SIGNAL: Final = (0.96, 0.55, 0.10, 0.9)
"""Of what is meant and not there: the reference and its path."""
_LENGTHS: Final = 5
"""Decimals of a metre: a hundredth of a millimetre, which a viewer does not show."""
_TURNS: Final = 6
_NOTHING: Final = ("metadata", "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


def text(message: dict[str, Any]) -> bytes:
    """A message as it is written; a number that is not finite becomes null."""
    return to_json(message, inf_nan_mode="null")


def time_of(stamp: int) -> dict[str, int]:
    """Plant time [ns] as a timestamp."""
    seconds, rest = divmod(max(stamp, 0), 10**9)
    return {"sec": seconds, "nsec": rest}


def transforms(frames: Iterable[FramePose], stamp: int) -> dict[str, Any]:
    """Where frames are at a plant time [ns]."""
    when = time_of(stamp)
    return {
        "transforms": [
            {
                "timestamp": when,
                "parent_frame_id": frame.parent,
                "child_frame_id": frame.child,
                "translation": _vector(frame.at),
                "rotation": _quaternion(frame.turned),
            }
            for frame in frames
        ]
    }


def entity(
    name: str,
    frame: str,
    solids: Iterable[Solid],
    stamp: int,
    at: Triple = (0.0, 0.0, 0.0),
    turned: Quaternion = UNTURNED,
) -> dict[str, Any]:
    """Solids that move with a frame.

    Args:
        name: whatever has the same one on its channel is replaced.
        frame: that they rest in.
        solids: as they are about their own origin.
        stamp: plant time since which they are there [ns].
        at: where that origin is in the frame [m].
        turned: and how it is turned there.
    """
    found = _empty(name, frame, stamp)
    for solid in solids:
        if isinstance(solid, Cuboid):
            found["cubes"].append({
                "pose": _pose(combine(at, 1.0, turned_by(turned, solid.centre)), turned),
                "size": _vector(solid.size),
                "color": _colour((*COLOURS[solid.finish], 1.0)),
            })  # fmt: skip
        else:
            found["cylinders"].append(_cylinder(solid, at, turned))
    return found


def marker(name: str, frame: str, diameter: float, stamp: int) -> dict[str, Any]:
    """A ball at a frame's origin [m]."""
    found = _empty(name, frame, stamp)
    size = _vector((diameter, diameter, diameter))
    found["spheres"].append({"pose": _pose((0.0, 0.0, 0.0), UNTURNED), "size": size, "color": _colour(SIGNAL)})
    return found


def line(name: str, frame: str, points: Sequence[Triple], thickness: float, stamp: int) -> dict[str, Any]:
    """A line through points of a frame [m]."""
    found = _empty(name, frame, stamp)
    found["lines"].append({
        "type": 0, "pose": _pose((0.0, 0.0, 0.0), UNTURNED), "thickness": thickness, "scale_invariant": False,
        "points": [_vector(point) for point in points], "color": _colour(SIGNAL), "colors": [], "indices": [],
    })  # fmt: skip
    return found


def update(entities: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Entities that appear, or take the place of those of their names."""
    return {"deletions": [], "entities": list(entities)}


def image(jpeg: bytes, frame: str, stamp: int) -> dict[str, Any]:
    """A picture, as JPEG, that was taken at a plant time [ns]."""
    data = base64.b64encode(jpeg).decode("ascii")
    return {"timestamp": time_of(stamp), "frame_id": frame, "data": data, "format": "jpeg"}


def _empty(name: str, frame: str, stamp: int) -> dict[str, Any]:
    head = {"timestamp": time_of(stamp), "frame_id": frame, "id": name, "lifetime": {"sec": 0, "nsec": 0}}
    return {**head, "frame_locked": True, **{kind: [] for kind in _NOTHING}}


def _cylinder(bar: RoundBar, at: Triple, turned: Quaternion) -> dict[str, Any]:
    """Foxglove's lie along z from the bar's start to its end, and both ends are given in shares of a box."""
    start, end = (combine(at, 1.0, turned_by(turned, point)) for point in (bar.start, bar.end))
    end_radius = bar.radius if bar.end_radius is None else bar.end_radius
    widest = max(bar.radius, end_radius)
    way = minus(end, start)
    length = math.sqrt(dot(way, way))
    return {
        "pose": _pose(combine(start, 0.5, way), _from_z(scaled(1.0 / length, way))),
        "size": _vector((2.0 * widest, 2.0 * widest, length)),
        "bottom_scale": round(bar.radius / widest, 4),
        "top_scale": round(end_radius / widest, 4),
        "color": _colour((*COLOURS[bar.finish], 1.0)),
    }


def _from_z(direction: Triple) -> Quaternion:
    """The shortest turn that takes z into a direction: (z × d, 1 + z·d), made a unit."""
    x, y, z = cross((0.0, 0.0, 1.0), direction)
    w = 1.0 + direction[2]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return (1.0, 0.0, 0.0, 0.0) if length < 1e-9 else (x / length, y / length, z / length, w / length)


def _pose(at: Triple, turned: Quaternion) -> dict[str, Any]:
    return {"position": _vector(at), "orientation": _quaternion(turned)}


def _vector(v: Triple) -> dict[str, float]:
    x, y, z = v
    return {"x": round(x, _LENGTHS) + 0.0, "y": round(y, _LENGTHS) + 0.0, "z": round(z, _LENGTHS) + 0.0}


def _quaternion(q: Quaternion) -> dict[str, float]:
    return {name: round(value, _TURNS) + 0.0 for name, value in zip("xyzw", q, strict=True)}


def _colour(rgba: tuple[float, float, float, float]) -> dict[str, float]:
    return dict(zip("rgba", rgba, strict=True))
