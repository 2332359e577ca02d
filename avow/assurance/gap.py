"""One demand of the policy against one guarantee: whether it is met, what is lacking, and the cheapest way to close the
gap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date
from itertools import combinations

from avow.assurance.facts import Facts
from avow.assurance.model import Currency, MethodInfo, ObligationView, Suggestion
from avow.assurance.naming import short
from avow.assurance.policy import CRITICALITIES, Demand, Policy, asked_of, costs
from avow.assurance.relied import judgements
from avow.base.graphs import components
from avow.base.persons import one_person
from avow.base.plain import count
from avow.base.remembered import by_identity
from avow.base.tuning.shown import TOOL_WORDS
from avow.base.verdict import Isolation, Link, Verdict
from avow.evidence.obligation import Kind
from avow.evidence.record import ISOLATION, SIGNED_BY, SOLVER, Evidence
from avow.evidence.status import Status, effective, join, link_rank, weigh


def shortfall(view: ObligationView, demand: Demand, policy: Policy, today: date) -> str | None:
    """What a guarantee lacks, in words; None if the demand is met."""
    if not demand.one_of:
        return None
    kept, dropped = counted(view, demand, policy, today)
    status = join(map(weigh, kept)).status if kept else view.status
    because = f" ({'; '.join(dropped)})" if dropped else ""
    if kept == [] and dropped:
        return f"nothing counts{because}"
    if status not in demand.one_of:
        return f"{status.value}, but {asked_of(demand)} is asked{because}"
    speaking = [item for item in kept if weigh(item).support is not None]
    number = independent(speaking) if demand.independent else len({item.method for item in speaking})
    if number < demand.methods:
        kind = "independent method" if demand.independent else "method"
        return f"{count(number, kind)}, but {demand.methods} are asked{because}"
    # that another method answered does not make good what this one could not do
    return next((f"{one.method} failed: {one.summary}" for one in kept if one.verdict is Verdict.ERROR), None)


@by_identity(20_000)
def counted(view: ObligationView, demand: Demand, policy: Policy, today: date) -> tuple[list[Evidence], list[str]]:
    """The records that count for a demand, and why others, which support the claim, do not."""
    evidence = view.records
    kept, dropped = [], []
    persons = _persons(evidence, demand, policy, today)
    for item in evidence:
        reason = _disregarded(item, demand, policy, today)
        if reason is None and effective(item) is Verdict.REVIEWED and len(persons) < demand.reviewers > 1:
            reason = f"reviewed by {len(persons)}, {demand.reviewers} reviewers are asked{_taken_for_one(persons)}"
        if reason is None:
            kept.append(item)
        elif weigh(item).support is not None:
            dropped.append(f"{item.method}: {reason}")
    return kept, dropped


def independent(evidence: Iterable[Evidence]) -> int:
    """The largest number of items that differ pairwise in backend AND in tool: two backends with one solver count once.

    The tool is the solver that decides, so Dafny and Hoare triples, which both call Z3, count once. This is a maximum
    matching between backends and tools, with an edge for each item.
    """
    edges: dict[str, set[str]] = {}
    for item in evidence:
        edges.setdefault(item.backend, set()).add(str(item.details.get(SOLVER, item.tool)))
    partner: dict[str, str] = {}

    def place(backend: str, tried: set[str]) -> bool:
        for tool in sorted(edges[backend] - tried):
            tried.add(tool)
            if tool not in partner or place(partner[tool], tried):
                partner[tool] = backend
                return True
        return False

    return sum(place(backend, set()) for backend in sorted(edges))


def reviewers(evidence: Evidence) -> tuple[str, ...]:
    """The persons behind a review, as its details name them (``reviewers``, ``reviewer`` or ``who``)."""
    for key in ("reviewers", "reviewer", "who"):
        match evidence.details.get(key):
            case str(name):
                return (name,)
            case list() | tuple() as names:
                return tuple(str(name) for name in names)
    return ()


def _persons(evidence: Iterable[Evidence], demand: Demand, policy: Policy, today: date) -> list[list[str]]:
    """The persons who reviewed the claim, in one record or in several that each count, each with all names that are
    taken for one person; a key belongs to one person, whatever names it signs."""
    reviews = [
        item
        for item in evidence
        if weigh(item).support is Status.REVIEWED and _disregarded(item, demand, policy, today) is None
    ]
    held = [(name, str(item.details.get(SIGNED_BY, ""))) for item in reviews for name in reviewers(item)]
    names, keys = {name for name, _ in held}, {key for _, key in held if key}
    arcs = [(name, f"key {key}") for name, key in held if key]
    arcs += [pair for pair in combinations(sorted(names), 2) if one_person(*pair)]
    both = [*arcs, *((b, a) for a, b in arcs)]
    found = components([*names, *(f"key {key}" for key in keys)], both)
    return [sorted(names & set(one)) for one in found if names & set(one)]


def _taken_for_one(persons: list[list[str]]) -> str:
    several = [" and ".join(f"'{name}'" for name in names) for names in persons if len(names) > 1]
    told = ", ".join(several)
    return f": {told} are taken for one person; where they are not, write full names that differ" if several else ""


def _age_days(evidence: Evidence, today: date) -> int | None:
    """Days since the evidence was made: by a person's date if the details give one, else by the attempt's start."""
    for text in (evidence.details.get("date"), evidence.started):
        if isinstance(text, str):
            try:
                return (today - date.fromisoformat(text[:10])).days
            except ValueError:
                continue
    return None


def _disregarded(item: Evidence, demand: Demand, policy: Policy, today: date) -> str | None:
    """The reason why a supporting item does not count; refutations and failures are never disregarded."""
    support = weigh(item).support
    if support is None:
        return None
    age = _age_days(item, today)
    if age is not None and age < -1:  # a clock in another time zone may be a day ahead
        return "dated in the future"
    limit = demand.max_age(support)
    if limit is not None:
        if age is None or age > limit:
            return f"{'of unknown age' if age is None else f'{age} days old'}, at most {limit} are allowed"
        if age < 0:
            return "dated in the future"
    if effective(item) is Verdict.REVIEWED:
        people = set(reviewers(item))
        strangers = people - set(policy.reviewers) if policy.reviewers else set()
        if strangers:
            return f"{', '.join(sorted(strangers))} may not review under this policy"
    elif demand.links and support is not Status.JUSTIFIED and item.link not in demand.links:
        return f"the tie is {item.link}, {' or '.join(demand.links)} is asked"
    if demand.of and item.of not in demand.of:
        return f"it is of a {item.of}, {' or '.join(demand.of)} is asked"
    if demand.numbers and item.numbers not in demand.numbers:
        return f"a REAL is {item.numbers} in it, {' or '.join(demand.numbers)} is asked"
    if support is Status.TESTED and 0 < (many := judgements(item)) < demand.cases:
        return f"{count(many, 'case')} met its condition, {demand.cases} are asked"
    if demand.unconditional and item.hypotheses:
        return "rests on hypotheses"
    kept = item.details.get(ISOLATION)
    if kept in tuple(Isolation) and Isolation(kept).rank < demand.isolation.rank:
        return f"the program ran with isolation {kept}, {demand.isolation} is asked (avow verify --sandbox)"
    return None


def _against_vacuity(view: ObligationView) -> str:
    match view.obligation.kind:
        case Kind.REQUIREMENT:
            return "state a formula that a faulty design would break, and name under `supported_by` what it needs"
        case Kind.COMPOSITION:
            return (
                "assume less: an environment must be able to go on for ever, and each guarantee's trigger to come about"
            )
        case _:  # above all a guarantee
            return f"give the method inputs that meet the trigger of {short(view.id)}"


def suggest(view: ObligationView, demand: Demand | None, facts: Facts) -> Suggestion:
    """The cheapest step: repair what is wrong, run or install what is planned, else add a suitable method."""
    match view.status:
        case Status.REFUTED:
            known = next((str(r.details["next"]) for r in view.records if "next" in r.details), "")
            severe = view.obligation.kind is Kind.GUARANTEE and view.criticality == CRITICALITIES[0]
            accept = "" if severe else ", or accept it with a dated reason"
            shown = f"what the counterexample of {short(view.id)} shows"
            if view.obligation.kind is Kind.SANITY and view.records:  # its summary names the clauses at fault
                shown = f"{short(view.id).partition(' (')[0]}: {view.records[-1].summary}"
            return Suggestion(known or f"repair {shown}{accept}", cost=-2)  # what is wrong comes before what is lacking
        case Status.CONTRADICTORY:
            text = "one method proves it and another refutes it; repair what is wrong, or find out which tool is"
            return Suggestion(f"{short(view.id)}: {text}", cost=-2)
        case Status.ERROR:
            # the same job is not run again by itself: its input has to change, or the run be fresh
            again = f"`avow verify --fresh {facts.system}`"
            failed = next((r for r in view.records if r.verdict is Verdict.ERROR), None)
            said = f" `{failed.method}`: {_clipped(failed.summary)}" if failed is not None else " the tool"
            return Suggestion(f"repair what stopped{said}; then {again}", cost=-1)
        case Status.UNWRITTEN:
            return Suggestion("replace `to_write` by what the node promises", cost=40)
        case Status.VACUOUS if hollow := [r.method for r in view.records if r.vacuous and "mutation" in r.details]:
            return Suggestion(
                f"find out what `{hollow[0]}` looks at: it says the same of every mutant of the claim", cost=50
            )
        case Status.VACUOUS:
            return Suggestion(_against_vacuity(view), cost=50)
        case Status.STALE if expired := _expired(view):
            return Suggestion(
                f"renew the {' and the '.join(expired)}: what was given was valid until a day that is past", cost=30
            )
        case Status.STALE if view.planned:
            return Suggestion(
                f"run `avow verify {facts.system}`: the plan's methods have not answered the claim as it is now"
            )
    if demand is None and view.status is Status.JUSTIFIED:
        return Suggestion(
            "a person's reason is not enough here: let a contract guarantee it, or take it as a risk under "
            "`accepted:`, with a name, a date and an expiry",
            cost=30,
        )
    used = _planned(view, facts)
    by_name = {method.name: method for method in facts.methods}
    tried = {r.method for r in view.records}
    for method, backend in used.items():
        info = by_name.get(backend)
        if info is not None and not info.available:
            return Suggestion(f"install what `{method}` needs: {info.install}", method)
        if method not in tried:
            return Suggestion(f"run `avow verify {facts.system}`: `{method}` has not answered yet", method)
    for record in view.records:
        if record.method in used and record.verdict is Verdict.NOT_RUN:
            return Suggestion(f"let `{record.method}` run: {_clipped(record.summary)}", record.method)
        if record.method in used and record.verdict is Verdict.ERROR:
            return Suggestion(
                f"repair what keeps `{record.method}` from answering: {_clipped(record.summary)}", cost=-1
            )
    if demand is None:
        if view.obligation.kind is Kind.REQUIREMENT:
            for record in view.records:
                if record.verdict is Verdict.UNKNOWN:
                    return Suggestion(f"see why it is unknown: {_clipped(record.summary)}", cost=20)
            return Suggestion("add what it rests on under `supported_by`, or state it as a formula", cost=20)
        if view.obligation.kind is Kind.COMPOSITION and _wants_a_reason(view):
            return Suggestion(reason_wanted(view.obligation.name), cost=5)
        return Suggestion(
            "narrow the question (a scenario in the plan), allow more `seconds`, or accept it with a reason", cost=20
        )
    new = _new_method(view, demand, used, facts)
    for record in view.records:
        if record.method in used and record.verdict is Verdict.UNKNOWN and not record.vacuous:
            return replace(new, text=f"{new.text}; or see why `{record.method}` gave up: {_clipped(record.summary)}")
    return new


def _clipped(text: str) -> str:
    return text if len(text) <= TOOL_WORDS else f"{text[:TOOL_WORDS].rpartition(' ')[0]} …"


def _expired(view: ObligationView) -> tuple[str, ...]:
    """The methods whose answers were valid until a day that has passed, and that have given none since."""
    return tuple(dict.fromkeys(v.entry.evidence.method for v in view.evidence if v.currency is Currency.EXPIRED))


def _wants_a_reason(view: ObligationView) -> bool:
    """Whether only a person's reason can discharge this condition, and no tool can; its evidence says where the reason
    belongs."""
    return not view.obligation.formula or view.obligation.name.startswith("environment.")


def reason_wanted(name: str) -> str:
    """The place in the plan for the reason that a condition of the composition lacks."""
    goal, _, key = name.partition(".")
    if name.startswith("start."):
        return "say what a delayed edge of the loop carries first: `connections: [{…, delayed: true, initial: …}]`"
    if name.startswith("environment."):
        about = name.removeprefix("environment.")
        key = about if about.startswith("in.") else f"{about.partition('.')[0]}.PORT"
        port = "" if about == key else ", with PORT its input"
        return f"say what is assumed of the input{port}, and why: `environment: {{{key}: {{assume: …, because: …}}}}`"
    key = "entered" if key.startswith(("loop.", "loop-of.")) else key.replace("-", "_")
    return f"give a reason in the plan: `compose: {{{goal}: {{{key}: {{because: …}}}}}}`"


def missing_tools(facts: Facts) -> Mapping[tuple[str, str], str]:
    """(node, method) → the command that installs the planned method's missing tool."""
    install = {info.name: info.install for info in facts.methods if not info.available}
    planned = [(node.name, method, backend) for node in facts.nodes for method, backend in node.methods]
    return {(node, method): install[backend] for node, method, backend in planned if backend in install}


