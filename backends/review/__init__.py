"""A person's recorded review (see `docs/backends/review.md`).

`record` reads it, and says whether what was read is still what stands there; `signature` who signed it; `stamp` fills
the digests in.
"""

from .backend import ReviewBackend

BACKEND = ReviewBackend()
