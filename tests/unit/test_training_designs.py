"""Where the surrogate learns: designs, their angles, and rows of shifts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study, replace_keys
from dogshape.pipeline.simulate.design import design_of, mark_worthy, worth_simulating
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.train import training
from dogshape.pipeline.train.training import Job, count_of, prototype_designs, simulated_data
from dogshape.sim.errors import InputError
from dogshape.surrogate.dataset import COLUMNS, rows_of

ONE = {"operating.mismatch_rpm": [25.0], "operating.force_N": [469.0]}
EIGHT = {"operating.mismatch_rpm": [5.0, 25.0, 100.0, 249.0], "operating.force_N": [235.2, 641.5]}


def test_designs_fill_the_feasible_space_and_a_band_beyond(small_study: Setup) -> None:
    designs = training.first_designs(small_study, 30)
    assert designs[:12] == training.first_designs(small_study, 12)
    assert [worth_simulating(small_study, one) for one in designs] == [True, True, False] * 10
    worst = replace_keys(small_study, {"search.limits.smallest_margin_worst": 0.0})
    assert not mark_worthy(worst, designs[2::3]).any()  # also where none is left for that limit
    for design in designs[2::3]:
        checks = design_of(small_study, design).checks
        assert -training.BORDER_WIDTH <= min(check.margin for check in checks) < 0.0
        assert all(c.passed for c in checks if c.name.endswith("_release"))
    for key, (low, high) in small_study.variables.items():
        values = [design[key] for design in designs]
        assert low <= min(values) < max(values) <= high
    assert {type(design["count"]) for design in designs} == {int}


def _shift(angle: float, seed: int | None = 1, **changes: Any) -> dict[str, Any]:
    given = {"mismatch_rpm": 50.0, "force_N": 469.0, "force_rise_s": 0.1766, "timeout_s": 1.0}
    found = {"outcome": "engaged", "shift_time_s": 0.05 + 0.001 * angle}
    shape = {"chamfer_deg": 8.0, "count": 15, "relative_angle_deg": angle, "seed": seed}
    return {**given, **found, **shape, **changes}


def test_rows_are_groups_of_whole_draws() -> None:
    names = ("chamfer_deg", "count")
    whole = [_shift(a) for a in (1.0, 7.0, 13.0, 19.0)]
    (row,) = rows_of(names, whole)
    found = dict(zip((*names, *COLUMNS), row, strict=True))
    assert found["mean_s"] == pytest.approx(0.06)
    assert found["sd_s"] == pytest.approx(np.std([0.051, 0.057, 0.063, 0.069], ddof=1))
    assert (found["engaged"], found["shifts"], found["seed"]) == (4, 4, 1)
    assert len(rows_of(names, whole[:3])) == 0  # a draw that was cut off
    other = [_shift(a, seed=2) for a in (2.0, 10.0, 18.0)]
    assert len(rows_of(names, [*whole, *other])) == 2
    hung = {"outcome": "blocked", "shift_time_s": None}
    (row,) = rows_of(names, [*whole[:3], _shift(19.0, **hung)])
    found = dict(zip((*names, *COLUMNS), row, strict=True))
    assert (found["engaged"], found["shifts"]) == (3, 4)
    assert found["mean_s"] == pytest.approx(0.057)
    (none,) = rows_of(names, [_shift(a, **hung) for a in (0.0, 8.0, 16.0)])
    assert np.isnan(none[len(names) + 2])
    assert none[len(names) + 5] == 0


def test_own_designs_are_those_that_can_be_simulated() -> None:
    study = load_study("mq200_paper")
    assert prototype_designs(study) == [study.prototype]
    assert prototype_designs(load_study("mq200_paper", {"dog.chamfer_deg": 5.0})) == []  # it holds
    narrow = load_study("mq200_paper", {"dog.count": 40})  # its tip is too narrow
    assert prototype_designs(narrow) == []


@pytest.mark.parametrize(("settings", "angles"), [({}, 16), (EIGHT, 16), (ONE, 128)])
def test_a_design_has_enough_angles_at_each_point_and_shifts_in_all(
    settings: dict[str, object], angles: int
) -> None:
    study = load_study("mq200_paper", {**settings, "surrogate.mix_shifts": 50_000})
    assert training.angles_of(study) == angles >= training.MIN_ANGLES
    each = angles * len(study.points)
    assert each >= training.MIN_SHIFTS
    assert count_of(study) == 50_000 // each
    job = Job(study.prototype, angles, 3, 0)
    blocks = job.blocks(study.search_setup)
    assert {len(block.angles) for block in blocks} == {angles // 2}
    assert sum(job.rounds(study)) == angles // 2
    assert {block.clutch.solver.engine for block in blocks} == {"planar"}
    other = replace(job, index=1)
    assert not {b.angles[0] for b in blocks} & {
        b.angles[0] for b in other.blocks(study.search_setup)
    }


def test_no_more_designs_than_are_worth_asking_and_no_fewer_than_a_fit_needs() -> None:
    many = load_study("mq200_paper", {**ONE, "surrogate.mix_shifts": 10**7})
    assert count_of(many) == training.MAX_DESIGNS
    for shifts in (1, 15 * 128 - 1):
        with pytest.raises(InputError, match=rf"mix_shifts = {shifts} .* give 1920 or more"):
            count_of(load_study("mq200_paper", {**ONE, "surrogate.mix_shifts": shifts}))


def test_designs_are_simulated_once_and_rows_are_the_mean_over_the_pitch(tmp_path: Path) -> None:
    """Half of a design's angles are where its times jump: they say what many even ones say."""
    study, path = load_study("mq200_paper", EIGHT).search_setup, tmp_path / "simulated.jsonl"
    own, less = study.prototype, {**study.prototype, "chamfer_deg": 7.5}
    jobs = [Job(own, 32, 1, 0), Job(less, 32, 1, 1)]
    even = Job(own, 31, 5, 0)  # below 32 fewer halve intervals
    counted: list[int] = []
    executor = scratch_executor(1, lambda done, known: counted.append(done - known))
    training.simulate_designs(study, path, "some", jobs[:1], executor)
    training.simulate_designs(study, path, "some", jobs, executor)
    assert sum(counted) == 2 * 8 * 32
    first = simulated_data(study, path, "some").grid
    assert first.x.shape == (2, 5)
    assert (first.shifts == 32).all()
    assert (first.engaged <= 32).all()
    training.simulate_designs(study, path, "other", [even], executor)
    other = simulated_data(study, path, "other").grid
    error = np.hypot(first.errors[1], other.errors[0])
    assert (np.abs(first.means[1] - other.means[0]) < 4.0 * error).all()
