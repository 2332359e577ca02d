"""A contract's state variables in Dafny: a datatype `History`, its initial value, and how a step updates it.

The history is ghost: a step gets it, and may use it only in its proof. The program's state has a type of the
implementer's, `Memory`, and an invariant of the implementer's, `Linked`, relates it to the history: `Established` shows
that it holds initially, and Step that it is preserved.
"""

from __future__ import annotations

from avow.backend_kit.stepping import Stepping
from avow.base.plain import one_line
from avow.base.records import dataclass
from avow.formulas.formula import conjunction
from avow.formulas.temporal.cell import CELL
from avow.language.printer import show_term
from avow.language.terms import Variable

from .printer import Predicate, Vocabulary, print_clause

ESTABLISHED, FIRST = "Established", "First"


@dataclass(frozen=True, slots=True)
class History:
    """The history of a node, as in the generated modules. Without cells there is none."""

    cells: tuple[Variable, ...] = ()
    begins: tuple[Predicate, ...] = ()
    moves: tuple[tuple[Predicate, ...], ...] = ()
    """For each cell its value after a step: the last of its predicates, after those of its quantifiers."""
    ports: tuple[Variable, ...] = ()
    told: tuple[str, ...] = ()
    """Comments: the purpose of each cell."""

    def call(self, predicate: Predicate, words: Vocabulary, module: str) -> str:
        """A predicate of the contract, of the history `h`."""
        arguments = (f"h.{words.local(p)}" if p in self.cells else words.local(p) for p in predicate.parameters)
        return f"{module}{predicate.name}({', '.join(arguments)})"


def history(steps: Stepping, words: Vocabulary) -> History:
    """The history of a node. Raises NotExpressible."""
    cells = tuple(cell.before for cell in steps.cells)
    comments = tuple(
        f"  //   {words.local(c.before)}: {one_line(show_term(c.record, 'rcl'))}"
        for c in steps.cells
        if c.record is not None
    )
    begins = print_clause(_named("begins", words), conjunction(c.begins() for c in steps.cells), words)
    moves = [print_clause(_named(f"{words.local(c.before)}_next", words), c.now, words) for c in steps.cells]
    ports = tuple(p.variable for p in (*steps.own.inputs, *steps.own.outputs))
    return History(cells, begins, tuple(moves), ports, comments)


def _named(wanted: str, words: Vocabulary) -> str:
    """A name that no clause of the contract has, with the wanted identifier."""
    name = f"{wanted} {CELL}"
    words.names("clause", name, wanted)
    return name
