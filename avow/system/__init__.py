"""A system: its contracts and its plan, read and checked against each other.

Start reading at `load`; `plan` is the plan as data (`plan_file` reads it), `graph` the dataflow, `subsystems` and
`folding` treat several nodes as one.
"""
