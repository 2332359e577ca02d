"""The plan's statements, in plain words, about everything assumed without being shown: reading, and reporting missing
ones; and requirements whose sentence contradicts their formula: the sentence is what an assessor reads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.persons import unreadable, wrong_day
from avow.base.plain import identifiers, is_blank
from avow.base.tuning.sizes import STATEMENT_WORDS
from avow.language.contract import Contract
from avow.system.plan import Plan, Statement, System
from avow.system.strict_yaml import Piece
from avow.system.temporal import written_state

GENERAL = {
    "assumptions.platform.execution": "Hardware, operating system, compilers and transport do what is expected of them",
    "assumptions.models.fidelity": "What runs does what its model does",
    "assumptions.samples.representative": "Cases that were not tried are like those that were",
    "assumptions.samples.recordings": "What is recorded is what the programs and settings of today do",
    "assumptions.platform.start": "Each delayed input begins with the first value that the plan gives",
    "assumptions.platform.reaction": "All nodes step together: each answers in time, and a reaction takes no time",
    "assumptions.tools.trusted": "The tools that answered, and the trusted base, answer rightly",
}
"""The basis of any evidence of a kind: the place of the plan where a person answers for it, and its words."""
_ARGUMENTS = {"persistence": "persistence", "one_output": "one-output", "entered": "entered"}


def read_statements(root: Piece) -> tuple[tuple[Statement, ...], list[Diagnostic]]:
    """Every statement of a well-shaped plan, and the faults in their words and dates. An entry that assumes nothing is
    one, of no place, if it has a last day: then its reason has to be read again."""
    faults: list[Diagnostic] = []
    found = [_statement(*each, faults) for each in _places(root)]
    return tuple(each for each in found if each.place or each.until), faults


def without_words(system: System) -> Iterator[Diagnostic]:
    """A warning for each assumption of this plan that has no words for a reader who does not know the contract."""
    for statement in system.plan.statements:
        told = statement.says or _has_fixed_words(statement.place)
        if not told and statement.span is not None and _own(statement, system.plan):
            hint = f"add  says: …  (at most {STATEMENT_WORDS} words), and  who: …, until: …"
            if not statement.because and statement.place.startswith("environment."):  # `constant: true`
                hint = "it needs a reason of its own: write  constant: {because: …, says: …, who: …, until: …}"
            message = f"{statement.keys}: no plain words yet"
            yield Diagnostic("PLAN128", message, statement.span, Severity.WARNING, hint)


def expired(system: System) -> Iterator[Diagnostic]:
    """A warning for each assumption and each accepted finding of this plan whose last day has passed."""
    dated = [(s.keys, "until", s.until, s.until_span) for s in system.plan.statements if _own(s, system.plan)]
    dated += [(f"accepted {f.obligation}", "expires", f.expires or "", f.span) for f in system.plan.accepted]
    for what, key, last, span in dated:
        if "" < last < datetime.now().astimezone().date().isoformat():
            text = f"{what} has expired: its last day was {last}"
            hint = f"decide whether it still holds, and give a new day: {key}: …"
            yield Diagnostic("PLAN138", text, span, Severity.WARNING, hint)


def not_validated(system: System) -> Iterator[Diagnostic]:
    """A warning for each requirement whose current sentence has not been read against its current formula."""
    for requirement in system.plan.requirements:
        if not requirement.validated:
            read = requirement.validation
            why = (
                f"{read.who} read another sentence, or another formula or support, on {read.date}"
                if read is not None and read.sentence
                else "nobody has read its sentence against its formula"
            )
            yield Diagnostic(
                "PLAN129",
                f"requirements.{requirement.id}: {why}",
                requirement.span,
                Severity.WARNING,
                hint=f'read both, then: avow validate {system.name} {requirement.id} --as "YOUR NAME"',
            )


def requirement_sentences(system: System) -> Iterator[Diagnostic]:
    """The lints RCL413 to RCL415 for the plan's requirements that have a formula."""
    from avow.language.sentences import elements_of  # not needed to load a plan

    elements = elements_of(system.contract.nodes)
    for requirement in system.plan.requirements:
        if requirement.formula is not None:
            yield from said_otherwise(
                requirement.text, requirement.formula, system.contract, elements, requirement.span
            )


