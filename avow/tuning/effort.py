"""Processor time and solver steps that questions and searches get.

Milliseconds and seconds are of processor time (`avow.solving.limits`) unless a number says otherwise.
"""

QUESTION_MS = 10_000
"""A question's time where nothing else is said: as long as a person waits for one answer."""

SMALLER_MODEL_MS = 150
"""For a model with small numbers, once there is one: a kindness to the reader, which must not cost more than the
answer."""

WALL_CLOCK = 20
"""Wall-clock time allowed, as a multiple of the limit in processor time: on a machine that is shared by so many, a
question still gets all its effort."""

ROUNDS = ((0.025, 0.1), (0.1, 0.2), (0.275, 0.3))
"""Parts of the time allowed, for the solver's own methods and for functions as tables: short rounds of different
methods before any gets long."""

FIRST_LOOK_MS = 30
"""Where there are functions, the solver's own methods answer at once or mostly not at all; then tables are tried."""

QUESTION_SHARE = 1.3
"""The share of the limit for everything that is done to answer one question, replays of what is found included."""

ANOTHER_SOLVER_MS = 1_500
"""From this much time on, another solver is worth the start of its process."""

SECOND_OPINION_MS = 1_000
"""How long cvc5 may look for values that Z3 says there are not: where it finds them it mostly does so at once."""

KERNEL_SECOND_MS = 5_000
"""For the second solver's answer to one question of the kernel: cvc5 counts no steps that mean the same on every
version."""

CVC5_START_SECONDS = 2.0
"""Seconds that cvc5's process may take beyond the limit of the question: to begin, and to read the script."""

NARROW_MS = 4_000
"""For the same question with fewer hypotheses, which is easier or hopeless: the last attempt, with all of them, has
the whole limit."""

DEEPER_SECONDS = 4.0
"""For more steps, where one step of induction fails: beyond two or three steps, questions grow faster than what
they prove."""

QUICK_MS = 1_500
"""Most side conditions are settled in a fraction of this."""

CERTIFICATE_STEPS = 1_500_000
"""Z3's steps for one question of the search for a certificate: a fifth of what the kernel allows, since a
certificate that is found so is checked within its budget."""

CERTIFICATE_MS = 2_000
"""A net for what Z3's steps do not count."""

OFFERS_SECONDS = 3.0
"""For all the offers to one failed question together; an offer is a service, not part of the answer."""

OFFER_STEP_MS = 500
"""For one question of an offer: six of them fit into the time for all."""

CONSISTENT_MS = 300
"""Whether a contract is consistent is asked for so long; then, whether it is realizable, which says more."""

REALIZABLE_SHARE = 1.2
"""The share of the limit for everything that is done, as long as it comes to an end by itself."""

CONFIRMING_MS = 500
"""For a question that should only confirm an answer."""

WITNESS_PATIENT_MS = 300
"""From this much time on for one attempt, all that is known of the chosen constants is told: short attempts are
quicker without."""

CONFLICT_MS = 500
"""For each of the questions that make a conflict smaller: there are many, and none of them decides anything."""

REPLAY_MS = 1_000
"""For whether values that a search found make a formula true, where only open values are left to be chosen."""

JUDGE_MS = 2_000
"""For the truth of a formula over values that a tool, a trace or a test gave, where enumeration cannot tell it: a run
may ask a thousand times."""
