"""What an answer about a source depends on, and what is wrong with a declaration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from source_nodes import NODES, Example

from avow.backends.hoare import BACKEND as HOARE
from avow.backends.python import BACKEND
from avow.base.verdict import Verdict
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.slices import method_slice
from avow.system.plan import Numbers

WATCHDOG = NODES["watchdog"]


def test_the_declaration_is_in_the_key(tmp_path: Path) -> None:
    job = WATCHDOG.job(tmp_path)
    (node,) = job.system.plan.nodes
    assert node.source is not None
    for other in (
        replace(node.source, numbers=Numbers.EXACT),
        replace(node.source, memory={}),
        replace(node.source, class_name="Other"),
        replace(node.source, parameters=""),
    ):
        system = replace(job.system, plan=replace(job.system.plan, nodes=(replace(node, source=other),)))
        assert surroundings(BACKEND, replace(job, system=system), "") != surroundings(BACKEND, job, "")
    assert {p.name for p in BACKEND.files(job)} == {"node.py", "params.yaml"}


def test_a_method_that_does_not_look_at_the_source_is_not_shown_it(tmp_path: Path) -> None:
    job = WATCHDOG.job(tmp_path)
    assert method_slice(BACKEND, job).system.plan.nodes[0].source is not None
    assert method_slice(HOARE, job).system.plan.nodes[0].source is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("timeout: off\n", "write it in quotes"),
        ("timeout: 1:30\n", "write it in quotes"),
        ("timeout: 010\n", "write it in quotes"),
        ("timeout: .nan\n", "no REAL"),
        ("timeout: [1, 2]\n", "is a list"),
        ("- 1\n", "no mapping"),
        ("timeout: 1\ntimeout: 2\n", "twice"),
        ("{", ""),
    ],
)
def test_parameters_that_others_may_read_otherwise(text: str, words: str, tmp_path: Path) -> None:
    job = WATCHDOG.job(tmp_path)
    (tmp_path / "params.yaml").write_text(text)
    found = BACKEND.check(job)
    assert any(d.is_error and words in d.message for d in found), found


@pytest.mark.parametrize(
    ("text", "shown", "why", "instead"),
    [
        ("        while beat:", "while beat:", "while is", "write `for"),
        ("        if now ** 2 > 4:", "now ** 2", "the operator ** is", "multiply"),
        ("        if sum([now]) > 4:", "sum([now])", "the call of sum is", "call min, max"),
        ("        if [t for t in now]:", "[t for t in now]", "a list comprehension is", "write a `for` loop"),
        ("        import numpy\n        if beat:", "import numpy", "the import of numpy", "only __future__, math"),
        ("        exec('')\n        if beat:", "exec('')", "exec can change or read", "rewrite it"),
    ],
)
def test_a_refusal_has_its_place_its_construct_and_what_to_write(
    text: str, shown: str, why: str, instead: str, tmp_path: Path
) -> None:
    source = WATCHDOG.source.replace("        if beat:", text)
    (told,) = BACKEND.check(replace(WATCHDOG, source=source).job(tmp_path))
    assert (told.code, told.is_error) == ("PYTHON200", False)
    assert told.span is not None
    assert source.splitlines()[told.span.line - 1][told.span.column - 1 : told.span.end_column - 1] == shown
    assert told.message.startswith(why)
    assert (told.hint or "").startswith(instead)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("class Watchdog", "class Dog"), "there is no class Watchdog"),
        (("beat: bool", "beep: bool"), "step wants beep"),
        (("now: float, beat: bool", "now: float"), "does not take the input beat"),
        (("self.last = 0.0", "self.last = 0"), "__init__ makes self.last an int"),
        (("self.last = 0.0", "self.was = 0.0"), "__init__ does not set self.last"),
    ],
)
def test_a_class_that_does_not_fit(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    source = WATCHDOG.source.replace(*change)
    example: Example = replace(WATCHDOG, source=source)
    told = BACKEND.check(example.job(tmp_path))
    assert any(words in d.message for d in told), told
    assert not any(o.verdict is Verdict.PROVED for o in example.settled(tmp_path).values())
