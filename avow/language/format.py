"""``avow fmt``: the canonical layout of a file. Comments are kept, the meaning is unchanged, formatting twice changes
nothing.

The layout is made from the surface syntax, so every parenthesis, number and name stays as it was written; `A` and `G`
are spelled out, and a quantifier's `;` becomes `|`. A part with a comment inside it keeps its own lines, re-indented.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import assert_never

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.language.flat import definition_head, flat, quantifier_head
from avow.language.lexer import Token, tokens
from avow.language.load import clean_text, unless_torn
from avow.language.outline import read
from avow.language.source import Reports, Source, in_order
from avow.language.syntax import (
    Connective,
    ConstantDeclaration,
    Declaration,
    Define,
    FileSyntax,
    IfThenElse,
    Lasting,
    Limited,
    Negation,
    NodeSyntax,
    Parentheses,
    PortList,
    Quantification,
    SetDisplay,
    SetType,
    Sign,
    Syntax,
    TermSyntax,
    TopicList,
    TypeDeclaration,
    children,
)

WIDTH = 120
_STEP = 2


def format_text(text: str, file: str) -> str:
    """The text in the canonical layout. Raises `Rejected` where its syntax has errors (its types may have)."""
    before = _Read(text, file)
    after = _Layout(before.source, before.stream, before.comments, before.syntax).file()
    _must_say_the_same(before, after)
    return after


class _Read:
    """A file's text, tokens, comments and syntax. Raises `Rejected` where its syntax has errors."""

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

    def says(self) -> list[tuple[object, Span]]:
        """Everything that the file says, part by part, whatever its layout; and where each part stands."""
        found: list[tuple[object, Span]] = []
        parts: list[Syntax | NodeSyntax] = [*self.syntax.declarations, *self.syntax.nodes]
        for part in sorted(parts, key=lambda part: part.start):
            if not isinstance(part, NodeSyntax):
                found.append((_shape(part), self.source.span(part.start, part.end)))
                continue
            listings = (part.inputs, part.outputs, part.topics)
            span = self.source.span(part.name.start, part.name.end)
            found.append(((part.name.text, *map(_shape, (*listings, *part.definitions))), span))
            for clause in part.clauses:
                said = (clause.kind, *map(_shape, (clause.name, clause.sentence, clause.formula)))
                found.append((said, self.source.span(clause.start, clause.end)))
        end = len(self.source.text)
        found.append(([c.text.split() for c in self.comments], self.source.span(end, end)))
        return found


def _must_say_the_same(before: _Read, after: str) -> None:
    """Raises `Rejected` where the text does not read back as what it was made from."""
    try:
        again = _Read(after, before.source.file).says()
    except Rejected:
        again = []
    for number, (said, span) in enumerate(before.says()):
        if number >= len(again) or again[number][0] != said:
            message = "in the canonical layout, this would not read back as the same contract; the file stays as it is"
            raise Rejected(
                Diagnostic("RCL007", message, span, hint="this is a defect of Avow: please tell its authors")
            )


def _shape(part: object) -> object:
    """A piece of syntax without its places. Only the dataclasses' own fields are looked at, not the printer's idea of
    them: what the printer forgets is seen here."""
    if isinstance(part, Token):
        return part.type if part.type in ("NOT_IN", "EMPTY_SEQUENCE") else part.text
    if isinstance(part, tuple):
        return tuple(map(_shape, part))
    if dataclasses.is_dataclass(part):
        own = (f.name for f in dataclasses.fields(part) if f.name not in ("start", "end", "depth"))
        return (type(part).__name__, *(_shape(getattr(part, name)) for name in own))
    return part


