"""What a verification backend promises to the core, and how the core finds it.

Front doors: `avow.backend_kit.protocol` (what a backend offers), `avow.backend_kit.registry` (which there are),
`avow.backend_kit.tools` (finding outside tools).
"""
