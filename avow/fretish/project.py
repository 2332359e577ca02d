"""Sentences of a file as nodes of a contract: a node for each component, its ports from FRET's variables.

A file is what FRET exports (JSON: requirements, with or without variables) or text with a sentence on a line, each with
its name and a colon before it, or without. What FRET does not say is taken from use: a name is an output where a
response speaks of it (behind its last ``=>``), BOOL where it stands for a truth, else REAL.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, assert_never

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.language.format import format_text
from avow.language.lexer import KEYWORDS, quote
from avow.language.load import check_text

from .meaning import Unsaid, demands, remarks
from .sentence import Call, Denied, Expression, Minus, Name, Number, Sentence, Sign, Truth, Unreadable, parse
from .sentence import parse_expression as parsed


@dataclass(frozen=True, slots=True)
class Requirement:
    """One requirement of a file."""

    name: str
    text: str
    span: Span


@dataclass(frozen=True, slots=True)
class Given:
    """What FRET's variables say of a name: its kind (``Input``), its type, and what it stands for."""

    kind: str = ""
    type: str = ""
    means: str = ""


@dataclass(frozen=True, slots=True)
class Project:
    requirements: tuple[Requirement, ...]
    variables: Mapping[tuple[str, str], Given] = field(default_factory=dict)
    """By component and name."""


def read(path: Path) -> Project:
    """Raises Rejected."""
    try:
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise Rejected(Diagnostic("FRET001", f"{path} cannot be read: {error.strerror}")) from None
    except UnicodeDecodeError as error:
        raise Rejected(Diagnostic("FRET001", f"{path} is not UTF-8: {error.reason} at byte {error.start}")) from None
    if not text.lstrip().startswith(("{", "[")):
        return Project(tuple(_lines(text, str(path))))
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Rejected(Diagnostic("FRET001", f"{path} is no JSON: {error}")) from None
    listed = found.get("requirements") if isinstance(found, dict) else found
    if not isinstance(listed, list) or not all(
        isinstance(r, dict) and isinstance(r.get("fulltext"), str) for r in listed
    ):
        message = f"{path} is not what FRET exports: a list of requirements, each with its `fulltext`"
        raise Rejected(Diagnostic("FRET001", message))
    requirements = [
        Requirement(str(r.get("reqid") or f"R{k}"), r["fulltext"], _place(text, r["fulltext"], str(path)))
        for k, r in enumerate(listed, start=1)
    ]
    variables = found.get("variables") if isinstance(found, dict) else None
    return Project(tuple(requirements), _given(variables if isinstance(variables, list) else []))


def _lines(text: str, file: str) -> Iterable[Requirement]:
    for number, line in enumerate(text.splitlines(), start=1):
        said = line.strip()
        if not said or said.startswith(("#", "//")):
            continue
        name, _, rest = said.partition(":")
        if rest and re.fullmatch(r"[A-Za-z][\w.-]*", name):
            said = rest.strip()
        else:
            name = f"R{number}"
        column = line.index(said) + 1
        yield Requirement(name, said, Span(file, number, column, number, column + len(said)))


def _place(text: str, sentence: str, file: str) -> Span:
    at = text.find(json.dumps(sentence, ensure_ascii=False)[1:-1])
    line = text.count("\n", 0, max(at, 0)) + 1
    column = at - text.rfind("\n", 0, max(at, 0)) if at >= 0 else 1
    return Span(file, line, column, line, column + len(sentence))


def _given(variables: list[Any]) -> dict[tuple[str, str], Given]:
    found: dict[tuple[str, str], Given] = {}
    for v in variables:
        if not isinstance(v, dict) or not isinstance(v.get("variable_name"), str) or not v.get("idType"):
            continue
        means = v.get("modeRequirement") if v["idType"] == "Mode" else v.get("assignment")
        kind = _TYPES.get(str(v.get("dataType")), "")
        key = (str(v.get("component_name")), v["variable_name"])
        found[key] = Given(str(v["idType"]), kind, means if isinstance(means, str) else "")
    return found


_TYPES = {
    "boolean": "BOOL",
    "integer": "INTEGER",
    "unsigned integer": "NATURAL",
    "double": "REAL",
    "single": "REAL",
}


@dataclass(frozen=True, slots=True)
class Nodes:
    """The contract's text, and what is to be said of sentences that it does not have, or that mean what few expect."""

    text: str
    faults: tuple[Diagnostic, ...]


