"""A node's guarantees as an RML specification: written (`translate`), read back (`reader`), and run by an interpreter
of our own (`interpreter`), which the tests hold against the engine."""
