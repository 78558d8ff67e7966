"""``dogshape gap`` on the published tables, from the bank that the package brings."""

from __future__ import annotations

from pathlib import Path

import pytest

import dogshape as ds
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.pipeline.diagnose.bank_diagnosis import Means, diagnosed


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """The diagnosis of the stand; nothing is left to simulate."""
    folder = tmp_path_factory.mktemp("bank")
    diagnosis = diagnosed(load_bench("mq200_stand"), Means(bank=folder))
    assert not list(folder.iterdir())
    return diagnosis


def test_the_stand_has_a_dead_time_and_a_drag(found: Diagnosis) -> None:
    """Dead time over all plausible hypotheses, and a drag above that of bearings and seals."""
    stand = found.to_dict()
    assert {"actuation_delay", "drag_torque"} <= set(stand["inclusion"])
    assert stand["inclusion"]["drag_torque"] > 0.5
    delay, drag = stand["sizes"]["actuation_delay"]["delay_s"], stand["sizes"]["drag_torque"]
    assert 0.03 < delay["low"] < delay["mean"] < delay["high"] < 0.13
    assert drag["drag_Nm"]["mean"] > 0.5
    assert found.fits[found.leading].p > 0.01


def test_residuals_of_the_stand_at_held_out_points(found: Diagnosis) -> None:
    stand = found.to_dict()
    gap = stand["gap"]
    assert 0.12 < gap["baseline_rmse_s"] < 0.15
    assert gap["heldout_rmse_s"] < 0.4 * gap["baseline_rmse_s"]
    empty = [(c["mismatch_rpm"], c["force_N"]) for c in stand["where"] if c["gap_s"] is None]
    assert len(empty) == 3
    assert {round(rpm) for rpm, _ in empty} == {5}


def test_a_plan_for_the_stand_distinguishes_what_shifts_show(tmp_path: Path) -> None:
    """A dead time is seen at nearly any strength, an axial gap at fewer."""
    plan = ds.plan_shifts("mq200_stand", 60, points=6, bank=tmp_path)
    names = [h[0] if h else "none" for h in plan.inference.field.hypotheses]
    seen = {name: plan.inference.apart[k, 0] for k, name in enumerate(names) if name != "none"}
    assert seen["actuation_delay"] > 0.9
    assert seen["axial_gap"] < seen["actuation_delay"]
    record = plan.to_dict()
    assert sum(visit["shifts"] for visit in record["order"]) == 60
    assert record["worth"] > 0.5
    assert not list(tmp_path.iterdir())
