"""``avow validate``: a person compares requirements' sentences with their formulas, and the plan records it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import click

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_regular, write
from avow.base.persons import unreadable
from avow.base.suggestions import suggest
from avow.base.workspace import system_folder
from avow.cli.options import json_option
from avow.system.load import PLAN_FILE, load_system, load_texts
from avow.system.plan import Requirement, System
from avow.system.validating import with_validation


@click.command()
@click.argument("system")
@click.argument("requirements", nargs=-1)
@click.option("--as", "who", default="", help="Your name: you have read each sentence against its formula.")
@json_option()
def command(system: str, requirements: tuple[str, ...], who: str, as_json: bool) -> int:
    """Say that requirements' formulas say what their sentences ask for.

    Without --as, each of the REQUIREMENTS (by default, those without a validation) is shown: its sentence, and
    its formula or the guarantees that it names. With --as, your name, the day and the digests of both are written
    under `validation` in plan.yaml. When either text changes, the requirement is not validated any more. A formula that
    says less than its sentence needs a reason there (`because`), or a sentence that says no more.
    """
    folder = system_folder(system)
    found = load_system(folder)
    known = {r.id: r for r in found.plan.requirements}
    for name in requirements:
        if name not in known:
            hint = suggest(name, list(known))
            raise Rejected(Diagnostic("CLI022", f"{found.name} has no requirement {name!r}", hint=hint))
    chosen = [known[name] for name in requirements] or [r for r in known.values() if not r.validated]
    if not who:
        shown = {"requirements": [_said(found, r) for r in chosen]}
        click.echo(document(shown) if as_json else _to_read(found, chosen))
        return 0
    name = " ".join(who.split())
    if why := unreadable(name):
        raise Rejected(Diagnostic("SIGN005", f"--as: {who!r} is no person's name: {why}"))
    if not requirements:
        hint = "name each requirement that you have read"
        raise Rejected(Diagnostic("CLI022", "no requirement is named", hint=hint))
    path = folder / PLAN_FILE
    text = read_regular(path).decode("utf-8")
    today = datetime.now().astimezone().date().isoformat()
    for requirement in chosen:
        text = with_validation(text, requirement, name, today)
    after = {r.id: r for r in load_texts(path, text).plan.requirements}
    missing = [r.id for r in chosen if not after[r.id].validated]
    if missing:
        message = f"{path}: the entry of {', '.join(missing)} could not be written"
        raise Rejected(Diagnostic("CLI022", message, hint="write  validation:  in block style, without aliases"))
    write(path, text)
    names = ", ".join(r.id for r in chosen)
    done = {"plan": str(path), "validated": [r.id for r in chosen], "who": name}
    click.echo(document(done) if as_json else f"{path}: {names} validated by {name}")
    return 0


def _said(system: System, requirement: Requirement) -> dict[str, object]:
    """A requirement's sentence, and the formula or guarantees that must have the same meaning."""
    support: dict[str, str] = {}
    for name in requirement.supported_by if not requirement.formula and not requirement.temporal else ():
        node, _, clause = name.partition(".")
        given = next((n for n in system.contract.nodes if n.name == node), None)
        own = given.guarantees if given is not None else ()
        support |= {f"{node}.{g.name}": g.sentence or "" for g in own if clause in ("", g.name)}
    return {
        "id": requirement.id,
        "sentence": requirement.text,
        "formula": " ".join((requirement.formula or requirement.temporal or "").split()),
        "guarantees": support,
        "validated": requirement.validated,
    }


def _to_read(system: System, chosen: Sequence[Requirement]) -> str:
    lines = []
    for requirement in chosen:
        said = _said(system, requirement)
        lines.append(f"{requirement.id}: {requirement.text}")
        lines += [f"  formula: {said['formula']}"] if said["formula"] else []
        support = said["guarantees"]
        lines += [f"  {name}: {text}" for name, text in support.items()] if isinstance(support, dict) else []
    if not lines:
        return "every requirement is validated"
    names = " ".join(r.id for r in chosen)
    return "\n".join([*lines, "", f'Where they say the same: avow validate {system.name} {names} --as "YOUR NAME"'])
