"""Derived claims: the status of claims that rest on claims, with hypotheses and the weakest claim below; cycles are
refused.

A claim rests on its own evidence (`own`), on other claims (`rests_on`, all of them needed), or on both. Nothing is kept
between calls: deleting an item of evidence and judging again gives the same result as never having had it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from avow.base.graphs import strong_components
from avow.base.records import dataclass
from avow.base.verdict import Link
from avow.evidence.status import Status, weakest_link


@dataclass(frozen=True, slots=True)
class Claim:
    """`own` is the status from the claim's own evidence; None if it has none of its own by nature (a pure combination
    of others). `prose` marks a claim whose derivation from what it rests on is a person's statement."""

    id: str
    own: Status | None = None
    rests_on: tuple[str, ...] = ()
    hypotheses: tuple[str, ...] = ()
    link: Link | None = None
    prose: bool = False


@dataclass(frozen=True, slots=True)
class Reestablished:
    """An obligation that the kernel established from its certificate. `solvers`: the number of solvers that answered
    each query."""

    obligation: str
    solvers: int
    key: str
    scope: str
    """The scope under which its certificate is kept among those of the run."""


@dataclass(frozen=True, slots=True)
class Standing:
    """A claim's status with everything that it rests on.

    `direct`: its own evidence fails; `below`: the claims under it that fail by their own evidence (root causes);
    `weakest`: the claim with the weakest status under it (itself included) and that status; `hypotheses` and `link`:
    those of it and of everything under it, and the least mechanical link among them.
    """

    status: Status
    direct: bool
    below: tuple[str, ...]
    weakest: tuple[str, Status]
    hypotheses: tuple[str, ...]
    link: Link | None
    circle: tuple[str, ...] = ()


def judge(claims: Iterable[Claim]) -> Mapping[str, Standing]:
    """Every claim's standing. A name under `rests_on` that is no claim counts as a claim without evidence."""
    known = {claim.id: claim for claim in claims}
    for claim in tuple(known.values()):
        for name in claim.rests_on:
            known.setdefault(name, Claim(name, Status.MISSING))
    alone = {name for name, claim in known.items() if not claim.rests_on}  # nearly all
    result = {name: _stand(known[name], {}) for name in alone}
    further = {name: [n for n in c.rests_on if n not in alone] for name, c in known.items() if name not in alone}
    for members in strong_components(sorted(further), further.__getitem__):
        component = tuple(sorted(members))
        circle = _circle(component, known)
        for name in component:
            result[name] = _circular(known[name], circle) if circle else _stand(known[name], result)
    return result


def _stand(claim: Claim, done: Mapping[str, Standing]) -> Standing:
    own = claim.own
    if own is not None and not (claim.rests_on or claim.prose):
        hypotheses = tuple(sorted({*claim.hypotheses})) if claim.hypotheses else ()
        return Standing(own, not own.supports, (), (claim.id, own), hypotheses, claim.link)
    under = [(name, done[name]) for name in dict.fromkeys(claim.rests_on)]
    direct = own is not None and not own.supports
    below = tuple(dict.fromkeys(cause for name, s in under for cause in _causes(name, s)))
    candidates = [(claim.id, own)] if own is not None else []
    candidates += [standing.weakest for _, standing in under]
    if not candidates:
        candidates = [(claim.id, Status.MISSING)]
        direct = True
    worst = min(candidates, key=lambda pair: (pair[1].rank, pair[0]))
    if direct:
        status = own or Status.MISSING
    elif below:
        status = Status.UNSUPPORTED
    else:
        status = Status.ARGUED if claim.prose and worst[1].rank > Status.ARGUED.rank else worst[1]
    links = [link for link in (claim.link, *(s.link for _, s in under)) if link is not None]
    if claim.prose:
        links.append(Link.GUIDED)
    return Standing(
        status=status,
        direct=direct,
        below=below,
        weakest=worst,
        hypotheses=tuple(sorted({*claim.hypotheses, *(h for _, s in under for h in s.hypotheses)})),
        link=weakest_link(links),
    )


def _causes(name: str, standing: Standing) -> tuple[str, ...]:
    if standing.status.supports:
        return ()
    return (name, *standing.below) if standing.direct or standing.circle else standing.below


def _circular(claim: Claim, circle: tuple[str, ...]) -> Standing:
    worst = (claim.id, Status.CIRCULAR)
    if claim.own is not None and claim.own.rank < Status.CIRCULAR.rank:  # a refutation is reported even within a cycle
        return Standing(claim.own, True, (), (claim.id, claim.own), claim.hypotheses, claim.link, circle)
    return Standing(Status.CIRCULAR, True, (), worst, claim.hypotheses, claim.link, circle)


def _circle(component: tuple[str, ...], claims: Mapping[str, Claim]) -> tuple[str, ...]:
    """The cycle in a strongly connected component, as a path that ends where it began; empty if there is none."""
    if len(component) == 1 and component[0] not in claims[component[0]].rests_on:
        return ()
    members, start = set(component), min(component)
    path, seen = [start], {start}
    while True:  # within a strongly connected component some successor always stays inside
        step = sorted(name for name in claims[path[-1]].rests_on if name in members)
        fresh = [name for name in step if name not in seen]
        if not fresh:
            return (*path[path.index(step[0]) :], step[0])
        path.append(fresh[0])
        seen.add(fresh[0])
