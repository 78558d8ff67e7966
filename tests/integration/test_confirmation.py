"""Confirmation on times made up: some designs were lucky in the search, or land too hard later."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.designs import designs_frame, failed_at_new_angles
from dogshape.pipeline.search.result_schema import StudyRecord
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.sim.clutch_tables import validate
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from tests.conftest import SMALL

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
        budget: int = 24, report: bool = False,
    ) -> Found:  # fmt: skip
        def made_up(block: Block) -> Iterator[Record]:
            new = (block.seed or 0) >= NEW_ANGLES
            for key, given in zip(block.keys, block.inputs, strict=True):
                own = round(given["chamfer_deg"], 6)
                load = 1e7 if new and own in (hard or ()) else 0.0
                stuck = given["chamfer_deg"] < blocked and block.keys.index(key) % 4 != 0
                time = _time(given) + LATE * (new and own in (lucky or ()))
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
        return run_study(study, Run(StudyFolder(place), 1, report=report))

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
    ends = {n: designs[n][TIME] + 1.96 * designs[n]["standard_error_s"] for n in front}
    assert found["chosen"] == min(ends, key=lambda number: ends[number])


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
    assert failed_at_new_angles(fails) == [number]
    frame = designs_frame(fails, ["chamfer_deg"]).set_index("trial")
    assert frame.index[frame["failed_at_fresh_angles"]].tolist() == [number]
    every = searched(hard={_chamfer(row) for row in plain["trials"]})
    assert every["front"] == []
    assert every["confirmation"]["chosen"] == _front(plain["trials"])[0]


def test_what_is_beyond_the_budget_is_left_out(searched: Searched) -> None:
    result = searched(budget=2)
    confirmed = {one["trial"] for one in result["confirmation"]["designs"]}
    assert len(confirmed) == 2
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
