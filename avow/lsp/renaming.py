"""Renaming in all files of a system: the contracts and the plan.

The new texts are checked before any edit is proposed: they have no new errors, no name in them changes its meaning, and
the plan names nothing that does not exist. Otherwise the rename is refused with the reason. Ports that share a name are
one thing to a system (they link, or the environment gives them one value), so they are renamed together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from avow.base.diagnostics import Diagnostic
from avow.formulas.formula import digest
from avow.language.contract import Contract
from avow.language.lexer import KEYWORDS, LIMITED
from avow.language.load import check_in_part
from avow.language.source import Source
from avow.language.terms import CALLED, Builtin, Past
from avow.lsp.names import OWNED, PORTS, Meaning, Occurrence, What, occurrences, taken_apart
from avow.lsp.plan_names import PlanText, plan_occurrences
from avow.lsp.project import Project, faults_of_plan

_WORDS = {*KEYWORDS, *LIMITED, *Builtin, *Past, *CALLED}
"""Words of the language, including operators that a name may shadow: such a name would have two readings."""


class Refused(Exception):  # noqa: N818 - it reads as what happened
    """A rename that would change more than the name; the text says why."""


@dataclass(frozen=True, slots=True)
class Edit:
    """A stretch of a file's text, and its replacement."""

    file: str
    start: int
    end: int
    text: str


def all_occurrences(project: Project) -> tuple[Occurrence, ...]:
    """Every name with a meaning in every file of the system."""
    found = occurrences(tuple(taken_apart(s.file, s.text) for s in project.sources), project.contract)
    return (*found, *(plan_occurrences(project.plan, project.contract) if project.plan is not None else ()))


def renamed_with(meaning: Meaning, other: Meaning) -> bool:
    """Whether two meanings are renamed together."""
    if meaning.what in PORTS:
        return other.what in PORTS and other.name == meaning.name
    return other == meaning


def is_renameable(project: Project, meaning: Meaning) -> bool:
    """Whether a name is written anywhere: that of a clause without a name is not."""
    return any(o.declares and o.written and o.meaning == meaning for o in all_occurrences(project))


def rename(project: Project, meaning: Meaning, new: str) -> tuple[Edit, ...]:
    """The edits that rename something. Raises Refused."""
    _check_name(new)
    if any(d.is_error for d in project.diagnostics):
        raise Refused("the contract has errors: a name is changed where all that it stands for is known")
    before = all_occurrences(project)
    places = [o for o in before if o.written and renamed_with(meaning, o.meaning)]
    if not any(o.declares for o in places):
        raise Refused(f"{meaning.shown} has no name of its own that could be changed")
    if new == meaning.name:
        return ()
    edits = tuple(Edit(o.file, o.start, o.end, new) for o in places)
    after = _after(project, edits)
    found = Counter(d.code for d in after.diagnostics) - Counter(d.code for d in project.diagnostics)
    if wrong := [d for d in after.diagnostics if d.code in found and d.is_error]:
        raise Refused(f"`{new}` does not do here: {wrong[0].message}")
    _compare(project, after, before, meaning, new)
    return edits


def _check_name(new: str) -> None:
    found = taken_apart("", new).tokens
    if len(found) != 1 or found[0].type != "NAME" or found[0].text != new:
        raise Refused(f"`{new[:60]}` is no name: a name is made of letters, digits, `_` and primes")
    if new in _WORDS:
        raise Refused(f"`{new}` is a word of the language")


def _after(project: Project, edits: Sequence[Edit]) -> Project:
    sources = tuple(Source(s.file, _edited(s.text, s.file, edits)) for s in project.sources)
    contract, diagnostics = check_in_part(sources, off=project.off)
    plan = project.plan
    if plan is not None:
        plan = PlanText(plan.file, _edited(plan.text, plan.file, edits))
    return Project(sources, contract, diagnostics, project.off, plan)


def _edited(text: str, file: str, edits: Sequence[Edit]) -> str:
    for edit in sorted((e for e in edits if e.file == file), key=lambda e: -e.start):
        text = text[: edit.start] + edit.text + text[edit.end :]
    return text


def _compare(project: Project, after: Project, before: Sequence[Occurrence], meaning: Meaning, new: str) -> None:
    def to(one: Meaning) -> Meaning:
        if one.what is What.VARIABLE:
            return replace(one, name=new if one == meaning else one.name, owner="")
        if renamed_with(meaning, one):
            return replace(one, name=new)
        of_node = meaning.what is What.NODE and one.what in OWNED and one.owner == meaning.name
        return replace(one, owner=new) if of_node else one

    now = [_bare(o.meaning) for o in all_occurrences(after)]
    if now != [to(o.meaning) for o in before]:
        raise Refused(f"`{new}` would stand for something else in another place")
    if meaning.what is What.VARIABLE:
        clauses = zip(_clauses(project.contract), _clauses(after.contract), strict=True)
        if any(digest(one) != digest(other) for one, other in clauses):
            raise Refused(f"with `{new}` a clause would say something else")
    if wrong := _new_faults(project, after):
        raise Refused(f"the plan would no longer fit: {wrong[0].message}")


def _bare(one: Meaning) -> Meaning:
    return replace(one, owner="") if one.what is What.VARIABLE else one


def _clauses(contract: Contract) -> Iterator[Any]:
    return (clause.spoken for node in contract.nodes for clause in node.clauses)


def _new_faults(project: Project, after: Project) -> list[Diagnostic]:
    """The faults of the plan that are new."""
    old, new = faults_of_plan(project), faults_of_plan(after)
    more = Counter(d.code for d in new) - Counter(d.code for d in old)
    return [d for d in new if more[d.code]]
