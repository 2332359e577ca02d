"""Evidence: claims (`obligation`), attempts at them (`record`), and the file that keeps those (`ledger`: append-only,
hash-chained).

`status` is the lattice: what unlike evidence says of one claim; `claims` what follows for claims that rest on claims;
`currency` which records still count.
"""
