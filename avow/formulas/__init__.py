"""Formulas as meanings: normal forms, digests, substitution, traversal, concrete values. Calls no solver.

Start reading at: `avow.formulas.formula`, `avow.formulas.traversal`, `avow.formulas.values`; for clauses that refer to
other steps, `avow.formulas.temporal`.
"""
