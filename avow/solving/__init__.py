"""The one bridge to Z3 and to SMT-LIB text: translation, bounded questions, models read back as values.

Start reading at: `avow.solving.questions` (satisfiable? entailed?), `avow.solving.smtlib` (the same as text).
"""
