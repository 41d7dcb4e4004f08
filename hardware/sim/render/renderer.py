"""Renders the simulated cameras in a process of its own, so that pictures never hold up the plant's ticks.

The world sends joint positions over an inherited socket; pictures go into a file in the run directory that the
camera's client maps, and a short answer says which.
"""

import math
import os
import socket
import struct
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.frozen import Frozen
from hardware.interfaces import HardwareError, Intrinsics
from hardware.sim.render.d435 import DEPTH_HEIGHT, DEPTH_WIDTH
from hardware.sim.render.quality import LOOK, PictureQuality
from hardware.sim.render.settings import CameraSettings, SceneState

MODEL_FILE = "world.mjb"
WIDTH, HEIGHT = 640, 480
"""Of clean pictures [px]."""
DEPTH_BYTES = 2 * DEPTH_WIDTH * DEPTH_HEIGHT
"""A slot's file begins with the depth picture, if there is one, in units of 16 bits; the colour picture follows."""
FRAME_BYTES = DEPTH_BYTES + 3 * 1280 * 720
"""Size of a slot's file: room for the largest pictures."""
HEADER = struct.Struct("<I")
"""Length of the JSON of a ``RenderRequest``, which follows; then the positions as float64."""
REPLY = struct.Struct("<I")
GO, READY = b"go", b"ready"
"""First word to the process that draws, once its model is there; and its first word."""
LOG_FILE: Final = "renderer.log"
MOST_THREADS = min(4, os.cpu_count() or 1)
"""Of Mesa where a picture is waited for, beside who asks it to draw, unless ``LP_NUM_THREADS`` says how many."""
KEEPING: Final = {"MALLOC_TRIM_THRESHOLD_": str(1 << 28), "MALLOC_MMAP_THRESHOLD_": str(1 << 28)}
"""glibc keeps a picture's memory for the next picture: to give it back and take it anew makes up a third of a depth
picture's errors' time."""
_LONGEST = 64
"""Of what the renderer says [bytes]."""
START_TIMEOUT = 60.0
DRAW_TIMEOUT = 60.0
"""Who waits for a picture does not hurry, on however busy a machine: one that takes longer does not come [s, wall]."""
MOST_DEATHS: Final = 3
"""A renderer that ends so often without a picture in between is given up."""
LOST = "the renderer is stuck or has ended again and again; renderer.log in the run directory says why"
GL_REMEDY = (
    "pictures need OpenGL through EGL, and it does not start here ({}): "
    "install it with 'sudo apt-get install libegl1 libgl1-mesa-dri', or leave the cameras out (--no-cameras; in a rig "
    "file cameras = false)"
)


class Sensor(Frozen):
    """The RGB-D camera that takes a picture, and what decides its noise."""

    camera: CameraSettings
    seed: int
    tick: int
    depth: bool
    """Whether the depth picture is wanted as well."""
    colour: bool = True
    """Whether the colour picture is wanted: it takes most of the time. Without, the file keeps an older one."""
    glance: bool = False
    """Depth alone, with ``GLANCE`` times fewer pixels along each axis."""


class RenderRequest(Frozen):
    """One picture that is wanted."""

    slot: int
    view: str
    looks: SceneState | None = None
    """None: light as the model has it."""
    sensor: Sensor | None = None
    """None: a clean picture of 640×480 pixels, without depth."""
    quality: PictureQuality = LOOK
    """Of a clean picture; a sensor's is as good as can be."""


def pack_request(shot: RenderRequest, positions: NDArray[np.float64]) -> bytes:
    """A request as sent to the renderer's process."""
    wish = shot.model_dump_json().encode()
    return HEADER.pack(len(wish)) + wish + positions.tobytes()


def unpack_request(message: bytes) -> tuple[RenderRequest, NDArray[np.float64]]:
    """Inverse of ``pack_request``."""
    end = HEADER.size + HEADER.unpack_from(message)[0]
    return RenderRequest.model_validate_json(message[HEADER.size : end]), np.frombuffer(message[end:], dtype=np.float64)


def frame_path(run_dir: Path, slot: int) -> Path:
    """File into which a slot's frames are written."""
    return run_dir / f"frame-{slot}.bin"


def make_slot(run_dir: Path, slot: int) -> None:
    """Make a slot's file with room for its frames (who drew without would be killed); ``OSError`` if there is none."""
    with frame_path(run_dir, slot).open("ab") as file:
        os.posix_fallocate(file.fileno(), 0, FRAME_BYTES)


def load_pictures(
    path: Path, width: int, height: int, *, depth: bool, colour: bool = True
) -> tuple[NDArray[np.uint8], NDArray[np.uint16] | None]:
    """What was drawn into a slot's file: colour (height, width, 3) RGB, black where it is not wanted; depth as the
    imager has it, in whole units, or None where it is not wanted.
    """
    shape = (height, width, 3)
    if colour:
        picture = np.fromfile(path, dtype=np.uint8, offset=DEPTH_BYTES, count=math.prod(shape)).reshape(shape)
    else:
        picture = np.zeros(shape, dtype=np.uint8)
    if not depth:
        return picture, None
    return picture, load_depth(path)


def load_depth(path: Path, decimation: int = 1) -> NDArray[np.uint16]:
    """The depth picture of a slot's file, in whole units, with so many times fewer pixels along each axis."""
    height, width = DEPTH_HEIGHT // decimation, DEPTH_WIDTH // decimation
    return np.fromfile(path, dtype=np.uint16, count=width * height).reshape(height, width)


