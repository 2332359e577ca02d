"""The tests that every verification backend has to pass: for pytest, and for third parties' backends as for our own.

A test file names the backend and seeds it with contracts whose verdicts are known:

    from avow.conformance import Conformance, Seeded

    class TestCoin(Conformance):
        backend = BACKEND
        seeded = (Seeded("heads", CONTRACT, {"heads": True}, {"same": Verdict.TESTED}), …)

`avow.conformance.suite` says what is tested, `avow.conformance.seeded` what a seeded case is. See
`docs/adding-a-backend.md`.
"""

import pytest

pytest.register_assert_rewrite("avow.conformance.seeded", "avow.conformance.suite")

from avow.conformance.seeded import Seeded  # noqa: E402 - pytest is to see their assertions first
from avow.conformance.suite import Conformance  # noqa: E402

__all__ = ["Conformance", "Seeded"]
