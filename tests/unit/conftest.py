"""Fixtures: a result for reports, and made-up shifts."""

from __future__ import annotations

import pytest

from tests.analytic import AnalyticShifts
from tests.search_results import Row, search_result


@pytest.fixture
def result() -> Row:
    """Result of a small search."""
    return search_result()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> AnalyticShifts:
    """Made-up shifts in place of simulated ones."""
    shifts = AnalyticShifts()
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", shifts)
    return shifts
