"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

BRIEFLY_SECONDS = 5.0
"""Seconds' worth of effort for whether the program has an output for every input, where that can only turn
`unknown` into `refuted`."""

INPUTS_TRIED = 300
"""Inputs that the program is run on before a proof is tried, which takes far longer."""

LENGTHS = (0, 1, 2, 3, 6)
"""Lengths of sequences among them: none, one, a pair, an odd and an even number more."""

VALUE_DEPTH = 3
"""Constructors within constructors among them; deeper values are of plain constructors only, so that they end."""

STATEMENT_STEPS = 25
"""Z3's steps that the run of a statement counts for: both take some ten microseconds."""

RUN_STEPS = 5_000
"""Statements after which a run is given up: some milliseconds, for programs that mostly take a few dozen."""

NESTING = 120
"""Nesting beyond which a program is refused: later passes recurse over it."""

ENDLESS_RUNS = 3
"""Runs without an end after which no more inputs are tried."""

FORMULA_NODES = 50_000
"""Nodes of a formula beyond which a program is too much for this method: branches in sequence double it."""

GUESS_EFFORT = 1_000
"""For one input that meets the precondition: what is not found at once is left to the proof."""

RUNS = 60
"""Runs from the start of a program that keeps something from step to step, before a proof is tried: that costs more."""

RUN_LENGTH = 12
"""Steps of such a run; a third of them are longer by the contract's limits."""

LONGEST_RUN = 60
"""Steps by which they are longer at most."""

DRAWS = 12
"""Draws for the inputs of a step, before the run ends for want of an allowed one."""

STICKY = (0.0, 0.5, 0.85)
"""How often a step of a run has the inputs of the step before: what lasts has to last beyond its limit."""

GUESSES = 200
"""Invariants that are guessed, each in the first form that no run contradicts: a few questions each."""
