"""Fixtures of tests about reports."""

from __future__ import annotations

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from tests.found import Row, found


@pytest.fixture
def result() -> Row:
    """What a small search found."""
    return found()


@pytest.fixture
def study() -> Setup:
    """The paper's study."""
    return load_study("mq200_paper")
