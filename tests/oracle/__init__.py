"""The brute force that tests hold Avow against: what follows from `reference.meaning`, by trying everything.

- `domains`: some values of each type, and Avow's own values as the reference has them;
- `stepping`: clauses with memory a step at a time, so that all runs of a system can be walked through;
- `runs`: all runs of one node, and the game that it plays against its inputs;
- `sanity`: what the sanity verdicts about a small contract have to be;
- `rml`: RML as a monitor executes it, read by a grammar of its own;
- `rosmonitoring`: what ROSMonitoring takes as a configuration.

The first four use none of Avow's evaluation, compilation to cells or solving.

Apart from it and from `drawn`, on purpose, stand

- whole systems, drawn and walked through in one file, since the walk knows just the wiring that is drawn there; their
  clauses are read here: `calculus.test_random_systems` (delays, subsystems), `calculus.test_random_runs` (functions and
  sequences within a scenario's domains, so with formulas of its own), `temporal.test_systems` and `test_timed_systems`
  (two nodes whose clauses have memory), `adversarial.drawn` (all that a system may have, and edits of it);
- an oracle whose subject is no typed term: FRET's intervals in `fretish.test_meaning`;
- a generator of terms that no text of a contract would be: that of `logic.test_one_point`.
"""
