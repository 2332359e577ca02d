"""Finds what a hand-written Dafny file leaves unproved without a message from Dafny.

Dafny accepts `assume`, `{:axiom}`, `{:verify false}`, a missing body… without proof and reports success. Each of them
becomes a hypothesis of every result from the file, shown as such. The scan works on tokens, so that comments and
strings have no effect on it. Anything not known to be harmless counts as an open hypothesis.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePosixPath

from avow.base.records import dataclass

HARMLESS = frozenset({"autotriggers", "fuel", "induction", "opaque", "split", "tailrecursion", "timeLimit", "trigger"})
"""Attributes that guide the prover or the compiler and assume nothing."""
SYNTAX = re.compile(r'"--function-syntax:[34]"')
"""The one option that a module may set: it only selects the spelling of ghost functions."""

_CALLABLES = frozenset({"method", "lemma", "colemma", "constructor", "function", "predicate", "copredicate"})
_MODIFIERS = frozenset(
    {"ghost", "static", "protected", "inductive", "twostate", "least", "greatest", "abstract", "opaque"}
)
MEMBERS = _CALLABLES | _MODIFIERS | {"const", "type", "module", "datatype", "codatatype", "newtype", "class", "import"}
"""Words that begin another member."""
_DIRECTIVE = re.compile(r"\s*#(?:if|else|elsif|endif)")
_TOKEN = re.compile(
    r"""
    (?P<space>\s+|//[^\n]*)
  | (?P<string>@"(?:[^"]|"")*"|"(?:[^"\\\n]|\\.)*")
  | (?P<word>[A-Za-z_][\w'?]*)
  | (?P<number>0x[\da-fA-F_]+|\d[\d_]*(?:\.\d+)?)
  | (?P<char>'(?:[^'\\\n]|\\[^\n][^'\n]*)')
  | (?P<sign>:=|==|!=|<=|>=|:\||::|=>|==>|<==>|\.\.|.)
    """,
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Token:
    kind: str
    text: str
    line: int
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Scan:
    """The content of the file. Lines count from 1."""

    hypotheses: tuple[tuple[int, str], ...]
    """Its unproved assumptions."""
    problems: tuple[tuple[int, str], ...]
    """Why it cannot be an implementation at all."""
    members: tuple[tuple[str, str], ...]
    """(kind, name) of every method and lemma that it declares: each must be found proved."""
    environment: str | None
    """The body of the implementation's own `Env`, or None if it has none."""
    text: str
    """The file with its includes of generated files blanked out: the generated files are given to Dafny directly."""


def scan(
    text: str,
    spec_module: str,
    impl_module: str,
    generated: Sequence[str],
    lemmas: Sequence[str] = ("EnvNotEmpty",),
) -> Scan:
    """`generated` are the names of the generated files, `lemmas` those that an implementation has to provide."""
    # Dafny reads a lone carriage return as the end of a line, and thus of a comment.
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return _Scanner(text, spec_module, impl_module, generated, lemmas).scan()


def tokens(text: str) -> list[Token]:
    """The file's tokens without comments; nested comments end where Dafny ends them."""
    found: list[Token] = []
    position, line = 0, 1
    while position < len(text):
        if text.startswith("/*", position):
            end = _comment_end(text, position)
        else:
            match = _TOKEN.match(text, position)
            assert match is not None  # the last alternative takes any character
            end = match.end()
            kind = match.lastgroup or "sign"
            if match.group() == ":" and found and found[-1].text == "{":
                # The start of an attribute, also if it contains spaces; nothing else begins like that.
                found[-1] = Token("sign", "{:", found[-1].line, found[-1].start, end)
            elif kind != "space":
                found.append(Token(kind, match.group(), line, position, end))
        line += text.count("\n", position, end)
        position = end
    return found


def _comment_end(text: str, start: int) -> int:
    depth, position = 0, start
    while position < len(text):
        if text.startswith("/*", position):
            depth, position = depth + 1, position + 2
        elif text.startswith("*/", position):
            depth, position = depth - 1, position + 2
            if depth == 0:
                return position
        else:
            position += 1
    return position


def resolved_environment(program: str, module: str) -> str | None:
    """The body of `Env` in that module, from the program that Dafny prints after resolution and refinement; None if
    there is not exactly one."""
    return _body_of_env(program, tokens(program), module)


def matching(found: Sequence[Token], at: int) -> int:
    """The index of the bracket that closes the one at `at`, or of the last token."""
    depth = 0
    for position in range(at, len(found)):
        text = found[position].text
        depth += (text in ("(", "{", "[", "{:")) - (text in (")", "}", "]"))
        if depth == 0:
            return position
    return len(found) - 1


def _body_of_env(text: str, found: Sequence[Token], module: str) -> str | None:
    """The body of the module's own `Env`: those in classes, nested modules, or other modules do not count."""
    at, bodies, modules = 0, list[str | None](), 0
    while at < len(found):
        if found[at].text == "module":
            name = at + 1
            while name < len(found) and found[name].text == "{:":
                name = matching(found, name) + 1
            opened = next((k for k in range(name, len(found)) if found[k].text == "{"), None)
            if opened is not None and name < len(found) and found[name].text == module:
                modules += 1
                bodies += _envs(text, found, opened + 1, matching(found, opened))
            if opened is not None:
                at = opened
        # tokens in brackets are not at the top level
        at = matching(found, at) + 1 if found[at].text in ("{", "{:", "(", "[") else at + 1
    return bodies[0] if modules == 1 and len(bodies) == 1 else None


def _envs(text: str, found: Sequence[Token], at: int, end: int) -> list[str | None]:
    bodies: list[str | None] = []
    while at < end:
        if found[at].text in ("predicate", "function", "copredicate"):
            name = at + 1
            while found[name].text in ("{:", "method"):
                name = (matching(found, name) if found[name].text == "{:" else name) + 1
            if found[name].text == "Env":
                bodies.append(_body(text, found, name + 1, end))
        at = matching(found, at) + 1 if found[at].text in ("{", "{:", "(", "[") else at + 1
    return bodies


def _body(text: str, found: Sequence[Token], at: int, end: int) -> str | None:
    """The first braces after a name, if another member, or nothing, follows them: else they are part of a clause, and
    the body is not guessed."""
    while at < end and found[at].text != "{" and found[at].text not in MEMBERS:
        at = (matching(found, at) if found[at].text in ("(", "[", "{:") else at) + 1
    closed = matching(found, at)
    if at >= end or found[at].text != "{" or not (closed + 1 >= end or found[closed + 1].text in MEMBERS):
        return None
    inside = tokens(text[found[at].end : found[closed].start])
    spaced = [f"{' ' if k and inside[k - 1].end < token.start else ''}{token.text}" for k, token in enumerate(inside)]
    return "".join(spaced)


class _Scanner:
    def __init__(
        self, text: str, spec_module: str, impl_module: str, generated: Sequence[str], lemmas: Sequence[str]
    ) -> None:
        self.text = text
        self.lemmas = lemmas
        self.tokens = tokens(text)
        self.spec_module, self.impl_module = spec_module, impl_module
        self.generated = frozenset(generated)
        # The specification uses qualified names, so only these must not be redeclared.
        self.names = frozenset({"Types", "Contract", spec_module})
        self.hypotheses: list[tuple[int, str]] = []
        self.problems: list[tuple[int, str]] = []
        self.members: list[tuple[str, str]] = []

    def scan(self) -> Scan:
        blanked = self.text
        for number, line in enumerate(self.text.split("\n"), 1):
            if _DIRECTIVE.match(line):  # also within an apparent comment: it may remove the comment
                self.hypotheses.append((number, "a preprocessor directive hides text from one reader or the other"))
        for at, token in enumerate(self.tokens):
            match token.text:
                case "assume" | "expect" if token.kind == "word":
                    self.open(token, f"'{token.text}' takes for granted what it says")
                case "{:":
                    self.attribute(at)
                case "@" if self.word(at + 1):
                    self.open(token, f"attribute @{self.tokens[at + 1].text}")
                case "decreases" | "witness" if self.text_at(at + 1) == "*":
                    what = "termination is not shown" if token.text == "decreases" else "a type may be empty"
                    self.open(token, f"'{token.text} *': {what}")
                case "include" if token.kind == "word":
                    blanked = self.include(at, blanked)
                case "trait" | "iterator" | "abstract" if token.kind == "word":
                    what = f"{token.text} module" if token.text == "abstract" else token.text
                    self.open(token, f"'{what}' may have members without bodies")
                case _ if token.kind == "word":
                    self.declaration(at)
        self.module()
        return Scan(tuple(self.hypotheses), tuple(self.problems), tuple(self.members), self.environment(), blanked)

    def attribute(self, at: int) -> None:
        """``{:name …}``; its arguments run to the matching brace."""
        name = self.text_at(at + 1)
        inside: list[Token] = []
        depth, position = 1, at + 2
        while position < len(self.tokens) and depth:
            text = self.tokens[position].text
            depth += (text in ("{", "{:")) - (text == "}")
            inside.append(self.tokens[position])
            position += 1
        if name == "options" and len(inside) == 2 and SYNTAX.fullmatch(inside[0].text):
            return
        if name not in HARMLESS:
            self.open(self.tokens[at], f"attribute {{:{name}}}")

    def include(self, at: int, text: str) -> str:
        """Blanks out the inclusion of a generated file, at any path: those are on Dafny's command line."""
        token, following = self.tokens[at], self.tokens[at + 1] if at + 1 < len(self.tokens) else None
        if following is None or following.kind != "string":
            return text
        name = following.text.lstrip("@").strip('"')
        if PurePosixPath(name.replace("\\", "/")).name not in self.generated:
            self.open(token, f"includes {name}, which is not verified with it")
            self.problems.append((token.line, f"includes {name}; only the generated files may be included"))
            return text
        stretch = text[token.start : following.end]
        return text[: token.start] + re.sub(r"[^\n]", " ", stretch) + text[following.end :]

    def declaration(self, at: int) -> None:
        token = self.tokens[at]
        before = self.text_at(at - 1)
        if before in (".", ":", ",", "(", "::", "<"):
            return
        if token.text in _CALLABLES and before != "type":
            kind = token.text
            if kind in ("function", "predicate") and self.text_at(at + 1) == "method":
                return  # the following word `method` is visited next
            if kind == "method" and before in ("function", "predicate"):
                kind = before
            if kind == "predicate" and before in ("inductive", "least", "greatest"):
                kind = "copredicate"
            self.member(at, kind)
        elif token.text == "const":
            self.constant(at)
        elif token.text == "type" and before not in (".",):
            self.type(at)
        elif token.text in ("datatype", "codatatype", "newtype", "class", "import"):
            name = self.name_after(at)
            if name is not None:
                self.redeclared(name)

    def member(self, at: int, kind: str) -> None:
        name = self.name_after(at)
        if name is None:
            return  # an anonymous constructor, or the word in another use
        self.redeclared(name)
        if kind in ("method", "lemma", "colemma", "constructor"):
            self.members.append((kind, name.text))

    def constant(self, at: int) -> None:
        """A constant without a value may be any value of its type, even if there is none."""
        name = self.name_after(at)
        if name is None:
            return
        self.redeclared(name)
        for following in self.tokens[at + 1 :]:
            if following.text == ":=":
                return
            if following.text in _CALLABLES | _MODIFIERS | {"const", "type", "module", "}", "datatype", "class", ";"}:
                break
        self.open(self.tokens[at], f"constant {name.text} has no value")

    def type(self, at: int) -> None:
        name = self.name_after(at)
        if name is None or self.text_at(at - 1) in ("{:", "opened"):
            return
        self.redeclared(name)
        position = self.tokens.index(name) + 1
        if self.text_at(position) == "(":
            position = matching(self.tokens, position) + 1
        if self.text_at(position) == "<":
            while position < len(self.tokens) and self.text_at(position) not in ("=", "{", "}"):
                position += 1
        if self.text_at(position) != "=":
            self.open(self.tokens[at], f"type {name.text} is left open")

    def redeclared(self, name: Token) -> None:
        if name.text in self.names:
            self.problems.append((name.line, f"declares {name.text} anew, which is a name of the generated modules"))
            self.open(name, f"declares {name.text} anew")

    def module(self) -> None:
        """Check that the implementation's module, which refines the generated one, is at the top level, once."""
        depth, found, named = 0, 0, None
        for at, token in enumerate(self.tokens):
            if token.text in ("{", "{:"):
                depth += 1
            elif token.text == "}":
                depth -= 1
            elif token.text == "module" and token.kind == "word":
                position = at + 1
                while self.text_at(position) == "{:":
                    while position < len(self.tokens) and self.text_at(position) != "}":
                        position += 1
                    position += 1
                name = self.text_at(position)
                if name in self.names:
                    self.problems.append((token.line, f"declares the module {name} anew"))
                    self.open(token, f"declares the module {name} anew")
                named = named or name
                refined = (self.text_at(position + 1), self.text_at(position + 2), self.text_at(position + 3))
                if name == self.impl_module and refined == ("refines", self.spec_module, "{") and depth == 0:
                    found += 1
                    if self.text_at(at - 1) == "abstract":
                        self.problems.append((token.line, "the implementation's module is abstract"))
        if found != 1:
            there = f"; there is a module {named}" if named and named != self.impl_module else ""
            wanted = f"module {self.impl_module} refines {self.spec_module}"
            self.problems.append((1, f"the file must hold '{wanted}' once, at the top{there}"))
        for kind, name in (*(("lemma", each) for each in self.lemmas), ("method", "Step")):
            if (kind, name) not in self.members:
                self.problems.append((1, f"{kind} {name} is missing"))

    def environment(self) -> str | None:
        """The text between the braces of `predicate Env(…) { … }`, of the implementation's module itself."""
        return _body_of_env(self.text, self.tokens, self.impl_module)

    def name_after(self, at: int) -> Token | None:
        position = at + 1
        while self.text_at(position) == "{:":
            position = matching(self.tokens, position) + 1
        if self.text_at(position) == "opened":
            position += 1
        token = self.tokens[position] if position < len(self.tokens) else None
        return token if token is not None and token.kind == "word" else None

    def word(self, at: int) -> bool:
        return at < len(self.tokens) and self.tokens[at].kind == "word"

    def text_at(self, at: int) -> str:
        return self.tokens[at].text if 0 <= at < len(self.tokens) else ""

    def open(self, token: Token, what: str) -> None:
        self.hypotheses.append((token.line, what))
