"""How far searches and enumerations go before they give up. Beyond a bound, an answer is `unknown` or "not exhaustive",
never a proof.
"""

GAME_MEMORIES = 300
"""Memories of a contract that are played through one by one; with more, quantifiers are eliminated instead."""

GAME_ANSWERS = 256
"""Inputs and outputs at one step of such a game: each is evaluated from each memory."""

WALKS = 20
"""Runs that `avow simulate` tries before it shows one that got stuck, where nodes remember: a choice at random may end
where a better one would go on."""

RUN_TO_AN_EXAMPLE = 6
"""Steps of a run at whose end an example is looked for: each adds a copy of the contract to the question."""

VIABILITY_ROUNDS = 8
"""Rounds in which the viable memories are approached: each eliminates quantifiers from a larger formula."""

INPUTS_AHEAD = 3
"""Steps for which inputs are chosen ahead, such that no answers go with them: each adds a copy of the contract."""

AHEAD_SIZE = 20_000
"""Operators of such a question, at most: what is remembered is written out, step into step."""

FORMULAS_KEPT = 2_000
"""Formulas that a session of questions keeps as expressions of Z3: a node's analysis asks about a few hundred."""

ROOTS_COMPARED = 5
"""Sines, or angles, of which a solver gets facts of every two: with more, these would be most of a question."""

QUESTIONS_KEPT = 500
"""Questions of evaluation to one Z3 context: what it keeps of them does not grow without end."""

CHOICES_FOUND = 300
"""Answers that the solver is asked for, where they cannot be enumerated: each costs one question."""

WITNESSES_TRIED = 4
"""Tuples of the hypotheses' own names that are put in for `exists`: each is a question, and the right one mostly is
the first of its types."""

DEEPEST_INDUCTION = 3
"""The k of k-induction, at most: each step adds a copy of the system to the question."""

PREMISES_TRIED = 6
"""Premises from which the witness of a claim that something exists may come: each is a question by itself."""

LONGEST_UNROLLING = 24
"""Steps unrolled from the initial values, at most: the time for deeper questions is mostly up before."""

LONGEST_RUN = 200
"""The same, where Spacer says that some run breaks the claim: it is worth to look for it."""

STATES_CHECKED = 50_000
"""Kinds of steps looked at over one scenario, so that memory stays bounded; beyond it, a search is not exhaustive."""

RUNS_TRIED = 20
"""Runs tried before a search: a violation that is common is found by one of them in a fraction of a search's time."""

REQUIREMENT_MUTANTS = 12
"""Mutants of a requirement's formula that are tried: the first that the contracts exclude ends the search."""

PROPERTY_ATOMS = 6
"""State formulas of a temporal property up to which every combination of their values is looked at."""

RUN_LENGTH = 60
"""The length of such a run, in steps."""

PARTIAL_ANSWERS = 100_000
"""Partial answers looked at for one question; beyond it, the search is not exhaustive."""

PARTIAL_ANSWERS_AGAIN = 2_000
"""The same, once a search was cut short: nothing will be exhaustive any more, and there are other inputs to try."""

NODE_ANSWERS = 1_500
"""Answers of one node to one input; with more, a search is not exhaustive."""

SEQUENCE_LENGTHS = 4
"""Sequences of up to so many elements are tried, unless an equation or the scenario gives the sequence: their
number grows with this as an exponent."""

POINTS_OF_ARGUMENTS = 10_000
"""Combinations of values that are listed; with more, none are."""

COMPLETIONS = 3
"""Values tried in the places that the search left undecided."""

VALUES_OF_A_PORT = 20_000
"""Values of a port that a scenario enumerates; with more, the user is asked for a domain."""

SMALL_TABLE = 3
"""A function of so few points is compared as it is; a key made once pays for larger ones."""

VALUES_ENUMERATED = 1_000_000
"""More values than this are not enumerated: the answer would not come in useful time."""

DISJUNCTION_DEPTH = 5
"""How far disjunctions within disjunctions are followed: the cost of planning is exponential in it."""

ROWS_WITHOUT_INDEX = 3
"""A table of so few rows is walked through; an index costs more than it saves."""

ATOMS_MADE = 500
"""Atoms made, at most: cases within cases multiply."""

DISJUNCTIONS_MADE = 16
"""Disjunctions of conjunctions that would become more than so many disjunctions are left as they are: their numbers
multiply."""

AUTOMATON_NODES = 5_000
"""Nodes of a property's automaton: the tableau is exponential in the property's length, and one so large is a slip
rather than a requirement."""

POINTWISE_PARTS = 100
"""A guarantee with more parts, once `or` is spread over `and`, is left as it is."""

SEQUENCE_SHOWN = 1_000
"""Elements of a sequence that a solver's model is read back into: beyond it, the model is given up."""

SIZES_TRIED = (1, 2, 3)
"""Sizes of an unspecified type that a contract should allow, beside larger ones: with one element nothing differs, two
are enough for `!=`, three for what two of them are not."""

SIZES_COMBINED = 16
"""Combinations of sizes that are asked about, for all such types together: each is a question or two."""

NUMBERS_PAIRED = 4
"""Half way between so many numbers, each with each, values are looked for."""

WITNESS_REFUTATIONS = 6
"""So many inputs for which there is an output after all, one after the other, and something else is tried."""

WITNESSES_PER_OUTPUT = 24
"""Candidates for one output: those that the clauses name come first, and the right one is hardly ever a late one."""

WITNESSES = 96
"""Combinations of them: each is a question to the solver."""

WITNESS_ARGUMENTS = 12
"""How many terms are tried for one argument of a constructor or one quantified variable."""

SMALL_NUMBER = 99
"""Numbers of up to two digits are small: a reader takes them in at a glance."""

TABLE_POINTS = 128
"""Tables read off a function that is given by comparisons have no more points."""

NUMBERS_WRITTEN_OUT = 16
"""A quantifier over more whole numbers stays one."""

PARTS_SEARCHED = 64
"""Conjunctions of more parts are left alone: each part may be looked at once for each variable."""

CASES_KEPT = 50
"""Cases of one claim that are tried again: more cost each later run, and those of the newest tool runs tell most."""

VALUES_LOOKED_AT = 500
"""So many values of one domain or column are looked at; a table may have a million."""

GUARDS = 32
"""Guards of a partial operation that are tried, two at a time, as its condition. Nobody writes more at one place. If no
guard gives the condition, the claim itself is checked."""

COUNTS_GUESSED = 6
"""Numbers below which a counter of a program and one that its contract has are guessed to agree, beside the limits that
the contract writes down: programs that keep less than they count saturate early."""

RECORDED_STEPS = 2000
"""Steps of a node's recordings on which its program and its models are asked: some minutes of a robot at ten hertz."""

ROUNDED_PART = 2**-40
"""The part of a REAL by which a program may differ from its model for rounding: thousands of roundings of a double."""

LIMITS_NESTED = 2
"""Instants at which what a limit in seconds is of may itself change in a silence: the terms double with each."""

CLOCKED_SIZE = 1_500
"""Operators of what is made of a clause with limits in seconds, at most: what people write has some fifty."""

INSTANCES = 1_000
"""Values of a quantified variable for which something is remembered along a run: each step looks at all of them."""

TABLE_ROUNDS = 4
"""Rounds in which a remembered function is made exact: the first finds its points, the second that there are no others;
where values elsewhere differ, no number of rounds is enough."""
