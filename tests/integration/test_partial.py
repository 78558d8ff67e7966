"""A search that simulates some operating points of each design and foretells the others."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.dog_guide import DogGuide
from dogshape.pipeline.search.point_choice import first_plan, hard_points, telling_plan
from dogshape.pipeline.simulate.point_plans import (
    blocks_of,
    is_whole,
    most_to_confirm,
    most_to_search,
    whole_plan,
)
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.pipeline.train.found_surrogates import known_surrogate
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.expected_time import Over
from tests.conftest import ONE_LEVEL, searching

FEW = [
    *ONE_LEVEL,
    "operating.mismatch_rpm=[25, 50, 100, 149]",
    "operating.force_N=[315.5, 641.5]",
    "expectation.angles=3",
    "search.points=3",
    "search.trials=16",
    "search.startup=12",
    "search.confirm_angles=3",
    "search.confirm_designs=2",
    # Another physics than that of the surrogate which the package brings: nothing joins it.
    "shift.timeout_s=1.1",
]
NAMES = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A small search run to its end."""
    folder = tmp_path_factory.mktemp("partial")
    return folder, run_study(load_study("mq200_paper", FEW), searching(folder, jobs=1))


def _points_of(folder: Path) -> dict[tuple[float, ...], dict[tuple[float, float], int]]:
    """Shifts of each design at each operating point."""
    count: dict[tuple[float, ...], dict[tuple[float, float], int]] = {}
    for line in (folder / "shifts.jsonl").read_text().splitlines():
        row = json.loads(line)
        design = tuple(round(row[name], 6) for name in NAMES)
        point = (round(row["mismatch_rpm"], 3), row["force_N"])
        count.setdefault(design, {}).setdefault(point, 0)
        count[design][point] += 1
    return count


def test_designs_are_simulated_at_a_few_points_and_confirmed_at_all(
    found: tuple[Path, dict[str, Any]],
) -> None:
    folder, result = found
    points = _points_of(folder)
    confirmed = {d["trial"] for d in result["confirmation"]["designs"]}
    assert {row["trial"] for row in result["front"]} <= confirmed
    assert len(confirmed) <= 2
    study = load_study("mq200_paper", FEW)
    announced = most_to_search(study, 16, partial=True, prototype=True)
    assert result["n_simulated_shifts"] <= announced + most_to_confirm(study, len(confirmed))
    for row in result["trials"]:
        mine = points[tuple(round(row[name], 6) for name in NAMES)]
        whole = row["prototype"] or row["trial"] in confirmed
        assert len(mine) == (8 if whole else row["points"])
        assert {(149.0, 641.5), (100.0, 641.5)} <= set(mine)
        assert row["prototype"] or row["points"] == 3
    seen = {point for mine in points.values() for point in mine}
    assert len(seen) == 8


def test_what_is_foretold_is_what_all_points_give(found: tuple[Path, dict[str, Any]]) -> None:
    """Confirmed at every point and new angles: within the errors of both."""
    _, result = found
    rows = {row["trial"]: row for row in result["trials"]}
    for design in result["confirmation"]["designs"]:
        row = rows[design["trial"]]
        both = np.hypot(row["standard_error_s"], design["standard_error_s"])
        gap = row["expected_shift_time_s"] - design["expected_shift_time_s"]
        assert abs(gap) < 4.0 * both
        assert row["low"] < row["expected_shift_time_s"] < row["high"]


def test_probabilities_say_how_sure_the_front_is(found: tuple[Path, dict[str, Any]]) -> None:
    _, result = found
    chance = {
        row["trial"]: row["probability_on_front"] for row in result["trials"] if row["feasible"]
    }
    assert all(0.0 <= value <= 1.0 for value in chance.values())
    assert sum(chance.values()) >= 1.0  # of every draw some design is on the front
    on_front = {row["trial"] for row in result["front"]}
    others = [value for trial, value in chance.items() if trial not in on_front]
    assert min(chance[trial] for trial in on_front) > 0.0
    assert np.mean([chance[trial] for trial in on_front]) > np.mean(others)


