"""Finds a file's clauses by their keywords and brackets, and parses each separately.

This is the parser's error recovery: an error inside a clause ends with the clause, so that all errors of a file are
reported in one run and a broken node does not hide the next. Section keywords are reserved, so they begin a section
even if a bracket before them was never closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from avow.base.suggestions import nearest
from avow.language.contract import ClauseKind
from avow.language.expectations import SECTION_FORMS, about_keyword
from avow.language.lexer import Token
from avow.language.parser import parse
from avow.language.source import Reports
from avow.language.syntax import (
    ChanceSyntax,
    ClauseSyntax,
    Declaration,
    Define,
    FileSyntax,
    NodeSyntax,
    PortList,
    TopicList,
)

_OPEN = {"LPAR": "RPAR", "LBRACE": "RBRACE"}
_NESTED = {**_OPEN, "LSQUARE": "RSQUARE"}
_CLOSE = frozenset(_OPEN.values())
_TOP = frozenset(("CONTEXT", "NODE"))
_ORDER = {"INPUTS": 0, "OUTPUTS": 1, "TOPICS": 2, "STEPS": 3, "DEFINE": 4, "ASSUME": 5, "GUARANTEE": 6}
_LISTS = ("INPUTS", "OUTPUTS", "TOPICS")
_CLAUSES = {"ASSUME": ClauseKind.ASSUMPTION, "GUARANTEE": ClauseKind.GUARANTEE}
_SECTIONS = frozenset((*_LISTS, "DEFINE", *_CLAUSES))
_CONTEXTS = frozenset(("context", "contexts", "type", "types", "constant", "constants"))
"""Words that earlier tools and authors use for `context`."""
_CHANCE = "write `guarantee NAME with probability >= 0.99 given (F) ( G )`; `given (F)` may be left out"
_SIGN = {"LPAR": "(", "RPAR": ")", "LBRACE": "{", "RBRACE": "}"}


def read(tokens: Sequence[Token], reports: Reports) -> FileSyntax:
    """The clauses of a file, with every syntax error in them reported."""
    return _OutlineReader(tokens, reports).file()


class _OutlineReader:
    def __init__(self, tokens: Sequence[Token], reports: Reports) -> None:
        self.tokens = tokens
        self.reports = reports
        self.at = 0
        self.complained = -1
        self.innermost: Token | None = None
        """The bracket that the last call of `balanced` found closed by one of another kind."""
        self.out = FileSyntax()

    # --- looking at tokens -------------------------------------------------------------------------------------------

    def kind(self, ahead: int = 0) -> str:
        at = self.at + ahead
        return self.tokens[at].type if at < len(self.tokens) else "$END"

    def found(self, at: int) -> tuple[str, int, int]:
        """The token at a position as text for messages, and its place."""
        if at >= len(self.tokens):
            end = self.tokens[-1].end if self.tokens else 0
            return "the end of the file", end, end
        token = self.tokens[at]
        return f"`{token.text[:40]}`", token.start, token.end

    def complain(self, code: str, message: str, hint: str | None = None) -> None:
        """Reports the token here, `%` in the message, unless it is a consequence of what was reported before."""
        words, start, end = self.found(self.at)
        near = self.tokens[self.at - 1].start if 0 < self.at <= len(self.tokens) else start
        if self.reports.is_torn(near, end) or start in self.reports.odd or start == self.complained:
            return
        self.complained = start
        self.reports.error(code, message.replace("%", words, 1), start, end, hint=hint)

    # --- the file ----------------------------------------------------------------------------------------------------

    def file(self) -> FileSyntax:
        contexts = 0
        if not self.tokens and not self.reports.failed:
            self.reports.error("RCL001", "there is no contract here: neither a context nor a node", 0, 0)
        while self.at < len(self.tokens) and not self.reports.full:
            match self.clause():
                case "CONTEXT":
                    contexts += self.kind() == "CONTEXT"
                    if contexts > 1:
                        self.complain("RCL112", "a second `context` in one file", "put all into one `context`")
                    self.at += 1
                    self.context()
                case "NODE":
                    self.node()
                case _:  # reported: continue at the next clause
                    self.skip_to_top()
        return self.out

    def clause(self) -> str:
        """The kind of clause that begins here, or that a word seems to mean; empty, and reported, if there is none."""
        kind = self.kind()
        if kind in _TOP:
            return kind
        hint = "a file is one `context { … }` and any number of `node NAME { … }`"
        message, meant = "expected `context` or `node` and not %", ""
        if kind == "NAME" and self.kind(1) == "LBRACE" and self.tokens[self.at].text.lower() in _CONTEXTS:
            hint, meant = (
                "types (`Name : type;`) and constants (`Name = value;`) belong in one `context { … }`",
                "CONTEXT",
            )
        elif kind == "NAME" and self.kind(1) == "NAME" and self.kind(2) == "LBRACE":
            hint, meant = "write `node`", "NODE"
        elif kind in _SECTIONS:
            hint = "this belongs inside a `node NAME { … }`"
        elif kind in _CLOSE:
            message, hint = "% closes nothing", "remove it, or find where a bracket was closed too early"
        self.complain("RCL111", message, hint)
        return meant

    def skip_to_top(self) -> None:
        """Skips the token here and all up to the next possible beginning of a clause."""
        self.at += 1
        while self.at < len(self.tokens) and self.kind() not in _TOP:
            if self.kind() == "NAME" and (
                self.kind(1) == "LBRACE" or (self.kind(1), self.kind(2)) == ("NAME", "LBRACE")
            ):
                return
            self.at += 1

    def open_brace(self, what: str) -> Token | None:
        if self.kind() != "LBRACE":
            hint = "write `{` there" if self.kind() in _SECTIONS else "names are made of letters, digits and `_`"
            self.complain("RCL113", f"expected `{{` after {what} and not %", hint)
            for ahead in range(1, 5):  # the rest of an invalid name
                if self.kind(ahead) in _SECTIONS or (self.kind(ahead) in _TOP and self.kind(ahead - 1) != "MINUS"):
                    return None
                if self.kind(ahead) == "LBRACE":
                    self.at += ahead
                    break
            else:
                return None
        self.at += 1
        return self.tokens[self.at - 1]

    # --- context -----------------------------------------------------------------------------------------------------

    def context(self) -> None:
        brace = self.open_brace("`context`")
        count = 0
        while self.at < len(self.tokens) and self.kind() not in _TOP and not self.reports.full:
            if self.kind() == "RBRACE":
                if count == 0 and brace is not None:
                    self.reports.error("RCL114", "this context declares nothing", brace.start, brace.end)
                self.at += 1
                return
            if self.kind() == "SEMICOLON":
                self.complain("RCL113", "% ends nothing here", "remove it")
                self.at += 1
                continue
            count += 1
            tree = self.declaration(self.out.broken)
            if tree is not None:
                self.out.declarations.append(tree)
        if brace is not None:
            self.reports.error("RCL115", "this `{` is never closed", brace.start, brace.end, hint="close it with `}`")

    def declaration(self, broken: set[str]) -> Declaration | None:
        """The declaration here, up to its `;`; if it has errors, its names go to `broken`."""
        first, relation = self.at, False
        stack: list[str] = []
        while self.at < len(self.tokens):
            kind = self.kind()
            if kind in _TOP or (kind in _SECTIONS and not (kind == "DEFINE" and self.at == first)):
                break
            if kind == "SEMICOLON" and "RPAR" not in stack:  # also within `{`: that brace lacks its partner
                break
            if kind == "RBRACE" and not stack:
                break
            if kind in ("COLON", "EQUALS", "EQ") and not stack and self.tokens[first].type != "DEFINE":
                if relation and self.kind(-1) == "NAME":
                    self.at -= 1  # the name before belongs to the next declaration
                    break
                relation = True
            if kind in _NESTED:
                stack.append(_NESTED[kind])
            elif kind in _NESTED.values() and stack:
                stack.pop()
            self.at += 1
        if self.at == first:  # a keyword where a declaration should begin
            self.complain("RCL113", "expected a declaration and not %", "write `Name : type;` or `Name = value;`")
            self.skip_to_top()
            return None
        part = self.tokens[first : self.at]
        begin = self.tokens[first - 1].end if first else 0
        tree: Declaration | None = parse("declaration", part, self.reports, part[-1].end, begin)
        self.out.parts.append((part[0].start, part[-1].end))
        if tree is None:
            broken.update(t.text for t in part if t.type == "NAME")
        if self.kind() == "SEMICOLON":
            self.at += 1
        elif tree is not None:
            end = part[-1].end
            message = f"`;` is missing after the declaration of `{tree.name.text}`"
            self.reports.error("RCL113", message, end - 1, end, hint="end every declaration with `;`")
        return tree

    # --- node --------------------------------------------------------------------------------------------------------

    def node(self) -> None:
        start = self.tokens[self.at].start
        self.at += 1
        if self.kind() == "NAME":
            node = NodeSyntax(self.tokens[self.at], start)
            self.at += 1
        else:
            hint = "write `node NAME {`, with a name of letters, digits and `_`, without quotation marks"
            self.complain("RCL113", "expected the node's name and not %", self.about_keyword(hint))
            node = NodeSyntax(Token("NAME", "", start, start), start)
            if self.kind() not in ("LBRACE", *_TOP) and self.kind(1) == "LBRACE":
                self.at += 1
        brace = self.open_brace("the node's name")
        self.out.nodes.append(node)
        before, seen, closed = "", dict[str, Token](), False
        while self.at < len(self.tokens) and self.kind() not in _TOP and not self.reports.full:
            if self.kind() == "RBRACE":
                self.at += 1
                closed = True
                break
            section = self.section() or self.meant_section()
            if section is None:
                self.not_a_section()
                continue
            keyword = self.tokens[self.at]
            if section in _LISTS and section in seen:
                earlier = self.reports.source.span(seen[section].start, seen[section].end)
                message = f"a second `{keyword.text}` in node `{node.name.text}`"
                notes = ((f"the first `{keyword.text}` is here", earlier),)
                self.reports.error("RCL117", message, keyword.start, keyword.end, notes=notes)
            elif before and _ORDER[section] < _ORDER[before]:
                message = f"`{keyword.text}` stands after `{before.lower()}`"
                hint = "the order is: inputs, outputs, topics, steps, definitions, assumptions, guarantees"
                self.reports.error("RCL116", message, keyword.start, keyword.end, hint=hint)
            else:
                before = section
            seen.setdefault(section, keyword)
            self.read_section(section, node)
            self.out.parts.append((keyword.start, self.tokens[self.at - 1].end))
        else:
            if brace is not None:
                message = f"the `{{` of node `{node.name.text}` is never closed"
                self.reports.error("RCL115", message, brace.start, brace.end, hint="close it with `}`")
        node.end = self.tokens[min(self.at, len(self.tokens)) - 1].end
        self.out.parts.append((node.start, node.end))
        self.missing(node, seen, closed)

    def about_keyword(self, hint: str) -> str:
        """The hint, preceded by the message for a keyword in the place of a name."""
        said = about_keyword(self.tokens[self.at]) if self.at < len(self.tokens) else None
        return f"{said}; {hint}" if said else hint

    def missing(self, node: NodeSyntax, seen: dict[str, Token], closed: bool) -> None:
        """Reports the required sections that a node lacks. In a node that is not `closed` (already reported), the last
        ones may follow later."""
        last = max((_ORDER[section] for section in seen), default=-1)
        for section in _LISTS:
            if section not in seen:
                node.broken.add("*")
                if node.name.text and (closed or _ORDER[section] < last):
                    message = f"node `{node.name.text}` has no `{section.lower()}( … )`"
                    self.reports.error("RCL118", message, node.name.start, node.name.end, hint=SECTION_FORMS[section])
        if node.name.text and "GUARANTEE" not in seen and closed:
            message = f"node `{node.name.text}` guarantees nothing"
            hint = "a node has at least one `guarantee( … )`"
            self.reports.error("RCL118", message, node.name.start, node.name.end, hint=hint)

    def section(self) -> str | None:
        kind = self.kind()
        if kind in _SECTIONS:
            return kind
        word = self.tokens[self.at].text
        if kind == "NAME" and word in ("A", "G") and self.kind(1) in ("LPAR", "NAME", "STRING"):
            return "ASSUME" if word == "A" else "GUARANTEE"
        return "STEPS" if kind == "NAME" and word == "steps" and self.kind(1) == "LPAR" else None

    def meant_section(self) -> str | None:
        """The section that a misspelt word begins: reported, and read as that section, so that nothing else is
        reported."""
        word = self.tokens[self.at].text
        if self.kind() not in ("NAME", "IN", "OUT") or self.kind(1) not in ("LPAR", "NAME", "STRING"):
            return None
        near = {"in": "inputs", "out": "outputs", "require": "assume", "requires": "assume", "ensure": "guarantee",
                "ensures": "guarantee"}.get(word.lower())  # fmt: skip
        if word[0] in "AG" and word[1:].isdigit():
            near = "assume" if word[0] == "A" else "guarantee"
        meant = [near] if near else nearest(word, [section.lower() for section in _SECTIONS])
        if not meant:
            return None
        hint = f"write `{meant[0]}`"
        if word[1:].isdigit():
            hint = f"a clause with a name is written `{meant[0]} {word}( … )`"
        self.complain("RCL113", "% begins no part of a node", hint)
        return meant[0].upper()

    def not_a_section(self) -> None:
        message = "expected `inputs`, `outputs`, `topics`, `assume`, `guarantee` or `}` and not %"
        hint = "a node has inputs, outputs, topics, assumptions and guarantees, each with parentheses"
        if self.kind() == "RPAR":
            message, hint = "this `)` closes nothing", "remove it, or find where a `(` is missing"
            if self.out.parts and self.reports.is_torn(self.out.parts[-1][0], self.tokens[self.at].end):
                self.complained = self.tokens[self.at].start  # `[0, 1)`: its partner may be unreadable
        elif self.kind() in ("SEMICOLON", "COMMA", "DOT"):
            message, hint = "% stands between the parts of a node", "remove it"
        self.complain("RCL113", message, hint)
        self.at += 1
        while self.at < len(self.tokens) and self.kind() not in (*_TOP, "RBRACE") and self.section() is None:
            if self.kind() in _OPEN:
                self.balanced()
            else:
                self.at += 1

    def balanced(self) -> int | None:
        """Moves past the bracket here and its partner; returns the partner's position, or None if it has none (then:
        where the search ended)."""
        opened = [self.tokens[self.at]]
        self.innermost = None
        self.at += 1
        while self.at < len(self.tokens):
            kind = self.kind()
            if kind in _TOP or kind in _SECTIONS:
                return None
            if kind in _OPEN:
                opened.append(self.tokens[self.at])
            elif kind in _CLOSE:
                if kind != _OPEN[opened[-1].type]:
                    self.innermost = opened[-1]
                    return None
                opened.pop()
            self.at += 1
            if not opened:
                return self.at - 1
        return None

    def read_section(self, section: str, node: NodeSyntax) -> None:
        keyword = self.tokens[self.at]
        if section == "DEFINE":
            tree = self.declaration(node.broken)
            node.definitions += [tree] if isinstance(tree, Define) else []
            return
        self.at += 1
        name = sentence = chance = None
        sound = True
        if section in _CLAUSES:
            if self.kind() == "NAME" and not self.has_chance():
                name = self.tokens[self.at]
                self.at += 1
            if self.kind() == "STRING":
                sentence = self.tokens[self.at]
                self.at += 1
            if self.has_chance():
                chance, sound = self.chance()
        if self.kind() != "LPAR":
            hint = f"write `{keyword.text}( … )`"
            if section in _CLAUSES and self.kind() not in ("LBRACE", "RBRACE", "$END"):
                hint = f'write `{keyword.text} NAME "sentence" ( … )`; the name and the sentence may be left out'
                hint = self.about_keyword(hint)
            self.complain("RCL113", f"expected `(` after `{(name or keyword).text}` and not %", hint)
            if self.kind() == "LBRACE":
                self.balanced()
            self.to_next_section(section, node, ())
            return
        opening = self.tokens[self.at]
        first = self.at + 1
        close = self.balanced()
        if close is None:
            self.unclosed(self.innermost or opening)
            self.to_next_section(section, node, self.tokens[first : self.at])
            return
        part, end = self.tokens[first:close], self.tokens[close].start
        if section == "STEPS":
            whole = (keyword.start, self.tokens[close].end)
            formula = parse("formula", self.tokens[first - 2 : close + 1], self.reports, whole[1], keyword.start)
            node.clauses.append(ClauseSyntax(ClauseKind.GUARANTEE, keyword, None, formula, whole, *whole))
        elif section in _CLAUSES:
            formula = None
            if part or self.reports.is_torn(opening.end, end):
                formula = parse("formula", part, self.reports, end, opening.end)
            else:
                message = f"this {_CLAUSES[section]} says nothing"
                hint = "write `TRUE` where the node promises nothing"
                if section == "ASSUME":
                    hint = "leave it out: no assumption means that every input is accepted"
                self.reports.error("RCL119", message, opening.start, self.tokens[close].end, hint=hint)
            whole = (keyword.start, self.tokens[close].end)
            formula = formula if sound else None
            inside = (opening.end, end)
            node.clauses.append(ClauseSyntax(_CLAUSES[section], name, sentence, formula, inside, *whole, chance))
        else:
            listing: PortList | TopicList | None
            if section == "TOPICS":
                listing = topics = parse("topics", part, self.reports, end, opening.end)
                node.topics = node.topics or topics
            else:
                start: Literal["given", "ports"] = "given" if section == "INPUTS" else "ports"
                listing = ports = parse(start, part, self.reports, end, opening.end)
                if section == "INPUTS":
                    node.inputs = node.inputs or ports
                else:
                    node.outputs = node.outputs or ports
            if listing is None:
                node.broken.update(t.text for t in part if t.type == "NAME")
            else:
                self.out.parts.extend((t.start, t.end) for t in listing.items)

    def has_chance(self) -> bool:
        """Whether ``with probability`` begins here."""
        return self.words(0) == "with" and self.words(1) == "probability"

    def words(self, ahead: int) -> str:
        return self.tokens[self.at + ahead].text if self.kind(ahead) == "NAME" else ""

    def chance(self) -> tuple[ChanceSyntax | None, bool]:
        """The probability here, and whether it has no syntax error (which is reported)."""
        start = self.tokens[self.at].start
        self.at += 2
        if (self.kind(), self.kind(1)) != ("GE", "NUMBER"):
            self.complain("RCL113", "expected `>= P` after `with probability` and not %", _CHANCE)
            return None, False
        self.at += 2
        least, given = self.tokens[self.at - 1], None
        if per_run := (self.words(0), self.words(1)) == ("per", "run"):
            self.at += 2
        if self.words(0) == "given":
            self.at += 1
            first = self.at
            self.at += (self.kind(), self.kind(1)) == ("LPAR", "RPAR")
            if self.kind() != "LPAR" or (close := self.balanced()) is None:
                self.complain("RCL113", "expected a formula in parentheses after `given` and not %", _CHANCE)
                return None, False
            part, (begin, end) = self.tokens[first + 1 : close], (self.tokens[first].end, self.tokens[close].start)
            given = parse("formula", part, self.reports, end, begin)
            if given is None:
                return None, False
        return ChanceSyntax(least, per_run, given, start, self.tokens[self.at - 1].end), True

    def unclosed(self, opening: Token) -> None:
        """Reports a bracket without partner."""
        words, start, end = self.found(self.at)
        if not self.reports.is_torn(opening.end, end):  # text that could not be read may hold the partner
            note = (f"it should be closed before {words} here", self.reports.source.span(start, end))
            hint = f"close it with `{_SIGN[_OPEN[opening.type]]}`"
            message = f"this `{_SIGN[opening.type]}` is never closed"
            self.reports.error("RCL115", message, opening.start, opening.end, hint=hint, notes=(note,))

    def to_next_section(self, section: str, node: NodeSyntax, part: Sequence[Token]) -> None:
        """Moves to where reading can resume after a section in error with these tokens."""
        if section in _LISTS:
            node.broken.update(t.text for t in part if t.type == "NAME")
            node.broken.add("*")
        while self.at < len(self.tokens) and self.kind() not in _TOP and self.section() is None:
            if self.kind() == "RBRACE" and (not part or self.kind(1) in (*_TOP, "$END", "RBRACE")):
                return
            self.at += 1
