"""The command that shows recorded games in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.ending import fail, say


def page(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder of a game's record, or of many; games if left out.")
    ] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="TCP port; where another page has it, any free one.")
    ] = None,
    host: Annotated[
        str | None, typer.Option(help="IPv4 address to listen at; any but a loopback one wants a password.")
    ] = None,
    address: Annotated[
        str | None, typer.Option(help="Where a TLS proxy stands before the page: what the browser shows.")
    ] = None,
    password: Annotated[Path | None, typer.Option(help="File that --set-password has made.")] = None,
    set_password: Annotated[
        Path | None, typer.Option(help="Ask for a password and write it, hashed, to this file; nothing else.")
    ] = None,
    browser: Annotated[bool, typer.Option(help="Open the browser, where there is a display.")] = True,
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

    from app.page.web.sign_in import PasswordHash

    first = getpass.getpass("Password of the page: ")
    made = PasswordHash.of(first)
    if getpass.getpass("Once more: ") != first:
        fail("these were two different passwords, and nothing was written: try again")
    made.save(file)
    say(f"{file} holds the password, hashed: name it as password under [page] of a game's settings, or with --password")


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
