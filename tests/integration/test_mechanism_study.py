"""A search over the dogs of a clutch with its mechanism."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dogshape.check import check_design
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.errors import InputError
from tests.conftest import SMALL, searching

PLANAR = "solver.engine=planar"


def test_a_search_is_one_of_the_clutch_with_its_mechanism(tmp_path: Path) -> None:
    """Search, confirmation, surrogate and folder, by the compiled engine."""
    keys = ["mechanism.spline_friction=0.1", "mechanism.delay_s=0.05", "effects.drag_torque=0.2"]
    plain, study = (load_study("mq200_paper", [*SMALL, PLANAR, *more]) for more in ([], keys))
    result = run_study(study, searching(tmp_path, jobs=1))
    assert result["physics_hash"] == study.physics_hash
    rows = [json.loads(line) for line in (tmp_path / "shifts.jsonl").read_text().splitlines()]
    expected = {"mechanism_spline_friction": 0.1, "mechanism_drag_torque_Nm": 0.2,
                "force_delay_s": 0.05}  # fmt: skip
    assert all(row.items() >= expected.items() and "engine" not in row for row in rows)
    stored, path = stored_surrogate(study, tmp_path / "surrogate.json")
    assert stored.surrogate.data.physics == study.physics
    assert check_design(study, None, None, path).to_dict()["low_s"] > 0.06
    with pytest.raises(InputError, match="mechanism_spline_friction is absent here"):
        check_design(plain, None, None, path)
