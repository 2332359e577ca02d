"""English sentences beside formulas that say something else.

A reader trusts the sentence, the tools the formula. Nobody can prove that the two agree, but three ways in which they
often do not can be seen: a comparison the other way round (or with another number), a sentence that goes one way beside
a formula that goes both (or the reverse), and an element that the sentence names and the formula does not.
Each is a hint, with a code of its own; what cannot be seen to differ is left alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.tuning.shown import SENTENCE_CHARACTERS
from avow.base.tuning.sizes import SENTENCE
from avow.language.bounds import bounds, constant
from avow.language.contract import Clause, Node
from avow.language.english import Comparison, both_ways, comparisons, is_one_way, mentions
from avow.language.printer import show_number, show_term
from avow.language.sorts import BOOL, DataSort, EnumSort, components
from avow.language.subterms import subterms
from avow.language.terms import (
    Builtin,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    Iff,
    Implies,
    Literal,
    Operation,
    Quantified,
    Quantifier,
    Term,
    Variable,
)


@dataclass(frozen=True, slots=True)
class Mismatch:
    """One difference between a clause's sentence and its formula."""

    code: str
    message: str
    hint: str


def mismatches(clause: Clause, elements: Mapping[str, str]) -> Iterator[Mismatch]:
    """What the clause's sentence is seen to say otherwise than its formula; `elements` are those of its node."""
    if clause.sentence is not None:
        yield from differences(clause.sentence, clause.written or clause.formula, elements)


def differences(sentence: str, formula: Term, elements: Mapping[str, str]) -> Iterator[Mismatch]:
    """What a sentence is seen to say otherwise than a formula in which these elements could stand."""
    sentence = sentence[:SENTENCE]
    yield from _comparisons(sentence, formula)
    yield from _directions(sentence, formula)
    yield from _elements(sentence, formula, elements)


def elements_of(nodes: Iterable[Node]) -> dict[str, str]:
    """The elements and constructors of the nodes' types, by their names in lower case."""
    sorts = components(*(port.sort for node in nodes for port in (*node.inputs, *node.outputs)))
    names: dict[str, str] = {}
    for sort in sorts:
        match sort:
            case EnumSort(members=members):
                names |= {name.lower(): name for name in members}
            case DataSort(constructors=constructors):
                names |= {c.name.lower(): c.name for c in constructors}
    return names


# --- comparisons -----------------------------------------------------------------------------------------------------

_IN_WORDS = {"<": "less than", "<=": "less than or equal to", ">": "greater than", ">=": "greater than or equal to"}
_SCALES = tuple(Fraction(10) ** k for k in range(-9, 10)) + tuple(
    scale for k in (60, 3600) for scale in (Fraction(k), Fraction(1, k))
)
"""Between a unit of the sentence and that of the contract: powers of ten, minutes, hours."""
_EITHER = "make the two say the same, whichever is meant"


def _comparisons(sentence: str, formula: Term) -> Iterator[Mismatch]:
    said = list(comparisons(sentence))
    if not said:
        return
    found = list(bounds(formula))
    numbers = sorted({n for t in subterms(formula) if (n := constant(t)) is not None})
    for what in said:
        about = [b for b in found if _same(what, b.number)]
        if any(b.may_mean(what.signs) for b in about):
            continue
        if about:
            shown = _short(show_term(about[0].term, "rcl"))
            meaning = f"{_IN_WORDS[about[0].sign]} {_plain(about[0].number)}"
            message = f"the sentence says “{what.text}”, the formula `{shown}`, that is, {meaning}"
            yield Mismatch("RCL413", message, _EITHER)
        elif what.in_digits and what.number not in (0, 1) and not any(_same(what, n) for n in numbers):
            has = ", ".join(f"`{_plain(n)}`" for n in numbers[:6]) or "no number"
            yield Mismatch("RCL413", f"the sentence says “{what.text}”, and the formula has {has}", _EITHER)


def _same(what: Comparison, number: Fraction) -> bool:
    if what.number == number:
        return True
    part = what.number / 100
    if what.unit == "%" and number in (part, 1 - part, 1 + part):
        return True
    return bool(what.unit) and any(what.number * scale == number for scale in _SCALES)


def _plain(number: Fraction) -> str:
    return show_number(number)[0]


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= SENTENCE_CHARACTERS else f"{text[: SENTENCE_CHARACTERS - 1]}…"


# --- one way or both -------------------------------------------------------------------------------------------------


def _directions(sentence: str, formula: Term) -> Iterator[Mismatch]:
    core = formula
    while isinstance(core, Quantified) and core.quantifier is Quantifier.FORALL:
        core = core.body
    if isinstance(core, Iff) and is_one_way(sentence):
        yield Mismatch(
            "RCL414",
            "the sentence goes one way (if …, then …), the formula both ways (`<=>`)",
            "write `->`, or say in the sentence that it is so exactly then",
        )
    words = both_ways(sentence)
    if words and isinstance(core, Implies) and not any(map(_is_both_ways, subterms(core))):
        yield Mismatch(
            "RCL414",
            f"the sentence goes both ways (“{words}”), the formula one way (`->`)",
            f"write `<=>`, or leave “{words}” out of the sentence",
        )


def _is_both_ways(term: Term) -> bool:
    match term:
        case Iff() | Conditional() | Operation(operator=Builtin.XOR) | Quantified(quantifier=Quantifier.UNIQUE):
            return True
        case Compare(operator="==" | "!=", left=left, right=right):  # ``done == TRUE`` is another way to write `done`
            return left.sort == BOOL and not isinstance(left, Literal) and not isinstance(right, Literal)
    return False


# --- elements --------------------------------------------------------------------------------------------------------


def _elements(sentence: str, formula: Term, elements: Mapping[str, str]) -> Iterator[Mismatch]:
    said = dict[str, str]()
    for word, name in mentions(sentence, elements):
        said.setdefault(name, word)
    spoken = [name.lower() for name in _names_in(formula) if len(name) > 2] if said else []
    for name, word in said.items():
        if not any(o.startswith(name.lower()) or word.lower().startswith(o) for o in spoken):
            yield Mismatch(
                "RCL415",
                f"the sentence says “{word}”, and the formula does not speak of `{name}`",
                "say it in the formula too, or leave it out of the sentence",
            )


def _names_in(formula: Term) -> Iterator[str]:
    for part in subterms(formula):
        match part:
            case EnumValue(name=name) | Variable(name=name) | Construct(constructor=name):
                yield name
