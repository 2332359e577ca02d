"""Text of the imperative language to its syntax tree; every error with its place and, where one can guess, its cure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from lark import Token, v_args
from lark.exceptions import UnexpectedCharacters, UnexpectedToken, VisitError
from lark.visitors import Transformer_NonRecursive

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.grammars import lark_of
from avow.base.records import dataclass
from avow.language import lexer
from avow.language import syntax as rcl
from avow.language.source import Source
from avow.language.terms import Quantifier

from . import syntax
from .tuning import NESTING


def parse_program(text: str, file: str) -> syntax.ProgramText:
    """Raises Rejected with code ``HOARE100``."""
    source: syntax.ProgramText = _parse(text, file, "program")
    return source


def parse_expression(text: str, place: Span) -> syntax.Written:
    """An expression at a place of the plan. Raises Rejected."""
    try:
        tree = _parse(text, place.file, "expression")
    except Rejected as rejected:
        raise Rejected(
            *(Diagnostic(d.code, f'in "{text}": {d.message}', place, hint=d.hint) for d in rejected.diagnostics)
        ) from rejected
    return syntax.Written(tree, Source(place.file, text, place.line, place.column))


def _parse(text: str, file: str, start: str) -> Any:
    lark = _lark()
    last: Token | None = None
    try:
        tokens: Iterator[Token] = lark.lex(text)
        if start == "program":
            tokens = Layout(file).process(tokens)
        interactive = lark.parse_interactive(start=start)
        for token in tokens:
            interactive.feed_token(token)
            last = token
        result = _Build(Source(file, text)).transform(interactive.feed_eof(last))
    except UnexpectedCharacters as error:
        span = Span(file, error.line, error.column, error.line, error.column + 1)
        hint = "a program has no fields of records: it assigns a record as a whole" if error.char == "." else None
        message = f"this character has no meaning here: {error.char!r}"
        raise Rejected(Diagnostic("HOARE100", message, span, hint=hint)) from error
    except UnexpectedToken as error:
        raise Rejected(_explain(error, file, last)) from error
    except VisitError as error:
        raise error.orig_exc from None
    deep = _too_deep(result, Source(file, text))
    if deep is not None:
        raise Rejected(Diagnostic("HOARE100", f"nested more than {NESTING} levels deep", deep))
    return result


def _explain(error: UnexpectedToken, file: str, before: Token | None) -> Diagnostic:
    token: Token = error.token
    span = _span_of(token, file)
    expected = set(error.accepts or error.expected or ())
    text = {"_SEP": "the end of the line", "_CLOSE": "the end of the block", "$END": "the end"}.get(
        token.type, f"`{token}`"
    )
    hint = None
    if token.type == "EQUALS" and "ASSIGN" in expected:
        return Diagnostic(
            "HOARE100", "`=` compares; an assignment is written `:=`", span, hint="write `:=` in place of `=`"
        )
    if token.type == "ASSIGN" and "ASSIGN" not in expected:
        hint = "`:=` assigns and stands only after a variable; to compare, write `==`"
        if token.line is not None:
            hint += " (a line indented further than the one above continues it)"
    elif before is not None and before.type == "NAME" and before.upper() in _KEYWORDS:
        hint = f"keywords are written in capitals: {before.upper()}"
    elif "THEN" in expected:
        hint = "the condition ends with THEN"
    elif token.type == "NAME" and "_SEP" in expected:
        hint = "start each statement on a line of its own, in the column of the one above, or separate them by `;`"
    elif "INVARIANT" in expected and token.type == "DO":
        hint = "a loop needs its invariant: WHILE … INVARIANT … DO …"
    return Diagnostic("HOARE100", f"did not expect {text} here", span, hint=hint)


_KEYWORDS = frozenset((
    "IF", "THEN", "ELSE", "ENDIF", "MATCH", "WITH", "WHILE", "INVARIANT", "VARIANT", "DO", "SKIP", "VAR", "GIVEN",
    "MEMORY",
))  # fmt: skip


def _lark() -> Any:
    starts = ("program", "expression")
    return lark_of(Path(__file__).with_name("imp.lark"), "imp", starts, propagate_positions=True)


def _too_deep(root: Any, text: Source) -> Span | None:
    """The place of a node too far below the root, found without recursion."""
    stack: list[tuple[Any, int]] = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        if isinstance(node, tuple):
            stack.extend((item, depth) for item in node)
        elif isinstance(node, rcl.TermSyntax):
            if depth + node.depth > NESTING:
                return text.span(node.start, node.end)
        elif isinstance(node, syntax.If | syntax.Match | syntax.While | syntax.Assign | syntax.ProgramText):
            if depth > NESTING:
                return node.span
            stack.extend((getattr(node, f.name), depth + 1) for f in fields(node))
    return None


def _token(kind: str, at: Token, text: str | None = None) -> lexer.Token:
    return lexer.Token(kind, str(at) if text is None else text, at.start_pos or 0, at.end_pos or 0)


def _tree(kind: Any, meta: Any, *parts: Any) -> Any:
    """A tree of RCL's syntax, whose depth is above that of its parts."""
    inner = [p for part in parts for p in (part if isinstance(part, tuple) else (part,))]
    depth = 1 + max((p.depth for p in inner if isinstance(p, rcl.TermSyntax)), default=0)
    return kind(meta.start_pos, meta.end_pos, depth, *parts)


