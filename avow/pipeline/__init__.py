"""The pipeline: every stage as a doit task. The only room that knows all stages.

Front doors: `avow.pipeline.tasks` (what `dodo.py` yields), `avow.pipeline.workload` (a system with all that there is to
do for it). `discharge` asks a worker for each work (`asking`, `worker`) and records the answers; `assess` builds,
renders and judges the case; `shortcut` finds out that nothing is to be done.
"""
