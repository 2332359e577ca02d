"""The engine made fast over recorded lines: what was found is remembered by what it depends on (`monitors`)."""
