"""``avow explain``: one obligation, and everything that is known of it."""

from __future__ import annotations

import json

import click


@click.command()
@click.argument("name", metavar="ID")
@click.option("--json", "as_json", is_flag=True, help="For machines.")
def command(name: str, as_json: bool) -> int:
    """One obligation: its formula, where it stands, its evidence, its counterexample, how to run it again.

    ID is an obligation's id, whole (system/node/kind/name) or in part, or a guarantee as node.name.
    """
    from avow.assurance.codec import to_json
    from avow.base.workspace import workspace
    from avow.cli.ledgers import find_claim, reported_cases, unreported

    place = workspace()
    cases_here = reported_cases(place)
    found = find_claim(cases_here, name, unreported(place, cases_here))
    if as_json:
        wanted = {view.id for _, view in found}
        cases = {case.system: case for case, _ in found}.values()
        listed = [o for case in cases for o in to_json(case)["obligations"] if _id(o["obligation"]) in wanted]
        click.echo(json.dumps({"obligations": listed}, indent=1))
        return 0
    from avow.report.terminal import show_obligation

    for at, (case, view) in enumerate(found[:20]):
        if at:
            click.echo()
        show_obligation(case, view)
    if len(found) > 20:
        click.echo(f"\nand {len(found) - 20} more obligations of that name")
    return 0


def _id(obligation: dict[str, str]) -> str:
    return "/".join(obligation[part] for part in ("system", "node", "kind", "name"))
