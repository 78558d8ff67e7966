"""Studies with other objectives, limits, variables of control, and shifts that all fail."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.schema import QUANTILE
from dogshape.pipeline.config.study_file import VARIABLES, Setup, load_study
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.search.confirmation import Executors, _simulate_anew
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.expectation import Estimate, mean_over, share_over
from dogshape.sim.statistics.hangs import HangPrior
from dogshape.sim.statistics.shift_records import Record
from dogshape.surrogate.store import load
from tests.conftest import SMALL, search_run
from tests.integration.studies import lines_of

QUANTILE_S = "shift_time_quantile_s"


def _tiny(name: str, *more: str) -> Setup:
    """A bundled study of two operating points, three angles and few designs, in Drake."""
    points = "operating={points=[{mismatch_rpm=100, force_N=469, weight=2}, "
    points += "{mismatch_rpm=-149, force_N=469}]}"
    budget = ["expectation.angles=3", "search.confirm_angles=3", "search.trials=4"]
    budget += ["search.sampler=space_filling", "solver.engine=drake"]
    return load_study(name, [points, *budget, *more])


def _run(study: Setup, folder: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    result = run_study(study, search_run(folder, jobs=1)).to_dict()
    return result, [json.loads(line) for line in lines_of(folder, "shifts.jsonl")]


def test_the_robust_study_at_smoke_size(tmp_path: Path) -> None:
    study = _tiny("mq200_robust")
    result, shifts = _run(study, tmp_path)
    assert result["leading"] == "shift_time_quantile_s"
    assert study.file.search.quantile == QUANTILE
    rows = [row for row in result["trials"] if row["feasible"]]
    first = min(rows, key=lambda row: row["shift_time_quantile_s"])
    assert result["confirmation"]["designs"][0]["trial"] == first["trial"]
    assert {row["force_factor"] for row in shifts} != {1.0}
    # The prototype's chamfer would not slide from rest at the upper end of the friction.
    assert result["trials"][0]["failed"] == ["chamfer_release"]
    for row in result["trials"][1:]:
        assert row["standard_errors"]["shift_time_quantile_s"] > 0.0
        assert row["shift_time_quantile_s"] > row["expected_shift_time_s"]
    confirmed = result["confirmation"]
    before, after = (confirmed[k]["estimates"][QUANTILE_S]["value"] for k in ("prototype", "best"))
    assert confirmed["gains"][QUANTILE_S]["value"] == pytest.approx(before - after)
    assert write_report(StudyFolder(tmp_path)).stat().st_size > 0
    resumed = run_study(study, search_run(tmp_path, jobs=1, resume=True)).to_dict()
    assert resumed["trials"] == result["trials"]
    assert resumed["n_simulated_shifts"] == result["n_simulated_shifts"]


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
        _simulate_anew(study, {"design 0": study.prototype}, executors)


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
    record = found.record.to_dict()
    best, confirmed = record["best"], record["confirmation"]
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
    time, error = confirmed["best"]["expected_shift_time_s"], life[0]["standard_error_s"]
    assert life[0]["expected_shift_time_s"] == pytest.approx(time, abs=2.0 * error)
    assert '<section id="life">' in (out / "report.html").read_text()
    # The surrogate is over both; designs that are operated differently meet at the same points.
    assert record["surrogate"] is not None
    surrogate = load(out / "surrogate.json").surrogate
    assert surrogate.data.variables == ("chamfer_deg", *OPERATED)
    assert len(surrogate.data.mix.points) == len(study.config.points)
    mix, told = study_mix(study.config), [t for t in record["trials"] if t["shifts"]]
    designs = study.config.rows(told)
    simulated = np.array([row["expected_shift_time_s"] for row in told])
    assert np.corrcoef(surrogate.predict_medians(designs, mix), simulated)[0, 1] > 0.9


PLANAR = "solver.engine=planar"


def study_with(*overrides: str) -> Setup:
    """Load the small study for the compiled engine."""
    return load_study("mq200_paper", [*SMALL, PLANAR, *overrides])


def measured(study: Setup, **dog: float) -> tuple[Any, list[Record]]:
    """Simulate a design; what was found and its shifts."""
    executor = scratch_executor()
    settings = study.file.expectation
    (found,) = evaluate(study, [dog], executor, settings.angles, settings.seed)
    return found, list(executor.journal.rows.values())


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("strike_torque_Nm", lambda r: r["peak_tangential_force_N"] * 0.024),
        ("impact_impulse_Ns", lambda r: r["impact_impulse_Ns"]),
    ],
)
def test_means_over_the_mix(name: str, of: Callable[[Record], float]) -> None:
    """Two points of equal weight and as many angles: the mean of all shifts."""
    study = study_with(f"search.limits.{name}=1e9")
    found, shifts = measured(study)
    expected = float(np.mean([of(row) for row in shifts]))
    assert expected > 0.0
    assert found.check_inputs.limited[name] == pytest.approx(expected, rel=1e-12)
    assert name in found.estimates


def test_share_at_the_first_try_is_its_posterior() -> None:
    study = study_with("search.limits.first_try_share=0.5", "search.within_s=0.06")
    found, shifts = measured(study)
    late = [sum(row["shift_time_s"] > 0.06 for row in shifts if row["mismatch_rpm"] == speed)
            for speed in sorted({row["mismatch_rpm"] for row in shifts})]  # fmt: skip
    each = len(shifts) // len(late)
    expected = share_over([1.0] * len(late), [(count, each) for count in late])
    assert found.estimates["first_try_share"].value == pytest.approx(expected.value)
    assert found.estimates["first_try_share"].standard_error > 0.0


def test_the_slowest_point_and_the_loss_on_a_reference() -> None:
    limits = ("worst_shift_time_s=1.0", "slower_than_reference_s=-0.1")
    study = study_with(*(f"search.limits.{one}" for one in limits))
    other, _ = measured(study)
    assert other.check_inputs.limited["slower_than_reference_s"] < 0.0
    found, _ = measured(study, chamfer_deg=5.0)
    rare = [HangPrior(rate=1e-4, strength=1e4, blocked_share=1e-6)] * len(study.points)
    other, found = (
        other.replace_priors(rare),
        found.replace_priors(rare),
    )  # a few shifts alone leave hangs open
    both = found.expectation.points, other.expectation.points
    assert found.check_inputs.limited["worst_shift_time_s"] == max(p.mean for p in both[0])
    lost = max(
        a.mean - b.mean - 2.0 * math.hypot(a.standard_error, b.standard_error)
        for a, b in zip(*both, strict=True)
    )
    assert found.check_inputs.limited["slower_than_reference_s"] == pytest.approx(lost, abs=1e-15)
    assert lost > -0.1
    assert not design_of(study, {"chamfer_deg": 5.0}, found.check_inputs).feasible


def test_a_search_keeps_its_limits(tmp_path: Path) -> None:
    """The chosen design keeps its limit at the new angles; designs that fail it are not chosen."""
    limit = 0.080
    study = study_with("expectation.angles=24", f"search.limits.worst_shift_time_s={limit}")
    result = run_study(study, search_run(tmp_path / "out", jobs=1)).to_dict()
    judged = [row for row in result["trials"] if "worst_shift_time_s" in row["margins"]]
    failed = [row for row in judged if row["margins"]["worst_shift_time_s"] < 0.0]
    assert failed
    assert not any(row["feasible"] for row in failed)
    dog = {key: judged[0][key] for key in VARIABLES}
    (own,) = evaluate(study, [dog], scratch_executor(), 24, 1)
    own = own.replace_priors([HangPrior(**prior) for prior in result["hang_prior"]])
    margin = 1.0 - own.check_inputs.limited["worst_shift_time_s"] / limit
    assert judged[0]["margins"]["worst_shift_time_s"] == pytest.approx(margin, rel=1e-9)
    checks = result["confirmation"]["best"]["checks"]
    (check,) = (c for c in checks if c["name"] == "worst_shift_time_s")
    assert check["value"] <= limit
    assert check["limit"] == limit
