"""Warnings: text that is legal and probably a mistake. Each has a code (RCL4xx) and can be switched off.

A plan's `lints_off` switches one off for a system. So does a comment ``// avow: allow RCL401``: after code, for its
line; on a line of its own, for the declaration, node or part of a node that follows; at the head of a file, for the
whole file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import permutations

from avow.base.codes import is_lint
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.suggestions import distance
from avow.language import terms as t
from avow.language.bracketing import misreadings
from avow.language.contract import Contract, Node
from avow.language.lexer import Token
from avow.language.lookups import lookups
from avow.language.printer import show_sort, show_term
from avow.language.sentences import elements_of, mismatches
from avow.language.sorts import BOOL, EnumSort, FunctionSort, NaturalSort
from avow.language.source import Reports
from avow.language.subterms import subterms
from avow.language.syntax import Define, FileSyntax, Name, NodePort, NodeSyntax, Syntax, walk

_ALLOW = re.compile(r"\bavow:\s*allow\b([^\n*]*)")
_CODE = re.compile(r"[A-Za-z]+[0-9]+")


@dataclass(frozen=True, slots=True)
class LintedFile:
    """The lints' input for a file: its syntax, its comments, and its reports."""

    syntax: FileSyntax
    comments: tuple[Token, ...]
    first_token: int
    reports: Reports


def lint(files: Sequence[LintedFile], nodes: Sequence[Node], contract: Contract | None, off: frozenset[str]) -> None:
    """Report every warning about the files, about their sound nodes, and about the contract that the files declare if
    all of it is sound."""
    found: list[Diagnostic] = []
    trees = [(file, tree) for file in files for tree in file.syntax.nodes]
    for file, tree in trees:
        found.extend(_about_text(file, tree))
    for node in nodes:
        found.extend(_about_node(node))
    if contract is not None:
        found.extend(of_all(contract, files, (spoken(tree) for _, tree in trees)))
        for file, tree in trees:
            found.extend(_in_vain(file, tree.definitions, spoken(tree)))
    tell(found, files, off)


def of_node(file: LintedFile, tree: NodeSyntax, node: Node) -> Iterator[Diagnostic]:
    """The warnings that depend only on the text of one node and the declarations that it names."""
    yield from _about_text(file, tree)
    yield from _about_node(node)
    yield from _in_vain(file, tree.definitions, spoken(tree))


def of_all(contract: Contract, files: Sequence[LintedFile], of_nodes: Iterable[frozenset[str]]) -> Iterator[Diagnostic]:
    """The warnings that depend on all nodes together. `of_nodes`: the names that each of them mentions."""
    yield from _spellings(contract)
    contexts = [(file, [d for d in file.syntax.declarations if isinstance(d, Define)]) for file in files]
    if any(trees for _, trees in contexts):
        named = frozenset(name for _, trees in contexts for tree in trees for name in _spoken(tree.body))
        named = named.union(*of_nodes)
        for file, trees in contexts:
            yield from _in_vain(file, trees, named)


def tell(found: Iterable[Diagnostic], files: Sequence[LintedFile], off: frozenset[str]) -> None:
    """Report the warnings neither switched off, by code or whole message, nor allowed by the files' comments. They are
    reported in order of place, so that the same ones are kept where there are too many."""
    by_name = {file.reports.source.file: file for file in files}
    allowances = {name: _allowances(file) for name, file in by_name.items()}
    places = []
    for diagnostic in (*found, *(unknown for file in files for unknown in _no_lints(file))):
        span = diagnostic.span
        if {diagnostic.code, diagnostic.message} & off or span is None or span.file not in by_name:
            continue
        if not any(diagnostic.code in codes and a <= span.line <= b for codes, a, b in allowances[span.file]):
            places.append(((span.line, span.column, diagnostic.code, diagnostic.message), span.file, diagnostic))
    for _, name, diagnostic in sorted(places, key=lambda found: found[0]):
        by_name[name].reports.add(diagnostic)


def _warning(
    code: str, message: str, span: Span | None, hint: str | None = None, *notes: tuple[str, Span | None]
) -> Diagnostic:
    return Diagnostic(code, message, span, Severity.WARNING, hint, notes)


# --- comments that allow ---------------------------------------------------------------------------------------------


def allows(comment: Token) -> bool:
    """Whether the comment allows a lint."""
    return _ALLOW.search(comment.text) is not None


