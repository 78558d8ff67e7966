"""Where the surrogate learns, and what its rows take from the journal of shifts."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.design import design_of, worth_simulating
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.pipeline.train.filling import (
    MOST,
    SLACK,
    filling_blocks,
    filling_designs,
    filling_point,
    finer_counts,
    own_blocks,
    own_designs,
)
from dogshape.pipeline.train.training import fill, train
from dogshape.pipeline.train.training_rows import dataset_of
from dogshape.sim.units import RPM
from dogshape.surrogate.dataset import COLUMNS, rows_of

WANTED = 0.01  #: relative error of references
EVEN = np.full(3, 1.0 / 3.0)  #: weights of three operating points


def test_designs_fill_the_feasible_space_and_a_band_beyond(small_study: Setup) -> None:
    designs = list(islice(filling_designs(small_study, 1), 30))
    assert designs[:12] == list(islice(filling_designs(small_study, 1), 12))
    inside = [worth_simulating(small_study, design) for design in designs]
    assert inside == [index % 3 != 2 for index in range(30)]
    for design in designs[2::3]:
        checks = design_of(small_study, design).checks
        assert -SLACK <= min(check.margin for check in checks) < 0.0
        assert all(c.passed for c in checks if c.name.endswith("_release"))
    for key, (low, high) in small_study.variables.items():
        values = [design[key] for design in designs]
        assert low <= min(values) < max(values) <= high
    assert {type(design["count"]) for design in designs} == {int}


@pytest.mark.parametrize("mismatch", ["[5, 249]", "[-100, 100]", "[-249, -5]"])
def test_operating_points_reach_their_edges(mismatch: str) -> None:
    study = load_study("mq200_paper", [f"operating.mismatch_rpm={mismatch}"])
    low, high = min(study.mismatches), max(study.mismatches)
    points = [filling_point(study, 1, index) for index in range(200)]
    speeds = np.array([point.mismatch / RPM for point in points])
    forces = np.array([point.profile.force for point in points])
    for values, ends in ((speeds, (low, high)), (forces, (235.2, 641.5))):
        span = ends[1] - ends[0]
        assert values.min() == pytest.approx(ends[0], abs=0.02 * span)
        assert values.max() == pytest.approx(ends[1], abs=0.02 * span)
        assert values.min() >= ends[0] - 1e-9
        assert values.max() <= ends[1] + 1e-9


def _found(errors: list[list[float]]) -> np.ndarray:
    """Means of 0.1 s with these errors, s, of designs at points."""
    return np.stack([np.full_like(errors, 0.1), errors], axis=-1)


def test_references_look_closer_where_their_error_is() -> None:
    counts = [12, 12, MOST]
    assert finer_counts(_found([[1e-4] * 3] * 4), counts, WANTED, EVEN) == counts
    part = WANTED * 0.1 * 3**0.5
    rough = _found([[3 * part, 1e-4, 3 * part], [2 * part, 1e-4, 0.0]])
    assert finer_counts(rough, counts, WANTED, EVEN) == [24, 12, MOST]
    seldom = np.array([0.05, 0.05, 0.9])  # what seldom counts needs no finer look
    assert finer_counts(rough, [12] * 3, WANTED, seldom) == [12, 12, 24]


def test_one_design_with_a_lucky_draw_is_looked_at_like_the_others() -> None:
    lucky = _found([[1e-5, 1e-5], [0.01, 1e-5], [0.01, 1e-5]])
    assert (
        finer_counts(lucky, [12, 12], WANTED, EVEN[:2] * 1.5)
        == finer_counts(lucky[::-1], [12, 12], WANTED, EVEN[:2] * 1.5)
        == [24, 12]
    )


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
    given = [_shift(a, seed=None) for a in (1.0, 2.0, 3.0)]
    assert rows_of(names, given)[0, -1] == -1
    hung = {"outcome": "blocked", "shift_time_s": None}
    (row,) = rows_of(names, [*whole[:3], _shift(19.0, **hung)])
    found = dict(zip((*names, *COLUMNS), row, strict=True))
    assert (found["engaged"], found["shifts"]) == (3, 4)
    assert found["mean_s"] == pytest.approx(0.057)
    (none,) = rows_of(names, [_shift(a, **hung) for a in (0.0, 8.0, 16.0)])
    assert np.isnan(none[len(names) + 2])
    assert none[len(names) + 5] == 0


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Setup, ShiftJournal]:
    """A study with a dozen designs simulated at two points of their own."""
    sets = ["surrogate.points=2", "surrogate.angles=3", "operating.mismatch_rpm=[50, 149]"]
    study = load_study("mq200_paper", sets)
    journal = ShiftJournal(tmp_path_factory.mktemp("filled") / "shifts.jsonl")
    designs = list(islice(filling_designs(study, 1), 12))
    blocks = [b for i, d in enumerate(designs) for b in filling_blocks(study, d, i, 1)]
    Executor(journal).run(blocks)
    return study, journal


def test_rows_of_other_physics_are_left_out(filled: tuple[Setup, ShiftJournal]) -> None:
    study, journal = filled
    rows = list(journal.rows.values())
    data = dataset_of(study, rows)
    assert len(data) == 24
    assert len(data.designs) == 12
    finer = [{**row, "accuracy": 1e-5} for row in rows]
    ramp = [{**row, "force_rise_s": 0.3} for row in rows]
    older = [{**row, "drake": "1.0"} for row in rows]
    assert len(dataset_of(study, [*rows, *finer, *ramp, *older])) == 24
    assert len(dataset_of(load_study("mq200_paper", ["contact.set=adams2019"]), rows)) == 0


def test_rows_do_not_depend_on_the_order_of_shifts(filled: tuple[Setup, ShiftJournal]) -> None:
    """Workers finish in any order; the digest of a data set, and so its fit, must not tell."""
    study, journal = filled
    rows = list(journal.rows.values())
    assert dataset_of(study, rows).digest == dataset_of(study, rows[::-1]).digest


def test_a_filled_folder_has_all_of_its_rows(tmp_path: Path) -> None:
    """Seeds of search and surrogate are alike by default; only a search's folder has others."""
    few = {"designs": 10, "points": 1, "angles": 3, "references": 3, "best_references": 0,
           "reference_angles": 3, "reference_error": 0.3}  # fmt: skip
    study = load_study("mq200_paper", {
        **{f"surrogate.{key}": value for key, value in few.items()}, "surrogate.mix_shifts": 0,
        "operating.mismatch_rpm": [50, 149], "operating.force_N": [469.0],
    })  # fmt: skip
    folder = StudyFolder(tmp_path)
    fill(study, folder, 1)
    data = train(folder).surrogate.data
    assert len(data.designs) == 11  # with the study's own dog
    own = data.rows[(data.x == study.rows([study.prototype])).all(axis=1)]
    assert own[:, 5].tolist() == [50.0, 149.0]
    assert (own[:, -2] == 672).all()


def test_own_designs_are_those_that_can_be_simulated() -> None:
    reference = {"chamfer_deg": 10.0, "count": 18}
    study = load_study("mq200_paper", {"search.reference": reference})
    assert own_designs(study) == [study.prototype, {**study.prototype, **reference}]
    assert len(own_designs(load_study("mq200_paper"))) == 1
    assert own_designs(load_study("mq200_paper", {"dog.chamfer_deg": 5.0})) == []  # it holds
    assert own_designs(load_study("mq200_paper", {"dog.count": 40})) == []  # its tip is too narrow
    blocks = own_blocks(study)
    assert len(blocks) == 2 * len(study.points)
    assert {len(block.angles) for block in blocks} == {48}
