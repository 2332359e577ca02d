"""Evidence: claims (`obligation`), attempts at them (`record`), and the file that keeps the attempts (`ledger`:
append-only, hash-chained).

`status` is the lattice: what different kinds of evidence together show for one claim; `claims` derives the status of
claims that rest on claims; `currency` decides which records still count.
"""
