"""The token is read from a file of its owner's alone, or from the keyring, and shown nowhere."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from app import UserError
from app.online.token import Token, read_token, require_server

SECRET = "lip_abcdefgh12345678"


def written(path: Path, mode: int = 0o600, text: str = SECRET + "\n") -> Path:
    path.write_text(text)
    path.chmod(mode)
    return path


def test_a_file_of_ones_own_is_read(tmp_path: Path) -> None:
    assert read_token(written(tmp_path / "token"), "https://lichess.org").reveal() == SECRET
    assert read_token(written(tmp_path / "read-only", 0o400), "https://lichess.org").reveal() == SECRET


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o660, 0o700])
def test_a_file_that_others_can_read_is_refused(tmp_path: Path, mode: int) -> None:
    with pytest.raises(UserError, match=rf"has mode {mode:04o}: only you may read it, so say 'chmod 600 .*'") as caught:
        read_token(written(tmp_path / "token", mode), "https://lichess.org")
    assert SECRET not in str(caught.value)


def test_what_is_no_file_and_no_token_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be read"):
        read_token(tmp_path / "missing", "https://lichess.org")
    (tmp_path / "link").symlink_to(written(tmp_path / "token"))
    with pytest.raises(UserError, match="cannot be read"):
        read_token(tmp_path / "link", "https://lichess.org")
    for text in ("", "short", "with space in it", "x" * 600):
        with pytest.raises(UserError, match="8 to 512 letters") as caught:
            read_token(written(tmp_path / "bad", text=text), "https://lichess.org")
        assert not text or text not in str(caught.value)


def test_the_keyring_is_asked_where_no_file_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "keyring", None)
    with pytest.raises(UserError, match="give --token-file FILE with mode 0600, or install the package keyring"):
        read_token(None, "https://lichess.org")
    kept = {("touchmove", "lichess.org"): SECRET}
    fake = SimpleNamespace(get_password=lambda *key: kept.get(key), errors=SimpleNamespace(KeyringError=OSError))
    monkeypatch.setitem(sys.modules, "keyring", fake)
    assert read_token(None, "https://lichess.org").reveal() == SECRET
    with pytest.raises(UserError, match=r"'keyring set touchmove chess\.example'"):
        read_token(None, "https://chess.example")


def test_a_token_shows_itself_nowhere() -> None:
    token = Token(SECRET)
    assert SECRET not in f"{token} {token!r}"
    with pytest.raises(TypeError):
        pickle.dumps(token)


@pytest.mark.parametrize(
    "server", ["lichess.org", "ftp://lichess.org", "http://lichess.org", "https://", "https://a:b@c", "http://h:99999"]
)
def test_a_server_is_refused_to_which_the_token_would_not_travel_safely(server: str) -> None:
    with pytest.raises(UserError, match="--server is "):
        require_server(server)


def test_a_server_of_ones_own_may_speak_in_the_clear_on_loopback() -> None:
    assert require_server("http://127.0.0.1:8080/") == "http://127.0.0.1:8080"
    assert require_server("https://lichess.org") == "https://lichess.org"
