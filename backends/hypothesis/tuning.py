"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

CONFIDENCE = 0.95
"""Of the bound on the probability of failure that is told: the common level, at which the rule of three holds."""

REJECTED_CASES = 20
"""Rejected cases for each one that was tried, beyond which the assumptions are too rarely met to say anything."""

SHRINKING_SECONDS = 4.0
"""Seconds spent on making a failing case simpler."""

BATCH = 50
"""Cases that are put to the subject at a time: so that the time to hand them over is shared."""

ASKED_AGAIN = 200
"""The first questions, which are put to a second process too: most thresholds, at a fraction of the time."""

APART = 4
"""Cases in which NaN, the infinities and the negative zero are tried: a fault there rarely depends on other inputs."""

ATTEMPTS = 6
"""Times that the inputs to blame for an unmet assumption are drawn again; a case that stays unmet is rejected and
counted."""

VALUE_DEPTH = 4
"""Values within values; deeper ones are of plain constructors and constant functions, so that they end."""

CASE_BYTES = 80
"""Length of the string that a case is drawn from: as many choices as a case has, in small systems; after it every
choice is the simplest."""

OPAQUE_VALUES = 4
"""Elements of an opaque type, and of a relation: so few that two draws meet."""

COMMON_LENGTHS = 5
"""Sequences and tables mostly have fewer elements than this: short ones fail as well, and read better."""

CONSTANTS_COMBINED = 6
"""Constants up to which their sums and differences are tried as well."""

LONG_SEQUENCE = 50
"""A sequence is also tried with so many elements, whatever is written."""

LONGEST_SEQUENCE = 4096
"""Numbers up to which they are taken for lengths: a laser's scan has a thousand and more."""

LENGTHS = 60
"""Lengths that are tried, the shortest first."""

CONSTANTS_READ = 300
"""So many constants of a program are looked at."""

LARGEST_CONSTANT = 2**64
"""Larger constants are no thresholds of a robot: no machine word holds them."""

STEPS = 20
"""Steps of one run of a class: what counts to ten, or waits for a second at ten hertz, comes to its end."""

STEP_TRIES = 12
"""Draws for one step's inputs; where the assumptions allow none of them, the run ends and another begins."""

HELD_STEPS = 0.8
"""In runs that hold their inputs, how often a step has those of the step before: what counts has to count on."""

LONG_HELD_STEPS = (0.95, 0.99)
"""Likewise, in some runs of a contract with memory: a condition that has to last has to last beyond its limit."""

LONGEST_RUN = 400
"""Steps by which a run is longer at most, however long the contract's limits are: twice their sum, so that what a
response demands comes due, would be too many."""

SHRINKING_TRIES = 60
"""Steps that are left out one by one of a run that breaks a guarantee: more than a run has."""

LONGEST_TEXT = 60
"""Longer texts of a program are messages, not values."""

SMALL = 4
"""Identifiers and coordinates are drawn from so few that relations meet."""

WIRE_DEPTH = 300
"""Nesting of a formula beyond which it is not written."""

RUNS_TOGETHER = 25
"""Runs of a callback class that one process is asked, each of a new object: to start one takes as long as many runs."""

SILENCE = 3
"""Seconds, of virtual time, that such a run goes on after its last message: most timers and time-outs are shorter."""

EDGES = 1500
"""Cases at thresholds that are tried, or twice `cases` where that is more: a few dozen thresholds of a few inputs."""

SAMPLED = 24
"""Drawn cases in which a subject is looked at for what it compares with: most of what it does shows in these."""

TRIED = 200
"""Cases at thresholds that others are steered from."""

STEERED = 600
"""Cases that steering may come up with: a comparison takes some five."""

STEERED_FROM = 60
"""Cases that are steered from: each shows a way through the subject that none before has shown."""

STEERED_PLACES = 10
"""Times that one comparison is steered to: from other ways, and by other inputs."""

STEERED_STEPS = 16
"""Steps of the secant method: one where a difference is linear in an input, some ten where it is a square."""

STEERED_TEXTS = 40
"""Texts of the subject that each text of a case is turned to."""

TURNS = (1, 997, 2**17, 2**33)
"""By how much a number is turned to see what moves with it; each where the one before moved nothing: what is divided
or shifted moves seldom."""

POINTS_TURNED = 2
"""Points of a function whose values are turned."""

COUNTED = 25_000
"""How often the same is asked of a subject that is seen to count: some twenty minutes at twenty hertz."""

COUNTED_STEPS = 2500
"""Likewise of a class, all of whose steps are kept and shown where they refute."""

COUNTED_FROM = 3
"""Cases that are asked again to see whether anything counts."""

ASKED_TO_COUNT = 5
"""Times that each of these is asked: what counts steadily shows in three differences."""

LED_TO = (0, 2, 5)
"""Steps of a run after which its next step is steered."""

AFTER_COUNTING = 400
"""Cases that are asked once more of a subject that has counted."""

SCOUT_PATIENCE = 2.0
"""Seconds for a question about what a subject compares: beyond it nothing more is looked at."""
