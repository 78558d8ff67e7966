"""Fixtures: studies that have ended, which tests of the whole program share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from tests.integration.studies import Finished, finished_study


def _study(fixture: str, more: Mapping[str, Any]) -> Any:
    """Make the fixture of the small study with other keys."""

    @pytest.fixture(scope="session", name=fixture)
    def make(tmp_path_factory: pytest.TempPathFactory) -> Finished:
        return finished_study(tmp_path_factory, fixture, more)

    return make


finished = _study("finished", {})
short = _study("short", {"search.trials": 4})  # no surrogate is fitted of four designs
calm = _study("calm", {"search.trials": 4, "search.sampler": "space_filling"})
in_drake = _study("in_drake", {"solver.engine": "drake"})