def intrinsics_for(vertical_field_of_view: float) -> Intrinsics:
    """Pinhole of a clean picture; angle in rad."""
    focal = 0.5 * HEIGHT / float(np.tan(0.5 * vertical_field_of_view))
    return Intrinsics(WIDTH, HEIGHT, focal, focal, 0.5 * (WIDTH - 1), 0.5 * (HEIGHT - 1))


class StartedDrawing:
    """A process that draws: it loads, and then waits to be told that its model lies in the run directory.

    Attributes:
        link: our end of the socket to it.
        process: ends when the socket closes.
    """

    def __init__(self, run_dir: Path, *, alone: bool) -> None:
        """Start it. ``alone``: as of ``Renderer``. The run directory may come later."""
        self.link, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        threads = {"LP_NUM_THREADS": str(MOST_THREADS if alone else 1)}
        environment = {**threads, **os.environ, **KEEPING, "MUJOCO_GL": "egl"}
        self._run_dir, self._said = run_dir, tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        with far:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "hardware.sim.render.drawing", str(run_dir), str(far.fileno())],
                pass_fds=[far.fileno()], stdout=self._said, stderr=self._said, stdin=subprocess.DEVNULL,
                env=environment,
            )  # fmt: skip

    def begin(self) -> None:
        """The model is there; what it says goes to its log from here on. One that has ended is found out later."""
        with suppress(OSError):
            self.link.send(GO)

    def close(self, patience: float) -> None:
        """End it, by force if it takes longer than ``patience`` [s]; what it said before its log is added to that."""
        self.link.close()
        try:
            self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if not self._said.closed:
            with self._said as said, (self._run_dir / LOG_FILE).open("ab") as log:
                said.seek(0)
                log.write(said.read())


class Renderer:
    """The renderer process as the world sees it: send positions, later take the answer.

    A process that ends is replaced, and asked again for every picture it still owed. A picture depends on its request
    alone, so that it comes out the same to the last bit.
    """

    def __init__(self, run_dir: Path, *, alone: bool = True, started: StartedDrawing | None = None) -> None:
        """Start the process; requests wait until it is ready, and ``wait_ready`` tells whether it can draw at all.

        ``alone``: whoever asks waits for the picture, so that it may take all cores; else it keeps to one and a half,
        beside a plant in real time. ``started``: a process for it that has begun to load.
        """
        self._run_dir, self._alone = run_dir, alone
        self._owed: list[bytes] = []
        """Requests without an answer, oldest first."""
        self._deaths = 0
        """Since the last picture."""
        (run_dir / LOG_FILE).write_bytes(b"")
        self._start(started)

    def _start(self, started: StartedDrawing | None = None) -> None:
        self._drawing = started or StartedDrawing(self._run_dir, alone=self._alone)
        self._link = self._drawing.link
        self._drawing.begin()

    def _start_again(self) -> None:
        """Another process, asked for what the last one owed; raises ``HardwareError`` where it ends again and again."""
        while True:
            self._deaths += 1
            if self._deaths >= MOST_DEATHS:
                raise HardwareError(LOST)
            self.close(patience=0.0)
            print("the renderer has ended: another one is started", file=sys.stderr, flush=True)
            try:
                self._start()
                for request in self._owed:
                    self._link.send(request)
            except OSError:
                continue
            return

    @property
    def pid(self) -> int:
        """Of the process that draws at the moment."""
        return self._drawing.process.pid

    @property
    def number(self) -> int:
        """Of the open file that has something to read when a picture is finished."""
        return self._link.fileno()

    def wait_ready(self) -> None:
        """Block until it can draw; raises ``HardwareError`` if there is no OpenGL, or it ends again and again."""
        while True:
            self._link.settimeout(START_TIMEOUT)
            answer, stuck = b"", False
            try:
                answer = self._link.recv(_LONGEST)
            except TimeoutError:
                stuck = True
            except OSError:  # it has ended
                pass
            if answer == READY:
                return
            self.close()
            if stuck or self._drawing.process.returncode >= 0:
                lines = (self._run_dir / LOG_FILE).read_text(errors="replace").strip().splitlines()
                raise HardwareError(GL_REMEDY.format(lines[-1][:200] if lines else "no answer"))
            self._start_again()  # it was killed

    def request(self, shot: RenderRequest, positions: NDArray[np.float64]) -> None:
        """Ask for a picture at joint positions; raises ``HardwareError`` if it ends again and again, or is stuck."""
        self._owed.append(pack_request(shot, positions))
        try:
            self._link.send(self._owed[-1])
        except (BlockingIOError, TimeoutError) as error:
            raise HardwareError(LOST) from error
        except OSError:
            self._start_again()

    def take(self, wait: bool, patience: float = DRAW_TIMEOUT) -> int | None:
        """The slot of the next finished picture; of one under way after ``patience`` at most [s, wall], or None without
        ``wait``.

        Raises ``HardwareError`` if the renderer ends again and again, or is stuck.
        """
        while True:
            try:
                self._link.settimeout(patience if wait else 0.0)
                message = self._link.recv(_LONGEST)
            except BlockingIOError:
                return None
            except TimeoutError as error:
                raise HardwareError(LOST) from error
            except OSError:
                message = b""
            if not message:
                self._start_again()
                patience = max(patience, START_TIMEOUT)
            elif message != READY:  # the first word of one that nobody waited for
                self._deaths = 0
                del self._owed[0]
                slot: int = REPLY.unpack(message)[0]
                return slot

    def close(self, patience: float = 5.0) -> None:
        """End the process, by force if it takes longer than ``patience`` [s]."""
        self._drawing.close(patience)