def nodes(project: Project, outputs: frozenset[str] = frozenset()) -> Nodes:
    """The nodes; of the names that FRET says nothing of, `outputs` are outputs, if any are given. Raises Rejected."""
    faults: list[Diagnostic] = []
    components: dict[str, list[tuple[Requirement, Sentence]]] = {}
    if not project.requirements:
        raise Rejected(Diagnostic("FRET001", "there is no sentence in the file"))
    for requirement in project.requirements:
        try:
            sentence = parse(requirement.text)
        except Unreadable as error:
            place = replace(requirement.span, column=requirement.span.column + error.column - 1)
            faults.append(Diagnostic("FRET002", f"{requirement.name}: {error.message}", place))
            continue
        components.setdefault(sentence.component, []).append((requirement, sentence))
        faults += [
            Diagnostic("FRET004", f"{requirement.name}: {text}", requirement.span, Severity.WARNING)
            for text in remarks(sentence)
        ]
    constants: dict[str, str] = {}
    texts = [
        _Node(component, found, project, outputs, constants, faults).text() for component, found in components.items()
    ]
    text = _context(constants) + "\n".join(filter(None, texts))
    return Nodes(format_text(text, "fretish.rcl") if any(texts) else "", tuple(faults))


class _Node:
    """One component's ports and clauses."""

    def __init__(
        self,
        component: str,
        found: list[tuple[Requirement, Sentence]],
        project: Project,
        outputs: frozenset[str],
        constants: dict[str, str],
        faults: list[Diagnostic],
    ) -> None:
        self.name = _word(component)
        self.found = found
        self.faults = faults
        self.given = {name: given for (of, name), given in project.variables.items() if of == component}
        self.outputs = outputs or frozenset(name for _, s in found for name in _names(_answered(s.response)))
        self.types: dict[str, str] = {}
        self.same: list[tuple[str, str]] = []
        self.ports: dict[str, str] = {}
        """Names that clauses speak of, each with `in` or `out`."""
        self.constants = constants
        """Of all nodes."""
        self.within: tuple[str, ...] = ()

    def text(self) -> str:
        for _, sentence in self.found:
            for part in (sentence.response, sentence.mode, sentence.trigger, sentence.stop):
                if part is not None:
                    self._truth(part)
        self._spread()
        clauses: list[str] = []
        taken: set[str] = set()
        for requirement, sentence in self.found:
            try:
                for demand in demands(sentence, self._say):
                    name = _unused(_word(requirement.name) + demand.suffix, taken)
                    clauses.append(self._clause(name, requirement, demand.formula))
            except Unsaid as error:
                self.faults.append(Diagnostic("FRET003", f"{requirement.name}: {error}", requirement.span))
        clauses = sorted(filter(self._sound, clauses), key=lambda clause: not clause.lstrip().startswith("assume"))
        return self._written(clauses) if clauses else ""

    def _clause(self, name: str, requirement: Requirement, formula: str) -> str:
        assumed = "assum" in requirement.name.lower()
        said = quote(" ".join(requirement.text.split()))
        return f"  {'assume' if assumed else 'guarantee'} {name} {said} ( {formula} )"

    def _sound(self, clause: str) -> bool:
        """Whether the checker takes the clause; what it says is the reason why it is left out."""
        besides = [] if clause.lstrip().startswith("guarantee") else ["  guarantee ( TRUE )"]
        found, diagnostics = check_text(self.context() + self._written([clause, *besides]), "fretish.rcl")
        if found is not None:
            return True
        error = next(d for d in diagnostics if d.is_error)
        name = clause.split(maxsplit=2)[1]
        place = next(r.span for r, _ in self.found if name.startswith(_word(r.name)))
        self.faults.append(
            Diagnostic("FRET003", f"{name}: its clause is no RCL: {error.message}", place, hint=error.hint)
        )
        return False

    def _written(self, clauses: list[str]) -> str:
        def listed(side: str) -> str:
            shown = ", ".join(f"{_word(n)} : {self._type(n)}" for n, of in sorted(self.ports.items()) if of == side)
            return f"( {shown} )" if shown else "()"

        head = f"node {self.name} {{\n  inputs{listed('in')}\n  outputs{listed('out')}\n  topics()\n"
        return f"{head}{chr(10).join(clauses)}\n}}\n"

    def context(self) -> str:
        return _context(self.constants)

    # -- types ---------------------------------------------------------------------------------------------------------

    def _truth(self, part: Expression) -> None:
        match part:
            case Name(text=name):
                self.types.setdefault(name, "BOOL")
            case Denied(body=body):
                self._truth(body)
            case Sign(operator="=>" | "<=>" | "|" | "&" | "xor", left=left, right=right):
                self._truth(left)
                self._truth(right)
            case Sign(operator="=" | "!=", left=Name(text=left), right=Name(text=right)):
                self.same.append((left, right))
            case Sign(left=left, right=right) | Call(name="preInt" | "preReal", arguments=(left, right)):
                self._number(left)
                self._number(right)
            case Call(name="preBool", arguments=(left, right)):
                self._truth(left)
                self._truth(right)
            case Call(arguments=(_, *rest)):  # persisted(n, p), occurred(n, p)
                for each in rest:
                    self._truth(each)
            case Number() | Truth() | Minus() | Call():
                pass
            case _:
                assert_never(part)

    def _number(self, part: Expression) -> None:
        match part:
            case Name(text=name):
                self.types.setdefault(name, "REAL")
            case Sign(left=left, right=right):
                self._number(left)
                self._number(right)
            case Minus(body=body) | Denied(body=body):
                self._number(body)
            case Call(arguments=arguments):
                for each in arguments:
                    self._number(each)
            case Number() | Truth():
                pass
            case _:
                assert_never(part)

    def _spread(self) -> None:
        """Names that are compared are of one type."""
        for _ in self.same:
            for left, right in (pair for one, other in self.same for pair in ((one, other), (other, one))):
                if left not in self.types and (known := self.given.get(right, Given()).type or self.types.get(right)):
                    self.types[left] = known

    def _type(self, name: str) -> str:
        return self.given.get(name, Given()).type or self.types.get(name, "REAL")

    # -- words ---------------------------------------------------------------------------------------------------------

    def _say(self, part: Expression) -> str:
        match part:
            case Name(text=name):
                return self._named(name)
            case Number(text=text):
                return text
            case Truth(value=value):
                return "TRUE" if value else "FALSE"
            case Denied(body=body):
                return f"(not {self._say(body)})"
            case Minus(body=body):
                return f"(-{self._say(body)})"
            case Sign(operator="mod" | "xor" as function, left=left, right=right):
                return f"{function}({self._say(left)}, {self._say(right)})"
            case Sign(operator="^"):
                raise Unsaid("`^` has no counterpart: write the product")
            case Sign(operator=operator, left=left, right=right):
                return f"({self._say(left)} {_SIGNS.get(operator, operator)} {self._say(right)})"
            case Call(name=name, arguments=arguments):
                return self._called(name, [self._say(a) for a in arguments])
            case _:
                assert_never(part)

    def _called(self, name: str, arguments: list[str]) -> str:
        match name, arguments:
            case (("preBool" | "preInt" | "preReal"), [first, value]):
                return f"previous({value}, {first})"
            case (("persisted" | "occurred"), [steps, formula]):
                return f"{'held' if name == 'persisted' else 'once'}[{steps} steps]({formula})"
            case (("abs" | "absInt" | "absReal"), [_]):
                return f"abs({arguments[0]})"
            case (("min" | "minInt" | "minReal" | "max" | "maxInt" | "maxReal"), [_, _]):
                return f"{name[:3]}({', '.join(arguments)})"
            case _:  # a function that only FRET's user knows, or one that looks ahead
                raise Unsaid(f"Avow does not know the function `{name}` of {len(arguments)} arguments")

    def _named(self, name: str) -> str:
        given = self.given.get(name, Given())
        if given.means and given.kind in ("Internal", "Mode"):
            if re.fullmatch(r"-?\d+(\.\d+)?", given.means.strip()):
                value = given.means.strip()
                return _word(name) if self.constants.setdefault(name, value) == value else f"({value})"
            return self._meant(name, given.means)
        side = "out" if given.kind == "Output" or (not given.kind and name in self.outputs) else "in"
        self.ports[name] = side
        return f"{side}.{_word(name)}"

    def _meant(self, name: str, means: str) -> str:
        """What a name stands for, which FRET has as an expression of Lustre."""
        if name in self.within:
            raise Unsaid(f"`{name}` is defined by itself")
        said = re.sub(r"\bnot\b", "!", re.sub(r"\band\b", "&", re.sub(r"\bor\b", "|", means)))
        before = self.within
        self.within = (*before, name)
        try:
            expression = parsed(said)
            self._truth(expression)
            return f"({self._say(expression)})"
        except Unreadable as error:
            raise Unsaid(f"what `{name}` stands for is not read: {error.message} in `{means[:80]}`") from None
        finally:
            self.within = before


