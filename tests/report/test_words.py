"""What people read in place of ids, of records' bounds, of commands and of long reasons."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, rover_case, system

from avow.assurance.model import Gate
from avow.assurance.naming import short
from avow.base.verdict import Verdict, said, unsaid
from avow.evidence.status import Status
from avow.report import formats
from avow.report.markdown import render_markdown
from avow.report.page import render_page
from avow.report.wording import bound_text, gate_line, tone, tool_command
from avow.sanity.claims import Property
from avow.system.plan import Requirement


@pytest.mark.parametrize("about", Property)
def test_a_sanity_claim_is_read_as_the_good_thing_that_it_states(about: Property) -> None:
    whole, part = short(f"s/agent/sanity/{about}"), short(f"s/agent/sanity/{about}-inspect_here")
    assert whole.startswith("agent (")
    assert part.startswith("agent.inspect_here (")
    assert "sanity" not in whole + part
    assert f"{about}-" not in part


def test_names_for_people_are_told_apart_and_what_is_unknown_stays() -> None:
    names = [f"s/agent/sanity/{about}{subject}" for about in Property for subject in ("", "-a", "-b")]
    assert len({short(name) for name in names}) == len(names)
    for odd in ("not-vacuousness", "not-vacuous-", "not-vacuous.a", "vacuous-a", "other-a"):
        assert short(f"s/agent/sanity/{odd}") == f"agent/sanity/{odd}"
    assert short("s/system/composition/environment.in.away") == "what is supposed of in.away"
    assert short("s/system/composition/D1.entailed") == "system/composition/D1.entailed"


def test_the_bounds_of_a_state_space_are_words() -> None:
    bound = {"exhaustive": True, "indices": ["i in 0…12"], "properties": 25, "states": 24119, "transitions": 1}
    assert bound_text(bound) == "every state explored, for each i in 0…12, 25 properties, 24 119 states, 1 transition"
    assert bound_text({"exhaustive": False}) == "not every state explored"


def test_a_tools_command_is_printed_with_the_folder_in_which_it_runs() -> None:
    claim = guarantee("agent", "low", "It is low", "out.x < 1")
    record = replace(evidence(claim, Verdict.TESTED, "my tests"), command=("python", "-P", "test_agent.py"))
    assert tool_command(record) == f"(cd 'artifacts/{claim.system}/agent/my tests' && python -P test_agent.py)"
    assert tool_command(replace(record, command=())) == ""


def test_a_gates_reason_is_a_line_and_all_of_it_a_fold() -> None:
    parts = [f"agent.clause_{n}: tested, but proved is asked of everything that moves" for n in range(5)]
    line = gate_line("; ".join(parts))
    assert line.startswith(parts[0])
    assert line.endswith("; and 3 more")
    assert len(line) <= 220
    assert gate_line(parts[0]) == parts[0]
    assert len(gate_line("x" * 900)) == 200
    gate = Gate("guarantees-high", "Guarantees", False, "; ".join(parts))
    case = replace(rover_case(), gates=(gate,))
    assert parts[4].replace("_", "\\_") not in render_markdown(case)
    assert "and 3 more" in render_markdown(case)
    page = render_page(case)
    assert page.count("<summary>all of it</summary>") == 1
    assert page.count(parts[0]) == 2
    assert page.count(parts[4]) == 1


GONE = {"link", "linked", "linking", "justified", "monitored"}
"""Words of the ledger, or of several senses, that people do not read: tie, argued, connection, supposed, observed."""
_TAGS = re.compile(r"<(style|script)\b.*?</\1>|<[^>]*>", re.DOTALL)


def _read(text: str) -> set[str]:
    return set(re.findall(r"[a-z]+", _TAGS.sub(" ", text).lower()))


def test_one_word_for_one_meaning_in_every_format_for_people() -> None:
    record = evidence(guarantee("agent", "g1"), Verdict.MONITORED, "rosmonitoring", summary="it held")
    lasting = evidence(guarantee("agent", "g2", line=12), Verdict.JUSTIFIED, "review", summary="it is so")
    subject = system(
        {"agent": ["g1", "g2"]},
        plans=[node_plan("agent", "low", "rosmonitoring", "review")],
        requirements=[Requirement("R", "It is safe.", None, None, ("agent.g1", "agent.g2"))],
    )
    found = make_case(subject, [guarantee("agent", "g1"), guarantee("agent", "g2", line=12)], [record, lasting])
    made = {name: text for name, text in formats(found) if isinstance(text, str)}
    for name in ("index.html", "claims.html", "traceability.html", "report.md", "report.tex", "gsn.svg", "comment.md"):
        assert _read(made[name]) & GONE == set(), name
    assert {"observed", "supposed"} <= _read(made["claims.html"])
    assert '"monitored"' in made["report.json"]
    assert "monitored" in made["report.sarif"]
    assert GONE & set(map(said, Status)) == set()


def test_only_what_supports_a_claim_has_a_good_colour() -> None:
    assert {s for s in Status if tone(s) in ("good", "fair")} == {s for s in Status if s.supports}


def test_a_plan_may_use_either_word() -> None:
    for status in Status:
        assert unsaid(status.word) == status.value
