"""Terms of agent programs, and operations on them: printing, renaming, unification."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import count


@dataclass(frozen=True, slots=True)
class Var:
    """``Floor``; an anonymous ``_`` gets a name of its own when it is read."""

    name: str


@dataclass(frozen=True, slots=True)
class Struct:
    """``going(1)``, ``door``, ``-8.18``, ``"text"``: numbers and texts are constants too."""

    functor: str
    args: tuple[Term, ...] = ()


Term = Var | Struct

Bindings = dict[str, Term]

CONS, NIL = "[|]", "[]"
"""Lists are terms: ``[a, b|T]`` is ``[|](a, [|](b, T))``."""

OPERATORS = frozenset("+-")


def show(term: Term) -> str:
    """A term as Gwendolen writes it."""
    if isinstance(term, Var):
        return "_" if term.name.startswith("_") else term.name
    if term.functor == CONS:
        return _list(term, show, ", ")
    if term.functor in OPERATORS and len(term.args) == 2:
        return f"({show(term.args[0])} {term.functor} {show(term.args[1])})"
    return f"{term.functor}({', '.join(map(show, term.args))})" if term.args else term.functor


def _list(term: Term, say: Callable[[Term], str], comma: str) -> str:
    items = []
    while isinstance(term, Struct) and term.functor == CONS:
        items.append(say(term.args[0]))
        term = term.args[1]
    rest = "" if term == Struct(NIL) else f"|{say(term)}"
    return f"[{comma.join(items)}{rest}]"


def plain(term: Term) -> str:
    """A term as AIL's own texts write it, by which it also sorts: no space after a comma."""
    if isinstance(term, Var):
        return term.name
    if term.functor == CONS:
        return _list(term, plain, ",")
    return f"{term.functor}({','.join(map(plain, term.args))})" if term.args else term.functor


def name_of(agent: Term) -> Term:
    """The receiver of a message: AIL accepts a text as a name, too."""
    text = isinstance(agent, Struct) and not agent.args and agent.functor[:1] in ("'", '"')
    return Struct(agent.functor[1:-1]) if isinstance(agent, Struct) and text else agent


def subterms(term: Term) -> Iterator[Term]:
    """The term and all its subterms, in reading order."""
    yield term
    if isinstance(term, Struct):
        for arg in term.args:
            yield from subterms(arg)


def variables(term: Term) -> Iterator[str]:
    return (part.name for part in subterms(term) if isinstance(part, Var))


def is_ground(term: Term) -> bool:
    return isinstance(term, Struct) and all(map(is_ground, term.args))


def named_apart(term: Struct) -> Struct:
    """Each ``_`` of a property gets a name of its own, as it stands for anything."""
    numbers = count(1)

    def walk(part: Term) -> Term:
        if isinstance(part, Var):
            return Var(f"?{next(numbers)}")
        return Struct(part.functor, tuple(map(walk, part.args)))

    return Struct(term.functor, tuple(map(walk, term.args)))


def rename(term: Term, names: Mapping[str, Term]) -> Term:
    """The term with its variables replaced, once: the replacements are not replaced again."""
    if isinstance(term, Var):
        return names.get(term.name, term)
    return Struct(term.functor, tuple(rename(arg, names) for arg in term.args)) if term.args else term


def apply(term: Term, bindings: Mapping[str, Term]) -> Term:
    """The term with its bound variables replaced, through chains of bindings."""
    if isinstance(term, Var):
        found = bindings.get(term.name)
        return term if found is None else apply(found, bindings)
    if not term.args:
        return term
    return Struct(term.functor, tuple(apply(arg, bindings) for arg in term.args))


def unify(left: Term, right: Term, bindings: Bindings) -> Bindings | None:
    """The most general extension of `bindings` that makes both equal, or None. No occurs check is needed: one side is
    always a belief, goal, event or deed of a running agent, whose variables are renamed apart."""
    stack = [(left, right)]
    result = bindings
    copied = False
    while stack:
        a, b = stack.pop()
        a, b = _resolve(a, result), _resolve(b, result)
        if a == b:
            continue
        if isinstance(b, Var) and not isinstance(a, Var):
            a, b = b, a
        if isinstance(a, Var):
            if not copied:
                result, copied = dict(result), True
            result[a.name] = b
            continue
        if not isinstance(b, Struct) or a.functor != b.functor or len(a.args) != len(b.args):
            return None
        stack.extend(zip(a.args, b.args, strict=True))
    return result


def _resolve(term: Term, bindings: Mapping[str, Term]) -> Term:
    while isinstance(term, Var):
        found = bindings.get(term.name)
        if found is None:
            return term
        term = found
    return term


def apart(term: Term, suffix: str) -> Term:
    """The term with fresh variables: a belief with variables applies to anything, and a plan or a rule is used more
    than once."""
    names = set(variables(term))
    return rename(term, {name: Var(name + suffix) for name in names}) if names else term
