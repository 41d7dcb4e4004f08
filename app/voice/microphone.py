"""The microphone: what people say, an utterance at a time, taken by Debian's arecord."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from typing import Final, Self

from app import UserError
from app.voice.recogniser import SAMPLE_RATE

PROGRAM: Final = "arecord"
_LONGEST: Final = 8.0
"""Nobody says a move for longer [s]; what goes on is a conversation or a noise, and is not listened to."""


class MicrophoneMissing(UserError):
    """There is nothing here that records."""

    def __init__(self) -> None:
        super().__init__(
            f"{PROGRAM} is not installed: run 'sudo apt-get install alsa-utils', or leave --microphone out"
        )


class Microphone:
    """Listens until it is closed. A context manager.

    Args:
        program: writes sound to its output, samples of 16 bit at ``SAMPLE_RATE``, until it is ended.

    Raises:
        MicrophoneMissing: it is not there.
    """

    def __init__(self, program: str = PROGRAM) -> None:
        found = shutil.which(program)
        if found is None:
            raise MicrophoneMissing
        self._recording = subprocess.Popen(
            [found, "--quiet", "--file-type", "raw", "--format", "S16_LE", "--rate", str(SAMPLE_RATE)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """The recording ends, and with it whoever waits for an utterance."""
        self._closed = True
        self._recording.kill()
        self._recording.wait()

    def utterances(self, deaf: Callable[[], bool] = lambda: False) -> Iterator[bytes]:
        """What is said between two silences, one after the other, until the microphone is closed.

        Args:
            deaf: whether what can be heard now is not to be listened to, as while the robot itself speaks.

        Raises:
            UserError: the recording has ended by itself; the sentence says what it says.
        """
        from pocketsphinx import Endpointer

        sound, complaints = self._recording.stdout, self._recording.stderr
        assert sound is not None
        assert complaints is not None
        ear, said = Endpointer(sample_rate=SAMPLE_RATE), bytearray()
        with sound, complaints:
            while len(frame := sound.read(ear.frame_bytes)) == ear.frame_bytes:
                if deaf():
                    ear, said = Endpointer(sample_rate=SAMPLE_RATE), bytearray()
                    continue
                said += ear.process(frame) or b""
                if said and not ear.in_speech:
                    if len(said) < _LONGEST * SAMPLE_RATE * 2:
                        yield bytes(said)
                    said.clear()
            if not self._closed:
                lines = complaints.read().decode(errors="replace").strip().splitlines()
                raise UserError(f"nothing can be heard any more: {lines[-1] if lines else f'{PROGRAM} has ended'}")
