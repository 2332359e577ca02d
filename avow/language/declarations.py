"""The context: elaborates the type and constant declarations of one or several files to an `Environment`.

Declarations may refer to later ones; a cycle is an error. A constant whose value is a set of fresh names declares an
enumeration of that name; the name also denotes the set of its elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.language import sorts as s
from avow.language import syntax
from avow.language.checker import Checker
from avow.language.flat import flat_text
from avow.language.foreign import FOREIGN_TYPES
from avow.language.lexer import Token
from avow.language.scope import Defined, Environment, Scope
from avow.language.source import Reports, Source
from avow.language.subterms import distinct_parts
from avow.language.terms import EnumValue, Quantified, Role, SetTerm, Variable


@dataclass(slots=True)
class _Declared:
    tree: syntax.Declaration
    reports: Reports
    state: str = "new"
    """new, open (being elaborated: meeting it again is a cycle), or done."""

    @property
    def name(self) -> Token:
        return self.tree.name

    @property
    def place(self) -> Span:
        return self.reports.source.span(self.name.start, self.name.end)


@dataclass(slots=True)
class Declarations:
    """Elaborates declarations into `environment`. Use: `add` for each file, then `elaborate`, then `type_of`."""

    environment: Environment = field(default_factory=Environment)
    declared: dict[str, _Declared] = field(default_factory=dict)
    owners: dict[str, str] = field(default_factory=dict)
    """The type declaration that contains each element or constructor: known before anything is elaborated."""
    definitions: dict[str, Defined] = field(default_factory=dict)
    """The definitions of the contexts; each node re-checks those that mention its inputs and outputs."""

    def add(self, trees: Sequence[syntax.Declaration], reports: Reports) -> None:
        for tree in trees:
            if reports.full:
                return
            new = _Declared(tree, reports)
            old = self.declared.get(new.name.text)
            if old is None:
                for part in syntax.walk(tree):
                    if isinstance(part, syntax.Element):
                        self.owners.setdefault(part.name.text, new.name.text)
                self.declared[new.name.text] = new
            elif old.reports is reports or not _same_text(old, new):
                name = new.name.text
                notes = ((f"`{name}` is first declared here", old.place),)
                message = f"`{name}` is declared twice"
                hint = "remove one of the two, or give one of them another name"
                if old.reports is not reports:
                    message = f"`{name}` is declared differently in another file"
                reports.error("RCL210", message, new.name.start, new.name.end, hint=hint, notes=notes)

    def elaborate(self) -> None:
        for name, declared in self.declared.items():
            if name in ("length", "indices") and (name == "length" or isinstance(declared.tree, syntax.Define)):
                declared.reports.error("RCL209", f"`{name}` is built in", declared.name.start, declared.name.end)
        for declared in self.declared.values():
            self.resolve(declared)
        checker = Checker(Scope(self.environment, bare=False, defined=self.definitions), Reports(Source("", "")))
        for name in self.definitions:
            if not self.of_ports(name):
                checker.definition(self.definitions[name])
        for name, declared in self.declared.items():
            if name in self.environment.elements:
                sort = self.environment.elements[name]
                notes = ((f"the element `{name}`", self.environment.places.get(name)),)
                message = f"`{name}` is both declared and an element of {sort.name}"
                declared.reports.error("RCL211", message, declared.name.start, declared.name.end, notes=notes)

    def resolve(self, declared: _Declared) -> None:
        if declared.state != "new":
            return
        environment, name = self.environment, declared.name.text
        environment.places[name] = declared.place
        declared.state = "open"
        match declared.tree:
            case syntax.TypeDeclaration(type=type_):
                sort = self.type_of(type_, declared.reports, name)
                if sort is None:
                    environment.broken.add(name)
                    environment.broken.update(_names(type_))
                else:
                    environment.types[name] = sort
            case syntax.ConstantDeclaration(value=value):
                self.constant(declared, syntax.unparenthesised(value))
            case syntax.Define():
                self.define(declared.tree, declared.reports, self.definitions, Scope(environment, bare=False))
            case _:
                assert_never(declared.tree)
        declared.state = "done"

    # --- definitions -------------------------------------------------------------------------------------------------

    def define(self, tree: syntax.Define, reports: Reports, into: dict[str, Defined], scope: Scope) -> None:
        """Registers a definition by name, with its parameters; its body is checked when it is looked up."""
        parameters: dict[str, Variable] = {}
        sound = True
        no_units(tree.parameters, reports)
        for part in tree.parameters:
            sort = self.type_of(part.type, reports, part.name.text)
            taken = scope.taken(part.name.text)
            if part.name.text in parameters:
                taken = ("a parameter", parameters[part.name.text].span)
            if taken is not None:
                notes = ((f"`{part.name.text}` is declared here", taken[1]),) if taken[1] is not None else ()
                message = f"`{part.name.text}` is already {taken[0]}"
                reports.error("RCL207", message, part.name.start, part.name.end, notes=notes)
            sound = sound and sort is not None and taken is None
            if sort is not None:
                span = reports.source.span(part.name.start, part.name.end)
                parameters[part.name.text] = Variable(Role.BOUND, part.name.text, sort, span)
        if sound:
            into[tree.name.text] = Defined(tuple(parameters.values()), tree, reports, scope.bare)
        else:
            self.environment.broken.add(tree.name.text)

    def of_ports(self, name: str) -> bool:
        """Whether a definition of the context mentions inputs or outputs, directly or through another definition."""
        waiting, seen = [name], {name}
        while waiting:
            tree = self.definitions[waiting.pop()].tree
            for part in syntax.walk(tree.body) if tree is not None else ():
                if isinstance(part, syntax.PortName):
                    return True
                text = (
                    part.text
                    if isinstance(part, syntax.Name)
                    else part.node
                    if isinstance(part, syntax.NodePort)
                    else ""
                )
                if text in self.definitions and text not in seen:
                    seen.add(text)
                    waiting.append(text)
        return False

    # --- constants ---------------------------------------------------------------------------------------------------

    def constant(self, declared: _Declared, value: syntax.TermSyntax) -> None:
        environment, name = self.environment, declared.name.text
        self.needed_by(value)
        fresh = self.fresh_names(value.items) if isinstance(value, syntax.SetDisplay) else []
        if isinstance(value, syntax.SetDisplay) and fresh and len(fresh) == len(value.items):
            members = [Token("NAME", t.text, t.start, t.end) for t in fresh]
            sort = self.enumeration(name, members, declared.reports)
            if sort is None:
                environment.broken.update((name, *(m.text for m in members)))
                return
            environment.types[name] = sort
            span = declared.reports.source.span(value.start, value.end)
            environment.constants[name] = SetTerm(
                tuple(EnumValue(m, sort) for m in sort.members), s.SetSort(sort), span
            )
            return
        term = Checker(Scope(environment), declared.reports).term(value)
        environment.broken.update(tree.text for tree in fresh)
        if term is not None and any(isinstance(part, Quantified) for part in distinct_parts(term)):
            message = "a constant is a value: no quantifier stands in it"
            declared.reports.error("RCL220", message, value.start, value.end, hint="write the formula where it is used")
            term = None
        if term is None:
            environment.broken.add(name)
        else:
            environment.constants[name] = term

    def fresh_names(self, trees: Sequence[syntax.TermSyntax]) -> list[syntax.Name]:
        """The trees that are undeclared names."""
        taken = (self.declared, self.owners, self.environment.elements, s.BUILTINS)
        return [t for t in trees if isinstance(t, syntax.Name) and not any(t.text in names for names in taken)]

    def needed_by(self, value: syntax.TermSyntax) -> None:
        """Elaborates the declarations that a constant's value mentions: other constants, and the types of elements."""
        for name in _names(value):
            owner = self.owners.get(name)
            other = self.declared.get(name) or (self.declared[owner] if owner is not None else None)
            if other is None:
                continue
            if other.state == "open":
                message = f"the declaration of `{name}` refers to itself"
                other.reports.error("RCL212", message, other.name.start, other.name.end)
                self.environment.broken.add(name)
            else:
                self.resolve(other)

    # --- types -------------------------------------------------------------------------------------------------------

    def type_of(self, tree: syntax.TypeSyntax, reports: Reports, name: str) -> s.Sort | None:
        """The sort that a type denotes; `name` is the name for a new set of names."""
        match tree:
            case syntax.Name():
                return self.named(tree, reports)
            case syntax.SetType(elements=()):
                return s.OpaqueSort(self.free_name(name))
            case syntax.SetType(elements=elements):
                return self.set_of(elements, reports, name)
            case syntax.TupleType(items=(only,)):
                return self.type_of(only, reports, name)
            case syntax.TupleType(items=items):
                return _tuple_sort([self.type_of(t, reports, f"{name}_{i + 1}") for i, t in enumerate(items)])
            case syntax.RecordType(fields=fields):
                return self.record(fields, reports, name)
            case syntax.SequenceType(item=of):
                item = self.type_of(of, reports, f"{name}_item")
                return None if item is None else s.SequenceSort(item)
            case syntax.ProductType():
                return _tuple_sort(self.factors(tree, reports, name))
            case syntax.FunctionType():
                return self.function(tree, reports, name)
            case _:
                assert_never(tree)

    def record(self, fields: Sequence[syntax.PortDeclaration], reports: Reports, name: str) -> s.Sort | None:
        sound, seen = True, dict[str, Span]()
        no_units(fields, reports)
        for part in fields:
            label = part.name
            if label.text in seen:
                notes = (("the first is here", seen[label.text]),)
                reports.error("RCL214", f"two fields `{label.text}`", label.start, label.end, notes=notes)
                sound = False
            seen[label.text] = reports.source.span(label.start, label.end)
        items = [self.type_of(part.type, reports, f"{name}_{part.name.text}") for part in fields]
        for part, item in zip(fields, items, strict=True):
            if isinstance(item, s.FunctionSort):
                message = "a field is a value, not a function"
                reports.error("RCL310", message, part.type.start, part.type.end, hint="make it an input of its own")
                sound = False
        kept = tuple(i for i in items if i is not None)
        declared = self.declared.get(name)
        own = name if declared is not None and declared.state == "open" else ""
        return s.TupleSort(kept, tuple(seen), own) if sound and len(kept) == len(items) else None

    def named(self, tree: syntax.Name, reports: Reports) -> s.Sort | None:
        name = tree.text
        environment = self.environment
        other = self.declared.get(name)
        if other is not None and other.state == "open":
            message = f"the type `{name}` refers to itself"
            reports.error("RCL212", message, tree.start, tree.end, hint="use a sequence `<T>` for what repeats")
            return None
        if other is not None:
            self.resolve(other)
        sort = environment.sort(name)
        if sort is not None or name in environment.broken:
            return sort
        if name in environment.constants:
            message = f"`{name}` is a constant, not a type"
            reports.error("RCL208", message, tree.start, tree.end, hint=f"declare a type with `:`: `{name} : …;`")
        elif name in environment.elements:
            message = f"`{name}` is an element of {environment.elements[name].name}, not a type"
            reports.error("RCL208", message, tree.start, tree.end)
        else:
            near = FOREIGN_TYPES.get(name.casefold())
            hint = f"did you mean `{near}`?" if near else did_you_mean(name, (*self.declared, *s.BUILTINS))
            hint = hint or f"declare it in the context: `{name} : …;`, or check this file with the one that declares it"
            reports.error("RCL208", f"the type `{name}` is not declared", tree.start, tree.end, hint=hint)
        return None

    def factors(self, tree: syntax.TypeSyntax, reports: Reports, name: str) -> list[s.Sort | None]:
        """The sorts of a product, or of a function's parameters."""
        if not isinstance(tree, syntax.ProductType):
            return [self.type_of(tree, reports, name)]
        sound = True
        for sign in tree.signs:
            if sign.text != "x":
                message = f"expected `x` between two types and not `{sign.text}`"
                hint = "a function is written `A x B --> C`, a type of sequences `<A>`; there is no type of sets"
                reports.error("RCL120", message, sign.start, sign.end, hint=hint)
                sound = False
        if not sound:
            return [None]
        return [self.type_of(t, reports, f"{name}_{i + 1}") for i, t in enumerate(tree.factors)]

    def function(self, tree: syntax.FunctionType, reports: Reports, name: str) -> s.Sort | None:
        parameters = self.factors(tree.parameters, reports, name)
        result = self.type_of(tree.result, reports, f"{name}_result")
        if result is None or None in parameters:
            return None
        return s.FunctionSort(tuple(p for p in parameters if p is not None), result)

    def set_of(self, elements: Sequence[syntax.Element], reports: Reports, name: str) -> s.Sort | None:
        if not any(e.parameters for e in elements):
            return self.enumeration(name, [e.name for e in elements], reports)
        constructors: list[s.Constructor] = []
        sound = True
        for element in elements:
            sorts = [self.type_of(t, reports, f"{name}_{element.name.text}") for t in element.parameters]
            sound = sound and None not in sorts
            constructors.append(s.Constructor(element.name.text, tuple(part for part in sorts if part is not None)))
        sort = s.DataSort(self.free_name(name), tuple(constructors))
        return self.introduce(sort, [e.name for e in elements], reports) if sound else None

    def enumeration(self, name: str, members: Sequence[Token], reports: Reports) -> s.EnumSort | None:
        sort = s.EnumSort(self.free_name(name), tuple(m.text for m in members))
        found = self.introduce(sort, members, reports)
        return found if isinstance(found, s.EnumSort) else None

    def free_name(self, name: str) -> str:
        """`name` itself for the declaration being elaborated; a set written in place gets an unused name."""
        declared = self.declared.get(name)
        if declared is not None and declared.state == "open":
            return name
        environment, free, number = self.environment, name, 1
        while free in self.declared or environment.sort(free) is not None or free in environment.elements:
            number += 1
            free = f"{name}{number}"
        return free

    def introduce(self, sort: s.EnumSort | s.DataSort, names: Sequence[Token], reports: Reports) -> s.Sort | None:
        """The sort, with its elements declared; or the known sort of an equal set."""
        environment = self.environment
        if sort.name not in self.declared:
            for known in (*environment.types.values(), *environment.anonymous.values()):
                if _same_set(known, sort):
                    return known
        sound = True
        seen: dict[str, Token] = {}
        for name in names:
            if name.text in seen:
                message = f"`{name.text}` occurs twice in this set"
                reports.error("RCL213", message, name.start, name.end)
                sound = False
            elif name.text in environment.elements:
                other = environment.elements[name.text]
                notes = ((f"`{name.text}` of {other.name}", environment.places.get(name.text)),)
                message = f"`{name.text}` is already an element of {other.name}"
                hint = "the elements of types are global: give each its own name"
                reports.error("RCL213", message, name.start, name.end, hint=hint, notes=notes)
                sound = False
            seen[name.text] = name
        if not sound:
            return None
        for name in names:
            environment.places[name.text] = reports.source.span(name.start, name.end)
        if sort.name not in self.declared:
            environment.anonymous[sort.name] = sort
        environment.add_elements(sort)
        return sort


