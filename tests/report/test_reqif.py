"""The ReqIF export against OMG's schema, through an independent reader, and path by path against the CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path

import pytest
import xmlschema
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, rover_case, system
from helpers import every_text
from reqif import PATH_TO_REQIF_ROOT
from reqif.parser import ReqIFParser
from reqif.reqif_bundle import ReqIFBundle

from avow.assurance.model import Case
from avow.report.reqif import KINDS, identifier
from avow.report.wording import clean
from avow.system.plan import Hazard, Requirement
from report.hostile import hostile_case


def mitigated() -> Case:
    g = guarantee("n", "low")
    asked = Requirement("R", "It keeps low", None, None, ("n.low",), source="SRS 1")
    hazards = (
        Hazard("H1", "It burns", "critical", "remote", mitigated_by=("R", "n.low")),
        Hazard("H2", "It drifts", "marginal"),
    )
    plans = [node_plan("n", "high", "hoare")]
    subject = system({"n": ["low"]}, plans=plans, requirements=[asked], hazards=hazards)
    return make_case(subject, [g], [evidence(g, outputs={"artifacts/log.txt": "a" * 64})])


CASES: dict[str, Callable[[], Case]] = {
    "rover": rover_case,
    "hostile": hostile_case,
    "empty": lambda: make_case(system({}), [], []),
    "hazards": mitigated,
}


@pytest.fixture(params=list(CASES))
def exported(request: pytest.FixtureRequest) -> tuple[Case, dict[str, str]]:
    made = CASES[request.param]()
    return made, {name: str(text) for name, text in every_text(made) if name.startswith("traceability.")}


@pytest.fixture(scope="module")
def schema() -> xmlschema.XMLSchema:
    folder = Path(PATH_TO_REQIF_ROOT) / "reqif/reqif_schema"
    return xmlschema.XMLSchema(str(folder / "reqif.xsd"), base_url=str(folder))


def test_the_schema_accepts_it(exported: tuple[Case, dict[str, str]], schema: xmlschema.XMLSchema) -> None:
    schema.validate(exported[1]["traceability.reqif"])


def test_the_schema_rejects_seeded_faults(schema: xmlschema.XMLSchema) -> None:
    text = str(dict(every_text(mitigated()))["traceability.reqif"])
    for old, new in (
        ("<REQ-IF-VERSION>1.0", "<REQ-IF-VERSION>9.9"),
        (' LAST-CHANGE="', ' CHANGED="'),
        (f'IDENTIFIER="{identifier("Requirement", "R")}"', f'IDENTIFIER="{identifier("Claim", "no/such")} x"'),
    ):
        assert old in text
        assert not schema.is_valid(text.replace(old, new, 1))


def values(bundle: ReqIFBundle) -> dict[str, tuple[str, dict[str, str]]]:
    """Identifier → kind and attributes, by their long names."""
    content = bundle.core_content.req_if_content
    kinds = {kind.identifier: kind for kind in content.spec_types if hasattr(kind, "attribute_definitions")}
    names = {a.identifier: a.long_name for k in kinds.values() for a in k.attribute_definitions or ()}
    return {
        thing.identifier: (
            kinds[thing.spec_object_type].long_name,
            {names[a.definition_ref]: a.value for a in thing.attributes},
        )
        for thing in content.spec_objects
    }


def test_it_has_the_paths_of_the_csv_and_no_others(exported: tuple[Case, dict[str, str]]) -> None:
    case, made = exported
    bundle = ReqIFParser.parse_from_string(made["traceability.reqif"])
    objects = values(bundle)
    assert all(set(told) <= {"ReqIF.ForeignID", *KINDS[kind]} for kind, told in objects.values())
    relations = bundle.core_content.req_if_content.spec_relations or []
    links = {(objects[r.source][1]["ReqIF.ForeignID"], objects[r.target][1]["ReqIF.ForeignID"]) for r in relations}
    rows = list(csv.DictReader(io.StringIO(made["traceability.csv"], newline="")))

    def cell(text: str) -> str:
        return clean(text.removeprefix("'"))

    wanted = {(cell(r["requirement"]), cell(r["obligation"])) for r in rows if r["requirement"] and r["obligation"]}
    wanted |= {(cell(r["obligation"]), r["evidence"]) for r in rows if r["obligation"] and r["evidence"]}
    wanted |= {
        (view.hazard.id, name)
        for view in case.hazards
        for m in view.mitigations
        for name in (m.name, *m.claims)
        if name in {told["ReqIF.ForeignID"] for _, told in objects.values()}
    }
    assert links == wanted
    told = {(kind, values["ReqIF.ForeignID"]): values for kind, values in objects.values()}
    for row in rows:
        if row["obligation"] and row["obligation status"]:
            assert told["Claim", cell(row["obligation"])]["Status"] == row["obligation status"]
        if row["evidence"]:
            assert told["Evidence", row["evidence"]]["Verdict"] == row["verdict"]
            assert told["Evidence", row["evidence"]].get("SHA-256", "") == row["SHA-256"]
        if row["requirement"]:
            assert told["Requirement", cell(row["requirement"])]["Status"] == row["requirement status"]
    for view in case.hazards:
        assert told["Hazard", view.hazard.id]["Status"] == view.level


def test_an_identifier_stays_when_only_the_state_changes() -> None:
    first, second = (
        values(ReqIFParser.parse_from_string(str(dict(every_text(c))["traceability.reqif"])))
        for c in (
            mitigated(),
            make_case(
                system({"n": ["low"]}, requirements=[Requirement("R", "It is low", None, None, ("n.low",))]),
                [guarantee("n", "low")],
                [],
            ),
        )
    )
    shared = {name for name in first if name in second}
    assert {first[name][0] for name in shared} == {"Requirement", "Claim"}
    assert all(first[name] != second[name] for name in shared)
