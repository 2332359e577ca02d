"""A subject that does not answer, or not end, is told as that: no answer of it counts, and the next run asks again."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from avow.base import process
from avow.isolation.level import SANDBOX

ASKED = """
import sys
from pathlib import Path
from avow.base import process
from avow.isolation.subject import SubjectFailed, SubjectProcess
process.adopt_orphans()
subject = SubjectProcess(Path(sys.argv[1]), "step", 1.0)
try:
    subject.ask({})
except SubjectFailed:
    pass
print(subject.close(), bool(subject.silent), sep="|")
"""
HANGS = "import subprocess, time\ndef step():\n    {}\n    time.sleep(60)\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deed", "told"),
    [
        ("pass", "does not answer within 1 s: it is in step (s.py, line 4)"),
        ("subprocess.Popen(['sleep', '60'])", "left processes behind"),
    ],
)
def test_what_hangs_left_nothing_behind_by_being_ended(tmp_path: Path, deed: str, told: str) -> None:
    """Under strace its process became its judge's, which took it for one that it had left."""
    (tmp_path / "s.py").write_text(HANGS.format(deed))
    given = {SANDBOX: "off", "PYTHONPATH": ":".join(sys.path)}
    done = process.run([sys.executable, "-c", ASKED, str(tmp_path / "s.py")], env=given)
    fault, silent = done.stdout.strip().split("|")
    assert told in fault, done
    assert silent == "True"
