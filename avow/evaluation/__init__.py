"""The exact truth of a formula over concrete values; where a quantifier cannot be made finite exactly, it says so.

Front doors: `avow.evaluation.evaluate`, and `avow.evaluation.truth` where a solver may help.
"""
