"""The pytest suite that every verification backend has to pass, third parties' backends as well as our own.

A test file names the backend and seeds it with contracts whose verdicts are known:

    from avow.conformance import Conformance, Seeded

    class TestCoin(Conformance):
        backend = BACKEND
        seeded = (Seeded("heads", CONTRACT, {"heads": True}, {"same": Verdict.TESTED}), …)

`avow.conformance.suite` contains the tests, `avow.conformance.seeded` defines seeded cases, and
`avow.conformance.plugin` is the pytest plugin. See `docs/developers/adding-a-backend.md`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from avow.conformance.seeded import Seeded
    from avow.conformance.suite import Conformance

__all__ = ["Conformance", "Seeded"]


def __getattr__(name: str) -> Any:
    """The two names are imported on demand: pytest loads the plugin in every environment that has Avow."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import pytest

    pytest.register_assert_rewrite("avow.conformance.seeded", "avow.conformance.suite")
    from avow.conformance import seeded, suite

    return {"Conformance": suite.Conformance, "Seeded": seeded.Seeded}[name]
