"""The argument as a goal structure: the source of the GSN and SACM exports.

The elements and relations are those of the GSN Community Standard, version 3. A requirement, a node and each general
question (validation, models, contracts, tools, hazards) is a module; a goal of another module is an away goal. Each
solution has an assurance claim point: why the evidence may be believed, and what would defeat it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum
from typing import Any

from avow.assurance.certification import ProofGrade
from avow.assurance.model import Case, EvidenceView, ObligationView
from avow.assurance.naming import is_foundation
from avow.assurance.relied import agrees, upper_bound
from avow.base.packaged import packaged
from avow.base.plain import count, listed
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.verdict import Link, Object
from avow.evidence.obligation import Kind, ProgramClaim
from avow.evidence.record import Evidence
from avow.evidence.status import Status, weigh
from avow.report import wording
from avow.report.modules import RequirementModule, node_modules, requirement_modules
from avow.report.qualification import DATA, independence

_CERTIFIED = (ProofGrade.CERTIFIED_1, ProofGrade.CERTIFIED_2)


class Sort(StrEnum):
    """GSN's elements, by the letters of their names."""

    GOAL = "G"
    STRATEGY = "S"
    SOLUTION = "Sn"
    CONTEXT = "C"
    ASSUMPTION = "A"
    JUSTIFICATION = "J"


@dataclass(frozen=True, slots=True)
class Defeater:
    """A doubt that would make evidence worthless, and how it was answered; an empty answer: it was not."""

    text: str
    answer: str


@dataclass(frozen=True, slots=True)
class Artifact:
    """The record behind a solution."""

    record: str
    """The hash of its entry in the ledger."""
    date: str
    tool: str
    command: str
    """The command that re-runs it."""
    files: tuple[tuple[str, str], ...]
    """(path, SHA-256) of the files that the tool wrote."""


@dataclass(frozen=True, slots=True)
class Element:
    """One element of the argument."""

    name: str
    """Unique in all modules: ``G1``, ``Sn12``."""
    sort: Sort
    text: str
    """A proposition for a goal; else a description of the element."""
    supported_by: tuple[str, ...] = ()
    in_context_of: tuple[str, ...] = ()
    undeveloped: bool = False
    defeated: bool = False
    """For a goal: a counterexample is known. For a solution: it is a counterexample."""
    unsupported: bool = False
    """For a goal: the elements below do not show it."""
    label: str = ""
    """Its name elsewhere and its status: ``REQ1 [shown]``."""
    believed: str = ""
    """For a solution, the assurance claim point: why the evidence may be believed."""
    defeaters: tuple[Defeater, ...] = ()
    artifact: Artifact | None = None

    def text_of_defeaters(self) -> tuple[str, ...]:
        """A line for each defeater: the doubt, and its answer."""
        return tuple(f"defeater: {d.text}: {d.answer or 'open'}" for d in self.defeaters)


@dataclass(frozen=True, slots=True)
class Module:
    name: str
    brief: str
    elements: tuple[Element, ...] = field(default=())


@by_identity(1)
def argument(case: Case) -> tuple[Module, ...]:
    """The whole argument: the system's module first, then requirements, nodes and general questions."""
    return tuple(_Argument(case).modules())


