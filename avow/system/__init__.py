"""A system: its contracts and its plan, read and held against each other.

`load` is the front door; `plan` is the plan as data (`plan_file` reads it), `graph` the dataflow, `subsystems` and
`folding` nodes taken together as one.
"""
