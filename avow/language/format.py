"""``avow fmt``: the canonical layout of a file. Comments are kept, the meaning is unchanged, and formatting is
idempotent.

The layout is derived from the surface syntax, so every parenthesis, number and name is kept as written; `A` and `G` are
spelled out, and a quantifier's `;` becomes `|`. A part with a comment inside it keeps its lines, re-indented.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from itertools import pairwise, zip_longest
from typing import assert_never

from avow.base.diagnostics import Diagnostic, Rejected
from avow.language import syntax
from avow.language.flat import TEXTS, flat, without_doubled
from avow.language.lexer import Token, tokens
from avow.language.load import clean_text, unless_torn
from avow.language.outline import read
from avow.language.source import Reports, Source, in_order
from avow.language.syntax import FileSyntax

WIDTH = 120
_STEP = 2
_SHORT = {"A": "assume", "G": "guarantee"}


def format_text(text: str, file: str) -> str:
    """The text in the canonical layout. Raises `Rejected` if its syntax has errors (type errors are allowed)."""
    before = _Read(text, file)
    after = _Layout(before.source, before.stream, before.comments, before.syntax).file()
    _must_say_the_same(before, after)
    return after


class _Read:
    """A file's text, tokens, comments and syntax. Raises `Rejected` if its syntax has errors."""

    def __init__(self, text: str, file: str) -> None:
        source = clean_text(text, file)
        if isinstance(source, Diagnostic):
            raise Rejected(source)
        self.source = source
        reports = Reports(source)
        self.comments: list[Token] = []
        self.stream = tokens(reports, self.comments)
        self.syntax = read(self.stream, unless_torn(reports))
        errors = tuple(d for d in in_order(reports) if d.is_error)
        if errors:
            raise Rejected(*errors)

    def words(self) -> Iterator[tuple[str, Token]]:
        """The file's content independent of layout: its tokens without doubled parentheses, then its comments."""
        for token, after in pairwise((*without_doubled(self.stream), Token("$END", "", 0, 0))):
            is_section = token.type == "NAME" and after.type in ("LPAR", "NAME", "STRING")
            word = _SHORT.get(token.text, token.text) if is_section else TEXTS.get(token.type, token.text)
            yield word, token
        for comment in self.comments:
            yield " ".join(comment.text.split()), comment


def _must_say_the_same(before: _Read, after: str) -> None:
    """Raises `Rejected` if the text does not read back as its original."""
    try:
        again = [word for word, _ in _Read(after, before.source.file).words()]
    except Rejected:
        again = []
    for (word, token), other in zip_longest(before.words(), again, fillvalue=("", Token("", "", 0, 0))):
        if word != other:
            message = "in the canonical layout, this would not read back as the same contract; the file stays as it is"
            hint = "this is a defect of Avow: please report it"
            raise Rejected(Diagnostic("RCL007", message, before.source.span(token.start, token.end), hint=hint))


