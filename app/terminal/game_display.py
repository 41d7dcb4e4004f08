"""What people see of a running game in the terminal, and what they, or a script, type there."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Self

import chess
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from app.records import PlyEvent
from app.terminal.shown import ClockShown, LookShown, PathShown, RemoteShown, SessionShown
from hardware.piece_set import Colour


class UserInterface:
    """Told what happens; this one shows nothing."""

    def phase(self, text: str) -> None:
        """What is being done now."""

    def position(self, board: chess.Board) -> None:
        """The position on the board."""

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """A ply was done."""

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """Something for the person at the board, who should not miss it; about some squares."""

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """Somebody is to say something: one of some words, about some squares, or at their turn a move."""

    def answered(self) -> None:
        """Nothing is asked any more."""

    def heard(self, line: str) -> None:
        """Somebody has said something."""

    def session(self, shown: SessionShown) -> None:
        """Devices were opened."""

    def round(self, folder: Path, number: int, *, sets_up: bool) -> None:
        """A game, or what is set up for it, begins; its record lies in a folder."""

    def result(self, result: str, reason: str) -> None:
        """That game is over, or is left: PGN's result, and why."""

    def remote(self, shown: RemoteShown) -> None:
        """Somebody elsewhere plays, and these words make sense now: told whenever that changes."""

    def clock(self, shown: ClockShown | None) -> None:
        """A clock was started or stopped; None: there are none."""

    def look(self, shown: LookShown) -> None:
        """The camera has looked at the board."""

    def path(self, shown: PathShown) -> None:
        """A motion of the arm begins."""

    def device(self, name: str, ok: bool | None, sentence: str) -> None:
        """How a device is: well, not well, or nobody can tell."""


class Together(UserInterface):
    """Several at once: each is told everything, in order."""

    def __init__(self, *members: UserInterface) -> None:
        self._members = members

    def phase(self, text: str) -> None:
        """See ``UserInterface.phase``."""
        self._each(lambda one: one.phase(text))

    def position(self, board: chess.Board) -> None:
        """See ``UserInterface.position``."""
        self._each(lambda one: one.position(board))

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self._each(lambda one: one.ply(event, board))

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self._each(lambda one: one.say(sentence, squares))

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self._each(lambda one: one.prompt(sentence, answers, squares, turn=turn))

    def answered(self) -> None:
        """See ``UserInterface.answered``."""
        self._each(lambda one: one.answered())

    def heard(self, line: str) -> None:
        """See ``UserInterface.heard``."""
        self._each(lambda one: one.heard(line))

    def session(self, shown: SessionShown) -> None:
        """See ``UserInterface.session``."""
        self._each(lambda one: one.session(shown))

    def round(self, folder: Path, number: int, *, sets_up: bool) -> None:
        """See ``UserInterface.round``."""
        self._each(lambda one: one.round(folder, number, sets_up=sets_up))

    def result(self, result: str, reason: str) -> None:
        """See ``UserInterface.result``."""
        self._each(lambda one: one.result(result, reason))

    def remote(self, shown: RemoteShown) -> None:
        """See ``UserInterface.remote``."""
        self._each(lambda one: one.remote(shown))

    def clock(self, shown: ClockShown | None) -> None:
        """See ``UserInterface.clock``."""
        self._each(lambda one: one.clock(shown))

    def look(self, shown: LookShown) -> None:
        """See ``UserInterface.look``."""
        self._each(lambda one: one.look(shown))

    def path(self, shown: PathShown) -> None:
        """See ``UserInterface.path``."""
        self._each(lambda one: one.path(shown))

    def device(self, name: str, ok: bool | None, sentence: str) -> None:
        """See ``UserInterface.device``."""
        self._each(lambda one: one.device(name, ok, sentence))

    def _each(self, tell: Callable[[UserInterface], None]) -> None:
        for one in self._members:
            tell(one)


