"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

CONFIDENCE = 0.95
"""Of the bound on the probability of failure that is told: the common level, at which the rule of three holds."""

REJECTED_CASES = 20
"""Rejected cases for each one that was tried, beyond which the assumptions are too rarely met to say anything."""

SHRINKING_SECONDS = 8.0
"""Seconds spent on making a failing case simpler."""

BATCH = 50
"""Calls that a second process is asked to repeat at a time: so that the time to hand them over is shared."""

ASKED_AGAIN = 200
"""The first questions, which are put to a second process too: most thresholds, at a fraction of the time."""

ASKED_OFTEN = 10_000
"""Calls by which the shortest of these are asked again in turn, each twice: a quarter of an hour at ten hertz."""

SECONDS_OFTEN = 3.0
"""Seconds for these: a slow function is called less often."""

APART = 4
"""Cases in which NaN, the infinities and the negative zero are tried: a fault there rarely depends on other inputs."""

OPAQUE_VALUES = 4
"""Elements of an opaque type, and of a relation: so few that two draws meet."""

CONSTANTS_COMBINED = 6
"""Constants up to which their sums and differences are tried as well."""

LONG_SEQUENCES = (50, 300, 1100)
"""A sequence is also tried with so many elements, whatever is written: a laser's scan has a thousand and more."""

LONGEST_SEQUENCE = 4096
"""Numbers up to which they are taken for lengths: a laser's scan has a thousand and more."""

LENGTHS_BESIDE = 20
"""So many lengths are tried one shorter and one longer, too."""

CONSTANTS_READ = 300
"""So many constants of a program are looked at."""

DATA_READ = 1000
"""So many letters of a data file that a program names are looked at: its first rows, as each number is a threshold."""

LARGEST_CONSTANT = 2**64
"""Larger constants are no thresholds of a robot: no machine word holds them."""

STEPS = 20
"""Steps of one run of a class: what counts to ten, or waits for a second at ten hertz, comes to its end."""

LONGEST_RUN = 400
"""Steps by which a run is longer at most, however long the contract's limits are: twice their sum, so that what a
response demands comes due, would be too many."""

LONGEST_TEXT = 60
"""Longer texts of a program are messages, not values."""

SMALL = 3
"""Identifiers and coordinates are drawn from so few that relations meet."""

RUNS_TOGETHER = 25
"""Runs of a callback class that one process is asked, each of a new object: to start one takes as long as many runs."""

SILENCE = 3
"""Seconds, of virtual time, that such a run goes on after its last message: most timers and time-outs are shorter."""

TINY = 1e-9
"""Doubles beside zero that are nearer to it are too long to be worth writing."""

ALTERNATIVES = 16
"""Alternatives of a quantified formula beyond which a generated test leaves it to Avow: nobody would read it."""

MORE_CASES = 5
"""Times as many cases as are wanted may be drawn until each condition of a guarantee was met."""
