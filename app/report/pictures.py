"""Pictures of a record, scaled down, as data within the page."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from app.records import PlyEvent, RecordError
from app.records.events import FoundEvent, TroubleEvent
from app.records.frames import frame_file
from app.report.figures_of_plies import ply_name
from app.report.markup import Html, tag
from app.report.source import ReportSource

MOST: Final = 24
"""Pictures chosen evenly; those of plies with trouble come besides."""
MOST_OF_TROUBLE: Final = 16
SIDE: Final = 360
"""Width that pictures are scaled down to [px]."""
QUALITY: Final = 72


@dataclass(frozen=True, slots=True)
class BoardPhoto:
    """What the board looked like after so many plies; JPEG."""

    ply: int
    caption: str
    jpeg: bytes
    width: int
    height: int
    trouble: bool

    def html(self) -> Html:
        """The picture with its caption."""
        data = "data:image/jpeg;base64," + base64.b64encode(self.jpeg).decode("ascii")
        image = tag("img", src=data, alt=f"The board after ply {self.ply}, seen by the camera", width=self.width,
                    height=self.height, loading="lazy", decoding="async")  # fmt: skip
        mark = tag("strong", " · trouble") if self.trouble else ""
        return tag("figure", image, tag("figcaption", self.caption, mark))


def photographs(source: ReportSource) -> tuple[BoardPhoto, ...]:
    """The start, the end, and pictures spread evenly between; and those of plies with trouble."""
    there: dict[int, tuple[Path, PlyEvent | None]] = {}
    for ply, event in ((0, None), *((one.ply, one) for one in source.plies)):
        path = frame_file(source.folder, ply, None if event is None else event.frame)
        if path is not None:
            there[ply] = path, event
    troubled = troubled_plies(source) & set(there)
    wanted = set(evenly(sorted(there), MOST)) | set(evenly(sorted(troubled), MOST_OF_TROUBLE))
    return tuple(
        shown for ply in sorted(wanted) if (shown := _scaled(ply, *there[ply], trouble=ply in troubled)) is not None
    )


def troubled_plies(source: ReportSource) -> set[int]:
    """Numbers of the plies after which something was wrong, and of those with a failure."""
    told = {event.ply for event in source.events if isinstance(event, TroubleEvent | FoundEvent)}
    return told | {ply.ply for ply in source.plies if ply.failures}


def evenly(numbers: Sequence[int], most: int) -> tuple[int, ...]:
    """At most so many of them, first and last among them."""
    if len(numbers) <= most:
        return tuple(numbers)
    chosen: Iterable[int] = np.linspace(0, len(numbers) - 1, most).round().astype(int).tolist()
    return tuple(numbers[index] for index in chosen)


def _scaled(ply: int, path: Path, event: PlyEvent | None, *, trouble: bool) -> BoardPhoto | None:
    """None: it is no picture that can be read."""
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror}: allow reading it") from error
    pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if pixels is None:
        return None
    height, width = pixels.shape[:2]
    if width > SIDE:
        pixels = cv2.resize(pixels, (SIDE, round(height * SIDE / width)), interpolation=cv2.INTER_AREA)
    done, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    assert done, "OpenCV encodes what it has decoded"
    caption = "at the start" if event is None else f"ply {ply}: {ply_name(event)}"
    return BoardPhoto(ply, caption, encoded.tobytes(), pixels.shape[1], pixels.shape[0], trouble)
