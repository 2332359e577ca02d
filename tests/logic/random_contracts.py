"""Random contracts over nearly all of the language, small enough that every case can be written out.

A port of an infinite type has a clause of its own, named `LIMIT` and the port, that admits only values of
`oracle.values.domain`, and not all of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from random import Random

from oracle.sanity import LIMIT

CONTEXT = """\
context {
  Colour : {red, green, blue};
  Cmd : {go(Colour), spin(BOOL), halt};
  Deep : {wrap(Cmd), tag(Colour, BOOL)};
  Pair : (Colour, BOOL);
}
"""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a port or a bound variable may be. `limit` is of a port ``{v}``; `arguments` and `result` are a function's
    kinds, `item` a sequence's."""

    written: str
    limit: str = ""
    arguments: tuple[str, ...] = ()
    result: str = ""
    item: str = ""


KINDS = {
    "Colour": Kind("Colour"),
    "BOOL": Kind("BOOL"),
    "Cmd": Kind("Cmd"),
    "Deep": Kind("Deep"),
    "Pair": Kind("Pair"),
    "natural": Kind("NATURAL", "{v} <= 2"),
    "integer": Kind("INTEGER", "-1 <= {v} <= 2"),
    "real": Kind("REAL", "{v} in {{0, 0.5, 1, 2}}"),
    "string": Kind("STRING", '{v} in {{"a", ""}}'),
    "truths": Kind("<BOOL>", "length({v}) <= 2", item="BOOL"),
    "pairs": Kind("<Pair>", "length({v}) <= 1", item="Pair"),
    "naturals": Kind("<NATURAL>", "length({v}) <= 1 and forall(n in NATURAL | n in {v} -> n < 3)", item="natural"),
    "choice": Kind("Colour --> BOOL", arguments=("Colour",), result="BOOL"),
    "map": Kind("Colour --> Colour", arguments=("Colour",), result="Colour"),
    "orders": Kind("BOOL --> Cmd", arguments=("BOOL",), result="Cmd"),
    "counts": Kind("BOOL --> NATURAL", "forall(q in BOOL | {v}(q) <= 2)", ("BOOL",), "natural"),
    "relation": Kind("Colour x BOOL --> BOOL", arguments=("Colour", "BOOL"), result="BOOL"),
}
NUMBERS = ("natural", "integer", "real")
FINITE = ("Colour", "Colour", "BOOL", "Cmd", "Pair")

Scope = tuple[tuple[str, Kind], ...]
"""Names with what they are, as a formula writes them (``in.i0``)."""


def random_contract(seed: int) -> str:
    """The text of a contract of one node; always the same for a seed."""
    return _Writer(Random(seed)).contract()


