"""The largest inputs that are read, and the deepest: beyond them a text is refused with a place and a message, so that
no input takes all memory or ends in a traceback.
"""

REQIF_BYTES = 200_000_000
"""Of a file, and of all files that an archive holds, unpacked: an archive of a few kilobytes may unpack to anything."""

OUTPUT_KEPT = 4_000_000
"""Characters of output kept: a tool that prints without end must not fill the memory."""

CHANNEL_KEPT = 64_000_000
"""Bytes kept of what comes through a judge's channel: a subject that writes without end must not fill the memory."""

SOURCE_SHOWN = 20_000_000
"""Bytes of a file that are looked at for the lines to show."""

LONGEST_TIMEOUT = 86_400.0
"""A day, in seconds: what asks for more is a slip, and tools' own counters of milliseconds overflow after 24 days."""

CONDITION_DEPTH = 150
"""Deeper formulas are not taken apart: what takes them apart recurses."""

REWRITTEN_DEPTH = 200
"""Deeper formulas are asked about as they are: what would rewrite them recurses."""

SENTENCE = 4_000
"""So many characters of a sentence are read: the lints of sentences look at each word."""

DIGITS = 500
"""Longer numbers are rejected: nobody means them, and arithmetic on them costs more than it is worth."""

CONTRACT_BYTES = 4_000_000
"""A larger file is no contract: at forty bytes a line it has a hundred thousand lines."""

NESTING = 150
"""How deep a formula or type may be nested. Every later pass may recurse as deep as this. A chain of operators is
no nesting: its terms are made shallow by `avow.language.chains`."""

SYSTEMS_WITHIN = 30
"""Systems within systems: each level reads a plan, and a circle that links hide must end."""

ROS_GRAPH_BYTES = 1_000_000
"""A larger file is no graph of one robot: a node with ten topics takes two thousand."""

DEFINITION_BYTES = 2_000_000
"""Of one file that defines message types: the largest package's definitions together are a tenth of it."""

STATEMENT_WORDS = 14
"""Words of an assumption's `says`: so many fit in a line of a report's first screen."""

PLAN_BYTES = 8_000_000
"""A larger file is no plan: data belongs in a table beside it."""

RANGE_VALUES = 100_000
"""Of one range of numbers, which is written out."""

REPAIR_ROUNDS = 20
"""Times that the pieces of a plan at fault are dropped to look at the rest: each may leave another without what it
needs, and nothing but further messages hangs on it."""

LAUNCH_BYTES = 1_000_000
"""Of one launch file: the longest of large robots have a thousand lines."""

LAUNCH_ELEMENTS = 20_000
"""Elements of one launch file, and of all that includes bring in: files that include each other end here."""

LAUNCH_DEPTH = 60
"""Groups within groups, and files within files: what reads them recurses."""

PACKAGES_SEARCHED = 20_000
"""Folders of a workspace that are searched for packages: a robot's has some hundreds."""

ANSWERS_KEPT = 20_000
"""Proved entailments that are carried from run to run: some 2 MB."""

ANSWERED_BY_ONE = 500
"""Questions to one process of a solver: what it keeps to itself does not grow without end."""

CONTRACTS_KEPT = 8
"""Contracts that stay checked in memory: a run loads one, and then asks what there is to say of it."""

NOTED = 2_000
"""Plans and options of one folder of which it is kept between runs that their shape is right."""

SHELVES = 32
"""Folders of which it is kept between runs what their contracts' texts say (some 25 kB a node of ten clauses), what
their ledgers' records say (some 20 kB a node), and what their reports say about each node (some 150 kB)."""

LINES_KEPT = 128
"""Lines of a ledger that are kept together as read: a run reads those after the last whole group again (0.2 ms each),
and one file for each group (0.2 ms)."""

PROGRAM_FILES = 5_000
"""Files of an outside tool that its key covers: Dafny has 60, MCAPL 3,000; a script that names a folder of the system's
would have no end."""

SCRIPT_BYTES = 65_536
"""So much of a tool's script is looked through for the files that it names: a launcher has a few lines."""

FOLDED = 4
"""Files of one folder that a tool looked at, from which on a record tells of the folder: a compiler reads hundreds of
headers, and a record that names each would be a hundred times as long."""

LOG_KEPT = 20_000
"""Bytes of a program's standard error that are kept, the last: a sanitizer's report is its end."""

LAYOUT_FIELDS = 10_000
"""Fields and items of a raw message that are read as arrays: a laser scan has some thousands, an image a million."""

PARAMETER_VALUES = 5
"""A program that is made with a contract's open parameters is tried with so many values: ends and between."""

PARAMETERS_TRIED = 10_000
"""Combinations of values that are looked at for ones that the assumptions allow."""
