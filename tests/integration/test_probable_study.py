"""A search under a limit on the share of manufactured clutches that keep all checks."""

from __future__ import annotations

from pathlib import Path

import pytest

import dogshape as ds
from dogshape.sim.strength.production import kept_share, standard_error

SETTINGS = {
    "operating": {"mismatch_rpm": [50.0], "force_N": [469.0]},
    "expectation.angles": 3,
    "solver.engine": "planar",
    "search.objectives": ["expected_shift_time_s", "feasible_probability"],
    "search.limits.feasible_probability": 0.99,
    "search.sampler": "space_filling",
    "search.trials": 5,
    "search.confirm_designs": 1,
    "search.confirm_angles": 3,
    "tolerance.distribution": "uniform",
}


@pytest.mark.slow  # test_production.py has the limit without a search
def test_a_search_keeps_a_share_of_manufactured_clutches(tmp_path: Path) -> None:
    study = ds.Study("mq200_paper", SETTINGS)
    found = study.search(tmp_path / "r", jobs=1, report=False)
    rows = found.record["trials"]
    proposed = [row for row in rows if not row["prototype"]]
    assert len(proposed) == 4
    for row in rows:
        dog = study.config.dog_with({key: row[key] for key in study.config.variables})
        share = kept_share(dog, study.config.limits)
        assert row["feasible_probability"] == share
        assert row["standard_errors"]["feasible_probability"] == standard_error(share)
        assert ("feasible_probability" in row["failed"]) == (share < 0.99)
    # What the limit forbids is never proposed; the prototype is, and fails it.
    assert all(row["feasible_probability"] >= 0.99 for row in proposed)
    assert [row["failed"] for row in rows if row["prototype"]] == [["feasible_probability"]]