@v_args(meta=True)
class _Build(Transformer_NonRecursive):  # type: ignore[misc]
    """Syntax tree from Lark's, without recursion."""

    def __init__(self, text: Source) -> None:
        super().__init__()
        self._text = text

    def _span(self, meta: Any) -> Span:
        return self._text.span(0, 0) if meta.empty else self._text.span(meta.start_pos, meta.end_pos)

    def program(self, meta: Any, items: list[Any]) -> syntax.ProgramText:
        declarations = tuple(item for item in items if isinstance(item, syntax.Declaration))
        memory = tuple(item for item in items if isinstance(item, syntax.Memory))
        return syntax.ProgramText(declarations, memory, items[-1], self._text, self._span(meta))

    def body(self, meta: Any, items: list[Any]) -> tuple[Any, ...]:
        return tuple(item for item in items if item is not None)

    def block(self, meta: Any, items: list[Any]) -> tuple[Any, ...]:
        return items[0]  # type: ignore[no-any-return]

    def memory(self, meta: Any, items: list[Any]) -> syntax.Memory:
        _, name, sort, _, initial = items
        return syntax.Memory(name, str(sort), initial, self._span(meta))

    def declaration(self, meta: Any, items: list[Any]) -> syntax.Declaration:
        names = tuple(item for item in items if isinstance(item, syntax.Name))
        *sorts, result = [item for item in items[1:] if item is None or isinstance(item, Token)]
        words = [str(word) for word in sorts if word is not None]
        span = self._span(meta)
        if result is None:
            if len(words) != 1:
                raise Rejected(Diagnostic("HOARE100", "a type is one name, or A x B --> C", span))
            return syntax.Declaration(names, (), words[0], items[0].type == "GIVEN", span)
        if len(words) % 2 == 0 or any(word != "x" for word in words[1::2]):
            raise Rejected(Diagnostic("HOARE100", "a function's parameters are separated by x: A x B --> C", span))
        return syntax.Declaration(names, tuple(words[::2]), str(result), items[0].type == "GIVEN", span)

    def skip(self, meta: Any, items: list[Any]) -> syntax.Skip:
        return syntax.Skip(self._span(meta))

    def assign(self, meta: Any, items: list[Any]) -> syntax.Assign:
        return syntax.Assign(items[0], (), items[2], self._span(meta))

    def update(self, meta: Any, items: list[Any]) -> syntax.Assign:
        return syntax.Assign(items[0], items[1], items[3], self._span(meta))

    def conditional(self, meta: Any, items: list[Any]) -> syntax.If:
        blocks = [item for item in items if isinstance(item, tuple)]
        return syntax.If(items[1], blocks[0], blocks[1] if len(blocks) > 1 else (), self._span(meta))

    def match(self, meta: Any, items: list[Any]) -> syntax.Match:
        blocks = [item for item in items if isinstance(item, tuple)]
        constructor, *variables = [item for item in items[3:] if isinstance(item, syntax.Name)]
        otherwise = blocks[1] if len(blocks) > 1 else ()
        return syntax.Match(items[1], constructor, tuple(variables), blocks[0], otherwise, self._span(meta))

    def loop(self, meta: Any, items: list[Any]) -> syntax.While:
        variant = items[5] if items[4] is not None else None
        body = next(item for item in items if isinstance(item, tuple))
        return syntax.While(items[1], items[3], variant, body, self._span(meta))

    def arguments(self, meta: Any, items: list[Any]) -> tuple[Any, ...]:
        return tuple(items)

    def comparator(self, meta: Any, items: list[Token]) -> lexer.Token:
        text = "==" if items[0] == "=" else str(items[0])
        return _token(lexer.SYMBOLS[text], items[0], text)

    def compare(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Comparison, meta, tuple(items[::2]), tuple(items[1::2]))

    def member(self, meta: Any, items: list[Any]) -> Any:
        return self.inside(meta, [*items[:2], _tree(rcl.SetDisplay, meta, items[2])])

    def inside(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Comparison, meta, (items[0], items[2]), (_token(items[1].type, items[1]),))

    def several(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.TupleDisplay, meta, tuple(items))

    def sequence(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.SequenceDisplay, meta, items[0] or ())

    @staticmethod
    def _infix(operator: str) -> Any:
        def build(self: _Build, meta: Any, items: list[Any]) -> Any:
            operands = (items[0], items[-1])
            if operator in (*rcl.Sign,):
                return _tree(rcl.Connective, meta, rcl.Sign(operator), operands)
            sign = lexer.Token(lexer.SYMBOLS[operator], operator, meta.start_pos, meta.end_pos)
            return _tree(rcl.Calculation, meta, operands, (sign,))

        return build

    iff, implies, disjoin, conjoin = map(_infix, ("<=>", "->", "or", "and"))
    add, subtract, multiply, divide = map(_infix, "+-*/")

    def negate(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Negation, meta, items[1])

    def minus(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Minus, meta, items[0])

    def number(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Number, meta, str(items[0]))

    def string(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Text, meta, str(items[0]))

    def truth(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Truth, meta, items[0].type == "TRUE")

    def reference(self, meta: Any, items: list[Any]) -> Any:
        role, dot, name = str(items[0]).rpartition(".")
        return _tree(rcl.PortName, meta, role, name) if dot else _tree(rcl.Name, meta, name)

    def name(self, meta: Any, items: list[Any]) -> syntax.Name:
        return syntax.Name(str(items[0]), self._span(meta))

    def call(self, meta: Any, items: list[Any]) -> Any:
        return _tree(rcl.Application, meta, items[0], items[1])

    def group(self, meta: Any, items: list[Token]) -> rcl.Binder:
        *names, _, sort = items
        domain = rcl.Name(sort.start_pos or 0, sort.end_pos or 0, 1, str(sort))
        return rcl.Binder(meta.start_pos, meta.end_pos, 1, tuple(_token("NAME", n) for n in names), domain)

    def quantified(self, meta: Any, items: list[Any]) -> Any:
        groups = tuple(item for item in items[1:] if isinstance(item, rcl.Binder))
        kind = Quantifier.FORALL if items[0].type == "FORALL" else Quantifier.EXISTS
        return _tree(rcl.Quantification, meta, kind, groups, items[-1])


