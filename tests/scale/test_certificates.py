"""Who reaches a cluster by TLS is told at once which certificate is not accepted, and why."""

from __future__ import annotations

import contextlib
import socket
import ssl
import threading
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.pipeline.cluster import Address

pytest.importorskip("cryptography")

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

YEAR = timedelta(days=365)


class Authority:
    """Issues certificates into a folder."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.key = folder, ec.generate_private_key(ec.SECP256R1())
        self.name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        own = self._signed(self.name, self.key, datetime.now(UTC) + YEAR, authority=True)
        self.file = folder / f"{name}.pem"
        self.file.write_bytes(own.public_bytes(serialization.Encoding.PEM))

    def _signed(
        self, subject: x509.Name, key: ec.EllipticCurvePrivateKey, until: datetime, authority: bool
    ) -> x509.Certificate:
        signing = x509.KeyUsage(not authority, False, False, False, False, authority, authority, False, False)
        return (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(self.name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(until - 2 * YEAR)
            .not_valid_after(until)
            .add_extension(x509.BasicConstraints(authority, None), critical=True)
            .add_extension(signing, critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(self.key.public_key()), critical=False)
            .sign(self.key, hashes.SHA256())
        )

    def issue(self, name: str, *, expired: bool = False) -> tuple[str, str]:
        """The files of a certificate and of its key."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        until = datetime.now(UTC) + (-timedelta(days=1) if expired else YEAR)
        made = self._signed(subject, key, until, authority=False)
        cert, secret = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        cert.write_bytes(made.public_bytes(serialization.Encoding.PEM))
        plain = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
        secret.write_bytes(key.private_bytes(serialization.Encoding.PEM, *plain))
        return str(cert), str(secret)


@contextlib.contextmanager
def listening(ca: Path, cert: str, key: str) -> Iterator[str]:
    """A server that greets whom it accepts, as a scheduler does."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=str(ca))
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_cert_chain(cert, key)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with contextlib.suppress(OSError):
                plain, _ = server.accept()
                with context.wrap_socket(plain, server_side=True) as secure:
                    secure.sendall(b"hello")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"dask+tls://127.0.0.1:{server.getsockname()[1]}"
        thread.join(60)


@pytest.mark.parametrize(
    ("client", "server", "why"),
    [
        ("good", "good", None),
        ("expired", "good", "this side's certificate is not accepted.*expired"),
        ("good", "expired", "the cluster's certificate is not accepted.*expired"),
        ("stranger", "good", "this side's certificate is not accepted"),
        ("good", "stranger", "the cluster's certificate is not accepted"),
        ("nonsense", "good", "certificate is not accepted"),
    ],
)
def test_each_fault_of_a_certificate_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, client: str, server: str, why: str | None
) -> None:
    ours, other = Authority(tmp_path, "ours"), Authority(tmp_path, "other")

    def issued(kind: str, name: str) -> tuple[str, str]:
        found = (other if kind == "stranger" else ours).issue(name, expired=kind == "expired")
        if kind == "nonsense":
            Path(found[0]).write_text("no certificate\n")
        return found

    cert, key = issued(client, "client")
    for name, value in (("CA", str(ours.file)), ("CERT", cert), ("KEY", key)):
        monkeypatch.setenv(f"AVOW_TLS_{name}", value)
    if client == "nonsense":
        with pytest.raises(Rejected, match=why):
            Address.read("dask+tls://127.0.0.1:9").security()
        return
    with listening(ours.file, *issued(server, "server")) as url:
        if why is None:
            Address.read(url).security()
        else:
            with pytest.raises(Rejected, match=f"CLUSTER005|{why}") as told:
                Address.read(url).security()
            assert told.value.diagnostics[0].code == "CLUSTER005"


def test_nobody_there_yet_is_no_matter_of_certificates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = Authority(tmp_path, "ours")
    cert, key = ours.issue("client")
    for name, value in (("CA", str(ours.file)), ("CERT", cert), ("KEY", key)):
        monkeypatch.setenv(f"AVOW_TLS_{name}", value)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))  # bound and not listening: refused at once
        Address.read(f"dask+tls://127.0.0.1:{closed.getsockname()[1]}").security()