class Terminal(UserInterface):
    """Board, present phase and the last plies on a terminal; plain lines where the output is none."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, refresh_per_second=8, transient=False) if console.is_terminal else None
        self._board = chess.Board()
        self._phase = "starting"
        self._rows: list[PlyEvent] = []
        self._since = time.monotonic()
        self._printed_phase = ""

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def phase(self, text: str) -> None:
        """See ``UserInterface.phase``."""
        self._phase = text
        if self._live is not None:
            self._show()
        elif not self._rows and text != self._printed_phase:  # start-up takes seconds; later the plies tell
            self._printed_phase = text
            self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def position(self, board: chess.Board) -> None:
        """See ``UserInterface.position``."""
        self._board = board.copy(stack=False)
        self._show()

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self._rows.append(event)
        self._board = board.copy(stack=False)
        if self._live is None:
            self._console.print(_line(event), highlight=False, soft_wrap=True)
        self._show()

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self._console.print(sentence, highlight=False, markup=False, soft_wrap=True)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self.say(sentence)

    def _show(self) -> None:
        if self._live is not None:
            self._live.update(self._picture())

    def _picture(self) -> Group:
        table = Table.grid(padding=(0, 3))
        squares = Panel(Text(self._board.unicode(borders=False, empty_square="·")), title=_title(self._rows))
        table.add_row(squares, _plies(self._rows[-8:]))
        wall = time.monotonic() - self._since
        return Group(table, Text(f"{self._phase}   ({wall:.0f} s)", style="cyan"))


class Conversation(UserInterface):
    """A game with a person at the keyboard: line by line, so that what they type stays in order.

    Args:
        console: is written to.
        echoes: what is typed is shown by the terminal itself; else, as of a script in a pipe, it is shown here.
    """

    def __init__(self, console: Console, *, echoes: bool = True) -> None:
        self._console, self._plain, self._echoes = console, console.color_system is None, echoes
        self._said = ""
        self._remote: RemoteShown | None = None
        self._person: Colour | None = None
        self._prompted = False
        """The last line is a prompt that nobody has answered."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing has to be undone."""

    def session(self, shown: SessionShown) -> None:
        """See ``UserInterface.session``."""
        self._person = shown.person

    def remote(self, shown: RemoteShown) -> None:
        """See ``UserInterface.remote``."""
        self._remote = shown

    def phase(self, text: str) -> None:
        """See ``UserInterface.phase``."""
        if text != self._said:
            self._said = text
            self._leave_prompt()
            self._console.print(f"  … {text}", style="cyan", highlight=False, markup=False, soft_wrap=True)

    def position(self, board: chess.Board) -> None:
        """See ``UserInterface.position``."""
        self._leave_prompt()
        self._console.print(board_text(board, plain=self._plain))

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self._leave_prompt()
        self._console.print(board_text(board, chess.Move.from_uci(event.uci), plain=self._plain))
        said = f"{_number(event)} {event.san}  ({self._who(event)} played)"
        self._console.print(said, style="bold", highlight=False, markup=False, soft_wrap=True)

    def _who(self, event: PlyEvent) -> str:
        """Whose move it was, whoever has carried it out: the arm makes those of an opponent elsewhere, too."""
        if self._remote is None:
            return "you" if event.by == "hand" else "I"
        if event.side is self._remote.side:
            return self._remote.name or "they"
        return "you" if event.side is self._person else "I"

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self._leave_prompt()
        self._console.print(sentence, highlight=False, markup=False, soft_wrap=True)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self._leave_prompt()
        self._console.print(f"{sentence} > ", style="bold", end="", highlight=False, markup=False, soft_wrap=True)
        self._prompted = True

    def heard(self, line: str) -> None:
        """A line was typed, or came from a script."""
        if not self._echoes:
            self._console.print(line, highlight=False, markup=False, soft_wrap=True)
        self._prompted = False

    def _leave_prompt(self) -> None:
        """What comes now is no answer to the prompt: it begins a line of its own."""
        if self._prompted:
            self._console.print()
        self._prompted = False


_LIGHT, _DARK, _MOVED = "#bd9b6a", "#80553a", "#7f8f2f"
"""Squares on which both white and black pieces can be told: contrasts of 2.5 and more."""


def board_text(board: chess.Board, last: chess.Move | None = None, *, plain: bool = False) -> Text:
    """The board, White below, with coordinates; the squares of the last move stand out.

    ``plain``: nothing is shown in colours, so that the pieces themselves have to differ.
    """
    text = Text()
    touched = set() if last is None else {last.from_square, last.to_square}
    for rank in range(7, -1, -1):
        text.append(f" {rank + 1} ", style="dim")
        for file in range(8):
            square = chess.square(file, rank)
            ground = _MOVED if square in touched else _LIGHT if (file + rank) % 2 else _DARK
            piece = board.piece_at(square)
            empty = "·" if plain else " "
            filled = None if piece is None else piece if plain else chess.Piece(piece.piece_type, chess.BLACK)
            glyph = empty if filled is None else filled.unicode_symbol()
            ink = "#ffffff" if piece is not None and piece.color else "#000000"
            text.append(f" {glyph} ", style=f"bold {ink} on {ground}")
        text.append("\n")
    text.append("    " + "  ".join("abcdefgh"), style="dim")
    return text


def _title(rows: list[PlyEvent]) -> str:
    return f"ply {rows[-1].ply}" if rows else "start"


def _number(event: PlyEvent) -> str:
    return f"{(event.ply + 1) // 2}{'.' if event.side == 'white' else '…'}"


def _placement(event: PlyEvent) -> str:
    errors = event.placement_mm
    return f"{max(errors.values()):.2f} mm" if errors else "-"


def _duration(event: PlyEvent) -> str:
    if event.real_s is None:
        return "by hand" if event.by == "hand" else "mended"
    return f"{event.real_s:.2f} s"


def _line(event: PlyEvent) -> str:
    verdict = {True: "ok", False: "WRONG", None: "unjudged"}[event.physical_ok]
    return (
        f"ply {event.ply:3d}  {event.side:5}  {event.san:7} {event.kind:10}  "
        f"{_duration(event):>7}  {_placement(event):>8}  {verdict}"
    )


def _plies(rows: list[PlyEvent]) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("", "move", "kind", "time", "placed", "board"):
        table.add_column(heading, justify="right" if heading in ("time", "placed") else "left")
    for event in rows:
        verdict = {True: "[green]ok", False: "[red]wrong", None: "-"}[event.physical_ok]
        table.add_row(_number(event), event.san, event.kind, _duration(event), _placement(event), verdict)
    return table
