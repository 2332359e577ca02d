"""The files that AJPF takes: properties (.psl), agent (.gwen), agent system (.ail) and one run each (.jpf); and a table
of what each property stands for. Pure: the same job gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from avow.backend_kit.protocol import Job
from avow.base.codec import document

from . import psl
from .ajpf_tool import jpf_file
from .checker import Property
from .instances import Instantiation
from .java import CLASS, environment_class
from .options import Setup
from .printer import program_text

_BUILDER = "gwendolen.GwendolenMASBuilder"


def export_files(job: Job, setup: Setup, made: Instantiation) -> Mapping[str, str]:
    """Relative path → text."""
    name = setup.agent
    runs = {f"jpf/{p.key}.jpf": jpf_file(f"{name}.ail", f"{name}.psl", p.key) for p in made.properties}
    properties = {f"{name}.psl": psl_file(made.properties)}
    return {**system_files(setup, name), **properties, "claims.json": _claims(job, setup, made), **runs}


def system_files(setup: Setup, name: str, *, scripted: bool = False) -> dict[str, str]:
    """The agents and what is around them. The environment's Java class is the plan's, or the one that is beside."""
    environment = setup.environment_class or CLASS
    return {
        f"{name}.gwen": program_text(setup.programs),
        f"{name}.ail": f"env = {environment}\nmas.file = {name}.gwen\nmas.builder = {_BUILDER}\n",
        f"{CLASS}.java": environment_class(setup.environment, agents=len(setup.programs), scripted=scripted),
    }


def psl_file(properties: Iterable[Property]) -> str:
    """Lines ``key: formula``. Comments are ASCII and of one line, whatever the contract says."""
    lines = []
    for p in properties:
        if p.about:
            lines.append(f"# {p.key}: {_plain(p.about)}")
        lines.append(f"{p.key}: {psl.show(p.formula)}")
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    return "".join(c if " " <= c <= "~" else "-" for c in text.replace("…", ".."))


def _claims(job: Job, setup: Setup, made: Instantiation) -> str:
    def entry(p: Property) -> dict[str, object]:
        return {"instance": p.about, "property": psl.show(p.formula)}

    data = {
        "agent": setup.agent,
        **({"agents": [p.name for p in setup.programs]} if len(setup.programs) > 1 else {}),
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
    return document(data) + "\n"
