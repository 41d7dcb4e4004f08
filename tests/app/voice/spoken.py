"""What people say, spoken by espeak-ng, and a program that plays it as a microphone would."""

from __future__ import annotations

import io
import os
import subprocess
import wave
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from app.voice.recogniser import SAMPLE_RATE

VOICES = ("en-us", "en-gb", "en-us+f2", "en-gb+f4", "en-gb-scotland", "en-gb-x-rp+m3")


def speech(words: str, voice: str = "en-us", *, speed: int = 150, pitch: int = 50) -> NDArray[np.int16]:
    """A sentence at the recogniser's rate, with some hiss and a pause before and after; letters are said by name."""
    said = " ".join(word.upper() if len(word) == 1 else word for word in words.split())
    made = subprocess.run(
        ["espeak-ng", "-v", voice, "-s", str(speed), "-p", str(pitch), "--stdout", said],
        check=True, capture_output=True,
    ).stdout  # fmt: skip
    with wave.open(io.BytesIO(made)) as file:
        rate, samples = file.getframerate(), np.frombuffer(file.readframes(1 << 24), np.int16)
    sound = resample_poly(samples.astype(float), SAMPLE_RATE, rate)
    pause = np.zeros(SAMPLE_RATE // 2)
    whole = np.concatenate([pause, sound / np.abs(sound).max() * 12_000, pause])
    return (whole + np.random.default_rng(1).normal(0.0, 60.0, whole.size)).astype(np.int16)


def microphone(folder: Path, *sounds: NDArray[np.int16]) -> str:
    """The path of a program that takes arecord's place: it plays these sounds, then silence until it is ended."""
    folder.mkdir()
    (folder / "sound").write_bytes(b"".join(sound.tobytes() for sound in sounds))
    program = folder / "arecord"
    program.write_text(f"#!/bin/sh\ncat {folder}/sound\nexec sleep 600\n")
    program.chmod(0o755)
    return str(program)


def open_microphone(folder: Path) -> Path:
    """A program ``arecord`` in a folder, and the pipe from which it plays: what is written there is heard."""
    folder.mkdir()
    pipe, program = folder / "sound", folder / "arecord"
    os.mkfifo(pipe)
    program.write_text(f"#!/bin/sh\nexec cat {pipe}\n")
    program.chmod(0o755)
    return pipe
