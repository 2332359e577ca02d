"""Slices and keys of random systems, also nested: each part of a slice is in a key, what lies outside it in none."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import some

from avow.pipeline.blobs import encode
from avow.pipeline.work import Work, catalogue
from avow.system.load import load_system

from .test_slices import _SHOWN, keys_or_refusal, mutated

SORTS = ("INTEGER", "REAL", "Mode", "BOOL")


class Made:
    """A random chain with side branches: node k reads some outputs of earlier nodes. `nested`: the first nodes are a
    subsystem of this plan, and another system is taken in."""

    def __init__(self, root: Path, seed: int, nested: bool) -> None:
        self.rng = random.Random(seed)
        self.folder = root / "contracts" / "made"
        (self.folder / "models").mkdir(parents=True)
        self.count = 5
        self.sorts = [self.rng.choice(SORTS) for _ in range(self.count)]
        self.reads = [self.rng.sample(range(k), min(k, self.rng.choice((1, 1, 2)))) for k in range(self.count)]
        self.bounds = [self.rng.randrange(1, 90) for _ in range(self.count)]
        self.nested = nested
        self.write()

    def holds(self, side: str, k: int) -> str:
        """Something about node k's output, or about an input that has it."""
        match self.sorts[k]:
            case "Mode":
                return f"{side}.x{k} != off"
            case "BOOL":
                return f"{side}.x{k}"
            case _:
                return f"{side}.x{k} >= {self.bounds[k]}"

    def write(self) -> None:
        text = "context {\n  Mode : {off, slow, fast};\n}\n"
        plan = "system: made\ncontract: system.rcl\nscenario:\n  domains: {INTEGER: [1, 50, 100], REAL: [1, 50, 100]}\n"
        plan += "nodes:\n"
        for k in range(self.count):
            inputs = ", ".join(f"x{j} : {self.sorts[j]}" for j in self.reads[k]) or f"raw{k} : INTEGER"
            assumed = "".join(f"  assume a{j} ( {self.holds('in', j)} )\n" for j in self.reads[k])
            when = f"in.raw{k} > 3" if not self.reads[k] else self.holds("in", self.reads[k][0])
            text += (
                f"node n{k} {{\n  inputs( {inputs} )\n  outputs( x{k} : {self.sorts[k]} )\n  topics()\n{assumed}"
                f'  guarantee g{k} "n{k} is as it should" ( {self.holds("out", k)} )\n'
                f"  guarantee h{k} ( {when} -> {self.holds('out', k)} )\n}}\n"
            )
            value = {"Mode": "slow", "BOOL": "TRUE"}.get(self.sorts[k], "95")
            (self.folder / "models" / f"n{k}.imp").write_text(f"x{k} := {value}\n")
            plan += f"  n{k}: {{criticality: low, methods: [hoare: {{program: models/n{k}.imp}}]}}\n"
        if self.nested:
            other = self.folder.parent / "other"
            other.mkdir(exist_ok=True)
            (other / "system.rcl").write_text(
                "node inner { inputs( a : INTEGER ) outputs( b : INTEGER ) topics() assume low ( in.a >= 0 )\n"
                f"  guarantee g ( out.b >= in.a + {self.bounds[0]} ) }}\n"
            )
            (other / "plan.yaml").write_text("system: other\ncontract: system.rcl\n")
            plan += "subsystems:\n  front: {nodes: [n0, n1]}\n  left: {system: ../other}\n"
        (self.folder / "system.rcl").write_text(text)
        (self.folder / "plan.yaml").write_text(plan)

    def works(self) -> list[Work]:
        return [work for work in catalogue(load_system(self.folder)).works if work.cut is not None]

    def encoded(self, work: Work) -> bytes:
        assert work.cut is not None
        return encode(work.cut(), self.folder)


CASES = [(seed, nested) for seed in range(6) for nested in (False, True)]


@pytest.mark.parametrize(("seed", "nested"), some(CASES, 2))
def test_a_change_of_any_part_changes_a_key_or_is_refused(tmp_path: Path, seed: int, nested: bool) -> None:
    made = Made(tmp_path, seed, nested)
    unseen: set[tuple[str, str, str]] = set()
    tried = 0
    # composition gets the whole system, and each of its keys is of what one condition can rest on
    for work in made.rng.sample([w for w in made.works() if w.engine != "compose"], 4):
        for place, data in sampled(made, mutated(made.encoded(work)), 60):
            tried += 1
            found = keys_or_refusal(data, made.folder) or {}
            kept = [found.get(name) == key for name, key in work.keys.items()]
            if (all(kept) if work.engine == "sanity" else any(kept)) and place not in _SHOWN:
                unseen.add((work.engine, *place))
    assert tried > 60
    assert not unseen


Change = tuple[tuple[str, str], bytes]


def sampled(made: Made, changes: Iterator[Change], most: int) -> list[Change]:
    found = list(changes)
    return found if len(found) <= most else made.rng.sample(found, most)


@pytest.mark.parametrize(("seed", "nested"), some(CASES, 2))
def test_an_edit_outside_a_slice_changes_no_key(tmp_path: Path, seed: int, nested: bool) -> None:
    """A clause of one node is seen by its own works, by those of its consumers, which assume it, and by the sanity of
    whoever reads what a consumer promises on its condition; by composition, too."""
    made = Made(tmp_path, seed, nested)
    for edited in range(made.count):
        before = {(w.node, w.engine): w.keys for w in made.works()}
        bound, sort = made.bounds[edited], made.sorts[edited]
        if sort in ("Mode", "BOOL"):
            continue
        made.bounds[edited] = bound + 1
        made.write()
        after = {(w.node, w.engine): w.keys for w in made.works()}
        changed = {name for name, keys in after.items() if keys != before[name]}
        consumers = {f"n{k}" for k in range(made.count) if edited in made.reads[k]}
        assert {node for node, engine in changed if engine == "hoare"} == {f"n{edited}", *consumers}
        told = {k for k in range(made.count) if edited in made.reads[k]}  # what they promise may speak of it
        behind = {f"n{k}" for k in range(made.count) if told & set(made.reads[k])}
        asked = {node for node, engine in changed if engine == "sanity"} - {"left_inner"}
        assert {f"n{edited}", *consumers} <= asked <= {f"n{edited}", *consumers, *behind}
        assert ("left_inner", "sanity") in changed or not (nested and edited == 0)
