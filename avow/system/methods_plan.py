"""The part of a plan that says how a node's guarantees are to be verified: `methods` of a node."""

from __future__ import annotations

import re

from avow.base.diagnostics import Diagnostic
from avow.system.plan import Method
from avow.system.strict_yaml import Piece

_METHOD_ID = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,60}\Z")


def read_methods(node: str, piece: Piece) -> tuple[tuple[Method, ...], tuple[Diagnostic, ...]]:
    """The methods of a node, each with an id of its own; what is wrong with them."""
    found: list[Method] = []
    faults: list[Diagnostic] = []
    used: set[str] = set()
    for item in piece.each("methods"):
        method = _method(node, item, used, faults)
        if method is not None:
            found.append(method)
    return tuple(found), tuple(faults)


def _method(node: str, item: Piece, used: set[str], faults: list[Diagnostic]) -> Method | None:
    if item.entries is None:
        backend, options = item.text, Piece(item.span, entries={})
    else:
        backend, options = next(iter(item.entries.items()))
        if options.value is None and options.entries is None and options.items is None and not options.text:
            options = Piece(options.span, entries={})
    if options.entries is None and (options.items is not None or not isinstance(options.value, str)):
        # A bare text (`review: reviews/x.yaml`) is for the backend's own schema to take or refuse.
        faults.append(
            Diagnostic("PLAN105", f"nodes.{node}: the options of {backend!r} must be a mapping", options.span)
        )
        return None
    if not _METHOD_ID.match(backend):
        faults.append(Diagnostic("PLAN105", f"nodes.{node}: {backend!r} cannot be a backend's name", item.span))
        return None
    given = options.at("id")
    name = given.text if given is not None else backend
    if given is not None and (not _METHOD_ID.match(name) or name in used):
        why = "is used twice" if name in used else "must be a word"
        faults.append(Diagnostic("PLAN110", f"nodes.{node}: the method's id {name!r} {why}", given.span))
    number = 2
    while name in used:
        name = f"{backend}-{number}"
        number += 1
    used.add(name)
    return Method(name, backend, options.located(), _taken_on(node, name, options.at("guarantees"), faults))


def _taken_on(node: str, method: str, piece: Piece | None, faults: list[Diagnostic]) -> tuple[str, ...]:
    """The clauses that a method names; none where the plan does not say, which stands for all of the node's."""
    if piece is None:
        return ()
    where = f"nodes.{node}: {method}: guarantees"
    names = piece.texts()
    if not names or not all(names) or piece.entries is not None:
        hint = "leave the key out for all of the node's guarantees, or the method for none"
        faults.append(
            Diagnostic("PLAN105", f"{where}: names of guarantees are wanted, one at least", piece.span, hint=hint)
        )
    for index, name in enumerate(names):
        if name in names[:index] and piece.items is not None:
            faults.append(Diagnostic("PLAN105", f"{where}: {name!r} stands there twice", piece.items[index].span))
    return names
