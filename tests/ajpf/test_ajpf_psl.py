"""Properties: what we print means to AJPF what we mean; what a person writes is read as AJPF reads it, or refused."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backends.ajpf.psl import (
    FALSE,
    TRUE,
    Always,
    And,
    Atom,
    Eventually,
    Implies,
    Modality,
    Not,
    Or,
    Release,
    Until,
    show,
)
from avow.backends.ajpf.psl_parser import Malformed, instantiate, parse_psl
from avow.backends.ajpf.terms import Struct, Var

P, Q, R = (Atom(Modality.BELIEVES, "ag", Struct(name)) for name in "pqr")


class AsAjpf:
    """Reads a property as AJPF's own grammar does, traps included: its precedences, and one `[]`, `<>`, `~` each at a
    place, further ones being lost."""

    def __init__(self, text: str) -> None:
        self.tokens = re.findall(
            r"\[\]|<>|->|\|\||[~&()]|\b[UR]\b|[TF]\b|(?:ItD|[BGIDP])\((?:[^()]|\([^()]*\))*\)", text
        )
        self.at = 0

    def now(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def accept(self, token):
        if self.now() == token:
            self.at += 1
            return True
        return False

    def level(self, operator, below, make):
        items = [below()]
        while self.accept(operator):
            items.append(below())
        if len(items) == 1:
            return items[0]
        if make in (And, Or):
            return make(tuple(items))
        result = items[0]
        for item in items[1:]:
            result = make(result, item)
        return result

    def property(self):
        return self.level("U", self.release, Until)

    def release(self):
        return self.level("R", self.implication, Release)

    def implication(self):
        return self.level("->", self.conjunction, Implies)

    def conjunction(self):
        return self.level("&", self.disjunction, And)

    def disjunction(self):
        return self.level("||", self.always, Or)

    def always(self):
        return Always(self.finally_()) if self.accept("[]") else self.finally_()

    def finally_(self):
        return Eventually(self.not_()) if self.accept("<>") else self.not_()

    def not_(self):
        return Not(self.atom()) if self.accept("~") else self.atom()

    def atom(self):
        while self.now() in ("[]", "<>", "~"):
            self.at += 1  # lost
        if self.accept("("):
            inner = self.property()
            assert self.accept(")")
            return inner
        token = self.now()
        self.at += 1
        return {"T": TRUE, "F": FALSE}.get(token) or parse_psl(token)

    def read(self):
        found = self.property()
        assert self.at == len(self.tokens), "trailing text"
        return found


TERMS = st.recursive(
    st.one_of(st.sampled_from([Struct("door"), Struct("3"), Struct("0.5"), Var("_")])),
    lambda inner: st.builds(lambda args: Struct("f", tuple(args)), st.lists(inner, min_size=1, max_size=3)),
    max_leaves=3,
)
FACTS = st.builds(lambda args: Struct("fact", tuple(args)), st.lists(TERMS, max_size=2))
ATOMS = st.one_of(
    st.builds(
        lambda m, t: Atom(m, "ag", t), st.sampled_from([m for m in Modality if m is not Modality.PERCEPT]), FACTS
    ),
    st.builds(lambda t: Atom(Modality.PERCEPT, "", t), FACTS),
)
SIMPLE = st.sampled_from([P, Q, R, TRUE, FALSE])


def formulas(leaves):
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.builds(Not, inner),
            st.builds(Always, inner),
            st.builds(Eventually, inner),
            st.builds(lambda items: And(tuple(items)), st.lists(inner, min_size=2, max_size=3)),
            st.builds(lambda items: Or(tuple(items)), st.lists(inner, min_size=2, max_size=3)),
            st.builds(Implies, inner, inner),
            st.builds(Until, inner, inner),
            st.builds(Release, inner, inner),
        ),
        max_leaves=8,
    )


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(formulas(ATOMS))
def test_what_is_printed_is_read_back(formula):
    assert parse_psl(show(formula)) == formula


@settings(max_examples=200, deadline=None)
@given(formulas(SIMPLE))
def test_ajpf_reads_what_is_meant(formula):
    assert AsAjpf(show(formula)).read() == formula


@pytest.mark.parametrize(
    "text",
    ["<>[] B(ag, p)", "[] [] B(ag, p)", "~~B(ag, p)", "~[]B(ag, p)", "<><> B(ag, p)", "~<>B(ag, p)"],
)
def test_lost_operators_are_refused(text):
    with pytest.raises(Malformed, match="loses an operator"):
        parse_psl(text)
    assert show(AsAjpf(text).read()).count("[") < text.count("[") or text.count("[") == 0  # AJPF really loses it


@pytest.mark.parametrize(
    "text",
    [
        "B(ag, p) & B(ag, q) || B(ag, r)",
        "B(ag, p) -> B(ag, q) -> B(ag, r)",
        "B(ag, p) U B(ag, q) U B(ag, r)",
        "B(ag, p) & B(ag, q) -> B(ag, r)",
    ],
)
def test_mixtures_are_refused(text):
    with pytest.raises(Malformed, match="say which is meant"):
        parse_psl(text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "B(ag)",
        "B(ag, p",
        "B(ag, p))",
        "B(A, p)",
        "B(Ag, p)",
        "B(ag, X)",
        "B(ag, p(X))",
        "B(ag, p(-1))",
        "B(ag, 3)",
        "B(ag, _)",
        "X B(ag, p)",
        "B(ag, p) | B(ag, q)",
        "!B(ag, p)",
        "B(ag, p) <-> B(ag, q)",
        "B(ag, p) # c",
        "B(ag, p):",
        'B(ag, "p")',
        "B(ag, é)",
        "~ " * 5000 + "T",
        "B(ag, p(i + x))",
        "B(ag, p\n",
    ],
)
def test_other_texts_are_refused(text):
    with pytest.raises(Malformed):
        parse_psl(text)


def test_unary_operators_bind_tightest_as_people_expect():
    assert parse_psl("[] B(ag, p) -> <> B(ag, q)") == Implies(Always(P), Eventually(Q))
    assert parse_psl("[]<>~B(ag, p)") == Always(Eventually(Not(P)))


def test_indices():
    formula = parse_psl("B(ag, at(i)) & D(ag, move(i + 1, _)) & B(ag, old(i - 1))")
    assert show(instantiate(formula, {"i": 4})) == "B(ag, at(4)) & D(ag, move(5, _)) & B(ag, old(3))"
    with pytest.raises(Malformed):
        instantiate(formula, {"i": 0})
    with pytest.raises(Malformed):
        instantiate(formula, {})


def test_every_line_of_a_property_file_is_ascii_and_one_key(lift):
    from avow.backends.ajpf import BACKEND

    text = BACKEND.export(lift())["cabin.psl"]
    assert text.isascii()
    for line in text.splitlines():
        assert line.startswith("#") or re.fullmatch(r"[A-Za-z0-9_]+: [^:]+", line)
