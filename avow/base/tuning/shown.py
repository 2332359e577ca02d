"""How much of a thing a person is shown. Nothing is lost: `report.json` has everything but old records, and the ledger
has those, too."""

TOOL_WORDS = 160
"""Characters of a tool's own words in a suggestion: two lines."""

HAZARD_CHARACTERS = 120
"""Characters of a hazard's text on the first screen: about a line, so that a qualification at its end is not lost."""

SOURCE_COLUMNS = 100
"""Columns of a source line that are shown around a fault: a terminal's width, less its margin."""

OLDER_RECORDS = 2
"""Newest earlier records of each claim and method in a report: the answer before the claim or the unit under test
changed, and the one before a new version of a tool. The ledger has all records."""

STEP_VARIABLES = 12
"""Variables shown of each step of a run: more fit in no line of a table."""

RULE_NODES = 40
"""A rule over more nodes is shown in its first and last lines."""

DOMAIN_VALUES = 8
"""Values of a domain that a message lists, so that it stays one line."""

DIFF_REASONS = 3
"""Reasons on the terminal; the page and the JSON have all."""

FORMULA_PARTS = 12
"""So many parts of a formula are shown, and the rest is left out."""

SENTENCE_CHARACTERS = 60
"""Characters of a sentence that a lint quotes, so that the message stays one line."""

DIAGNOSTICS = 200
"""More than this of one file are of no use to anyone: reading ends there."""

ALIKE = 5
"""Diagnostics of one file that differ in their place alone: one mistake, made again and again, hides no other."""

WARNINGS = 3
"""Warnings of a system that a run prints, a line each: `avow check` shows all."""

GATE_REASON = 240
"""Characters of a failing gate's reason on the terminal: three lines."""

NODE_BOXES = 12
"""Guarantees of a node that have a box each; more are grouped by their status."""

CHANGES_UNFOLDED = 40
"""Longer groups are folded, but for what got worse."""

RUN_ROWS = 200
"""Rows of a run that the page shows at all."""

ROWS_LEFT_OUT = 3
"""Leaving out fewer rows than this is not worth a note."""

CONTRACT_LINES = 1200
"""Lines of a contract in the PDF or the appendix, which then says so: some twenty pages."""

SUMMARY_ROWS = 200
"""Rows of a table in the summary; all of them are in report.json."""

SUMMARY_SOURCE = 40_000
"""Characters of contracts in the summary: code hosts cut a comment at some 65,000."""

ROWS_UNFOLDED = 60
"""So many rows of a long list are shown at once; the rest is folded."""

OBLIGATIONS_IN_FULL = 1500
"""So many obligations are shown with everything, those with something to tell first; the others in brief, so that a
page over ten thousand is still a page that opens."""

GUARANTEE_ROWS = 600
"""So many guarantees have a row of their own in the summary; beyond that each node's line counts them."""

FINDING_CHARACTERS = 240
"""Characters of a finding in the answer. The obligation has all of it."""

PDF_OBLIGATIONS = 500
"""Obligations in the PDF: nobody turns more pages; all are in report.json, and the PDF says so."""

PDF_COLUMNS = 9
"""Columns of a run that fit on a page. For a wider run only the reason is shown."""

COLOURED_CHARACTERS = 400_000
"""Characters of a file that are still coloured: colours triple a page, and nobody reads that much of it."""

ANCHORED_LINES = 4_000
"""So many lines have an anchor each; of longer files only those that something in the report points at."""

DETAILS = 6000
"""Characters of a record's details: about three screens; report.json has all."""

FORMULA_COLUMNS = 88
"""A formula longer than this many characters is broken into lines: the width of the page's column for formulas."""

NODES_DRAWN = 200
"""More nodes than this are not drawn: nobody would find anything in the picture."""

SUBSYSTEMS_DRAWN = 40
"""Subsystems of which the inside is drawn."""

RECORDS = 8
"""Records that `avow explain` lists of one file or digest; the ledger has all."""

DRAFTED_FIELDS = 12
"""Fields of one topic's messages that `avow init` drafts ports for: a person removes those that are not needed."""

DRAFTED_WORDS = 6
"""Different words of a field that a draft lists beside it."""

TIMELINE_COLUMNS = 128
"""Columns of a run's timeline: some five points of a picture each. A power of two: columns are joined in pairs."""

TIMELINE_PORTS = 12
"""Ports of one timeline that have a lane; clauses and ports with a finding always have one."""

TIMELINES = 4
"""Timelines of one guarantee in its evidence, those with a finding first."""

EDIT_CHARACTERS = 160
"""Of an edited part of a contract or plan, before and after: some two lines of either."""
