"""Lines count once, in order, unchanged, and only between those who know the secret."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from app.linked.errors import LinkBroken, LinkError
from app.linked.messages import (
    AliveMessage,
    EntriesMessage,
    MoveEntry,
    message_of,
    opening_of,
)
from app.linked.sealing import Handshake
from app.linked.secret import LinkSecret, make_secret
from app.settings.defaults import LinkRole
from tests.app.linked.pair import GUEST, HOST, SECRET, pair, refused

MANY = 3000
"""Forged lines; a hundred thousand were tried once, see docs/results.md."""


def shake(secret: LinkSecret = SECRET, guest: str = "g", host: str = "h", nonce: bytes = b"1") -> Handshake:
    return Handshake.of(secret, b"guest says " + nonce, b"host says", guest, host)


def forge(lines: list[bytes], number: int, draw: random.Random) -> bytes:
    """A line that the other robot has not sent as its next one."""
    line = bytearray(draw.choice(lines))
    match draw.choice(("replay", "flip", "cut", "swap", "number", "noise")):
        case "replay":
            return lines[draw.choice([k for k in range(len(lines)) if k != number])]
        case "flip":
            line[draw.randrange(len(line) - 1)] ^= 1 << draw.randrange(8)
        case "cut":
            del line[draw.randrange(len(line)) :]
        case "swap":
            line[:64] = draw.choice([one for one in lines if one[:64] != line[:64]])[:64]
        case "number":
            line[65:66] = b"%d" % draw.randrange(10, 1000)
        case _:
            line = bytearray(draw.randbytes(draw.randrange(200)))
    return bytes(line)


def test_whatever_is_forged_or_repeated_is_refused_and_has_no_effect(tmp_path: Path) -> None:
    draw = random.Random(5)
    host, _, _ = pair(tmp_path)
    sealer, opener = shake().sealer(GUEST), shake().opener(GUEST)
    bodies = [
        EntriesMessage(at=1 + k, entries=(MoveEntry(ply=k, uci="e7e5"),), head="0" * 64).model_dump_json().encode()
        for k in range(20)
    ]
    lines = [sealer.seal(body) for body in bodies]
    number, before = 7, list(host.log.digests)
    for line, body in zip(lines[:number], bodies, strict=False):
        assert opener.open(line) == body
    for _ in range(MANY):
        forged = forge(lines, number, draw)
        if forged != lines[number]:
            assert refused(lambda forged=forged: host.peer.received(message_of(opener.open(forged))))
    assert host.log.digests == before
    assert opener.open(lines[number]) == bodies[number], "the next line still counts"


def test_lines_of_another_connection_direction_or_secret_are_refused() -> None:
    line = shake().sealer(GUEST).seal(b"{}")
    assert shake().opener(GUEST).open(line) == b"{}"
    others = (
        shake(nonce=b"2").opener(GUEST), shake().opener(HOST), shake(LinkSecret(b"x" * 32)).opener(GUEST),
        shake(host="man in the middle").opener(GUEST),
    )  # fmt: skip
    assert all(refused(lambda opener=opener: opener.open(line)) for opener in others)


def test_a_proof_is_of_one_role_one_connection_one_secret_and_both_certificates() -> None:
    proof = shake().proof(GUEST)
    assert shake().proves(GUEST, proof)
    assert not shake().proves(HOST, proof), "nobody can send a proof back"
    for other in (
        shake(nonce=b"2"),
        shake(LinkSecret(b"x" * 32)),
        shake(host="man in the middle"),
        shake(guest="x"),
    ):
        assert not other.proves(GUEST, proof)


@pytest.mark.parametrize(
    "line",
    [
        b"", b"{}", b"[]", b"null", b"\xff", b'{"message":"say"}', b'{"message":"alive","more":1}',
        b'{"message":"have","length":-1}', b'{"message":"have","length":"1"}', b'{"message":"have","length":1e400}',
        b'{"message":"mending","busy":1}', b'{"message":"entries","at":0,"entries":[],"head":"x"}',
        b'{"message":"sync","name":"a\\u001b[2Jb","length":0,"head":"' + b"0" * 64 + b'"}',
        b'{"message":"hello","version":1,"nonce":"' + b"0" * 64 + b'"}', b"[" * 5000,
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_in_a_sentence(line: bytes) -> None:
    with pytest.raises(LinkBroken, match=r"^a message of the other robot makes no sense \(.+\): the link is cut$"):
        message_of(line)


def test_before_both_are_known_only_openings_are_read() -> None:
    with pytest.raises(LinkBroken, match="makes no sense"):
        opening_of(AliveMessage().model_dump_json().encode())


def test_a_secret_is_for_its_owner_alone_and_is_never_shown(tmp_path: Path) -> None:
    path = tmp_path / "secret"
    make_secret(path)
    secret = LinkSecret.load(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert LinkSecret.of(f" {path.read_text()}") == secret, "typed, it is the same"
    assert path.read_text().strip() not in repr(secret)
    assert secret.key.hex() not in repr(secret)
    with pytest.raises(LinkError, match=r"secret cannot be written \(File exists\): name another file$"):
        make_secret(path)
    path.chmod(0o640)
    with pytest.raises(LinkError, match=r"^others can read the secret in .*: run 'chmod 600 .*'$"):
        LinkSecret.load(path)
    with pytest.raises(LinkError, match=r"^the secret has 5 characters: choose one with 12 to 200$"):
        LinkSecret.of("short")
    with pytest.raises(LinkError, match=r"^the secret .*none cannot be read \(No such file or directory\): copy"):
        LinkSecret.load(tmp_path / "none")
    assert LinkRole.HOST.other is LinkRole.GUEST
