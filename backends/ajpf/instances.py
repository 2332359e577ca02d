"""A guarantee as properties: one instance for each value of its index variables, read as in
`avow.backends.ajpf.reading`. Warnings are given for values that no instance covers, and for words that neither program
nor environment has (mostly typing errors: forbidding what no agent of this program could do shows nothing)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.suggestions import nearest
from avow.formulas.renaming import bound_names
from avow.language.contract import Clause
from avow.language.sorts import DataSort, EnumSort
from avow.language.subterms import subterms
from avow.language.terms import TRUE, And, Implies, Quantified, Quantifier, Term, Variable

from . import psl
from .checker import Property
from .mapping import Decider, Mapper, NotCovered, domain_of, range_of, substituted
from .options import Extra, Setup, is_index
from .psl import Always, Eventually, Formula, Modality
from .psl_parser import instantiate
from .reading import Left, read_properties
from .shape import TooComplex
from .syntax import DeedKind
from .terms import Struct
from .timing import timed
from .tuning import PROPERTIES
from .words import runs, together


@dataclass(frozen=True, slots=True)
class Claim:
    """The result for one guarantee: its properties, or why it is not covered."""

    guarantee: str
    properties: tuple[Property, ...] = ()
    not_covered: str | None = None
    span: Span | None = None
    indices: tuple[str, ...] = ()
    """Index variables with their ranges, in words."""
    settled: tuple[str, ...] = ()
    """Instances that the scenario and the table alone decide, in words."""
    granted: tuple[str, ...] = ()
    """Rows that are true, or false, for every agent."""
    left: tuple[Left, ...] = ()
    """The parts that it forbids and for which a property of the plan stands."""
    hypothesis: str = ""
    """The part of a guarantee about future steps that is not shown."""


@dataclass(frozen=True, slots=True)
class Instantiation:
    claims: tuple[Claim, ...]
    extras: tuple[tuple[Extra, tuple[Property, ...]], ...]
    unused: tuple[str, ...]
    """Rows of the table that covered nothing."""
    words: Mapping[Formula, str] = field(default_factory=dict)
    """The contract's wording for each formula that came from a row."""

    @property
    def properties(self) -> tuple[Property, ...]:
        found = [p for claim in self.claims for p in claim.properties]
        return tuple(found + [p for _, properties in self.extras for p in properties])


def instances(job: Job, setup: Setup) -> Instantiation:
    """All properties of a method, with keys that are unique."""
    scenario = job.system.plan.scenario
    mapper = Mapper(setup.rows, Decider(job), lambda v: range_of(v, setup.instances, scenario))
    keys: set[str] = set()
    claims = tuple(_claim(job.clause(o), mapper, setup, keys) for o in job.obligations)
    extras = tuple((extra, _extra(extra, keys)) for extra in setup.extras)
    unused = tuple(row.text for row in setup.rows if row.text not in mapper.used)
    return Instantiation(claims, extras, unused, dict(mapper.words))


def diagnose(job: Job, setup: Setup, made: Instantiation) -> Iterator[Diagnostic]:
    """Parts that the table and the instances do not cover, and unused rows: warnings, as the rest can be checked."""
    for claim in made.claims:
        if claim.not_covered is not None:
            yield Diagnostic(
                "AJPF130",
                f"guarantee '{claim.guarantee}' is not covered: {claim.not_covered}",
                claim.span,
                Severity.WARNING,
                hint="add a row to the method's predicates, or leave the guarantee to other methods (guarantees: …)",
            )
    granted = {text for claim in made.claims for text in claim.granted}
    for row in setup.rows:
        if row.text in granted and not isinstance(row.formula, psl.Truth):
            message = f"the row “{row.text}” says nothing: its formula is true, or false, of every agent"
            yield Diagnostic("AJPF132", message, row.span, Severity.WARNING)
    for claim in made.claims:
        used = {left.extra for left in claim.left}
        for extra in setup.extras:
            ours = extra.guarantee == claim.guarantee and claim.not_covered is None
            if extra.forbids is not None and ours and extra.name not in used:
                message = f"'{extra.guarantee}' forbids nothing that '{extra.name}' would stand for"
                yield Diagnostic("AJPF131", message, extra.span, Severity.WARNING)
    if all(claim.not_covered is None for claim in made.claims):
        for row in setup.rows:
            if row.text in made.unused:
                yield Diagnostic("AJPF131", f"the row “{row.text}” covers nothing", row.span, Severity.WARNING)
    yield from _left_out(job, setup)
    yield from _unknown_words(job, setup)


