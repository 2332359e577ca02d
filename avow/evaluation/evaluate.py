"""Exact evaluation of typed terms over concrete values (`avow.formulas.values`).

Nothing is approximated: either the value is the one that the logic defines, or `NotEvaluable` says why it cannot be
computed this way. A term is compiled once into closures over a list of slots; evaluation then walks no syntax.
Quantifiers over finite sorts are enumerated; over infinite ones they are reduced to finitely many values by
`avow.evaluation.quantifier_search`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from avow.evaluation.compiler import Code, Compiler, Domains, Env, NotEvaluable, finite_values
from avow.evaluation.quantifier_search import Search
from avow.formulas.renaming import rename_apart
from avow.formulas.values import SequenceValue, Value
from avow.language.enclosures import Enclosed
from avow.language.sorts import BOOL
from avow.language.terms import Quantified, Quantifier, Term

__all__ = [
    "Domains",
    "Evaluator",
    "NotEvaluable",
    "compile_counterexample",
    "compile_number",
    "compile_term",
    "evaluate",
    "finite_values",
    "free_names",
]

Evaluator = Callable[[Mapping[str, Value]], Value]


def evaluate(term: Term, valuation: Mapping[str, Value], *, domains: Domains | None = None) -> Value:
    """The value of a term; `valuation` maps qualified names (``in.r``, or a free bound variable's name) to values.

    `domains` replaces the infinite range of a sort's quantified variables by the given values: the answer then applies
    to that finite scenario. Raises NotEvaluable.
    """
    return compile_term(term, domains=domains)(valuation)


def compile_term(term: Term, *, domains: Domains | None = None) -> Evaluator:
    """Compile once, evaluate often. The result raises NotEvaluable, also for a number that can only be enclosed. So
    does compiling a term nested too deeply.

    A function's table must not be changed after it was passed: an index of it may be kept.
    """
    value_of = compile_number(term, domains=domains)
    return value_of if term.sort == BOOL else lambda valuation: _kept(value_of(valuation))


def _kept(value: Value) -> Value:
    """A value that may be remembered and looked up."""
    match value:
        case Enclosed():
            raise NotEvaluable(f"{value}: a number that can only be enclosed")
        case SequenceValue(items=items) | tuple(items):
            for item in items:
                _kept(item)
    return value


def compile_number(term: Term, *, domains: Domains | None = None) -> Evaluator:
    """As `compile_term`, with numbers that can only be enclosed: they are compared, and nothing else."""
    compiler = Compiler(domains or {}, quantified)
    code = guarded(lambda: compiler.code(rename_apart(term)))
    fill = filler(compiler)
    return lambda valuation: guarded(lambda: code(fill(valuation)))


def compile_counterexample(term: Term) -> Callable[[Mapping[str, Value]], dict[str, Value] | None]:
    """For ``forall(x, y | …)``: values of x, y under which the body is false, or None if none were found.

    The result, and compiling, raise NotEvaluable. Other formulas have no bound variables to name: always None.
    """
    compiler = Compiler({}, quantified)
    if not isinstance(term, Quantified) or term.quantifier is not Quantifier.FORALL:
        return lambda valuation: None
    apart = guarded(lambda: rename_apart(term))
    assert isinstance(apart, Quantified)
    search = guarded(lambda: Search(compiler, apart.variables, apart.body, False))
    names, fill = tuple(v.name for v in term.variables), filler(compiler)

    def find(valuation: Mapping[str, Value]) -> dict[str, Value] | None:
        for witness in search.witnesses(fill(valuation)):
            return dict(zip(names, witness, strict=True))
        return None

    return lambda valuation: guarded(lambda: find(valuation))


def quantified(compiler: Compiler, term: Quantified) -> Code:
    """Quantifiers as searches (`avow.evaluation.quantifier_search`)."""
    match term.quantifier:
        case Quantifier.EXISTS:
            return Search(compiler, term.variables, term.body, True).exists
        case Quantifier.FORALL:
            search = Search(compiler, term.variables, term.body, False)
            return lambda env: not search.exists(env)
        case Quantifier.UNIQUE:
            return Search(compiler, term.variables, term.body, True, unique=True).exactly_one


def filler(compiler: Compiler) -> Callable[[Mapping[str, Value]], Env]:
    names = tuple(compiler.free.items())
    size = compiler.size

    def fill(valuation: Mapping[str, Value]) -> Env:
        env: Env = [None] * size
        for name, slot in names:
            try:
                env[slot] = valuation[name]
            except KeyError:
                raise NotEvaluable(f"{name} has no value") from None
        return env

    return fill


def guarded(action: Callable[[], Any]) -> Any:
    try:
        return action()
    except RecursionError:
        raise NotEvaluable("the formula is nested too deeply") from None


def free_names(term: Term) -> frozenset[str]:
    """The qualified names that a valuation must contain for the term."""
    compiler = Compiler({}, quantified)
    compiler.code(rename_apart(term))
    return frozenset(compiler.free)
