"""Limits of a study: quantities of its shifts or its shape, judged at the angles of the search."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import VARIABLES, Setup, load_study
from dogshape.pipeline.simulate.design import OBJECTIVES, design_of
from dogshape.pipeline.simulate.evaluation import ESTIMATORS, evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.study import run_study
from dogshape.sim.statistics.shift_records import Record
from tests.conftest import SMALL, searching

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


def test_every_simulated_quantity_has_an_estimator() -> None:
    assert {o.name for o in OBJECTIVES.values() if o.simulated} == set(ESTIMATORS)


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("strike_torque_Nm", lambda r: r["peak_tangential_force_N"] * 0.024),
        ("impact_impulse_Ns", lambda r: r["impact_impulse_Ns"]),
        ("first_try_share", lambda r: float(r["shift_time_s"] <= 0.06)),
    ],
)
def test_means_over_the_mix(name: str, of: Callable[[Record], float]) -> None:
    """Two points of equal weight and as many angles: the mean of all shifts."""
    bound = 0.5 if name == "first_try_share" else 1e9
    study = study_with(f"search.limits.{name}={bound}", "search.within_s=0.06")
    found, shifts = measured(study)
    expected = float(np.mean([of(row) for row in shifts]))
    assert expected > 0.0
    assert found.measured.limited[name] == pytest.approx(expected, rel=1e-12)
    assert name in found.estimates


def test_the_slowest_point_and_the_loss_on_a_reference() -> None:
    study = study_with(
        "search.limits.worst_shift_time_s=1.0", "search.limits.slower_than_reference_s=-0.1"
    )
    other, _ = measured(study)
    assert other.measured.limited["slower_than_reference_s"] < 0.0
    found, _ = measured(study, chamfer_deg=5.0)
    both = found.expectation.points, other.expectation.points
    assert found.measured.limited["worst_shift_time_s"] == max(p.mean for p in both[0])
    lost = max(
        a.mean - b.mean - 2.0 * math.hypot(a.standard_error, b.standard_error)
        for a, b in zip(*both, strict=True)
    )
    assert found.measured.limited["slower_than_reference_s"] == pytest.approx(lost, abs=1e-15)
    assert lost > -0.1
    assert not design_of(study, {"chamfer_deg": 5.0}, found.measured).feasible


def test_a_search_keeps_its_limits(tmp_path: Path) -> None:
    """The chosen design keeps its limit at the new angles; designs that fail it are not chosen."""
    limit = 0.080
    study = study_with("expectation.angles=24", f"search.limits.worst_shift_time_s={limit}")
    result = run_study(study, searching(tmp_path / "out", jobs=1))
    judged = [row for row in result["trials"] if "worst_shift_time_s" in row["margins"]]
    failed = [row for row in judged if row["margins"]["worst_shift_time_s"] < 0.0]
    assert failed
    assert not any(row["feasible"] for row in failed)
    dog = {key: judged[0][key] for key in VARIABLES}
    (own,) = evaluate(study, [dog], scratch_executor(), 24, 1)
    margin = 1.0 - own.measured.limited["worst_shift_time_s"] / limit
    assert judged[0]["margins"]["worst_shift_time_s"] == pytest.approx(margin, rel=1e-9)
    (check,) = (
        c for c in result["confirmation"]["best"]["checks"] if c["name"] == "worst_shift_time_s"
    )
    assert check["value"] <= limit
    assert check["limit"] == limit
