"""The page's password: its file, its cookie, and what is shown to who does not know it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.exceptions import InvalidStatus

from app.page.web.live_socket import Allowance
from app.page.web.sign_in import SHORTEST, SIGNED_IN, TRIES, PasswordFileError, PasswordHash, SignIn
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import ServedPage, served

PASSWORD = "Zugzwang: ½ point"
KEPT = PasswordHash.of(PASSWORD)


@pytest.fixture
def page(tmp_path: Path) -> Iterator[ServedPage]:
    RecordedGame(tmp_path / "games" / "match").record.close()
    KEPT.save(tmp_path / "password")
    with served(tmp_path / "games", password=tmp_path / "password") as running:
        yield running


def sign_in(page: ServedPage, password: str) -> tuple[int, str]:
    """Status and cookie."""
    from urllib.parse import urlencode

    form = urlencode({"password": password})
    answer = page.get("/login", {"Content-Type": "application/x-www-form-urlencoded"}, method="POST", body=form)
    return answer.status, (answer.headers["Set-Cookie"] or "").split(";")[0]


# ---------------------------------------------------------------------------------------------------------------- file


def test_a_password_is_known_again_from_its_file_and_nothing_else_is(tmp_path: Path) -> None:
    KEPT.save(tmp_path / "password")
    content = (tmp_path / "password").read_text(encoding="ascii")
    assert PASSWORD not in content
    assert (tmp_path / "password").stat().st_mode & 0o777 == 0o600
    found = PasswordHash.load(tmp_path / "password")
    assert found.matches(PASSWORD)
    assert not found.matches(PASSWORD + " ")
    assert PasswordHash.of(PASSWORD).salt != KEPT.salt
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("password", ["", "x" * (SHORTEST - 1), "x" * 201])
def test_a_password_is_neither_short_nor_endless(password: str) -> None:
    with pytest.raises(PasswordFileError, match=f"has {len(password)} characters: choose one with 10 to 200"):
        PasswordHash.of(password)


@settings(max_examples=50)
@given(st.binary(max_size=200))
def test_any_other_file_is_no_password_file(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("password") / "file"
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(PasswordFileError, match=r"not a password file|another version"):
        PasswordHash.load(path)


def test_a_file_that_others_read_or_that_is_missing_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "password"
    with pytest.raises(PasswordFileError, match="cannot be read: No such file or directory: make it with"):
        PasswordHash.load(path)
    KEPT.save(path)
    path.chmod(0o640)
    with pytest.raises(PasswordFileError, match="others can read the password file"):
        PasswordHash.load(path)
    with pytest.raises(PasswordFileError, match="cannot be written"):
        KEPT.save(tmp_path / "no" / "folder")


# -------------------------------------------------------------------------------------------------------------- cookie


class Time:
    now = 1e9

    def __call__(self) -> float:
        return self.now


def test_a_cookie_is_known_until_it_is_too_old_or_the_password_is_another() -> None:
    time = Time()
    signed = SignIn(KEPT, 8064, secure=True, now=time)
    header = signed.cookie()
    assert "; HttpOnly; SameSite=Strict; Secure" in header
    assert "Secure" not in SignIn(KEPT, 8064, secure=False).cookie()
    cookie = header.split(";")[0]
    assert signed.knows(cookie)
    assert signed.knows(f"other=1; {cookie}; more=2")
    assert SignIn(PasswordHash(KEPT.salt, KEPT.hash), 8064, secure=True, now=time).knows(cookie), "a page started again"
    assert not SignIn(PasswordHash.of(PASSWORD), 8064, secure=True, now=time).knows(cookie)
    assert not SignIn(KEPT, 8065, secure=True, now=time).knows(cookie)
    time.now += SIGNED_IN + 1
    assert not signed.knows(cookie)


@given(st.text(max_size=80), st.integers(0, 40), st.characters())
def test_no_other_cookie_is_known(text: str, at: int, letter: str) -> None:
    signed = SignIn(KEPT, 8064, secure=False)
    name, value = signed.cookie().split(";")[0].split("=", 1)
    assert not signed.knows(text)
    assert not signed.knows(f"{name}={text}") or text == value
    at = min(at, len(value) - 1)
    changed = value[:at] + letter + value[at + 1 :]
    assert not signed.knows(f"{name}={changed}") or changed.strip('" ') == value or changed == value


@pytest.mark.parametrize("other", ['seen={"a":1}', "a b=1", "token", 'x="', "x@y=1", "path=/", "caf\xe9=1", "=;;"])
def test_cookies_of_other_programs_on_the_computer_keep_nobody_out(other: str) -> None:
    sign_in = SignIn(KEPT, 8064, secure=False)
    cookie = sign_in.cookie().split(";")[0]
    assert sign_in.knows(f"{other}; {cookie}")
    assert sign_in.knows(f"{cookie}; {other}")
    assert not sign_in.knows(f"{other}; touchmove-8064=; a={cookie}")


def test_an_allowance_is_so_many_at_once_and_so_many_a_second() -> None:
    time = Time()
    allowance = Allowance(2.0, 3.0, time)
    assert [allowance.take() for _ in range(5)] == [True, True, True, False, False]
    assert allowance.wait == pytest.approx(0.5)
    time.now += 1.0
    assert [allowance.take() for _ in range(3)] == [True, True, False]
    time.now += 1000.0
    assert [allowance.take() for _ in range(4)] == [True, True, True, False]
    allowance.give_back()
    assert allowance.take()


# ---------------------------------------------------------------------------------------------------------------- page

PATHS = (
    "/", "/static/app.js", "/static/index.html", "/robot.json", "/games", "/games/match/record.json",
    "/games/match/film", "/picture/camera.jpg", "/stream/camera", "/nowhere", "/static/../static/app.js",
)  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_nothing_is_shown_to_who_has_not_signed_in(page: ServedPage, path: str) -> None:
    assert page.get(path).status == 401
    asked = page.get(path, {"Accept": "text/html,*/*"})
    assert (asked.status, asked.headers["Location"]) == (303, "/login")
    assert page.get(path, {"Cookie": f"touchmove-{page.port}=abc.def"}).status == 401


def test_who_knows_the_password_comes_in_everywhere(page: ServedPage) -> None:
    assert page.get("/login").status == 200
    assert page.get("/static/login.css").status == 200
    status, cookie = sign_in(page, PASSWORD)
    assert status == 303
    assert page.get("/games", {"Cookie": cookie}).status == 200
    with page.browser(cookie=cookie) as browser:
        assert browser.holds
    with pytest.raises(InvalidStatus, match="401"):
        page.browser()


@pytest.fixture
def no_try_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long this machine takes for the wrong ones."""
    monkeypatch.setattr("app.page.web.server.AGAIN", 1e6)


@pytest.mark.usefixtures("no_try_comes_back")
def test_a_wrong_password_is_said_so_and_not_tried_for_ever(page: ServedPage) -> None:
    tries = int(TRIES)
    statuses = [sign_in(page, f"wrong {number}")[0] for number in range(tries + 2)]
    assert statuses == [403] * tries + [429] * 2
    status, cookie = sign_in(page, "wrong again")
    assert (status, cookie) == (429, "")


def test_who_signs_in_rightly_is_not_counted(page: ServedPage) -> None:
    assert {sign_in(page, PASSWORD)[0] for _ in range(15)} == {303}


def test_a_form_that_is_too_large_is_refused(page: ServedPage) -> None:
    body = b"password=" + 5000 * b"x"
    assert page.get("/login", method="POST", body=body).status == 413


def test_the_form_shows_nothing_that_was_typed(page: ServedPage) -> None:
    form = b"password=%3Cscript%3E"
    answer = page.get("/login", method="POST", body=form)
    assert b"script" not in answer.content  # type: ignore[attr-defined]
    assert b"That is not the password." in answer.content  # type: ignore[attr-defined]
