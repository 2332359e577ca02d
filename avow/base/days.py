"""Days that people write: ISO 8601, and in the past where they say what was done."""

from __future__ import annotations

import re
from datetime import UTC, date, datetime, timedelta

EARLIEST = date(2000, 1, 1)
"""Years before ROS, and before anything that a contract is of: an earlier day is a slip of the pen."""
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}", re.ASCII)


def wrong_day(text: str, *, past: bool = True) -> str:
    """What is wrong with a day such as 2026-11-21, in words; empty: nothing. With `past` it says when something was
    done, and is not still to come anywhere on earth."""
    try:
        if not _DAY.fullmatch(text):  # the standard has other forms, which do not sort as texts
            raise ValueError
        day = date.fromisoformat(text)
    except ValueError:
        return f"{text!r} is no date of the calendar such as 2026-11-21"
    if day < EARLIEST:
        return f"{text} is long before any contract"
    latest = datetime.now(UTC).date() + timedelta(days=1)  # somewhere it may be tomorrow already
    return f"{text} is still to come" if past and day > latest else ""