def _context(constants: Mapping[str, str]) -> str:
    lines = "".join(f"  {_word(name)} = {value};\n" for name, value in sorted(constants.items()))
    return f"context {{\n{lines}}}\n\n" if lines else ""


_SIGNS = {"=>": "->", "&": "and", "|": "or", "=": "=="}


def _answered(response: Expression) -> Expression:
    """What a response demands, without the condition that it has itself."""
    while isinstance(response, Sign) and response.operator == "=>":
        response = response.right
    return response


def _names(part: Expression) -> Iterable[str]:
    match part:
        case Name(text=name):
            yield name
        case Denied(body=body) | Minus(body=body):
            yield from _names(body)
        case Sign(left=left, right=right):
            yield from _names(left)
            yield from _names(right)
        case Call(arguments=arguments):
            for each in arguments:
                yield from _names(each)
        case Number() | Truth():
            return
        case _:
            assert_never(part)


def _word(name: str) -> str:
    """A name of FRET's as one of RCL's."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    word = word if re.match(r"[A-Za-z]", word) else f"r{word}"
    return f"{word}_" if word in KEYWORDS or word in _OPERATORS else word


_OPERATORS = frozenset(
    ("previous", "rose", "fell", "changed", "once", "historically", "held", "counted", "next", "within", "eventually")
) | frozenset(("abs", "min", "max", "mod", "div", "length", "xor", "implies", "true", "false", "topics"))


def _unused(name: str, taken: set[str]) -> str:
    k = 2
    word = name
    while word in taken:
        word, k = f"{name}_{k}", k + 1
    taken.add(word)
    return word
