"""Sentences of a file as nodes of a contract: a node for each component, its ports from FRET's variables.

A file is an export from FRET (JSON: requirements, with or without variables) or text with one sentence per line, with
or without its name and a colon before it. Information that FRET lacks is inferred from use: a name is an output if a
response mentions it (after its last ``=>``), BOOL if it is used as a truth value, otherwise REAL.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from avow.base import codec
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.language.format import format_text
from avow.language.lexer import KEYWORDS, quote
from avow.language.load import check_text
from avow.language.terms import CALLED, Builtin, Past

from .meaning import Unsaid, demands, remarks
from .sentence import (
    FIRST,
    FORM,
    Expression,
    Scope,
    Sentence,
    Unreadable,
    is_assumption,
    parse,
    parse_expression,
)


@dataclass(frozen=True, slots=True)
class Requirement:
    """One requirement of a file."""

    name: str
    text: str
    span: Span
    project: str = ""


@dataclass(frozen=True, slots=True)
class Given:
    """FRET's entry for a variable: its kind (``Input``), its type, and its definition."""

    kind: str = ""
    type: str = ""
    means: str = ""


@dataclass(frozen=True, slots=True)
class Project:
    requirements: tuple[Requirement, ...]
    variables: tuple[tuple[tuple[str, str, str], Given], ...] = ()
    """With project (empty if the file does not give it), component and name of each."""

    def of(self, project: str, component: str) -> dict[str, Given]:
        """The entries for a component's names. Raises Rejected if one has two different entries."""
        found: dict[str, Given] = {}
        for (where, owner, name), given in self.variables:
            here = owner == component and (where == project or not where or not project)
            if here and found.setdefault(name, given) != given:
                raise Rejected(Diagnostic("FRET001", f"two different variables `{name}` of component `{component}`"))
        return found


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
        told = codec.parsed(text)
        found = codec.from_json(_Export, told if isinstance(told, dict) else {"requirements": told})
    except codec.Unreadable as error:
        found_at = re.search(r"line (\d+) column (\d+)", str(error))
        line, column = (int(found_at[1]), int(found_at[2])) if found_at else (1, 1)
        span = Span(str(path), line, column, line, column + 1)
        raise Rejected(Diagnostic("FRET001", f"{path} is no export of FRET's: {error}", span)) from None
    requirements = (
        Requirement(r.reqid or f"R{k}", r.fulltext, _place(text, r.fulltext, str(path)), r.project or "")
        for k, r in enumerate(found.requirements, start=1)
    )
    return Project(tuple(requirements), tuple(_given(v) for v in found.variables if v.idType))


@dataclass(frozen=True, slots=True)
class _Requirement(codec.Foreign):
    fulltext: str
    reqid: str | None = None
    project: str | None = None


@dataclass(frozen=True, slots=True)
class _Variable(codec.Foreign):
    variable_name: str
    component_name: str
    project: str | None = None
    idType: str | None = None  # noqa: N815 - FRET's own names
    dataType: str | None = None  # noqa: N815
    assignment: str | None = None
    modeRequirement: str | None = None  # noqa: N815


@dataclass(frozen=True, slots=True)
class _Export(codec.Foreign):
    """An export from FRET; in some versions only the requirements."""

    requirements: tuple[_Requirement, ...]
    variables: tuple[_Variable, ...] = ()


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


def _given(v: _Variable) -> tuple[tuple[str, str, str], Given]:
    means = v.modeRequirement if v.idType == "Mode" else v.assignment
    kind = _TYPES.get(v.dataType or "", "")
    return (v.project or "", v.component_name, v.variable_name), Given(v.idType or "", kind, means or "")


_TYPES = {
    "boolean": "BOOL",
    "integer": "INTEGER",
    "unsigned integer": "NATURAL",
    "double": "REAL",
    "single": "REAL",
}


@dataclass(frozen=True, slots=True)
class Nodes:
    """The contract's text, and diagnostics for sentences that it does not contain, or whose meaning few expect."""

    text: str
    faults: tuple[Diagnostic, ...]


