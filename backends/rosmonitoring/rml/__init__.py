"""A node's guarantees as an RML specification (`translate`). The tests read it back, and compare an interpreter of
their own with the engine (`tests/oracle/rml.py`)."""
