"""Keys of plan.yaml that were renamed. An old name is read for one release, with a warning that names the new one."""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.system.strict_yaml import Piece

_RENAMED = {"suppositions": "assumptions"}
VALIDATION_BEFORE = {
    "confirmed": {"who": "who", "on": "date", "sentence": "sentence"},
    "amounts": {key: key for key in ("says", "because", "who", "date", "until")},
}
"""For each old entry that `validation` replaces, the new name of each of its keys."""


def rename_old_keys(root: Piece) -> tuple[Diagnostic, ...]:
    """Give the keys of a plan's document their new names, in place. Returns a warning for each old name."""
    return (*_renamed(root), *(d for _, _, piece in root.keyed("requirements") for d in _joined(piece)))


def _renamed(root: Piece) -> Iterator[Diagnostic]:
    for old, new in _RENAMED.items():
        if root.entries and old in root.entries and new not in root.entries:
            root.entries[new] = root.entries.pop(old)
            root.keys[new] = root.keys.pop(old, root.span)
            yield _warned(old, new, root.keys[new])


def _joined(requirement: Piece) -> Iterator[Diagnostic]:
    """The content of `confirmed` and `amounts`, as one `validation`."""
    entries = requirement.entries
    if not entries or "validation" in entries or not VALIDATION_BEFORE.keys() & entries.keys():
        return
    validation: Piece | None = None
    for old, keys in VALIDATION_BEFORE.items():
        piece = entries.get(old)
        if piece is None or not set(piece.entries or ()) <= keys.keys():
            continue  # its shape is wrong: reported under the old name
        del entries[old]
        span = requirement.keys.pop(old, piece.span)
        validation = validation or Piece(piece.span, entries={})
        for key, inner in (piece.entries or {}).items():
            assert validation.entries is not None
            validation.entries.setdefault(keys[key], inner)
            validation.keys.setdefault(keys[key], piece.key_span(key))
        yield _warned(old, "validation", span)
    if validation is not None:
        entries["validation"] = validation
        requirement.keys["validation"] = validation.span


def _warned(old: str, new: str, span: Span) -> Diagnostic:
    message = f"`{old}` is called `{new}` now; the old name is read for one more release"
    hint = "`avow validate` writes it" if new == "validation" else f"write  {new}:"
    return Diagnostic("PLAN139", message, span, Severity.WARNING, hint=hint)