def _allowances(file: LintedFile) -> list[tuple[frozenset[str], int, int]]:
    """The codes that comments allow, each with the first and last line to which they apply."""
    source = file.reports.source
    found = []
    for comment in file.comments:
        match = _ALLOW.search(comment.text)
        if match is None:
            continue
        codes = frozenset(_CODE.findall(match.group(1)))
        line, _ = source.place(comment.start)
        before = source.text[source.text.rfind("\n", 0, comment.start) + 1 : comment.start]
        if comment.end <= file.first_token:
            found.append((codes, 1, 1 << 60))
        elif before.strip():
            found.append((codes, line, line))
        else:
            following = [part for part in file.syntax.parts if part[0] >= comment.end]
            start = min((part[0] for part in following), default=None)
            if start is not None:
                end = max(part[1] for part in following if part[0] == start)
                found.append((codes, source.place(start)[0], source.place(end)[0]))
    return found


def _no_lints(file: LintedFile) -> Iterator[Diagnostic]:
    """Warnings about allowed codes that are not a lint's."""
    for comment in file.comments:
        match = _ALLOW.search(comment.text)
        for code in sorted(set(_CODE.findall(match.group(1)))) if match is not None else ():
            if not is_lint(code):
                span = file.reports.source.span(comment.start, comment.end)
                yield _warning("RCL410", f"`{code}` is not the code of a lint", span)


# --- about the text --------------------------------------------------------------------------------------------------


def _about_text(file: LintedFile, node: NodeSyntax) -> Iterator[Diagnostic]:
    source = file.reports.source
    for clause in node.clauses:
        if clause.formula is None:
            continue
        parts = (clause.chance.given, clause.formula) if clause.chance is not None else (clause.formula,)
        for reading in (found for part in parts if part is not None for found in misreadings(part, source.text)):
            span = source.span(reading.start, reading.end)
            yield _warning(
                "RCL401",
                f"`{reading.mixed}` beside `{reading.operator}` without parentheses: another bracketing means "
                "something else",
                span,
                f"it is read as `{reading.shown}`: put the parentheses that you mean",
            )
    for topic in node.topics.items if node.topics is not None else ():
        name, role, matched = topic.name, topic.role, topic.port
        if matched is not None and role is None:
            inputs = {p.name.text for p in node.inputs.items} if node.inputs is not None else set()
            which = "in" if matched.text in inputs else "out"
            yield _warning(
                "RCL409",
                f"the topic `{name.text}` matches a bare `{matched.text}`",
                source.span(matched.start, matched.end),
                f"write `matches({which}.{matched.text})`",
            )


def _in_vain(file: LintedFile, trees: Iterable[Define], named: Collection[str]) -> Iterator[Diagnostic]:
    """Unused definitions (`named`: the names in use), and unused parameters."""
    span = file.reports.source.span
    for tree in trees:
        name = tree.name.text
        if name not in named:
            yield _warning("RCL418", unspoken(name), span(tree.name.start, tree.name.end), "remove it, or use it")
        for part in tree.parameters:
            if part.name.text not in _spoken(tree.body):
                message = f"the definition `{name}` does not speak of its parameter `{part.name.text}`"
                yield _warning("RCL418", message, span(part.name.start, part.name.end), "remove it, or use it")


def unspoken(name: str) -> str:
    """The message of RCL418 for a definition that nothing uses."""
    return f"nothing speaks of the definition `{name}`"


def spoken(node: NodeSyntax) -> frozenset[str]:
    """The names that a node's definitions and clauses mention."""
    bodies = [*(d.body for d in node.definitions), *(c.formula for c in node.clauses if c.formula is not None)]
    bodies += [c.chance.given for c in node.clauses if c.chance is not None and c.chance.given is not None]
    return frozenset(name for body in bodies for name in _spoken(body))


def _spoken(tree: Syntax) -> set[str]:
    parts = list(walk(tree))
    heads = {part.node for part in parts if isinstance(part, NodePort)}  # `p.x` of a record
    return heads | {part.text for part in parts if isinstance(part, Name)}


# --- about a node ----------------------------------------------------------------------------------------------------


