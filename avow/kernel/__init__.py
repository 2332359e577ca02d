"""The kernel: what decides that a claim about a composed system is proved. docs/kernel.md says what it does; read then
calculus/proofs/kernel.dfy (the theorem), `statements`, `certificate`, `text`, `check`, `solvers`. Engines
(`avow.calculus`) only *find*: no wrong hint makes a claim true. Of Avow only the language and base are used here.
"""
