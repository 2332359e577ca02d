"""A program, the contract's node and the plan's table, made into one checked whole; or what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.formulas.formula import free_variables, substitute
from avow.language import sorts as s
from avow.language.contract import Contract, Node, Port
from avow.language.printer import show_sort, show_term
from avow.language.scope import of_contract
from avow.language.syntax import Application, Name, PortName, TermSyntax
from avow.language.terms import Apply, Role, Term, TupleTerm, Variable

from . import syntax
from .parser import parse_expression
from .program import Assign, Block, If, Match, Predicate, Program, Reading, Skip, Statement, Update, While, variable
from .typing import Expressions, Local, Names, assignments, expect, fitted, rejected, spread

T = TypeVar("T")

Table = Mapping[str, tuple[str, Span]]
"""The plan's `variables`: key as written → meaning as written, and its place."""


_Place = tuple[Role, str]
"""A port's role and name."""


@dataclass(frozen=True, slots=True)
class Checked:
    program: Program
    reading: Reading
    unassigned: frozenset[str]
    """The variables of outputs that some path leaves without a value."""


@dataclass(frozen=True, slots=True)
class _Entry:
    """One line of the table, parsed."""

    port: Port
    parameters: tuple[Variable, ...] | None
    """Of a predicate's pattern; None for a whole port."""
    meaning: syntax.Written
    span: Span


def check(source: syntax.ProgramText, contract: Contract, node: Node, table: Table) -> Checked:
    """Raises Rejected, with everything that is wrong (codes ``HOARE200``, ``HOARE300``, ``HOARE400``)."""
    checker = _Checker(source, contract, node)
    return checker.run(table)


def _covers(term: Term, sort: s.Sort, used: set[Variable]) -> bool:
    """Whether a term can have every value of an input's sort, whatever the terms of other inputs have: it is made of
    variables that are free to take them. Those are then used up."""
    match term:
        case Variable() | Apply(function=Variable()):
            head = term if isinstance(term, Variable) else term.function
            assert isinstance(head, Variable)
            free = head not in used and (term.sort == sort or (term.sort, sort) == (s.INTEGER, s.NATURAL))
            used.add(head)
            return free
        case TupleTerm(items=items) if isinstance(sort, s.TupleSort):
            return all(_covers(item, part, used) for item, part in zip(items, sort.items, strict=True))
        case _:  # no value that is written down
            return False