def _about_node(node: Node) -> Iterator[Diagnostic]:
    written = not node.unwritten
    in_clauses = {v for clause in node.clauses for v in _variables(clause.spoken)}
    in_guarantees = {v for clause in node.guarantees for v in _variables(clause.spoken)}
    for port in node.inputs if written else ():
        if (t.Role.INPUT, port.name) not in in_clauses:
            message = f"no clause of `{node.name}` speaks of its input `{port.name}`"
            yield _warning("RCL402", message, port.span, "remove it, or say what the node does with it")
    for port in node.outputs if written else ():
        if (t.Role.OUTPUT, port.name) not in in_guarantees:
            message = f"no guarantee of `{node.name}` speaks of its output `{port.name}`: it may be anything"
            yield _warning("RCL403", message, port.span, "add a guarantee about it, or remove it")
    matched = {(topic.port.role, topic.port.name) for topic in node.topics if topic.port is not None}
    ports = (*node.inputs, *node.outputs)
    for topic in node.topics if written else ():
        if topic.port is None:
            near = next((p for p in ports if p.name == topic.name), None)
            hint = f"write `{topic.name} matches({near.role}.{near.name})`" if near is not None else None
            message = f"no variable of `{node.name}` matches the topic `{topic.name}`"
            yield _warning("RCL404", message, topic.span, hint or "write `matches(in.…)` or `matches(out.…)`")
    silent = [p for p in ports if (p.role, p.name) not in matched and not p.parameter]
    if node.topics:
        for port in silent:
            message = uncarried(node.name, f"{port.role}.{port.name}")
            yield _warning("RCL405", message, port.span, "list its topic, with `matches(…)`")
    elif silent:
        names = ", ".join(f"`{p.role}.{p.name}`" for p in silent[:6]) + (", …" if len(silent) > 6 else "")
        yield _warning("RCL405", f"`{node.name}` has no topics: nothing carries {names}", silent[0].span)
    carriers: dict[tuple[t.Role, str], str] = {}
    for topic in node.topics:
        if topic.port is None:
            continue
        first = carriers.setdefault((topic.port.role, topic.port.name), topic.name)
        if first != topic.name:
            message = f"two topics carry `{topic.port.role}.{topic.port.name}`: `{first}` and `{topic.name}`"
            yield _warning("RCL411", message, topic.span, "a monitor needs a `mapping` that says which it reads")
    for clause in node.assumptions:
        if clause.formula != t.TRUE and _always(clause.formula):
            message = f"the assumption `{clause.name}` says nothing: the types of the inputs make it true"
            yield _warning("RCL408", message, clause.formula.span, "leave it out, or say what was meant")
        spoken = sorted(name for role, name in _variables(_now(clause.formula)) if role is t.Role.OUTPUT)
        if spoken:
            message = f"the assumption `{clause.name}` speaks of the node's own output `{spoken[0]}`"
            yield _warning("RCL416", message, clause.formula.span, "assume of inputs, guarantee of outputs")
    elements = elements_of((node,)) if any(clause.sentence for clause in node.clauses) else {}
    for clause in node.clauses:
        for unused in _unused(clause.spoken):
            message = f"`{unused.name}` is quantified and never used"
            yield _warning("RCL407", message, unused.span, "remove it, or tie it to what was meant")
        for position in _calculated(clause.written or clause.formula):
            yield _warning(
                "RCL417",
                f"the position `{show_term(position, 'rcl')}` is calculated, and claims about it are mostly `unknown`",
                position.span,
                "if the order matters, take two positions: `forall(i, j in indices(s) | i < j -> s(i) <= s(j))`",
            )
        for mismatch in mismatches(clause, elements):
            yield _warning(mismatch.code, mismatch.message, clause.sentence_span, mismatch.hint)
    yield from _looked_up(node)


def uncarried(node: str, port: str) -> str:
    """The message of RCL405 for a variable."""
    return f"no topic of `{node}` carries `{port}`"


def _looked_up(node: Node) -> Iterator[Diagnostic]:
    """A warning for each total function that the node looks up by its value."""
    found = {look.function: look for clause in reversed(node.clauses) for look in lookups(clause.spoken)}
    for port in (*node.inputs, *node.outputs):
        look = found.get(port.variable)
        if look is None or not isinstance(port.sort, FunctionSort):
            continue
        relation = FunctionSort((*port.sort.parameters, port.sort.result), BOOL)
        asked = f"`{show_term(look.place, 'rcl')}` asks which arguments have a value"
        yield _warning(
            "RCL412",
            f"`{port.variable.qualified}` gives a value to all arguments ({show_sort(port.sort)} is a total function), "
            f"and `{node.name}` looks up arguments by their value",
            port.span,
            f"if some arguments have no value, no function can say so, but a relation can: {show_sort(relation)}",
            (asked, look.place.span),
        )


def _variables(term: t.Term, *roles: t.Role) -> set[tuple[t.Role, str]]:
    return {
        (item.role, item.name)
        for item in subterms(term)
        if isinstance(item, t.Variable) and item.role in (roles or t.Role)
    }


def _now(term: t.Term) -> t.Term:
    """The term without previous values: what it states about this step."""
    if isinstance(term, t.History) and term.operator is t.Past.PREVIOUS:
        return _now(term.arguments[1])
    parts = tuple(map(_now, term.children))
    return term.rebuild(parts) if parts else term


