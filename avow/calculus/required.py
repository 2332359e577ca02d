"""The questions behind a plan's requirements."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from avow.base.codec import to_json
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.calculus import chance
from avow.calculus.composition import Composition
from avow.calculus.discharge import Bounds
from avow.calculus.questions import Answer
from avow.calculus.requirements import FormulaQuestion, TemporalQuestion, formula_question, supports, temporal_question
from avow.calculus.variables import Frame, system_term
from avow.evidence.record import COMPOSES, LIKELY_LEAVES
from avow.formulas.formula import digest
from avow.kernel.check import Refused
from avow.system.plan import Requirement
from avow.system.temporal import parse_state


@dataclass(frozen=True, slots=True)
class LikelyQuestion:
    """Does the formula hold with the probability that is asked? `formal` is about the steps at which no guarantee with
    a probability fails (`avow.calculus.chance`)."""

    requirement: Requirement
    formal: FormulaQuestion

    @property
    def text(self) -> str:
        return self.formal.text

    @property
    def digest(self) -> str:
        """It covers the formula with what the guarantees say, and all probabilities."""
        asked, each = self.requirement.probability, chance.leaves(self.formal.likely)
        return sha256(repr((self.formal.digest, asked and asked.words, asked and asked.independent, each)))

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        asked, each = self.requirement.probability, chance.leaves(self.formal.likely)
        assert asked is not None
        if why := unshown(composition.frame, self.requirement):
            return Answer(Verdict.UNKNOWN, why)
        answer = self.formal(composition, bounds)
        frame = composition.frame
        earlier = frame.memory(of=self.requirement.id) or any(edge.delayed for edge in frame.graph.edges)
        if answer.verdict is Verdict.REFUTED and earlier:
            # a guarantee may have failed at an earlier step, which refutes no probability
            text = f"it does not follow at each step at which {', '.join(self.formal.likely)} hold: {answer.summary}"
            return replace(answer, verdict=Verdict.UNKNOWN, summary=text, details={**answer.details, "genuine": False})
        if answer.verdict is not Verdict.PROVED:
            return answer
        shown = chance.text(chance.least(asked, each))
        how = "multiplied, as they fail independently" if asked.independent else "by the union bound"
        made = replace(asked, at_least=shown).words
        summary = f"{made}, {how}, from {chance.made_of(each)}; the rest {answer.summary}"
        details = {**answer.details, LIKELY_LEAVES: to_json(each)}
        if isinstance(of := details.get(COMPOSES), dict):  # a failure of these counts, whatever condition they have
            details[COMPOSES] = {**of, "beyond": [name for name in of["beyond"] if name not in self.formal.likely]}
        return replace(answer, summary=summary, details=details)


def unshown(frame: Frame, requirement: Requirement) -> str:
    """Why the guarantees' probabilities do not give that of the requirement; empty if they do, or if it has none."""
    asked, system = requirement.probability, frame.system
    if asked is None:
        return ""
    found = chance.likely(system, requirement)
    given = chance.condition(system, asked)
    for name, clause in found.items():
        if given is None or clause.chance is None:
            continue
        own = chance.over_system(clause.chance.given, name.partition(".")[0])
        if digest(system_term(frame, own)) != digest(system_term(frame, given)):
            why = "among the steps that meet one condition it may fail more often than among those that meet another"
            return f"{name} has its probability under another condition than the requirement's, {asked.given}: {why}"
    each = chance.leaves(found)
    try:
        shown = chance.least(asked, each)
    except Refused as why:
        return str(why)
    if shown >= Fraction(asked.at_least):
        return ""
    return f"the guarantees give at least {chance.text(shown)}, and {asked.at_least} is asked: {chance.made_of(each)}"


def requirement_question(
    composition: Composition, requirement: Requirement
) -> FormulaQuestion | TemporalQuestion | LikelyQuestion | None:
    """The question for a requirement; None if it is prose. Raises Rejected if a formula is wrong."""
    frame = composition.frame
    if requirement.formula is not None:
        question = replace(formula_question(frame, requirement.id, supports(composition, requirement)), required=True)
        if requirement.probability is None:
            return question
        system = frame.system
        goal = chance.while_kept(
            system,
            replace(requirement, supported_by=()),
            parse_state(requirement.formula, system.contract, requirement.formula_span),
        )
        found = chance.likely(system, requirement)
        return LikelyQuestion(requirement, replace(question, spoken=goal, likely=found))
    if requirement.temporal is not None:
        return temporal_question(frame, requirement.id, requirement.temporal, requirement.formula_span)
    return None
