"""Confirmation on times made up: some designs were lucky in the search, or land too hard later."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.designs import designs_frame, out_at_new_angles
from dogshape.pipeline.reports.headline import headline
from dogshape.pipeline.search.confirmation import HANG_ANGLES, contested_designs, deciding_points
from dogshape.pipeline.search.state import PointTimes, SearchState, Trial, replace_priors
from dogshape.pipeline.search.study_record import StudyRecord
from dogshape.pipeline.simulate.design import CheckInputs, Design
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, Evaluation
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import StudyOptions, run_study
from dogshape.sim.clutch_tables import validate
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.expectation import Estimate, ShiftResult, expect, expect_point
from dogshape.sim.statistics.hangs import HangPrior, pool
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.landing import Demand
from tests.conftest import SMALL
from tests.search_results import record_of

SETTINGS = [
    *SMALL,
    "solver.engine=drake",
    "expectation.angles=4",
    "search.sampler=space_filling",
    "search.trials=24",
    "search.confirm_designs=24",
]
LATE = 0.02  #: s that a design takes longer at the new angles, where it was lucky in the search
TIME, LENGTH = "expected_shift_time_s", "axial_length_mm"

Found = dict[str, Any]
Searched = Callable[..., Found]


def _time(given: Record) -> float:
    """Return the time of a shift: a saw-tooth round the pitch, longer for short dogs."""
    mean = 0.09 + 0.006 * (4.2 - given["height_mm"]) + 0.012 * (given["braking_deg"] % 1.0)
    turned = given["relative_angle_deg"] * given["count"] / 360.0
    place = (turned + 7.3 * given["height_mm"] + 0.31 * given["chamfer_deg"]) % 1.0
    return mean + 0.03 * (place - 0.5)


@pytest.fixture
def searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Searched:
    """Run the study by a formula; sets name designs by their chamfer.

    At the new angles ``hard`` designs land too hard, and ``lucky`` ones take longer. Of those whose
    chamfer is below ``blocked`` one shift in three or four engages.
    """
    monkeypatch.setattr("dogshape.pipeline.study.MIN_DESIGNS", 99)  # no surrogate

    def search(
        hard: set[float] | None = None, lucky: set[float] | None = None, blocked: float = 0.0,
        *, budget: int = 24, report: bool = False, late: float = LATE,
    ) -> Found:  # fmt: skip
        def made_up(block: Block) -> Iterator[Record]:
            new = (block.seed or 0) >= NEW_ANGLES
            for key, given in zip(block.keys, block.inputs, strict=True):
                own = round(given["chamfer_deg"], 6)
                load = 1e7 if new and own in (hard or ()) else 0.0
                stuck = given["chamfer_deg"] < blocked and block.keys.index(key) % 4 != 0
                time = _time(given) + late * (new and own in (lucky or ()))
                yield {
                    "key": key, **given, "outcome": "blocked" if stuck else "engaged",
                    "seed": block.seed, "shift_time_s": None if stuck else time, "face_contacts": 1,
                    "slots_skipped": 0,
                    "peak_axial_force_N": 1e3, "peak_tangential_force_N": 1e3,
                    "landing_loads_N_mm": [1e-3 * load] * len(OVERLAPS),
                }  # fmt: skip

        monkeypatch.setattr("dogshape.pipeline.simulate.executor.run_block", made_up)
        study = load_study("mq200_paper", [*SETTINGS, f"search.confirm_designs={budget}"])
        place = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        return run_study(study, StudyOptions(StudyFolder(place), 1, report=report)).to_dict()

    return search


def _front(rows: list[Found], without: int | None = None) -> list[int]:
    """The designs that no other beats, best first, by comparing each with each."""
    values = {
        row["trial"]: (row[TIME], row[LENGTH])
        for row in rows
        if row["feasible"] and row["trial"] != without
    }
    kept = [
        number
        for number, own in values.items()
        if not any(o[0] <= own[0] and o[1] <= own[1] and o != own for o in values.values())
    ]
    return sorted(kept, key=lambda number: values[number][0])


def _chamfer(row: Found) -> float:
    return round(row["chamfer_deg"], 6)


def test_the_whole_front_is_confirmed_and_has_values_of_the_new_angles(searched: Searched) -> None:
    result = searched()
    found, front = result["confirmation"], [row["trial"] for row in result["front"]]
    designs = {one["trial"]: one for one in found["designs"]}
    lengths = {row["trial"]: row[LENGTH] for row in result["trials"]}
    after = [
        {**one, LENGTH: lengths[number], "feasible": all(c["passed"] for c in one["checks"])}
        for number, one in designs.items()
    ]
    assert {*_front(result["trials"])} <= {*designs}
    assert front == _front(after)
    assert found["left_out"] == []
    for row in result["front"]:
        assert row[TIME] == designs[row["trial"]][TIME]
        assert row["standard_error_s"] == designs[row["trial"]]["standard_error_s"]
    assert found["chosen"] == front[0]


def test_designs_that_were_lucky_or_fail_later_leave_the_front(searched: Searched) -> None:
    """A design that a withdrawn one dominated is confirmed; trials stay those of the search."""
    plain = searched()
    whole = _front(plain["trials"])
    # The first of the front that alone dominates others.
    number = next(one for one in whole if len(_front(plain["trials"], one)) >= len(whole))
    first = next(row for row in plain["trials"] if row["trial"] == number)
    beaten = _front(plain["trials"], number)
    late, fails = searched(lucky={_chamfer(first)}), searched(hard={_chamfer(first)})
    for result in (late, fails):
        assert result["trials"] == plain["trials"]
        assert number not in [row["trial"] for row in result["front"]]
        assert result["confirmation"]["chosen"] != number
        assert {*beaten} <= {one["trial"] for one in result["confirmation"]["designs"]}
    one = next(d for d in late["confirmation"]["designs"] if d["trial"] == number)
    off = one[TIME] - one["searched"]["value"]
    assert off > 0.5 * LATE
    errors = one["searched"]["standard_error"] ** 2 + one["standard_error_s"] ** 2
    assert one["errors_apart"] == pytest.approx(off / errors**0.5)
    assert one["agrees"] == (abs(one["errors_apart"]) <= 3.0)
    assert [*out_at_new_angles(record_of(fails))] == [number]
    frame = designs_frame(record_of(fails), ["chamfer_deg"]).set_index("trial")
    assert frame.index[frame["failed_at_fresh_angles"]].tolist() == [number]
    every = searched(hard={_chamfer(row) for row in plain["trials"]})
    assert every["front"] == []
    assert every["confirmation"]["chosen"] == _front(plain["trials"])[0]


def test_what_is_beyond_the_budget_is_left_out(searched: Searched) -> None:
    result = searched(budget=2)
    confirmed = {one["trial"] for one in result["confirmation"]["designs"]}
    assert len(confirmed - {0}) == 2  # beside the study's own dog
    assert result["confirmation"]["left_out"]
    assert not confirmed & {*result["confirmation"]["left_out"]}
    assert {row["trial"] for row in result["front"]} <= confirmed


def test_designs_that_do_not_engage_get_no_time_or_gain(searched: Searched, tmp_path: Path) -> None:
    """The prototype, of 8 degrees, and others; none is ranked by the retries of a time-out."""
    result = searched(blocked=9.0, report=True)
    validate(StudyRecord, result, "the result")
    page = (tmp_path / "out0" / "report.html").read_text("utf-8")
    silent = [row for row in result["trials"] if "engagement" in row["failed"]]
    assert 0 in [row["trial"] for row in silent]
    assert all(row[TIME] is None and not row["feasible"] for row in silent)
    assert all(row["engaged"] < 0.5 for row in silent)
    assert "faster" not in page
    confirmation = result["confirmation"]
    assert all(row["engaged"] == 1.0 for row in [result["best"], *result["front"]])
    assert confirmation["prototype"]["engages"] is False
    assert confirmation["prototype"][TIME] is None
    assert confirmation["gain_s"] is confirmation["gain_share"] is None
    assert confirmation["gains"] == {}


HANG_SHIFTS = 64  #: of each of two operating points


def _at_new_angles(
    state: SearchState, engaged: Sequence[float], hangs: Sequence[int]
) -> tuple[SearchState, dict[int, Evaluation]]:
    """Give designs that engage in such times, and hang so often at the first operating point."""
    study, found = state.study, dict[int, Evaluation]()
    trials = list[Trial]()
    for number, (time, hung) in enumerate(zip(engaged, hangs, strict=True)):
        points = []
        for point, count in zip(study.points, (hung, 0), strict=True):
            shifts = [ShiftResult(Outcome.ENGAGED, time)] * (HANG_SHIFTS - count)
            shifts += [ShiftResult(Outcome.TIMED_OUT, None)] * count
            points.append(expect_point(point, shifts, 1.0, 0.2))
        expectation = expect(points)
        estimates = {TIME: Estimate(expectation.mean, expectation.standard_error)}
        check_inputs = CheckInputs(Demand())
        found[number] = Evaluation(
            expectation, check_inputs, np.zeros((0, 13)), estimates, 2 * HANG_SHIFTS
        )
        trials.append(
            Trial(number, study.prototype, (expectation.mean,), estimates=estimates,
                  check_inputs=check_inputs, times=[PointTimes.of(point) for point in points])
        )  # fmt: skip
    return SearchState(study, tuple(trials)), found


def test_hangs_that_decide_between_designs_are_looked_at_more_closely() -> None:
    """A clearly slower design is a rival as long as its hangs may be fewer; far ones are none."""
    study = load_study("mq200_paper", [*SMALL, "search.objectives=['expected_shift_time_s']"])
    state, found = _at_new_angles(
        SearchState(study, ()), [0.060, 0.064, 0.500, 0.060], hangs=[0, 0, 0, 1]
    )
    priors = pool([trial.counts for trial in state.trials])
    found = {number: one.replace_priors(priors) for number, one in found.items()}
    trials = tuple(replace_priors(study, trial, priors) for trial in state.trials)
    passing = {number: Design(study, study.prototype, study.clutch.dog, (), "") for number in found}
    renewed = SearchState(study, trials, passing)
    # The last is as fast while it engages: its hang alone tells it from the best.
    assert contested_designs(renewed, found) == [0, 1]
    at_first = deciding_points([found[3].expectation])
    assert at_first == [0]
    surely_none = HangPrior(rate=1e-6, strength=1e7, blocked_share=1e-9)
    sure = {number: one.replace_priors([surely_none] * 2) for number, one in found.items()}
    assert contested_designs(renewed, sure) == []
    assert HANG_ANGLES.rounds(16) == [32, 64, 128]


def test_the_own_dog_is_confirmed_and_chosen_where_it_is_the_fastest(searched: Searched) -> None:
    """At the new angles all other designs were lucky: the own dog, behind before, is the best."""
    plain = searched()
    others = {_chamfer(row) for row in plain["trials"] if not row["prototype"]}
    assert plain["best"]["prototype"] is False
    result = searched(lucky=others, late=0.2)
    confirmation = result["confirmation"]
    assert 0 in {one["trial"] for one in confirmation["designs"]}
    assert result["best"]["prototype"]
    assert confirmation["chosen"] == 0
    assert confirmation["gain_s"] is None
    assert headline(record_of(result)).startswith(
        "Your own dog is the fastest: expected shift time"
    )
    assert headline(record_of(result)).endswith("Not judged: flank strike.")
    assert 0 in [row["trial"] for row in result["front"]]
