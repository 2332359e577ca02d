"""Numbers as tables and plans write them."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from avow.base.plain import exact


def test_a_number_is_read_as_people_write_it() -> None:
    assert [exact(t) for t in ("2.5", "1e-3", "-7", " 4 ")] == [Fraction(5, 2), Fraction(1, 1000), -7, 4]
    for wrong in ("1_0", "٣", "1,5", "", "1/0", "inf"):
        with pytest.raises(ValueError, match=re.escape(wrong) or "^$|Invalid"):
            exact(wrong)
