"""The interface between a verification backend and the core. Start reading at: `avow.backend_kit.protocol` (what a
backend offers), `avow.backend_kit.given` (reading what the plan gives
it), `avow.backend_kit.registry` (which backends there are).
"""