def _left_out(job: Job, setup: Setup) -> Iterator[Diagnostic]:
    """The plan's instances that lack part of the scenario's domain."""
    formulas = [job.clause(obligation).formula for obligation in job.obligations]
    bound = (v for f in formulas for t in subterms(f) if isinstance(t, Quantified) for v in t.variables)
    ours: dict[str, Variable] = {}
    for variable in filter(lambda v: is_index(v.sort), bound):
        name = next((n for n in (variable.name, variable.name.rstrip("'")) if n in setup.instances), None)
        if name is not None:
            ours.setdefault(name, variable)
    for name, variable in ours.items():
        domain = domain_of(variable, job.system.plan.scenario) or ()
        missing = sorted(set(domain) - set(setup.instances[name]))
        if missing:
            shown = ", ".join(map(str, missing[:8])) + (", …" if len(missing) > 8 else "")
            yield Diagnostic(
                "AJPF133",
                f"the instances leave out {name} = {shown}, which the scenario has: nothing is checked there",
                job.method.options.at("instances", name),
                Severity.WARNING,
                hint=f"without `{name}` under `instances`, the scenario's domain is taken",
            )


def _claim(clause: Clause, mapper: Mapper, setup: Setup, keys: set[str]) -> Claim:
    try:
        stand_ins = [e for e in setup.extras if e.guarantee == clause.name and e.counts and e.forbids is not None]
        return _instantiate(clause, mapper, stand_ins, keys)
    except NotCovered as error:
        return Claim(clause.name, not_covered=error.reason, span=error.span or clause.span)
    except (TooComplex, RecursionError):
        return Claim(clause.name, not_covered="the formula is too complex to map", span=clause.span)


def _instantiate(clause: Clause, mapper: Mapper, stand_ins: Sequence[Extra], keys: set[str]) -> Claim:
    found: dict[Formula, Property] = {}
    about: dict[Formula, list[str]] = {}
    timing = timed(clause.formula)
    said_now = clause.formula if timing is None else timing.formula
    ranges: dict[str, str] = {}
    settled: list[str] = []
    left: dict[Left, None] = {}
    mapper.expanded.clear()
    mapper.granted.clear()
    end = bound_names(timing.ends) if timing is not None and timing.ends is not None else frozenset[str]()
    for variables, antecedent, consequent in _implications(said_now):
        used = [
            v
            for v in variables
            if is_index(v.sort) and v.name in bound_names(antecedent) | bound_names(consequent) | end
        ]
        others = tuple(v for v in variables if not is_index(v.sort))
        domains = []
        for variable in used:
            values = mapper.range_of(variable)
            if values is None:
                raise NotCovered(f"{variable.name} has no finite range (options: instances)", clause.span)
            ranges[variable.name] = runs(values)
            domains.append(values)
        for choice in product(*domains):
            values_now = dict(zip(used, choice, strict=True))
            label = ", ".join(f"{v.name} = {n}" for v, n in values_now.items())
            left_side, right_side = substituted(antecedent, values_now), substituted(consequent, values_now)
            ending = timing
            if timing is not None and timing.ends is not None:
                ending = replace(timing, ends=substituted(timing.ends, values_now))
            made = list(read_properties(left_side, right_side, others, mapper, stand_ins, ending))
            for item in made:
                if isinstance(item, Left):
                    left[item] = None
                    continue
                if item.trigger == psl.FALSE:
                    settled.append(f"{label or 'the guarantee'}: the scenario and the table rule the trigger out")
                    continue
                formula = item.formula
                found.setdefault(formula, item)
                about.setdefault(formula, [])
                if label and label not in about[formula]:
                    about[formula].append(label)
                if len(found) > PROPERTIES:
                    raise NotCovered(f"more than {PROPERTIES} instances", clause.span)
            if not made:
                settled.append(f"{label or 'the guarantee'}: the scenario and the table alone make it true")
    properties = tuple(
        replace(p, key=_key(clause.name, about[f], keys), about=together(about[f])) for f, p in found.items()
    )
    for name, numbers in mapper.expanded.items():
        ranges.setdefault(name, runs(numbers))
    indices = tuple(f"{name} in {values}" for name, values in ranges.items())
    granted = tuple(sorted(mapper.granted))
    about_it = timing.hypothesis if timing is not None else ""
    return Claim(clause.name, properties, None, clause.span, indices, tuple(settled), granted, tuple(left), about_it)