def _planned(view: ObligationView, facts: Facts) -> Mapping[str, str]:
    backends = _backends(facts).get(view.obligation.node, {})
    return {method: backends.get(method, method) for method, _ in view.planned}


@by_identity(1)
def _backends(facts: Facts) -> Mapping[str, Mapping[str, str]]:
    """Node → method → backend."""
    return {node.name: dict(node.methods) for node in facts.nodes}


@by_identity(1)
def _unsuited(facts: Facts) -> Mapping[str, frozenset[str]]:
    """Method → the nodes that it does not suit."""
    return {info.name: frozenset(info.unsuited) for info in facts.methods}


def _new_method(view: ObligationView, demand: Demand, used: Mapping[str, str], facts: Facts) -> Suggestion:
    strong_enough = view.status in demand.one_of
    order = costs()
    node, unsuited = view.obligation.node, _unsuited(facts)

    def fits(info: MethodInfo) -> bool:
        if info.name in used.values() or node in unsuited[info.name]:
            return False
        if demand.links and info.link not in demand.links and info.strength is not Verdict.REVIEWED:
            return False
        return strong_enough or Status(info.strength) in demand.one_of

    def dear(info: MethodInfo) -> int:
        """Persons cost more than machines, and tools to be installed more than installed ones."""
        by_hand = 5 if info.link is Link.GUIDED else 0
        return order.get(info.strength, 9) + by_hand + (0 if info.available else 5)

    fitting = sorted(
        (info for info in facts.methods if fits(info)), key=lambda i: (dear(i), -link_rank(i.link), i.name)
    )
    if not fitting:
        wanted = "a second, independent method" if strong_enough else f"a method that can give {asked_of(demand)}"
        return Suggestion(f"add {wanted} under nodes.{node}.methods", cost=60)
    best = fitting[0]
    install = "" if best.available else f" (first: {best.install})"
    others = " or ".join(f"`{info.name}`" for info in fitting[1:3])
    return Suggestion(
        f"add `{best.name}` under nodes.{node}.methods: {best.title}{install}{f'; or {others}' if others else ''}",
        best.name,
        10 + order.get(best.strength, 9),
    )
