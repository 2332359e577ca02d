"""The formula checker, part one: the parts' common base, literals, and name resolution."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from fractions import Fraction

from avow.base.diagnostics import Span
from avow.base.plain import count
from avow.base.suggestions import did_you_mean, suggest
from avow.language.conversions import convert
from avow.language.foreign import APART, FIELDS, WORDS
from avow.language.lexer import KEYWORDS, Token, unquote
from avow.language.printer import show_sort
from avow.language.scope import Scope
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, STRING, EnumSort, Sort, TupleSort
from avow.language.source import Reports
from avow.language.syntax import Name, NodePort, Number, Syntax, TermSyntax, Text
from avow.language.terms import Construct, EnumValue, Item, Literal, Past, Role, Term, Variable


class Names(ABC):
    """Literals and names, with a formula's scope and its reports. The scope's `bound` variables change during a check
    and are restored afterwards."""

    def __init__(self, scope: Scope, reports: Reports) -> None:
        self.scope = scope
        self.reports = reports

    def formula(self, tree: TermSyntax) -> Term | None:
        """A term of sort BOOL."""
        term = self.term(tree, BOOL)
        if term is None or term.sort == BOOL:
            return term
        shown = show_sort(term.sort)
        hint = "compare it each time, as in `s == red or s == green`, or apply it to its arguments"
        message = f"this must be true or false, and it is of type {shown}"
        self.error("RCL301", message, tree, hint=hint, notes=self.declared(term))
        return None

    @abstractmethod
    def term(self, tree: TermSyntax, expected: Sort | None = None) -> Term | None:
        """A term of any sort; `expected` is used only if the text leaves the sort open (``<>``)."""

    @abstractmethod
    def history(self, tree: TermSyntax, operator: Past, arguments: Sequence[TermSyntax]) -> Term | None:
        """A term with an operator that refers to other steps."""

    @abstractmethod
    def defined(self, tree: Syntax, name: str, arguments: Sequence[TermSyntax]) -> Term | None:
        """A definition of the scope applied to these arguments."""

    def error(
        self,
        code: str,
        message: str,
        at: Syntax | Token,
        *,
        hint: str | None = None,
        notes: tuple[tuple[str, Span | None], ...] = (),
    ) -> None:
        self.reports.error(code, message, at.start, at.end, hint=hint, notes=notes)

    def declared(self, term: Term) -> tuple[tuple[str, Span | None], ...]:
        """A note on where a port is declared: the mistake may be there."""
        role = term.role if isinstance(term, Variable) else Role.BOUND
        port = self.scope.ports(role).get(term.name) if isinstance(term, Variable) and role is not Role.BOUND else None
        return ((f"`{port.name}` is declared as {port.type_name} here", port.span),) if port is not None else ()

    def span(self, tree: Syntax | Token) -> Span:
        return self.reports.source.span(tree.start, tree.end)

    def between(self, first: TermSyntax, last: TermSyntax) -> Span:
        """The span from the start of one part to the end of another."""
        return self.reports.source.span(first.start, last.end)

    def text(self, tree: Syntax) -> str:
        text = " ".join(self.reports.source.text[tree.start : tree.end].split())
        return text if len(text) <= 40 else text[:39] + "…"

    def terms(self, trees: Iterable[TermSyntax]) -> list[Term | None]:
        return [self.term(t) for t in trees]

    def wanted(self, tree: TermSyntax, sort: Sort, what: str) -> Term | None:
        """The term, converted to the sort that its context requires."""
        term = self.term(tree, sort)
        if term is None:
            return None
        converted = convert(term, sort)
        if converted is None:
            message = f"{what} must be of type {show_sort(sort)} and is of type {show_sort(term.sort)}"
            self.error("RCL303", message, tree, notes=self.declared(term))
        return converted

    def has_sort(
        self, tree: TermSyntax, term: Term, kinds: type | tuple[type, ...], code: str, what: str, hint: str = ""
    ) -> bool:
        """Whether a term has a sort of one of these kinds; reports it if not."""
        if isinstance(term.sort, kinds):
            return True
        message = f"{what}, and this is of type {show_sort(term.sort)}"
        self.error(code, message, tree, hint=hint or None, notes=self.declared(term))
        return False

    # --- literals ----------------------------------------------------------------------------------------------------

    def number(self, tree: Number, span: Span, sign: int = 1) -> Term:
        if "." in tree.digits:
            return Literal(sign * Fraction(tree.digits), REAL, span)
        value = sign * int(tree.digits)
        return Literal(value, NATURAL if value >= 0 else INTEGER, span)

    def string(self, tree: Text) -> Term | None:
        if not tree.text.endswith('"') or tree.start in self.reports.odd:
            return None  # other quotation marks, or no closing one: reported by the lexer
        return Literal(unquote(tree.text), STRING, self.span(tree))

    # --- names -------------------------------------------------------------------------------------------------------

    def name(self, tree: Name, expected: Sort | None) -> Term | None:
        name = tree.text
        scope, environment = self.scope, self.scope.environment
        if name in scope.bound:
            bound = scope.bound[name]
            return Variable(bound.role, bound.name, bound.sort, self.span(tree))
        if name in scope.defined:
            return self.defined(tree, name, ())
        ports = (Role.INPUT, Role.OUTPUT) if scope.bare else ()
        candidates = [r for r in ports if name in scope.ports(r) and r in scope.roles]
        if len(candidates) == 2:
            hint = f"write `in.{name}` or `out.{name}`"
            self.error("RCL202", f"`{name}` is both an input and an output of node `{scope.node}`", tree, hint=hint)
            return None
        if candidates and (name in environment.elements or name in environment.constants):
            what = "an element of a type" if name in environment.elements else "a constant"
            port = f"{candidates[0]}.{name}"
            message = (
                f"`{name}` is {what}, and an {'in' if candidates[0] is Role.INPUT else 'out'}put of node `{scope.node}`"
            )
            hint = f"write `{port}` for that; to speak of the other, rename one of them"
            self.error("RCL202", message, tree, hint=hint)
            return None
        if candidates:
            return self.port(candidates[0], name, tree)
        if name in environment.elements:
            return self.element(name, tree)
        if name in environment.constants:
            return environment.constants[name]
        if environment.sort(name) is not None:
            self.error("RCL204", f"`{name}` is a type, not a value", tree)
        elif name in scope.nodes:
            hint = f"name one of its inputs or outputs: `{name}.…`"
            self.error("RCL204", f"`{name}` is a node, not a value", tree, hint=hint)
        else:
            self.undeclared(name, tree, text=expected == STRING)
        return None

    def undeclared(self, name: str, tree: Syntax, what: str = "name", *, text: bool = False) -> None:
        """Reports an undeclared name; `text`: a string is expected."""
        if self.scope.is_broken(name) or tree.start in self.reports.odd:  # the latter is reported by the lexer
            return
        known = self.scope.known() if what == "name" else (*self.scope.known(), *map(str, Past), "always")
        owners = [n.name for n in self.scope.nodes.values() if any(p.name == name for p in (*n.inputs, *n.outputs))]
        hint = f"write {' or '.join(f'`{owner}.{name}`' for owner in owners)}" if owners else None
        hint = hint or WORDS.get(name.casefold()) or did_you_mean(name, known)
        if hint is None and text:
            hint = f'write texts in quotation marks: `"{name}"`'
        if hint is None and what == "name":
            hint = "declare it in the context, among the inputs or outputs, or in a quantifier: `exists(x in REAL | …)`"
        self.error("RCL201", f"the {what} `{name}` is not declared", tree, hint=hint)

    def element(self, name: str, tree: Syntax) -> Term | None:
        sort = self.scope.environment.elements[name]
        if isinstance(sort, EnumSort):
            return EnumValue(name, sort, self.span(tree))
        wanted = len(sort.constructor(name).parameters)
        if wanted:
            shown = ", ".join(show_sort(p) for p in sort.constructor(name).parameters)
            hint = f"write `{name}({shown})` with a term for each type"
            self.error("RCL305", f"`{name}` needs {count(wanted, 'argument')}", tree, hint=hint)
            return None
        return Construct(name, (), sort, self.span(tree))

    def port(self, role: Role, name: str, tree: Syntax) -> Term | None:
        port = self.scope.ports(role).get(name)
        if port is None or role not in self.scope.roles:
            self.no_port(role, name, tree)
            return None
        return port.value or Variable(role, name, port.sort, self.span(tree))

    def no_port(self, role: Role, name: str, tree: Syntax) -> None:
        scope = self.scope
        if scope.is_broken(name) or name in KEYWORDS:  # the latter is reported by the lexer
            return
        if scope.node is None:
            message = f"no node is meant here, so `{role}.{name}` has no meaning"
            self.error("RCL203", message, tree, hint="write `node.port`")
            return
        if name in scope.ports(role):
            self.error("RCL203", f"the {role}puts of a node have no place here: `{role}.{name}`", tree)
            return
        other = Role.OUTPUT if role is Role.INPUT else Role.INPUT
        hint = did_you_mean(name, scope.ports(role))
        if name in scope.ports(other):
            hint = f"it is an {other}put: write `{other}.{name}`"
        elif taken := scope.taken(name):
            hint = f"write `{name}` alone: it is {taken[0]}"
        self.error("RCL203", f"{scope.named} has no {role}put `{name}`", tree, hint=hint)

    def field(self, record: Term | None, name: str, tree: Syntax) -> Term | None:
        """``p.x`` of a record."""
        if record is None:
            return None
        sort = record.sort
        if isinstance(sort, TupleSort) and name in sort.labels:
            position = sort.labels.index(name)
            return Item(record, position, sort.items[position], self.span(tree)).rebuild((record,))
        labels = sort.labels if isinstance(sort, TupleSort) else ()
        hint = did_you_mean(name, labels) or f"its fields are {', '.join(labels)}" if labels else FIELDS
        if not labels:
            hint = WORDS.get(name) or (APART if isinstance(sort, TupleSort) else hint)
        self.error("RCL312", f"a value of type {show_sort(sort)} has no field `{name}`", tree, hint=hint)
        return None

    def elsewhere(self, before: str, name: str, tree: Syntax) -> None:
        """Reports `before.name` inside a node: a misspelt role, a field, or another node's variable."""
        scope = self.scope
        own = [f"`{r}.{name}`" for r in (Role.INPUT, Role.OUTPUT) if name in scope.ports(r)]
        message = f"`{before}.{name}` has no meaning inside a node"
        hint = f"write {' or '.join(own) or '`in.…` or `out.…`'}: a contract speaks of its own inputs and outputs only"
        if scope.environment.sort(before) is not None:
            message, hint = f"`{before}` is a type and has no fields", "write its elements alone"
        self.error("RCL205", message, tree, hint=hint)

    def node_port(self, tree: NodePort) -> Term | None:
        node_name, role_text, name = tree.node, tree.role, tree.name
        scope = self.scope
        bare = Name(tree.start, tree.start + len(node_name), 1, node_name)
        known = scope.taken(node_name) is not None and scope.environment.sort(node_name) is None
        if role_text is None and node_name not in scope.nodes and known:
            return self.field(self.term(bare), name, tree)
        if not scope.nodes:
            self.elsewhere(node_name, name, tree)
            return None
        node = scope.nodes.get(node_name)
        if node is None:
            self.error("RCL206", f"there is no node `{node_name}`", tree, hint=did_you_mean(node_name, scope.nodes))
            return None
        roles = [Role(role_text)] if role_text else [Role.INPUT, Role.OUTPUT]
        ports = [
            p
            for p in (*node.inputs, *node.fixed, *node.outputs)
            if p.name == name and p.role in roles and p.role in scope.roles
        ]
        if not ports:
            near = suggest(name, (p.name for p in (*node.inputs, *node.outputs)))
            self.error("RCL203", f"node `{node_name}` has no input or output `{name}`", tree, hint=near)
            return None
        if len(ports) > 1:
            hint = f"write `{node_name}.in.{name}` or `{node_name}.out.{name}`"
            self.error("RCL202", f"`{name}` is both an input and an output of node `{node_name}`", tree, hint=hint)
            return None
        return ports[0].value or Variable(ports[0].role, f"{node_name}.{name}", ports[0].sort, self.span(tree))
