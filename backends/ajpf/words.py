"""A run of the agent in the contract's own words, through the plan's table read backwards.

Each row of the table says which agent formula stands for which contract formula. So a step of a run is described by the
rows that hold in it: a column for each row, with the indices for which it holds. The agent's beliefs are beside it,
under names in parentheses: reports print those small.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, assert_never

from avow.base.verdict import Counterexample
from avow.formulas.lasso import Lasso

from . import psl
from .checker import Property, label_states
from .explore import Graph, System
from .mapping import Row
from .psl import Always, Atom, Eventually, Formula, Implies, Release, Until, compiled
from .psl_parser import Malformed, index_names, instantiate
from .terms import Struct, Term, show, subterms
from .tuning import INDICES_TRIED

Step = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Wording:
    """`rows` is the plan's table; `told` the meaning of each formula from it, as found in the contract; `indices` the
    values that the plan gives to index variables."""

    rows: Sequence[Row]
    told: Mapping[Formula, str]
    indices: Mapping[str, Sequence[int]] = field(default_factory=dict)

    def say(self, formula: Formula) -> str:
        """A formula without temporal operators in the contract's words; uncovered parts stay in the agent's."""
        known = self.told.get(formula)
        if known is not None:
            return known
        match formula:
            case psl.Truth(value=value):
                return "always" if value else "never"
            case psl.Not(body=body):
                return f"¬({self.say(body)})"
            case psl.And(items=items):
                return " ∧ ".join(self._junction(items, psl.And))
            case psl.Or(items=items):
                return " ∨ ".join(f"({part})" if " ∧ " in part else part for part in self._junction(items, psl.Or))
            case Atom() | Implies() | Always() | Eventually() | Until() | Release():  # one part
                return self._part_of(formula)
            case _:
                assert_never(formula)

    def _junction(self, items: Sequence[Formula], kind: type[psl.And] | type[psl.Or]) -> Iterator[str]:
        """One row may stand for several items: the rows that cover most come first."""
        rest = list(items)
        whole = [f for f in self.told if isinstance(f, kind) and set(f.items) <= set(rest)]
        for formula in sorted(whole, key=lambda f: -len(f.items)):
            if set(formula.items) <= set(rest):
                yield self.told[formula]
                rest = [item for item in rest if item not in formula.items]
        for item in rest:
            text = self.say(item)
            yield f"({text})" if kind is psl.And and " ∨ " in text else text

    def _part_of(self, formula: Formula) -> str:
        """One of the alternatives that a row stands for: the row, and which of them it is."""
        row = next((f for f in self.told if isinstance(f, psl.Or) and formula in f.items), None)
        shown = psl.show(formula)
        return shown if row is None else f"{self.told[row]} (here {shown})"


def explain(graph: Graph, lasso: Lasso, refuted: Property, wording: Wording) -> Counterexample:
    """The run on which a property fails: step by step the contract's columns, then the agent's beliefs."""
    visited = [graph.states[number] for number in lasso.path]
    rows = _contract_cells(graph, visited, wording)
    trace: list[Step] = []
    places: list[int] = []
    loop: int | None = None
    for at, state in enumerate(visited):
        shown = (*rows[at], *_agent_cells(graph.system, state))
        if at == lasso.loop:
            loop = len(trace)
        elif trace and trace[-1] == shown and (loop is None or loop < len(trace)):
            places.append(len(trace) - 1)
            continue
        places.append(len(trace))
        trace.append(shown)
    name, equals, value = refuted.about.partition(" = ")
    values = ({name: value} if equals else {}) | {"(property)": psl.show(refuted.formula)}
    return Counterexample(tuple(values.items()), _because(graph, visited, places, refuted, wording), tuple(trace), loop)


def _because(graph: Graph, visited: Sequence[Any], places: Sequence[int], refuted: Property, wording: Wording) -> str:
    trigger, goal, forbidden = refuted.trigger, refuted.goal, refuted.forbidden
    if trigger is None:
        return "the property fails on this run"
    meant = _where(graph, visited, trigger)
    if forbidden is not None:
        at = next(iter(meant), None)
        came = next((to for to in _where(graph, visited, forbidden) if at is not None and to >= at), None)
        met = f"in step {_step(places, at)}: {wording.say(trigger)}"
        when = "demanded whatever happens" if trigger == psl.TRUE else met
        return f"{when}; what is then forbidden comes in step {_step(places, came)}: {wording.say(forbidden)}"
    if goal is None:
        return f"in step {_step(places, next(iter(meant), None))}: {wording.say(trigger)}; this must never be"
    if trigger == psl.TRUE:
        return f"demanded whatever happens, and never so on this run: {wording.say(goal)}"
    last = max(_where(graph, visited, goal), default=-1)
    step = _step(places, next((at for at in meant if at > last), None))
    return f"in step {step}: {wording.say(trigger)}; what must follow never does: {wording.say(goal)}"


def _where(graph: Graph, visited: Sequence[Any], formula: Formula) -> list[int]:
    """The indices of the states in which a formula without temporal operators holds."""
    atoms = tuple(dict.fromkeys(psl.atoms(formula)))
    test = compiled(formula, {atom: at for at, atom in enumerate(atoms)})
    return [at for at, label in enumerate(label_states(graph.system, visited, atoms)) if test(label)]


def _step(places: Sequence[int], at: int | None) -> str:
    return "?" if at is None else str(places[at])


def _contract_cells(graph: Graph, visited: Sequence[Any], wording: Wording) -> list[Step]:
    """For each state and each row that ever holds: ``i = 1, 2``, or ``yes`` if the row has no index. If two rows are
    opposites throughout, only the first is shown."""
    numbers = _numbers(graph, visited)
    tried: list[tuple[Row, dict[str, int], Formula]] = []
    for row in wording.rows:
        tried += [(row, values, made) for values, made in _instances(row, wording.indices, numbers)]
    atoms = tuple(dict.fromkeys(a for _, _, formula in tried for a in psl.atoms(formula)))
    places = {atom: at for at, atom in enumerate(atoms)}
    tests = [(row, values, compiled(formula, places)) for row, values, formula in tried]
    cells: dict[str, list[str]] = {}
    opposites: set[tuple[str, ...]] = set()
    labels = label_states(graph.system, visited, atoms)
    for row in wording.rows:
        mine = [(values, test) for of, values, test in tests if of is row]
        column = [_cell([values for values, test in mine if test(label)]) for label in labels]
        if set(column) - {"no"} and tuple(column) not in opposites:
            cells[row.say({})] = column
            opposites.add(tuple(_OPPOSITE.get(cell, "") for cell in column))
    return [tuple((name, column[at]) for name, column in cells.items()) for at in range(len(visited))]


_OPPOSITE = {"yes": "no", "no": "yes"}


def _cell(holds_for: Sequence[Mapping[str, int]]) -> str:
    if not holds_for:
        return "no"
    names = list(holds_for[0])
    if len(names) == 1:
        return f"{names[0]} = {runs([values[names[0]] for values in holds_for])}"
    return "; ".join(", ".join(f"{n} = {v}" for n, v in values.items()) for values in holds_for) or "yes"


def runs(numbers: Iterable[int]) -> str:
    """``1, 2, 5…9``"""
    groups: list[list[int]] = []
    for n in sorted(numbers):
        if groups and groups[-1][-1] == n - 1:
            groups[-1].append(n)
        else:
            groups.append([n])
    return ", ".join(f"{g[0]}…{g[-1]}" if len(g) > 2 else ", ".join(map(str, g)) for g in groups)


def together(texts: Iterable[str], most: int | None = None) -> str:
    """Instances in one text: ``i = 1, 2, 5…9``; of those that are not values of one variable at most `most`."""
    shown = list(dict.fromkeys(texts))
    split = [text.split(" = ") for text in shown]
    if len(shown) > 1 and all(len(s) == 2 and s[0] == split[0][0] for s in split):
        values = [s[1] for s in split]
        return f"{split[0][0]} = {runs(map(int, values)) if all(v.isdigit() for v in values) else ', '.join(values)}"
    return "; ".join(shown[:most]) + (" …" if most is not None and len(shown) > most else "")


def _instances(
    row: Row, ranges: Mapping[str, Sequence[int]], numbers: Sequence[int]
) -> Iterator[tuple[dict[str, int], Formula]]:
    """The row's formula with numbers for its indices, and these; empty if no state decides it."""
    names = sorted(index_names(row.formula) & row.variables)
    domains = [sorted({*ranges.get(name, ()), *numbers}) for name in names]
    total = 1
    for domain in domains:
        total *= len(domain)
    if psl.is_temporal(row.formula) or total > INDICES_TRIED:
        return
    for choice in product(*domains):
        values = dict(zip(names, choice, strict=True))
        try:
            yield values, instantiate(row.formula, values)
        except Malformed:
            continue


