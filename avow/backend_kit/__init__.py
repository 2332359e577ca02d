"""What a verification backend promises to the core, and what it gets from it.

Front doors: `avow.backend_kit.protocol` (what a backend offers), `avow.backend_kit.given` (reading what the plan gives
it), `avow.backend_kit.registry` (which backends there are).
"""
