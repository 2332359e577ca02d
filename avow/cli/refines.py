"""``avow refines``: may one contract stand in for another?"""

from __future__ import annotations

import json
from pathlib import Path

import click

from avow.cli.paths import PathArgument


@click.command()
@click.argument("concrete", type=PathArgument(dir_okay=False))
@click.argument("abstract", type=PathArgument(dir_okay=False))
@click.option("--node", metavar="NAME", help="Only this node; by default every node of ABSTRACT.")
@click.option("--json", "as_json", is_flag=True, help="For machines.")
@click.option("--seconds", default=10.0, show_default=True, help="Time for one question to the solver.")
@click.option("--seed", default=0, show_default=True, help="The solver's seed.")
def command(concrete: Path, abstract: Path, node: str | None, as_json: bool, seconds: float, seed: int) -> int:
    """Does CONCRETE refine ABSTRACT: assume no more, and guarantee no less? Nodes and ports are matched by name; a
    single node in each file is matched whatever its name.

    Code 1 where it does not, or where the solver gave up; 2 for bad input.
    """
    from avow.calculus.discharge import Bounds
    from avow.calculus.refinement import refines
    from avow.diagnostics import Diagnostic, Rejected
    from avow.language.load import load_contract
    from avow.verdict import Verdict

    if seconds <= 0:
        raise Rejected(Diagnostic("CLI004", f"--seconds {seconds}: a time above 0 is wanted"))
    new, old = load_contract([concrete]), load_contract([abstract])
    pairs = [(n, m) for m in old.nodes for n in new.nodes if n.name == m.name and node in (None, m.name)]
    if not pairs and node is None and len(new.nodes) == len(old.nodes) == 1:
        pairs = [(new.nodes[0], old.nodes[0])]
    missing = [m.name for m in old.nodes if node in (None, m.name) and all(m is not b for _, b in pairs)]
    if node is not None and not pairs:
        known = ", ".join(m.name for m in old.nodes)
        raise Rejected(Diagnostic("CLI003", f"there is no node '{node}' in both files", hint=f"{abstract}: {known}"))
    if not pairs:
        raise Rejected(Diagnostic("CLI003", f"no node of {abstract} is in {concrete}"))
    bounds = Bounds(max(1, int(seconds * 1000)), seed)
    found = [refines(n, m, bounds) for n, m in pairs]
    good = not missing and all(result.verdict is Verdict.PROVED for result in found)
    if as_json:
        document = {
            "refines": good,
            "missing": missing,
            "nodes": [
                {
                    "concrete": result.concrete,
                    "abstract": result.abstract,
                    "verdict": str(result.verdict),
                    "ports": [fault.message for fault in result.faults],
                    "clauses": [
                        {
                            "clause": f"{demand.node}.{demand.clause.name}",
                            "kind": str(demand.clause.kind),
                            "verdict": str(demand.verdict),
                            "needed": list(demand.needed),
                            "vacuous": demand.vacuous,
                            "counterexample": dict(demand.counterexample.values) if demand.counterexample else None,
                        }
                        for demand in result.demands
                    ],
                }
                for result in found
            ],
        }
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
        return 0 if good else 1
    for name in missing:
        click.echo(f"{name}: not in {concrete}")
    for result in found:
        click.echo(f"{result.concrete} refines {result.abstract}: {result.verdict}")
        for fault in result.faults:
            click.echo(f"  {fault.message}")
        for demand in result.demands:
            if demand.verdict is Verdict.PROVED and not demand.vacuous:
                continue
            what = "assumes" if demand.clause.kind == "assumption" else "must guarantee"
            click.echo(f"  {demand.verdict}: {demand.node} {what} {demand.clause.name}")
            if demand.counterexample is not None:
                click.echo(f"    {demand.counterexample.text()}")
            elif demand.reason:
                click.echo(f"    {demand.reason}")
            elif demand.vacuous:
                click.echo("    only because the hypotheses contradict one another")
    return 0 if good else 1
