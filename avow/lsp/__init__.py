"""The language server: what an editor asks about .rcl files and plans.

Front door: `avow.lsp.server`. It puts in the protocol's words what `features` and its neighbours answer as plain data;
`project` says what a document belongs to, `background` asks the sanity claims in a process of its own.
"""
