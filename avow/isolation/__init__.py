"""Runs foreign code in isolation from its oracle, and records what it reads.

`subject.SubjectProcess` is a user's function in a process of its own; `judge.ask` runs the oracle in another;
`outside.Outside` runs tools. `observed` has the recorded reads; `level.Isolation` is the degree of isolation.
`docs/trust-model.md` says what is guaranteed, and what is not.
"""