def _numbers(graph: Graph, visited: Sequence[Any]) -> list[int]:
    """The whole numbers that occur in the agent's run."""
    system = graph.system
    facts: set[Term] = set()
    for state in visited:
        for agent, mind in zip(system.agents, system.minds(state), strict=True):
            facts |= agent.believed(mind)
        did = system.did(state)
        facts |= set() if did is None else {did[1]}
    names = {term.functor for fact in facts for term in subterms(fact) if isinstance(term, Struct) and not term.args}
    found = {int(name) for name in names if name.isascii() and name.isdigit() and len(name) < 10}
    return sorted(found) if len(found) <= INDICES_TRIED else []


def _agent_cells(system: System, state: Any) -> Step:
    """The last action, each agent's beliefs beyond its initial ones, the new percepts."""
    names = [f"{agent.program.name} " if len(system.agents) > 1 else "" for agent in system.agents]
    did = system.did(state)
    words = [("(last action)", "none" if did is None else f"{names[did[0]]}{show(did[1])}")]
    for name, agent, mind in zip(names, system.agents, system.minds(state), strict=True):
        believed = agent.believed(mind)
        always = frozenset(agent.program.beliefs)
        words.append((f"({name}believes)", ", ".join(sorted(map(show, believed - always))) or "nothing new"))
        missing = sorted(map(show, always - believed))
        if missing:
            words.append((f"({name}no longer believes)", ", ".join(missing)))
    now = system.core(state)
    if now.drawn:
        offered = system.world.drawn(now.choice)
        words.append(("(is about to perceive)", ", ".join(map(show, offered)) or "nothing"))
    return tuple(words)
