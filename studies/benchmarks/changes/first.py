"""The first test of a session that fails."""

from __future__ import annotations

import pytest


class First:
    """Notes the first test that fails."""

    failed = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note it."""
        self.failed = self.failed or (report.nodeid if report.failed else "")

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that cannot be collected."""
        self.failed = self.failed or (f"{report.nodeid} (it cannot be collected)" if report.failed else "")
