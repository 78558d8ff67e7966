"""A search over the dogs of a clutch with its mechanism."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.errors import InputError
from tests.conftest import SMALL, searching


def test_a_search_is_one_of_the_clutch_with_its_mechanism(tmp_path: Path) -> None:
    """Search, confirmation, surrogate and folder, by the compiled engine."""
    keys = ["mechanism.spline_friction=0.1", "mechanism.delay_s=0.05", "effects.drag_torque=0.2"]
    study = load_study("mq200_paper", [*SMALL, "solver.engine=planar", *keys])
    result = run_study(study, searching(tmp_path, jobs=1))
    assert result["physics_hash"] == study.physics_hash
    assert result["confirmation"] is not None
    rows = [json.loads(line) for line in (tmp_path / "shifts.jsonl").read_text().splitlines()]
    assert len({row["seed"] for row in rows}) > 1
    for row in rows:
        assert row["mechanism_spline_friction"] == 0.1
        assert row["mechanism_drag_torque_Nm"] == 0.2
        assert row["force_delay_s"] == 0.05
        assert "engine" not in row  # Drake's, of confirmation and audit
        assert row["shift_time_s"] is None or row["shift_time_s"] > 0.06
    stored, path = stored_surrogate(study, tmp_path / "surrogate.json")
    assert stored.surrogate.data.physics == study.physics
    assert StudyFolder(tmp_path).stored_study().points == study.points
    found = check_design(study, None, None, path)
    assert found.to_dict()["low_s"] > 0.06
    with pytest.raises(InputError, match="mechanism_spline_friction is absent here"):
        check_design(load_study("mq200_paper", [*SMALL, "solver.engine=planar"]), None, None, path)