class _Writer:
    def __init__(self, random: Random) -> None:
        self.random = random
        self.bound = 0

    def contract(self) -> str:
        depths = self.random.choice
        inputs = self._ports("i", depths([1, 2, 2]))
        outputs = self._ports("o", depths([1, 1, 2]))
        ins = tuple((f"in.{name}", kind) for name, kind in inputs)
        outs = tuple((f"out.{name}", kind) for name, kind in outputs)
        assumed = [self.formula(ins, depths([0, 1, 2])) for _ in range(depths([0, 1, 1]))]
        guaranteed = [self.formula(ins + outs, depths([1, 2, 3])) for _ in range(depths([1, 2, 2, 3]))]
        clauses = [
            *_limits("assume", ins),
            *(f"assume( {formula} )" for formula in assumed),
            *_limits("guarantee", outs),
            *(f"guarantee( {formula} )" for formula in guaranteed),
        ]
        head = f"inputs( {_declared(inputs)} ) outputs( {_declared(outputs)} ) topics()"
        return CONTEXT + "node n {\n  " + "\n  ".join([head, *clauses]) + "\n}\n"

    def _ports(self, letter: str, count: int) -> Scope:
        return tuple((f"{letter}{k}", KINDS[self.random.choice(list(KINDS))]) for k in range(count))

    # -- formulas ------------------------------------------------------------------------------------------------------

    def formula(self, scope: Scope, depth: int) -> str:
        choice = self.random.random()
        if depth <= 0 or choice < 0.2:
            return self.atom(scope, self.random.choice([1, 1, 2]))
        if choice < 0.28:
            return f"not ({self.formula(scope, depth - 1)})"
        if choice < 0.62:
            return self._connected(scope, depth - 1)
        return self._quantified(scope, depth - 1)

    def _connected(self, scope: Scope, depth: int) -> str:
        connective = self.random.choice(["and", "or", "->", "->", "->", "<=>", "chain"])
        if connective == "chain":
            links = (f"({self.formula(scope, 0)})" for _ in range(self.random.choice([3, 4, 5])))
            return f"({' <=> '.join(links)})"
        return f"(({self.formula(scope, depth)}) {connective} ({self.formula(scope, depth)}))"

    def _quantified(self, scope: Scope, depth: int) -> str:
        quantifier = self.random.choice(["forall", "forall", "exists", "exists", "exists_unique"])
        kind, collection = self._range(scope)
        names = [self._fresh()]
        if kind.written in ("Colour", "BOOL") and collection == kind.written and self.random.random() < 0.3:
            names.append(self._fresh())
        inner = scope + tuple((name, kind) for name in names)
        return f"{quantifier}({', '.join(names)} in {collection} | {self.formula(inner, depth)})"

    def _range(self, scope: Scope) -> tuple[Kind, str]:
        """What a bound variable ranges over."""
        match self.random.choice([*FINITE, "upto", "reals", "sequence", "set"]):
            case "upto":
                return KINDS["natural"], self._upto(scope)
            case "reals":
                return KINDS["real"], "{0, 0.5, 2}"
            case "sequence" if sequences := [(name, kind) for name, kind in scope if kind.item]:
                name, kind = self.random.choice(sequences)
                return KINDS[kind.item], name
            case "set" | "sequence":
                item = self.random.choice(["Colour", "Cmd", "Pair", "natural"])
                return KINDS[item], self._set(item, scope, 1, 2)
            case finite:
                return KINDS[finite], finite

    def _fresh(self) -> str:
        self.bound += 1
        return f"v{self.bound}"

    def atom(self, scope: Scope, depth: int) -> str:
        kinds = [kind.result or _name(kind) for _, kind in scope] + [kind.item for _, kind in scope if kind.item]
        name = self.random.choice(kinds or ["Colour"])
        choice = self.random.random()
        if name == "BOOL" and choice < 0.6:
            return self.term("BOOL", scope, depth)
        if name in NUMBERS and choice < 0.7:
            return self._measured(name, scope, depth, chained=choice < 0.15)
        item = self.term(name, scope, depth)
        if choice > 0.85:
            members = self._set(name, scope, depth - 1, self.random.choice([1, 2, 3]))
            return f"{item} {self.random.choice(['in', 'in', '!in'])} {members}"
        sequences = [s for s, kind in scope if kind.item == name]
        if sequences and choice < 0.5:
            return f"{item} {self.random.choice(['in', '!in'])} {self.random.choice(sequences)}"
        if name == "natural" and choice > 0.8:
            return f"{item} in {self._upto(scope)}"
        return f"{item} {self.random.choice(['==', '==', '!='])} {self.term(name, scope, depth)}"

    def _measured(self, name: str, scope: Scope, depth: int, chained: bool) -> str:
        one, other = self.term(name, scope, depth), self.term(self.random.choice([name, *NUMBERS[1:]]), scope, depth)
        if chained:
            signs = self.random.choice(["<", "<="]), self.random.choice(["<", "<="])
            return f"{self.term('integer', scope, 0)} {signs[0]} {one} {signs[1]} {other}"
        return f"{one} {self.random.choice(['<', '<=', '==', '!=', '>', '>='])} {other}"

    def _set(self, item: str, scope: Scope, depth: int, count: int) -> str:
        return "{" + ", ".join(self.term(item, scope, depth) for _ in range(count)) + "}"

    def _upto(self, scope: Scope) -> str:
        return f"<{self.random.choice([0, 1])} upto {self._small(scope)}>"

    def _small(self, scope: Scope) -> str:
        literal = self.random.randrange(3)
        return str(literal) if literal else self.term("natural", scope, 0)

    # -- terms ---------------------------------------------------------------------------------------------------------

    def term(self, name: str, scope: Scope, depth: int) -> str:
        """A term of the kind of this name. What the scope has is likelier than what is made up."""
        options: list[Callable[[], str]] = list(self._made(name, scope, depth - 1))
        if named := [v for v, kind in scope if kind is KINDS[name]]:
            options += 3 * [lambda: self.random.choice(named)]
        functions = [(v, kind) for v, kind in scope if kind.result == name]
        if functions and depth > 0:
            options += 3 * [lambda: self._applied(*self.random.choice(functions), scope, depth - 1)]
        if sequences := [v for v, kind in scope if kind.item == name]:
            options.append(lambda: f"{self.random.choice(sequences)}({self._small(scope)})")
        return self.random.choice(options)()

    def _applied(self, function: str, kind: Kind, scope: Scope, depth: int) -> str:
        return f"{function}({', '.join(self.term(argument, scope, depth) for argument in kind.arguments)})"

    def _made(self, name: str, scope: Scope, depth: int) -> Iterable[Callable[[], str]]:
        choice = self.random.choice

        def of(part: str) -> str:
            return self.term(part, scope, depth)

        match name:
            case "Colour":
                yield lambda: choice(["red", "green", "blue"])
            case "BOOL":
                yield lambda: choice(["TRUE", "FALSE"])
            case "Cmd":
                yield from (lambda: f"go({of('Colour')})", lambda: f"spin({of('BOOL')})", lambda: "halt")
            case "Deep":
                yield from (lambda: f"wrap({of('Cmd')})", lambda: f"tag({of('Colour')}, {of('BOOL')})")
            case "Pair":
                yield lambda: f"({of('Colour')}, {of('BOOL')})"
            case "string":
                yield lambda: choice(['"a"', '""', '"b"'])
            case "natural" | "integer" | "real":
                yield from self._numbers(name, scope, depth)
            case _ if item := KINDS[name].item:
                yield lambda: f"<{', '.join(of(item) for _ in range(choice([0, 1, 1, 2])))}>"
                if item == "natural":
                    yield lambda: self._upto(scope)

    def _numbers(self, name: str, scope: Scope, depth: int) -> Iterable[Callable[[], str]]:
        choice = self.random.choice

        def of(part: str) -> str:
            return self.term(part, scope, depth)

        def combined(signs: str) -> Callable[[], str]:
            return lambda: f"({of(name)} {choice(signs)} {of(name)})"

        match name:
            case "natural":
                yield lambda: choice(["0", "1", "2", "3"])
                if sequences := [v for v, kind in scope if kind.item]:
                    yield lambda: f"length({choice(sequences)})"
                if depth >= 0:
                    yield combined("+*")
            case "integer":
                yield lambda: choice(["0", "1", "2", "-1"])
                yield lambda: self.term("natural", scope, depth + 1)
                if depth >= 0:
                    yield from (combined("+-*"), lambda: f"({of('natural')} - {of('natural')})")
                    yield lambda: f"(-{of('integer')})"
            case "real":
                yield lambda: choice(["0", "0.5", "1", "2", "1.5"])
                yield lambda: self.term(choice(["integer", "natural"]), scope, depth + 1)
                if depth >= 0:
                    yield combined("+-*")
                    yield lambda: f"({of('real')} / {choice(['2', '4', self.term('real', scope, 0)])})"


def _limits(clause: str, ports: Scope) -> list[str]:
    """The clauses that keep ports within a few values."""
    limited = ((name, kind.limit.format(v=name)) for name, kind in ports if kind.limit)
    return [f"{clause} {LIMIT}{name.partition('.')[2]} ( {formula} )" for name, formula in limited]


def _declared(ports: Scope) -> str:
    return ", ".join(f"{name} : {kind.written}" for name, kind in ports)


def _name(wanted: Kind) -> str:
    return next(name for name, kind in KINDS.items() if kind is wanted)
