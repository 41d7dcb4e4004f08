"""Who watches a command that plays: the terminal, a page in a browser, a voice; and how they hear of its end."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import typer

from app.cli.ending import fail, say
from hardware.loading import begin_loading

if TYPE_CHECKING:
    from rich.console import Console

    from app.page.news import Program
    from app.page.publisher import PagePublisher
    from app.page.starting import StartedPage
    from app.play.session import SessionResult
    from app.players.person import Lines
    from app.settings.defaults import Settings
    from app.terminal.game_display import UserInterface
    from app.terminal.typed_lines import TypedLines
    from app.voice.listener import Listener
    from app.voice.speaker import Speaker


def page_of_command(context: typer.Context) -> StartedPage | None:
    """The page's process, started first of all, where the options do not say that nobody wants it.

    It loads while this one does, and serves once the settings are known; it ends with the command in any case.
    """
    begin_loading()  # until the rig is open
    if context.params.get("headless") or context.params.get("page") is False:
        return None
    from app.page.starting import StartedPage

    started = StartedPage()
    context.call_on_close(started.cancel)
    return started


def show_game(
    program: Program, play: Callable[[UserInterface, Lines], SessionResult], settings: Settings,
    page_ahead: StartedPage | None, *, headless: bool = False, as_json: bool, awaited: bool = False,
) -> NoReturn:  # fmt: skip
    """Play a game before everybody who watches; ends the program.

    Args:
        program: that plays.
        play: given a user interface, and what is said at the terminal and on the page.
        settings: of the game.
        page_ahead: the page's process, which waits for them; None: nobody wants a page.
        headless: nothing is shown.
        as_json: the report is printed.
        awaited: a person may come by the page alone.
    """
    from rich.console import Console
    from rich.text import Text

    from app import UserError
    from app.players.game_end import plies_in_words
    from engine.errors import EngineProblem

    console = Console(stderr=True)
    with ExitStack() as stack:
        audience = stack.enter_context(
            _audience(program, settings, console, page_ahead, headless=headless, awaited=awaited)
        )
        try:
            result = play(audience.ui, audience.lines)
        except (UserError, EngineProblem) as error:
            audience.end(str(error))
            fail(str(error))
        except KeyboardInterrupt as stop:
            from app.play.session import Interrupted

            more = f"; 'touchmove resume {stop.folder}' continues it" if isinstance(stop, Interrupted) else ""
            audience.end(f"the program was interrupted{more}")
            fail(f"interrupted; the arm is at rest, and nothing that this program started is still running{more}", 130)
        report = result.report
        plies = plies_in_words(report.plies)
        played = "" if plies in report.exit_reason else f", {plies}"
        ended = f"{report.exit_reason}, result {report.result}{played}; record in {result.folder}"
        audience.end(ended)
    if as_json:
        print(report.model_dump_json(indent=2))
    if not headless:
        console.print(ended, highlight=False, markup=False, soft_wrap=True)
    for failure in report.failures:
        console.print(Text.assemble(("failed:", "red"), f" {failure.reason}"), soft_wrap=True)
    if result.resumable:
        from app.play.match import match_of

        sentence = f"'touchmove resume {match_of(result.folder)}' continues it"
        console.print(sentence, highlight=False, markup=False, soft_wrap=True)
    raise typer.Exit(0 if result.holds else 1)


@dataclass(frozen=True, slots=True)
class _Audience:
    """Who is shown a game, what they say, and how they are told that the program ends."""

    ui: UserInterface
    lines: Lines
    end: Callable[[str], None] = lambda _: None


@contextmanager
def _audience(
    program: Program,
    settings: Settings,
    console: Console,
    page_ahead: StartedPage | None,
    *,
    headless: bool,
    awaited: bool,
) -> Iterator[_Audience]:
    """The terminal and the page, as far as they are wanted; arguments as of ``show_game``."""
    from app import UserError
    from app.terminal.game_display import Conversation, Terminal, Together, UserInterface
    from app.terminal.typed_lines import TypedLines

    talks = program in ("play", "resume")
    with ExitStack() as stack:
        terminal: UserInterface = UserInterface()
        if not headless:
            shown = (
                Conversation(console, echoes=sys.stdin is not None and sys.stdin.isatty())
                if talks
                else Terminal(console)
            )
            terminal = stack.enter_context(shown)
        speaker: Speaker | None = None
        if settings.terminal.speak:
            from app.voice.speaker import Speaker

            try:
                speaker = stack.enter_context(Speaker(settings.terminal.voice))
            except UserError as error:
                fail(str(error))
            terminal = Together(terminal, speaker)
        typed = sys.stdin if talks else None
        remedy = None if awaited else "with --page the game waits for a browser"
        if page_ahead is not None and not settings.page.on:
            page_ahead.cancel()
            page_ahead = None
        ui, company, publisher = terminal, _nobody_else, None
        if page_ahead is not None:
            from app.page.publisher import PagePublisher

            publisher = PagePublisher(program)
            ui = Together(terminal, publisher)
            company = partial(_watched, publisher, awaited)
        lines = TypedLines(typed, ui.heard, company, remedy)
        if settings.terminal.microphone:
            ui = Together(ui, stack.enter_context(_listener(lines, ui, speaker)))
        if publisher is not None and page_ahead is not None:
            from app.page.supervisor import PageSupervisor
            from app.records.files import GAMES

            publisher.subscribe(lines.offer)
            stack.enter_context(PageSupervisor(settings.page, publisher, GAMES, _invite, say, page_ahead))
        yield _Audience(ui, lines, (lambda _: None) if publisher is None else publisher.end)


def _nobody_else() -> bool:
    return False


def _watched(publisher: PagePublisher, awaited: bool) -> bool:
    return (awaited or publisher.used) and not publisher.given_up


def _listener(lines: TypedLines, ui: UserInterface, speaker: Speaker | None) -> Listener:
    from app import UserError
    from app.voice.listener import Listener

    try:
        return Listener(lines.offer, ui.say, _nobody_else if speaker is None else speaker.speaks)
    except UserError as error:
        fail(str(error))


def _invite(address: str) -> None:
    """Say where the page is, and open it where there is a screen and somebody who has started this by hand."""
    say(f"watch and play in a browser: {address}")
    if (
        sys.stderr is not None
        and sys.stderr.isatty()
        and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    ):
        # some browsers keep who opens them waiting, and whoever looks after the page must not be
        threading.Thread(target=webbrowser.open, args=(address,), name="browser", daemon=True).start()