class _Layout:
    """Writes the file from left to right: each part in canonical form, after the comments that precede it."""

    def __init__(self, source: Source, stream: Sequence[Token], comments: Sequence[Token], tree: FileSyntax) -> None:
        self.text = source.text
        self.stream = stream
        self.starts = [token.start for token in stream]
        self.comments = comments
        self.next_comment = 0
        self.at = 0
        self.lines: list[str] = []
        self.declarations: dict[int, syntax.Declaration] = {tree.start: tree for tree in tree.declarations}
        self.topics: dict[int, syntax.TopicList] = {}
        self.formulas: dict[int, syntax.TermSyntax] = {}
        self.chances = {c.start: c.chance for node in tree.nodes for c in node.clauses if c.chance is not None}
        for node in tree.nodes:
            self.declarations |= {part.start: part for part in node.definitions}
            if node.topics is not None:
                self.topics[node.topics.start] = node.topics
            self.formulas |= {c.formula.start: c.formula for c in node.clauses if c.formula is not None}

    def flat(self, start: int, end: int) -> str:
        """The text between two offsets, on one line."""
        return flat(self.stream[bisect_left(self.starts, start) : bisect_left(self.starts, end)])

    def whole(self, tree: syntax.Syntax) -> str:
        return self.flat(tree.start, tree.end)

    def kind(self) -> str:
        return self.stream[self.at].type if self.at < len(self.stream) else "$END"

    # --- comments and blank lines ------------------------------------------------------------------------------------

    def blank(self) -> None:
        if self.lines and self.lines[-1] and not self.lines[-1].endswith("{"):
            self.lines.append("")

    def blank_before(self, start: int) -> bool:
        """Whether the text has an empty line before this offset."""
        gap = self.text[:start]
        return gap[len(gap.rstrip(" \t\r\n\f")) :].count("\n") > 1

    def flush(self, until: int, indent: int, *, apart: bool = False) -> None:
        """Write the comments before `until`; `apart`: put an empty line before them, or here if there are none."""
        first, closed = True, False  # closed: the line ends with a `//` comment, and takes no other one
        while self.next_comment < len(self.comments) and self.comments[self.next_comment].start < until:
            comment = self.comments[self.next_comment]
            self.next_comment += 1
            line_start = self.text.rfind("\n", 0, comment.start) + 1
            shown = self.relaid(comment.text, indent, 1)
            if self.text[line_start : comment.start].strip() and self.lines and self.lines[-1] and first and not closed:
                closed = comment.text.startswith("//")
                self.lines[-1] += "  " + shown[0]
                self.lines.extend(shown[1:])
                continue
            if (apart and first) or self.blank_before(comment.start):
                self.blank()
            first = False
            self.lines.append(" " * indent + shown[0])
            self.lines.extend(shown[1:])
        if first and apart:
            self.blank()

    def relaid(self, text: str, indent: int, further: int) -> list[str]:
        """The lines of a piece kept as is: the first without indentation, the others moved to `indent + further`."""
        first, *rest = [line.rstrip() for line in text.split("\n")]
        rest = [line[: len(line) - len(line.lstrip())].expandtabs(4) + line.lstrip() for line in rest]
        least = min((len(line) - len(line.lstrip()) for line in rest if line), default=0)
        return [first, *(" " * (indent + further) + line[least:] if line else "" for line in rest)]

    def has_comment(self, start: int, end: int) -> bool:
        at = self.next_comment
        return at < len(self.comments) and self.comments[at].start < end and self.comments[at].start > start

    # --- the file ----------------------------------------------------------------------------------------------------

    def file(self) -> str:
        while self.at < len(self.stream):
            self.flush(self.stream[self.at].start, 0, apart=True)
            if self.blank_before(self.stream[self.at].start):
                self.blank()
            head = self.stream[self.at].text
            if self.kind() == "NODE":
                self.at += 1
                head += " " + self.stream[self.at].text
            self.at += 2
            self.lines.append(head + " {")
            while self.kind() != "RBRACE":
                self.part(head == "context" or self.kind() == "DEFINE")
            self.flush(self.stream[self.at].start, _STEP)
            while self.lines and not self.lines[-1]:
                self.lines.pop()
            self.lines.append("}")
            self.at += 1
        self.flush(len(self.text) + 1, 0)
        return "\n".join(self.lines) + "\n"

    def part(self, is_declaration: bool) -> None:
        first = self.at
        depth = 0
        while True:  # up to `;` for a declaration, else the closing parenthesis
            kind = self.kind()
            depth += (kind in ("LPAR", "LBRACE")) - (kind in ("RPAR", "RBRACE"))
            self.at += 1
            given = kind == "RPAR" and self.kind() == "LPAR"
            if depth == 0 and not given and (kind == "SEMICOLON" if is_declaration else kind == "RPAR"):
                break
        own = self.stream[first : self.at]
        start, end = own[0].start, own[-1].end
        self.flush(start, _STEP)
        if self.blank_before(start):
            self.blank()
        if self.has_comment(start, end):
            while self.has_comment(start, end):
                self.next_comment += 1
            kept = self.relaid(self.text[start:end], _STEP, _STEP)
        elif is_declaration:
            kept = self.declaration(self.declarations[start])
        else:
            kept = self.section(own)
        self.lines.append(" " * _STEP + kept[0])
        self.lines.extend(kept[1:])

    def declaration(self, tree: syntax.Declaration) -> list[str]:
        match tree:
            case syntax.TypeDeclaration(type=body) | syntax.ConstantDeclaration(value=body):
                head = f"{self.flat(tree.start, body.start)} "
                lines = self.broken_set(body, _STEP + len(head), WIDTH - 1) or self.laid(body, _STEP + 2, WIDTH - 1)
            case syntax.Define(body=body):
                head = f"{self.flat(tree.start, body.start)} "
                lines = [self.whole(body)]
                if _STEP + len(head) + len(lines[0]) >= WIDTH:
                    head = head.rstrip()
                    lines = ["", *self.laid(body, _STEP + 2, WIDTH - 1)]
                    lines[1] = " " * (_STEP + 2) + lines[1]
            case _:
                assert_never(tree)
        return [head + lines[0], *lines[1:-1], lines[-1] + ";"] if len(lines) > 1 else [head + lines[0] + ";"]

    def section(self, own: Sequence[Token]) -> list[str]:
        if own[0].text == "steps":
            return [flat(own)]
        keyword = _SHORT.get(own[0].text, own[0].text)
        at = first = next(k for k, token in enumerate(own) if token.type == "LPAR")
        head = " ".join([keyword, *(token.text for token in own[1:at])])
        if (chance := self.chances.get(own[0].start)) is not None:
            at = next(k for k, token in enumerate(own) if token.start >= chance.end)
            head += f" ( {flat(own[first + 1 : at - 1])} ) " if chance.given is not None else " "
        inside = own[at + 1 : -1]
        if not inside:
            return [head + "()"]
        if keyword in ("inputs", "outputs", "topics"):
            topics = self.topics.get(inside[0].start)
            items = _ports(inside) if topics is None or keyword != "topics" else [_topic(tree) for tree in topics.items]
            line = f"{head}( {', '.join(items)} )"
            if len(items) == 1 or _STEP + len(line) <= WIDTH:
                return [line]
            pad = " " * (_STEP + len(head) + 2)
            return [f"{head}( {items[0]},", *(f"{pad}{item}," for item in items[1:-1]), f"{pad}{items[-1]} )"]
        tree = self.formulas[inside[0].start]
        line = f"{head}( {flat(inside)} )"
        if not any(token.type == "STRING" for token in own[:first]) and _STEP + len(line) <= WIDTH:
            return [line]
        lines = self.laid(tree, 2 * _STEP + 2, WIDTH - 2)
        return [head.rstrip(), *_enclosed(f"{' ' * (2 * _STEP)}( ", lines, " )")]

    # --- trees to lines ----------------------------------------------------------------------------------------------

    def laid(self, tree: syntax.Syntax, indent: int, width: int) -> list[str]:
        """The lines of a formula that begins at column `indent`; all but the first carry their indentation."""
        line = self.whole(tree)
        if indent + len(line) <= width:
            return [line]
        match tree:
            case syntax.Parentheses(body=inner):
                return _enclosed("(", self.laid(inner, indent + 1, width - 1), ")")
            case syntax.Connective(sign=syntax.Sign.AND | syntax.Sign.OR, items=items):
                sign = f"{tree.sign} "
                lines = self.laid(items[0], indent, width)
                for part in items[1:]:
                    lines += _enclosed(" " * indent + sign, self.laid(part, indent + len(sign), width), "")
                return lines
            case syntax.Connective(items=items):
                sign = f" {tree.sign}"
                lines = self.laid(items[0], indent, width - len(sign))
                for part in items[1:]:
                    lines[-1] += sign
                    last = part is items[-1]
                    deeper = indent + (_STEP if last else 0)
                    more = self.laid(part, deeper, width - (0 if last else len(sign)))
                    lines += _enclosed(" " * deeper, more, "")
                return lines
            case syntax.Lasting(left=one, right=other):
                sign = f"{self.flat(one.end, other.start)} "
                more = self.laid(other, indent + len(sign), width)
                return [*self.laid(one, indent, width), *_enclosed(" " * indent + sign, more, "")]
            case syntax.Limited(arguments=(inner,)):
                head = self.flat(tree.start, inner.start)
                return _enclosed(head, self.laid(inner, indent + len(head), width - 1), ")")
            case syntax.Negation(body=inner):
                return _enclosed("not ", self.laid(inner, indent + 4, width), "")
            case syntax.Quantification(body=inner):
                body = _enclosed(" " * (indent + _STEP), self.laid(inner, indent + _STEP, width - 1), ")")
                return [self.flat(tree.start, inner.start), *body]
            case syntax.IfThenElse(condition=condition, then=then, otherwise=otherwise):
                pad = " " * indent
                lines = _enclosed("if ", self.laid(condition, indent + 3, width), "")
                lines += _enclosed(f"{pad}then ", self.laid(then, indent + 5, width), "")
                return [*lines, *_enclosed(f"{pad}else ", self.laid(otherwise, indent + 5, width), "")]
            case _:  # a term or type, which is kept on one line
                return [line]

    def broken_set(self, tree: syntax.Syntax, indent: int, width: int) -> list[str] | None:
        """A long set over several lines, as many elements on each as fit; None if it is short or not a set."""
        if not isinstance(tree, syntax.SetType | syntax.SetDisplay) or indent + len(self.whole(tree)) <= width:
            return None
        lines = ["{"]
        pad = " " * (_STEP + _STEP)
        row = ""
        items = [self.whole(part) for part in syntax.children(tree)]
        for i, item in enumerate(items):
            piece = item + ("," if i < len(items) - 1 else "")
            if row and len(pad) + len(row) + 1 + len(piece) > width:
                lines.append(pad + row)
                row = ""
            row = f"{row} {piece}".strip()
        return [*lines, pad + row, " " * _STEP + "}"]


