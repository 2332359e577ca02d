"""A proof outline in the paper's notation: assertions in braces between the statements, each with its rule."""

from __future__ import annotations

from dataclasses import field

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, negation
from avow.language.printer import show_term
from avow.language.terms import TRUE, Term

from .program import Assign, Block, If, Match, Skip, Statement, Update, While
from .simplify import simplify
from .triples import Triple
from .wp import Conditions, fits, misfits, side_conditions, weakest

STEP = "   "


@dataclass(slots=True)
class _Writer:
    side: Conditions
    lines: list[str] = field(default_factory=list)

    def assertion(self, depth: int, term: Term, rule: str = "") -> None:
        text = f"{STEP * depth}{{{one_line(term)}}}"
        self.lines.append(f"{text} - {rule}" if rule else text)

    def code(self, depth: int, text: str) -> None:
        self.lines.append(f"{STEP * depth}{text}")


def one_line(term: Term) -> str:
    """A term on one line, in mathematical notation."""
    return show_term(term, "unicode").replace("\n", " ")


def outline(triple: Triple, body: Block) -> str:
    """The whole outline; its entailments ("strengthening") are the verification conditions. Raises TooLarge."""
    writer = _Writer(side_conditions(triple, body))
    pre = triple.full_pre
    writer.assertion(0, pre)
    first = _weakest(body, triple.post, writer)
    if first != pre:
        writer.assertion(0, first, "strengthening")
    if body:
        _block(writer, 0, body, triple.post)
    return "\n".join(writer.lines) + "\n"


def _weakest(body: Block, post: Term, writer: _Writer) -> Term:
    return simplify(weakest(body, post, writer.side))


def _block(writer: _Writer, depth: int, body: Block, post: Term) -> None:
    after = [post]
    for statement in reversed(body[1:]):
        after.append(_weakest((statement,), after[-1], writer))
    for statement, then in zip(body, reversed(after), strict=True):
        _statement(writer, depth, statement, then)


def _statement(writer: _Writer, depth: int, statement: Statement, post: Term) -> None:
    match statement:
        case Skip():
            writer.code(depth, "SKIP")
            writer.assertion(depth, post, "skip axiom")
        case Assign(target=target, value=value):
            writer.code(depth, f"{target.name} := {one_line(value)}")
            writer.assertion(depth, post, "assignment axiom")
        case Update(target=target, arguments=arguments, value=value):
            writer.code(depth, f"{target.name}[{', '.join(map(one_line, arguments))}] := {one_line(value)}")
            writer.assertion(depth, post, "assignment axiom")
        case If(condition=condition, then=then, otherwise=otherwise):
            before = _weakest((statement,), post, writer)
            writer.code(depth, f"IF ({one_line(condition)}) THEN")
            _branch(writer, depth, (before, condition), then, post)
            if otherwise:
                writer.code(depth, "ELSE")
            _branch(writer, depth, (before, simplify(negation(condition))), otherwise, post)
            writer.assertion(depth, post, "conditional rule")
        case Match(subject=subject, constructor=constructor, variables=variables):
            before = _weakest((statement,), post, writer)
            pattern = f"{constructor}({', '.join(v.name for v in variables)})" if variables else constructor
            writer.code(depth, f"MATCH {one_line(subject)} WITH {pattern} THEN")
            _branch(writer, depth, (before, fits(statement, variables)), statement.then, post)
            if statement.otherwise:
                writer.code(depth, "ELSE")
            _branch(writer, depth, (before, simplify(misfits(statement))), statement.otherwise, post)
            writer.assertion(depth, post, "conditional rule")
        case While(condition=condition, invariant=invariant, body=body):
            writer.code(depth, f"WHILE ({one_line(condition)}) DO")
            _branch(writer, depth, (invariant, condition), body, invariant)
            writer.assertion(depth, conjunction((invariant, simplify(negation(condition)))), "while rule")
            writer.assertion(depth, post, "weakening")


def _branch(writer: _Writer, depth: int, facts: tuple[Term, Term], body: Block, post: Term) -> None:
    before, condition = facts
    entered = condition if before == TRUE else conjunction((before, condition))
    writer.assertion(depth + 1, entered)
    wanted = _weakest(body, post, writer)
    if wanted != entered:
        writer.assertion(depth + 1, wanted, "strengthening")
    if body:
        _block(writer, depth + 1, body, post)
