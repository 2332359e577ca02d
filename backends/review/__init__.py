"""The review backend (see `docs/backends/review.md`)."""

from .backend import ReviewBackend

BACKEND = ReviewBackend()
