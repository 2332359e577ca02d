"""The calculus of composed systems: rules R1 to R4, their side conditions, and requirements. It finds proofs;
`avow.kernel` decides.

Start reading at `composition` (a system's derivations). `rules` finds the rule instances, `discharge` proves side
conditions, `obligations` lists what has to be shown, `model_checking` judges temporal requirements over the scenario.
"""
