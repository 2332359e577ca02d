"""``avow refines``: may one contract replace another?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from avow.base.codec import document, to_json
from avow.base.diagnostics import Diagnostic, Rejected, refuse
from avow.base.verdict import Verdict
from avow.base.workspace import system_folder
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.export import derived_contract
from avow.calculus.refinement import Demand, Refinement, refines
from avow.cli.options import ContractArgument, json_option, seconds_option, seed_option
from avow.language.contract import ClauseKind, Node
from avow.language.load import load_contract
from avow.solving.limits import from_seconds
from avow.system.load import load_system


@click.command()
@click.argument("concrete", type=ContractArgument())
@click.argument("abstract", type=ContractArgument())
@click.option("--node", metavar="NAME", help="Only this node, or NEW=OLD; by default every node of ABSTRACT.")
@click.option("--rename", "renames", multiple=True, metavar="NEW=OLD", help="CONCRETE's port NEW is ABSTRACT's OLD.")
@json_option()
@seconds_option(10.0)
@seed_option()
def command(
    concrete: Path, abstract: Path, node: str | None, renames: tuple[str, ...], as_json: bool, seconds: float, seed: int
) -> int:
    """Does CONCRETE refine ABSTRACT: assume no more, and guarantee no less?

    Each is an .rcl file, whose nodes are compared one by one, or a system's name or folder, of which the contract that
    is derived of all its nodes is compared. Nodes and ports are matched by name (--node, --rename); a single node on
    each side whatever its name.

    Code 1 where it does not, where the solver gave up, or where the answer is vacuous: CONCRETE's guarantees cannot
    be met at some input, and of such a contract everything follows. 2 for bad input.
    """
    bounds = Bounds(from_seconds(seconds), seed)
    new, stands = _nodes(concrete, bounds)
    old, _ = _nodes(abstract, bounds)
    pairs, missing = _pairs(new, old, node, concrete, abstract)
    names = _renamed(renames, [n for n, _ in pairs])
    found = [refines(n, m, bounds, names) for n, m in pairs]
    good = not missing and stands is Verdict.PROVED and all(result.holds for result in found)
    if as_json:
        nodes = [_data(result) for result in found]
        click.echo(document({"refines": good, "missing": missing, "nodes": nodes, "derivation": stands}))
        return 0 if good else 1
    for name in missing:
        click.echo(f"{name}: not in {concrete}")
    if stands is not Verdict.PROVED:
        click.echo(f"{concrete}: its own derivation is {stands}: `avow compose {concrete}` says why")
    for result in found:
        _print(result, str(concrete), str(abstract))
    return 0 if good else 1


def _nodes(path: Path, bounds: Bounds) -> tuple[tuple[Node, ...], Verdict]:
    """The nodes to compare, and whether they may be relied on: a derived contract only if its derivation is proved."""
    path = path if path.suffix == ".rcl" or path.is_dir() else system_folder(str(path))
    if not path.is_dir():
        return load_contract([path]).nodes, Verdict.PROVED
    composition = compose(load_system(path))
    refuse(composition.frame.graph.findings)
    whole = composition.whole
    return derived_contract(composition, whole).nodes, composition.stands(whole, bounds)


def _pairs(
    new: tuple[Node, ...], old: tuple[Node, ...], asked: str | None, concrete: Path, abstract: Path
) -> tuple[list[tuple[Node, Node]], list[str]]:
    """The pairs of nodes to compare, and the nodes of ABSTRACT without a counterpart. Raises Rejected."""
    if asked is not None:
        mine, _, theirs = asked.partition("=") if "=" in asked else (asked, "", asked)
        for name, nodes, path in ((mine, new, concrete), (theirs, old, abstract)):
            if name not in [n.name for n in nodes]:
                known = ", ".join(n.name for n in nodes)
                raise Rejected(Diagnostic("CLI003", f"{path} has no node '{name}'", hint=f"it has: {known}"))
        one = next(n for n in new if n.name == mine)
        return [(one, m) for m in old if m.name == theirs], []
    if len(new) == len(old) == 1:
        return [(new[0], old[0])], []
    by_name = {n.name: n for n in new}
    pairs = [(by_name[m.name], m) for m in old if m.name in by_name]
    if not pairs:
        hint = f"{concrete} has: {', '.join(by_name)}; compare two by --node NEW=OLD"
        raise Rejected(Diagnostic("CLI003", f"no node of {abstract} is in {concrete}", hint=hint))
    return pairs, [m.name for m in old if m.name not in by_name]


def _renamed(texts: tuple[str, ...], nodes: list[Node]) -> Mapping[str, str]:
    """Raises Rejected."""
    ports = {port.name for node in nodes for port in (*node.inputs, *node.outputs)}
    found: dict[str, str] = {}
    for text in texts:
        mine, equals, theirs = text.partition("=")
        if not (equals and mine and theirs) or mine in found or theirs in found.values():
            message = f"--rename {text}: wanted is NEW=OLD, each port once"
            raise Rejected(Diagnostic("CLI003", message, hint=f"ports: {', '.join(sorted(ports))}"))
        if mine not in ports:
            hint = f"ports: {', '.join(sorted(ports))}"
            raise Rejected(Diagnostic("CLI003", f"--rename {text}: there is no port '{mine}'", hint=hint))
        found[mine] = theirs
    return found


def _data(result: Refinement) -> dict[str, object]:
    return {
        "concrete": result.concrete,
        "abstract": result.abstract,
        "verdict": "vacuous" if result.vacuous else result.verdict,
        "unrealizable": dict(result.unrealizable.values) if result.unrealizable else None,
        "doubt": result.doubt,
        "ports": [fault.message for fault in result.faults],
        "clauses": [
            {
                "clause": f"{demand.node}.{demand.clause.name}",
                "kind": demand.clause.kind,
                "verdict": demand.verdict,
                "needed": demand.needed,
                "vacuous": demand.vacuous,
                "counterexample": dict(demand.counterexample.values) if demand.counterexample else None,
            }
            for demand in result.demands
        ],
        "certificates": to_json(result.certificates),
    }


def _print(result: Refinement, concrete: str, abstract: str) -> None:
    answer = "vacuous" if result.vacuous else result.verdict
    click.echo(f"{result.concrete} ({concrete}) refines {result.abstract} ({abstract}): {answer}")
    for fault in result.faults:
        click.echo(f"  {fault.message}")
    if result.unrealizable is not None:
        told = result.unrealizable.text()
        click.echo(
            f"  {concrete} is not realizable: {told}. It is true of it, as of everything; `avow sanity` says more"
        )
    if result.doubt:
        click.echo(f"  whether anything can keep {concrete} is not known: {result.doubt}")
    for demand in result.demands:
        told = _told(demand, concrete, abstract)
        if told:
            click.echo(f"  {demand.verdict}: {told}")


def _told(demand: Demand, concrete: str, abstract: str) -> str:
    if demand.verdict is Verdict.PROVED:
        if not demand.vacuous:
            return ""
        return f"{demand.clause.name}, but only because what is assumed or guaranteed contradicts itself"
    if demand.clause.kind is ClauseKind.ASSUMPTION:
        what = f"{concrete} assumes {demand.clause.name}, which {abstract} does not"
    else:
        what = f"{abstract} guarantees {demand.clause.name}, which {concrete} need not keep"
    if demand.counterexample is not None:
        values = ", ".join(f"{name} = {value}" for name, value in demand.counterexample.values)
        return f"{what}: at {values}" if values else what
    return f"{what}: {demand.reason}" if demand.reason else what