def _implications(term: Term) -> Iterator[tuple[tuple[Variable, ...], Term, Term]]:
    """The formula as implications under universal quantifiers: (variables, antecedent, consequent)."""
    match term:
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            for inner, left, right in _implications(body):
                yield (*variables, *inner), left, right
        case And(items=items):
            for item in items:
                yield from _implications(item)
        case Implies(left=left, right=right):
            for variables, more, final in _implications(right):
                yield variables, left if more == TRUE else And((left, more)), final
        case _:  # demanded without condition
            yield (), TRUE, term


def _extra(extra: Extra, keys: set[str]) -> tuple[Property, ...]:
    found = []
    for choice in product(*extra.indices.values()):
        values: Mapping[str, int] = dict(zip(extra.indices, choice, strict=True))
        label = ", ".join(f"{n} = {v}" for n, v in values.items())
        formula = instantiate(extra.formula, values)
        trigger, goal = _response(formula)
        found.append(Property(_key(extra.name, [label] if label else [], keys), formula, trigger, goal, label))
    return tuple(found)


def _response(formula: Formula) -> tuple[Formula | None, Formula | None]:
    """Trigger (and goal) of ``[] (H -> …)``, if H has no temporal operator."""
    if isinstance(formula, Always) and isinstance(formula.body, psl.Implies) and not psl.is_temporal(formula.body.left):
        right = formula.body.right
        goal = right.body if isinstance(right, Eventually) and not psl.is_temporal(right.body) else None
        return formula.body.left, goal
    return None, None


def _key(name: str, about: Sequence[str], keys: set[str]) -> str:
    """ASCII, without colons or spaces, as AJPF's property files require."""
    words = [name, *re.findall(r"[0-9]+", about[0] if about else "")]
    base = re.sub(r"[^A-Za-z0-9]+", "_", "_".join(words)).strip("_") or "property"
    key, number = base, 1
    while key in keys:
        number += 1
        key = f"{base}_{number}"
    keys.add(key)
    return key


# Words that neither the program nor the environment has: mostly typing errors. They matter most in prohibitions:
# forbidding what no agent of this program could do shows nothing.

_Word = tuple[str, int]
_KINDS = {
    Modality.BELIEVES: "belief",
    Modality.WANTS: "goal",
    Modality.INTENDS: "goal",
    Modality.INTENDS_TO_DO: "action",
    Modality.DID: "action",
    Modality.PERCEPT: "percept",
}


