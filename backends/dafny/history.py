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

from .printer import Predicate, Vocabulary, call, print_clause, signature, sort_text

ESTABLISHED, FIRST = "Established", "First"


@dataclass(frozen=True, slots=True)
class History:
    """The history of a node, as in the generated modules. Without cells there is none, and no lines for it."""

    cells: tuple[Variable, ...] = ()
    begins: tuple[Predicate, ...] = ()
    moves: tuple[tuple[Predicate, ...], ...] = ()
    """For each cell its value after a step: the last of its predicates, after those of its quantifiers."""
    ports: tuple[Variable, ...] = ()
    told: tuple[str, ...] = ()
    """Comments: the purpose of each cell."""

    def call(self, predicate: Predicate, words: Vocabulary) -> str:
        """A predicate of the contract, of the history `h`."""
        return self._of(predicate, words, "Contract.")

    def given(self, signature: str, *, program: bool = True) -> str:
        """The parameters of a declaration that gets the history, and the program's state."""
        before = ["ghost h: Contract.History", "m: Memory"] if program else ["h: Contract.History"]
        return ", ".join((*(before if self.cells else ()), *((signature,) if signature else ())))

    def left(self, signature: str, memory: str = "Memory") -> str:
        """The results of a step."""
        return ", ".join((*((f"n: {memory}",) if self.cells else ()), *((signature,) if signature else ())))

    def advanced(self, words: Vocabulary) -> str:
        return f"Contract.Advance({', '.join(('h', *map(words.local, self.ports)))})"

    def contract(self, words: Vocabulary) -> list[str]:
        """Its lines in the module of the contract."""
        if not self.cells:
            return []
        fields = ", ".join(f"{words.local(c)}: {sort_text(c.sort, words)}" for c in self.cells)
        lines = [
            "",
            "  // What the contract remembers of the steps before.",
            *self.told,
            f"  datatype History = History({fields})",
        ]
        for predicates in (self.begins, *self.moves):
            for predicate in predicates[:-1]:
                lines += declared(predicate, "bool", words)
        ports = ", ".join(f"{words.local(p)}: {sort_text(p.sort, words)}" for p in self.ports)
        moved = ", ".join(self._of(made[-1], words, "") for made in self.moves)
        lines += declared(self.begins[-1], "bool", words)
        for cell, made in zip(self.cells, self.moves, strict=True):
            lines += declared(made[-1], sort_text(cell.sort, words), words)
        return [
            *lines,
            f"  predicate Begins(h: History) {{ {self._of(self.begins[-1], words, '')} }}",
            f"  function Advance(h: History{f', {ports}' if ports else ''}): History {{ History({moved}) }}",
        ]

    def specification(self) -> list[str]:
        """Its lines in the abstract module."""
        if not self.cells:
            return []
        return [
            "  // The implementer's: what the program keeps from step to step, its value before the first one, and",
            "  // the invariant that links it to what the contract remembers, shown to hold before the first step.",
            "  type Memory",
            "  function method Begin(): Memory",
            "  predicate Linked(h: Contract.History, m: Memory)",
            f"  lemma {ESTABLISHED}(h: Contract.History)",
            "    requires Contract.Begins(h)",
            "    ensures Linked(h, Begin())",
            "",
        ]

    def probe(self) -> list[str]:
        """Its lines in the module that uses the implementation from outside."""
        if not self.cells:
            return []
        return [
            "",
            f"  lemma {FIRST}(h: Contract.History)",
            "    requires Contract.Begins(h)",
            "    ensures Implementation.Linked(h, Implementation.Begin())",
            f"  {{ Implementation.{ESTABLISHED}(h); }}",
        ]

    def skeleton(self) -> list[str]:
        if not self.cells:
            return []
        return [
            "  datatype Memory = Memory  // what is kept, for example Memory(count: nat)",
            "  function method Begin(): Memory { Memory }",
            "  predicate Linked(h: Contract.History, m: Memory) { true }",
            f"  lemma {ESTABLISHED}(h: Contract.History) {{ }}",
            "",
        ]

    def _of(self, predicate: Predicate, words: Vocabulary, module: str) -> str:
        arguments = (f"h.{words.local(p)}" if p in self.cells else words.local(p) for p in predicate.parameters)
        return f"{module}{predicate.name}({', '.join(arguments)})" if self.cells else call(predicate, words, module)


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


def declared(predicate: Predicate, sort: str, words: Vocabulary) -> list[str]:
    """The lines of a predicate, or of a function to a sort."""
    kind, result = ("predicate", "") if sort == "bool" else ("function", f": {sort}")
    return [f"  {kind} {predicate.name}({signature(predicate.parameters, words)}){result}", f"  {{ {predicate.body} }}"]
