"""The reference evaluator: what docs/language.md says, and nothing else.

`meaning` was written from that page alone. It reads typed terms (`avow.language.terms`) and uses none of Avow's
evaluation, formulas, solving or sanity, nor the conditions that the checker adds to a clause for its having a value:
it can read a clause as it is written (`Clause.written`). The tests beside it hold every engine against it.
"""