class _Argument:
    def __init__(self, case: Case) -> None:
        self.case = case
        self.last = dict.fromkeys(Sort, 0)
        self.requirement_modules = requirement_modules(case)
        self.views = {view.id: view for view in case.obligations}
        self.grades = {proof.obligation: proof.grade for proof in case.proofs}
        programs = [view for view in case.obligations if view.obligation.kind is Kind.PROGRAM]
        self.links = [view for view in programs if view.obligation.name == ProgramClaim.LINKED]
        self.top = self.new(Sort.GOAL)
        self.requirements = {r.id: self.new(Sort.GOAL) for r in case.requirements}
        self.nodes = {node.name: self.new(Sort.GOAL) for node in case.nodes}
        shared = (v for v in case.obligations if v.obligation.kind in (Kind.GUARANTEE, Kind.COMPOSITION))
        self.goals = {view.id: self.new(Sort.GOAL) for view in shared}

    def new(self, sort: Sort) -> str:
        self.last[sort] += 1
        return f"{sort}{self.last[sort]}"

    def made(self, sort: Sort, text: str, below: tuple[str, ...] = (), **more: Any) -> Element:
        """An element with a name of its own."""
        return Element(self.new(sort), sort, text, below, **more)

    def modules(self) -> Iterator[Module]:
        asked = (self.validation(), self.composition(), self.models(), self.contracts(), self.tools())
        general = [module for module in asked if module]
        hazards = self.hazards()
        yield self.whole([*general, *([hazards] if hazards else [])])
        yield from map(self.requirement, self.requirement_modules)
        for node in node_modules(self.case):
            yield self.node(node.node.name, node.node.title, node.guarantees)
        yield from general
        if hazards:
            yield hazards

    def whole(self, others: Sequence[Module]) -> Module:
        case = self.case
        context = self.made(Sort.CONTEXT, f"Policy {case.policy.name}: {case.policy.title}")
        assumptions = [
            Element(a.number, Sort.ASSUMPTION, a.words, label=f"{a.number} ({a.sort})") for a in case.assumptions
        ]
        strategies = []
        if self.requirements:
            text, below = "Argument over each requirement", tuple(self.requirements.values())
            strategies.append(self.made(Sort.STRATEGY, text, below))
        if others:
            text, below = "Argument over what the evidence takes for granted", tuple(m.elements[0].name for m in others)
            strategies.append(self.made(Sort.STRATEGY, text, below))
        given = f", given assumptions A1 to A{len(assumptions)}" if assumptions else ""
        met, of_all = sum(r.level.holds for r in case.requirements), count(len(self.requirements), "requirement")
        proposition = f"{case.title} meets {of_all}{given}"
        if not case.answers.headline.holds:
            proposition = f"{case.title} is shown to meet {met} of {of_all}{given} ({case.answers.told})"
        top = Element(
            self.top,
            Sort.GOAL,
            proposition if self.requirements else f"The contracts of {case.title} hold",
            tuple(s.name for s in strategies),
            (context.name,),
            not strategies,
            label=case.answers.told,
            unsupported=not case.answers.headline.holds,
        )
        return Module(f"system-{case.system}", case.title, (top, context, *strategies, *assumptions))

    def requirement(self, module: RequirementModule) -> Module:
        r = module.requirement
        context = []
        if r.formal:
            context.append(self.made(Sort.CONTEXT, r.formal, label="Formula"))
        if r.source:
            context.append(self.made(Sort.CONTEXT, r.source, label="Source"))
        solutions = [s for name in r.obligations if name in self.views for s in self.solutions(self.views[name])]
        below = tuple(self.goals[name] for name in r.closure if name in self.goals)
        strategy = self.made(Sort.STRATEGY, module.strategy, below)
        supported = (*([strategy.name] if below else []), *(s.name for s in solutions))
        goal = Element(
            self.requirements[r.id],
            Sort.GOAL,
            r.words,
            supported,
            (*module.supposes, *(c.name for c in context)),
            not supported,
            r.status is Status.REFUTED,
            not r.level.holds,
            f"{r.id} [{r.stands}]",
        )
        return Module(f"requirement-{r.id}", r.words, (goal, *([strategy] if below else []), *context, *solutions))

    def node(self, name: str, title: str, guarantees: Sequence[ObligationView]) -> Module:
        goals, solutions = self.claims(guarantees)
        below = tuple(goal.name for goal in goals)
        text, lacking = f"{title} keeps each of its guarantees", any(goal.unsupported for goal in goals)
        root = Element(self.nodes[name], Sort.GOAL, text, below, undeveloped=not below, unsupported=lacking)
        return Module(f"node-{name}", title, (root, *goals, *solutions))

    # -- general questions ---------------------------------------------------------------------------------------------

    def validation(self) -> Module | None:
        """Whether formulas mean what their sentences say: a person's statement for each requirement."""
        if not self.requirements:
            return None
        solutions = []
        for r in self.case.requirements:
            if r.validated and r.validation is not None:
                said = f"{r.id}: {r.validation.who} read the sentence against its formula or support"
                digest = r.validation.formula or r.validation.sentence
                artifact = Artifact(digest, r.validation.date, r.validation.who, "", ())
                open_doubt = Defeater("the reader misread the sentence", "")
                solutions.append(
                    self.made(
                        Sort.SOLUTION,
                        said,
                        label=r.validation.date,
                        believed="digests bind the word to the texts as they were read",
                        defeaters=(open_doubt,),
                        artifact=artifact,
                    )
                )
        whole = len(solutions) == len(self.case.requirements)
        text = "Each requirement's formula or support says what its sentence asks for"
        return self.general("validation", text, solutions, whole)

    def models(self) -> Module | None:
        """Whether the models that were verified behave like the programs that run."""
        of_models = {v.obligation.node for v in self.case.guarantees if any(r.of is Object.MODEL for r in v.records)}
        if not of_models:
            return None
        linked = [v for v in self.links if v.obligation.node in of_models]
        goals, solutions = self.claims(linked)
        for node in sorted(of_models - {v.obligation.node for v in linked}):
            text = f"The model of {node} that was verified behaves as its program"
            label = f"{node} [{Status.MISSING}]"
            goals.append(self.made(Sort.GOAL, text, undeveloped=True, unsupported=True, label=label))
        whole = all(self.linked(v, r) for v in self.case.guarantees for r in v.records if r.of is Object.MODEL)
        text = "Each model that was verified behaves as the program that runs"
        return self.general("model-fidelity", text, [*goals, *solutions], whole, goals)

    def composition(self) -> Module | None:
        """Whether the contracts fit together: the conditions that requirements share."""
        views = [v for v in self.case.obligations if v.obligation.kind is Kind.COMPOSITION]
        goals, solutions = self.claims(views)
        good = all(v.standing.supports for v in views)
        text = "The nodes' contracts fit together: each condition of the composition holds"
        return self.general("composition", text, [*goals, *solutions], good, goals) if views else None

    def contracts(self) -> Module | None:
        """Whether contracts are worth verifying: consistent, realizable, not vacuous."""
        sanity = [v for v in self.case.obligations if is_foundation(v.obligation)]
        if not sanity:
            return None
        goals, solutions = self.claims(sanity)
        good = all(v.standing.supports for v in sanity)
        text = "Each contract can be kept: it is consistent and realizable, and its assumptions can be met"
        return self.general("contracts", text, [*goals, *solutions], good, goals)

    def tools(self) -> Module:
        """Whether the tools answer correctly: the mitigation for each part that has to be trusted."""
        solutions = [
            self.made(
                Sort.SOLUTION,
                f"{line.what} ({line.which}): {line.mitigation}",
                believed="it belongs to what has to be trusted",
                defeaters=(Defeater(f"an error in {line.what} goes unseen", "" if line.partly else line.mitigation),),
            )
            for line in self.case.answers.trusted
        ]
        text = "The tools and the trusted base answer rightly"
        return self.general("tools", text, solutions, False)

    def hazards(self) -> Module | None:
        if not self.case.hazards:
            return None
        goals, others = [], list[Element]()
        for view in self.case.hazards:
            below = []
            for m in view.mitigations:
                below.append(self.mitigation(m.name, m.claims) or self.new(Sort.GOAL))
                if not self.mitigation(m.name, m.claims):  # a mitigation by the dataflow graph alone
                    label = f"{m.name} [{m.level}]"
                    others.append(Element(below[-1], Sort.GOAL, m.words, undeveloped=True, label=label))
            hazard = view.hazard
            goals.append(
                self.made(
                    Sort.GOAL,
                    f"The hazard “{hazard.text}” is mitigated",
                    tuple(dict.fromkeys(below)),
                    undeveloped=not below,
                    unsupported=not view.level.holds,
                    label=f"{hazard.id} [{view.level}; {hazard.severity}]",
                )
            )
        good = all(view.level.holds for view in self.case.hazards)
        return self.general("hazards", "Each hazard that was identified is mitigated", [*goals, *others], good, goals)

    def mitigation(self, name: str, claims: Sequence[str]) -> str | None:
        if name in self.requirements:
            return self.requirements[name]
        if name in self.nodes:
            return self.nodes[name]
        return next((self.goals[claim] for claim in claims if claim in self.goals), None)

    def general(
        self, name: str, text: str, elements: Sequence[Element], whole: bool, goals: Sequence[Element] | None = None
    ) -> Module:
        """`whole`: whether everything below the goal is shown. `goals`: the elements directly below it, if not all."""
        below = tuple(element.name for element in (elements if goals is None else goals))
        root = self.made(Sort.GOAL, text, below, undeveloped=not below, unsupported=not whole)
        label = "" if whole else "partly shown" if below else "not shown"
        return Module(name, text, (replace(root, label=label), *elements))

    def claims(self, views: Iterable[ObligationView]) -> tuple[list[Element], list[Element]]:
        """A goal for each claim, and the solutions below them."""
        goals, solutions = list[Element](), list[Element]()
        for view in views:
            found = list(self.solutions(view))
            solutions += found
            of, own = view.obligation, self.goals.get(view.id)
            goals.append(
                Element(
                    own or self.new(Sort.GOAL),
                    Sort.GOAL,
                    of.claim,
                    tuple(s.name for s in found),
                    undeveloped=not found,
                    defeated=view.status.refuted,
                    unsupported=not view.standing.supports,
                    label=f"{'' if own else f'{of.node}: '}{of.name} [{view.standing}]",
                )
            )
        return goals, solutions

    # -- evidence ------------------------------------------------------------------------------------------------------

    def solutions(self, view: ObligationView) -> Iterator[Element]:
        """The evidence that supports or refutes a claim: a record that does neither is left out."""
        for item in view.counting:
            record = item.entry.evidence
            weight = weigh(record)
            if weight.support is None and not weight.refuted:
                continue
            command = wording.rerun(view, record)
            artifact = Artifact(
                item.entry.hash, record.started, record.tool_told, command, tuple(sorted(record.outputs.items()))
            )
            yield self.made(
                Sort.SOLUTION,
                record.summary,
                defeated=weight.refuted,
                label=f"{record.method} [{weight.status.value}]",
                believed=self.believed(view, item),
                defeaters=tuple(self.defeaters(view, item)),
                artifact=artifact,
            )

    def believed(self, view: ObligationView, item: EvidenceView) -> str:
        record = item.entry.evidence
        made = {
            Link.GENERATED: "what the tool was given was generated from the contract",
            Link.MAPPED: "a person's table says how the contract's words appear in it",
            Link.GUIDED: "a person judges that it is about this claim",
        }[record.link]
        grade = self.grades.get(view.id)
        return f"{made}; its proof is {grade}" if grade else made

    def defeaters(self, view: ObligationView, item: EvidenceView) -> Iterator[Defeater]:
        record = item.entry.evidence
        status, promised = weigh(record).status, view.obligation.kind is Kind.GUARANTEE
        if record.link is not Link.GUIDED:
            again = "the kernel established it again" if self.grades.get(view.id) in _CERTIFIED else ""
            seeded = record.backend in packaged("avow.report", DATA)["seeded"]
            tried = "the backend's conformance tests catch seeded faults" if seeded else again
            yield Defeater("the translation or the reading of the tool's answer is wrong", tried)
        if status is Status.REVIEWED:
            several = len(independence(view).persons) > 1
            yield Defeater("the reviewer overlooked a fault", "several persons reviewed it" if several else "")
        if status is Status.JUSTIFIED:
            yield Defeater("the reason that a person gives does not hold", "")
        if status is Status.CHECKED:
            yield Defeater("what the finite scenario leaves out breaks the claim", "")
        if record.of is Object.RECORDING:
            yield Defeater("the recording does not show the programs of today", "")
        if promised:
            score, told = record.details.get("mutation"), wording.mutation(record)
            whole = isinstance(score, Mapping) and score.get("killed") == score.get("mutants")
            seen = f" ({told})" if told and not whole else ""
            yield Defeater(f"the method would accept a wrong node as well{seen}", told if whole else "")
        if promised and status in (Status.PROVED, Status.CHECKED) and record.of is Object.MODEL:
            yield Defeater("the model differs from the program that runs", self.linked(view, record))
        if status in (Status.TESTED, Status.MONITORED):
            within = f" ({wording.bound_text(record.bound)})" if upper_bound(record) is not None else ""
            yield Defeater(f"a case that was not tried fails{within}", "")
        if status is Status.PROVED:
            twice = self.grades.get(view.id) is ProofGrade.CERTIFIED_2
            yield Defeater("the solver is wrong", "two solvers answered each question" if twice else "")

    def linked(self, view: ObligationView, record: Evidence) -> str:
        found = agrees(self.links, view.obligation, record.method)
        return f"the program agrees with it: {found}" if found is not None and found.supports else ""


def doubts(case: Case) -> list[tuple[str, int, int, str]]:
    """(doubt, how many pieces of evidence it is about, of how many it is open, the answers to the others)."""
    found: dict[str, Counter[str]] = {}
    for doubt in (d for module in argument(case) for element in module.elements for d in element.defeaters):
        found.setdefault(doubt.text.partition(" (")[0], Counter())[doubt.answer] += 1
    return [(text, answers.total(), answers.pop("", 0), listed(list(answers), 3)) for text, answers in found.items()]


def by_name(modules: Iterable[Module]) -> Mapping[str, Element]:
    """Every element of the argument by its name."""
    return {element.name: element for module in modules for element in module.elements}
