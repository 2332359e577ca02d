"""The names in a plan, checked against the contract: nodes, ports, guarantees, tables' arities, and whether a
scenario's values have the required types; all located."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import exact
from avow.base.suggestions import suggest
from avow.base.tuning.bounds import VALUES_LOOKED_AT
from avow.language import sorts as s
from avow.language.contract import Chance, Contract, Node, Port
from avow.language.load import parse_term
from avow.language.printer import show_type
from avow.system.hazards import check_mitigations
from avow.system.node_plan import check_memory
from avow.system.plan import STEP_LENGTH, Plan, Table
from avow.system.statements import GENERAL
from avow.system.strict_yaml import Piece
from avow.system.tables import cell_place


def check_names(plan: Plan, root: Piece, contract: Contract) -> tuple[Diagnostic, ...]:
    """A diagnostic for everything that the plan names and the contract does not have."""
    nodes = {node.name: node for node in contract.nodes}
    return (
        *_connections(plan, root, nodes),
        *_environment(plan, root, nodes),
        *_requirements(plan, root, nodes),
        *_goals(plan, root, nodes),
        *_nodes(plan, root, nodes),
        *_running(root, nodes),
        *_scenario(plan, root, contract, nodes),
        *_findings(plan, root, nodes),
        *_assumptions(plan, root),
        *check_mitigations(plan, nodes),
        *check_memory(plan, nodes),
    )


def ports_named(name: str, nodes: Iterable[Node]) -> tuple[tuple[Node, Port], ...]:
    """The ports that a plan denotes by ``in.p``, ``out.p`` (of every node) or ``node.p`` (either side of one node)."""
    owner, _, port = name.partition(".")
    found: list[tuple[Node, Port]] = []
    for node in nodes:
        sides = {"in": node.inputs, "out": node.outputs, node.name: node.inputs + node.outputs}
        found += [(node, candidate) for candidate in sides.get(owner, ()) if candidate.name == port]
    return tuple(found)


def _unknown(what: str, name: str, known: Iterable[str], span: Span) -> Diagnostic:
    return Diagnostic(
        "PLAN106", f"{what} {name!r}: there is no such thing in the contract", span, hint=suggest(name, known)
    )


def _connections(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    subsystems = {subsystem.name for subsystem in plan.subsystems}
    for index, piece in enumerate(root.each("connections")):
        for key, side in (("from", "output"), ("to", "input")):
            for item in piece.each(key):
                name, _, port = item.text.partition(".")
                where = f"connections[{index}].{key}"
                if name in subsystems:
                    continue  # avow.system.subsystems determines whose port it is
                if name not in nodes:
                    yield _unknown(f"{where}: node", name, nodes, item.span)
                    continue
                ports = nodes[name].outputs if side == "output" else nodes[name].inputs
                if port not in [p.name for p in ports if not p.parameter]:
                    yield _unknown(f"{where}: {side}", item.text, [f"{name}.{p.name}" for p in ports], item.span)


def _environment(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    subsystems = {subsystem.name for subsystem in plan.subsystems}
    for name, span, _ in root.keyed("environment"):
        owner, _, port = name.partition(".")
        if owner == "in":
            known = sorted({p.name for node in nodes.values() for p in node.inputs})
            if port not in known:
                yield _unknown("environment: input", name, [f"in.{p}" for p in known], span)
        elif owner in subsystems:
            continue  # as above
        elif owner not in nodes:
            yield _unknown("environment: node", owner, ["in", *nodes], span)
        elif port not in [p.name for p in nodes[owner].inputs]:
            yield _unknown("environment: input", name, [f"{owner}.{p.name}" for p in nodes[owner].inputs], span)


def _requirements(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    goals = [*(goal.name for goal in plan.compose), *(subsystem.name for subsystem in plan.subsystems)]
    chances = {f"{n.name}.{g.name}": g.chance for n in nodes.values() for g in n.guarantees}
    for name, _, requirement in root.keyed("requirements"):
        asked = requirement.at("probability")
        if asked is not None:
            yield from _unlikely(f"requirements.{name}.probability", asked, requirement, chances)
        for item in requirement.each("supported_by"):
            owner, dot, _ = item.text.partition(".")
            if item.text in goals or (not dot and owner in nodes):
                continue
            where = f"requirements.{name}.supported_by"
            known = [f"{n}.{g.name}" for n in nodes for g in nodes[n].guarantees if n == owner or owner not in nodes]
            if item.text not in known:
                yield _unknown(where, item.text, known if owner in nodes else [*nodes, *goals, *known], item.span)
            elif chances[item.text] and asked is None and (requirement.at("formula") or requirement.at("temporal")):
                message = f"{where}: {item.text} holds with a probability, and no proof of a formula may use it"
                hint = "give the requirement a `probability`, or leave this guarantee out here"
                yield Diagnostic("PLAN141", message, item.span, hint=hint)


def _unlikely(
    where: str, asked: Piece, requirement: Piece, chances: Mapping[str, Chance | None]
) -> Iterator[Diagnostic]:
    """Why a requirement's probability cannot be composed of those of guarantees."""
    if requirement.at("formula") is None:
        yield Diagnostic("PLAN142", f"{where}: there is no `formula` that has it", asked.span, hint="add a `formula`")
    named = [item.text for item in requirement.each("supported_by")]
    below = {name: chance for name in named if (chance := chances.get(name))}
    if not below and not any("." in name and name not in chances for name in named):  # that is an error of its own
        hint = "name one as `node.guarantee`, or leave out `probability`"
        message = f"{where}: no guarantee with a probability is under `supported_by`"
        yield Diagnostic("PLAN142", message, asked.span, hint=hint)
    if len(kinds := [key for key in ("given", "steps", "per_run") if asked.at(key) is not None]) > 1:
        message = f"{where}: {' and '.join(kinds)} exclude one another"
        yield Diagnostic("PLAN142", message, asked.span, hint=f"keep one of {', '.join(kinds)}")
        return
    in_a_run, steps = asked.at("per_run") is not None, asked.at("steps") is not None
    for guarantee, chance in below.items() if in_a_run or not steps else ():
        if chance.per_run != in_a_run:
            has, wanted = ("a whole run", "each step") if chance.per_run else ("each step", "a whole run")
            message = f"{where}: the probability of {guarantee} is of {has}, and that of the requirement of {wanted}"
            hint = "`steps: 100` asks about the first 100 steps together, and composes both kinds"
            yield Diagnostic("PLAN142", message, asked.span, hint=hint)


