"""The command that shows recorded games in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.ending import fail, say


def page(
    folder: Annotated[Path | None, typer.Argument(help="Folder with one or more records; if left out, games.")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="TCP port; if another page uses it, any free one.")
    ] = None,
    host: Annotated[
        str | None, typer.Option(help="IPv4 address to listen on; any except a loopback address needs a password.")
    ] = None,
    address: Annotated[
        str | None, typer.Option(help="Public https address, if a TLS proxy stands in front of the page.")
    ] = None,
    password: Annotated[Path | None, typer.Option(help="Password file, made by --set-password.")] = None,
    set_password: Annotated[
        Path | None, typer.Option(help="Only ask for a password and write it, hashed, to this file.")
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the browser if there is a display.")] = True,
) -> None:
    """Show recorded games in the browser, until Ctrl-C."""
    from app import UserError

    try:
        if set_password is not None:
            _set_password(set_password)
        else:
            _show(folder, {"port": port, "host": host, "address": address, "password": password}, browser=browser)
    except UserError as error:
        fail(str(error))


def _set_password(file: Path) -> None:
    import getpass
    import warnings

    from app.page.web.sign_in import PasswordHash

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", getpass.GetPassWarning)  # it would be read where anybody sees it
            first = getpass.getpass("Password of the page: ")
            made = PasswordHash.of(first)
            again = getpass.getpass("Repeat it: ")
    except (EOFError, getpass.GetPassWarning):
        fail("no password was typed, and nothing was written: run this at a terminal")
    except KeyboardInterrupt:
        fail("interrupted; nothing was written", 130)
    if again != first:
        fail("the two passwords differ, and nothing was written: try again")
    made.save(file)
    say(f"{file} holds the hashed password: name it as password under [page] in a game's settings, or with --password")


def _show(folder: Path | None, wishes: dict[str, object], *, browser: bool) -> None:
    import asyncio

    from app.cli.options import settings_or_end
    from app.page.page_server import open_in_browser, show_records
    from app.records.files import GAMES

    settings = settings_or_end({f"page.{name}": value for name, value in wishes.items()}).page

    def ready(address: str) -> None:
        say(f"the page is at {address}; Ctrl-C ends it")
        if browser:
            open_in_browser(address)

    try:
        asyncio.run(show_records(settings, GAMES if folder is None else folder, ready))
    except KeyboardInterrupt:
        raise typer.Exit(0) from None
