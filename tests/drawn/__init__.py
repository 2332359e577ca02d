"""What tests draw by chance: formulas, clauses and contracts, always the same for a seed.

- `formulas`: formulas over any names and types, as text; `Knobs` say what they are made of;
- `memory`: clauses that speak of other steps, and runs;
- `contracts`: whole contracts, small enough to write out every case, or as strange as the language allows.

What stands apart from it, and why, `oracle` says.
"""