def nodes(project: Project, outputs: frozenset[str] = frozenset()) -> Nodes:
    """The nodes; among the names without an entry in FRET, `outputs` are outputs, if any are given. Raises Rejected."""
    faults: list[Diagnostic] = []
    components: dict[str, tuple[str, str, list[tuple[Requirement, Sentence]]]] = {}
    if not project.requirements:
        raise Rejected(Diagnostic("FRET001", "there is no sentence in the file"))
    for requirement in project.requirements:
        try:
            sentence = parse(requirement.text)
        except Unreadable as error:
            place = replace(requirement.span, column=requirement.span.column + error.column - 1)
            faults.append(Diagnostic("FRET002", f"{requirement.name}: {error.message}", place, hint=FORM))
            continue
        word = _word(sentence.component)
        of, component, found = components.setdefault(word, (requirement.project, sentence.component, []))
        if (of, component) != (requirement.project, sentence.component):
            what = (
                _clash(component, sentence.component, word)
                if of == requirement.project
                else (
                    f"component `{component}` of project {of or '(none)'} and `{sentence.component}` of "
                    f"{requirement.project or '(none)'} would be one node: export one project at a time"
                )
            )
            faults.append(Diagnostic("FRET003", f"{requirement.name}: {what}", requirement.span))
            continue
        found.append((requirement, sentence))
        faults += [
            Diagnostic("FRET004", f"{requirement.name}: {text}", requirement.span, Severity.WARNING)
            for text in remarks(sentence)
        ]
    constants: dict[str, str] = {}
    words: dict[str, str] = {}
    texts = [
        _Node(component, found, project.of(of, component), outputs, constants, words, faults).text()
        for of, component, found in components.values()
    ]
    text = _context(constants) + "\n".join(filter(None, texts))
    if not any(texts):
        return Nodes("", tuple(faults))
    _, told = check_text(text, "fretish.rcl")
    if wrong := [d for d in told if d.is_error]:
        raise Rejected(*faults, Diagnostic("FRET003", f"the nodes together are no RCL: {wrong[0].message}"))
    return Nodes(format_text(text, "fretish.rcl"), tuple(faults))


@dataclass(slots=True)
class _Node:
    """One component's ports and clauses."""

    component: str
    found: list[tuple[Requirement, Sentence]]
    given: Mapping[str, Given]
    outputs: frozenset[str]
    """Those that the user names; empty: what the responses mention."""
    constants: dict[str, str]
    words: dict[str, str]
    """RCL's names, each with FRET's. These two are shared by all nodes: outputs feed inputs of their name."""
    faults: list[Diagnostic]
    types: dict[str, str] = field(default_factory=dict)
    same: list[tuple[str, str]] = field(default_factory=list)
    ports: dict[str, str] = field(default_factory=dict)
    """The names that clauses use, each with `in` or `out`."""
    scoped: bool = False
    within: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.outputs = self.outputs or frozenset(n for _, s in self.found for n in _names(_answered(s.response)))

    def text(self) -> str:
        for _, sentence in self.found:
            for part in (sentence.response, sentence.mode, sentence.trigger, sentence.stop):
                if part is not None:
                    self._truth(part)
        self._spread()
        clauses: list[str] = []
        taken: set[str] = set()
        sources: dict[str, Requirement] = {}
        for requirement, sentence in self.found:
            self.scoped = sentence.scope is not Scope.ALWAYS
            try:
                for demand in demands(sentence, self._say):
                    name = _unused(_word(requirement.name) + demand.suffix, taken)
                    clauses.append(self._clause(name, requirement, demand.formula))
                    sources[clauses[-1]] = requirement
            except Unsaid as error:
                self.faults.append(Diagnostic("FRET003", f"{requirement.name}: {error}", requirement.span))
        clauses = [clause for clause in clauses if self._sound(clause, sources[clause])]
        clauses.sort(key=lambda clause: not clause.lstrip().startswith("assume"))
        return self._written(clauses) if clauses else ""

    def _clause(self, name: str, requirement: Requirement, formula: str) -> str:
        said = quote(" ".join(requirement.text.split()))
        return f"  {'assume' if is_assumption(requirement.name) else 'guarantee'} {name} {said} ( {formula} )"

    def _sound(self, clause: str, source: Requirement) -> bool:
        """Whether the checker accepts the clause; otherwise its error is the reason why the clause is left out."""
        besides = [] if clause.lstrip().startswith("guarantee") else ["  guarantee ( TRUE )"]
        found, diagnostics = check_text(self.context() + self._written([clause, *besides]), "fretish.rcl")
        if found is not None:
            return True
        error = next(d for d in diagnostics if d.is_error)
        message = f"{source.name}: its clause is no RCL: {error.message}"
        self.faults.append(Diagnostic("FRET003", message, source.span, hint=error.hint))
        return False

    def _written(self, clauses: list[str]) -> str:
        def listed(side: str) -> str:
            shown = ", ".join(f"{_word(n)} : {self._type(n)}" for n, of in sorted(self.ports.items()) if of == side)
            return f"( {shown} )" if shown else "()"

        head = f"node {_word(self.component)} {{\n  inputs{listed('in')}\n  outputs{listed('out')}\n  topics()\n"
        return f"{head}{chr(10).join(clauses)}\n}}\n"

    def context(self) -> str:
        return _context(self.constants)

    # -- types ---------------------------------------------------------------------------------------------------------

    def _truth(self, part: Expression) -> None:
        match part:
            case Expression(sign="name", text=name):
                self.types.setdefault(name, "BOOL")
            case Expression(sign="=" | "!=", parts=(Expression(sign="name") as left, Expression(sign="name") as right)):
                self.same.append((left.text, right.text))
            case (
                Expression(sign="!" | "=>" | "<=>" | "|" | "&" | "xor", parts=parts)
                | Expression(sign="call", text="preBool", parts=parts)
            ):
                for each in parts:
                    self._truth(each)
            case Expression(sign="call", text=text, parts=parts) if text not in ("preInt", "preReal"):
                for each in parts[1:]:  # persisted(n, p), occurred(n, p)
                    self._truth(each)
            case _:  # of numbers
                for name in _names(part):
                    self.types.setdefault(name, "REAL")

    def _spread(self) -> None:
        """Names that are compared have one type."""
        for _ in self.same:
            for left, right in (pair for one, other in self.same for pair in ((one, other), (other, one))):
                if left not in self.types and (known := self.given.get(right, Given()).type or self.types.get(right)):
                    self.types[left] = known

    def _type(self, name: str) -> str:
        return self.given.get(name, Given()).type or self.types.get(name, "REAL")

    # -- words ---------------------------------------------------------------------------------------------------------

    def _say(self, part: Expression) -> str:
        match part:
            case Expression(sign="name", text=name):
                return self._named(name)
            case Expression(sign="number" | "truth", text=text):
                return text
            case Expression(sign="call", text=name, parts=arguments):
                return self._called(name, [self._say(a) for a in arguments])
            case Expression(sign="^"):
                raise Unsaid("`^` has no counterpart: write the product")
            case Expression(sign="mod" | "xor" as function, parts=parts):
                return f"{function}({', '.join(map(self._say, parts))})"
            case Expression(sign=sign, parts=(body,)):
                return f"({_SIGNS.get(sign, sign)}{self._say(body)})"
            case Expression(sign=sign, parts=parts):
                return f"({f' {_SIGNS.get(sign, sign)} '.join(map(self._say, parts))})"

    def _called(self, name: str, arguments: list[str]) -> str:
        match name, arguments:
            case (("preBool" | "preInt" | "preReal"), [first, value]):
                return f"previous({value}, {first})"
            case (("persisted" | "occurred"), [_, _]) if self.scoped:
                raise Unsaid(
                    f"inside a scope `{name}` looks back to the scope's beginning only, which no clause here says"
                )
            case (("persisted" | "occurred"), [steps, formula]):
                return f"{'held' if name == 'persisted' else 'once'}[{steps} steps]({formula})"
            case (("abs" | "absInt" | "absReal"), [_]):
                return f"abs({arguments[0]})"
            case (("min" | "minInt" | "minReal" | "max" | "maxInt" | "maxReal"), [_, _]):
                return f"{name[:3]}({', '.join(arguments)})"
            case _:  # a function known only to FRET's user, or one that looks ahead
                raise Unsaid(f"Avow does not know the function `{name}` of {len(arguments)} arguments")

    def _named(self, name: str) -> str:
        if name == FIRST and name not in self.given:
            return "rose(TRUE)"
        if (other := self.words.setdefault(_word(name), name)) != name:
            raise Unsaid(_clash(other, name, _word(name)))
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
        """The definition of a name, which FRET has as an expression of Lustre."""
        if name in self.within:
            raise Unsaid(f"`{name}` is defined by itself")
        if len(self.within) > _DEEPEST:
            raise Unsaid(f"`{name}` is defined through more than {_DEEPEST} other names")
        if (found := re.search(r"(?<!<)->|--", means)) is not None:
            reason = {"->": "speaks of the first step", "--": "begins a comment"}[found[0]]
            raise Unsaid(f"what `{name}` stands for is not read: `{found[0]}` {reason} in Lustre")
        said = re.sub(r"\bnot\b", "!", re.sub(r"\band\b", "&", re.sub(r"\bor\b", "|", means)))
        before = self.within
        self.within = (*before, name)
        try:
            expression = parse_expression(said)
            self._truth(expression)
            return f"({self._say(expression)})"
        except Unreadable as error:
            raise Unsaid(f"what `{name}` stands for is not read: {error.message} in `{means[:80]}`") from None
        finally:
            self.within = before


