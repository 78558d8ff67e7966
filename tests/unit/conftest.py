"""Fixtures: a result for reports, and made-up shifts."""

from __future__ import annotations

import pytest

from tests.found import Row, found
from tests.made_up import Quick


@pytest.fixture
def result() -> Row:
    """What a small search found."""
    return found()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> Quick:
    """Made-up shifts in place of simulated ones."""
    shifts = Quick()
    monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", shifts)
    return shifts
