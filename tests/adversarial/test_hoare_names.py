"""A name that begins as a keyword does is a name: `in'`, `or'`, `do_it`."""

from __future__ import annotations

from pathlib import Path

from avow.base.verdict import Verdict

from .settling import settle

CONTRACT = """
node n { inputs( in' : NATURAL, or' : BOOL ) outputs( not' : NATURAL, do_it : BOOL ) topics()
  guarantee same ( out.not' == in.in' ) guarantee flag ( out.do_it <=> not in.or' ) }
"""


def test_keywords_with_a_prime(tmp_path: Path) -> None:
    program = "not' := in'\nIF or' or not or' THEN\n   do_it := not or'\nELSE\n   do_it := TRUE\n"
    found = settle(tmp_path, CONTRACT, "hoare: {program: p.imp}", {"p.imp": program})
    assert {name: outcome.verdict for name, outcome in found.items()} == dict.fromkeys(("same", "flag"), Verdict.PROVED)