def _unknown_words(job: Job, setup: Setup) -> Iterator[Diagnostic]:
    """A warning (AJPF134) for each row, property and entry of the environment file that uses such a word; an error
    (AJPF135) where the contract and the environment file do not declare it either."""
    known = _vocabulary(setup)
    contract = _declared(job)
    actions = {*setup.environment.after, *setup.environment.quiet}
    places = [(f"the row “{row.text}”", row.formula, row.span) for row in setup.rows]
    places += [(f"the property '{extra.name}'", extra.formula, extra.span) for extra in setup.extras]
    for what, formula, span in places:
        for atom in dict.fromkeys(psl.atoms(formula)):
            kind = _KINDS[atom.modality]
            if _word(atom.term) not in known[kind]:
                declared = contract | actions if kind == "action" else contract
                yield _unknown(what, _word(atom.term), kind, known[kind], declared, span)
    span = job.method.options.at("environment")
    for action in sorted(actions - {"print"} - {name for name, _ in known["action"]}):
        near = nearest(action, {name for name, _ in known["action"]})
        declared = contract if near else contract | {action}
        yield _unknown(setup.environment_path.name, (action, 0), "action", known["action"], declared, span)


def _declared(job: Job) -> set[str]:
    """The names that the contract has for what a node may do: its ports, and the values of its types."""
    names = {port.name for port in (*job.node.inputs, *job.node.outputs)}
    for _, sort in job.system.contract.types:
        match sort:
            case EnumSort():
                names.update(sort.members)
            case DataSort():
                names.update(constructor.name for constructor in sort.constructors)
    return names


def _vocabulary(setup: Setup) -> dict[str, set[_Word]]:
    programs = setup.programs
    deeds = [deed for program in programs for plan in program.plans for deed in plan.deeds]

    def done(*kinds: DeedKind) -> Iterable[object]:
        return (deed.term for deed in deeds if deed.kind in kinds)

    percepts = _words(fact for _, group in setup.environment.groups for fact in group if fact is not None)
    sent = _words(deed.term.args[2] for deed in deeds if deed.kind is DeedKind.SEND and isinstance(deed.term, Struct))
    sent = sent if len(programs) > 1 else set()  # an agent may believe or want what a message tells it
    sent = {("send", 2)} if any(deed.kind is DeedKind.SEND for deed in deeds) else set()
    heads = (rule.head for program in programs for rule in program.rules)
    beliefs = _words((*(b for program in programs for b in program.beliefs), *heads, *done(DeedKind.ADD_BELIEF)))
    goals = _words((*(goal.term for program in programs for goal in program.goals), *done(DeedKind.ADD_GOAL)))
    actions = _words(done(DeedKind.ACTION)) | sent
    return {"belief": beliefs | percepts | sent, "goal": goals | sent, "action": actions, "percept": percepts}


def _words(terms: Iterable[object]) -> set[_Word]:
    return {_word(term) for term in terms if isinstance(term, Struct)}


def _word(term: Struct) -> _Word:
    return term.functor, len(term.args)


def _shown(word: _Word) -> str:
    name, arity = word
    return f"{name}({', '.join('_' * arity)})" if arity else name


def _unknown(what: str, word: _Word, kind: str, known: set[_Word], declared: set[str], span: Span | None) -> Diagnostic:
    message = f"{what} speaks of the {kind} {_shown(word)}, which neither the program nor the environment ever has"
    names = {name for name, _ in known}
    same = sorted(_shown(other) for other in known if other[0] == word[0])
    # a name of the program alone, beside a declared one, may be a slip of the program
    near = same or nearest(word[0], names - declared if word[0] in declared else names | declared)
    if not near and (word[0] in declared or kind != "action"):
        hint = f"{kind}s that there are: {', '.join(sorted(map(_shown, known))[:12])}" if known else None
        return Diagnostic("AJPF134", message, span, Severity.WARNING, hint=hint)
    hint = f"did you mean `{near[0]}`?" if near else "use a name of the program, the environment or the contract"
    return Diagnostic("AJPF135", message, span, hint=hint)  # a ban of it would hold of any program
