"""Sanity during editing: a process of its own, which ends when the text has changed.

``python -m avow.lsp.background PARENT`` reads the texts of a system from its standard input, evaluates the sanity
claims of the requested nodes, and writes a line of JSON for each node as soon as it is done. It opens no file and runs
nothing from the workspace: ``avow sanity`` covers the plan (scenario, environment, providers).
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from avow.base.codec import canonical, from_text, to_json
from avow.base.process import die_with, kill_tree, unwatch, watch
from avow.base.tuning.running import NODES_REMEMBERED, SANITY_LINE
from avow.base.verdict import Verdict
from avow.language.contract import Contract, Node
from avow.language.load import check_in_part, sound_nodes
from avow.language.source import Source
from avow.lsp.names import taken_apart
from avow.sanity.claims import node_key
from avow.sanity.document import Result, to_document

_NEUTRAL = "/"
"""Its working directory: nothing of a workspace is found from there."""


def is_bad(answer: Result) -> bool:
    """Whether a claim is refuted or broken, and not merely a consequence of another."""
    return answer.verdict in (Verdict.REFUTED, Verdict.ERROR) and not answer.because


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The input of the process: files with their texts, and the keys of the requested nodes."""

    texts: tuple[tuple[str, str], ...]
    nodes: tuple[str, ...]


def askable(sources: Sequence[Source], contract: Contract) -> tuple[Node, ...]:
    """The nodes of which no part is missing because of an error."""
    return sound_nodes(contract, [taken_apart(s.file, s.text).syntax for s in sources])


class Asked:
    """The known answers, by the meaning of a node; and the process that computes more. At most one runs."""

    def __init__(self, told: Callable[[], None]) -> None:
        self.told = told
        self.answers: dict[str, tuple[Result, ...]] = {}
        self.wanted: frozenset[str] = frozenset()
        """The keys of the nodes that are being evaluated."""
        self.task: asyncio.Task[None] | None = None

    def about(self, node: Node, clause: str | None) -> tuple[Result, ...]:
        """The known answers for a clause of a node, or (None) for the node and its outputs; none until computed."""
        others = {each.name for each in node.clauses}
        found = self.answers.get(_key(node), ())
        return tuple(a for a in found if (a.subject not in others if clause is None else a.subject == clause))

    def ask(self, systems: Sequence[tuple[Sequence[Source], Contract]]) -> None:
        """Request the answers for the nodes of these systems that have none, one system after the other; any other
        request under way is cancelled."""
        asked = [(sources, self._missing(sources, contract)) for sources, contract in systems]
        wanted = frozenset(key for _, missing in asked for key in missing)
        if wanted == self.wanted and self.task is not None and not self.task.done():
            return
        self.give_up()
        if wanted:
            self.wanted = wanted
            self.task = asyncio.get_running_loop().create_task(self._one_by_one(asked))

    def _missing(self, sources: Sequence[Source], contract: Contract) -> frozenset[str]:
        return frozenset(_key(node) for node in askable(sources, contract)) - self.answers.keys()

    async def _one_by_one(self, asked: Sequence[tuple[Sequence[Source], frozenset[str]]]) -> None:
        for sources, missing in asked:
            if missing - self.answers.keys():
                await self._run(sources, missing)

    def give_up(self) -> None:
        """End the running process, if there is one."""
        if self.task is not None:
            self.task.cancel()
        self.task, self.wanted = None, frozenset()

    async def _run(self, sources: Sequence[Source], missing: frozenset[str]) -> None:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "avow.lsp.background", str(os.getpid())),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            cwd=_NEUTRAL,
            start_new_session=True,
            limit=SANITY_LINE,
        )
        watch(process.pid)
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            wanted = _Wanted(tuple((s.file, s.text) for s in sources), tuple(sorted(missing)))
            process.stdin.write(canonical(to_json(wanted)).encode())
            process.stdin.close()
            while line := await process.stdout.readline():
                key, answers = from_text(tuple[str, tuple[Result, ...]], line)
                self.answers[key] = answers
                while len(self.answers) > NODES_REMEMBERED:
                    del self.answers[next(iter(self.answers))]
                self.told()
        except (OSError, ValueError):
            pass  # it died: the rest stays unknown
        finally:
            with suppress(ProcessLookupError):
                kill_tree(process.pid)
            unwatch(process.pid)


def _key(node: Node) -> str:
    """Identifies everything that the answers and their sentences depend on."""
    return f"{node.name} {node_key(node)}"


def main(parent: int) -> None:
    """The main function of the process."""
    die_with(parent)
    os.nice(10)  # the editor has priority
    from avow.sanity.analysis import analyse

    wanted = from_text(_Wanted, sys.stdin.read())
    contract, _ = check_in_part([Source(file, text) for file, text in wanted.texts])
    for node in contract.nodes:
        key = _key(node)
        if key not in wanted.nodes:
            continue
        answers = tuple(map(to_document, analyse(node)))
        print(canonical(to_json((key, answers))), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