class _Layout:
    """Writes the file from left to right: each part in canonical form, after the comments that precede it."""

    def __init__(self, source: Source, stream: Sequence[Token], comments: Sequence[Token], syntax: FileSyntax) -> None:
        self.text = source.text
        self.stream = stream
        self.comments = comments
        self.next_comment = 0
        self.at = 0
        self.lines: list[str] = []
        self.declarations: dict[int, Declaration] = {tree.start: tree for tree in syntax.declarations}
        self.listings: dict[int, PortList | TopicList] = {}
        self.formulas: dict[int, TermSyntax] = {}
        for node in syntax.nodes:
            self.declarations |= {tree.start: tree for tree in node.definitions}
            for tree in (node.inputs, node.outputs, node.topics):
                if tree is not None:
                    self.listings[tree.start] = tree
            for clause in node.clauses:
                if clause.formula is not None:
                    self.formulas[clause.formula.start] = clause.formula

    def kind(self) -> str:
        return self.stream[self.at].type if self.at < len(self.stream) else "$END"

    # --- comments and blank lines ------------------------------------------------------------------------------------

    def blank(self) -> None:
        if self.lines and self.lines[-1] and not self.lines[-1].endswith("{"):
            self.lines.append("")

    def blank_before(self, start: int) -> bool:
        """Whether the text has an empty line before this place."""
        gap = self.text[:start]
        return gap[len(gap.rstrip(" \t\r\n\f")) :].count("\n") > 1

    def flush(self, until: int, indent: int, *, apart: bool = False) -> None:
        """Write the comments before `until`; `apart`: an empty line before them, or where there are none, now."""
        first, closed = True, False  # closed: the line ends with a `//` comment, and can take no further one
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
        """The lines of a piece kept as it is: the first without indentation, the others moved to `indent + further`."""
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
        while True:  # to the end of the part: `;` for a declaration, else the closing parenthesis
            kind = self.kind()
            depth += (kind in ("LPAR", "LBRACE")) - (kind in ("RPAR", "RBRACE"))
            self.at += 1
            if depth == 0 and (kind == "SEMICOLON" if is_declaration else kind == "RPAR"):
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

    def declaration(self, tree: Declaration) -> list[str]:
        match tree:
            case TypeDeclaration(type=type_):
                head = f"{tree.name.text} : "
                lines = _broken_set(type_, _STEP + len(head), WIDTH - 1) or [flat(type_)]
            case ConstantDeclaration(value=value):
                head = f"{tree.name.text} = "
                lines = _broken_set(value, _STEP + len(head), WIDTH - 1) or _lay(value, _STEP + 2, WIDTH - 1)
            case Define(body=body):
                head = f"{definition_head(tree)} "
                fits = _STEP + len(head) + len(flat(body)) < WIDTH
                lines = [flat(body)] if fits else ["", *_lay(body, _STEP + 2, WIDTH - 1)]
                lines[1:2] = [" " * (_STEP + 2) + line for line in lines[1:2]]
                head = head if fits else head.rstrip()
            case _:
                assert_never(tree)
        return [head + lines[0], *lines[1:-1], lines[-1] + ";"] if len(lines) > 1 else [head + lines[0] + ";"]

    def section(self, own: Sequence[Token]) -> list[str]:
        if own[0].text == "steps":
            return [flat(self.formulas[own[0].start])]
        keyword = {"A": "assume", "G": "guarantee"}.get(own[0].text, own[0].text)
        head = keyword
        at = 1
        while own[at].type != "LPAR":
            head += " " + own[at].text
            at += 1
        if at + 1 >= len(own) - 1:
            return [head + "()"]
        start = own[at + 1].start
        if keyword in ("inputs", "outputs", "topics"):
            items = [flat(part) for part in self.listings[start].items]
            line = f"{head}( {', '.join(items)} )"
            if _STEP + len(line) <= WIDTH:
                return [line]
            pad = " " * (_STEP + len(head) + 2)
            return [f"{head}( {items[0]}," if len(items) > 1 else f"{head}( {items[0]} )"] + [
                f"{pad}{item}{' )' if i == len(items) - 1 else ','}" for i, item in enumerate(items) if i
            ]
        tree = self.formulas[start]
        line = f"{head}( {flat(tree)} )"
        if own[at - 1].type != "STRING" and _STEP + len(line) <= WIDTH:
            return [line]
        lines = _lay(tree, 2 * _STEP + 2, WIDTH - 2)
        pad = " " * (2 * _STEP)
        if len(lines) == 1:
            return [head, f"{pad}( {lines[0]} )"]
        return [head, f"{pad}( {lines[0]}", *lines[1:-1], f"{lines[-1]} )"]


# --- trees to lines --------------------------------------------------------------------------------------------------


def _lay(tree: TermSyntax, indent: int, width: int) -> list[str]:
    """The lines of a formula that begins at column `indent`; all but the first carry their indentation."""
    line = flat(tree)
    if indent + len(line) <= width:
        return [line]
    match tree:
        case Parentheses(body=inner):
            return _enclosed("(", _lay(inner, indent + 1, width - 1), ")")
        case Connective(sign=Sign.AND | Sign.OR, items=items):
            sign = f"{tree.sign} "
            lines = _lay(items[0], indent, width)
            for part in items[1:]:
                more = _lay(part, indent + len(sign), width)
                lines += [" " * indent + sign + more[0], *more[1:]]
            return lines
        case Connective(items=items):
            sign = f" {tree.sign}"
            lines = _lay(items[0], indent, width - len(sign))
            for i, part in enumerate(items[1:], 2):
                lines[-1] += sign
                last = i == len(items)
                deeper = indent + (_STEP if last else 0)
                more = _lay(part, deeper, width - (0 if last else len(sign)))
                lines += [" " * deeper + more[0], *more[1:]]
            return lines
        case Lasting(word=word, left=one, limit=bound, right=other):
            sign = f"{word}{'' if bound is None else flat(bound)} "
            more = _lay(other, indent + len(sign), width)
            return [*_lay(one, indent, width), " " * indent + sign + more[0], *more[1:]]
        case Limited(arguments=(inner,)):
            head = f"{tree.name.text}{flat(tree.limit)}("
            return _enclosed(head, _lay(inner, indent + len(head), width - 1), ")")
        case Negation(body=inner):
            return _enclosed("not ", _lay(inner, indent + 4, width), "")
        case Quantification(body=inner):
            body = _enclosed(" " * (indent + _STEP), _lay(inner, indent + _STEP, width - 1), ")")
            return [quantifier_head(tree), *body]
        case IfThenElse(condition=condition, then=then, otherwise=otherwise):
            pad = " " * indent
            lines = _enclosed("if ", _lay(condition, indent + 3, width), "")
            lines += _enclosed(f"{pad}then ", _lay(then, indent + 5, width), "")
            return [*lines, *_enclosed(f"{pad}else ", _lay(otherwise, indent + 5, width), "")]
        case _:  # a term, which stays on its line
            return [line]


def _enclosed(before: str, lines: list[str], after: str) -> list[str]:
    lines[0] = before + lines[0]
    lines[-1] += after
    return lines


def _broken_set(tree: Syntax, indent: int, width: int) -> list[str] | None:
    """A long set over several lines, as many elements on each as fit; None where it is short or no set."""
    if not isinstance(tree, SetType | SetDisplay) or indent + len(flat(tree)) <= width:
        return None
    lines = ["{"]
    pad = " " * (_STEP + _STEP)
    row = ""
    items = [flat(part) for part in children(tree)]
    for i, item in enumerate(items):
        piece = item + ("," if i < len(items) - 1 else "")
        if row and len(pad) + len(row) + 1 + len(piece) > width:
            lines.append(pad + row)
            row = ""
        row = f"{row} {piece}".strip()
    return [*lines, pad + row, " " * _STEP + "}"]
