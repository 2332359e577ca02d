"""The checker of the first page: it bears out every number of a true page, and finds any that is changed."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, keys_of, node_plan, obligation, system
from assurance.test_rates import sampled, three
from helpers import every_text

from avow.assurance.answers import Baseline
from avow.assurance.changes import KINDS
from avow.assurance.deficits import _WORDS, words_of
from avow.assurance.model import Case
from avow.assurance.state import baseline_of
from avow.base.files import sha256
from avow.base.verdict import Counterexample, Object, Verdict
from avow.evidence.ledger import Ledger
from avow.evidence.obligation import Kind, ProgramClaim
from avow.kernel.rates import tail
from avow.pipeline.report_check import check
from avow.recount import NUMBER, recounted
from avow.recount.__main__ import main
from avow.recount.facts import Facts, upper
from avow.recount.page import blocks
from avow.recount.rules import _DEFICITS
from avow.report import render_all
from avow.system.plan import EnvironmentInput, Finding, Hazard, Requirement
from report.test_answers_page import CASES as PAGES
from report.test_answers_page import REPORTS


def with_a_rate() -> Case:
    return three(sampled("a.g"), sampled("b.g", "0.049", 60), sampled("c.g"))


def limited() -> Case:
    """A requirement whose rate is above the policy's limit: the gate's reason has the rate in it."""
    samples = (sampled("a.g"), sampled("b.g", "0.049", 60), sampled("c.g"))
    return three(*samples, policy={"max_failure_rate": {"medium": 0.01}})


def stratified() -> Case:
    """A second experiment, with strata and an assumption of its own without words."""
    target = guarantee("n", "g")
    bound = {"runs": 40, "failures": 0, "worst stratum": "floor = dry, 0 of 20 failed"}
    bound |= {"failure probability at most": 0.1392, "confidence": 0.95}
    record = evidence(target, Verdict.TESTED, "experiment-2", bound=bound, hypotheses=("runs are independent",))
    return make_case(system({"n": ["g"]}), [target], [record])


def examined() -> Case:
    """A refutation that the plan expects, with a counterexample to be cut; gates that are not asked."""
    target = guarantee("n", "g")
    subject = system({"n": ["g"]}, policy="reproduction", expected=[Finding("n/guarantee/g", "refuted")])
    values = (*((f"in.x{at}", str(at)) for at in range(20)), ("in.r", "127"))
    target = replace(target, formula="0 ≤ in.r < 120")
    return make_case(subject, [target], [evidence(target, Verdict.REFUTED, counterexample=Counterexample(values))])


def weakened() -> Case:
    """Inputs without an answer, a claim that NaN breaks, and a refutation by a method that left the plan."""
    target = guarantee("n", "g")
    known = {"bound": {"cases": 9, "unanswered": 2}, "details": {"no numbers": "in.x = NaN"}}
    sampled = evidence(target, Verdict.TESTED, "hypothesis", **known)
    records = [sampled, evidence(target, Verdict.REFUTED, "dafny")]
    asked = Requirement("R", "It is safe.", "n.x > 0", None, ("n.g",))
    hazards = [
        Hazard(f"H{at}", f"It burns {'abcdefghij'[at]}", "critical", mitigated_by=("n.g",)[at // 8 :])
        for at in range(10)
    ]
    plans = [node_plan("n", "low", "hypothesis")]
    subject = system({"n": ["g"]}, plans=plans, requirements=[asked], hazards=hazards)
    return make_case(subject, [target], records, keys=keys_of(records[:1]))


def mixed() -> Case:
    """A hazard with a mitigation that is tested and one that is proved of a model; a gate that the plan relaxes."""
    a, b = guarantee("a", "g"), guarantee("b", "g")
    hazard = Hazard("H", "It burns", "critical", mitigated_by=("b", "a"))
    relaxed = {"profile": "default", "programs": ["tested", "not-run"]}
    subject = system({"a": ["g"], "b": ["g"]}, hazards=[hazard], policy=relaxed)
    runs = obligation("a", Kind.PROGRAM, ProgramClaim.FAULTLESS)
    records = [evidence(a, Verdict.TESTED, "hypothesis", of=Object.SOURCE), evidence(b)]
    return make_case(subject, [a, b, runs], [*records, evidence(runs, Verdict.NOT_RUN, "fuzz")])


CASES: dict[str, Callable[[], Case]] = {
    "rate": with_a_rate,
    "limited": limited,
    "stratified": stratified,
    "examined": examined,
    "weakened": weakened,
    "mixed": mixed,
    **PAGES,
}  # type: ignore[dict-item]


@cache
def made(name: str) -> tuple[str, bytes]:
    found = dict(every_text(CASES[name]()))
    return found["index.html"], found["report.json"].encode()


def changed(page: str) -> Iterator[tuple[str, str]]:
    """Each number that a reader sees, one greater than it is: (text around it, the page). Left out: the digest of
    what is signed, which `avow sign` computes, and names of nodes."""
    told = blocks(page)
    body = page.index("<body")
    for text in re.finditer(r">([^<>]+)<", page[body:]):
        for number in NUMBER.finditer(text[1]):
            at, end = (body + text.start(1) + place for place in number.span())
            digits = number.group()
            other = page[:at] + digits[:-1] + str((int(digits[-1]) + 1) % 10) + page[end:]
            entity, node = page[:at].endswith("&#"), page[:at].endswith("arm")
            left_out = re.match(r"[^<]*…</code>", page[at:])
            if not (entity or node or left_out) and blocks(other) != told:
                yield page[at - 30 : end + 30], other


@pytest.mark.parametrize("name", CASES)
def test_a_true_page_is_borne_out(name: str) -> None:
    assert recounted(*made(name)) == []


@pytest.mark.parametrize("number", [3, 4, 5, 12])
def test_any_number_of_tools_is_borne_out(number: int) -> None:
    target, versions = guarantee("n", "g"), ("1.0", "2", "4.16.0.0", "Python 3.11", "(x) 3")
    records = [
        evidence(target, Verdict.TESTED, f"hypothesis-{at}", tool=f"tool{at}", tool_version=versions[at % 5])
        for at in range(number)
    ]
    texts = dict(every_text(make_case(system({"n": ["g"]}), [target], records)))
    page, data = texts["index.html"], texts["report.json"].encode()
    assert recounted(page, data) == []
    assert "0 of 1 guarantee that holds has a second method" in page
    many = f", {number - 3} of {number - 3} other tools)"
    assert (many in page) == (number > 4)
    for wrong in (
        many.replace(f"of {number - 3} ", f"of {number - 2} "),
        many.replace(f", {number - 3} ", f", {number - 2} "),
    ):
        assert number < 5 or recounted(page.replace(many, wrong), data) != []


def test_findings_that_the_plan_lists_add_up_on_the_page() -> None:
    page, data = made("examined")
    told = " ".join(re.sub(r"<[^>]*>", " ", page).split())
    assert "1 finding against it, which the plan lists: 1 refuted · " in told
    assert recounted(page.replace("lists: 1 refuted", "lists: 2 refuted"), data) != []


def test_no_kind_of_deficit_is_hidden_on_the_first_screen() -> None:
    found = CASES["rover"]()
    told = " ".join(re.sub(r"<[^>]*>", " ", made("rover")[0]).split()).partition("6 What has nobody shown?")[2]
    assert len(found.deficits) > 6
    assert all(f"{d.count} {d.words}" in told.partition("7 What must")[0] for d in found.deficits)


def test_where_no_guarantee_holds_none_is_counted_that_has_a_second_method() -> None:
    page, _ = made("examined")
    assert 'no certificate <span class="m">(1 answer of hoare: z3 1.0)</span>: no guarantee holds.' in page


def test_a_gate_that_the_plan_relaxes_is_named() -> None:
    page, data = made("mixed")
    assert "gates pass, 1 relaxed by the plan" in " ".join(page.split())
    assert ": passes, relaxed by the plan" in page
    assert recounted(page.replace("1 relaxed", "2 relaxed"), data)


def test_another_report_json_is_named_as_such() -> None:
    page, data = made("rate")
    (line,) = recounted(page, data + b"\n")
    assert line.startswith("report.json is not the one that the page names")


def _signed_first(seed: int) -> Case:
    """A case of random claims after a signature of another one: every kind of change may occur."""
    random = Random(seed)
    limits = ["in.r < 120 ⇒ out.s = 1", "in.r < 130 ⇒ out.s = 1", "47 runs, 0 failed; the worst stratum: 3"]
    verdicts = [Verdict.PROVED, Verdict.TESTED, Verdict.REFUTED]
    title = "It is 1 of 2 cases, 3 answers from earlier runs"

    def drawn(old: Baseline | None) -> Case:
        targets = [
            replace(guarantee("n", name, f"{title} {name}", formula), digest=sha256(formula))
            for name in "abcd"
            if random.random() < 0.8
            for formula in [random.choice(limits)]
        ]
        records = [evidence(target, random.choice(verdicts)) for target in targets]
        names = [f"n.{target.name}" for target in targets]
        asked = [Requirement(f"R{at}", title, random.choice(limits), None, tuple(names)) for at in range(3)]
        asked = random.sample(asked, random.randint(0, 3))
        assumed = [EnvironmentInput(f"in.{x}", "in.x < 3", f"{x} of 12") for x in "xy" if random.random() < 0.5]
        severity, policy = random.choice(["critical", "marginal"]), random.choice([None, "reproduction"])
        hazards = [Hazard(f"H{at}", f"It burns {at}", severity, mitigated_by=tuple(names[:at])) for at in range(3)]
        subject = system(
            {"n": [t.name for t in targets]},
            requirements=asked,
            environment=assumed,
            policy=policy,
            hazards=random.sample(hazards, random.randint(0, 3)),
        )
        sources = {"contracts/rover/system.rcl": f"const LOW = {random.choice([18, 19])};"}
        return make_case(subject, targets, records, baseline=old, sources=sources)

    return drawn(baseline_of(drawn(None), "signed/rover/1.json", "A. Person 2", "2026-11-20", "2027-11-20"))


def test_changes_since_a_signature_are_borne_out_and_changed_ones_found() -> None:
    found = set[str]()
    for seed in range(30):
        later = _signed_first(seed)
        texts = dict(every_text(later))
        page, data = texts["index.html"], texts["report.json"].encode()
        assert recounted(page, data) == [], seed
        found |= {entry.kind for entry in later.changes.entries}
        if seed < 3:
            before, after = page.partition('id="changes"')[0], page.partition('id="gates"')[2]
            rows = set(page.splitlines())  # a row that became another true one is no lie
            lies = [(near, lie) for near, lie in changed(page) if lie.startswith(before) and lie.endswith(after)]
            lies = [(near, lie) for near, lie in lies if not rows.issuperset(lie.splitlines())]
            assert [near for near, lie in lies if not recounted(lie, data)] == []
    assert found >= {*KINDS} - {"expired", "rerun"}


def test_a_counterexample_begins_with_what_the_formula_reads() -> None:
    assert "(in.r = 127, in.x0 = 0," in examined().answers.refuted


def test_each_kind_of_deficit_is_recounted() -> None:
    facts = Facts(json.loads(made("weakened")[1]))
    assert {"unanswered", "nan", "withdrawn"} <= {d["key"] for d in facts.case["deficits"]}
    for key in _WORDS:
        assert facts.deficit(key) is not None, key
        assert all(any(re.fullmatch(p, words_of(key, n)) for p in _DEFICITS) for n in (1, 2)), key


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rover", "large", "rate", "limited", "stratified", "examined"])
def test_any_changed_number_is_found(name: str) -> None:
    page, data = made(name)
    seeded = list(changed(page))
    assert len(seeded) > 40
    assert [near for near, other in seeded if not recounted(other, data)] == []


def test_some_changed_numbers_are_found() -> None:
    page, data = made("rover")
    for told, lie in (("3 of 7 gates", "4 of 7 gates"), ("A1 to A", "A2 to A"), ("46 of 50", "47 of 50")):
        if told in page:
            assert recounted(page.replace(told, lie), data) != [], told


@pytest.mark.nightly
@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.name)
def test_numbers_of_shipped_systems_are_borne_out_and_changed_ones_found(folder: Path) -> None:
    page, data = (folder / "index.html").read_text(), (folder / "report.json").read_bytes()
    assert recounted(page, data) == []
    assert [near for near, other in changed(page) if not recounted(other, data)] == []


def with_facts(name: str, change) -> list[str]:  # type: ignore[no-untyped-def]
    """What is found where the page is as it was and a fact in report.json is another one."""
    page, data = made(name)
    case = json.loads(data)
    change(case)
    altered = json.dumps(case).encode()
    import hashlib

    page = page.replace(hashlib.sha256(data).hexdigest(), hashlib.sha256(altered).hexdigest())
    return recounted(page, altered)


def _drop(key: str, within: str = ""):  # type: ignore[no-untyped-def]
    def change(case) -> None:  # type: ignore[no-untyped-def]
        found = next(item for item in case[key] if not within or item[within])
        if within:
            found[within] = not found[within] if isinstance(found[within], bool) else []
        else:
            case[key].remove(found)

    return change


def _refute(case) -> None:  # type: ignore[no-untyped-def]
    view = next(v for v in case["obligations"] if v["obligation"]["kind"] == "guarantee" and v["standing"] == "proved")
    view["standing"] = view["status"] = "refuted"


def _fewer_trials(case) -> None:  # type: ignore[no-untyped-def]
    for view in case["obligations"]:
        for item in view["evidence"]:
            bound = item["entry"]["evidence"]["bound"]
            bound |= {key: bound[key] - 1 for key in ("triggered",) if key in bound}


FACTS = {
    "a requirement less": _drop("requirements"),
    "an assumption less": _drop("assumptions"),
    "a gate less": _drop("gates"),
    "a gate that fails": _drop("gates", "passed"),
    "an assumption that nobody needs": _drop("assumptions", "needed_by"),
    "a refuted guarantee": _refute,
    "fewer trials": _fewer_trials,
}


@pytest.mark.parametrize("fault", FACTS)
def test_a_number_that_its_facts_do_not_bear_out_is_found(fault: str) -> None:
    assert with_facts("large", FACTS[fault]) != []


def test_what_report_json_itself_counts_for_the_page_is_not_believed() -> None:
    """The same lie on the page and in the answers of report.json."""
    page, data = made("large")
    lie = data.decode().replace("30 argued", "31 argued")
    assert lie != data.decode()
    page = page.replace("30 argued", "31 argued")
    assert any("31 argued" in line for line in recounted(page, lie.encode()))


def test_a_bound_is_computed_again_from_its_sample() -> None:
    """A record that claims less than 95 of 100 cases can show is not quoted as evidence of it."""
    assert upper(0, 47, 0.95) == pytest.approx(1 - 0.05 ** (1 / 47))
    for failures, trials, sure in ((2, 50, 0.9), (0, 3, 0.5), (7, 300, 0.99)):
        assert float(tail(failures, trials, Fraction(upper(failures, trials, sure)))) == pytest.approx(1 - sure)
    assert upper(5, 5, 0.9) == 1

    def shown(bound: float) -> list[str]:
        told = {"runs": 47, "failures": 0, "failure probability at most": bound, "confidence": 0.95}
        target = guarantee("n", "g")
        found = make_case(system({"n": ["g"]}), [target], [evidence(target, Verdict.TESTED, "experiment", bound=told)])
        texts = dict(every_text(found))
        return recounted(texts["index.html"], texts["report.json"].encode())

    assert shown(0.0618) == []
    assert any("47 runs, 0 failed" in line for line in shown(0.05))


def test_the_weakest_evidence_of_requirements_and_hazards_is_found_again() -> None:
    """Another bound, and another claim of those beneath."""
    node, danger = [guarantee("n", "g"), guarantee("n", "h")], Hazard("H", "It burns", "marginal", mitigated_by=("R",))
    asked = Requirement("R", "It is so.", "n.x > 0", None, ("n.g", "n.h"))
    own = obligation("system", Kind.REQUIREMENT, "R", clauses=("n.g", "n.h"))
    bounds = [{"cases": 20, "failure_probability_below": bound, "confidence": 0.95} for bound in (0.15, 0.2)]
    records = [evidence(g, Verdict.TESTED, "hypothesis", bound=b) for g, b in zip(node, bounds, strict=True)]
    subject = system({"n": ["g", "h"]}, requirements=[asked], hazards=[danger])
    texts = dict(every_text(make_case(subject, [*node, own], [*records, evidence(own, method="compose")])))
    page, data = texts["index.html"].replace("\u00a0", " "), texts["report.json"].encode()
    assert recounted(page, data) == []
    assert page.count("bound 20 %") == 2
    for wrong in ("bound 20 %</td>", "n.h, tested, bound 20 %"):
        other = wrong.replace("20 %", "15 %").replace("n.h", "n.g")
        assert page.count(wrong) == 1
        assert recounted(page.replace(wrong, other), data) != [], wrong


def test_report_check_recounts(tmp_path: Path) -> None:
    found: Case = CASES["rover"]()
    render_all(found, tmp_path)
    page = tmp_path / "index.html"
    ledger = Ledger(tmp_path / "none.jsonl")
    assert not any("the evidence gives" in line for line in check(tmp_path, ledger))
    page.write_text(re.sub(r"(\d+) of (\d+) gates", "99 of 99 gates", page.read_text()))
    assert any(
        "index.html: head: “policy: 99 of 99 gates pass”: the evidence gives" in x for x in check(tmp_path, ledger)
    )


@pytest.mark.skipif(not REPORTS, reason="no system has been verified here: `doit verify`")
def test_the_words_that_the_docs_explain_stand_on_the_page() -> None:
    """Each phrase in italics under "The first screen", with any numbers."""
    docs = (Path(__file__).parents[2] / "docs/reading-a-report.md").read_text("utf-8")
    told = docs.partition("## The first screen")[2].partition("## Behind")[0]
    phrases = {" ".join(found.split()) for found in re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", told)}
    pages = " ".join((folder / name).read_text("utf-8") for folder in REPORTS for name in FIRST)
    shown = " ".join(re.sub(r"<[^>]*>", " ", pages).split()).casefold()
    phrases -= set(map(str, Object))  # a report has those that it needs, explained (`first_screen.words`)
    plain = {phrase: re.sub(r"\d(?:\\?\.\d|\d)*", r"[\\d.]+", re.escape(phrase.casefold())) for phrase in phrases}
    assert {phrase for phrase, pattern in plain.items() if not re.search(pattern, shown)} == set()


FIRST = ("index.html", "argument.html")


def test_it_is_a_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 2
    assert "cannot be read" in capsys.readouterr().err
    render_all(CASES["rover"](), tmp_path)
    assert main([str(tmp_path)]) == 0
    page = tmp_path / "index.html"
    page.write_text(page.read_text().replace("policy: ", "policy: 1"))
    assert main([str(tmp_path)]) == 1
    assert "the evidence gives" in capsys.readouterr().out


def test_a_revision_of_digits_alone_is_borne_out() -> None:
    case = CASES["rate"]()
    texts = dict(every_text(replace(case, run=replace(case.run, revision="658064233809"), ledger_head="123456789012")))
    page, data = texts["index.html"], texts["report.json"].encode()
    assert "git HEAD <code>658064233809</code>" in page
    assert recounted(page, data) == []
    assert recounted(page.replace("658064233809", "658064233808"), data)
