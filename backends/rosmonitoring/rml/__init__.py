"""A node's guarantees as an RML specification (`translate`). The tests read it back, and hold an interpreter of theirs
against the engine (`tests/oracle/rml.py`)."""
