"""Optional signatures (ed25519, offline, extra ``avow[signing]``) of a ledger up to its newest record.

The signature is over the head's hash and the number of records; through the hash chain it covers every record. It is
kept beside the ledger as ``<ledger>.sig``, and stays valid for the records that it covers when others follow. The index
of ledgers is signed in the same way, so that the loss of a whole ledger, with its signature, is noticed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from avow.base.codec import canonical, from_text, to_json
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_regular, write
from avow.base.records import dataclass

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

_CONTEXT = "avow ledger head 1"


def signature_path(signed: Path) -> Path:
    """The path of the signature of a ledger or of a review's record."""
    return signed.with_name(signed.name + ".sig")


def new_key_pair(private: Path) -> Path:
    """Write a new private key (readable by its owner only) and, beside it, the public one. Raises Rejected."""
    _needs_cryptography()
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    key = Ed25519PrivateKey.generate()
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    try:
        handle = os.open(private, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise Rejected(Diagnostic("SIGN001", f"{private} cannot be made: {error.strerror}")) from None
    with os.fdopen(handle, "wb") as file:
        file.write(secret)
    public = private.with_name(private.name + ".pub")
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    write(public, key.public_key().public_bytes(serialization.Encoding.PEM, form))
    return public


@dataclass(frozen=True, slots=True)
class Signed:
    """A chain that is signed: its name, and the hashes of its lines, oldest first."""

    name: str
    marks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Signature:
    """The content of ``<ledger>.sig``: the hash of the newest line covered, and the number of lines covered; key and
    signature in hexadecimal."""

    hash: str
    public_key: str
    records: int
    signature: str


def sign(path: Path, chain: Signed, private: Path) -> Path:
    """Sign the newest line, and with it all before; the signature is written to `path`. Raises Rejected if there is
    nothing to sign, or no such key."""
    key = private_key(private)
    if not chain.marks:
        raise Rejected(Diagnostic("SIGN002", f"{chain.name} has no records: it is not signed"))
    head, count = chain.marks[-1], len(chain.marks)
    signature = key.sign(_message(chain.name, head, count))
    public = key.public_key().public_bytes_raw().hex()
    write(path, canonical(to_json(Signature(head, public, count, signature.hex()))) + "\n")
    return path


def verify_signature(path: Path, chain: Signed, public: Path | None) -> tuple[str | None, int]:
    """What is wrong with a signature (None if nothing is), and how many of the chain's lines it covers.

    Without `public`, the signature's own key is used: it then only shows that nothing was changed since that key was
    used. Raises Rejected.
    """
    _needs_cryptography()
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        stated = from_text(Signature, read_regular(path))
        signature, own = bytes.fromhex(stated.signature), bytes.fromhex(stated.public_key)
        key = public_key(public) if public is not None else Ed25519PublicKey.from_public_bytes(own)
    except (OSError, ValueError) as error:
        return f"{path.name} cannot be read as a signature: {error}", 0
    head, count = stated.hash, stated.records
    try:
        key.verify(signature, _message(chain.name, head, count))
    except InvalidSignature:
        return f"{path.name} is not a signature of this ledger by that key", 0
    if not 0 < count <= len(chain.marks) or chain.marks[count - 1] != head:
        return f"the {count} records that {path.name} covers are not those in the ledger", 0
    return None, count


def _message(system: str, head: str, count: int) -> bytes:
    return f"{_CONTEXT}\n{system}\n{count}\n{head}\n".encode()


def private_key(path: Path) -> Ed25519PrivateKey:
    """Raises Rejected if the file holds no ed25519 private key."""
    _needs_cryptography()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        key = load_pem_private_key(path.read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:
        raise Rejected(Diagnostic("SIGN003", f"{path} cannot be read as a private key: {error}")) from None
    if not isinstance(key, Ed25519PrivateKey):
        raise Rejected(Diagnostic("SIGN003", f"{path} is no ed25519 key"))
    return key


def public_key(path: Path) -> Ed25519PublicKey:
    """Raises Rejected if the file holds no ed25519 public key."""
    _needs_cryptography()
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    try:
        key = load_pem_public_key(path.read_bytes())
    except (OSError, ValueError) as error:
        raise Rejected(Diagnostic("SIGN003", f"{path} cannot be read as a public key: {error}")) from None
    if not isinstance(key, Ed25519PublicKey):
        raise Rejected(Diagnostic("SIGN003", f"{path} is no ed25519 key"))
    return key


def _needs_cryptography() -> None:
    try:
        import cryptography  # noqa: F401
    except ImportError as error:
        hint = "pip install 'avow[signing]'"
        raise Rejected(Diagnostic("SIGN004", "signatures need the cryptography package", hint=hint)) from error
