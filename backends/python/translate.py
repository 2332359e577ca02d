"""From the abstract syntax of a Python class to the small program of its step.

What is not in the subset is a `Refusal` with its line. Names are resolved as Python does (a name that a function binds
is local in all of it), a local may be read only where every path has bound it, and every path of a step returns.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, assert_never

from avow.backend_kit.programs.judging import to_return
from avow.language import sorts as s
from avow.language.contract import Node

from . import program
from .expressions import Expressions
from .program import Expr, Kind, Scalar, assigned
from .tuning import INLINED_DEPTH
from .whole_file import Parts, Refusal, bound_names, outside, plain_arguments


def kind_of(sort: s.Sort) -> Kind | None:
    """What a value of the sort is in Python; None: nothing that a step may have."""
    if isinstance(sort, s.NotScalar):
        return None
    match sort:
        case s.BoolSort():
            return Kind.BOOL
        case s.RealSort():
            return Kind.FLOAT
        case s.IntegerSort() | s.NaturalSort():
            return Kind.INT
        case s.EnumSort():
            return Kind.TEXT
        case _:
            assert_never(sort)


@dataclass(slots=True)
class Scope:
    """A function's names: those that it binds, those bound on every path so far, and the kind of each."""

    suffix: str
    own: frozenset[str]
    receiver: str
    """What the method calls its object."""
    bound: set[str] = field(default_factory=set)
    sequences: dict[str, program.View] = field(default_factory=dict)
    aliases: dict[str, Any] = field(default_factory=dict)
    """Names of a constant mapping: the parameters."""


