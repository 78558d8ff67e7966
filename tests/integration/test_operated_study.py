"""Searches over shape and shift control together, and of a clutch with its mechanism."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import dogshape as ds
from dogshape.check import check_design
from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.surrogate.store import load
from tests.conftest import SMALL, searching

SETTINGS = {
    "operating": {
        "mismatch_rpm": {"distribution": "normal", "mean": 50.0, "sd": 10.0},
        "force_N": [315.5],
        "samples": 3,
    },
    "expectation.angles": 4,
    "search.audit_shifts": 4,
    "load.landing_share": None,
    "variables": {
        "chamfer_deg": [7.5, 12.0],
        "mismatch_set_rpm": [-100.0, 100.0],
        "force_factor": [0.8, 2.0],
        "rise_factor": [0.7, 1.5],
    },
    "wear": {"crest_loss_mm": 0.1},
    "search.trials": 18,
    "search.startup": 12,
    "search.confirm_designs": 1,
    "search.confirm_angles": 4,
}


def test_shape_and_control_are_searched_together(tmp_path: Path) -> None:
    out, study = tmp_path / "r", ds.Study("mq200_paper", SETTINGS)
    found = study.search(out, jobs=1)
    best, record = found.best, found.record
    confirmed = record["confirmation"]
    assert best is not None
    assert confirmed is not None
    assert all({*OPERATED} <= row.keys() for row in record["trials"])
    points = confirmed["best"]["points"]
    mean = sum(p["mismatch_rpm"] for p in points) / len(points)
    assert mean == pytest.approx(best["mismatch_set_rpm"], abs=1e-5)
    forces = [p["force_N"] for p in points]
    assert forces == pytest.approx([315.5 * best["force_factor"]] * 3)
    life = record["life"]
    assert [row["crest_loss_mm"] for row in life] == [0.0, 0.05, 0.1]
    time = confirmed["best"]["expected_shift_time_s"]
    assert life[0]["expected_shift_time_s"] == pytest.approx(time, rel=0.1)
    assert '<section id="life">' in (out / "report.html").read_text()
    # The surrogate is over both; designs that are operated differently meet at the same points.
    assert record["surrogate"] is not None
    surrogate = load(out / "surrogate.json").surrogate
    assert surrogate.data.variables == ("chamfer_deg", *OPERATED)
    assert len(surrogate.data.mix.points) == len(study.config.points)
    mix, told = study_mix(study.config), [t for t in record["trials"] if t["shifts"]]
    designs = study.config.rows(told)
    simulated = np.array([row["expected_shift_time_s"] for row in told])
    assert np.corrcoef(surrogate.medians(designs, mix), simulated)[0, 1] > 0.9


def test_a_search_is_one_of_the_clutch_with_its_mechanism(tmp_path: Path) -> None:
    """Search, confirmation, surrogate and folder, by the compiled engine."""
    keys = ["mechanism.spline_friction=0.1", "mechanism.delay_s=0.05", "effects.drag_torque=0.2"]
    plain, study = (
        load_study("mq200_paper", [*SMALL, "solver.engine=planar", *more]) for more in ([], keys)
    )
    result = run_study(study, searching(tmp_path, jobs=1))
    assert result["physics_hash"] == study.physics_hash
    rows = [json.loads(line) for line in (tmp_path / "shifts.jsonl").read_text().splitlines()]
    expected = {"mechanism_spline_friction": 0.1, "mechanism_drag_torque_Nm": 0.2,
                "force_delay_s": 0.05}  # fmt: skip
    assert all(row.items() >= expected.items() and "engine" not in row for row in rows)
    stored, path = stored_surrogate(study, tmp_path / "surrogate.json")
    assert stored.surrogate.data.physics == study.physics
    assert check_design(study, surrogate=path).to_dict()["low_s"] > 0.06
    with pytest.raises(ds.InputError, match="mechanism_spline_friction is absent here"):
        check_design(plain, surrogate=path)
