"""What can be read from an English sentence without understanding it: comparisons with numbers, whether it speaks of a
condition one way or both ways, and which words may stand for a name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from fractions import Fraction

from avow.base.records import dataclass
from avow.language.operators import FLIPPED, OPPOSITE

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
_OR_MORE = re.compile(
    rf"(?<![\w.<>=-])(?P<number>{_NUMBER})(?!\d|\.\d)(?P<unit>{_UNIT})\s+or\s+"
    rf"(?:(?P<more>{_MORE}|above|over)|{_LESS}|below|under)(?!\w|\s+than\b|\s+{_NUMBER})",
    re.IGNORECASE,
)
_SPEED = re.compile(r"\b(?:faster|slower)\b", re.IGNORECASE)
_NO_SPEED = re.compile(r"|(?:milli|micro|[µunm])?s|sec|(?:milli|micro)?seconds?|min|minutes?|h|hours?", re.IGNORECASE)
"""A unit of time, or none: ``faster than 2 s`` is less than 2 s, ``faster than 2 m/s`` is more."""
_JUST_BEFORE = re.compile(
    r"(?:\b(?:not|never|cannot)|n't)(?:\s+(?:be|is|goe?s?|gets?|rises?|falls?|drops?|stays?|have|has|comes?|moves?|drives?"
    r"|travels?|runs?|fl(?:y|ies)|turns?|rotates?))?\s*$",
    re.IGNORECASE,
)
_MAY = re.compile(r"\b(?:may|might|allowed|permitted)\b", re.IGNORECASE)
_NEGATION = re.compile(r"\b(?:not|never|no|cannot|nor|without|unless)\b|n't\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Comparison:
    """``less than 25 cm``: the signs that it may mean, and the number. A numeral may be a word (``zero``)."""

    text: str
    signs: frozenset[str]
    number: Fraction
    unit: str
    in_digits: bool


def comparisons(sentence: str) -> Iterator[Comparison]:
    """Every comparison with a number. Near a negation, what is meant may be the opposite; right behind one, it is."""
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
        yield Comparison(text, _meant(signs, sentence[: match.start()], text, unit), number, unit, in_digits)
    for match in _OR_MORE.finditer(sentence):
        text, unit = match[0], match["unit"].strip()
        signs = _meant(frozenset({">=" if match["more"] else "<="}), sentence[: match.start()], text, unit)
        yield Comparison(text, signs, _number(match["number"]), unit, match["number"].lower() not in _WORDS)


def _meant(signs: frozenset[str], before: str, text: str, unit: str) -> frozenset[str]:
    """What these signs may mean in a comparison with these words before it. What may be more than a number where
    something is so, is at most that number elsewhere."""
    if _SPEED.search(text) and _NO_SPEED.fullmatch(unit):
        signs |= {FLIPPED[sign] for sign in signs}
    clause = re.split(r"[.;:,]", before)[-1]
    opposite = frozenset(OPPOSITE[sign] for sign in signs)
    if _JUST_BEFORE.search(clause):
        return opposite
    allowed = signs <= {"<", ">"} and _MAY.search(clause)
    return signs | opposite if allowed or _NEGATION.search(clause) else signs


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
    """Whether it says `if …` (`when …`, `while …`), and nothing that could mean the converse too."""
    return bool(_CONDITION.search(sentence)) and not _PERHAPS_BOTH.search(sentence)


def both_ways(sentence: str) -> str | None:
    """The words with which it says that the converse holds too (``if and only if``, ``exactly when``), if it does."""
    match = _BOTH.search(sentence)
    return match[0] if match else None


# --- names -----------------------------------------------------------------------------------------------------------

_COMMON = frozenset(
    "all and any are can end for has its left may none not off one out say the two was yes".split()  # noqa: SIM905
)
"""English words that stand in sentences without naming anything."""
_EXCEPT = re.compile(
    r"\b(?:no|not|nothing|none|nobody|nowhere|neither|nor|never|other than|unless|except|without|instead|rather"
    r"|avoid\w*|prevent\w*|forbid\w*)\b|n't\b",
    re.IGNORECASE,
)


def mentions(sentence: str, names: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """The words with which the sentence speaks of one of the names as of something that is, each with the name: of
    ``stop`` speak ``stop``, ``stops``, ``stopped`` and ``stopping``, but not an exception (``neither low nor high`` is
    normal). `names` are by their lower-case form; those of one or two letters say nothing."""
    for word in re.finditer(r"[A-Za-z_][\w']*", sentence):
        for stem in _stems(word[0].lower()):
            if stem in names and stem not in _COMMON and len(stem) > 2:
                if not _EXCEPT.search(re.split(r"[.;:]", sentence[: word.start()])[-1]):
                    yield word[0], names[stem]
                break


def _stems(word: str) -> Iterator[str]:
    """What the word may be a form of, itself first."""
    yield word
    for ending in ("s", "es", "d", "ed", "ing"):
        if word.endswith(ending):
            stem = word.removesuffix(ending)
            yield stem
            if ending == "ing":
                yield stem + "e"
            if ending in ("ed", "ing") and stem[-2:-1] == stem[-1:]:
                yield stem[:-1]
