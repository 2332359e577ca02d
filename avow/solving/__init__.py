"""The one bridge to Z3 and to SMT-LIB text: translation, questions with limits, models read back as values.

Front doors: `avow.solving.questions` (satisfiable? entailed?), `avow.solving.smtlib` (the same as text).
"""