def _ports(found: Sequence[Token]) -> list[str]:
    """The declarations of a list of ports, each with the names that share its type."""
    items, depth, begin, typed = list[str](), 0, 0, False
    for at, token in enumerate(found):
        depth += (token.type in ("LPAR", "LBRACE", "LSQUARE")) - (token.type in ("RPAR", "RBRACE", "RSQUARE"))
        typed = typed or token.type == "COLON"
        if token.type == "COMMA" and depth == 0 and typed:
            items.append(_port(found[begin:at]))
            begin, typed = at + 1, False
    return [*items, _port(found[begin:])]


def _port(found: Sequence[Token]) -> str:
    """A declaration; its unit has no spaces."""
    at = next((k for k, token in enumerate(found) if token.type == "IN"), len(found))
    return flat(found[:at]) + (f" in {''.join(token.text for token in found[at + 1 :])}" if found[at:] else "")


def _topic(tree: syntax.TopicDeclaration) -> str:
    line = f"{'/'.join(name.text for name in tree.type.names)} {tree.name.text}"
    line += f" in {tree.frame.text}" if tree.frame is not None else ""
    role = f"{tree.role}." if tree.role is not None else ""
    return line if tree.port is None else f"{line} matches({role}{tree.port.text})"


def _enclosed(before: str, lines: list[str], after: str) -> list[str]:
    lines[0] = before + lines[0]
    lines[-1] += after
    return lines
