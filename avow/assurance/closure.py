"""Everything that a requirement rests on, closed under what its parts rest on.

A guarantee adds the claims that discharge its node's assumptions; a side condition adds those that its proof used; two
nodes or more add that values persist and that each input gives at most one output. So a requirement in prose never
looks stronger than one that is derived through the same nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from avow.assurance.model import NodeView, ObligationView
from avow.assurance.naming import requirement_claim
from avow.assurance.relied import Relied, differs
from avow.base.records import dataclass
from avow.evidence.claims import Standing
from avow.evidence.obligation import Kind

_TOGETHER = (".persistence", ".one-output")


@dataclass(frozen=True, slots=True)
class Closed:
    """`claims` are obligations' ids, sorted, and `accepted` the assumptions that persons accept; `failing` those of
    both that do not hold; `assumptions` those of nodes (``node.clause``) that nothing in the case discharges."""

    claims: tuple[str, ...]
    accepted: tuple[str, ...]
    failing: tuple[str, ...]
    assumptions: tuple[str, ...]


class Closure:
    """The dependencies between claims, including those that claims do not list themselves."""

    def __init__(
        self,
        views: Sequence[ObligationView],
        nodes: Sequence[NodeView],
        rests: Mapping[str, tuple[str, ...]],
        standings: Mapping[str, Standing],
        relied: Mapping[str, Relied],
    ) -> None:
        self.relied = relied
        self.programs = [view for view in views if view.obligation.kind is Kind.PROGRAM]
        self.standings = standings
        self.views = {view.id: view for view in views}
        self.rests = rests
        self.local = {view.obligation.local_id: view.id for view in views}
        self.assumptions = {node.name: tuple(name for name, _ in node.assumptions) for node in nodes}
        self.composition = [view for view in views if view.obligation.kind is Kind.COMPOSITION]
        self.joint: dict[str, list[str]] = {}
        for view in self.composition:
            if view.obligation.name.startswith("joint."):
                self.joint.setdefault(view.obligation.name.removeprefix("joint."), []).append(view.id)
        self.known = {f"{view.obligation.node}.{view.obligation.name}": view.id for view in views if _guarantees(view)}
        self.by: dict[str, tuple[str, ...]] = {}
        self.below: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {}

    def of_requirement(self, name: str) -> Closed:
        return self.of([requirement_claim(name)])

    def of(self, claims: Iterable[str]) -> Closed:
        """The closure of some claims (obligations, requirements, derivations)."""
        found, open_assumptions = self._walk(claims)
        nodes = {
            self.views[name].obligation.node for name in found if name in self.views and _guarantees(self.views[name])
        }
        if len(nodes) > 1:
            found, more = self._walk((*found, *self._together()))
            open_assumptions |= more
        claims_of = tuple(sorted(name for name in found if name in self.views))
        accepted = tuple(sorted(name for name in found if name.startswith("assumption:")))
        failing = tuple(
            name
            for name in (*claims_of, *accepted)
            if name in self.standings
            and not self.standings[name].status.supports
            and not (name in self.views and self.views[name].advice)
        )
        return Closed(claims_of, accepted, failing, tuple(sorted(open_assumptions)))

    def _walk(self, claims: Iterable[str]) -> tuple[set[str], set[str]]:
        seen, lost, todo = set[str](), set[str](), list(claims)
        while todo:
            name = todo.pop()
            if name in seen:
                continue
            seen.add(name)
            todo += self.rests.get(name, ())
            if name in self.views:
                if name not in self.below:
                    self.below[name] = self._further(self.views[name])
                further, assumptions = self.below[name]
                todo += further
                lost |= set(assumptions)
        return seen, lost

    def _further(self, view: ObligationView) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The claims that a claim rests on beyond those it lists, and the assumptions that nothing discharges."""
        if _guarantees(view):
            node, about = view.obligation.node, f"{view.obligation.node}.{view.obligation.name}"
            assumed = [f"{node}.{clause}" for clause in self.assumptions.get(node, ())]
            return self._discharged(assumed, [*self.joint.get(about, ()), *self._differing(view)])
        if view.obligation.kind in (Kind.COMPOSITION, Kind.REQUIREMENT):
            labels = [label for r in view.records for label in used(r.details)]
            found = [self.known[label] for label in labels if label in self.known]
            found += [name for label in labels if (name := self._environment(label)) is not None]
            assumed = [label for label in labels if label not in self.known and self._is_assumption(label)]
            return self._discharged(assumed, found)
        return (), ()

    def _differing(self, view: ObligationView) -> Iterator[str]:
        """The refuted claim by which a node's program differs from the model that a guarantee rests on."""
        relied = self.relied.get(view.id)
        claim = differs(self.programs, view.obligation, relied.record) if relied else None
        if claim is not None:
            yield claim.id

    def _discharged(self, assumptions: Sequence[str], found: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        lost = []
        for about in assumptions:
            if about not in self.by:
                self.by[about] = self._by(about)
            by = self.by[about]
            found += by
            if not by:
                lost.append(about)
        return tuple(dict.fromkeys(found)), tuple(lost)

    def _by(self, about: str) -> tuple[str, ...]:
        """The claims that discharge an assumption: in the whole system, if there are any; else one way that holds, or
        all that were tried."""
        whole = self.local.get(f"system/{Kind.COMPOSITION}/whole.{about}")
        outside = self.local.get(f"system/{Kind.COMPOSITION}/environment.{about}")
        loops = [v.id for v in self.composition if ".loop." in v.obligation.name and about in v.obligation.clauses]
        if whole is not None or outside is not None:
            return (*(name for name in (whole, outside) if name is not None), *loops)
        ways = [
            v
            for v in self.composition
            if v.obligation.clauses[:1] == (about,) and v.obligation.name.endswith(f".{about}")
        ]
        good = [view for view in ways if view.standing.supports]
        return tuple(view.id for view in (good[:1] or ways))

    def _environment(self, label: str) -> str | None:
        if not label.startswith("environment "):
            return None
        port = label.removeprefix("environment ").split(" ")[0]
        return self.local.get(f"system/{Kind.COMPOSITION}/environment.{port}")

    def _is_assumption(self, label: str) -> bool:
        node, _, clause = label.partition(".")
        return clause in self.assumptions.get(node, ())

    def _together(self) -> Iterator[str]:
        """The conditions under which values of several nodes belong to one step: the whole system's, if it has any,
        else all."""
        spoken = [view for view in self.composition if view.obligation.name.endswith(_TOGETHER)]
        whole = [view for view in spoken if view.obligation.name.startswith("whole.")]
        yield from (view.id for view in whole or spoken)
        yield from (view.id for view in self.composition if view.obligation.name.startswith("start."))


def _guarantees(view: ObligationView) -> bool:
    return view.obligation.kind is Kind.GUARANTEE


def used(details: Mapping[str, object]) -> Iterator[str]:
    """Labels of the hypotheses that a proof used, without the step that they are about."""
    listed = details.get("needed", details.get("initial"))
    for label in listed if isinstance(listed, list) else ():
        yield str(label).removesuffix(" one step before")
