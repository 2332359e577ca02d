"""Notes that only save time: earlier results, bound to this user by a keyed digest.

The content of a note can always be computed again. A note that was edited, made up or copied from another machine is
ignored, and the result is computed from the files. The key is in the user's cache folder, not in the workspace. It
keeps a verdict from being edited; it is no signature, and nothing that other people rely on depends on it.
"""

from __future__ import annotations

import functools
import hashlib
import hmac
import json
import os
import pwd
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from avow.base.codec import from_json, parsed, to_json
from avow.base.files import PART, read_regular, write

T = TypeVar("T")

_MARK = "mark"
_KEY_BYTES = hashlib.sha256().digest_size


def write_note(path: Path, said: object) -> None:
    """`said`: a dataclass or a dictionary. Raises OSError."""
    body = to_json(said)
    write(path, json.dumps({**body, _MARK: _mark(path, body)}) + "\n")


def read_note(kind: type[T], path: Path) -> T | None:
    """The content, only if this user's Avow wrote it there."""
    try:
        data = parsed(read_regular(path))
        mark = data.pop(_MARK)
        return from_json(kind, data) if hmac.compare_digest(mark, _mark(path, data)) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def sealed(path: Path, data: bytes) -> bytes:
    """The data, sealed for that place."""
    return _seal(path, data) + data


def unsealed(path: Path) -> bytes | None:
    """The data, only if this user's Avow sealed it for that place."""
    try:
        kept = read_regular(path)
    except OSError:
        return None
    mark, data = kept[: hashlib.sha256().digest_size], kept[hashlib.sha256().digest_size :]
    return data if hmac.compare_digest(mark, _seal(path, data)) else None


def cache_folder() -> Path:
    """The folder of this user's caches: never the working folder, which may belong to another user. Without a home
    directory (an unknown user id in a container) nothing is cached."""
    named, home = Path(os.environ.get("XDG_CACHE_HOME", "")), Path(os.environ.get("HOME", ""))
    if named.is_absolute():
        return named / "avow"
    if not home.is_absolute():
        try:
            home = Path(pwd.getpwuid(os.getuid()).pw_dir)
        except KeyError:
            home = Path(os.devnull)
    return home / ".cache" / "avow"


def _seal(path: Path, data: bytes) -> bytes:
    text = str(path.absolute()).encode("utf-8", "surrogateescape")
    return hmac.new(_key(str(cache_folder())), b"%d %b %b" % (len(text), text, data), hashlib.sha256).digest()


def _mark(path: Path, body: Mapping[str, Any]) -> str:
    """Bound to one place among the artifacts: a note copied to another is ignored there."""
    parts = path.absolute().parts
    within = max((at for at, part in enumerate(parts) if part == "artifacts"), default=0)
    text = json.dumps([parts[within:], body], sort_keys=True)
    return hmac.new(_key(str(cache_folder())), text.encode("utf-8", "surrogatepass"), hashlib.sha256).hexdigest()


@functools.cache
def _key(folder: str) -> bytes:
    """Made when first needed; if it cannot be stored, it is for this process alone."""
    path = Path(folder) / "notes.key"
    kept = _kept_key(path)
    if kept is not None:
        return kept
    key = secrets.token_bytes(_KEY_BYTES)
    part = path.with_name(f".{path.name}.{os.getpid()}{PART}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(key.hex())
        try:
            if path.is_file() and path.stat().st_size != 2 * _KEY_BYTES:
                path.unlink()
            os.link(part, path)  # of two processes that make one at once, the first wins
        finally:
            part.unlink()
    except OSError:
        pass
    return _kept_key(path) or key


def _kept_key(path: Path) -> bytes | None:
    """None if there is none or it is too short: an empty file would be a known key."""
    try:
        key = bytes.fromhex(read_regular(path).decode())
    except (OSError, ValueError):
        return None
    return key if len(key) == _KEY_BYTES else None