def no_units(ports: Sequence[syntax.PortDeclaration], reports: Reports) -> None:
    """Reports the units of what is no input or output."""
    for token in (part.unit for part in ports):
        if token is not None:
            message = "only an input or output of a number type has a unit"
            reports.error("RCL222", message, token.start, token.end)


def _tuple_sort(items: Sequence[s.Sort | None]) -> s.Sort | None:
    return None if None in items else s.TupleSort(tuple(i for i in items if i is not None))


def _same_set(known: s.Sort, new: s.EnumSort | s.DataSort) -> bool:
    match known, new:
        case s.EnumSort(members=a), s.EnumSort(members=b):
            return a == b
        case s.DataSort(constructors=c), s.DataSort(constructors=d):
            return c == d
    return False


def _same_text(one: _Declared, other: _Declared) -> bool:
    texts = (flat_text(each.reports.source.text[each.tree.start : each.tree.end]) for each in (one, other))
    return len(set(texts)) == 1


def _names(tree: syntax.Syntax) -> set[str]:
    """Every name that occurs in a type or value."""
    found: set[str] = set()
    for part in syntax.walk(tree):
        if isinstance(part, syntax.Name):
            found.add(part.text)
        elif isinstance(part, syntax.NodePort):
            found.add(part.node)
        elif isinstance(part, syntax.Element):
            found.add(part.name.text)
        elif isinstance(part, syntax.Binder):
            found.update(name.text for name in part.names)
        elif isinstance(part, syntax.ProductType):
            found.update(sign.text for sign in part.signs)
    return found
