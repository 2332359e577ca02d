"""What may hold whenever a loop's next turn is decided on: candidates, of which the largest inductive part stays.

They come from comments (``# invariant: best <= Far``), from the guarantees (the output's name becomes a local, the
length of a sequence for how much of it is done), and from a few shapes that loops often have. A candidate costs a
question or two; one that is wrong is dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from avow.base.diagnostics import Rejected
from avow.formulas.formula import free_variables, substitute
from avow.formulas.sequences import flatten
from avow.language import terms as t
from avow.language.contract import Contract, Node
from avow.language.load import parse_formula
from avow.language.printer import show_term
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, FunctionSort, Sort

from .program import Assign, For, Item, Name, View, parts
from .symbolic import ZERO, Candidate, Turn, plus, widest
from .tuning import CANDIDATES

_NUMBERS = (INTEGER, REAL)


class Sequences:
    """The node's sequence inputs: the terms for their lengths and elements."""

    def __init__(self, node: Node, names: Iterable[str]) -> None:
        self.variables = tuple(node.input(name).variable for name in names)
        whole = flatten({"": t.TRUE}, self.variables)
        self.parts = dict(whole.parts) if whole is not None else {}

    def flat(self, formula: t.Term) -> t.Term | None:
        """The formula without the sequences themselves; None where one is used as a whole."""
        if not self.variables:
            return formula
        made = flatten({"": formula}, self.variables)
        return made.formulas[""] if made is not None else None

    def of(self, name: str) -> tuple[t.Variable, t.Variable]:
        """Length and elements."""
        return next(pair for v, pair in self.parts.items() if v.name == name)


def candidates(
    loops: Sequence[tuple[For, Turn]], node: Node, contract: Contract, guarantees: Iterable[t.Term], known: Sequences
) -> tuple[Candidate, ...]:
    """Candidates for the loops of a step, as they were met in a first run."""
    promised = tuple(part for g in guarantees for part in (g.items if isinstance(g, t.And) else (g,)))
    found: dict[tuple[str, str], Candidate] = {}
    for loop, first in {loop.counter: (loop, first) for loop, first in loops}.values():
        made = (
            *_written(loop, node, contract, known),
            *_promised(loop, first, promised, known),
            *_shapes(loop, first, known),
        )
        for candidate in made[:CANDIDATES]:
            found.setdefault((candidate.loop, candidate.text), candidate)
    return tuple(found.values())


def _written(loop: For, node: Node, contract: Contract, known: Sequences) -> Iterator[Candidate]:
    for line, text in loop.invariants:

        def build(turn: Turn, text: str = text) -> t.Term | None:
            meanings = _readable(turn)
            extra: dict[str, Sort] = {name: widest(term.sort) for name, term in meanings.items()}
            try:
                formula = parse_formula(text, node, contract, None, extra, roles=frozenset({t.Role.INPUT}))
            except Rejected:
                return None
            flat = known.flat(formula)
            if flat is None:
                return None
            return substitute(flat, {t.Variable(t.Role.BOUND, n, extra[n]): item for n, item in meanings.items()})

        yield Candidate(loop.counter, f"the invariant of line {line}", build)


def _readable(turn: Turn) -> dict[str, t.Term]:
    """What a comment may name: locals, attributes without ``self.``, the loop's own counter, and ``done``."""
    found: dict[str, t.Term] = {"done": turn.done}
    for name, term in turn.values.items():
        if name.startswith("self.") and not isinstance(term.sort, FunctionSort):
            found[name.removeprefix("self.")] = term
    for name, term in turn.values.items():
        if name.isidentifier():
            found[name] = term
    if turn.loop.position is not None:
        found[turn.loop.position.name] = turn.done
    return found


