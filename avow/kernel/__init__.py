"""The kernel: what decides that a claim about a composed system is proved. docs/kernel.md says what it does; read then
calculus/proofs/kernel.dfy (the theorem), `statements`, `certificate`, `text`, `check`, `solvers`.

Engines (`avow.calculus`) only *find*; a wrong hint of theirs can make a claim unknown, never true. Nothing here imports
anything of Avow but the term language and `avow.base`.
"""