def said_otherwise(
    text: str, formula: str, contract: Contract, elements: Mapping[str, str], span: Span | None
) -> Iterator[Diagnostic]:
    """The contradictions between a requirement's sentence and its formula; `elements` are the contract's
    (`elements_of`). Raises Rejected if that is not a formula."""
    from avow.language.sentences import differences

    for found in differences(text, written_state(formula, contract, span, clause=True), elements):
        yield Diagnostic(found.code, found.message, span, Severity.WARNING, found.hint)


def wrong_words(place: str, piece: Piece) -> Iterator[Diagnostic]:
    """The faults in the persons, reasons and days of an entry."""
    for key in ("who", "says", "because", "reason", "date", "until", "expires"):
        part = piece.at(key)
        if part is None:
            continue
        text = " ".join(part.text.split())
        if key == "says":
            yield from _not_plain(place, text, part.span)
        if key == "who":
            wrong = f"{text!r} names no person: {why}" if (why := unreadable(text)) else ""
        elif key in ("says", "because", "reason"):
            wrong = f"{key} is blank" if is_blank(text) else ""
        else:
            wrong = wrong_day(text, past=key == "date")
        if not wrong and key in ("until", "expires") and (begun := piece.at("date")) is not None and text < begun.text:
            wrong = f"{key} is before the date of the entry"
        if wrong:
            yield Diagnostic("PLAN105", f"{place}: {wrong}", part.span)


def _not_plain(place: str, text: str, span: Span) -> Iterator[Diagnostic]:
    number = len(text.split())
    if number > STATEMENT_WORDS:
        message = f"{place}: says has {number} words; at most {STATEMENT_WORDS} fit a report's first screen"
        yield Diagnostic("PLAN115", message, span, hint="the whole reason is for  because")
    if names := identifiers(text):
        message = f"{place}: says is for readers who do not know the contract, but names {', '.join(names)}"
        yield Diagnostic("PLAN115", message, span, hint="say it in words")


def _has_fixed_words(place: str) -> bool:
    """Whether the statement at a place has the same words in every plan, or needs none."""
    return not place or place.startswith("requirements.") or place in GENERAL


def _own(statement: Statement, plan: Plan) -> bool:
    return statement.span is not None and statement.span.file == str(plan.path)


def _places(root: Piece) -> Iterator[tuple[str, str, Piece]]:
    """Each statement's name, its keys in the plan, and its entry."""
    for port, _, piece in root.keyed("environment"):
        constant = piece.at("constant")
        holds = constant is not None and constant.value is not False
        name = f"environment.{port}"
        yield name if piece.at("assume") is not None or holds else "", name, piece
        if piece.at("assume") is not None and constant is not None and holds:
            yield f"{name}.constant", f"{name}.constant", constant  # constancy is a separate statement
    for section in ("compose", "subsystems"):
        for goal, _, piece in root.keyed(section):
            for key, name in _ARGUMENTS.items():
                argument = piece.at(key)
                if argument is not None:
                    yield f"{goal}.{name}", f"{section}.{goal}.{key}", argument
    for name, _, piece in root.keyed("assumptions"):
        yield f"assumptions.{name}", f"assumptions.{name}", piece
    for name, _, piece in root.keyed("requirements"):
        validation = piece.at("validation")
        if validation is not None:
            yield f"requirements.{name}.validation", f"requirements.{name}.validation", validation


def _statement(place: str, keys: str, piece: Piece, faults: list[Diagnostic]) -> Statement:
    texts = piece.words()
    faults += wrong_words(keys, piece)
    words = {key: texts.get(key, "") for key in ("says", "because", "who", "until", "date")}
    ends = piece.at("until")
    return Statement(place, span=piece.span, until_span=ends.span if ends is not None else None, keys=keys, **words)
