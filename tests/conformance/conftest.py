"""Dafny takes ten seconds for some of the suite: CI asks for one of a kind, and the nightly run for all."""

from __future__ import annotations

import pytest

LONG = (
    "test_one_obligation_at_a_time",
    "test_what_it_says_not_to_look_at",
    *(f"{name}[wrong]" for name in ("test_hostile_names", "test_a_hostile_folder", "test_files_that_are_missing")),
)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "::TestDafny::" in item.nodeid and item.name.startswith(LONG):
            item.add_marker(pytest.mark.nightly)
