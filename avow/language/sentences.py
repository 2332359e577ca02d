"""Detects English sentences that disagree with their formulas.

Readers trust the sentence, the tools the formula. Their agreement cannot be proved, but three common differences can be
detected: a reversed comparison (or another number), an implication beside an equivalence, and an element that the
sentence names and the formula does not. Each is a hint with its own code; other differences are not reported.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.tuning.shown import SENTENCE_CHARACTERS
from avow.base.tuning.sizes import SENTENCE
from avow.language import terms as t
from avow.language.bounds import bounds, constant
from avow.language.contract import Clause, Node
from avow.language.operators import FLIPPED, OPPOSITE
from avow.language.printer import show_number, show_term
from avow.language.sorts import BOOL, DataSort, EnumSort, components
from avow.language.subterms import subterms


@dataclass(frozen=True, slots=True)
class Mismatch:
    """One difference between a clause's sentence and its formula."""

    code: str
    message: str
    hint: str


def mismatches(clause: Clause, elements: Mapping[str, str]) -> Iterator[Mismatch]:
    """The detected differences between the clause's sentence and its formula; `elements` are those of its node."""
    if clause.sentence is not None:
        yield from differences(clause.sentence, clause.written or clause.formula, elements)


def differences(sentence: str, formula: t.Term, elements: Mapping[str, str]) -> Iterator[Mismatch]:
    """The detected differences between a sentence and a formula in which these elements may occur."""
    sentence = sentence[:SENTENCE]
    yield from _comparisons(sentence, formula)
    yield from _directions(sentence, formula)
    yield from _elements(sentence, formula, elements)


def elements_of(nodes: Iterable[Node]) -> dict[str, str]:
    """The elements and constructors of the nodes' types, by lower-case words: an element's name, as its forms may be
    ordinary verbs (`sprays` beside the mode `spray`), and the forms of a constructor, as of a verb with its objects."""
    sorts = components(*(port.sort for node in nodes for port in (*node.inputs, *node.outputs)))
    names: dict[str, str] = {}
    for sort in sorts:
        match sort:
            case EnumSort(members=members):
                names |= {name.lower(): name for name in members}
            case DataSort(constructors=constructors):
                names |= {form: c.name for c in constructors for form in _forms(c.name.lower())}
    return names


def _forms(verb: str) -> Iterator[str]:
    """``stop``, ``stops``, ``stopped``, ``stopping``, ``moving``."""
    yield from (verb, f"{verb.removesuffix('e')}ing")
    yield from (f"{verb}{double}{ending}" for double in ("", verb[-1:]) for ending in ("s", "es", "d", "ed", "ing"))


# --- comparisons -----------------------------------------------------------------------------------------------------

_IN_WORDS = {"<": "less than", "<=": "less than or equal to", ">": "greater than", ">=": "greater than or equal to"}
_SCALES = tuple(Fraction(10) ** k for k in range(-9, 10)) + tuple(
    scale for k in (60, 3600) for scale in (Fraction(k), Fraction(1, k))
)
"""Factors between a unit of the sentence and that of the contract: powers of ten, minutes, hours."""
_EITHER = "make the two say the same, whichever is meant"


def _comparisons(sentence: str, formula: t.Term) -> Iterator[Mismatch]:
    said = list(comparisons(sentence))
    if not said:
        return
    found = list(bounds(formula))
    numbers = sorted({n for term in subterms(formula) if (n := constant(term)) is not None})
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


def _directions(sentence: str, formula: t.Term) -> Iterator[Mismatch]:
    core = formula
    while isinstance(core, t.Quantified) and core.quantifier is t.Quantifier.FORALL:
        core = core.body
    if isinstance(core, t.Iff) and is_one_way(sentence):
        yield Mismatch(
            "RCL414",
            "the sentence goes one way (if …, then …), the formula both ways (`<=>`)",
            "write `->`, or say in the sentence that it is so exactly then",
        )
    words = both_ways(sentence)
    if words and isinstance(core, t.Implies) and not any(map(_is_both_ways, subterms(core))):
        yield Mismatch(
            "RCL414",
            f"the sentence goes both ways (“{words}”), the formula one way (`->`)",
            f"write `<=>`, or leave “{words}” out of the sentence",
        )


