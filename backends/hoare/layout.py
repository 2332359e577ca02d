"""Blocks by indentation, as the paper prints its programs: `_OPEN`, `_CLOSE` and `_SEP` put among the tokens.

- After THEN, ELSE and DO a block opens. Its statements start in the column of its first token; a line that starts
  further left closes it, one that starts further right continues the statement above.
- ELSE and ENDIF (ENDMATCH, ENDWHILE) close what is open inside; at the start of a line they belong to the innermost
  IF whose line is not indented further than they are.
- A block that is not indented further than what surrounds it needs its ENDIF.
"""

from __future__ import annotations

from collections.abc import Iterator

from lark import Token

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass

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
    """One pass over the tokens of one program."""

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
        return Rejected(Diagnostic("HOARE100", message, span_of(token, self.file)))


def span_of(token: Token, file: str) -> Span:
    line, column = token.line or 1, token.column or 1
    return Span(file, line, column, token.end_line or line, token.end_column or column + 1)


def _mark(kind: str, at: Token) -> Token:
    return Token.new_borrow_pos(kind, "", at)
