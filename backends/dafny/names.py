"""Names of the contract as Dafny identifiers: unchanged where Dafny allows it, never two for one.

Text from a contract is data: whatever a name looks like (a keyword, a primed or a Greek name), what comes out is an
identifier, and different names come out different.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import field

from avow.base.records import dataclass

RESERVED = frozenset(
    re.findall(
        r"\w+",
        """
    abstract allocated array arrow as assert assume bool bv break by calc case char class codatatype colemma const
    constructor continue copredicate datatype decreases default downto else ensures exists expect export extends
    fallible false feature for forall free fresh function ghost greatest hide hints if imap import in include
    inductive int invariant is iset iterator label labeled least lemma level map match method modifies modify module
    multiset nameonly new newtype nat null object old older opaque opened ORDINAL or predicate print protected
    provides reads real refines requires return returns reveal reveals seq set static string then this to trait true
    twostate type unchanged using var where while witness yield yields
    array0 array1 array2 array3 array4 Main Env EnvNotEmpty Step Types Contract Base Upto Divide DivideByZero Nth Beyond
    AbsInt AbsReal MinInt MinReal MaxInt MaxReal
        """,
    )
)
"""Keywords and built-in names of Dafny 2.3 to 4.x, and the names that the generated modules use themselves."""

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_']*")
_BIT_VECTOR = re.compile(r"bv\d+|array\d+")


@dataclass(slots=True)
class Names:
    """Hands out identifiers; the same (kind, name) always gets the same one within a table."""

    taken: set[str] = field(default_factory=set)
    given: dict[tuple[str, str], str] = field(default_factory=dict)

    def __call__(self, kind: str, name: str, wanted: str | None = None) -> str:
        """The identifier for a name; `wanted` is what it should look like, if not like the name itself."""
        key = (kind, name)
        if key not in self.given:
            self.given[key] = self.fresh(name if wanted is None else wanted)
        return self.given[key]

    def fresh(self, wanted: str) -> str:
        """An identifier that nothing else has."""
        base = identifier(wanted)
        candidate, number = base, 2
        while candidate in self.taken or candidate in RESERVED or _BIT_VECTOR.fullmatch(candidate):
            candidate = f"{base}_{number}"
            number += 1
        self.taken.add(candidate)
        return candidate

    def inner(self, more: Iterable[str] = ()) -> Names:
        """A table for an inner scope: shadows nothing."""
        return Names(self.taken | set(more))


def identifier(text: str) -> str:
    """`text`, if it may be an identifier, else something that looks like it."""
    if _PLAIN.fullmatch(text):
        return text
    safe = "".join(c if c.isascii() and (c.isalnum() or c in "_'") else f"u{ord(c):04x}" for c in text)
    return safe if _PLAIN.fullmatch(safe) else f"n{safe}"


def file_stem(name: str) -> str:
    """The same for the name of a file."""
    return identifier(name).replace("'", "_prime")