def _unused(term: t.Term) -> Iterator[t.Variable]:
    for part in subterms(term):
        if isinstance(part, t.Quantified):
            used = {name for role, name in _variables(part.body) if role is t.Role.BOUND}
            yield from (v for v in part.variables if v.name not in used)


def _calculated(term: t.Term) -> Iterator[t.Term]:
    """The element positions that are computed from quantified variables."""
    for part in subterms(term):
        if isinstance(part, t.Index) and isinstance(part.index, t.Arithmetic) and _variables(part.index, t.Role.BOUND):
            yield part.index


def _always(term: t.Term) -> bool:
    """Whether the sorts alone make the formula true; False if that is not obvious."""
    match term:
        case t.Literal(value=True):
            return True
        case t.In(item=item, collection=t.SetTerm(items=items)):
            if items and item in items:
                return True
            sort = item.sort
            names = {i.name for i in items if isinstance(i, t.EnumValue)}
            return isinstance(sort, EnumSort) and names >= set(sort.members)
        case t.Compare(operator="==" | "<=" | ">=", left=left, right=right) if left == right:
            return True
        case t.Compare(operator=">=", left=left, right=t.Literal(value=value)) if value == 0:
            return isinstance(left.sort, NaturalSort)
        case t.Compare(operator="<=", left=t.Literal(value=value), right=right) if value == 0:
            return isinstance(right.sort, NaturalSort)
        case t.And(items=items):
            return all(map(_always, items))
        case t.Or(items=items):
            return any(map(_always, items))
        case t.Implies(right=body) | t.Quantified(quantifier=t.Quantifier.FORALL, body=body):
            return _always(body)
    return False


# --- spellings -------------------------------------------------------------------------------------------------------


def _spellings(contract: Contract) -> Iterator[Diagnostic]:
    """Names of one kind that are probably one name, unless one node uses both: then they are distinct."""
    places: dict[str, dict[str, Span | None]] = {what: {} for what in ("package", "message type", "topic", "variable")}
    together: set[tuple[str, str]] = set()
    for node in contract.nodes:
        for topic in node.topics:
            package, slash, name = topic.ros_type.partition("/")
            for what, written in (("package", package), ("message type", name)) if slash else ():
                places[what].setdefault(written, topic.span)
            places["topic"].setdefault(topic.name, topic.span)
        ports = (*node.inputs, *node.outputs)
        for port in ports:
            places["variable"].setdefault(port.name, port.span)
        together.update(permutations([port.name for port in ports][:200], 2))
        together.update(permutations([topic.name for topic in node.topics][:200], 2))
    for what, table in places.items():
        for earlier, later in similar(list(table)):
            if what in ("package", "message type") or (earlier, later) not in together:
                message = f"the {what}s `{earlier}` and `{later}` differ in a letter or two"
                note = (f"`{earlier}` is here", table[earlier])
                yield _warning("RCL406", message, table[later], "if one thing is meant, write it one way", note)


_DIGITS = re.compile(r"[0-9]+|'+$")


def similar(names: Sequence[str]) -> list[tuple[str, str]]:
    """The pairs (earlier, later) of names that are probably two spellings of one.

    Names of five letters and more that differ by one letter, of nine and more also by two, or only in capitals and
    underscores. Names that differ only in numbers or primes (``arm1``, ``arm2``; ``x``, ``x'``) are taken as distinct.
    Time is linear in the number of names: candidates share a form with one or two letters deleted.
    """
    buckets: dict[str, list[int]] = {}
    found: dict[tuple[int, int], None] = {}
    for i, name in enumerate(names):
        if len(name) > 80:
            continue
        folded = name.replace("_", "").casefold()
        for key in _deletions(folded):
            for j in buckets.setdefault(key, [])[-20:]:
                if (j, i) not in found and _one_thing(names[j], name):
                    found[(j, i)] = None
            buckets[key].append(i)
    return [(names[i], names[j]) for i, j in found]


def _one_thing(one: str, other: str) -> bool:
    if _DIGITS.sub("", one) == _DIGITS.sub("", other):
        return False
    a, b = one.replace("_", "").casefold(), other.replace("_", "").casefold()
    if a == b:
        return len(a) > 1
    shorter = min(len(a), len(b))
    limit = 0 if shorter < 5 else 1 if shorter < 9 else 2
    return distance(a, b, limit) <= limit


def _deletions(name: str) -> set[str]:
    """The name, and its forms with one letter deleted (also two, for long names)."""
    if len(name) < 5:
        return {name}
    once = {name[:i] + name[i + 1 :] for i in range(len(name))}
    found = {name, *once}
    if len(name) + 2 >= 9 and len(name) <= 40:
        found.update(part[:i] + part[i + 1 :] for part in once for i in range(len(part)))
    return found
