"""Is a contract worth verifying? Realizability, conflicts, vacuity, redundancy, with witnesses and counterexamples.

Start reading at: `avow.sanity.claims` (the claims), `avow.sanity.analysis` (the answers).
"""
