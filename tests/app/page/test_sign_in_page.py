"""Somebody signs in, in a real browser, and is sent to do it again once that is no longer good."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from app.page.web.sign_in import PasswordHash
from tests.app.page.browsers import PATIENCE
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import served

pytestmark = pytest.mark.slow
PASSWORD = "Zugzwang: ½ point"


def test_who_is_no_longer_signed_in_is_asked_to_do_it_again(browser: Browser, tmp_path: Path) -> None:
    RecordedGame(tmp_path / "games" / "match").record.close()
    PasswordHash.of(PASSWORD).save(tmp_path / "password")
    with served(tmp_path / "games", password=tmp_path / "password") as site, browser.new_context() as context:
        context.set_default_timeout(PATIENCE)
        page = context.new_page()

        def sign_in() -> None:
            expect(page).to_have_url(f"http://127.0.0.1:{site.port}/login")
            page.locator("input[type=password]").fill(PASSWORD)
            page.keyboard.press("Enter")
            # only who is connected holds the controls: a socket that is still to come would survive what follows
            expect(page.locator("#open-controls")).to_contain_text("You have the controls")

        page.goto(f"http://127.0.0.1:{site.port}/")
        sign_in()
        context.clear_cookies()
        site.do(lambda: [connection.transport.abort() for connection in [*site.page._server.server_state.connections]])
        sign_in()  # it has come there by itself
