"""The verification backends, one folder each; found by the core through the entry-point group ``avow.backends``.

The folder stands at the top level and is the package `avow.backends`: in a wheel by its place, in a checkout through
`avow/backends/__init__.py`. Nothing called plain ``backends`` is ever importable: two copies of one module would be two
different backends. Within its folder a backend imports itself relatively, and the core as ``avow.…``.
"""

if __name__ != "avow.backends":
    raise ImportError("import the backends as avow.backends, never as a top-level package")
