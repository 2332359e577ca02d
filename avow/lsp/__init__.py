"""The language server: what an editor asks about .rcl files."""
