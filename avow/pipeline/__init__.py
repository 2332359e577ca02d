"""The pipeline: every stage as a doit task. The only package that knows all stages.

Start reading at: `avow.pipeline.tasks` (what `dodo.py` yields), `avow.pipeline.workload` (a system with all its jobs).
`discharge` runs each job in a process of its own (`dispatch`, `worker`) and records the answers; `assess` builds,
renders and judges the case; `shortcut` detects that nothing is to be done.
"""
