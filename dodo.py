"""The pipeline as doit tasks: `doit verify` does everything for every system under contracts/.

`doit list --all` shows each stage. What a task does stands in `avow.pipeline`.
"""

import sys
from pathlib import Path

if (here := Path(__file__).resolve().parent) in map(Path.resolve, map(Path, sys.path[:2])):
    # put there by doit and by `python -m`: no module of this folder is to stand in for one of Avow's
    sys.path[:2] = [place for place in sys.path[:2] if Path(place).resolve() != here]

from avow.pipeline.tasks import Pipeline

RUN = Pipeline(Path(__file__).parent, sys.argv[1:])
DOIT_CONFIG = RUN.config()


def task_avow():
    """all stages from check to verify, for each system, node and method"""
    yield from RUN.tasks()
