"""The options in plan.yaml: the model, and the variable or formula of each port; or all faults."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file, file_text
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.packaged import packaged
from avow.base.suggestions import suggest
from avow.language.contract import Port
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort

from .tuning import MODEL_BYTES

SCHEMA = packaged("avow.backends.storm", "options.json")
_KIND = re.compile(r"\s*(dtmc|mdp)\b")
_NAMED = re.compile(
    r"(?:;|\bmodule\s+\w+|\b(?:dtmc|mdp)\b|\bendmodule\b)\s*(?:global\s+)?([A-Za-z_]\w*)\s*:"
    r"|\bformula\s+([A-Za-z_]\w*)\s*="
)
_COPIED = re.compile(r"\bmodule\s+\w+\s*=\s*\w+\s*\[([^\]]*)\]")
OWN = "avow_"
"""The first letters of the names that the backend adds to the model."""


@dataclass(frozen=True, slots=True)
class Bound:
    """A port's variable or formula; `values` are the numbers of an enumeration's elements, in their order."""

    name: str
    port: Port
    values: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Given:
    """The options, with the model's text. `ports` are by qualified name."""

    path: Path
    text: str
    nondeterministic: bool
    ports: Mapping[str, Bound]


def read(job: Job) -> Given:
    """Raises Rejected with all faults."""
    faults: list[Diagnostic] = []
    path, text, kind = Path(), "", None
    try:
        path = existing_file(job, "model", job.options.get("model", ""), wrong="STORM101", absent="STORM102")
        text = file_text(path, "STORM102", "STORM111", MODEL_BYTES)
        plain = re.sub(r"//[^\n]*", "", text)
        kind = _KIND.match(plain)
        if kind is None:
            faults.append(
                Diagnostic("STORM111", "the model begins with neither `dtmc` nor `mdp`", Span(str(path), 1, 1, 1, 2))
            )
        if OWN in plain:
            line = next(n for n, one in enumerate(text.splitlines(), 1) if OWN in one)
            message = f"names that begin with `{OWN}` belong to Avow"
            faults.append(Diagnostic("STORM111", message, Span(str(path), line, 1, line, 2), hint="rename it"))
    except Rejected as rejected:
        faults += rejected.diagnostics
    ports = {}
    for found in _ports(job, names_of(text) if text else None):
        if isinstance(found, Diagnostic):
            faults.append(found)
        else:
            ports[found.port.variable.qualified] = found
    if faults or kind is None:
        raise Rejected(*faults)
    return Given(path, text, kind[1] == "mdp", ports)


def names_of(text: str) -> set[str]:
    """The variables and formulas that a model in PRISM declares."""
    plain = re.sub(r"//[^\n]*", "", text)
    copied = {name for inside in _COPIED.findall(plain) for name in re.findall(r"=\s*([A-Za-z_]\w*)", inside)}
    return copied | {name for found in _NAMED.findall(plain) for name in found if name}


def _ports(job: Job, known: set[str] | None) -> Iterator[Bound | Diagnostic]:
    own = {port.variable.qualified: port for port in (*job.node.inputs, *job.node.outputs)}
    for name, entry in job.options.get("ports", {}).items():

        def fault(message: str, hint: str | None = None, name: str = name) -> Diagnostic:
            return Diagnostic("STORM103", f"{name}: {message}", job.method.options.at("ports", name), hint=hint)

        if name not in own:
            yield fault(f"the node has {', '.join(own)}", suggest(name, own))
            continue
        of, wrong = _bound(own[name], entry)
        if wrong:
            yield fault(wrong)
        elif known is not None and of.name not in known:
            yield fault(f"the model declares no variable or formula '{of.name}'", suggest(of.name, sorted(known)))
        else:
            yield of


def _bound(port: Port, entry: Any) -> tuple[Bound, str]:
    """What an entry says, and what is wrong with it."""
    if isinstance(port.sort, EnumSort):
        values = entry.get("values", {}) if isinstance(entry, dict) else {}
        if sorted(values) != sorted(port.sort.members) or len({*values.values()}) < len(values):
            return Bound("", port), f"'values' gives each of {', '.join(port.sort.members)} a number of its own"
        return Bound(entry["name"], port, tuple(values[member] for member in port.sort.members)), ""
    if not isinstance(port.sort, BoolSort | IntegerSort | NaturalSort | RealSort):
        return Bound("", port), "its type has no counterpart in PRISM"
    if isinstance(entry, dict):
        return Bound("", port), "only an enumeration has 'values'"
    return Bound(entry, port), ""
