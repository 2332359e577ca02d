"""A running program does what the checked one does, told what it perceives."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.backends.ajpf.live import Endless, Running
from avow.base.diagnostics import Rejected

PROGRAM = """
GWENDOLEN

:name: lamp

:Initial Beliefs:

next(1, 2)

:Initial Goals:

look(1) [perform]

:Plans:

+!look(N) [perform] : { B next(N, M) } <- +at(N), peek(N, M), +seen(N);
+dark : { ~B lit } <- +lit, print("on"), switch(on);
"""


def running(tmp_path: Path, text: str = PROGRAM) -> Running:
    path = tmp_path / "a.gwen"
    path.write_text(text, encoding="utf-8")
    return Running(path)


def test_it_acts_and_rests_and_perceives(tmp_path: Path) -> None:
    agent = running(tmp_path)
    assert agent.perceive([]) == ("peek", ("1", "2"))
    assert agent.believes("at(1)")
    assert not agent.believes("seen(1)")
    assert agent.perceive([]) is None
    assert agent.believes("seen(1)")
    assert agent.perceive(["dark"]) == ("switch", ("on",))
    assert agent.perceive(["dark"]) is None
    assert agent.believes("dark")
    assert agent.perceive([]) is None
    assert not agent.believes("dark")
    assert agent.perceive(["dark"]) is None  # it is lit


@pytest.mark.slow
def test_a_program_that_never_acts_is_told(tmp_path: Path) -> None:
    loop = PROGRAM.replace("+at(N), peek(N, M), +seen(N);", "+!look(N) [perform];")
    with pytest.raises(Endless):
        running(tmp_path, loop).perceive([])


def test_what_is_no_percept_or_no_program_is_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no percept"):
        running(tmp_path).perceive(["dark("])
    with pytest.raises(Rejected):
        running(tmp_path, "GWENDOLEN\n:name:")