def _is_both_ways(term: t.Term) -> bool:
    match term:
        case (
            t.Iff()
            | t.Conditional()
            | t.Operation(operator=t.Builtin.XOR)
            | t.Quantified(quantifier=t.Quantifier.UNIQUE)
        ):
            return True
        case t.Compare(operator="==" | "!=", left=left, right=right):  # ``done == TRUE`` is another form of `done`
            return left.sort == BOOL and not isinstance(left, t.Literal) and not isinstance(right, t.Literal)
    return False


# --- elements --------------------------------------------------------------------------------------------------------


def _elements(sentence: str, formula: t.Term, elements: Mapping[str, str]) -> Iterator[Mismatch]:
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


def _names_in(formula: t.Term) -> Iterator[str]:
    for part in subterms(formula):
        match part:
            case t.EnumValue(name=name) | t.Variable(name=name) | t.Construct(constructor=name):
                yield name


# --- what can be read from a sentence without understanding it --------------------------------------------------------

_LESS = r"(?:less|fewer|smaller|lower|shorter|earlier|sooner|closer|nearer|slower|colder|cooler|lighter)"
_MORE = r"(?:greater|more|larger|higher|longer|bigger|later|farther|further|faster|hotter|warmer|heavier)"
_PHRASES = (
    ("<=", rf"{_LESS} than or equals? to|no {_MORE} than|at most|not exceed(?:ing|s)?|never exceeds?|<=|≤"),
    (">=", rf"{_MORE} than or equals? to|no {_LESS} than|at least|>=|≥"),
    ("<", rf"{_LESS} than|below|under|<"),
    (">", rf"{_MORE} than|above|exceed(?:s|ing)?|beyond|over|>"),
    ("up to", r"up to|within"),
    ("between", r"between"),
)
_WORDS = {w: n for n, w in enumerate(("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"))}
_NUMBER = rf"(?:[-−]?\d+(?:\.\d+)?|(?:{'|'.join(_WORDS)})\b)"
_UNIT = (
    r"(?:\s?(?:%|percent|°c?|deg|degrees?|[mcdk]?m|(?:milli|centi|kilo)?met(?:er|re)s?|[µunm]?s|sec|(?:milli|micro)?seconds?"
    r"|min|minutes?|h|hours?|[kmg]?hz|[mk]?v|volts?|m?a|amps?|[mk]?w|watts?|k?j|[km]?n|newtons?|nm|[km]?pa|m?bar|psi|k|kelvin"
    r"|celsius|[mk]?g|(?:kilo)?grams?|m?l|lit(?:er|re)s?|m?rad|rpm|[mµ]?sv|m?gy|bq|lux|lx|dbm?|ppm|bytes?|[kmg]b)"
    r"(?:\s?/\s?(?:min|ms|s|h))?(?![\w%]))?"
)
_COMPARISON = re.compile(
    rf"(?<![\w<>=])(?:{'|'.join(f'(?P<o{i}>{text})' for i, (_, text) in enumerate(_PHRASES))})"
    rf"\s*(?P<number>{_NUMBER})(?!\d|\.\d)(?P<unit>{_UNIT})(?!\w)(?:\s*and\s+(?P<second>{_NUMBER}))?",
    re.IGNORECASE,
)
_NEGATION = re.compile(
    r"\b(?:not|never|no|cannot|nor|without|unless|may|might|allowed|permitted)\b|n't\b", re.IGNORECASE
)
_SPEED = re.compile(r"\b(?:faster|slower)\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Comparison:
    """``less than 25 cm``: the possible signs, and the number. A numeral may be a word (``zero``)."""

    text: str
    signs: frozenset[str]
    number: Fraction
    unit: str
    in_digits: bool


def comparisons(sentence: str) -> Iterator[Comparison]:
    """Every comparison with a number."""
    for match in _COMPARISON.finditer(sentence):
        kind = next(_PHRASES[i][0] for i in range(len(_PHRASES)) if match.group(f"o{i}"))
        number, unit = _number(match["number"]), match["unit"].strip()
        in_digits = match["number"].lower() not in _WORDS
        if kind == "between" or (kind == "up to" and match["second"] is not None):  # “within 3 and 5”
            if match["second"] is not None:
                yield Comparison(match[0], frozenset({">", ">="}), number, unit, in_digits)
                yield Comparison(match[0], frozenset({"<", "<="}), _number(match["second"]), unit, in_digits)
            continue
        text = sentence[match.start() : match.end("unit")].strip()
        signs = frozenset({"<", "<="} if kind == "up to" else {kind})
        yield Comparison(text, _meant(signs, sentence[: match.start()], text), number, unit, in_digits)


def _meant(signs: frozenset[str], before: str, text: str) -> frozenset[str]:
    """The possible signs of a comparison, given the words before it: near a negation or permission also the opposite,
    for a speed also the reverse (``faster than 2 s`` is less than 2 s)."""
    if _SPEED.search(text):
        signs |= {FLIPPED[sign] for sign in signs}
    unsure = _NEGATION.search(re.split(r"[.;:,]", before)[-1])
    return signs | {OPPOSITE[sign] for sign in signs} if unsure else signs


def _number(text: str) -> Fraction:
    word = text.lower()
    return Fraction(_WORDS[word]) if word in _WORDS else Fraction(text.replace("−", "-"))


# --- conditions ------------------------------------------------------------------------------------------------------

_CONDITION = re.compile(r"\b(?:if|when|whenever|while|once|provided|as (?:soon|long) as|in case)\b", re.IGNORECASE)
_BOTH = re.compile(
    r"\b(?:if,? and only if|iff|when,? and only when|(?:exactly|precisely|just) (?:if|when|while|then))\b",
    re.IGNORECASE,
)
_PERHAPS_BOTH = re.compile(
    r"\b(?:only|exactly|precisely|iff|otherwise|else|unless|equals?|equivalent|same|vice versa|conversely|except"
    r"|no other|not? (?:\w+ ){0,2}other\w*|until|just)\b",
    re.IGNORECASE,
)


def is_one_way(sentence: str) -> bool:
    """Whether the sentence has `if …` (`when …`, `while …`), and nothing that could express the converse too."""
    return bool(_CONDITION.search(sentence)) and not _PERHAPS_BOTH.search(sentence)


def both_ways(sentence: str) -> str | None:
    """The words that state the converse too (``if and only if``, ``exactly when``), if any."""
    match = _BOTH.search(sentence)
    return match[0] if match else None


# --- names -----------------------------------------------------------------------------------------------------------

_COMMON = frozenset(
    "all and any are can end for has its left may none not off one out say the two was yes".split()  # noqa: SIM905
)
"""English words that are common in sentences and do not name an element."""
_EXCEPT = re.compile(
    r"\b(?:no|not|nothing|none|nobody|nowhere|neither|nor|never|other than|unless|except|without|instead|rather"
    r"|avoid\w*|prevent\w*|forbid\w*)\b|n't\b",
    re.IGNORECASE,
)


def mentions(sentence: str, names: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """The words by which the sentence mentions one of the names affirmatively, each with the name; not in an exception
    (``neither low nor high`` is normal). `names` maps lower-case forms to names; those of one or two letters are
    ignored."""
    for word in re.finditer(r"[A-Za-z_][\w']*", sentence):
        name = names.get(word[0].lower(), "")
        before = re.split(r"[.;:]", sentence[: word.start()])[-1]
        if len(name) > 2 and name.lower() not in _COMMON and not _EXCEPT.search(before):
            yield word[0], name
