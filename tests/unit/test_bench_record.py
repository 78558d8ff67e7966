"""Unit: what a table does not show of its record, and the clock that took its times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from dogshape.diagnosis.bench.bench_data import Reading, gather, load_bench
from dogshape.diagnosis.bench.stand_file import EmptyCells
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, summary
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from tests.benches import good_set
from tests.diagnosed import simulated_bench, simulated_diagnosis

HEAD = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s,engaged\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return good_set(tmp_path, sensor=False, traces=False)


def state(folder: Path, text: str) -> None:
    with (folder / "bench.toml").open("a") as file:
        file.write(f"\n{text}\n")


def times(folder: Path, *values: float, n: int = 1) -> None:
    rows = "".join(f"50,469.0,0.1766,{n},{value:.6g},\n" for value in values)
    (folder / "shifts.csv").write_text(HEAD + rows)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[record]\ntime_zero = "trigger"', "time_zero is 'trigger', but it must be one of"),
        ('[sensor]\ndisplacement_at = "actuator"', "did you mean 'record.displacement_at'?"),
        ("[errors]\nclock_step_ms = 101.0", "is 101.0, but it must be at most 100"),
    ],
)
def test_a_wrong_key_is_refused_with_its_rule(folder: Path, text: str, words: str) -> None:
    state(folder, text)
    with pytest.raises(DogshapeError, match=words.replace("?", r"\?")):
        load_bench(folder)


@pytest.mark.parametrize(
    ("reading", "failed", "unknown"),
    [("not_made", 2, 0), ("failed", 12, 0), ("unknown", 2, 10)],
)
def test_empty_cells_are_read_as_stated(
    folder: Path, reading: str, failed: int, unknown: int
) -> None:
    rows = "50,469.0,0.1766,3,0.1,\n50,469.0,0.1766,2,,false\n50,469.0,0.1766,10,,\n"
    (folder / "shifts.csv").write_text(HEAD + rows + "5,469.0,0.1766,1,,true\n")
    state(folder, f'[record]\nempty_cells = "{reading}"')
    cell, other = load_bench(folder).cells
    assert (cell.engaged, cell.failed, cell.unknown) == (3, failed, unknown)
    assert (cell.n, cell.time) == (3, pytest.approx(0.1))
    assert (other.engaged, other.failed, other.unknown) == (1, 0, 0)


def _silent(force: float, meaning: EmptyCells, **cause: Mapping[str, float]) -> Diagnosis:
    """Diagnose means of shifts with a cause, beside rows of three at a force without a time."""
    bench = simulated_bench(cause)
    slips, profile = [cell.point.mismatch for cell in bench.cells[::3]], ForceProfile(force, 0.1766)
    rows = [Reading(50, OperatingPoint(slip, profile), 3, None, None) for slip in slips]
    cells = (*bench.cells, *(cell.with_empty(meaning) for cell in gather(rows)))
    record = bench.record.model_copy(update={"empty_cells": meaning})
    clutch = replace(bench.clutch, timeout=0.5)  # below the flight of a ring that hardly moves
    return simulated_diagnosis(replace(bench, clutch=clutch, cells=cells, record=record))


def test_a_meaning_of_empty_cells_that_decides_is_stated_beside_the_answer() -> None:
    """Shifts at 60 N fail by 120 N of friction, which times from 235 N on hardly show."""
    found = _silent(60.0, "unknown", sleeve_friction={"friction_N": 120.0})
    one, other = found.readings
    assert (one.verdict.causes, other.verdict.causes) == ((), ("sleeve_friction",))
    assert found.verdict.causes == ()
    assert f"If shifts without a time failed ({chance(other.probability)})" in summary(found)
    for meaning, reading in (("not_made", one), ("failed", other)):
        stated = _silent(60.0, meaning, sleeve_friction={"friction_N": 120.0})
        assert (stated.readings, stated.verdict) == ((), reading.verdict)
        most = max(stated.posterior.values())
        assert max(reading.posterior.values()) == pytest.approx(most, rel=0.01)


def test_failures_that_nothing_explains_decide_nothing() -> None:
    found = _silent(600.0, "unknown", actuation_delay={"delay_s": 0.08})
    assert [one.probability > 0.9 for one in found.readings] == [True, False]
    assert found.verdict.causes == ("actuation_delay",)
    assert "without a time" not in summary(found)


CYCLES = (0.12, 0.17, 0.09, 0.11, 0.21)


def test_times_of_a_controller_show_its_cycle(folder: Path) -> None:
    times(folder, *CYCLES)
    bench = load_bench(folder)
    assert bench.clock_step == pytest.approx(0.01)
    (warning,) = bench.warnings
    assert "all 5 times of single shifts are multiples of 10 ms" in warning.sentence
    assert warning.sentence.endswith("state that key, with 0 where the clock is finer")


@pytest.mark.parametrize(
    "values",
    [(0.121, 0.174, 0.093, 0.112, 0.215), CYCLES[:3], (0.121, *CYCLES), (0.122, 0.174, 0.096)],
)
def test_finer_or_few_times_show_none(folder: Path, values: tuple[float, ...]) -> None:
    times(folder, *values)
    bench = load_bench(folder)
    assert (bench.clock_step, bench.warnings) == (0.0, ())


def test_a_step_that_the_times_do_not_have_is_refused(folder: Path) -> None:
    times(folder, *CYCLES, 0.1234)
    state(folder, "[errors]\nclock_step_ms = 10.0")
    words = r"10 ms, but 1 of 6 times of single shifts .* of it \(row 7: 0.1234 s\)"
    with pytest.raises(DogshapeError, match=words):
        load_bench(folder)
