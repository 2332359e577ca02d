"""What an answer of the calculus rests on, as hypotheses that the case discharges: obligations, by what they say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.verdict import Hypothesis, HypothesisKind
from avow.calculus.composition import Composition, argument
from avow.calculus.questions import Answer
from avow.calculus.variables import OBSERVED
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.formulas.formula import node_digest
from avow.kernel.certificate import How
from avow.kernel.check import Needed
from avow.kernel.statements import Claimed


@dataclass(frozen=True, slots=True)
class Resting:
    """`obligations`: the composition's, by name."""

    composition: Composition
    obligations: Mapping[str, Obligation]

    def behind(self, answer: Answer, goal: str | None) -> tuple[Hypothesis, ...]:
        """What an answer about a side condition of a derivation rests on, or about a requirement (`goal` None)."""
        found: dict[Hypothesis, None] = {}
        if answer.everything:
            found |= dict.fromkeys(self.everything())
        if answer.established is not None:
            for need in answer.established.hypotheses:
                if goal is None or need.kind in (How.ENVIRONMENT, How.TOGETHER):
                    found |= dict.fromkeys(self.needed(need, goal))
            if goal is None:
                shown = (self.named(Claimed.ASSUMPTION, mark, node) for node, mark in answer.established.shown if node)
                found |= dict.fromkeys(self.discharging(*name.split(".")) for name in shown)
        return tuple(found)

    def everything(self) -> Iterator[Hypothesis]:
        """Every guarantee, what discharges every assumption, and what makes their values belong together."""
        frame = self.composition.frame
        for node in frame.system.contract.nodes:
            yield from (h for clause in node.guarantees for h in self.guarantee(node.name, clause.name))
            yield from (self.discharging(node.name, clause.name) for clause in node.assumptions)
        yield from (self.composed(f"environment.{assumed.port}") for assumed in frame.assumed)
        yield from self.together(frame.graph.nodes, None, optional=True)

    def needed(self, need: Needed, goal: str | None) -> Iterable[Hypothesis]:
        match need.kind:
            case How.GUARANTEE:
                name = self.named(Claimed.GUARANTEE, need.digest, need.node)
                return self.guarantee(*name.split("."))
            case How.ENVIRONMENT:
                assumed = self.composition.certificates.known.find(need.digest, Claimed.ENVIRONMENT, need.node)
                if assumed is not None:
                    return (self.composed(f"environment.{assumed.name}"),)
                name = self.named(Claimed.ASSUMPTION, need.digest, need.node)
                return (self.discharging(*name.split(".")),)
            case How.TOGETHER:
                return self.together(need.conds, goal)
            case How.OPEN | How.SHOWN | How.POSSIBLE | How.DEFINED:
                return ()

    def named(self, kind: Claimed, digest: str, node: str) -> str:
        found = self.composition.certificates.known.find(digest, kind, node)
        assert found is not None, "the kernel has looked it up"
        return f"{found.node}.{found.name}"

    def guarantee(self, node: str, clause: str) -> tuple[Hypothesis, ...]:
        """What has to be shown of it: nothing of what stands for a topic's wiring, as of any link."""
        owner = self.composition.frame.system.contract.node(node)
        if owner.relay:
            return ()
        mark = node_digest(owner, owner.clause(clause))
        return (Hypothesis(HypothesisKind.CLAIM, f"{node}/{Kind.GUARANTEE}/{clause}", mark),)

    def discharging(self, node: str, clause: str) -> Hypothesis:
        """The obligation that settles an assumption of a node."""
        shown = self.composition.where(node, clause)
        if shown is not None:
            goal, about = shown
            return self.composed(f"{goal.name}.{about}")
        return self.composed(f"environment.{node}.{clause}")

    def composed(self, name: str) -> Hypothesis:
        """A composition obligation; where there is none of that name, a person has to accept what it would say."""
        obligation = self.obligations.get(name)
        if obligation is not None:
            return Hypothesis(HypothesisKind.CLAIM, obligation.local_id, obligation.digest)
        return Hypothesis(
            HypothesisKind.SUPPOSITION, f"{SYSTEM_LEVEL}/supposition/{name}", sha256(name), f"nothing settles {name}"
        )

    def together(self, nodes: Iterable[str], goal: str | None, *, optional: bool = False) -> tuple[Hypothesis, ...]:
        """Persistence and one output for each input, of a derivation over these nodes: the one in question, one for
        which the plan gives reasons, or any."""
        wanted, composition = frozenset(nodes), self.composition
        if any(name.startswith(OBSERVED) for name in wanted):
            wanted = frozenset(composition.frame.graph.nodes)
        covering = [
            g
            for g in composition.goals
            if f"{g.name}.persistence" in self.obligations and wanted <= set(composition.leaves(g, g.nodes))
        ]

        def rank(name: str) -> tuple[bool, bool]:
            return name != goal, not all(argument(composition, name, key) for key in ("persistence", "one_output"))

        chosen = min((g.name for g in covering), key=rank, default=None)
        if chosen is not None:
            return tuple(self.composed(f"{chosen}.{part}") for part in ("persistence", "one-output"))
        return () if optional else (self.composed(f"together({','.join(sorted(wanted))})"),)


def discharged_by(composition: Composition, obligations: Iterable[Obligation]) -> dict[str, tuple[Hypothesis, ...]]:
    """For each node what discharges its assumptions: who relies on one of its guarantees relies on these."""
    resting = Resting(composition, {o.name: o for o in obligations})
    return {
        node.name: tuple(dict.fromkeys(resting.discharging(node.name, clause.name) for clause in node.assumptions))
        for node in composition.frame.system.contract.nodes
    }
