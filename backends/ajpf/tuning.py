"""This backend's numbers: limits of reading, search and display; each with its reason."""

RULE_DEPTH = 60
"""The depth of belief rules that call each other: one that calls itself never ends, and the search must."""

RULE_STEPS = 300_000
"""Beliefs and rules tried for one query: about a second's work."""

DRAWS = 4096
"""Combinations of percepts that an environment may draw in one step: each is a branch of every state."""

STATES = 2_000_000
"""States explored by default; the limit on memory is mostly met before."""

RECENT = 4_096
"""States without their queues whose successors are kept: breadth first, most that are asked again were asked just
before. With all of them kept, a million states take up to twice the memory, and as long."""

INTENTIONS = 6
"""With more intentions at once, the agent has probably fallen behind its percepts for good."""

PROPERTIES = 5_000
"""Instances of one guarantee: each is a property that is checked by itself."""

INDEX_VALUES = 1_000
"""Values of one index of a mapping's row, which are written out."""

DEFAULT_STATES = 1_000_000
"""States that a method explores unless its options say otherwise: an agent that needs more has the option."""

PROGRAM_BYTES = 2_000_000
"""A larger file is not a hand-written agent."""

ALTERNATIVES = 8
"""Alternatives of a trigger that are each explained: a reader follows no more."""

REPLAY_MILLISECONDS = 10_000
"""For one run. An agent that does not continue is ended; its report so far counts."""

REPLAY_START = 30.0
"""Seconds for Java to start and to load AIL's classes, on a busy machine."""

SAMPLED_RUNS = 5
"""Runs of each state space that AIL repeats, besides those that refute."""

SAMPLED_STEPS = 400
"""Steps of such a run; a longer one is left out."""

GRACE = 0.5
"""The part of the time limit that may be used beyond it to find violations in the explored states."""

NEARBY = 200_000
"""States among which a run that refutes a property is sought first: it is found sooner, and is shorter."""

MULTIPLIED_OUT = 256
"""More disjuncts (or conjuncts) than this under one quantifier are not multiplied out."""

PARTS = 20_000
"""More parts than this are not written out."""

TAUTOLOGY_CASES = 4_000
"""Cases examined before a formula is taken to depend on the agent."""

INDICES_TRIED = 400
"""Combinations of index values with which a row is tried in each step."""

LIVE_JOBS = 1_000
"""Steps of a running program without an action: after so many it is taken to be endless; a plan has some tens."""

STANDING_ATOMS = 40
"""Beliefs to which rules are followed from those of a property, to see whether it follows from the rules alone."""

STANDING_INSTANCES = 64
"""Instances of one rule that are examined for that."""
