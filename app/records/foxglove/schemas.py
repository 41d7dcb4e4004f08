"""The schemas that Foxglove publishes for JSON, as far as a record writes messages of them; and one of our own.

Source: the field tables of Foxglove's schema documentation. Times are plant time. A field that is never used here, such
as an entity's arrows, is declared with items of any kind and written empty.
"""

from __future__ import annotations

from typing import Any, Final

Schema = dict[str, Any]


def _object(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": properties}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


_NUMBER: Final[Schema] = {"type": "number"}
_TEXT: Final[Schema] = {"type": "string"}
_NANOSECONDS: Final[Schema] = {"type": "integer", "minimum": 0, "maximum": 999_999_999}
_TIME: Final = _object("time", sec={"type": "integer", "minimum": 0}, nsec=_NANOSECONDS)
_DURATION: Final = _object("duration", sec={"type": "integer"}, nsec=_NANOSECONDS)
_VECTOR: Final = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POINT: Final = _object("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION: Final = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE: Final = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOUR: Final = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_UNUSED: Final = _list({"type": "object"})

TRANSFORMS: Final = _object(
    "foxglove.FrameTransforms",
    transforms=_list(
        _object(
            "foxglove.FrameTransform",
            timestamp=_TIME,
            parent_frame_id=_TEXT,
            child_frame_id=_TEXT,
            translation=_VECTOR,
            rotation=_QUATERNION,
        )
    ),
)

SCENE: Final = _object(
    "foxglove.SceneUpdate",
    deletions=_list(
        _object(
            "foxglove.SceneEntityDeletion",
            timestamp=_TIME,
            type={
                "title": "foxglove.SceneEntityDeletionType",
                "oneOf": [
                    {"title": "MATCHING_ID", "const": 0},
                    {"title": "ALL", "const": 1},
                ],
            },
            id=_TEXT,
        )
    ),
    entities=_list(
        _object(
            "foxglove.SceneEntity",
            timestamp=_TIME,
            frame_id=_TEXT,
            id=_TEXT,
            lifetime=_DURATION,
            frame_locked={"type": "boolean"},
            metadata=_list(_object("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)),
            arrows=_UNUSED,
            cubes=_list(_object("foxglove.CubePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)),
            spheres=_list(_object("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOUR)),
            cylinders=_list(
                _object(
                    "foxglove.CylinderPrimitive",
                    pose=_POSE,
                    size=_VECTOR,
                    bottom_scale=_NUMBER,
                    top_scale=_NUMBER,
                    color=_COLOUR,
                )
            ),
            lines=_list(
                _object(
                    "foxglove.LinePrimitive",
                    type={
                        "title": "foxglove.LineType",
                        "oneOf": [
                            {"title": "LINE_STRIP", "const": 0},
                            {"title": "LINE_LOOP", "const": 1},
                            {"title": "LINE_LIST", "const": 2},
                        ],
                    },
                    pose=_POSE,
                    thickness=_NUMBER,
                    scale_invariant={"type": "boolean"},
                    points=_list(_POINT),
                    color=_COLOUR,
                    colors=_list(_COLOUR),
                    indices=_list({"type": "integer", "minimum": 0}),
                )
            ),
            triangles=_UNUSED,
            texts=_UNUSED,
            models=_UNUSED,
        )
    ),
)

IMAGE: Final = _object(
    "foxglove.CompressedImage",
    timestamp=_TIME,
    frame_id=_TEXT,
    data={"type": "string", "contentEncoding": "base64"},
    format=_TEXT,
)

TRACKING: Final = _object(
    "touchmove.Tracking",
    error={**_NUMBER, "description": "largest distance of the tool from its reference since the last message [m]"},
    force={
        **_NUMBER,
        "description": "largest force on the tool since the last message, estimated from torques and motion [N]",
    },
    tactile={**_NUMBER, "description": "largest force on a pad since the last message [N]"},
    torque={**_NUMBER, "description": "largest servomotor torque since the last message [N m]"},
    lateness={**_NUMBER, "description": "largest delay of a tick in the second before [s]"},
)
"""Worst values between two messages, so that a plot at a low rate shows every peak that the telemetry has."""
