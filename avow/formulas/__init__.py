"""Formulas as meanings: normal forms, digests, substitution, traversal, concrete values. Asks no solver.

Front doors: `avow.formulas.formula`, `avow.formulas.traversal`, `avow.formulas.values`; for clauses that speak of other
steps `avow.formulas.temporal`.
"""
