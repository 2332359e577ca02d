"""The brute force that tests hold Avow against: meanings by the book, on finite domains, by trying everything.

- `values`: typed terms at one step, and over runs of steps (clauses with memory, responses);
- `seconds`: the same over timed words, where limits are in seconds;
- `sanity`: what the sanity verdicts about a small contract have to be;
- `systems`: all runs of a system of nodes, and the game of a node against its inputs.

It reads terms and contracts, and uses none of Avow's evaluation, compilation to cells or solving. Beside it stand those
whose subject is no typed term: `differential.oracle` (what was written, before Avow's parser saw it, and programs that
run), the interpreter of RML in `rosmonitoring.test_agreement` and FRET's intervals in `fretish.test_meaning`.
"""
