"""Fixtures of tests about reports."""

from __future__ import annotations

import pytest

from tests.found import Row, found


@pytest.fixture
def result() -> Row:
    """What a small search found."""
    return found()
