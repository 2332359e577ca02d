"""Is a contract worth verifying? Realizability, conflicts, vacuity, redundancy, with witnesses and counterexamples.

Front doors: `avow.sanity.claims` (what is asked), `avow.sanity.analysis` (the answers).
"""
