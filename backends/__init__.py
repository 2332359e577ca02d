"""The verification backends, one folder each; found by the core through the entry-point group ``avow.backends``.

The folder stands at the top level and is reached as ``avow.backends`` through a symbolic link, so that nothing
called plain ``backends`` is ever importable: two copies of one module would be two different backends.
"""

if __name__ != "avow.backends":
    raise ImportError("import the backends as avow.backends, never as a top-level package")
