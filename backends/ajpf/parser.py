"""Reads Gwendolen programs. Any text gives a `Program` or located diagnostics."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer, UnexpectedCharacters, UnexpectedEOF, UnexpectedInput, UnexpectedToken, v_args
from lark.exceptions import VisitError

from avow.backend_kit.given import file_text
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.grammars import lark_of

from .syntax import RECEIVED, SENT, Condition, Deed, DeedKind, Event, Goal, GoalKind, Plan, Program, Rule, Sign
from .terms import CONS, NIL, Struct, Var, is_ground, show
from .tuning import PROGRAM_BYTES

_SAID = {
    "ATOM": "a name",
    "VARIABLE": "a variable",
    "WORD": "a name",
    "NUMBER": "a number",
    "POSITIVE": "a number",
    "NATURAL": "a whole number",
    "STRING": "a text",
    "TEXT": "a text",
    "SIGN_ADD": "'+'",
    "SIGN_DROP": "'-'",
    "KIND": "'perform' or 'achieve'",
    "FORCE": "':tell', ':perform' or ':achieve'",
    "$END": "the end",
}


def read_system(path: Path) -> tuple[Program, ...]:
    """The agents of a file. Raises Rejected."""
    return parse_system(file_text(path, "AJPF101", "AJPF101", PROGRAM_BYTES), str(path))


def parse_fact(text: str) -> Struct | None:
    """One ground literal, such as a percept ``danger`` or ``result(0, 3)``, or None."""
    builder = _Builder("")
    try:
        made = builder.transform(_grammar().parse(text, start="struct"))
    except (UnexpectedInput, VisitError, RecursionError):
        return None
    return made if isinstance(made, Struct) and is_ground(made) else None


def parse_system(text: str, file: str) -> tuple[Program, ...]:
    """All agents of a file. Raises Rejected with the place of a syntax error, or of what cannot be run."""
    builder = _Builder(file)
    try:
        tree = _grammar().parse(text, start="start")
        agents: tuple[Program, ...] = builder.transform(tree)
    except UnexpectedInput as error:
        raise Rejected(_unexpected(error, text, file)) from None
    except (RecursionError, VisitError) as error:
        if not isinstance(getattr(error, "orig_exc", error), RecursionError):
            raise
        raise Rejected(Diagnostic("AJPF102", "nested too deeply", _at(file, 1, 1))) from None
    for at, agent in enumerate(agents):
        if agent.name in [other.name for other in agents[:at]]:
            message = f"there are two agents called '{agent.name}'"
            builder.problems.append(Diagnostic("AJPF104", message, agent.name_span))
    if builder.problems:
        raise Rejected(*builder.problems)
    return agents


def _grammar() -> Lark:
    grammar, starts = Path(__file__).with_name("gwendolen.lark"), ("start", "struct")
    found: Lark = lark_of(grammar, "gwendolen", starts, lexer="contextual", propagate_positions=True)
    return found


def _at(file: str, line: int, column: int, width: int = 1) -> Span:
    return Span(file, line, column, line, column + width)


def _unexpected(error: UnexpectedInput, text: str, file: str) -> Diagnostic:
    if isinstance(error, UnexpectedToken) and error.token.type != "$END":
        wanted = _wanted(error.accepts or error.expected)
        token = error.token
        span = _at(file, token.line or 1, token.column or 1, max(1, len(token)))
        return Diagnostic("AJPF102", f"unexpected {_quote(str(token))}", span, hint=wanted)
    if isinstance(error, UnexpectedCharacters):
        character = text[error.pos_in_stream] if error.pos_in_stream < len(text) else ""
        wanted = _wanted(error.allowed or set())
        return Diagnostic(
            "AJPF102", f"unexpected {_quote(character)}", _at(file, error.line, error.column), hint=wanted
        )
    lines = text.split("\n")
    expected = error.expected if isinstance(error, UnexpectedEOF | UnexpectedToken) else set()
    span = _at(file, len(lines), len(lines[-1]) + 1)
    return Diagnostic("AJPF102", "the program ends too early", span, hint=_wanted(expected))


def _wanted(names: Any) -> str | None:
    terminals = {t.name: t for t in _grammar().terminals}
    expected = sorted({_SAID.get(n) or (f"'{terminals[n].pattern.value}'" if n in terminals else n) for n in names})
    return "expected " + " or ".join(expected) if 0 < len(expected) <= 8 else None


def _quote(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:40] + "…")


def _build(method: Any) -> Any:
    return v_args(meta=True)(method)


class _Builder(Transformer):  # type: ignore[misc]
    """Parse tree to data."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.file = file
        self.problems: list[Diagnostic] = []
        self.fresh = count(1)

    def span(self, meta: Any) -> Span:
        if meta.empty:
            return _at(self.file, 1, 1)
        return Span(self.file, meta.line, meta.column, meta.end_line, meta.end_column)

    # Terms

    def struct(self, parts: list[Any]) -> Struct:
        return Struct(str(parts[0]), tuple(p for p in parts[1:] if p is not None))

    def variable(self, parts: list[Token]) -> Var:
        return Var(str(parts[0]))

    def anonymous(self, parts: list[Token]) -> Var:
        return Var(f"_{next(self.fresh)}")

    def number(self, parts: list[Token]) -> Struct:
        return Struct(_number(str(parts[0])))

    def string(self, parts: list[Token]) -> Struct:
        return Struct(str(parts[0]))

    # Sections

    def name(self, parts: list[Token]) -> Token:
        return parts[0]

    @_build
    def belief(self, meta: Any, parts: list[Struct]) -> Struct:
        self.ground("belief", parts[0], meta)
        return parts[0]

    def ground(self, what: str, term: Struct, meta: Any) -> None:
        if not is_ground(term):
            message = f"the initial {what} {show(term)} has a variable"
            self.problems.append(Diagnostic("AJPF103", message, self.span(meta)))

    def several(self, parts: list[Any]) -> tuple[Any, ...]:
        """All sections."""
        return tuple(p for p in parts if p is not None)

    beliefs = rules = goals = plans = deeds = start = several

    def list_term(self, parts: list[Any]) -> Struct:
        made = Struct(NIL)
        for item in reversed([p for p in parts if p is not None]):
            made = Struct(CONS, (item, made))
        return made

    def open_list(self, parts: list[Any]) -> Struct:
        made = parts[-1]
        for item in reversed(parts[:-1]):
            made = Struct(CONS, (item, made))
        return made  # type: ignore[no-any-return]

    def arithmetic(self, parts: list[Any]) -> Struct:
        return Struct(str(parts[1]), (parts[0], parts[2]))

    def equation(self, parts: list[Any]) -> tuple[str, Struct]:
        return str(parts[1]), Struct(str(parts[1]), (parts[0], parts[2]))

    # Conditions, each with the sign that denies it, if it has one

    def believed(self, parts: list[Any]) -> Condition:
        return Condition(parts[1], parts[0] is None)

    def holding(self, parts: list[Any]) -> Condition:
        test, term = parts[1]
        return Condition(term, parts[0] is None, test=test)

    def wanted_goal(self, parts: list[Any]) -> Condition:
        return Condition(parts[1], parts[0] is None, is_goal=True, goal=parts[2])

    def sent(self, parts: list[Any]) -> Condition:
        """Without a sender: the agent itself; it does not remember others' messages."""
        denied, to, sender, force, content = parts
        term = Struct(SENT, (to, sender or self.anonymous([]), _force(force), content))
        return Condition(term, denied is None)

    def no_way(self, parts: list[Any]) -> Condition:
        return Condition(None, positive=False, group=tuple(parts[1:]))

    def anything(self, parts: list[Any]) -> Condition:
        return Condition(None)

    def cut(self, parts: list[Any]) -> Condition:
        return Condition(None, is_cut=True)

    @_build
    def rule(self, meta: Any, parts: list[Any]) -> Rule:
        return Rule(parts[0], tuple(p for p in parts[1:] if p is not None), self.span(meta))

    def kind(self, parts: list[Token]) -> GoalKind:
        return GoalKind(str(parts[0]))

    @_build
    def goal(self, meta: Any, parts: list[Any]) -> Goal:
        self.ground("goal", parts[0], meta)
        return Goal(parts[0], parts[1] or GoalKind.PERFORM)

    # Plans

    @_build
    def of_belief(self, meta: Any, parts: list[Any]) -> Event:
        return self.trigger(Event(Sign(parts[0]), parts[1]), meta)

    @_build
    def of_goal(self, meta: Any, parts: list[Any]) -> Event:
        return self.trigger(Event(Sign(parts[0]), parts[1], parts[2], is_goal=True), meta)

    def trigger(self, event: Event, meta: Any) -> Event:
        if isinstance(event.term, Var):
            message = f"a plan for any {'goal' if event.is_goal else 'belief'} at all: the checker does not run that"
            self.problems.append(Diagnostic("AJPF103", message, self.span(meta)))
        return event

    def received(self, parts: list[Any]) -> Event:
        """AIL calls the sender `From` and the receiver `To`: a plan may use these variables."""
        return Event(Sign.ADD, Struct(RECEIVED, (Var("From"), Var("To"), _force(parts[1]), parts[2])))

    def guard(self, parts: list[Condition]) -> tuple[Condition, ...]:
        return _as_tried(parts)

    def change_belief(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind(parts[0]), parts[1])

    def change_goal(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind(f"{parts[0]}!"), parts[1], parts[2] or GoalKind.PERFORM)

    def wait(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind.WAIT if parts[0] is None else DeedKind.WAIT_NOT, parts[1])

    def send(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind.SEND, Struct("send", (parts[0], _force(parts[1]), parts[2])))

    def lock(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind(f"{parts[0]}.lock"), Struct(".lock"))

    def action(self, parts: list[Any]) -> Deed:
        return Deed(DeedKind.ACTION, parts[0])

    @_build
    def plan(self, meta: Any, parts: list[Any]) -> Plan:
        event, guard, deeds = parts
        return Plan(event, guard, deeds or (), self.span(meta))

    def agent(self, parts: list[Any]) -> Program:
        name, beliefs, rules, goals, plans = parts
        span = _at(self.file, name.line or 1, name.column or 1, len(name))
        return Program(str(name), beliefs, rules, goals, plans, span)


def _force(token: Token) -> Struct:
    """``:tell``, ``:perform`` or ``:achieve``, as a term."""
    return Struct(str(token)[1:].strip())


def _number(text: str) -> str:
    """3, 3.0 and 03 are one number to the agent, so they are one text here."""
    sign, digits = ("-", text[1:]) if text.startswith("-") else ("", text)
    whole, _, fraction = digits.partition(".")
    whole, fraction = whole.lstrip("0") or "0", fraction.rstrip("0")
    shown = f"{whole}.{fraction}" if fraction else whole
    return shown if shown == "0" else sign + shown


def _as_tried(conditions: list[Condition]) -> tuple[Condition, ...]:
    """A guard's conditions in the order in which AIL tries them: as written, but a negated first one after the second
    if that is not negated (it may bind the variables of the first). `True` is no condition."""
    real = [c for c in conditions if c.term is not None or c.group]
    if len(real) > 1 and not real[0].positive and real[1].positive:
        real[:2] = real[1], real[0]
    return tuple(real)
