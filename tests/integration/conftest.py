"""Fixtures: studies that have ended, which tests of the whole program share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from tests.integration.studies import Finished, finished_study, make_once


def _study(fixture: str, overrides: Mapping[str, Any]) -> Any:
    """Make the fixture of the small study with other keys."""

    @pytest.fixture(scope="session", name=fixture)
    def make(tmp_path_factory: pytest.TempPathFactory) -> Finished:
        return finished_study(tmp_path_factory, fixture, overrides)

    return make


finished = _study("finished", {})
short = _study("short", {"search.trials": 4})  # no surrogate is fitted of four designs
in_drake = _study("in_drake", {"solver.engine": "drake"})


@pytest.fixture(scope="session")
def reported(finished: Finished, tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """The small study with its report."""

    def make(folder: Path) -> None:
        finished.copy(folder)
        assert ds.load_result(folder).report() == folder / "report.html"

    return make_once(tmp_path_factory, "reported", make)
