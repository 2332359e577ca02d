"""What the kernel takes to establish again what the calculus proved, against finding those proofs.

    python benchmarks/kernel.py [SYSTEM ...]        # default: the shipped systems

CPU seconds of this process (Z3 is in it). The ratio has to be below 1: a certificate is checked in less time than its
proof takes. On one shared core, remote_inspection: 7.4 s and 0.11 s, a ratio of 0.015; cvc5, on the same questions,
adds 7,000 of its own steps, less than a second.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from avow.calculus.certificates import Certificates  # noqa: E402
from avow.calculus.composition import compose  # noqa: E402
from avow.calculus.discharge import Bounds  # noqa: E402
from avow.calculus.obligations import all_tasks, reestablished, settle_each  # noqa: E402
from avow.system.load import load_system  # noqa: E402


def measured(folder: Path) -> tuple[float, float, int]:
    """Seconds to prove, seconds to establish again, and how many claims were."""
    composition = compose(load_system(folder))
    obligations = [task.obligation for task in all_tasks(composition)]
    start = time.process_time()
    tuple(settle_each(composition, obligations, Bounds(20_000)))
    proofs = time.process_time() - start
    certificates = Certificates(compose(load_system(folder)), dict(composition.certificates.made))
    start = time.process_time()
    found = [reestablished(certificates, o.id) for o in obligations]
    return proofs, time.process_time() - start, sum(one is not None for one in found)


def main(names: list[str]) -> None:
    folders = [ROOT / "contracts" / name for name in names]
    folders = folders or sorted(p.parent for p in (ROOT / "contracts").glob("*/plan.yaml"))
    print(f"{'system':32}{'claims':>8}{'proofs':>10}{'kernel':>10}{'ratio':>10}")
    for folder in folders:
        proofs, kernel, claims = measured(folder)
        print(f"{folder.name:32}{claims:8}{proofs:9.2f}s{kernel:9.2f}s{kernel / proofs:10.3f}")


if __name__ == "__main__":
    main(sys.argv[1:])
