"""A search over shape and shift control together, from trials to report."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.reports.text import ms_with_error
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.store import load

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
    "search.trials": 10,
    "search.startup": 6,
    "search.confirm_designs": 1,
    "search.confirm_angles": 4,
}


def test_shape_and_control_are_searched_together(tmp_path: Path) -> None:
    out = tmp_path / "r"
    found = ds.Study("mq200_paper", SETTINGS).search(out, jobs=1)
    best, record = found.best, found.record
    assert best is not None
    assert {row["prototype"] for row in record["trials"]} == {True, False}
    assert all({*OPERATED} <= row.keys() for row in record["trials"])
    assert record["surrogate"] is None
    confirmed = ds.load_result(out).record["confirmation"]
    assert confirmed is not None
    points = confirmed["best"]["points"]
    mean = sum(p["mismatch_rpm"] for p in points) / len(points)
    assert mean == pytest.approx(best["mismatch_set_rpm"], abs=1e-5)
    forces = [p["force_N"] for p in points]
    assert forces == pytest.approx([315.5 * best["force_factor"]] * 3)
    life = ds.load_result(out).record["life"]
    assert [row["crest_loss_mm"] for row in life] == [0.0, 0.05, 0.1]
    time = confirmed["best"]["expected_shift_time_s"]
    assert life[0]["expected_shift_time_s"] == pytest.approx(time, rel=0.1)
    page = (out / "report.html").read_text()
    assert "set-point of the mismatch" in page
    _, _, drift = page.partition('<section id="life">')
    cells = re.findall(r"<td[^>]*>(.*?)</td>", drift.partition("</section>")[0])
    assert cells[::7] == ["0.0 %", "50 %", "100 %"]
    assert cells[1::7] == ["0", "50", "100"]
    assert cells[4] == ms_with_error(life[0]["expected_shift_time_s"], life[0]["standard_error_s"])
    # What was simulated is found again: the same command has nothing left to do.
    shifts = (out / "shifts.jsonl").read_text()
    again = ds.Study("mq200_paper", SETTINGS).search(out, jobs=1, resume=True)
    assert (out / "shifts.jsonl").read_text() == shifts
    assert json.dumps(again.record["best"]) == json.dumps(best)


def test_the_surrogate_knows_the_operation(tmp_path: Path) -> None:
    """The study's own sampler searches shape and control, and leaves a surrogate over both."""
    settings = {**SETTINGS, "search.sampler": "surrogate", "search.trials": 18}
    study = ds.Study("mq200_paper", {**settings, "search.startup": 12})
    found = study.search(tmp_path / "r", jobs=1)
    assert found.record["surrogate"] is not None
    surrogate = load(tmp_path / "r" / "surrogate.json").surrogate
    assert surrogate.data.variables == ("chamfer_deg", *OPERATED)
    # Designs that are operated differently meet at the study's own operating points.
    assert len(surrogate.data.mix.points) == len(study.config.points)
    mix, told = study_mix(study.config), [t for t in found.record["trials"] if t["shifts"]]
    designs = study.config.rows(told)
    times = surrogate.medians(designs, mix)
    simulated = np.array([row["expected_shift_time_s"] for row in told])
    assert np.corrcoef(times, simulated)[0, 1] > 0.9
    # A set-point far from the simulated one is another design: the answer follows it.
    other = designs[0].copy()
    other[1] = -other[1]
    moved, own = surrogate.medians(np.array([other, designs[0]]), mix)
    assert moved != pytest.approx(own, rel=0.02)
