"""The pipeline as doit tasks: `doit verify` does everything for every system under contracts/.

`doit list --all` shows each stage. What a task does stands in `avow.pipeline`.
"""

from pathlib import Path

from avow.pipeline.tasks import config, pipeline

DOIT_CONFIG = config(Path(__file__).parent)


def task_avow():
    """check, sanity, compose, obligations, export, discharge, report and verify, for each system, node and method"""
    yield from pipeline(Path(__file__).parent)
