"""What following a game in pictures came to, in the form that ``touchmove vision --json`` prints."""

from __future__ import annotations

from rich.console import Group, RenderableType

from app.terminal.report_table import rows_table
from hardware.frozen import Frozen


class VisionEvent(Frozen):
    """One picture, or one settled view of a video."""

    frame: str  # name of its file; of a video, its number
    moves: tuple[str, ...]  # played since the one before, in UCI; where it was asked, what the answer was
    confidence: float  # probability of the moves by what was seen, before anybody was asked
    asked: bool  # whether a person had to say what was played
    said: str = ""  # what there is to say about it, in words


class Score(Frozen):
    """How it compares with what is known."""

    plies: int  # that were played by the labels
    right: int  # of them, seen and accepted as played
    wrong: int  # accepted as something else, or overlooked
    asked: int  # left to a person
    square_accuracy: float | None
    """Share of squares whose state (empty, white, black) was read right, before the rules and any answer counted; the
    first picture left out. None where no position is known."""


class VisionReport(Frozen):
    """A game followed: ``score`` is None where the truth is not known.

    ``failed`` says why it could not be followed to the end.
    """

    events: tuple[VisionEvent, ...]
    score: Score | None
    pgn: str
    failed: str | None = None

    @property
    def holds(self) -> bool:
        """Followed to the end, and nothing wrong where that is known."""
        return self.failed is None and (self.score is None or self.score.wrong == 0)

    def table(self) -> RenderableType:
        """For people: the game, and how sure its moves were."""
        rows = [
            (one.frame, " ".join(one.moves) or "-", f"{one.confidence:.4f}", "asked" if one.asked else one.said)
            for one in self.events
        ]
        title = self.failed or self.pgn
        return Group(rows_table(("frame", "moves", ">confidence", ""), rows, title), self._summary())

    def _summary(self) -> str:
        asked = sum(event.asked for event in self.events)
        if self.score is None:
            return f"{len(self.events)} views, asked at {asked}"
        one = self.score
        squares = "" if one.square_accuracy is None else f", {100 * one.square_accuracy:.2f} % of squares read right"
        return f"{one.plies} plies: {one.right} right, {one.wrong} wrong, {one.asked} asked{squares}"
