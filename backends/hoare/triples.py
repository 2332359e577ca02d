"""Hoare triples from a guarantee: {assumptions and antecedent} program {consequent}, one for each conjunct.

The guarantee is taken apart only where that keeps its meaning: outer universal quantifiers become constants, an
implication's conditions on inputs move to the precondition, a conjunction makes several triples, and an equivalence
between outputs and inputs two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.formulas.disjunctions import conjuncts
from avow.formulas.formula import conjunction, equation, free_variables, negation, substitute
from avow.formulas.renaming import rename_apart
from avow.language import terms as t
from avow.language.contract import Clause, Node
from avow.language.printer import show_term
from avow.language.sorts import INTEGER, NATURAL, FunctionSort

from .checker import Checked
from .program import Reading, variable


@dataclass(frozen=True, slots=True)
class Triple:
    """{pre} program {post}. `pre` is over inputs and ghosts, which the program does not change."""

    name: str
    """``low``, or ``low.2`` where a guarantee makes several."""
    obligation: str
    pre: t.Term
    post: t.Term
    ghosts: tuple[tuple[t.Variable, t.Variable], ...]
    """(variable, its ghost): also part of the precondition, as equations."""

    @property
    def full_pre(self) -> t.Term:
        """The precondition with the ghosts' equations."""
        return conjunction((*(equation(v, g) for v, g in self.ghosts), self.pre))


def triples(obligation: str, clause: Clause, node: Node, checked: Checked) -> tuple[Triple, ...]:
    """The triples whose validity is that of the obligation of this id. Raises Rejected (code ``HOARE400``) where the
    formula speaks of an output that the program has nothing for."""
    names = set(checked.program.names)
    assumed = [translate(a, checked.reading, names) for a in node.assumptions]
    parts = tuple(_split(rename_apart(clause.formula, names)))
    found: dict[tuple[t.Term, t.Term], None] = {}
    for conditions, consequent in parts:
        goal = _translate_formula(consequent, checked.reading, clause)
        read = [_translate_formula(c, checked.reading, clause) for c in conditions]
        found.setdefault((_joined((*assumed, *read)), goal))
    ghosts = tuple(sorted(checked.program.ghosts.items(), key=lambda pair: pair[0].name))
    count = len(found)
    return tuple(
        Triple(clause.name if count == 1 else f"{clause.name}.{k}", obligation, pre, post, ghosts)
        for k, (pre, post) in enumerate(found, start=1)
    )


def _joined(parts: Sequence[t.Term]) -> t.Term:
    """All of them, equal parts once."""
    return conjunction(dict.fromkeys(piece for part in parts for piece in conjuncts(part, True)))


def every_run(node: Node, checked: Checked) -> Triple:
    """{assumptions} program {TRUE}: on every input that the assumptions allow, the program asks for nothing undefined,
    keeps its invariants and gets on towards its end. The node promises an output for each of them, also where a
    guarantee asks nothing of it."""
    names = set(checked.program.names)
    assumed = [translate(a, checked.reading, names) for a in node.assumptions]
    ghosts = tuple(sorted(checked.program.ghosts.items(), key=lambda pair: pair[0].name))
    return Triple("every-run", "", _joined(assumed), t.TRUE, ghosts)


# -- the guarantee, taken apart ----------------------------------------------------------------------------------------

_Part = tuple[tuple[t.Term, ...], t.Term]
"""Conditions on inputs, and consequent; still in the contract's words."""


def _split(formula: t.Term) -> Iterator[_Part]:
    stack: list[_Part] = [((), formula)]
    while stack:
        conditions, goal = stack.pop()
        match goal:
            case t.Quantified(quantifier=t.Quantifier.FORALL, body=body):
                stack.append((conditions, body))  # the variables are constants of the triple
            case t.And(items=items):
                stack.extend((conditions, item) for item in reversed(items))
            case t.Implies(left=left, right=right):
                early, late = _sides(left)
                if late:
                    yield (*conditions, *early), t.Implies(conjunction(late), right)
                else:
                    stack.append(((*conditions, *early), right))
            case t.Iff(left=left, right=right) if _is_input(left) != _is_input(right):
                cause, effect = (left, right) if _is_input(left) else (right, left)
                stack.append(((*conditions, negation(cause)), negation(effect)))
                stack.append(((*conditions, cause), effect))
            case _:  # proved as a whole
                yield conditions, goal


def _sides(antecedent: t.Term) -> tuple[list[t.Term], list[t.Term]]:
    """The conjuncts that speak of inputs only, and the others."""
    parts = conjuncts(antecedent, True)
    return [p for p in parts if _is_input(p)], [p for p in parts if not _is_input(p)]


def _is_input(term: t.Term) -> bool:
    return all(v.role is not t.Role.OUTPUT for v in free_variables(term))


# -- the contract's words in the program's -----------------------------------------------------------------------------


def one_line(term: t.Term) -> str:
    """A term on one line, in mathematical notation."""
    return show_term(term, "unicode").replace("\n", " ")


def translate(clause: Clause, reading: Reading, names: set[str]) -> t.Term:
    """A clause over the program's variables. Raises Rejected."""
    return _translate_formula(rename_apart(clause.formula, names), reading, clause)


def _translate_formula(formula: t.Term, reading: Reading, clause: Clause) -> t.Term:
    """The formula with every port read as the plan or the names say; bound names are apart already. Raises Rejected."""
    missing: list[t.Variable] = []
    widened: list[t.Term] = []

    def port(current: t.Variable) -> t.Term:
        found = reading.terms.get((current.role, current.name))
        if found is None:
            missing.append(current)
            return current
        if current.sort == NATURAL and found.sort == INTEGER and current.role is t.Role.OUTPUT:
            widened.append(t.Compare(">=", found, t.Literal(0, INTEGER)))
        return found

    def read(current: t.Term) -> t.Term:
        if isinstance(current, t.Variable):
            return current if current.role is t.Role.BOUND else port(current)
        if isinstance(current, t.Compare) and isinstance(current.left.sort, FunctionSort):
            return read(_pointwise(current))
        if isinstance(current, t.Apply) and isinstance(current.function, t.Variable):
            predicate = reading.predicates.get((current.function.role, current.function.name))
            if predicate is not None:
                arguments = map(read, current.arguments)
                return substitute(predicate.meaning, dict(zip(predicate.parameters, arguments, strict=True)))
        parts = tuple(map(read, current.children))
        return current.rebuild(parts) if parts else current

    result = read(formula)
    if missing:
        raise Rejected(*(_missing(v, clause) for v in dict.fromkeys(missing)))
    return conjunction((*dict.fromkeys(widened), result))


def _pointwise(compared: t.Compare) -> t.Term:
    sort = compared.left.sort
    assert isinstance(sort, FunctionSort)
    points = tuple(variable(f"at~{k}", s) for k, s in enumerate(sort.parameters))
    left, right = (t.Apply(side, points, sort.result) for side in (compared.left, compared.right))
    everywhere = t.Quantified(t.Quantifier.FORALL, points, equation(left, right))
    return everywhere if compared.operator == "==" else t.Not(everywhere)


def _missing(port: t.Variable, clause: Clause) -> Diagnostic:
    return Diagnostic(
        "HOARE400",
        f"{clause.kind} {clause.name} speaks of {port.qualified}, for which the program has nothing",
        clause.span,
        hint=f'map it under `variables`: "{port.qualified}": …, or use a variable of that name',
    )
