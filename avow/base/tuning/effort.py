"""What questions and searches get, in effort and in solver steps.

A unit of effort is `STEPS` of Z3's steps (`avow.solving.limits`): about a millisecond. No clock decides an answer;
numbers in seconds only end what hangs.
"""

STEPS = 4_000
"""Z3's steps in a unit of effort: so many it takes in a millisecond or two (three thousand questions of the shipped
systems took 1,500 to 4,000, in all of Z3's engines)."""

MOST_STEPS = 4_000_000_000
"""Z3's limit is a number of 32 bits: some 25 minutes."""

QUESTION_STEPS = 1_000
"""Steps that a question counts for beside those of its answer: writing it down takes time too, and a loop of questions
comes to an end."""

WITNESS_STEPS = 5_000
"""Steps that a question's part about one witness counts for: writing it down takes some two milliseconds."""

PRODUCT_STEPS = 50
"""Steps that a pair of a system's step and a state of an automaton counts for: some twenty microseconds."""

SEARCH_STEPS = 50
"""Steps that a partial answer or a step of a system counts for: looking at it takes some twenty
microseconds."""

HANGS = 60
"""A question hangs once it has taken so many times as long as its effort usually takes, and `HANGS_SECONDS` besides:
the slowest of Z3's steps take ten times as long as most, and other work may share the machine."""

HANGS_SECONDS = 60
"""Every question gets so long before it is called hanging: a stalled machine is no reason."""

SOLVED_EFFORT = 2_000
"""For the values of variables that nothing restricts to finitely many, at each evaluation of a formula."""

QUESTION_EFFORT = 10_000
"""Default effort of a question: as long as a person waits for one answer."""

SMALLER_MODEL_EFFORT = 150
"""For a model with small numbers, once there is one: a kindness to the reader, which must not cost more than the
answer."""

ROUNDS = ((0.025, 0.1), (0.1, 0.2), (0.275, 0.3))
"""Parts of the effort allowed, for the solver's own methods and for functions as tables: short rounds of different
methods before any gets long."""

CLOSER_LOOKS = 6
"""Attempts at a question with `sin`, `cos` or `atan2`, each with bounds that are closer around the last model."""

RESTARTS = 8
"""Where there are functions, the solver's own methods find a contradiction early or by luck: before the last round as
many further seeds have a try. One redundant clause, its question's parts in 14 orders: 3 answered by one attempt of
effort 400, 13 by 8 of 25, 14 by 16. The number was chosen by these same orders: how many of others it answers was not
measured."""

RESTART = 0.025
"""The part of the effort allowed for each."""

FIRST_LOOK_EFFORT = 30
"""Where there are functions, the solver's own methods answer at once or mostly not at all; then tables are tried."""

QUESTION_SHARE = 1.5
"""The share of the limit for everything that is done to answer one question, replays of what is found included."""

ANOTHER_SOLVER_EFFORT = 1_500
"""From this much effort on, another solver is worth the start of its process."""

SECOND_OPINION_EFFORT = 1_000
"""Effort of cvc5 to look for values that Z3 says there are not: where it finds them it mostly does so at once."""

KERNEL_SECOND_STEPS = 20_000
"""cvc5's steps for one question of the kernel: those that it answers took 4,000 at most, a tenth of a second."""

KERNEL_SECOND_ALL = 200_000
"""cvc5's steps for all of a system's claims in a run: what comes later is established by Z3 alone, and its grade says
so. The shipped systems take a twentieth of it."""

CVC5_STEPS = 20
"""cvc5's steps in a unit of effort: it takes 7 to 80 of them in a millisecond, fewest where there are
quantifiers."""

CVC5_SECONDS = 12
"""Seconds after which a question to cvc5 hangs, with one more for each `CVC5_EFFORT_A_SECOND` of effort: there are
scripts on which it does not keep its own limit."""

CVC5_EFFORT_A_SECOND = 50

NARROW_EFFORT = 4_000
"""For the same question with fewer hypotheses, which is easier or hopeless: the last attempt, with all of them, has
the whole limit."""

INVARIANT_EFFORT = 1_500
"""For Spacer, in each of its two ways, to find an invariant: most are found within 100, and where it goes on for ever,
more does not help."""

DEEPER_EFFORT = 4_000
"""For more steps, where one step of induction fails: beyond two or three steps, questions grow faster than what
they prove."""

QUICK_EFFORT = 1_500
"""Most side conditions are settled in a fraction of this."""

CERTIFICATE_STEPS = 1_500_000
"""Z3's steps for one question of the search for a certificate: a fifth of what the kernel allows, since a
certificate that is found so is checked within its budget."""

CERTIFICATE_NET_MS = 60_000
"""A net for what Z3's steps do not count, by the clock."""

CUT_EFFORT = 2_000
"""For whether a node may answer an input otherwise than was found: hundreds of inputs are asked about."""

ELIMINATION_STEPS = 250_000
"""Z3's steps to eliminate variables; two rounds of a game over a limit in seconds took 180,000. Z3 keeps no limit where
it applies what eliminates; so it is first run as a solver, which has one."""

ELIMINATION_SECONDS = 60
"""After this time an elimination hangs: the steps that it is allowed take less than half a second."""

CONSISTENT_EFFORT = 300
"""Whether a contract is consistent is asked for so long; then, whether it is realizable, which says more."""

REALIZABLE_SHARE = 1.2
"""The share of the limit for everything that is done, as long as it comes to an end by itself."""

CONFIRMING_EFFORT = 500
"""For a question that should only confirm an answer."""

WITNESS_PATIENT_EFFORT = 300
"""From this much effort on, an attempt gets all known facts about the chosen constants. Short attempts are quicker
without them."""

DEFEAT_EFFORT = 2_000
"""For inputs, chosen ahead, that leave a node with memory no outputs: those of published contracts took a tenth."""

CONFLICT_EFFORT = 500
"""For each of the questions that make a conflict smaller: there are many, and none of them decides anything."""

REPLAY_EFFORT = 1_000
"""For whether values that a search found make a formula true, where only open values are left to be chosen."""

JUDGE_EFFORT = 2_000
"""For the truth of a formula over values that a tool, a trace or a test gave, where enumeration cannot tell it: a run
may ask a thousand times."""
