"""How two robots get to know each other at the beginning of a connection, before anything they say is believed."""

from __future__ import annotations

import asyncio
import secrets
from dataclasses import dataclass
from typing import Final

from app.linked.errors import LinkBroken, LinkRefused
from app.linked.identity import RobotIdentity, fingerprint_of, require_signature
from app.linked.messages import (
    LONGEST_HELLO,
    VERSION,
    HelloMessage,
    Opening,
    ProofMessage,
    RefusalMessage,
    opening_of,
)
from app.linked.sealing import Handshake
from app.linked.secret import LinkSecret
from app.settings.defaults import LinkRole

WHY: Final = {
    "secret": "the two robots do not have the same secret, or somebody stands between them: give both one --secret",
    "certificate": "the host plays this game with another robot: join with the one that began it, or begin a new game",
    "version": "the two robots have different versions of Touchmove: install the same on both",
    "game": "the host plays another game: name the folder of the same game on both",
}
"""What the host's refusals mean, for the guest's people."""


@dataclass(frozen=True, slots=True)
class Introduced:
    """Both ends know who the other is: the connection's keys, and the fingerprint of the other's certificate."""

    handshake: Handshake
    fingerprint: str


async def introduce_guest(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, identity: RobotIdentity, secret: LinkSecret
) -> Introduced:
    """The guest's part, on a connection whose host's certificate is known to be the right one, or is met first.

    Raises:
        LinkRefused: the host refuses, or does not prove itself.
        LinkBroken: what came means nothing.
        OSError: the connection is cut.
    """
    certificate = writer.get_extra_info("ssl_object").getpeercert(True)
    hello = HelloMessage(version=VERSION, nonce=secrets.token_hex(32), certificate=identity.certificate.hex())
    mine = await _send(writer, hello)
    theirs, answer = await _hear(reader)
    if not isinstance(answer, HelloMessage):
        raise LinkBroken("the host does not say hello: the link is cut")
    if answer.version != VERSION:
        raise LinkRefused(WHY["version"])
    host = fingerprint_of(certificate)
    handshake = Handshake.of(secret, mine, theirs, identity.fingerprint, host)
    signature = identity.sign(handshake.signed()).hex()
    await _send(writer, ProofMessage(proof=handshake.proof(LinkRole.GUEST), signature=signature))
    _, answer = await _hear(reader)
    if not isinstance(answer, ProofMessage):
        raise LinkBroken("the host does not prove that it knows the secret: the link is cut")
    if not handshake.proves(LinkRole.HOST, answer.proof):
        raise LinkRefused(WHY["secret"])
    return Introduced(handshake, host)


async def introduce_host(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, identity: RobotIdentity, secret: LinkSecret,
    guest: str | None,
) -> Introduced:  # fmt: skip
    """The host's part. ``guest`` is the fingerprint of the only guest that may come; None: any that knows the secret.

    Raises:
        LinkRefused: the guest does not prove itself, or is another one; it has been told.
        LinkBroken: what came means nothing.
        OSError: the connection is cut.
    """
    theirs, hello = await _hear(reader)
    if not isinstance(hello, HelloMessage):
        raise LinkBroken("a guest does not say hello: the link is cut")
    mine = await _send(writer, HelloMessage(version=VERSION, nonce=secrets.token_hex(32)))
    if hello.version != VERSION:
        raise LinkRefused("a robot with another version of Touchmove wants to join: install the same on both")
    certificate = _bytes(hello.certificate)
    fingerprint = fingerprint_of(certificate)
    handshake = Handshake.of(secret, theirs, mine, fingerprint, identity.fingerprint)
    _, proof = await _hear(reader)
    if not isinstance(proof, ProofMessage):
        raise LinkBroken("a guest does not prove that it knows the secret: the link is cut")
    if not handshake.proves(LinkRole.GUEST, proof.proof):
        await refuse(writer, "secret")
        raise LinkRefused("somebody with another secret wants to join and was refused")
    try:
        require_signature(certificate, handshake.signed(), _bytes(proof.signature))
        if guest not in (None, fingerprint):
            raise LinkRefused("another robot wants to join this game and was refused: only the one that began it may")
    except LinkRefused:
        await refuse(writer, "certificate")
        raise
    await _send(writer, ProofMessage(proof=handshake.proof(LinkRole.HOST)))
    return Introduced(handshake, fingerprint)


async def refuse(writer: asyncio.StreamWriter, why: str) -> None:
    """Tell a guest why it is refused."""
    await _send(writer, RefusalMessage.model_validate({"why": why}))


async def line_of(reader: asyncio.StreamReader, longest: int) -> bytes:
    """The next line, with its end.

    Raises:
        LinkBroken: it is too long.
        OSError: the connection is cut.
    """
    try:
        line = await reader.readuntil(b"\n")
    except asyncio.IncompleteReadError as error:
        raise ConnectionResetError("the connection was closed") from error
    except asyncio.LimitOverrunError as error:
        raise LinkBroken(f"a line is longer than {longest} bytes: the link is cut") from error
    if len(line) > longest:
        raise LinkBroken(f"a line is longer than {longest} bytes: the link is cut")
    return line


async def _send(writer: asyncio.StreamWriter, message: HelloMessage | ProofMessage | RefusalMessage) -> bytes:
    line = message.model_dump_json().encode() + b"\n"
    writer.write(line)
    await writer.drain()
    return line


async def _hear(reader: asyncio.StreamReader) -> tuple[bytes, Opening]:
    line = await line_of(reader, LONGEST_HELLO)
    message = opening_of(line)
    if isinstance(message, RefusalMessage):
        raise LinkRefused(WHY[message.why])
    return line, message


def _bytes(text: str) -> bytes:
    return bytes.fromhex(text if len(text) % 2 == 0 else "")
