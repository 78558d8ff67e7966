"""Objectives of designs whose shifts all fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.search.confirmation import Executors, _resimulated
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.expectation import Estimate, mean_over
from tests.integration.test_objective_studies import _run, _tiny


def test_a_mean_of_nothing_is_unknown_and_a_point_of_nothing_is_left_out() -> None:
    nothing = mean_over([1.0, 2.0], [[], []])
    assert np.isnan([nothing.value, nothing.standard_error]).all()
    assert mean_over([1.0, 2.0], [[], [3.0, 3.0, 3.0]]) == Estimate(3.0, 0.0)


def test_designs_whose_shifts_all_fail_are_as_if_not_simulated(tmp_path: Path) -> None:
    """Their times count as not engaged; what they strike is unknown, and never the best."""
    study = _tiny("mq200_three", "solver.max_steps=20", "search.trials=2")
    result, shifts = _run(study, tmp_path)
    assert not shifts
    assert result["failed_shifts"] == {"no end after solver.max_steps = 20": 12}
    assert result["n_simulated_designs"] == 0
    assert result["best"] is result["confirmation"] is None
    for row in result["trials"]:
        assert row["peak_impact_force_N"] is None
        assert row["failed"] == ["simulation"]
        assert not row["feasible"]
    executors = Executors(scratch_executor(1), scratch_executor(1))
    with pytest.raises(InputError, match="every shift of design 0 at new angles failed"):
        _resimulated(study, {"design 0": study.prototype}, executors)
