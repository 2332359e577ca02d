"""The kernel: what decides that a claim about a composed system is proved. Small, to be read by a stranger in an hour.

Engines (`avow.calculus`) only *find*; a wrong hint of theirs can make a claim unknown, never true. Read in this order:

1. `avow/calculus/proofs/kernel.dfy`: the theorem (`Sound`), checked by Dafny. A run is a sequence of states r(0),
   r(1), …: r(0) holds what delayed edges deliver first, r(t + 1) the values of all ports at step t. A claim is a
   formula over two neighbouring states. A certificate is a list of entries, each shown by questions put to a solver or
   given; the theorem says which questions suffice, and that the given entries of a closed part are all it rests on.
2. `statements`: the claims of a system, as formulas over its values now and one step before, from contract and plan as
   they are now; each is known by the digest of its text.
3. `certificate`: what a certificate is, as data and as JSON.
4. `text`: a formula as SMT-LIB text. The only translation that a certified claim rests on.
5. `check`: the theorem's conditions, held against a certificate; hypotheses and key are computed here.
6. `solvers`: a question put to Z3, and to a second solver where there is one.

Nothing here imports anything of Avow but the term language and `avow.base`.
"""
