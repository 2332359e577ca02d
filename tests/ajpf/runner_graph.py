"""The state graph of Spin's runner (`agent.c`) by itself: without Spin, many systems in the time of one."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from avow.backends.ajpf import promela
from avow.backends.ajpf.checker import Kripke
from avow.backends.ajpf.explore import System
from avow.backends.ajpf.psl import Atom

_DRIVER = r"""
#include <stdio.h>
#include <string.h>
#include "agent.h"
#define MOST 20000
static S states[MOST + 1];
static int found, slots[1 << 16];
static int number(const S *s) {
    const unsigned char *c = (const unsigned char *)s;
    unsigned at = 2166136261u;
    size_t i;
    for (i = 0; i < sizeof *s; i++) at = (at ^ c[i]) * 16777619u;
    for (at %= 1 << 16; slots[at]; at = (at + 1) % (1 << 16))
        if (!memcmp(&states[slots[at] - 1], s, sizeof *s)) return slots[at] - 1;
    states[found] = *s;
    return (slots[at] = ++found) - 1;
}
int main(void) {
    S s;
    int i, k;
    memset(&s, 0, sizeof s);
    number(&s);
    for (i = 0; i < found && found < MOST; i++) {
        for (k = 0; k < NATOMS; k++) printf("%d ", says(&states[i], k));
        printf(":");
        for (k = 0; k < ways(&states[i]); k++) {
            s = states[i];
            go(&s, k);
            printf(" %d", number(&s));
        }
        printf("\n");
    }
    return found == MOST;
}
"""


def runner_graph(folder: Path, system: System, atoms: Sequence[Atom]) -> Kripke:
    """Labels are those of `checker.label_states`. State 0 stands before the first job, with the first state's label."""
    for path in promela.RUNNER:
        (folder / path.name).write_text(path.read_text())
    (folder / "agent.h").write_text(promela.header(system, atoms))
    (folder / "driver.c").write_text(_DRIVER)
    for command in (["gcc", "-O0", "-w", "-o", "driver", "driver.c", "agent.c", "-lm"], ["./driver"]):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout[-300:] + done.stderr
    labels, successors = [], []
    for line in done.stdout.splitlines():
        said, _, targets = line.partition(":")
        labels.append(sum(int(bit) << at for at, bit in enumerate(said.split()[: len(atoms) + 2 * _fair(system)])))
        successors.append(tuple(map(int, targets.split())))
    return Kripke((0,), successors, labels)


def _fair(system: System) -> int:
    return len(system.environment.fair)