def _assumptions(plan: Plan, root: Piece) -> Iterator[Diagnostic]:
    methods = sorted({"compose", "sanity", *(method.id for node in plan.nodes for method in node.methods)})
    general = [place.removeprefix("assumptions.") for place in GENERAL]
    for name, span, _ in root.keyed("assumptions"):
        method = name.partition(".")[0]
        if method not in methods and name not in general:
            message = f"assumptions.{name}: the plan has no method {method!r}"
            yield Diagnostic("PLAN106", message, span, hint=suggest(name, [*methods, *general]))


def _goals(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    known = [*nodes, *(subsystem.name for subsystem in plan.subsystems)]
    for name, _, goal in root.keyed("compose"):
        for item in goal.each("select"):
            if item.text not in known:
                yield _unknown(f"compose.{name}.select: node", item.text, known, item.span)


def _nodes(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    piece = root.at("nodes")
    own = [name for name, node in nodes.items() if not node.relay]  # a topic's wiring has nothing to show
    for entry in plan.nodes:
        node = nodes.get(entry.node)
        if node is None or node.relay:
            yield _unknown("nodes: node", entry.node, own, piece.key_span(entry.node) if piece else root.span)
            continue
        known = [g.name for g in node.guarantees]
        for method in entry.methods:
            for index, name in enumerate(method.guarantees):
                if name not in known:
                    where = f"nodes.{entry.node}.methods: {method.id}: guarantee"
                    yield _unknown(where, name, known, method.options.at("guarantees", index))


def _running(root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    """Checks what the plan says about nodes as they run."""
    for path in (("model", "compound"), ("model", "external"), ("ros", "nodes")):
        for name, span, _ in root.keyed(*path):
            if name not in nodes:
                yield _unknown(f"{'.'.join(path)}: node", name, nodes, span)


def _scenario(plan: Plan, root: Piece, contract: Contract, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    if plan.scenario is None:
        return
    everything = [
        *dict.fromkeys(f"in.{p.name}" for node in contract.nodes for p in node.inputs),
        *dict.fromkeys(f"out.{p.name}" for node in contract.nodes for p in node.outputs),
    ]
    interpret = root.at("scenario", "interpret")
    for name, (table, columns) in plan.scenario.interpret.items():
        span = (interpret.at(name) or interpret).span if interpret else root.span
        found = ports_named(name, contract.nodes)
        if not found:
            yield _unknown("scenario.interpret: port", name, everything, span)
            continue
        sort = found[0][1].sort
        if not isinstance(sort, s.FunctionSort):
            message = f"scenario.interpret.{name}: only a function or relation is given by a table"
            yield Diagnostic("PLAN109", message, span, hint=f"give its values under domains: {name}")
            continue
        wanted = len(sort.parameters) + (0 if sort.result == s.BOOL else 1)
        if len(columns) != wanted:
            message = f"scenario.interpret.{name}: {wanted} columns are wanted, {table} gives {len(columns)} here"
            yield Diagnostic("PLAN109", message, span)
            continue
        given = plan.scenario.table(table)
        for column, cells in zip(columns, (*sort.parameters, sort.result), strict=False):
            yield from _unusable(
                f"scenario.interpret.{name}: {table}.{column}", given.column(column), cells, contract, span, (given,)
            )
    domains = root.at("scenario", "domains")
    types = dict(contract.types)
    for name, texts in plan.scenario.domains.items():
        span = domains.key_span(name) if domains else root.span
        if name == STEP_LENGTH and name not in types:
            yield from _unusable(f"scenario.domains.{name}", texts, s.REAL, contract, span)
            continue
        if name not in s.BUILTINS and name not in types and not ports_named(name, contract.nodes):
            yield _unknown("scenario.domains: type or port", name, [*s.BUILTINS, *types, *everything], span)
            continue
        place = (domains.at(name) or domains).span if domains else root.span
        named = s.BUILTINS.get(name) or types.get(name)
        sorts = [named] if named else [_domain_sort(port.sort) for _, port in ports_named(name, contract.nodes)]
        if len(set(sorts)) == 1 and not isinstance(sorts[0], s.FunctionSort):
            said = " ".join(domains.texts(name)) if domains else ""
            used = [table for table in plan.scenario.tables if f"{table.name}." in said]
            yield from _unusable(f"scenario.domains.{name}", texts, sorts[0], contract, place, used)


def _findings(plan: Plan, root: Piece, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    """Checks the nodes, the sorts of claims, and the names that do not follow from a derivation or an analysis."""
    known = [f"{name}/guarantee/{clause.name}" for name, node in nodes.items() for clause in node.guarantees]
    known += [f"system/requirement/{requirement.id}" for requirement in plan.requirements]
    for key in ("expected", "accepted"):
        for item in root.each(key):
            obligation = item.at("obligation")
            if obligation is None:
                continue
            owner, _, rest = obligation.text.partition("/")
            meant = obligation.text.replace(".", "/guarantee/")
            if meant in known and meant != obligation.text:
                message = f"{key}: obligation {obligation.text!r} is no obligation's name"
                yield Diagnostic("PLAN106", message, obligation.span, hint=f"write `{meant}`")
            elif owner not in nodes and owner != "system" and not set(owner) & set("*?["):
                yield _unknown(f"{key}: node", owner, [*nodes, "system"], obligation.span)
            elif not (set(obligation.text) & set("*?[") or rest.startswith(_DERIVED) or obligation.text in known):
                yield _unknown(f"{key}: obligation", obligation.text, known, obligation.span)


_DERIVED = ("well-formed/", "sanity/", "composition/", "program/", "assumption/")


# -- are a scenario's values values? What a domain or a table gives must be of the type that it is given for -----------


def _unusable(
    where: str,
    texts: tuple[str, ...],
    sort: s.Sort,
    contract: Contract,
    span: Span,
    tables: Iterable[Table] = (),
) -> Iterator[Diagnostic]:
    """The first of the values that is not of the sort: in the file of the table that has it, if one does."""
    for text in list(dict.fromkeys(texts))[:VALUES_LOOKED_AT]:
        reason = _wrong(text, sort, contract)
        if reason is not None:
            message = f"{where}: {text!r} is no value of {show_type(sort)}: {reason}"
            at = next((place for table in tables if (place := cell_place(table, text))), None)
            notes = (("the plan names it here", span),) if at else ()
            yield Diagnostic("PLAN109", message, at or span, notes=notes)
            return


def _domain_sort(sort: s.Sort) -> s.Sort:
    """The meaning of a port's values under ``domains``: places for a relation, results for another function."""
    if not isinstance(sort, s.FunctionSort):
        return sort
    if sort.result != s.BOOL:
        return sort.result
    return sort.parameters[0] if len(sort.parameters) == 1 else s.TupleSort(sort.parameters)


def _wrong(text: str, sort: s.Sort, contract: Contract) -> str | None:
    match sort:
        case s.OpaqueSort() | s.StringSort():
            return None
        case s.RealSort() | s.IntegerSort() | s.NaturalSort():
            try:
                number = exact(text)
            except ValueError:
                pass  # perhaps arithmetic, or a constant's name
            else:
                if isinstance(sort, s.RealSort) or number.denominator == 1:
                    return "it is negative" if isinstance(sort, s.NaturalSort) and number < 0 else None
                return "it is not whole"
    try:
        parse_term(text, None, contract, sort=sort)
    except Rejected as rejected:
        return rejected.diagnostics[0].message
    return None
