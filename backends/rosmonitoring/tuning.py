"""This backend's constants: limits on reading, searching and output; each with its reason."""

from fractions import Fraction

TOPICS_KEPT = 1_000
"""Topics of a trace that are remembered by name, to list them if an expected topic is missing."""

VIOLATIONS_KEPT = 200
"""Violations of one trace that are written to the log; all are counted."""

VIOLATIONS_SHOWN = 10
"""Violations of one clause, or of one variable, that are shown without --all, so that many of one hide no others."""

NUMBER_LENGTH = 400
"""Digits, and the size of an exponent: longer numbers are no measurements, and cost more than an event may."""

COMPARISONS = 600
"""Comparisons in a condition; a larger one is refused, since it is checked at every event."""

CASES = 64
"""Combinations of constants that one topic's message may have; more are refused."""

TRACKED_TUPLES = 48
"""Tuples of a relation that an RML property follows: each doubles the states that a monitor may be in."""

EVENT_CHARACTERS = 8_000_000
"""Characters of one event; a longer line is not an event."""

BREACHES_KEPT = 1_000
"""Breaches of one output, or assumption, to which later ones may be traced: as many as answers that wait."""

BREACHES_OPEN = 100
"""Broken assumptions that wait for a verdict on the publisher: all are checked whenever a violation is reported."""

BREACHES_IN_DOUBT = 10_000
"""Breaches by order that wait for the end of the run, when the numbers of answers and inputs are compared: some 15 MB.
Others are counted."""

CANDIDATES_SHOWN = 12
"""Candidate fields that an error names; the user looks up a message with more anyway."""

COMBINATIONS = 64
"""Combinations of inputs that one answer may have answered and that are judged: six inputs with two values each."""

KEYS_KEPT = 1_000
"""Messages of an input, and answers, that wait for their counterpart: ten seconds at 100 Hz."""

UNANSWERED_KEPT = 100_000
"""Keys of inputs without an answer, or of answers, that are kept: more than one batch of messages has."""

DECIDED_SHARE = 1.0
"""The share of publications that has to be decided before a run is evidence, unless the plan sets another: an undecided
one may have broken the guarantee."""

DIFFERENCES = 10
"""Publications of a topic that a replay shows if they differ from the recording; the rest are counted."""

LEAST_SHARE = 0.5
"""The least `decided:` that a message proposes: below it, the recording is of something else."""

OPEN_QUESTIONS = 1_000
"""Incomplete answers that are given to Z3, in one run: some seconds. Others are undecided."""

REMEMBERED = 65_536
"""Values of a variable, and verdicts of a clause, that are remembered at a time: some megabytes."""

CHUNK = 1 << 20
"""Bytes of a trace that are read at a time."""

BATCH = 16_384
"""Messages of a bag that are judged at a time: enough for arrays to be worthwhile, and some megabytes."""

BATCH_BYTES = 1 << 24
"""Total bytes of these messages, above which fewer are judged at a time: images are large."""

RATE_MESSAGES = 10
"""Messages over which a rate is taken: a single late one is no evidence about the rate, and ten show it in a second at
10 Hz."""

TIMES_ALIKE = 10
"""Consecutive messages of one topic with the same time: two may come within a clock's resolution; with this many, the
clock stood still, and times are no evidence for limits in seconds."""

FRAME_BYTES = 64_000_000
"""Bytes of one message of a running graph; a greater length counts as an error of the other side."""

HEADER_BYTES = 1_000_000
"""Bytes of a connection's header: it contains a definition, at most some hundred kilobytes."""

QUEUED_MESSAGES = 100_000
"""Messages of a running graph that wait to be judged; more are lost, counted and reported."""

LIVE_APART = Fraction(1, 2)
"""Seconds on a running graph within which messages of two topics may be received in another order than they were
published: connections on one busy machine differ by some hundredths."""

LIVE_PAUSE = 0.1
"""Seconds without a message after which deadlines are checked."""

VERDICTS_EVERY = 1.0
"""Seconds between two messages of verdicts if nothing is broken, as for ROS's diagnostics."""

TIMELINE_EVENTS = 100_000
"""Events whose values are read for the picture of a run: a few seconds; a longer run is sampled."""

WORD_LENGTH = 60
"""Characters of a value in that picture: it has no space for more."""

DDS_SETTLE = 0.005
"""Seconds that DDS is given after a message, so that those published with it are there and can be ordered."""

DDS_TAKEN = 1_000
"""Samples, and writers, that are taken from DDS at a time."""

AGAIN_SECONDS = 1.0
"""Seconds until a ROS 1 master or publisher that did not answer is contacted again."""

MASTER_ATTEMPTS = 10
"""How often a master is contacted: one that was started at the same moment answers within some seconds."""

PUBLISHER_SECONDS = 5.0
"""Seconds for a ROS 1 publisher to send its message definition: a running one does within milliseconds."""

LISTENER_SECONDS = 1.0
"""Seconds that a subscriber may take for a message; a slower one is dropped, so that no other waits for it."""

DDS_MATCH = 5.0
"""Seconds after which a writer that was discovered but not matched is reported."""

LATEST_TIME = 10**12
"""Seconds, 31,700 years: a greater number is no time of an event in seconds, but perhaps in nanoseconds."""

EVENTS_WITHOUT_CLOCK = 10_000
"""Events that wait for a clock's first reading: seconds; if it never comes, later events are not judged."""

TICKS = 10**20
"""Ticks in a second: times are compared as integer numbers of ticks, since a trace writes at most 20 decimals."""

GRACE = Fraction(1, 20)
"""Seconds after a deadline until silence is reported: messages need time to arrive."""

JITTER = Fraction(1, 100)
"""Seconds by which times may go back, and regular steps may be early or late: clocks are no better."""
