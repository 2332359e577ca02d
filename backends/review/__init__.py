"""A person's recorded review (see `docs/backends/review.md`).

`record` reads it, and checks whether the reviewed files and guarantees have changed; `signature` checks who signed it;
`stamp` fills in the digests.
"""

from .backend import ReviewBackend

BACKEND = ReviewBackend()
