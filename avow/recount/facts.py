"""What report.json says of obligations, records, requirements, assumptions and proofs, counted again."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import Any

Json = dict[str, Any]
HOLDS = ("shown", "shown of models", "shown by tests", "shown by tests and of models", "argued")
SUPPORTS = ("proved", "checked", "tested", "monitored", "reviewed", "justified")
"""Best first."""
_SAMPLED = ("tested", "monitored")
_SEEN = ("proved", "checked", *_SAMPLED, "reviewed")
"""What tools and readers found, not a person's reason."""
_STRICT = 1 - 1e-5
"""Bounds in records are decimals of six digits: so far may one lie below what the sample gives."""
_BELOW = {"catastrophic": ("medium", "low"), "critical": ("medium", "low"), "marginal": ("low",), "negligible": ()}
"""A hazard's severity → the criticalities that are too low for what mitigates it."""
_QUOTED: tuple[str, ...] = ("assumptions", "baseline", "changes", "digests", "environment", "hazards")
_QUOTED += ("nodes", "policy", "run", "standard", "statements", "system", "title", "today", "tools", "methods")
_QUOTED += ("ledger_head", "sources")


class Facts:
    """`quoted`: every text that the page may quote to the letter."""

    def __init__(self, case: Json) -> None:
        self.case = case
        self.requirements: list[Json] = case["requirements"]
        self.assumptions: list[Json] = case["assumptions"]
        self.views: list[Json] = case["obligations"]
        self.guarantees = [v for v in self.views if v["obligation"]["kind"] == "guarantee"]
        self.hazards: list[Json] = case.get("hazards") or []
        self.changes: list[Json] = list(map(_flat, case["changes"]["entries"]))
        self.gates = [g for g in case["gates"] if not g.get("idle")]
        self.failing = [g for g in case["gates"] if not g["passed"]]
        self.advice = {item["claim"] for item in case["open_items"] if item["kind"] == "advice"}
        self.advice |= {_id(v) for v in self.views if v["obligation"].get("advisory")}
        self.quoted = {" ".join(text.split()) for text in self._texts()}

    def _texts(self) -> Iterator[str]:
        for name in _QUOTED:
            yield from _strings(self.case.get(name) or ())
        for r in self.requirements:
            yield from (r["id"], r["text"], r["formula"], r.get("temporal") or "")
        for v in self.views:
            yield from (
                v["obligation"]["claim"],
                v["obligation"]["claim"].rstrip("."),
                v["obligation"]["name"],
                _id(v),
                _short(v),
            )
            yield from (r["numbers"] for r in records(v))
            for told in (_refuting(record, v["obligation"]["formula"]) for record in records(v)):
                yield from (told, told[:71].rstrip() + "…")
        yield from (f"{name} {version}" for name, version in self.case["kernel"]["solvers"].items())
        yield from self.tools()
        for gate in self.case["gates"]:
            yield from (gate["title"], *gate["reason"].split("; "), gate["reason"][:199].rstrip() + "…")
            yield from (re.sub("`([^`]+)`", r"\1", s["text"]) for s in gate["suggestions"])

    def level(self, *levels: str) -> list[str]:
        return [r["id"] for r in self.requirements if r["level"] in levels]

    def lost(self) -> int:
        """Requirements that lack more than a person who reads the sentence against the formula."""
        waits = [r for r in self.requirements if r["status"] in (*SUPPORTS, "argued") and not r.get("expired")]
        waiting = [r["id"] for r in waits if not r.get("failing") and not r["unknown_names"]]
        return len([name for name in self.level("not shown") if name not in waiting])

    def supposed(self, requirement: str) -> int:
        return sum(requirement in a["needed_by"] for a in self.assumptions)

    def owned_ones(self) -> list[Json]:
        return [a for a in self.assumptions if a["who"] and (a["until"] or a["sort"] == "meaning")]

    def numbers(self, sort: str) -> list[int]:
        return [int(a["number"][1:]) for a in self.assumptions if a["sort"] == sort]

    def wrong(self) -> list[Json]:
        return [v for v in self.views if v["status"] in ("refuted", "contradictory") and _id(v) not in self.advice]

    def wronged(self) -> int:
        """Nodes with a refuted claim, the whole system among them."""
        return len({v["obligation"]["node"] for v in self.wrong()})

    def known(self) -> tuple[str, str]:
        """Findings that the plan speaks of and that support nothing, and how many stand how; remarks apart."""
        bad = [v for v in self.views if v["handled"] and v["standing"] not in (*SUPPORTS, "argued")]
        of = Counter("remarked" if _id(v) in self.advice else v["standing"] for v in bad)
        return str(len(bad)), ", ".join(f"{many} {status}" for status, many in of.items())

    def unneeded(self) -> int:
        """Guarantees beneath no requirement and no hazard; none where no requirement is named."""
        roots = (*self.requirements, *self.hazards) if self.requirements else ()
        beneath = {name for root in roots for name in root.get("closure", ())}
        return sum(_id(v) not in beneath for v in self.guarantees) if roots else 0

    def signed(self) -> str:
        """The sentence that was signed, while the case is the signed one."""
        return self.case["baseline"].get("says", "") if self.case["answers"]["signed"].startswith("signed") else ""

    def old(self) -> int:
        return sum(r["run"] != self.case["run"]["id"] for v in self.views for r in records(v))

    def unanswered(self) -> int:
        """The greatest share of drawn inputs without an answer, in percent, rounded up."""
        bounds = [r["bound"] for v in self.views for r in records(v) if v["obligation"]["kind"] != "program"]
        return max(
            (-(-100 * b["unanswered"] // b["cases"]) for b in bounds if {"unanswered", "cases"} <= b.keys()), default=0
        )

    def proofs(self, *grades: str) -> int:
        asked = [p for p in self.case["proofs"] if p["obligation"].split("/")[2] in ("composition", "requirement")]
        return sum(not grades or p["grade"] in grades for p in asked)

    def tools(self) -> Counter[str]:
        """How many answers without a certificate each tool has: proofs, searches, tests, observations, refutations."""
        told = [r for v in self.views for r in records(v)]
        told = [r for r in told if support(r) in ("checked", *_SAMPLED) or r["verdict"] == "refuted"]
        proofs = Counter(tool for p in self.case["proofs"] for tool in p.get("tools") or ())
        return proofs + Counter(map(_tool, told))

    def stands(self, node: str, status: str, what: str) -> tuple[int, int]:
        """At least and at most so many guarantees of a node stand so, by evidence of such an object (any: ``-``)."""
        ways = []
        for v in self.guarantees:
            if v["obligation"]["node"] == node:
                open_ = v["standing"] not in (*SUPPORTS, "argued")
                ways.append({(v["standing"], "")} if open_ else {_way(r) for r in supporting(v)})
        fits = [{w[0] == status and what in (w[1], "-") for w in way} for way in ways]
        return sum(fit == {True} for fit in fits), sum(True in fit for fit in fits)

    def deficit(self, key: str) -> tuple[int, int] | None:
        """At least and at most so many, as the records have it; None for a kind that is not known here."""
        within = self.guarantees
        own = [v for v in self.views if v["obligation"]["kind"] == "requirement"]
        sampled = [{support(r) in ("tested", "monitored") for r in supporting(v)} for v in self.views]
        read = [{support(r) == "reviewed" for r in supporting(v)} for v in within]
        model = [{_way(r)[1] == "model" for r in supporting(v)} for v in within]
        hand = [{r["link"] != "generated" for r in supporting(v)} for v in within]
        premises = [v for v in self.views if v["obligation"]["kind"] == "composition"]
        exact = {
            "open": sum(v["standing"] not in (*SUPPORTS, "argued") for v in within),
            "premises": sum(v["standing"] not in (*SUPPORTS, "argued") for v in premises),
            "argued": len(self.level("argued")),
            "unvalidated": sum(not r.get("validated") for r in self.requirements),
            "bounded": sum(bool(r.get("bounded")) and r["level"] in HOLDS for r in self.requirements),
            "bare": sum(_words(f"{a['because']} {a['text']}") <= _words(a["says"]) for a in self.assumptions),
            "wordless": sum(not a["says"] for a in self.assumptions),
            "unowned": len(self.assumptions) - len(self.owned_ones()),
            "unanswered": sum(
                any(r["bound"].get("unanswered") or r["bound"].get("open") for r in records(v)) for v in (*within, *own)
            ),
            "nan": sum(any(r["details"].get("no numbers") for r in records(v)) for v in (*within, *own)),
            "withdrawn": sum(i["kind"] == "withdrawn" for i in self.case["open_items"]),
            "idle": sum(
                not any(_id(v) in r["closure"] for r in self.requirements) for v in within if self.requirements
            ),
            "underrated": sum(
                any(
                    _id(v) in h.get("closure", ()) and v["criticality"] in _BELOW[h["hazard"]["severity"]]
                    for h in self.hazards
                )
                for v in within
            ),
            "unrun": sum(_silent(v, method) for v in within for method, _ in v["planned"]),
            "programs": sum(v["obligation"]["kind"] == "program" and v["status"] == "not-run" for v in self.views),
            "advice": sum(i["advice"] and not i["handled"] for i in self.case["open_items"]),
            "excused": sum(
                len(f["obligations"]) for f in self.case["findings"] if f["how"] == "accepted" and not f["expired"]
            ),
        }
        loose = {"sampled": sampled, "read": read, "models": model, "tied": hand}
        if key in exact:
            return exact[key], exact[key]
        if key in loose:
            return sum(found == {True} for found in loose[key]), sum(True in found for found in loose[key])
        if key == "single":
            alone = [len({r["method"] for r in supporting(v)}) for v in within]
            return sum(many == 1 for many in alone), sum(many > 0 for many in alone)
        return None

    def seen(self, before: str) -> set[str]:
        """What the records show of the claim that a text quotes at its end, in the words of the page, with the bound
        that follows."""
        quoted = before.rpartition("”")[0]
        found = [v for v in self.views if quoted.endswith(f"“{' '.join(v['obligation']['claim'].split()).rstrip('.')}")]
        return {words for v in found for r in supporting(v) for words in _seen(r)}

    def searched(self, requirement: str) -> set[str]:
        """The same of a requirement's own formula or property, and of the claims below it, with their names."""
        own = {n for r in self.requirements if r["id"] == requirement for n in (*r["obligations"], *r["closure"])}
        return {words for v in self.views if _id(v) in own for r in supporting(v) for words in _seen(r)}

    def fails(self, claims: list[str]) -> list[str]:
        """Those of the claims that do not hold, each with its status, as the page names them."""
        bad = [v for v in self.views if _id(v) in claims and v["standing"] not in (*SUPPORTS, "argued")]
        return [f"{_short(v)}, {v['status']}" for v in bad]

    def weakest(self, claims: list[str]) -> list[str]:
        """``navigation.stays, tested, bound 13 %``: what may be the weakest evidence of some claims. Where a claim has
        several records, either may be the one relied upon: none that is certainly stronger than another claim's."""
        known, leaves = set(claims), ("guarantee", "requirement")
        of = [v for v in self.views if _id(v) in known and v["obligation"]["kind"] in leaves]
        own = [v for v in of if v["obligation"]["kind"] == "guarantee"]
        ways = [(v, sorted((_weakness(r), _told(r)) for r in supporting(v) if support(r) in _SEEN)) for v in own or of]
        ways = [(v, found) for v, found in ways if found]
        least = min((found[-1][0] for _, found in ways), default=(0, 0.0))
        return [f"{_short(v)}, {told}" for v, found in ways for weak, told in found if weak <= least]

    def rate(self, words: str) -> str:
        """The least favourable rate of the requirements, as the page has it, from the samples of its leaves."""
        found = [rate for r in self.requirements if (rate := r.get("rate")) and rate["bound"]]
        for rate in found:
            leaves = [leaf["strata"] for leaf in rate["leaves"]]
            strata = [s for leaf in leaves for s in leaf]
            bound = sum((max(Fraction(s["bound"]) for s in leaf) for leaf in leaves), Fraction(0))
            sure = 1 - sum((1 - Fraction(s["confidence"]) for s in strata), Fraction(0))
            what = f"{strata[0].get('trial', 'step')}s"
            told = f"at most {_percent(bound, ROUND_CEILING)} of {what} fail, at {_percent(sure, ROUND_FLOOR)}"
            if told == words and all(_sampled(s) for s in strata):
                return told
        return "none" if not found else "another rate"


def _id(view: Json) -> str:
    o = view["obligation"]
    return f"{o['system']}/{o['node']}/{o['kind']}/{o['name']}"


def records(view: Json) -> list[Json]:
    """The records that count today."""
    return [item["entry"]["evidence"] for item in view["evidence"] if item["counts"]]


def supporting(view: Json) -> list[Json]:
    """The records that may be relied upon: none where something refutes the claim."""
    return [record for record in records(view) if support(record) and view["status"] in SUPPORTS]


def _refuting(record: Json, formula: str) -> str:
    """What a refuting record found, as the page has it: first the values that the formula names, in its order."""
    found = record["counterexample"] or {"values": (), "explanation": ""}
    place = {name: formula.find(name) if name in formula else len(formula) for name, _ in found["values"]}
    shown = sorted(found["values"], key=lambda value: place[value[0]])
    values = ", ".join(f"{name} = {value}" for name, value in shown if not name.startswith("("))
    example = ": ".join(part for part in (values, found["explanation"]) if part)
    return (example or record["summary"]) if record["verdict"] == "refuted" else ""


def support(record: Json) -> str:
    """What a record supports with: no more than its method can show, and nothing where it is vacuous."""
    told, most = record["verdict"], record["strength"]
    if record["vacuous"] or told not in SUPPORTS or most not in SUPPORTS:
        return ""
    return SUPPORTS[max(SUPPORTS.index(told), SUPPORTS.index(most))]


def _way(record: Json) -> tuple[str, str]:
    said = support(record)
    return said, record["of"] if said in ("proved", "checked", "tested", "monitored") else ""


def _words(text: str) -> set[str]:
    return set(re.findall(r"\w+", text.casefold()))


def _tool(record: Json) -> str:
    tool, version = record["tool"], record["tool_version"]
    told = version if tool and version.casefold().startswith(tool.casefold()) else f"{tool} {version}".strip()
    told = " ".join(re.sub(r"[^\w.+'-]", " ", told).split())
    asks = record["backend"]
    return f"search by {told}" if asks == "compose" else told if told.startswith(asks) else f"{asks}: {told}"


def _sampled(stratum: Json) -> bool:
    """Whether the failures in a stratum's trials show its bound."""
    sure = float(Fraction(stratum["confidence"]))
    return float(Fraction(stratum["bound"])) >= _STRICT * upper(stratum["failures"], stratum["trials"], sure)


def _short(view: Json) -> str:
    """A claim as the page names it, if that is no sentence."""
    o = view["obligation"]
    own = f"{o['node']}.{o['name']}" if o["kind"] == "guarantee" else f"{o['node']}/{o['kind']}/{o['name']}"
    return own.removeprefix("system/requirement/")


def _weakness(record: Json) -> tuple[int, float]:
    """The weakest first: a person's reading; of samples, the greatest bound on failures, or what as many trials would
    give; then bounded checks; then proofs."""
    said, bound = support(record), _upper(record)
    if bound is None:
        trials = _trials(record)
        bound = 1 - 0.05 ** (1 / trials) if trials else 1.0
    return ("reviewed", "sampled", "checked", "proved").index("sampled" if said in _SAMPLED else said), -bound


def _told(record: Json) -> str:
    """``tested, bound 13 %``."""
    bound = _upper(record)
    shown = "no bound" if bound is None else f"bound {_percent(Fraction(str(bound)), ROUND_CEILING)}"
    return f"{support(record)}, {shown}" if support(record) in _SAMPLED else support(record)


def _upper(record: Json) -> float | None:
    """The greatest bound on failures that a record names."""
    named = ((k.lower().replace("_", " "), v) for k, v in record["bound"].items())
    return max(
        (float(v) for k, v in named if "failure" in k and ("below" in k or "at most" in k) and _is(v)), default=None
    )


def _trials(record: Json) -> int:
    bound = record["bound"]
    return next((bound[k] for k in ("triggered", "judged", "runs", "cases") if isinstance(bound.get(k), int)), 0)


def _silent(view: Json, method: str) -> bool:
    return all(r["verdict"] in ("not-run", "error", "unknown") for r in records(view) if r["method"] == method)


def _seen(record: Json) -> Iterator[str]:
    bound = record["bound"]
    known = _upper(record)
    runs, cases, hit = bound.get("runs"), bound.get("cases"), bound.get("triggered")
    most = ", with no bound on failures"
    if known is not None:
        sure, failed = bound.get("confidence"), bound.get("failures", 0)
        trials = _trials(record)
        whole = "worst stratum" in bound or not _is(sure) or not isinstance(failed, int)
        if not whole and known < _STRICT * upper(failed, trials, sure):
            return  # it says more than its sample shows
        told = f"{_percent(Fraction(str(sure)), ROUND_FLOOR)} confidence" if _is(sure) else "confidence not recorded"
        drawn = (
            ""
            if "rate" in record["details"]
            else f" of {'runs' if isinstance(runs, int) else 'cases'} drawn like these"
        )
        most = f" ({told}: at most {_percent(Fraction(str(known)), ROUND_CEILING)}{drawn} fail)"
    if isinstance(runs, int):
        hit = runs if hit is None else hit
        of = _count(runs, "run") if hit == runs else f"{_count(hit, 'triggered run')} of {runs}"
        worst = f"; the worst stratum: {bound['worst stratum']}" if "worst stratum" in bound else ""
        yield f"{of}, {bound.get('failures', 0)} failed{worst}{most}"
    if isinstance(cases, int):
        few = "only " if isinstance(hit, int) and hit < cases / 2 else ""
        met = (
            f"{few}{hit} of {_count(cases, 'case')} met its condition"
            if isinstance(hit, int)
            else _count(cases, "case")
        )
        yield f"{met}, none failed{most}"
    if support(record) == "checked":
        steps, states = (bound.get(key) for key in ("steps", "states"))
        yield f"every case of a bounded model was looked at, with {_count(states, 'state')}"
        many = f"{steps} kind{'' if steps == 1 else 's'} of steps"
        yield f"every run within the plan's scenario was looked at, with {many}"
    if isinstance(bound.get("depth"), int):
        yield f"searched to step {bound['depth']}, not exhaustively"
    if isinstance(bound.get("judged"), int):
        traces = bound.get("traces")
        on = f" on {_count(len(traces), 'recorded run')}" if traces and isinstance(traces, dict | list) else ""
        yield f"observed {_count(bound['judged'], 'time')}{on}, none against it"


def upper(failures: int, trials: int, confidence: float) -> float:
    """The greatest rate of failure at which so few failures have a probability of 1 - confidence (Clopper, Pearson)."""
    if failures >= trials:
        return 1.0
    low, high = failures / trials, 1.0
    for _ in range(60):
        p = (low + high) / 2
        chance = sum(
            math.exp(
                math.lgamma(trials + 1)
                - math.lgamma(k + 1)
                - math.lgamma(trials - k + 1)
                + (k * math.log(p) if k else 0)
                + (trials - k) * math.log1p(-p)
            )
            for k in range(failures + 1)
        )
        low, high = (p, high) if chance > 1 - confidence else (low, p)
    return low


def _percent(part: Fraction, way: str) -> str:
    exact = Decimal(part.numerator * 100) / Decimal(part.denominator)
    return f"{Context(prec=3, rounding=way).create_decimal(exact).normalize():f} %"


def _is(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _flat(value: Any) -> Any:
    """The same with each text as a page has it: one blank in place of several."""
    if isinstance(value, dict):
        return {key: _flat(item) for key, item in value.items()}
    return " ".join(value.split()) if isinstance(value, str) else list(map(_flat, value))


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield str(key)
            yield from _strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from _strings(item)
