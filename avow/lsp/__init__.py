"""The language server: an editor's requests about .rcl files and plans.

Start reading at `avow.lsp.server`. It converts the plain data of `features` and its neighbours to the protocol's form;
`project` determines a document's system, `background` evaluates the sanity claims in its own process.
"""
