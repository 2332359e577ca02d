"""Times and retries of a run: workers, a cluster, the language server. In wall-clock seconds."""

TRIAL_SECONDS = 120.0
"""For the one-line job with which `avow doctor` tries a tool: a cold start of .NET takes ten."""

CHARACTERS_PER_SECOND = 500_000
"""About how fast texts are checked: a text so long that it takes a while is checked when its author pauses."""

NOTICED_SECONDS = 0.05
"""So many seconds are a while."""

CONFORMANCE_PATIENCE = 60.0
"""Seconds within which a discharge with hardly any time must be back, on a busy machine."""

SUBJECT_PATIENCE = 10.0
"""Seconds that a subject may take for one answer: a robot's step takes milliseconds, its first import seconds."""


CLUSTER_CONNECT = 30.0
"""Seconds to reach a cluster's scheduler, which may just be starting."""

CLUSTER_RETRIES = 2
"""How often a work is sent again after the connection to the scheduler was lost."""

CLUSTER_LOOK = 2.0
"""Seconds between two looks whether a cluster still has workers for what is under way."""

CLUSTER_ANSWER = 15.0
"""Seconds that a scheduler may take to say which workers it has, on a loaded machine."""

CLUSTER_PATIENCE = 60.0
"""Seconds that a work waits for a worker when there is none for it: one that is started again takes some five."""

WORKER_GRACE = 90.0
"""Seconds above the tool's own limits that a worker gets to translate and write."""

WALL = 5
"""A limit of processor seconds ends after so many times that time on the clock at the latest: a program may sleep."""

PROCESSOR_LOOK = 0.1
"""Seconds between two looks at the processor time used: a look takes a millisecond."""

FORK_LOOK = 0.5
"""Seconds between two looks whether a work is still wanted."""

FORK_STOP = 15.0
"""Seconds that a supervisor gets to end a job's process."""

VERSION_SECONDS = 20.0
"""For a tool to say its version: one that runs on Java or .NET takes seconds on a loaded machine."""

MASTER_SECONDS = 5.0
"""For a ROS master to answer: one on the same network does within milliseconds."""

DDS_SECONDS = 3.0
"""For which a DDS domain is listened to before its graph is drafted: who is there answers a newcomer within one."""

DDS_PAUSE = 0.05
"""Seconds between two looks at what DDS has found meanwhile."""

DDS_NAMES = (24, 16)
"""Bytes of an endpoint's name in ROS 2's announcements: up to Humble, and since."""

LAST_DOMAIN = 232
"""The greatest DDS domain: its ports are computed from it, and end at 65535."""

DRAFT_MESSAGES = 200_000
"""Messages of a bag that a draft looks at for its comments: seconds, and the ranges of what follows are no others."""

COLLECTED = 10_000_000
"""Objects that a run makes before Python looks for those that hold each other: nearly all that it makes stays to its
end, and each look at 100,000 takes a tenth of what an edit costs."""

COLLECTED_IN_WORKS = 100_000
"""The same in a worker, where what is found may hold a solver's memory."""

SAMPLE_TRIES = 12
"""Draws for one case that meets the assumptions; then any is taken, which validates all the same."""

SAMPLE_LENGTHS = (0, 1, 2, 3, 4, 5, 8, 12)
"""Lengths of drawn sequences: none, few, and more than any window of a filter that is written out."""

SUBJECT_BATCH = 100
"""Cases in one message to the class' process: each message wakes another process."""

SAMPLES_SHIFTED = 150
"""Cases with the differences of a solver's values: one in some ten of them rounds as the solver says."""

SANITY_PAUSE = 0.4
"""Seconds without a change of a text after which the sanity of its nodes is asked: as long as between two words."""

NODES_REMEMBERED = 400
"""Nodes whose sanity the language server remembers, by their meaning: more than a system has."""

SANITY_LINE = 1 << 24
"""Bytes of the answers about one node."""

FIXES_TRIED = 12
"""Ways of doing what one hint says that the language server tries: each is a check of the text."""

DRIVEN_SECONDS = 60.0
"""Seconds for one run of a callback class, whose time is virtual: thousands of messages take one."""

NUMBERS_AGAIN = 0.3
"""How often a message that is generated has the numbers of an earlier one: robots come where they were sent."""

LONGEST_GAP = 60.0
"""Seconds between two messages that are generated: a longer time-out is none of a callback's."""

DRIVEN_MEGABYTES = 2048
"""Of memory for such a run."""

DRIVEN_CALLBACKS = 200_000
"""Callbacks of such a run: what calls itself without end makes more."""

BYTE_CODE_ROOM = 100_000_000
"""Bytes free on the disk, below which no byte code is kept: all that Avow imports has a tenth of it."""

TICK_SECONDS = 0.02
"""Seconds in which the clock of file times ticks at least once (a hundredth, at most): two changes with more between
them have different times, where the file system counts less than seconds."""

SETTLED_NS = 2_000_000_000
"""Nanoseconds after a file's last change for which another change might show no other time: coarse clocks tick in
hundredths of a second, some file systems in two seconds."""