class Translator(Expressions):
    """Reads one class for one node. Raises Refusal."""

    def __init__(self, parts: Parts, node: Node, memory: Mapping[str, str], params: Mapping[str, Any], text: str):
        super().__init__(parts, params)
        self.node, self.memory = node, dict(memory)
        self.lines = tuple(text.splitlines())
        self.calls: list[str] = []
        self.made = 0
        self.making = True
        """`__init__` is read, not `step`."""
        self.changed: dict[str, int] = {}
        self.branches = 0
        """Conditions and loops around the statement that is read."""

    def step(self) -> program.Step:
        """The whole class."""
        start = self._start()
        sequences = self._inputs()
        self.making = False
        self.start = start
        for port, attribute in self.memory.items():
            if attribute not in start:
                line = self.parts.node.lineno
                raise Refusal(line, f"__init__ does not set self.{attribute}, which is the memory {port}")
            wanted = kind_of(self.node.input(port).sort)
            if self.kinds[f"self.{attribute}"] is not wanted:
                have = self.kinds[f"self.{attribute}"]
                raise Refusal(
                    self.parts.node.lineno, f"__init__ makes self.{attribute} {_a(have)}, and {port} is {_a(wanted)}"
                )
        body = self._method("step")
        unknown = sorted(set(self.changed) - set(self.memory.values()))
        if unknown:
            line = self.changed[unknown[0]]
            raise Refusal(line, f"self.{unknown[0]} is changed by a step and is not among the node's memory")
        return program.Step(body, start, dict(self.memory), sequences, self.lines)

    # -- the object --------------------------------------------------------------------------------------

    def _start(self) -> dict[str, Scalar]:
        init = self.parts.methods.get("__init__")
        if init is None:
            return {}
        arguments = plain_arguments(init)
        if len(arguments) > 2:
            raise Refusal(init.lineno, "__init__ takes one mapping of parameters, or nothing")
        scope = Scope("@init", bound_names(init), arguments[0])
        for name in arguments[1:]:
            scope.aliases[name] = self.params
        self.scope = scope
        self.calls.append("__init__")
        body, completes = self.block(init.body)
        self.calls.pop()
        if not completes:
            raise Refusal(init.lineno, "__init__ returns something, or never ends")
        values: dict[str, Any] = {}
        try:
            program.run_block(body, values)
        except program.Failed as fault:
            raise Refusal(init.lineno, f"__init__ ends in {fault}") from None
        found = {name.removeprefix("self."): v for name, v in values.items() if name.startswith("self.")}
        for name in [n for n in self.kinds if n.startswith("self.")]:
            if name.removeprefix("self.") not in found:
                raise Refusal(init.lineno, f"{name} is not set on every path of __init__")
        return found

    def _inputs(self) -> dict[str, Kind]:
        step = self.parts.methods.get("step")
        if step is None:
            raise Refusal(self.parts.node.lineno, f"the class {self.parts.node.name} has no method step")
        given = {p.name: p for p in self.node.inputs if p.name not in self.memory}
        names = plain_arguments(step)[1:]
        for name in names:
            if name not in given:
                raise Refusal(step.lineno, f"step wants {name}, which is no input of {self.node.name}")
        missing = [name for name in given if name not in names]
        if missing:
            raise Refusal(step.lineno, f"step does not take the input {missing[0]}")
        sequences: dict[str, Kind] = {}
        for name, port in given.items():
            item = kind_of(port.sort.item) if isinstance(port.sort, s.SequenceSort) else None
            kind = kind_of(port.sort)
            if item is not None:
                sequences[name] = item
            elif kind is None:
                raise Refusal(step.lineno, f"the input {name} is {port.type_name}, which this method does not know")
            else:
                self.kinds[f"in.{name}"] = kind
        self.items = sequences
        for port in self.node.outputs:
            if kind_of(port.sort) is None:
                raise Refusal(
                    step.lineno, f"the output {port.name} is {port.type_name}, which this method does not know"
                )
        return sequences

    # -- methods -----------------------------------------------------------------------------------------

    def _method(self, name: str) -> tuple[program.Statement, ...]:
        method = self.parts.methods[name]
        arguments = plain_arguments(method)
        if not arguments:
            raise Refusal(method.lineno, f"{name} has no argument for its object")
        scope = Scope("", bound_names(method), arguments[0])
        if arguments[0] in scope.own:
            raise Refusal(method.lineno, f"{arguments[0]} is bound anew in {name}")
        self.scope = scope
        first: list[program.Statement] = []
        for argument in arguments[1:]:
            if argument in self.items:
                if argument in scope.own:
                    raise Refusal(method.lineno, f"the sequence {argument} is bound anew")
                scope.sequences[argument] = program.View(argument)
            else:
                kind = self.kinds[f"in.{argument}"]
                first.append(self.assign(argument, program.Name(f"in.{argument}", kind), method.lineno))
        self.calls.append(name)
        body, completes = self.block(method.body)
        self.calls.pop()
        if completes:
            raise Refusal(method.lineno, f"{name} can end without a return: it then gives None")
        return (*first, *body)

    def inline(self, definition: ast.FunctionDef, arguments: Sequence[ast.expr], method: bool, line: int) -> Expr:
        """A call of an own method, or of a function of the module."""
        name = definition.name
        if name in self.calls or len(self.calls) > INLINED_DEPTH:
            raise Refusal(line, f"{name} calls itself, or calls go deeper than {INLINED_DEPTH}")
        names = plain_arguments(definition)
        if method and not names:
            raise Refusal(line, f"{name} has no argument for its object")
        receiver, names = (names[0], names[1:]) if method else ("", names)
        if len(names) != len(arguments) or any(isinstance(a, ast.Starred) for a in arguments):
            raise Refusal(line, f"{name} is called with other arguments than it takes")
        self.made += 1
        scope = Scope(f"@{self.made}", bound_names(definition), receiver)
        if receiver in scope.own:
            raise Refusal(definition.lineno, f"{receiver} is bound anew in {name}")
        first: list[program.Statement] = []
        caller = self.scope
        for argument, value in zip(names, arguments, strict=True):
            view = self.view(value)
            if view is not None:
                if argument in scope.own:
                    raise Refusal(definition.lineno, f"the sequence {argument} is bound anew")
                scope.sequences[argument] = view
                continue
            given = self.expression(value)
            self.scope = scope
            first.append(self.assign(argument, given, line))
            self.scope = caller
        self.scope = scope
        self.calls.append(name)
        outer, self.results = self.results, []
        try:
            body, completes = self.block(definition.body)
        finally:
            self.calls.pop()
            self.scope = caller
            results, self.results = self.results, outer
        if completes or not results:
            raise Refusal(definition.lineno, f"{name} can end without a return: it then gives None")
        if len(set(results)) > 1:
            raise Refusal(definition.lineno, f"{name} returns {' or '.join(sorted(map(_a, set(results))))}")
        inlined = program.Inlined((*first, *body), results[0])
        if self.conditional and any(n.startswith("self.") for n in assigned(inlined.body)):
            raise Refusal(line, f"{name} changes an attribute, and is called only under a condition here")
        return inlined

    # -- statements --------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt]) -> tuple[tuple[program.Statement, ...], bool]:
        """The statements, and whether one can come to their end."""
        found: list[program.Statement] = []
        for statement in statements:
            made, completes = self.statement(statement)
            found += made
            if not completes:
                return tuple(found), False  # what follows is never reached
        return tuple(found), True

    def statement(self, statement: ast.stmt) -> tuple[list[program.Statement], bool]:
        try:
            return self._statement(statement)
        except Refusal as refusal:
            refusal.within(statement)
            raise

    def _statement(self, statement: ast.stmt) -> tuple[list[program.Statement], bool]:
        line = statement.lineno
        match statement:
            case ast.Pass() | ast.Expr(value=ast.Constant()):
                return [], True
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                return self.together(targets, values, line), True
            case ast.Assign(targets=[target], value=value):
                return [self.binding(target, value, line)], True
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                return [self.binding(target, value, line)], True
            case ast.AugAssign(target=ast.Name() | ast.Attribute() as target, op=op, value=value):
                whole = ast.BinOp(_loaded(target), op, value)
                return [self.binding(target, ast.copy_location(whole, statement), line)], True
            case ast.If(test=test, body=body, orelse=orelse):
                return self.branch(test, body, orelse, line)
            case ast.For(orelse=[]):
                return [self.loop(statement)], True
            case ast.Return(value=value):
                return [self.give(value, line)], False
            case ast.Break():
                return [program.Leave("break", line)], False
            case ast.Continue():
                return [program.Leave("continue", line)], False
        raise outside(statement, line)

    def together(self, targets: Sequence[ast.expr], values: Sequence[ast.expr], line: int) -> list[program.Statement]:
        """``a, b = b, a``: every value is found before anything is bound, from left to right."""
        if len(targets) != len(values):
            raise Refusal(line, "names and values that are not as many")
        found: list[program.Statement] = []
        for value in values:
            given = self.expression(value)
            self.made += 1
            found.append(program.Assign(f"#value{self.made}", given, line))
        for target, first in zip(targets, list(found), strict=True):
            assert isinstance(first, program.Assign)
            found.append(self.bind(target, program.Name(first.name, first.value.kind), line))
        return found

    def bind(self, target: ast.expr, value: Expr, line: int) -> program.Statement:
        match target:
            case ast.Name(id=name):
                return self.assign(name, value, line)
            case ast.Attribute(value=ast.Name(id=receiver), attr=attribute) if receiver == self.scope.receiver:
                if not self.making:
                    self.changed.setdefault(attribute, line)
                return self.set_attribute(attribute, value, line)
        raise Refusal(line, "only a name, or an attribute of the object itself, is assigned to")

    def binding(self, target: ast.expr, value: ast.expr, line: int) -> program.Statement:
        match target:
            case ast.Name():
                if isinstance(self.constant(value), Mapping):
                    raise Refusal(line, "a mapping is kept under another name")
            case ast.Attribute(value=ast.Name(id=receiver), attr=attribute) if receiver == self.scope.receiver:
                constant = self.constant(value) if self.making else None
                if isinstance(constant, Mapping):
                    if self.branches or attribute in self.mappings:
                        raise Refusal(line, f"self.{attribute} is a mapping, and bound under a condition or twice")
                    self.mappings[attribute] = constant
                    return program.If(program.Const(True, Kind.BOOL), (), (), line)
            case _:  # `bind` refuses it
                pass
        return self.bind(target, self.expression(value), line)

    def assign(self, name: str, value: Expr, line: int) -> program.Statement:
        full = f"{name}{self.scope.suffix}"
        self.same_kind(full, name, value.kind, line)
        self.scope.bound.add(name)
        return program.Assign(full, value, line)

    def set_attribute(self, attribute: str, value: Expr, line: int) -> program.Statement:
        full = f"self.{attribute}"
        if attribute in self.mappings:
            raise Refusal(line, f"{full} is a mapping and a value")
        self.same_kind(full, full, value.kind, line)
        return program.Assign(full, value, line)

    def same_kind(self, full: str, name: str, kind: Kind, line: int) -> None:
        known = self.kinds.setdefault(full, kind)
        if known is not kind:
            numbers = {known, kind} == {Kind.INT, Kind.FLOAT}
            hint = ": write 0.0 where a float is meant" if numbers else ""
            raise Refusal(line, f"{name} is {_a(known)} elsewhere and {_a(kind)} here{hint}")

    def branch(
        self, test: ast.expr, body: Sequence[ast.stmt], orelse: Sequence[ast.stmt], line: int
    ) -> tuple[list[program.Statement], bool]:
        condition = self.truth(test)
        before = set(self.scope.bound)
        self.branches += 1
        then, one = self.block(body)
        after = self.scope.bound
        self.scope.bound = set(before)
        otherwise, other = self.block(orelse)
        self.branches -= 1
        match one, other:
            case True, True:
                self.scope.bound &= after
            case True, False:
                self.scope.bound = after
            case _:  # what the second branch has bound, or nothing that matters
                pass
        return [program.If(condition, then, otherwise, line)], one or other

    def loop(self, statement: ast.For) -> program.Statement:
        line = statement.lineno
        self.made += 1
        counter = program.Name(f"#{self.made}", Kind.INT)
        count, first, position = self.iterated(statement, counter, line)
        before = set(self.scope.bound)
        head = [self.assign(name, value, line) for name, value in first]
        self.branches += 1
        body, _ = self.block(statement.body)
        self.branches -= 1
        self.scope.bound = before  # a loop may have no turn
        here = range(line - 2, max(line, statement.end_lineno or line))
        comments = tuple((k + 1, text) for k in here if (text := _invariant(self.lines, k)))
        return program.For(counter.name, count, (*head, *body), line, comments, position)

    def iterated(
        self, statement: ast.For, counter: program.Name, line: int
    ) -> tuple[Expr, list[tuple[str, Expr]], program.Name | None]:
        """How often, what each turn begins with, and the loop's own name of its position."""
        target, source = statement.target, statement.iter
        view = self.view(source)
        if view is not None and isinstance(target, ast.Name):
            item = program.Item(view, counter, self.items[view.sequence], line)
            return program.Length(view), [(target.id, item)], None
        match source:
            case ast.Call(func=ast.Name(id="range"), args=[*arguments], keywords=[]) if (
                isinstance(target, ast.Name) and 1 <= len(arguments) <= 2 and "range" not in self.scope.own
            ):
                ends = [self.expression(a) for a in arguments]
                if any(e.kind is not Kind.INT for e in ends):
                    raise Refusal(line, "range of what is no int")
                zero = program.Const(0, Kind.INT)
                low, high = (zero, ends[0]) if len(ends) == 1 else (ends[0], ends[1])
                if not isinstance(low, program.Const):
                    raise Refusal(line, "range that starts at what is no constant")
                size = high if low == zero else program.Binary("-", high, low, Kind.INT, line)
                at: Expr = counter if low == zero else program.Binary("+", low, counter, Kind.INT, line)
                name = program.Name(f"{target.id}{self.scope.suffix}", Kind.INT)
                return program.Extreme("max", (zero, size), Kind.INT), [(target.id, at)], name if low == zero else None
            case ast.Call(func=ast.Name(id="enumerate"), args=[inner], keywords=[]):
                view = self.view(inner)
                match target:
                    case ast.Tuple(elts=[ast.Name(id=index), ast.Name(id=each)]) if view is not None and index != each:
                        item = program.Item(view, counter, self.items[view.sequence], line)
                        name = program.Name(f"{index}{self.scope.suffix}", Kind.INT)
                        return program.Length(view), [(index, counter), (each, item)], name
        raise Refusal(line, "a loop over something else than an input sequence, its part, range or enumerate")

    def give(self, value: ast.expr | None, line: int) -> program.Statement:
        if self.making:
            raise Refusal(line, "__init__ returns early")
        if len(self.calls) > 1 or self.calls[-1] != "step":
            if value is None:
                raise Refusal(line, f"{self.calls[-1]} returns None")
            found = self.expression(value)
            self.results.append(found.kind)
            return program.Give((("", found),), line)
        outputs = {p.name: p for p in self.node.outputs if p.name not in self.memory}
        given: dict[str, ast.expr] = {}
        match value:
            case ast.Dict(keys=keys, values=values):
                for key, part in zip(keys, values, strict=True):
                    if not isinstance(key, ast.Constant) or not isinstance(key.value, str) or key.value in given:
                        raise Refusal(line, "a dict whose keys are not texts, each once")
                    given[key.value] = part
            case ast.Call(func=ast.Name(id="dict"), args=[], keywords=keywords) if all(k.arg for k in keywords):
                given = {str(k.arg): k.value for k in keywords}
            case ast.expr() if len(outputs) == 1:
                given = {next(iter(outputs)): value}
            case _:
                raise Refusal(line, f"a step returns {to_return(outputs)}")
        if set(given) != set(outputs):
            raise Refusal(line, f"a step returns {to_return(outputs)}, here {', '.join(sorted(given)) or '{}'}")
        return program.Give(tuple((name, self.output(name, part, line)) for name, part in given.items()), line)

    def output(self, name: str, value: ast.expr, line: int) -> Expr:
        found, wanted = self.expression(value), kind_of(self.node.output(name).sort)
        whole = wanted is Kind.FLOAT and found.kind is Kind.INT  # a REAL may well be an int: it is the same number
        if found.kind is not wanted and not whole:
            raise Refusal(line, f"the output {name} is {_a(wanted)}, here {_a(found.kind)}")
        return found


def _a(kind: Kind | None) -> str:
    return f"{'an' if kind is Kind.INT else 'a'} {kind}"


def _invariant(lines: Sequence[str], at: int) -> str:
    text = lines[at].partition("#")[2].strip() if 0 <= at < len(lines) else ""
    return text.removeprefix("invariant:").strip() if text.startswith("invariant:") else ""


def _loaded(target: ast.Name | ast.Attribute) -> ast.expr:
    match target:
        case ast.Name(id=name):
            return ast.copy_location(ast.Name(name, ast.Load()), target)
        case ast.Attribute(value=value, attr=attribute):
            return ast.copy_location(ast.Attribute(value, attribute, ast.Load()), target)
