"""Days that people write: ISO 8601, and in the past where they say what was done."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta


def wrong_day(text: str, *, past: bool = True) -> str:
    """What is wrong with a day, in words; empty: nothing. With `past` it says when something was done, and is not still
    to come anywhere on earth."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return f"{text!r} is no date of the calendar"
    latest = datetime.now(UTC).date() + timedelta(days=1)  # somewhere it may be tomorrow already
    return f"{text} is still to come" if past and day > latest else ""
