"""The argument in GSN modules: one for each requirement, one for each node, nothing twice.

A requirement's module points at nodes by *away goals*; a node's module holds its guarantees with their evidence.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from avow.assurance.answers import MEANINGS, Level
from avow.assurance.model import Case, NodeView, ObligationView, RequirementView
from avow.assurance.naming import derivation_claim
from avow.base.plain import count, listed
from avow.base.records import dataclass
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.report.wording import tally


@dataclass(frozen=True, slots=True)
class RequirementModule:
    requirement: RequirementView
    because: str
    """The reason for its level, as a sentence."""
    strategy: str
    away: tuple[tuple[str, str, str], ...]
    """(node, its name for readers, the number of its guarantees that count here, each or its counts by status)."""
    conditions: str
    """How the conditions of the composition stand that are needed here; empty if there are none."""
    supposes: tuple[str, ...]
    """Numbers of assumptions."""
    failing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NodeModule:
    node: NodeView
    guarantees: tuple[ObligationView, ...]


def requirement_modules(case: Case) -> tuple[RequirementModule, ...]:
    views = {view.id: view for view in case.obligations}
    numbers = {s.key: s.number for s in case.assumptions}
    total = Counter(view.obligation.node for view in case.guarantees)
    found = []
    for r in case.requirements:
        under = [views[name] for name in r.closure if name in views]
        away = []
        for node in case.nodes:
            own = [v for v in under if v.obligation.kind is Kind.GUARANTEE and v.obligation.node == node.name]
            if own:
                of = f"{len(own)} of {count(total[node.name], 'guarantee')}"
                away.append((node.name, node.title, f"{of}: {_standings(own)}"))
        side = [v for v in under if v.obligation.kind is Kind.COMPOSITION]
        stand = ", ".join(f"{many} {said}" for said, many in tally(side).items())
        conditions = f"{count(len(side), 'condition')}: {stand}" if side else ""
        supposes = tuple(numbers[key] for key in r.supposes if key in numbers)
        failing = r.failing or r.below
        because = _because(case, r) + (f" F{r.rate.words[1:]}." if r.rate and r.level.holds else "")
        strategy = _strategy(case, r, len(away))
        found.append(RequirementModule(r, because, strategy, tuple(away), conditions, supposes, failing))
    return tuple(found)


def node_modules(case: Case) -> tuple[NodeModule, ...]:
    guarantees: dict[str, list[ObligationView]] = {}
    for view in case.guarantees:
        guarantees.setdefault(view.obligation.node, []).append(view)
    return tuple(NodeModule(node, tuple(guarantees.get(node.name, ()))) for node in case.nodes)


def _standings(views: Sequence[ObligationView]) -> str:
    if len(views) <= 3:
        return ", ".join(f"{view.obligation.name} {view.standing}" for view in views)
    return ", ".join(f"{many} {said}" for said, many in tally(views).items())


def conditions(case: Case) -> list[tuple[ObligationView, list[str]]]:
    """The conditions of the composition, each with the requirements that rest on it."""
    needing: dict[str, list[str]] = {}
    for r in case.requirements:
        for name in r.closure:
            needing.setdefault(name, []).append(r.id)
    composition = (view for view in case.obligations if view.obligation.kind is Kind.COMPOSITION)
    return [(view, needing[view.id]) for view in composition if view.id in needing]


def _because(case: Case, r: RequirementView) -> str:
    match r.level:
        case Level.ARGUED if not r.formal:
            said = next((s.because for s in case.statements if s.place == f"requirements.{r.id}.validation"), "")
            reason = f" The reason given: {said.rstrip('.')}." if said else ""
            told = "Argued: a person says that the guarantees below amount to the sentence. No tool has looked at that."
            return told + reason
        case Level.NOT_SHOWN:
            late = [s for s in case.assumptions if s.expired and r.id in s.needed_by]
            if late:
                return f"Not shown: an assumption has expired ({', '.join(s.number for s in late)})."
            if r.awaits_validation:
                return "Not shown: the formula holds, but nobody has read the sentence against it (`avow validate`)."
            return "Not shown: see what fails below."
        case Level.REFUTED:
            return "Refuted: the contracts allow a counterexample."
        case _:  # every other level is derived, or sampled by a search
            every = not r.supported_by and {view.id for view in case.guarantees} <= set(r.rests_on)
            named = " The plan names no guarantee below it: it counts as resting on all of them." if every else ""
            tested = any(case.obligation(name).status is Status.TESTED for name in r.obligations)
            how = "Nothing refutes it" if tested else "A tool derived it"
            how += f": {r.searched}" if r.searched else ""
            return f"{str(r.level).capitalize()}: {MEANINGS[r.level]}. {how}.{named}"


def _strategy(case: Case, r: RequirementView, nodes: int) -> str:
    """The strategy in the words of the calculus, with the derivations that it uses."""
    over = count(nodes, "node contract")
    if not r.formal:
        return f"A person's judgement over {over}"
    used = [d.derivation for d in case.derivations if derivation_claim(d.derivation.name) in r.rests_on]
    rules = listed([f"rule {d.rule} ({d.name})" for d in used], 4)
    how = "model checking of the composition" if r.temporal else "entailment by the composed contracts"
    return f"{rules}, then {how} of {over}" if rules else f"{how[:1].upper()}{how[1:]} of {over}"