@pytest.mark.slow
def test_the_same_search_on_two_workers(found: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    again = run_study(load_study("mq200_paper", FEW), searching(tmp_path, jobs=2))
    keys = (*NAMES, "expected_shift_time_s", "standard_error_s", "probability_on_front")
    first, second = ([[row.get(k) for k in keys] for row in r["trials"]] for r in (found[1], again))
    assert first == second


class CutOffError(Exception):
    """Stands for the end of a process."""


@contextmanager
def _ending_at(name: str, calls: int) -> Iterator[None]:
    """End the process at a call of Optuna's."""
    usual, left = getattr(optuna.Study, name), iter(range(calls))

    def counted(*given: Any, **named: Any) -> Any:
        if next(left, None) is None:
            raise CutOffError
        return usual(*given, **named)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(optuna.Study, name, counted)
        yield


def test_cut_off_while_it_told_and_asked_it_ends_as_it_would_have(
    found: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    """First designs that were told in part are foretold from all of them; so is what follows."""
    study, how = load_study("mq200_paper", FEW), Run(StudyFolder(tmp_path), jobs=1, resume=True)
    for name in ("study.json", "shifts.jsonl"):  # what is asked was simulated
        shutil.copy(found[0] / name, tmp_path)
    for name, calls in (("tell", 5), ("ask", 2)):
        with _ending_at(name, calls), pytest.raises(CutOffError):
            run_study(study, how)
    again = run_study(study, how)
    keys = (*NAMES, "points", "expected_shift_time_s", "standard_error_s", "probability_on_front")
    first, second = ([[row.get(k) for k in keys] for row in r["trials"]] for r in (found[1], again))
    assert first == second


@pytest.fixture(scope="module")
def study() -> Setup:
    return load_study("mq200_paper", [*ONE_LEVEL, "search.points=6"])


def test_first_plans_take_turns_and_keep_the_hard_points(study: Setup) -> None:
    plans = [first_plan(study, 6, number) for number in range(7)]
    assert all(sum(count > 0 for count in plan) == 6 for plan in plans)
    assert np.all(np.sum(plans, axis=0) > 0)
    hardest = [study.points[k] for k in hard_points(study)]
    assert all(p.profile.force == 641.5 for p in hardest)
    assert all(plan[k] for plan in plans for k in hard_points(study))


def test_a_telling_plan_has_each_point_once_and_as_many_as_wanted(study: Setup) -> None:
    stored = known_surrogate(study)
    assert stored is not None
    over = Over(stored.surrogate, study_mix(study))
    designs = stored.surrogate.data.designs[::200] + 0.3
    for points in (3, 10, 27):
        for design in designs:
            plan = telling_plan(study, points, over, design)
            assert sorted(plan) == [0] * (28 - points) + [study.file.expectation.angles] * points
            assert all(plan[place] for place in hard_points(study))


def test_plans_share_angles_with_whole_designs(study: Setup) -> None:
    """Designs differ by their shape and not by their luck, whatever was simulated of them."""
    whole = blocks_of(study, study.clutch, whole_plan(study), 1)
    part = blocks_of(study, study.clutch, first_plan(study, 6, 0), 1)
    assert len(part) == 6
    assert all(block in whole for block in part)
    assert is_whole(whole_plan(study))
    assert not is_whole(first_plan(study, 6, 0))


@pytest.mark.parametrize(
    ("override", "partial"),
    [
        ("search.points=6", True),
        ("search.points=28", False),
        ("search.objectives=['expected_shift_time_s', 'smallest_margin']", True),
        ("search.objectives=['shift_time_quantile_s', 'axial_length_mm']", False),
        ("search.objectives=['expected_shift_time_s', 'peak_impact_force_N']", False),
    ],
)
def test_only_what_can_be_foretold_is_left_out(override: str, partial: bool) -> None:
    study = load_study("mq200_paper", [*ONE_LEVEL, "search.points=6", override])
    assert DogGuide(study).partial == partial


def test_too_few_designs_to_foretell_from_are_simulated_whole(tmp_path: Path) -> None:
    study = load_study("mq200_paper", [*FEW, "search.trials=2", "search.confirm_designs=1"])
    result = run_study(study, searching(tmp_path, jobs=1))
    assert [row["points"] for row in result["trials"]] == [8, 8]
    assert all(len(points) == 8 for points in _points_of(tmp_path).values())
