"""A statement in a DSSE envelope (https://github.com/secure-systems-lab/dsse), signed with ed25519 or by name only.

Without a key, an envelope shows the name that was written in it, and nothing more; with a key, it shows that the key's
holder signed the text.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from avow.base.codec import Foreign, from_text, parsed, to_json
from avow.base.records import dataclass
from avow.evidence.signing import private_key, public_key

PAYLOAD = "application/vnd.in-toto+json"


@dataclass(frozen=True, slots=True)
class Opened:
    """A statement that verifies, and a description of how it was verified."""

    statement: dict[str, Any]
    checked: str
    key: str = ""
    """The public key that signed it, in hexadecimal; empty if none did."""


@dataclass(frozen=True, slots=True)
class _Signature(Foreign):
    keyid: str
    sig: bytes


@dataclass(frozen=True, slots=True)
class _Envelope(Foreign):
    """The envelope in DSSE's format."""

    payload: bytes
    payloadType: str  # noqa: N815 - its own name
    signatures: tuple[_Signature, ...]


def seal(statement: dict[str, Any], private: Path | None, *, indent: int | None = 1) -> str:
    """The envelope as JSON; on one line with `indent` None. Raises Rejected for a key that cannot be used."""
    payload = json.dumps(statement, ensure_ascii=True, sort_keys=True).encode()
    signatures: list[_Signature] = []
    if private is not None:
        key = private_key(private)
        public = key.public_key().public_bytes_raw()
        signature = key.sign(_authenticated(payload))
        signatures.append(_Signature(public.hex(), signature))
    body = _Envelope(payload, PAYLOAD, tuple(signatures))
    return json.dumps(to_json(body), indent=indent, sort_keys=True) + "\n"


def seal_lines(statements: str, private: Path) -> str:
    """JSON lines as envelopes, one a line. Raises Rejected for a key that cannot be used."""
    return "".join(seal(json.loads(line), private, indent=None) for line in statements.splitlines())


def unseal_lines(text: str, trusted: Sequence[Path] = ()) -> str:
    """The statements in envelopes, one a line, as `seal_lines` received them; for a line that is no envelope, or whose
    signature is not valid, a line that says what is wrong with it. Raises Rejected for a trusted key that cannot be
    read."""
    found = (unseal(line, trusted) for line in text.splitlines())
    return "".join(
        f"{one if isinstance(one, str) else json.dumps(one.statement, ensure_ascii=True, sort_keys=True)}\n"
        for one in found
    )


def unseal(text: str, trusted: Sequence[Path] = ()) -> Opened | str:
    """The statement, or why it does not verify. With `trusted` public keys one of them must have signed it; otherwise
    an envelope without a signature is accepted, and a signature must be valid. Raises Rejected for a trusted key that
    cannot be read."""
    try:
        body = from_text(_Envelope, text)
        payload, signatures = body.payload, [(bytes.fromhex(s.keyid), s.sig) for s in body.signatures]
        statement = parsed(payload)
    except ValueError as error:
        return f"it is no envelope: {error}"
    if body.payloadType != PAYLOAD or not isinstance(statement, dict):
        return "it is no in-toto statement"
    if not signatures:
        return "no trusted key has signed it" if trusted else Opened(statement, "by name, without a key")
    try:
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    except ImportError:
        return "its signature cannot be checked here: pip install 'avow[signing]'"
    known = {public_key(path).public_bytes_raw() for path in trusted}
    for raw, signature in signatures:
        if known and raw not in known:
            continue
        try:
            Ed25519PublicKey.from_public_bytes(raw).verify(signature, _authenticated(payload))
        except (InvalidSignature, ValueError):
            return "its signature is not of this text"
        key_name = "a trusted key" if known else "a key that nobody here has named as trusted:"
        return Opened(statement, f"with {key_name} {raw.hex()[:16]}…", raw.hex())
    return "no trusted key has signed it"


def _authenticated(payload: bytes) -> bytes:
    """DSSE's pre-authentication encoding."""
    return b"DSSEv1 %d %s %d %s" % (len(PAYLOAD), PAYLOAD.encode(), len(payload), payload)
