"""This backend's numbers: limits of reading, search and display; each with its reason."""

CONFIDENCE = 0.95
"""The confidence of the reported bound on the probability of failure: the common level of the rule of three."""

REJECTED_CASES = 20
"""Rejected cases per case tried, beyond which the assumptions are met too rarely for a result."""

SHRINKING_SECONDS = 8.0
"""Seconds spent on making a failing case simpler."""

BATCH = 50
"""Calls that a second process repeats at a time, so that the cost of sending them is shared."""

ASKED_AGAIN = 200
"""The first requests, which a second process repeats: they cover most thresholds, at a fraction of the time."""

ASKED_OFTEN = 10_000
"""Calls that repeat the shortest of these in turn, each twice: a quarter of an hour at ten hertz."""

SECONDS_OFTEN = 3.0
"""Seconds for these: a slow function is called less often."""

APART = 4
"""Cases in which NaN, the infinities and the negative zero are tried: a fault there rarely depends on other inputs."""

LOGGED_RUNS = 3
"""Runs of a callback class that its log has in full, so that a reader sees what a run is; the seed gives all."""

OPAQUE_VALUES = 4
"""Elements of an opaque type, and of a relation: so few that two draws are often equal."""

CONSTANTS_COMBINED = 6
"""Constants up to which their sums and differences are tried as well."""

LONG_SEQUENCES = (50, 300, 1100)
"""Lengths at which a sequence is always tried: a laser scan has a thousand elements and more."""

LONGEST_SEQUENCE = 4096
"""Numbers up to this one are also tried as lengths: a laser scan has a thousand elements and more."""

LENGTHS_BESIDE = 20
"""Up to so many lengths are also tried one shorter and one longer."""

CONSTANTS_READ = 300
"""So many constants of a program are read."""

DATA_READ = 1000
"""So many characters of a data file that a program names are read: its first rows, as each number is a threshold."""

LARGEST_CONSTANT = 2**64
"""Larger constants are not thresholds of a robot: no machine word holds them."""

STEPS = 20
"""Steps of one run of a class: a count to ten, or a delay of a second at ten hertz, ends within them."""

LONGEST_RUN = 400
"""The largest number of additional steps of a run: twice the sum of the contract's limits, so that responses become
due, may be too many."""

LONGEST_TEXT = 60
"""Longer texts of a program are messages, not values."""

SMALL = 3
"""Identifiers and coordinates are drawn from so few that relations overlap."""

RUNS_TOGETHER = 25
"""Runs of a callback class in one process, each with a new object: starting a process takes as long as many runs."""

SILENCE = 3
"""Seconds of virtual time that such a run continues after its last message: most timers and time-outs are shorter."""

TINY = 1e-9
"""Neighbouring doubles nearer to zero are too long to be worth writing."""

ALTERNATIVES = 16
"""Alternatives of a quantified formula beyond which a generated test leaves it to Avow: it would be unreadable."""

MORE_CASES = 5
"""This many times the wanted cases may be drawn until each condition of a guarantee was met."""
