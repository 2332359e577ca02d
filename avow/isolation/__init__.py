"""Runs code that is not ours apart from its judge, and records what it reads.

`subject.SubjectProcess` is a function of the user's in a process of its own; `judge.ask` runs whoever questions it, in
another; `outside.Outside` runs tools. What was read is `observed`; how far a program is kept from everything else is
`level.Isolation`. `docs/trust-model.md` says what is promised, and what is not.
"""
