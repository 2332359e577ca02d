"""A person's recorded review (see `docs/backends/review.md`).

`record` reads it, `signature` who signed it, `freshness` whether what was read is still what stands there; `stamp`
fills the digests in.
"""

from .backend import ReviewBackend

BACKEND = ReviewBackend()
