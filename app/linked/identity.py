"""A robot's certificate, made at first use, and the certificates of the robots that it knows.

The standard library speaks TLS and makes no certificates: that takes the package ``cryptography`` (extra ``link``). The
command ``openssl`` could do it, too, but is not on every computer, and would write the key to a file before we could
say who may read it.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import os
import ssl
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.linked.errors import LinkError, LinkRefused
from app.records.files import write_atomically

KEY_FILE: Final = "key.pem"
CERTIFICATE_FILE: Final = "certificate.pem"
KNOWN_FILE: Final = "known_hosts.json"
_MISSING: Final = (
    "two robots need certificates, and the package cryptography, which makes them, is missing: install the extra with "
    "pip install 'touchmove[link]'"
)
_VALID: Final = datetime.timedelta(days=36525)
"""Robots know each other by the certificate itself, not by its dates."""


def fingerprint_of(certificate: bytes) -> str:
    """SHA-256 of a certificate in DER, in lower-case hex."""
    return hashlib.sha256(certificate).hexdigest()


def shown_fingerprint(fingerprint: str) -> str:
    """The same for people, who compare it by eye."""
    return ":".join(fingerprint[k : k + 4] for k in range(0, len(fingerprint), 4)).upper()


@dataclass(frozen=True, slots=True)
class RobotIdentity:
    """A robot's key and certificate in a folder that only its owner reads.

    Attributes:
        folder: of the files.
        certificate: in DER.
    """

    folder: Path
    certificate: bytes

    @classmethod
    def of(cls, folder: Path) -> RobotIdentity:
        """The identity in a folder; made if there is none.

        Raises:
            LinkError: the package that makes it is missing, others may read the key, or a file cannot be used.
        """
        key, certificate = folder / KEY_FILE, folder / CERTIFICATE_FILE
        try:
            if not (key.exists() and certificate.exists()):
                _make(folder)
            if stat.S_IMODE(key.stat().st_mode) & 0o077:
                raise LinkError(f"others can read this robot's key {key}: run 'chmod 600 {key}'")
            return cls(folder, ssl.PEM_cert_to_DER_cert(certificate.read_text(encoding="ascii")))
        except OSError as error:
            raise LinkError(
                f"this robot's certificate in {folder} cannot be used ({error.strerror}): name another folder with "
                "--identity"
            ) from error
        except ValueError as error:
            raise LinkError(
                f"{certificate} holds no certificate: delete {folder}, and a new one is made; the other robot has to "
                "forget the old one"
            ) from error

    @property
    def fingerprint(self) -> str:
        """See ``fingerprint_of``."""
        return fingerprint_of(self.certificate)

    def sign(self, data: bytes) -> bytes:
        """By this robot's key."""
        try:
            from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
            from cryptography.hazmat.primitives.serialization import load_pem_private_key
        except ImportError as error:
            raise LinkError(_MISSING) from error
        key = load_pem_private_key((self.folder / KEY_FILE).read_bytes(), None)
        assert isinstance(key, Ed25519PrivateKey)
        return key.sign(data)

    def tls(self, *, host: bool) -> ssl.SSLContext:
        """The settings of TLS 1.3. Who the other end is, its certificate's fingerprint and the secret say.

        Raises:
            LinkError: the files cannot be used.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER if host else ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        if host:
            context.num_tickets = 0  # each connection proves anew who both are
            try:
                context.load_cert_chain(self.folder / CERTIFICATE_FILE, self.folder / KEY_FILE)
            except (OSError, ssl.SSLError) as error:
                raise LinkError(
                    f"key and certificate in {self.folder} do not belong together: delete both, and new ones are made"
                ) from error
        return context


def require_signature(certificate: bytes, data: bytes, signature: bytes) -> None:
    """Make sure that the owner of a certificate (DER) has signed.

    Raises:
        LinkRefused: they have not, or it is no certificate of a robot.
    """
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.x509 import load_der_x509_certificate

    wrong = "the other robot does not have the key of the certificate that it shows"
    try:
        key = load_der_x509_certificate(certificate).public_key()
        if not isinstance(key, Ed25519PublicKey):
            raise LinkRefused(wrong)
        key.verify(signature, data)
    except (InvalidSignature, ValueError) as error:
        raise LinkRefused(wrong) from error


@dataclass(frozen=True, slots=True)
class KnownRobots:
    """The certificates of robots that were met, by address or role: trusted at first use, then only those."""

    path: Path

    def fingerprint(self, address: str) -> str | None:
        """Of a robot; None: it was never met.

        Raises:
            LinkError: the file cannot be read.
        """
        return self._all().get(address)

    def remember(self, address: str, fingerprint: str) -> None:
        """From now on this robot is the one with this certificate.

        Raises:
            LinkError: the file cannot be read or written.
        """
        known = {**self._all(), address: fingerprint}
        write_atomically(self.path, json.dumps(known, indent=2) + "\n")

    def _all(self) -> dict[str, str]:
        try:
            found = json.loads(self.path.read_bytes())
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            raise LinkError(f"{self.path} cannot be read: delete it to trust each host anew") from error
        if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
            raise LinkError(f"{self.path} is no list of known hosts: delete it to trust each host anew")
        return found


def default_folder() -> Path:
    """Where a robot's identity lies if nobody says otherwise: in the user's configuration."""
    base = os.environ.get("XDG_CONFIG_HOME")
    return (Path(base) if base else Path.home() / ".config") / "touchmove"


def _make(folder: Path) -> None:
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
        from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
        from cryptography.x509.oid import NameOID
    except ImportError as error:
        raise LinkError(_MISSING) from error
    key = Ed25519PrivateKey.generate()
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "touchmove")])
    now = datetime.datetime.now(datetime.UTC)
    certificate = (
        x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
        .serial_number(x509.random_serial_number()).not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + _VALID).sign(key, None)
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    part = folder / f"{KEY_FILE}.{os.getpid()}.part"
    try:
        part.unlink(missing_ok=True)
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
        part.replace(folder / KEY_FILE)
    finally:
        part.unlink(missing_ok=True)
    write_atomically(folder / CERTIFICATE_FILE, certificate.public_bytes(Encoding.PEM))
