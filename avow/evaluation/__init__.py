"""The exact truth of a formula over concrete values; a quantifier that cannot be made finite exactly is reported.

Start reading at: `avow.evaluation.evaluate`, and `avow.evaluation.truth`, where a solver may help.
"""
