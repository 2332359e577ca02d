"""Renames held against the meaning of formulas, and against each other: every name to every other name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("pygls")

from avow.formulas.formula import digest, substitute
from avow.language.load import load_contract
from avow.language.subterms import subterms
from avow.language.terms import Role, Variable
from avow.lsp.names import PORTS, What
from avow.lsp.project import Project, project_of
from avow.lsp.renaming import Edit, Refused, all_occurrences
from avow.lsp.renaming import rename as renamed
from avow.system.load import load_system

CONTRACT = """\
context {
  Colour : {red, green}; Way : { go(REAL), stop }; Limit = 3; define over(a : REAL) = a > Limit;
  Map : REAL x REAL --> BOOL; Same = (Limit); Mode = {slow, fast}; Pose : [px, py : REAL];
}
node one {
  inputs( r : REAL, seen : Map )
  outputs( colour : Colour, r2 : REAL )
  topics( float64 r matches(in.r), string seen matches(in.seen), string c matches(colour), float64 d matches(r2) )
  define most = forall(x in REAL | x > r -> x > out.r2);
  assume in_range ( forall(x, y in REAL | seen(x, y) -> (exists(z in REAL | z > x and z < y))) )
  guarantee low ( (exists(x in REAL | over(x) and x < in.r)) -> colour == green )
  guarantee there ( forall(p in Pose | (p.px > r and p.py > 0) -> p != (0, 0)) )
  guarantee r3 ( most and colour in Colour )
}
node two {
  inputs( colour : Colour, r2 : REAL, mode : Mode )
  outputs( r : REAL, way : Way )
  topics( string c matches(in.colour), float64 d matches(in.r2), float64 r matches(out.r), string w matches(way) )
  guarantee low ( way == go(r2) or (way == stop and out.r == Same and mode in Mode) )
}
"""
PLAN = """\
system: s
connections:
  - {from: two.r, to: one.r, delayed: true, initial: "out.r == Limit"}
environment:
  one.seen: {assume: "forall(x in REAL | in.seen(x, x))", because: it is so}
requirements:
  R: {text: t, formula: "one.colour == red and two.way != stop", supported_by: [one.low, two]}
  S: {text: t, temporal: "always (two.r2 > Limit)", supported_by: [two.low]}
compose:
  D: {select: [one, two]}
nodes:
  one: {criticality: high}
expected:
  - {obligation: one/sanity/not-vacuous-low, verdict: refuted, reason: r}
  - {obligation: two/guarantee/low, verdict: refuted, reason: r}
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("renaming")
    (folder / "system.rcl").write_text(CONTRACT, "utf-8")
    (folder / "plan.yaml").write_text(PLAN, "utf-8")
    load_system(folder)
    return project_of(str(folder / "system.rcl"), {str(folder / "system.rcl"): CONTRACT})


def apply(project: Project, edits: tuple[Edit, ...], folder: Path) -> None:
    """Writes the files as they would be."""
    folder.mkdir()
    for file in {project.plan.file if project.plan else "", *(s.file for s in project.sources)}:
        text = project.text_of(file)
        for edit in sorted((e for e in edits if e.file == file), key=lambda e: -e.start):
            text = text[: edit.start] + edit.text + text[edit.end :]
        (folder / Path(file).name).write_text(text, "utf-8")


@pytest.mark.slow
def test_every_name_to_every_other(project: Project, tmp_path: Path) -> None:
    """What is allowed leaves every clause its meaning, by its digest, and the system can be loaded."""
    meanings = list(dict.fromkeys(o.meaning for o in all_occurrences(project) if o.declares))
    assert {m.what for m in meanings} == set(What)
    names = [*dict.fromkeys(m.name for m in meanings), "fresh", "x'", "G1", "A1"]
    number = allowed = refused = 0
    for meaning in meanings:
        for new in [name for name in names if name != meaning.name]:
            number += 1
            if number % 4 and new != "fresh":
                continue
            try:
                edits = renamed(project, meaning, new)
            except Refused:
                refused += 1
                assert new != "fresh", meaning
                continue
            allowed += 1
            folder = tmp_path / str(allowed)
            apply(project, edits, folder)
            after = load_contract([folder / "system.rcl"])
            load_system(folder)
            if meaning.what in (What.ELEMENT, What.FIELD):
                continue  # a digest knows elements and fields by their names
            for old_node, new_node in zip(project.contract.nodes, after.nodes, strict=True):
                for one, other in zip(old_node.clauses, new_node.clauses, strict=True):
                    found = {t for t in subterms(one.formula) if isinstance(t, Variable) and t.role is not Role.BOUND}
                    ports = meaning.what in PORTS
                    moved = {v: replace(v, name=new) for v in found if ports and v.name == meaning.name}
                    assert digest(substitute(one.formula, moved)) == digest(other.formula), (meaning, new)
    assert allowed > 40
    assert refused > 40


@pytest.mark.slow
def test_a_rename_and_its_reverse_leave_the_files_as_they_were(project: Project, tmp_path: Path) -> None:
    for k, meaning in enumerate(dict.fromkeys(o.meaning for o in all_occurrences(project) if o.declares)):
        folder = tmp_path / str(k)
        apply(project, renamed(project, meaning, "fresh"), folder)
        file = str(folder / "system.rcl")
        there = project_of(file, {file: Path(file).read_text("utf-8")})
        back = next(o.meaning for o in all_occurrences(there) if o.meaning.name == "fresh")
        apply(there, renamed(there, back, meaning.name), folder / "back")
        assert (folder / "back/system.rcl").read_text("utf-8") == CONTRACT, meaning
        assert (folder / "back/plan.yaml").read_text("utf-8") == PLAN, meaning
