"""Where code that is not ours runs: apart from its judge, observed, and gone when the judge speaks.

`subject.SubjectProcess` is a function of the user's in a process of its own; `judge.ask` runs whoever questions it, in
another. What the subject reads, looks for and starts is recorded (`observed`). How far the subject is kept from
everything else is `level.Isolation`. `docs/trust-model.md` says what is promised, and what is not.
"""