def _context(constants: Mapping[str, str]) -> str:
    lines = "".join(f"  {_word(name)} = {value};\n" for name, value in sorted(constants.items()))
    return f"context {{\n{lines}}}\n\n" if lines else ""


_DEEPEST = 20
"""The depth of nested definitions that are followed."""

_SIGNS = {"=>": "->", "&": "and", "|": "or", "=": "==", "!": "not "}


def _answered(response: Expression) -> Expression:
    """The demand of a response, without its own condition."""
    while response.sign == "=>":
        response = response.parts[-1]
    return response


def _names(part: Expression) -> Iterable[str]:
    if part.sign == "name":
        yield part.text
    for each in part.parts:
        yield from _names(each)


def _clash(one: str, other: str, word: str) -> str:
    return f"`{one}` and `{other}` would both be `{word}` in RCL: rename one of them"


def _word(name: str) -> str:
    """A FRET name as an RCL name."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    word = word if re.match(r"[A-Za-z]", word) else f"r{word}"
    return f"{word}_" if word in KEYWORDS or word in _OPERATORS else word


_OPERATORS = {*Past, *Builtin, *CALLED, "implies", "true", "false", "topics"}
"""Words that have a meaning in RCL in some places."""


def _unused(name: str, taken: set[str]) -> str:
    k = 2
    word = name
    while word in taken:
        word, k = f"{name}_{k}", k + 1
    taken.add(word)
    return word
