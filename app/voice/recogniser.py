"""Speech into phrases, offline: PocketSphinx, with the American English acoustic model in its package."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, Final

from app import UserError
from app.voice.phrases import ADDRESS

SAMPLE_RATE: Final = 16_000
"""What the acoustic model was trained with [Hz]; one channel of 16 bit."""
_NAME: Final = "now"
"""Of the grammar; each new one takes the place of the one before."""
_ADDRESSED: Final = 1e-40
"""Likelihood ratio above which the address was said: found in 20 of 20 commands, and once in
44 other sentences ("could you p...")."""


class RecogniserMissing(UserError):
    """The package is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "spoken moves need the package pocketsphinx: install it with pip install 'touchmove[voice]', or leave "
            "--microphone out"
        )


class Recogniser:
    """Tells whether the robot is spoken to, and which of some phrases was said.

    Raises:
        RecogniserMissing: the extra ``voice`` is not installed.
    """

    def __init__(self) -> None:
        if find_spec("pocketsphinx") is None:
            raise RecogniserMissing
        from pocketsphinx import Decoder

        self._decoder = Decoder(lm=None, samprate=SAMPLE_RATE, loglevel="FATAL")
        self._spotter = Decoder(
            lm=None, samprate=SAMPLE_RATE, loglevel="FATAL", keyphrase=ADDRESS, kws_threshold=_ADDRESSED
        )
        self._grammar = ""

    def knows(self, word: str) -> bool:
        """Whether it knows how a word sounds; no other may be in a grammar."""
        return self._decoder.lookup_word(word) is not None

    def addressed(self, sound: bytes) -> bool:
        """Whether the robot is spoken to in an utterance, samples of 16 bit at ``SAMPLE_RATE``."""
        return self._hear(self._spotter, sound) is not None

    def understood(self, sound: bytes, grammar: str) -> str | None:
        """The phrase of a grammar that a sound is most like; None: it is like none of them.

        Args:
            sound: as above.
            grammar: an expression in JSGF, of words in the recogniser's dictionary.
        """
        if grammar != self._grammar:
            self._decoder.add_jsgf_string(_NAME, f"#JSGF V1.0; grammar {_NAME}; public <said> = {grammar};")
            self._decoder.activate_search(_NAME)
            self._grammar = grammar
        return self._hear(self._decoder, sound)

    @staticmethod
    def _hear(decoder: Any, sound: bytes) -> str | None:
        decoder.start_utt()
        decoder.process_raw(sound, full_utt=True)
        decoder.end_utt()
        found = decoder.hyp()
        return None if found is None else str(found.hypstr)