def _promised(loop: For, first: Turn, promised: Sequence[t.Term], known: Sequences) -> Iterator[Candidate]:
    """A guarantee as a claim about the iterations so far."""
    offsets = {view.sequence: view.start for view in _views(loop)}
    lengths = {pair[0]: offsets.get(v.name, 0) for v, pair in known.parts.items()}
    for formula in promised:
        outputs = sorted((v for v in free_variables(formula) if v.role is t.Role.OUTPUT), key=lambda v: v.name)
        if len(outputs) != 1:
            continue
        (output,) = outputs
        stands: list[tuple[str, Callable[[Turn], t.Term]]] = [
            (name, lambda turn, name=name: turn.values[name])  # type: ignore[misc]
            for name in first.carried
            if widest(first.values[name].sort) == widest(output.sort)
        ]
        if output.sort == BOOL:
            stands += [("TRUE", lambda turn: t.TRUE), ("FALSE", lambda turn: t.FALSE)]
        for name, meaning in stands:

            def build(
                turn: Turn,
                formula: t.Term = formula,
                output: t.Variable = output,
                meaning: Callable[[Turn], t.Term] = meaning,
            ) -> t.Term | None:
                done = {length: plus(turn.done, start) for length, start in lengths.items()}
                return substitute(formula, {output: meaning(turn), **done})

            yield Candidate(loop.counter, f"{name} as {output.qualified} in {_hash_text(formula)}", build)


def _hash_text(formula: t.Term) -> str:
    """A formula in few words that distinguish it from others."""
    return show_term(formula, "unicode").replace("\n", " ")[:120]


def _shapes(loop: For, first: Turn, known: Sequences) -> Iterator[Candidate]:
    views = list(_views(loop))
    for name in first.carried:
        sort = widest(first.values[name].sort)
        if sort in _NUMBERS:
            for operator in ("<=", ">="):
                yield _compared(loop, name, operator, lambda turn, name=name: turn.entry[name], "it was first")  # type: ignore[misc]
                zero = ZERO if sort == INTEGER else t.Literal(0, REAL)
                yield _compared(loop, name, operator, lambda turn, zero=zero: zero, "0")  # type: ignore[misc]
            if sort == INTEGER:
                yield _compared(loop, name, "<=", lambda turn, name=name: plus(turn.done, turn.entry[name]), "turns")  # type: ignore[misc]
                yield _compared(loop, name, "==", lambda turn, name=name: plus(turn.done, turn.entry[name]), "turns")  # type: ignore[misc]
        for view in views:
            _, elements = known.of(view.sequence)
            assert isinstance(elements.sort, FunctionSort)
            if widest(elements.sort.result) != sort or sort not in _NUMBERS:
                continue
            yield Candidate(loop.counter, f"{name} is first or an item", _item_or_first(name, view, elements))
            for operator in ("<=", ">="):
                yield Candidate(
                    loop.counter, f"{name} {operator} every item so far", _every_item(name, operator, view, elements)
                )


def _item_or_first(name: str, view: View, elements: t.Variable) -> Callable[[Turn], t.Term]:
    def build(turn: Turn) -> t.Term:
        at, item = _position(view, elements)
        value = turn.values[name]
        here = t.And((t.Compare("<", at, turn.done), t.Compare("==", value, item)))
        return t.Or((t.Compare("==", value, turn.entry[name]), t.Quantified(t.Quantifier.EXISTS, (at,), here)))

    return build


def _every_item(name: str, operator: str, view: View, elements: t.Variable) -> Callable[[Turn], t.Term]:
    def build(turn: Turn) -> t.Term:
        at, item = _position(view, elements)
        inside = t.Implies(t.Compare("<", at, turn.done), t.Compare(operator, turn.values[name], item))
        return t.Quantified(t.Quantifier.FORALL, (at,), inside)

    return build


def _position(view: View, elements: t.Variable) -> tuple[t.Variable, t.Term]:
    assert isinstance(elements.sort, FunctionSort)
    at = t.Variable(t.Role.BOUND, "at", NATURAL)
    return at, t.Apply(elements, (plus(at, view.start),), elements.sort.result)


def _compared(loop: For, name: str, operator: str, other: Callable[[Turn], t.Term], what: str) -> Candidate:
    return Candidate(
        loop.counter, f"{name} {operator} {what}", lambda turn: t.Compare(operator, turn.values[name], other(turn))
    )


def _views(loop: For) -> Iterator[View]:
    """The sequences, or parts, whose item of the turn's number is looked at."""
    for statement in loop.body:
        if isinstance(statement, Assign):
            for part in parts(statement.value):
                if isinstance(part, Item) and isinstance(part.index, Name):
                    yield part.view
