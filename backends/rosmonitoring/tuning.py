"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

from fractions import Fraction

TOPICS_KEPT = 1_000
"""Topics of a trace that are remembered by name, to say what it has where it lacks what is listened to."""

VIOLATIONS_KEPT = 200
"""Violations of one trace that are written to the log; all are counted."""

VIOLATIONS_SHOWN = 10
"""Violations of one clause, or of one variable, that are shown without --all: a flood of one hides no other."""

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
"""Breaches of one output, or assumption, that later ones may be followed to: as many as answers that wait."""

BREACHES_OPEN = 100
"""Broken assumptions that wait for a verdict on who said it: all are looked at whenever something is told."""

BREACHES_IN_DOUBT = 10_000
"""Breaches by order that wait for the end of the run, where it shows whether there were as many answers as inputs: some
15 MB. Others are counted."""

CANDIDATES_SHOWN = 12
"""Fields that an error names as what may be meant; a message with more is looked up anyway."""

COMBINATIONS = 64
"""Combinations of inputs that one answer may have answered and that are judged: six inputs with two values each."""

KEYS_KEPT = 1_000
"""Messages of an input, and answers, that wait for their counterpart: ten seconds at 100 Hz."""

DECIDED_SHARE = 1.0
"""Of what was published, the share that has to be decided before a run is evidence, where the plan says no other: what
is undecided may have broken the guarantee."""

DIFFERENCES = 10
"""Publications of a topic that a replay shows where they differ from the recording; the rest are counted."""

LEAST_SHARE = 0.5
"""The least `decided:` that a message proposes: who takes less has a recording of something else."""

OPEN_QUESTIONS = 1_000
"""Answers of which a part is missing that are asked of Z3, in one run: some seconds. Others are undecided."""

REMEMBERED = 65_536
"""Values of a variable, and verdicts of a clause, that are remembered at a time: some megabytes."""

CHUNK = 1 << 20
"""Bytes of a trace that are read at a time."""

BATCH = 16_384
"""Messages of a bag that are judged at a time: enough for arrays to pay, and some megabytes."""

BATCH_BYTES = 1 << 24
"""Bytes of these messages, above which fewer are judged at a time: images are large."""

RATE_MESSAGES = 10
"""Messages over which a rate is taken: one that comes a little late says nothing of the rate, and of ten it shows in a
second at 10 Hz."""

TIMES_ALIKE = 10
"""Messages of one topic, one after another, with one time: two may come within a clock's resolution; where so many do,
the clock stood still, and times are no evidence for limits in seconds."""

FRAME_BYTES = 64_000_000
"""Bytes of one message of a running graph; a longer length is taken for a fault of the other side."""

HEADER_BYTES = 1_000_000
"""Bytes of a connection's header: it holds a definition, at most some hundred kilobytes."""

QUEUED_MESSAGES = 100_000
"""Messages of a running graph that wait to be judged; more are lost, counted and told."""

LIVE_APART = Fraction(1, 2)
"""Seconds on a running graph within which messages of two topics may be heard in another order than they were said:
connections on one busy machine differ by some hundredths."""

LIVE_PAUSE = 0.1
"""Seconds without a message after which deadlines are looked at."""

VERDICTS_EVERY = 1.0
"""Seconds between two messages of verdicts where nothing is broken, as ROS's diagnostics are."""

TIMELINE_EVENTS = 100_000
"""Events whose values are read for the picture of a run: a few seconds; of a longer run, one event in so many."""

WORD_LENGTH = 60
"""Characters of a value in that picture: more have no room in it."""

DDS_SETTLE = 0.005
"""Seconds that DDS is given after a message, so that what was said with it is there and can be put into order."""

DDS_TAKEN = 1_000
"""Samples, and writers, that are taken from DDS at a time."""

AGAIN_SECONDS = 1.0
"""Seconds until a ROS 1 master or publisher that did not answer is asked again."""

MASTER_ATTEMPTS = 10
"""How often a master is asked: one that was started at the same moment answers within some seconds."""

PUBLISHER_SECONDS = 5.0
"""For a publisher of ROS 1 to say what its messages hold: one that runs does within milliseconds."""

LISTENER_SECONDS = 1.0
"""Seconds that one who listens may take for a message; who takes longer is left, so that nobody waits for him."""

DDS_MATCH = 5.0
"""Seconds after which a writer that was found and is not matched is told."""

LATEST_TIME = 10**12
"""Seconds, 31,700 years: a greater time of an event is none, but perhaps nanoseconds."""

EVENTS_WITHOUT_CLOCK = 10_000
"""Events that wait for a clock's first reading: seconds; where it never comes, what came later is not judged."""

TICKS = 10**20
"""In a second: times are compared as whole numbers of these, since a trace writes at most 20 decimals."""

GRACE = Fraction(1, 20)
"""Seconds after a deadline until silence is told: messages have a way to go."""

JITTER = Fraction(1, 100)
"""Seconds by which times may go back, and steps that come regularly may be early or late: clocks are no better."""
