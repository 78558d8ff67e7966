"""Fixtures: studies that have ended, which tests of the whole program share."""

from __future__ import annotations

import pytest

from tests.integration.studies import Finished, finished_study


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """The small study, run to its end by one worker."""
    return finished_study(tmp_path_factory, "small")


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """The small study with four designs, of which no surrogate is fitted."""
    return finished_study(tmp_path_factory, "short", trials=4)


@pytest.fixture(scope="session")
def in_drake(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """The small study, all of it in Drake."""
    return finished_study(tmp_path_factory, "drake", engine="drake")