# -- blocks by indentation ---------------------------------------------------------------------------------------------


_ENDS = {"ENDIF": "IF", "ENDMATCH": "MATCH", "ENDWHILE": "WHILE"}
_OPENING = {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}


@dataclass(slots=True)
class _Block:
    statement: Token
    """The IF, MATCH or WHILE that the block belongs to."""
    indent: int
    """The column in which that statement's line starts."""
    column: int
    """The column of the block's statements."""
    first: bool
    """It is the branch that an ELSE can follow."""
    explicit: bool
    """Not indented: only a keyword can close it."""


class Layout:
    """One pass over the tokens of one program: `_OPEN`, `_CLOSE` and `_SEP` are put among them, as blocks follow from
    indentation, as the paper prints its programs.

    - After THEN, ELSE and DO a block opens. Its statements start in the column of its first token; a line that starts
      further left closes it, one that starts further right continues the statement above.
    - ELSE and ENDIF (ENDMATCH, ENDWHILE) close what is open inside; at the start of a line they belong to the innermost
      IF whose line is not indented further than they are.
    - A block that is not indented further than what surrounds it needs its ENDIF.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self._owner: _Block | None = None

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        """Raises Rejected for a block that never ends, or an ELSE that belongs to nothing."""
        blocks: list[_Block] = []
        pending: list[Token] = []  # IF, MATCH and WHILE whose first block has not opened yet
        indents: dict[int, int] = {}  # where the line of such a statement starts, by its position in the text
        opens: _Block | None = None
        self._owner = None
        depth, line, indent, base = 0, 0, 1, 0
        last: Token | None = None
        for token in stream:
            starts_line = token.line != line
            if starts_line:
                line, indent = token.line, token.column
            base = base or token.column
            if opens is not None:
                opens.column, opens.explicit, chained = self._column(token, opens, blocks, base, starts_line, indent)
                if chained:
                    opens.indent = indent
                blocks.append(opens)
                yield _mark("_OPEN", token)
                opens = None
            elif starts_line and depth == 0:
                if token.type == "ELSE" or token.type in _ENDS:
                    yield from self._close_for(token, blocks, True)
                else:
                    while blocks and not blocks[-1].explicit and token.column < blocks[-1].column:
                        blocks.pop()
                        yield _mark("_CLOSE", token)
                    if token.column == (blocks[-1].column if blocks else base) and last is not None:
                        yield _mark("_SEP", token)
            elif depth == 0 and (token.type == "ELSE" or token.type in _ENDS):
                yield from self._close_for(token, blocks, False)
            depth += _OPENING.get(str(token), 0) if token.type not in {"STRING"} else 0
            if token.type in {"IF", "MATCH", "WHILE"}:
                pending.append(token)
                indents[token.start_pos or 0] = indent
            elif token.type in {"THEN", "DO"} and pending:
                owner = pending.pop()
                opens = _Block(owner, indents[owner.start_pos or 0], 0, token.type == "THEN", False)
            elif token.type == "ELSE" and self._owner is not None:
                opens = _Block(self._owner.statement, self._owner.indent, 0, False, False)
            yield token
            last = token
        if last is None:
            return
        if opens is not None:
            raise self._rejected(last, f"the program ends where the branch after {last} should start")
        for block in reversed(blocks):
            if block.explicit:
                end = next(k for k, v in _ENDS.items() if v == block.statement.type)
                raise self._rejected(
                    block.statement, f"this {block.statement} needs its branches indented, or an {end}"
                )
            yield _mark("_CLOSE", last)

    def _close_for(self, token: Token, blocks: list[_Block], starts_line: bool) -> Iterator[Token]:
        """Close the blocks up to the one that ELSE or an END-keyword ends; it is kept for the second branch."""
        wanted = _ENDS.get(token.type)
        while blocks:
            block = blocks.pop()
            yield _mark("_CLOSE", token)
            fits = block.first and block.statement.type != "WHILE" if wanted is None else block.statement.type == wanted
            if fits and (not starts_line or block.indent <= token.column):
                self._owner = block
                return
        end = "IF or MATCH" if wanted is None else wanted
        raise self._rejected(token, f"{token} here belongs to no open {end}")

    def _column(
        self, token: Token, opens: _Block, blocks: list[_Block], base: int, starts_line: bool, indent: int
    ) -> tuple[int, bool, bool]:
        around = blocks[-1].column if blocks else base
        if token.type in {"IF", "MATCH"} and not starts_line and not opens.first:
            return indent + 1, False, True  # ELSE IF: a chain, its branches need not be indented below the IF
        return token.column, token.column <= around, False

    def _rejected(self, token: Token, message: str) -> Rejected:
        return Rejected(Diagnostic("HOARE100", message, _span_of(token, self.file)))


def _span_of(token: Token, file: str) -> Span:
    line, column = token.line or 1, token.column or 1
    return Span(file, line, column, token.end_line or line, token.end_column or column + 1)


def _mark(kind: str, at: Token) -> Token:
    return Token.new_borrow_pos(kind, "", at)
