"""The rules that every backend must keep. `docs/developers/adding-a-backend.md` explains them."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import jsonschema
import pytest

from avow.backend_kit import registry
from avow.backend_kit.protocol import COMMON_OPTIONS, Backend, Job, Limits, lacks
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.tools import find_tool
from avow.base.tuning.running import CONFORMANCE_PATIENCE
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import Seeded, settle, verdicts
from avow.evidence.status import Status
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.sorts import BOOL
from avow.language.terms import TRUE, And, History, Not, Past
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.methods import method_job
from avow.solving.smtlib import CVC5
from avow.system.plan import System

_HOSTILE = ("class", "ensures", "lambda", "None", "self", "exit", "con", "x" * 120)
"""Names that are ordinary in the contract language, but special for a tool, a file system or Python."""

_ODD_VALUES: tuple[Any, ...] = (None, True, -1, 10**30, 1.5, "", "nowhere", "../../../etc/passwd", [], {}, [[]])
"""Values that a typing error may give to options; most have a wrong type for any option."""

_FOLDER = 'it\'s; $(touch broken) "a b" µ'
"""A folder name that breaks code which pastes paths into commands."""

_LIES = (None, "", "exit 1", "kill -9 $$", "head -c 100000 /dev/zero", "echo unsat; echo 0 errors")
"""The replacements of the tools: none, or a script with this content."""

_ENOUGH = Limits(seconds=120.0)
_HARDLY = Limits(seconds=0.05)


class Conformance:
    """Inherit it, name `backend`, and seed it. The name of the class must start with `Test`."""

    backend: ClassVar[Backend]
    seeded: ClassVar[tuple[Seeded, ...]]
    """Contracts with known verdicts. At least one claim must be supported, and one refuted (or, by `never_refutes`,
    not supported): a method with the same verdict for everything shows nothing."""
    never_refutes: ClassVar[bool] = False
    """The method cannot show that a claim is false: a claim that it does not support is `unknown`."""
    files_name_the_node: ClassVar[bool] = False
    """The seeded files contain names derived from the node's: the node then keeps its name."""

    asks_inputs: ClassVar[bool] = True
    """The program under test is run on inputs of the contract, on which its assumptions can be judged; this is false
    for measurements of whole runs, and for a model with an environment of its own."""

    def pytest_generate_tests(self, metafunc: pytest.Metafunc) -> None:
        if "case" in metafunc.fixturenames:
            metafunc.parametrize("case", self.seeded, ids=[case.name for case in self.seeded])
        if "answer" in metafunc.fixturenames:
            outside = any(tool.path for tool in self.backend.tools())
            metafunc.parametrize("answer", _LIES if outside else ())

    @pytest.fixture
    def job(self, case: Seeded, tmp_path: Path) -> Job:
        return case.written(self.backend, tmp_path / "system")

    # -- declarations --------------------------------------------------------------------------------------------------

    def test_it_keeps_the_promise(self) -> None:
        """All attributes exist, have the right types, and are not empty."""
        assert lacks(self.backend) == ""
        assert self.backend.strength.supports, "strength is the best verdict, one that supports a claim"
        for name in ("name", "title", "version", "green_means"):
            assert getattr(self.backend, name).strip(), f"{name} says nothing"
        assert self.backend.name == self.backend.name.lower()
        assert self.backend.name.replace("_", "").replace("-", "").isalnum()

    def test_the_schema_is_one(self, case: Seeded) -> None:
        """`options_schema` is JSON schema, leaves the pipeline's own options alone, accepts the seeded options, and
        rejects an undeclared one: otherwise a typing error in a name would not be found."""
        jsonschema.Draft202012Validator.check_schema(self.backend.options_schema)
        common = COMMON_OPTIONS & set(self.backend.options_schema.get("properties", {}))
        assert not common, f"these are options of every method: {sorted(common)}"
        own = case.options
        if isinstance(own, Mapping):
            own = {key: value for key, value in own.items() if key not in COMMON_OPTIONS}
        schema = jsonschema.Draft202012Validator(self.backend.options_schema)
        schema.validate(own)
        assert not isinstance(own, Mapping) or not schema.is_valid({**own, "undeclared": 1}), "additionalProperties"

    def test_the_codes_are_declared(self) -> None:
        for name, code in self.backend.codes.items():
            assert code.code == name
            assert code.title, name

    def test_tools_are_found_without_an_exception(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A missing tool has instructions to install it."""
        monkeypatch.setenv("PATH", os.devnull)
        self.forget_tools()
        try:
            for tool in self.backend.tools():
                assert tool.present or tool.install, f"{tool.name} does not say how it is installed"
        finally:
            self.forget_tools()

    def test_seeds_of_both_kinds(self) -> None:
        every = [verdict for case in self.seeded for verdict in case.verdicts.values()]
        assert any(verdict.supports for verdict in every), "no seeded claim is supported"
        bad = [v for v in every if (not v.supports if self.never_refutes else v is Verdict.REFUTED)]
        assert bad, "no seeded claim is refuted"

    # -- verdicts ------------------------------------------------------------------------------------------------------

    def test_seeded_verdicts(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """Each claim gets its correct verdict, twice; a refutation has a reason; the system's folder is unchanged."""
        errors = [d for d in self.backend.check(job) if d.is_error]
        assert not any(v.supports for v in case.verdicts.values()) or not errors, errors
        before = _tree(job.root)
        children = _children()
        report = settle(self.backend, job, tmp_path / "made", _ENOUGH)
        found = verdicts(job, report)
        absent = [t for t in self.backend.tools() if not t.present]
        if absent and Verdict.NOT_RUN in found.values():
            pytest.skip(f"{absent[0].name} is not here: {absent[0].install}")
        assert found == dict(case.verdicts), [(o.obligation, o.verdict, o.summary) for o in report.outcomes]
        assert _tree(job.root) == before, "a discharge changes nothing in the system's folder"
        assert _children() <= children, "a discharge leaves no process behind"
        assert report.tool
        for outcome in report.outcomes:
            self.is_sound(outcome)
        assert verdicts(job, settle(self.backend, job, tmp_path / "again", _ENOUGH)) == found

    def is_sound(self, outcome: Outcome) -> None:
        """The conditions on every outcome."""
        assert outcome.summary.strip(), f"{outcome.verdict} without a word"
        assert "Traceback" not in outcome.summary
        if outcome.verdict is Verdict.REFUTED:
            assert outcome.counterexample is not None, "a refutation needs a counterexample"
        if outcome.verdict.supports:
            most = self.backend.strength
            assert Status(outcome.verdict).rank <= Status(most).rank, f"strength says {most} at best"
        if outcome.verdict in (Verdict.CHECKED, Verdict.TESTED, Verdict.MONITORED):
            assert outcome.bound, "an answer within bounds names them"

    def test_one_obligation_at_a_time(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """A subset of the obligations gets the same verdicts as in the whole set, and no others are answered."""
        assert self.backend.discharge(replace(job, obligations=(), claims=()), tmp_path, _ENOUGH).outcomes == ()
        for k, obligation in enumerate(job.obligations):
            one = replace(job, obligations=(obligation,))
            found = verdicts(one, settle(self.backend, one, tmp_path / str(k), _ENOUGH))
            assert found == {obligation.name: case.verdicts[obligation.name]} or self.is_absent(found)

    # -- export --------------------------------------------------------------------------------------------------------

    def test_export_is_pure(self, job: Job, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Same job, same bytes, at any place and time; names stay in the folder; nothing is written."""
        before = _tree(job.root)
        once = dict(self.backend.export(job))
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("TZ", "Pacific/Auckland")
        assert dict(self.backend.export(job)) == once
        assert _tree(job.root) == before
        for name, text in once.items():
            assert isinstance(text, str)
            assert not Path(name).is_absolute()
            assert ".." not in Path(name).parts
            assert str(job.root) not in text, f"{name} holds this machine's paths"

    def test_outside_checks(self, job: Job, tmp_path: Path) -> None:
        """Each names an existing file, and guarantees of the method."""
        files = self.backend.export(job)
        for name, text in files.items():
            write(tmp_path / name, text)
        for check in self.backend.outside_checks(job, tmp_path, tuple(files)):
            assert check.file.is_file(), check.file
            assert check.command
            assert set(check.guarantees) <= set(job.method.guarantees)

    def test_translations(self, job: Job) -> None:
        """Every notation gives files or what is missing; bad input is Rejected, with a place or a reason."""
        for notation, words in self.backend.translations.items():
            assert words.strip()
            try:
                made = self.backend.translate(notation, job.system, job.node)
            except Rejected as rejected:
                self.codes_are_known(rejected.diagnostics)
                continue
            assert made.files or made.missing
            assert made == self.backend.translate(notation, job.system, job.node)
            self.codes_are_known(made.missing)

    def test_other_steps(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """A clause about other steps is judged, or rejected by name: here each demands something impossible."""
        never = Not(History(Past.ONCE, (TRUE,), BOOL))
        for where in ("guarantees", "assumptions"):
            node = job.node
            if where == "guarantees":
                asked = {o.name for o in job.obligations}
                changed = tuple(
                    replace(c, formula=And((c.formula, never))) if c.name in asked else c for c in node.guarantees
                )
                node = replace(node, guarantees=changed)
            elif not self.backend.remembers:
                odd = Clause(ClauseKind.ASSUMPTION, "begun", len(node.assumptions) + 1, Not(never))
                node = replace(node, assumptions=(*node.assumptions, odd))
            else:
                continue
            report = settle(self.backend, self.asked_of(job, node), tmp_path / where, _ENOUGH)
            for outcome in report.outcomes:
                assert not outcome.verdict.supports, f"{outcome.obligation} is {outcome.verdict}"
                if not self.backend.remembers:
                    assert outcome.verdict is Verdict.UNKNOWN
                    assert "once" in outcome.summary

    def test_only_what_is_assumed(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """A counterexample satisfies the node's assumptions: if nothing can, nothing is refuted."""
        if Verdict.REFUTED not in case.verdicts.values() or not self.asks_inputs:
            return
        nothing = Clause(ClauseKind.ASSUMPTION, "nothing", len(job.node.assumptions) + 1, Not(TRUE))
        node = replace(job.node, assumptions=(*job.node.assumptions, nothing))
        report = settle(self.backend, self.asked_of(job, node), tmp_path / "made", _ENOUGH)
        refuted = [o.summary for o in report.outcomes if o.verdict is Verdict.REFUTED]
        assert not refuted, "the assumptions exclude every input"

    def asked_of(self, job: Job, node: Node) -> Job:
        """The job, with the node in place of the one of its name."""
        nodes = tuple(node if other.name == node.name else other for other in job.contract.nodes)
        system = replace(job.system, contract=replace(job.contract, nodes=nodes))
        return method_job(system, node, job.method, self.backend)

    # -- hostile input -------------------------------------------------------------------------------------------------

    def test_hostile_names(self, case: Seeded, tmp_path: Path) -> None:
        """A node and guarantees with names that are keywords of a tool or of Python: the verdicts do not change."""
        mine = _HOSTILE[self.seeded.index(case) % len(_HOSTILE) :] + _HOSTILE
        words = mine[: len(_HOSTILE) : min(2, len(self.seeded))]
        for k in range(0, len(words), len(case.verdicts)):  # as many of them at a time as there are claims
            some = words[k : k + len(case.verdicts)]
            node = {} if self.files_name_the_node else {case.node: f"{some[0]}_n"}
            other = case.renamed({**node, **dict(zip(case.verdicts, some, strict=False))})
            job = other.written(self.backend, tmp_path / str(k) / "system")
            found = verdicts(job, settle(self.backend, job, tmp_path / str(k) / "made", _ENOUGH))
            assert found == dict(other.verdicts) or self.is_absent(found), some

    def test_a_hostile_folder(self, case: Seeded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Paths are data, also those that a shell would run as commands."""
        monkeypatch.chdir(tmp_path)
        job = case.written(self.backend, tmp_path / _FOLDER)
        found = verdicts(job, settle(self.backend, job, tmp_path / "made", _ENOUGH))
        assert found == dict(case.verdicts) or self.is_absent(found)
        assert not (tmp_path / "broken").exists()

    def test_hostile_options(self, case: Seeded, tmp_path: Path) -> None:
        """Odd values that pass the schema, one after the other: a value that `check` rejects supports nothing, and
        neither call raises. (The pipeline rejects values that do not pass the schema.)"""
        if not isinstance(case.options, Mapping):
            pytest.skip("the options are no mapping")
        for k, (key, value) in enumerate((key, value) for key in case.options for value in _ODD_VALUES):
            if key in COMMON_OPTIONS:
                continue
            folder = tmp_path / str(k)
            odd = replace(case, options={**case.options, key: value})
            try:
                job = odd.written(self.backend, folder)
            except Rejected:  # YAML cannot express it, or the plan's reader rejects it already
                continue
            schema = jsonschema.Draft202012Validator(self.backend.options_schema)
            if schema.is_valid(job.options) and any(d.is_error for d in self.backend.check(job)):
                self.is_refused(job, folder / "made")

    def test_files_that_are_missing(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """Without a file, and with a broken one, no claim that depends on it is supported, and nothing raises."""
        for name in case.files:
            kept = (job.root / name).read_bytes()
            for broken in (None, b"", b"\xff\xfe\x00\x01", b"(" * 5000):
                (job.root / name).unlink(missing_ok=True)
                if broken is not None:
                    (job.root / name).write_bytes(broken)
                self.is_refused(job, tmp_path / "made")
            (job.root / name).write_bytes(kept)

    def is_refused(self, job: Job, folder: Path) -> None:
        self.codes_are_known(self.backend.check(job))
        for path in self.backend.files(job):
            assert path.is_absolute()
        try:
            report = settle(self.backend, job, folder, _ENOUGH)
        except Rejected:  # from export: the diagnostics of check
            report = self.backend.discharge(job, folder, _ENOUGH)
        for name, verdict in verdicts(job, report).items():
            assert not verdict.supports, f"{name} is {verdict} although the input is at fault"

    def codes_are_known(self, diagnostics: tuple[Diagnostic, ...]) -> None:
        known = {*self.backend.codes, *registry.every_code()}
        for diagnostic in diagnostics:
            assert diagnostic.code in known, f"{diagnostic.code} is not declared"
            assert diagnostic.message.strip()

    # -- tools and time ------------------------------------------------------------------------------------------------

    def test_hardly_any_time(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """It returns soon, with a verdict for each claim: the correct one, or one for giving up."""
        begun, children = time.monotonic(), _children()
        found = verdicts(job, settle(self.backend, job, tmp_path / "made", _HARDLY))
        assert time.monotonic() - begun < CONFORMANCE_PATIENCE
        gave_up = (Verdict.UNKNOWN, Verdict.ERROR, Verdict.NOT_RUN)
        for name, verdict in found.items():
            assert verdict in (case.verdicts[name], *gave_up), (name, verdict)
        assert _children() <= children, "a discharge leaves no process behind"

    def test_tools_that_are_missing_or_lie(
        self, case: Seeded, job: Job, answer: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Without its outside tools, or with others under their names, no further claim is supported: neither an exit
        code nor empty output is an answer."""
        outside = [Path(tool.path).name for tool in self.backend.tools() if tool.path]
        place = tmp_path / "bin"
        place.mkdir()
        for name in outside if answer is not None else ():
            (place / name).write_text(f"#!/bin/sh\n{answer}\n")
            (place / name).chmod(0o755)
        monkeypatch.setenv("PATH", f"{place}:/usr/bin:/bin" if answer is not None else str(place))
        self.forget_tools()
        try:
            report = settle(self.backend, job, tmp_path / "made", _ENOUGH)
        finally:
            self.forget_tools()
        for outcome in report.outcomes:
            if outcome.verdict.supports:
                right = case.verdicts[_job_name(job, outcome)]
                assert right.supports, f"{outcome.obligation} is {outcome.verdict} without its tool"
                required = [t for t in self.backend.tools() if t.path and not t.optional]
                assert not required, f"{required[0].name} is required, and was not there"

    def forget_tools(self) -> None:
        """Called when the PATH changes. Override it if a backend caches its tools by itself."""
        find_tool.cache_clear()

    def is_absent(self, found: Mapping[str, Verdict]) -> bool:
        return set(found.values()) == {Verdict.NOT_RUN} and any(not t.present for t in self.backend.tools())

    # -- staleness -----------------------------------------------------------------------------------------------------

    def test_its_files_are_named(self, case: Seeded, job: Job) -> None:
        """Every file that the answer depends on is in `files`; otherwise a change of it would not be noticed."""
        named = {path.resolve() for path in self.backend.files(job)}
        for path in named:
            assert path.is_relative_to(job.root.resolve()), f"{path} is outside the system's folder"
        for name in case.files:
            assert (job.root / name).resolve() in named, f"a change of {name} would go unnoticed"

    def test_what_it_says_not_to_look_at(self, case: Seeded, job: Job, tmp_path: Path) -> None:
        """The pipeline relies on `uses_scenario`, `uses_steps` and `uses_wiring`: if one is False, export and verdicts
        do not depend on that part; if it is True, that part changes the key."""
        whole = self.backend.export(job)
        found = verdicts(job, settle(self.backend, job, tmp_path / "made", _ENOUGH))
        for name, looked, system in _others(self.backend, job):
            other = replace(job, system=system)
            if looked:
                assert surroundings(self.backend, other, "") != surroundings(self.backend, job, ""), name
            else:
                assert self.backend.export(other) == whole, f"it does look at the {name}"
                assert verdicts(other, settle(self.backend, other, tmp_path / name, _ENOUGH)) == found, name

    def test_suits_any_node(self, job: Job) -> None:
        """A guess, but never an exception."""
        nodes: tuple[Node, ...] = job.contract.nodes
        assert all(isinstance(self.backend.suits(node), bool) for node in nodes)


def _job_name(job: Job, outcome: Outcome) -> str:
    return next(o.name for o in job.obligations if o.id == outcome.obligation)


def _others(backend: Backend, job: Job) -> Iterator[tuple[str, bool, System]]:
    """The parts, whether the backend says that it uses each, and a system that differs only there."""
    plan = job.system.plan
    scenario = plan.scenario
    if scenario is not None:
        other = replace(scenario, steps=(scenario.steps or 0) + 7, digest=scenario.digest + "'")
        if backend.uses_scenario:
            yield "steps", backend.uses_steps, replace(job.system, plan=replace(plan, scenario=other))
        else:
            yield "scenario", False, replace(job.system, plan=replace(plan, scenario=None))
    if not backend.uses_wiring:
        alone = replace(job.system.contract, nodes=(job.node,))
        yield "wiring", False, replace(job.system, contract=alone)


def _tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def _children() -> set[int]:
    """The running child processes of this one; empty if the operating system does not list them. The second solver's
    process belongs to the pipeline, which keeps it for the next query: it is ended first."""
    CVC5.close()
    if sys.platform != "linux":
        return set()
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[1] == str(os.getpid()) and fields[0] != "Z":
            found.add(int(stat.parent.name))
    return found
