"""``dogshape diagnose`` on the published tables."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, diagnose_bench

EVIDENCE = Path(__file__).parents[2] / "docs" / "evidence" / "gap_stand.json"


def _diagnosed(folder: Path, seed: int) -> Inference:
    settings = replace(USUAL, seed=seed)
    return diagnose_bench(load_bench("mq200_stand"), BankOptions(bank=folder, settings=settings))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for what the bundled bank lacks."""
    return tmp_path_factory.mktemp("bank")


@pytest.fixture(scope="module")
def found(folder: Path) -> Inference:
    """The diagnosis of the stand."""
    return _diagnosed(folder, USUAL.seed)


def _assert_same(record: dict[str, Any], expected: dict[str, Any]) -> None:
    """Verdict, inclusion to 0.03 or three stated errors, sizes to a tenth of their intervals."""
    assert record["verdict"] == expected["verdict"]
    assert set(record["causes"]) == set(expected["causes"])
    for name, probability in expected["inclusion"].items():
        errors = [one["inclusion_error"].get(name, 0.0) for one in (record, expected)]
        allowed = max(0.03, 3.0 * math.hypot(*errors))
        assert record["inclusion"].get(name, 0.0) == pytest.approx(probability, abs=allowed), name
    for name in ("actuation_delay", "drag_torque"):
        for parameter, size in expected["sizes"][name].items():
            tenth = 0.1 * (size["high"] - size["low"])
            mean = record["sizes"][name][parameter]["mean"]
            assert mean == pytest.approx(size["mean"], abs=tenth), parameter


def test_another_seed_gives_the_same_answer(found: Inference, folder: Path) -> None:
    _assert_same(_diagnosed(folder, USUAL.seed + 1).to_dict(), found.to_dict())


def test_this_processor_gives_the_published_answer(found: Inference) -> None:
    """``make processors`` repeats it with other instructions and numbers of threads."""
    _assert_same(found.to_dict(), json.loads(EVIDENCE.read_text(encoding="utf-8")))


def test_the_stand_has_a_dead_time_and_a_drag(found: Inference) -> None:
    """Dead time over all plausible hypotheses, and a drag above that of bearings and seals."""
    stand = found.to_dict()
    assert {"actuation_delay", "drag_torque"} <= set(stand["inclusion"])
    assert stand["inclusion"]["drag_torque"] > 0.5
    delay, drag = stand["sizes"]["actuation_delay"]["delay_s"], stand["sizes"]["drag_torque"]
    assert 0.03 < delay["low"] < delay["mean"] < delay["high"] < 0.13
    assert drag["drag_Nm"]["mean"] > 0.5
    assert found.fits[found.leading].p > 0.01


def test_residuals_of_the_stand_at_held_out_points(found: Inference) -> None:
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
    seen = {
        name: plan.inference.distinct_share[k, 0] for k, name in enumerate(names) if name != "none"
    }
    assert seen["actuation_delay"] > 0.9
    assert seen["axial_gap"] < seen["actuation_delay"]
    record = plan.to_dict()
    assert sum(visit["shifts"] for visit in record["order"]) == 60
    assert record["worth"] > 0.5
