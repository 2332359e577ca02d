"""The kernel decides whether a claim about a composed system is proved (`docs/developers/kernel.md`).

The theorem is `calculus/proofs/kernel.dfy`. The modules are `statements`, `certificate`, `text`, `check` and `solvers`.
Engines (`avow.calculus`) only search: no wrong hint makes a claim true. The kernel imports only the language and base.
"""
