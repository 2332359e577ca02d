"""In a checkout, the package `avow.backends` is the folder `backends/` at the top level; this file leads there.

A wheel has that folder itself in this one's place (`setup.py`), so that this file is never installed.
"""

from pathlib import Path

__path__[:] = [str(Path(__file__).parents[2] / "backends")]
