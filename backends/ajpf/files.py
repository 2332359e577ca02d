"""The files that AJPF takes: properties (.psl), agent (.gwen), agent system (.ail) and one run each (.jpf); and a table
of what each property stands for. Pure: the same job gives the same bytes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from avow.backend_kit.protocol import Job

from . import psl
from .checker import Property
from .instances import Instantiation
from .options import Setup

BUILDER = "gwendolen.GwendolenMASBuilder"
TARGET = "ail.util.AJPF_w_AIL"


def export_files(job: Job, setup: Setup, made: Instantiation) -> Mapping[str, str]:
    """Relative path → text."""
    name = setup.program.name
    files = {
        f"{name}.psl": psl_file(made.properties),
        f"{name}.gwen": setup.program_text,
        f"{name}.ail": ail_file(setup, f"{name}.gwen"),
        "claims.json": _claims(job, setup, made),
    }
    for p in made.properties:
        files[f"jpf/{p.key}.jpf"] = jpf_file(f"{name}.ail", f"{name}.psl", p.key)
    return files


def psl_file(properties: Iterable[Property]) -> str:
    """Lines ``key: formula``. Comments are ASCII and of one line, whatever the contract says."""
    lines = []
    for p in properties:
        if p.about:
            lines.append(f"# {p.key}: {_plain(p.about)}")
        lines.append(f"{p.key}: {psl.show(p.formula)}")
    return "\n".join(lines) + "\n"


def ail_file(setup: Setup, program: str) -> str:
    """The environment's Java class is the plan's; without one the file says what is missing."""
    if setup.environment_class:
        env = f"env = {setup.environment_class}\n"
    else:
        env = "# env = (the plan names no environment_class: AJPF needs a Java class for the environment)\n"
    return f"{env}mas.file = {program}\nmas.builder = {BUILDER}\nlog.warning = ajpf.MCAPLAgent,ajpf.MCAPLcontroller\n"


def jpf_file(ail: str, properties: str, key: str) -> str:
    return f"@using = mcapl\n\ntarget = {TARGET}\ntarget.args = {ail},{properties},{key}\n"


def _plain(text: str) -> str:
    return "".join(c if " " <= c <= "~" else "-" for c in text.replace("…", ".."))


def _claims(job: Job, setup: Setup, made: Instantiation) -> str:
    def entry(p: Property) -> dict[str, object]:
        return {"instance": p.about, "property": psl.show(p.formula)}

    data = {
        "agent": setup.program.name,
        "percept_semantics": str(setup.semantics),
        "environment": list(setup.environment.describe()),
        "table": {row.text: psl.show_template(row.formula) for row in setup.rows},
        "instances": {name: list(values) for name, values in setup.instances.items()},
        "guarantees": {
            claim.guarantee: {
                "formula": next((o.formula for o in job.obligations if o.name == claim.guarantee), ""),
                "properties": {p.key: entry(p) for p in claim.properties},
                **({"not covered": claim.not_covered} if claim.not_covered else {}),
                **({"settled by the scenario": list(claim.settled)} if claim.settled else {}),
                **({"taken for granted": list(claim.granted)} if claim.granted else {}),
                **({"left to": {left.forbidden: left.extra for left in claim.left}} if claim.left else {}),
            }
            for claim in made.claims
        },
        "further properties": {
            extra.name: {
                "guarantee": extra.guarantee,
                "because": extra.because,
                "properties": {p.key: entry(p) for p in properties},
            }
            for extra, properties in made.extras
        },
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
