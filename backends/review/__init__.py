"""The review backend (see `docs/backends/review.md`)."""

from avow.backends.review.backend import ReviewBackend

BACKEND = ReviewBackend()
