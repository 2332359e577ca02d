"""The calculus of composed systems: rules R1 to R4, their side conditions, and requirements. It finds; `avow.kernel`
decides.

`composition` is the front door: a system's derivations; `rules` finds the rule instances, `discharge` settles side
conditions, `obligations` says what has to be shown, `model_checking` judges temporal requirements over the scenario.
"""