class _Checker:
    def __init__(self, source: syntax.ProgramText, contract: Contract, node: Node) -> None:
        self.source, self.node = source, node
        self.names = Names(of_contract(contract))
        self.problems: list[Diagnostic] = []
        self.assigned_names = {statement.target.name for statement, _ in assignments(source.body, self.names)}
        self.given: dict[str, Variable] = {}
        self.ghosts: dict[Variable, Variable] = {}
        self.ports: dict[str, Term] = {}

    def run(self, table: Table) -> Checked:
        self._declarations()
        entries = self._attempt(lambda: self._entries(table)) or ()
        self._sorts(entries)
        reading = self._reading(entries)
        body = self._block(self.source.body, {})
        if self.problems:
            raise Rejected(*dict.fromkeys(self.problems))
        sorts = self.names.sorts
        state = tuple(variable(name, sort) for name, sort in sorted(sorts.items()))
        assigned = frozenset(v for v in state if v.name in self.assigned_names)
        spoken = ((at, free_variables(term)) for at, term in reading.terms.items())
        read = (*spoken, *((at, predicate.free) for at, predicate in reading.predicates.items()))
        made = frozenset(v.name for (role, _), some in read if role is Role.OUTPUT for v in some)
        program = Program(body, state, assigned, dict(self.ghosts))
        return Checked(program, reading, program.unassigned(made - frozenset(self.given)))

    def _attempt(self, action: Callable[[], T]) -> T | None:
        try:
            return action()
        except Rejected as bad:
            self.problems.extend(bad.diagnostics)
            return None

    # -- names ---------------------------------------------------------------------------------------------------------

    def _declarations(self) -> None:
        for declaration in self.source.declarations:
            words = (*declaration.parameters, declaration.sort)
            types = {word: found for word in words if (found := self.names.type(word)) is not None}
            self.problems += [self.names.unknown_type(w, declaration.span) for w in words if w not in types]
            if types.keys() != set(words):
                continue
            sort: s.Sort = types[declaration.sort]
            if declaration.parameters:
                sort = s.FunctionSort(tuple(types[p] for p in declaration.parameters), sort)
            for name in declaration.names:
                if name.name in self.names.sorts:
                    self._problem("HOARE200", f"`{name.name}` is declared twice", name.span)
                self.names.sorts[name.name] = sort
                if declaration.is_input:
                    self.given[name.name] = variable(name.name, sort)

    def _sorts(self, entries: tuple[_Entry, ...]) -> None:
        """Give every name its sort: the plan's table first, then the ports' own names, then the assignments."""
        mapped = {(entry.port.role, entry.port.name) for entry in entries}
        for port in (*self.node.inputs, *self.node.outputs):
            wanted = port.role is Role.INPUT or port.name in self.assigned_names
            if (port.role, port.name) not in mapped and wanted:
                self.names.sorts.setdefault(port.name, port.sort)
        known = -1
        while known != len(self.names.sorts):  # what one line of the table says helps to read another
            known = len(self.names.sorts)
            for entry in entries:
                wanted_sort = s.BOOL if entry.parameters is not None else entry.port.sort
                expect(entry.meaning.tree, wanted_sort, self.names, entry.meaning.text)
            spread(self.source, self.names)
        for name in sorted(self.names.sorts):
            if self.names.is_value(name):
                what = f"`{name}` is a value of the contract; a variable needs another name"
                self._problem("HOARE200", what, self._first_use(name))

    def _first_use(self, name: str) -> Span:
        for statement, _ in assignments(self.source.body, self.names):
            if statement.target.name == name:
                return statement.target.span
        return self.source.span

    def _problem(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        self.problems.append(Diagnostic(code, message, span, hint=hint))

    # -- the plan's table ----------------------------------------------------------------------------------------------

    def _entries(self, table: Table) -> tuple[_Entry, ...]:
        entries: list[_Entry] = []
        for key, (text, span) in table.items():
            entry = self._attempt(lambda key=key, text=text, span=span: self._entry(key, text, span))  # type: ignore[misc]
            if entry is None:
                continue
            if any(e.port == entry.port for e in entries):
                self._problem("HOARE400", f"`{key}` is mapped twice", span)
            entries.append(entry)
        return tuple(entries)

    def _entry(self, key: str, text: str, span: Span) -> _Entry:
        pattern, meaning = parse_expression(key, span).tree, parse_expression(text, span)
        if isinstance(pattern, Name | PortName):
            return _Entry(self._port(pattern, key, span), None, meaning, span)
        if isinstance(pattern, Application) and all(isinstance(a, Name) for a in pattern.arguments):
            port = self._port(pattern.function, key, span)
            names = [a.text for a in pattern.arguments if isinstance(a, Name)]
            sort = port.sort
            if not isinstance(sort, s.FunctionSort) or sort.result != s.BOOL:
                raise rejected(
                    "HOARE400", f"`{key}`: {port.role}.{port.name} is {show_sort(port.sort)}, no relation", span
                )
            if len(names) != len(sort.parameters) or len(set(names)) != len(names):
                message = f"`{key}` needs {len(sort.parameters)} different names for its arguments"
                raise rejected("HOARE400", message, span)
            parameters = tuple(variable(n, part) for n, part in zip(names, sort.parameters, strict=True))
            return _Entry(port, parameters, meaning, span)
        raise rejected("HOARE400", f"`{key}` is neither a port (in.r) nor a relation with names (out.done(i))", span)

    def _port(self, written: TermSyntax, key: str, span: Span) -> Port:
        assert isinstance(written, Name | PortName)
        name = written.text if isinstance(written, Name) else f"{written.role}.{written.name}"
        ports = [p for p in (*self.node.inputs, *self.node.outputs) if name in (p.name, p.variable.qualified)]
        if len(ports) == 1:
            return ports[0]
        if ports:
            raise rejected(
                "HOARE400", f"`{key}`: there is an input and an output of that name; write in. or out.", span
            )
        known = [f"{p.role}.{p.name}" for p in (*self.node.inputs, *self.node.outputs)]
        raise rejected("HOARE400", f"`{key}`: the node has no such input or output", span, did_you_mean(name, known))

    # -- what the ports are in the program -----------------------------------------------------------------------------

    def _reading(self, entries: tuple[_Entry, ...]) -> Reading:
        found: dict[_Place, Predicate] = {}
        spans = {(entry.port.role, entry.port.name): entry.span for entry in entries}
        for entry in entries:
            meaning = self._attempt(lambda entry=entry: self._meaning(entry))  # type: ignore[misc]
            if meaning is not None:
                found[entry.port.role, entry.port.name] = meaning
        for port in (*self.node.inputs, *self.node.outputs):
            at = (port.role, port.name)
            if at not in spans and port.name in self.names.sorts:
                same = variable(port.name, self.names.sorts[port.name])
                place = port.span or self.source.span
                made = self._attempt(lambda same=same, port=port, place=place: fitted(same, port.sort, place))  # type: ignore[misc]
                if made is not None:
                    found[at] = Predicate((), made)
        self._givens(found)
        self._outputs(found, spans)
        ghosts: dict[Variable, Term] = dict(self.ghosts)
        first = {at: Predicate(p.parameters, substitute(p.meaning, ghosts)) for at, p in found.items()}
        read = {at: first[at] if at[0] is Role.INPUT else p for at, p in found.items()}
        terms = {at: p.meaning for at, p in read.items() if not p.parameters}
        self.ports = {name: t for (role, name), t in terms.items() if role is Role.INPUT}
        plain = all(isinstance(p.meaning, Variable) and not p.parameters for p in found.values())
        relations = {at: p for at, p in read.items() if p.parameters}
        return Reading(terms, relations, self._restrictions(found), not plain)

    def _meaning(self, entry: _Entry) -> Predicate:
        """What a line of the table says; of a whole port without parameters."""
        if entry.parameters is None:
            whole = Expressions(self.names, entry.meaning.text, {}).read(entry.meaning.tree, entry.port.sort)
            if isinstance(entry.port.sort, s.FunctionSort) and not isinstance(whole, Variable):
                message = "a function can only be read as a function variable of the program"
                raise rejected("HOARE400", message, entry.span)
            return Predicate((), whole)
        taken = [p.name for p in entry.parameters if self.names.is_value(p.name)]
        if taken:
            raise rejected("HOARE400", f"`{taken[0]}` is a value of the contract, no name for an argument", entry.span)
        local = {p.name: p.sort for p in entry.parameters}
        expressions = Expressions(self.names, entry.meaning.text, local, asserts=True)
        return Predicate(entry.parameters, expressions.read(entry.meaning.tree, s.BOOL))

    def _givens(self, found: Mapping[_Place, Predicate]) -> None:
        for (role, _), read in found.items():
            if role is Role.INPUT:
                self.given.update((v.name, v) for v in read.free)
        for name, given in self.given.items():
            if name in self.assigned_names:
                self.ghosts[given] = variable(f"{name}₀", given.sort)

    def _outputs(self, found: Mapping[_Place, Predicate], spans: Mapping[_Place, Span]) -> None:
        """What an output is read as must be something that the program sets or is given."""
        known = sorted({*self.assigned_names, *self.given})
        for at, read in found.items():
            for used in sorted(read.free, key=lambda v: v.name):
                if at[0] is Role.OUTPUT and used.name not in known and at in spans:
                    message = f"the program neither sets nor is given `{used.name}`"
                    self._problem("HOARE400", message, spans[at], did_you_mean(used.name, known))

    def _restrictions(self, found: Mapping[_Place, Predicate]) -> tuple[str, ...]:
        """Readings of inputs that leave out some of an input's values: the claim is then about the others."""
        limits: list[str] = []
        used: set[Variable] = set()
        for (role, name), read in sorted(found.items(), key=lambda item: (bool(item[1].parameters), item[0])):
            shown = show_term(read.meaning, "unicode")
            if role is Role.INPUT and read.parameters:
                limits.append(f"in.{name}(…) is {shown}: the plan covers no other relation")
            elif role is Role.INPUT and not _covers(read.meaning, sort := self.node.input(name).sort, used):
                kind = "" if read.meaning.sort == sort else f", {show_sort(read.meaning.sort)}"
                limits.append(f"in.{name} is {shown}{kind}: the plan covers no other value of it")
        return tuple(limits)

    # -- statements ----------------------------------------------------------------------------------------------------

    def _read(self, tree: TermSyntax, local: Local, sort: s.Sort | None = None) -> Term:
        return Expressions(self.names, self.source.text, local).read(tree, sort)

    def _block(self, body: tuple[syntax.Statement, ...], local: Local) -> Block:
        made = (self._attempt(lambda each=each: self._statement(each, local)) for each in body)  # type: ignore[misc]
        return tuple(statement for statement in made if statement is not None)

    def _statement(self, statement: syntax.Statement, local: Local) -> Statement:
        match statement:
            case syntax.Skip(span=span):
                return Skip(span)
            case syntax.Assign():
                return self._assign(statement, local)
            case syntax.If(condition=condition, then=then, otherwise=otherwise, span=span):
                test = self._attempt(lambda: self._read(condition, local, s.BOOL))
                first, second = self._block(then, local), self._block(otherwise, local)
                return Skip(span) if test is None else If(test, first, second, span)
            case syntax.Match():
                return self._match(statement, local)
            case syntax.While(condition=condition, invariant=invariant, variant=variant, body=body, span=span):
                test = self._attempt(lambda: self._read(condition, local, s.BOOL))
                asserting = Expressions(self.names, self.source.text, local, self.ports, asserts=True)
                holds = self._attempt(lambda: asserting.read(invariant, s.BOOL))
                measure = self._attempt(lambda: self._measure(variant, local)) if variant is not None else None
                inside = self._block(body, local)
                return Skip(span) if test is None or holds is None else While(test, holds, measure, inside, span)

    def _measure(self, variant: TermSyntax, local: Local) -> Term:
        measure = Expressions(self.names, self.source.text, local, self.ports, asserts=True).read(variant)
        if measure.sort not in (s.INTEGER, s.NATURAL):
            raise rejected("HOARE300", f"a variant is an integer; this is {show_sort(measure.sort)}", measure.span)
        return measure

    def _assign(self, statement: syntax.Assign, local: Local) -> Statement:
        name = statement.target
        if name.name in local or self.names.is_value(name.name):
            raise rejected("HOARE200", f"`{name.name}` is no variable: it cannot be assigned", name.span)
        sort = self.names.sorts.get(name.name)
        if sort is None:
            value = self._read(statement.value, local)  # says what is wrong with it, if something is
            if statement.arguments:
                known = [n for n, part in self.names.sorts.items() if isinstance(part, s.FunctionSort)]
                declare = f"declare it (VAR {name.name} : A --> B;) or assign a whole map first"
                hint = did_you_mean(name.name, known) or declare
                raise rejected("HOARE200", f"nothing says which map `{name.name}` is", name.span, hint)
            raise rejected("HOARE300", f"the sort of `{name.name}` is unclear ({show_sort(value.sort)}?)", name.span)
        target = variable(name.name, sort)
        if not statement.arguments:
            value = self._read(statement.value, local, sort)
            if isinstance(sort, s.FunctionSort) and not isinstance(value, Variable):
                raise rejected("HOARE300", "only a whole map can be assigned to a map", value.span)
            return Assign(target, value, statement.span)
        if not isinstance(sort, s.FunctionSort):
            whole = "a sequence is assigned as a whole: s := [a, b]" if isinstance(sort, s.SequenceSort) else None
            raise rejected("HOARE300", f"`{name.name}` is {show_sort(sort)}, no map", name.span, whole)
        if len(statement.arguments) != len(sort.parameters):
            message = f"`{name.name}` takes {len(sort.parameters)} argument(s), not {len(statement.arguments)}"
            raise rejected("HOARE300", message, statement.span)
        pairs = zip(statement.arguments, sort.parameters, strict=True)
        arguments = tuple(self._read(argument, local, parameter) for argument, parameter in pairs)
        return Update(target, arguments, self._read(statement.value, local, sort.result), statement.span)

    def _match(self, statement: syntax.Match, local: Local) -> Statement:
        subject = self._read(statement.subject, local)
        name, sort, elements = statement.constructor, subject.sort, self.names.environment.elements
        if not isinstance(sort, s.DataSort) or elements.get(name.name) != sort:
            known = [c.name for c in sort.constructors] if isinstance(sort, s.DataSort) else []
            message = f"`{name.name}` does not make values of {show_sort(sort)}"
            element = f"MATCH takes constructors with arguments apart; for an element, write IF (… == {name.name})"
            hint = element if isinstance(sort, s.EnumSort) else did_you_mean(name.name, known)
            raise rejected("HOARE300", message, name.span, hint)
        parameters = sort.constructor(name.name).parameters
        if len(parameters) != len(statement.variables):
            message = f"`{name.name}` has {len(parameters)} argument(s), not {len(statement.variables)}"
            raise rejected("HOARE300", message, name.span)
        inner = dict(local)
        for found, parameter in zip(statement.variables, parameters, strict=True):
            if found.name in inner or found.name in self.names.sorts or self.names.is_value(found.name):
                raise rejected("HOARE200", f"`{found.name}` is in use already", found.span)
            inner[found.name] = parameter
        bound = tuple(variable(v.name, inner[v.name]) for v in statement.variables)
        then, otherwise = self._block(statement.then, inner), self._block(statement.otherwise, local)
        return Match(subject, name.name, bound, then, otherwise, statement.span)
