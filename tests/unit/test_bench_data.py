"""Bench data sets: content, record and clock, and errors with file, row and column."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.bench.stand_file import EmptyCells, Measured, TestTerms, Tolerance
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.inference.static_readings import measured_facts
from dogshape.diagnosis.next_test import require_terms
from dogshape.diagnosis.report.wording import chance, remarks
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import build_study
from dogshape.pipeline.diagnose.study_keys import study_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.drive import Drive
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import good_set, state
from tests.conftest import Call
from tests.diagnoses import EFFECTS, simulated_bench, simulated_diagnosis


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    target = tmp_path / "set"
    shutil.copytree(bundled_root() / "bench" / "mq200_stand", target)
    return target


def test_published_tables_are_complete() -> None:
    for name in ("mq200_stand", "mq200_adams"):
        bench = load_bench(name)
        assert len(bench.cells) == 28
        assert sum(cell.time is None for cell in bench.cells) == 3
        assert all(cell.n == 10 for cell in bench.cells if cell.time is not None)
        assert bench.clutch.shift_travel == pytest.approx(4.65e-3)
        assert bench.clutch.contact.static_friction == 0.30
    first = load_bench("mq200_stand").cells[0]
    assert first.time == 0.4807
    assert first.point.mismatch == pytest.approx(5 * RPM)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.4807", "abc", "row 2, column shift_time_s is 'abc', but it must be a number"),
        ("0.4807", "480.7", "row 2, column shift_time_s is '480.7', but it must be a time in s"),
        ("5,235.2,0.251,10", "5,235.2,0.251,0", "row 2, column n_shifts is '0'"),
        ("0.4807,true", "0.4807,yes", "row 2, column engaged is 'yes'"),
        ("0.251,10", "0.251,1e12", "column n_shifts is '1e12', but it must be at most"),
        ("0.251,10", "0.251,2.5", "row 2, column n_shifts is '2.5', but it must be a whole number"),
        ("0.251,10", "0.251,", "column n_shifts is '', but it must be a whole number"),
        ("mismatch_rpm", "mismatch_rmp", "row 1: 'mismatch_rmp' is not a known column"),
        ("shift_time_s,", "shift_time_s,Force_N,", "'Force_N' is not a known column; did you"),
        ("5,235.2", "5,-235.2", "force_N is -235.2 N"),
        ("count = 15", "cuont = 15", "'dog.cuont' is not a known key; did you mean 'dog.count'?"),
        ("timeout_s = 1.0", "timeout_s = -1.0", "timeout_s is -1 s"),
        ("shift_travel_mm = 4.65", "shift_travel_mm = 5.0", "shift_travel_mm is 5 mm"),
        ("count = 15", "count = ", "not valid TOML"),
        ('time_zero = "unknown"', 'time_zero = "trigger"', "'trigger', but it must be one of"),
        ("[sensor]", '[sensor]\ndisplacement_at = "sleeve"', "mean 'record.displacement_at'?"),
        ("[dog]", "errors.clock_step_ms = 101.0\n[dog]", "is 101.0, but it must be at most 100"),
        ("[dog]", "errors.each_point.mismatch_rpm = 1e5\n[dog]", "each_point.mismatch_rpm is 1000"),
    ],
)
def test_broken_files(folder: Path, old: str, new: str, words: str) -> None:
    for file in (folder / "shifts.csv", folder / "bench.toml"):
        file.write_text(file.read_text().replace(old, new, 1))
    with pytest.raises(DogshapeError) as refused:
        load_bench(folder)
    assert words in str(refused.value)


def test_missing_sets_and_files(folder: Path) -> None:
    with pytest.raises(DogshapeError, match=r"there is no data set at.*mq200_adams, mq200_stand"):
        load_bench("nowhere")
    for name in ("shifts.csv", "bench.toml"):
        (folder / name).unlink()
        with pytest.raises(DogshapeError, match=f"there is no .*{name}"):
            load_bench(folder)


def test_a_set_without_times_gets_no_verdict_and_its_shares_compared(
    folder: Path, dogshape: Call
) -> None:
    table, nothing = folder / "shifts.csv", "50,469.0,0.1766,10,,,"
    head = table.read_text().splitlines()[0]
    table.write_text(f"{head}\n{nothing}\n{nothing}\n")
    said = dogshape("validate", folder)
    assert said.status == 2
    assert "no shift with a time and none that is known to have engaged or failed" in said.sentence
    table.write_text(f"{head}\n50,469.0,0.1766,4,,false,\n50,469.0,0.1766,1,,true,\n{nothing}\n")
    refused = dogshape("diagnose", folder)
    assert refused.status == 2
    assert "has no shift with a time (1 of 5 tried ones engaged)" in refused.sentence
    assert "'dogshape validate' compares the shares" in refused.sentence
    compared = dogshape("validate", folder, "--angles", 3, "--jobs", 1, "--json")
    assert "shifts by Drake, about 1 min of one core; the compiled engine takes" in compared.err
    assert "a stopped run leaves its finished shifts in results/shifts" in compared.err
    record = compared.json
    assert (record["rmse_s"], record["relative_rms"]) == (None, None)
    assert record["engaged"] == {"engaged": 1, "tried": 5, "simulated_share": 1.0}


def _warned(folder: Path, head: str, rows: list[str]) -> list[str]:
    (folder / "shifts.csv").write_text("\n".join([head, *rows]))
    return [finding.sentence for finding in load_bench(folder).warnings]


def test_rows_that_are_there_twice_are_a_warning(folder: Path) -> None:
    head, *rows = (folder / "shifts.csv").read_text().splitlines()
    assert _warned(folder, head, rows) == []
    (mean,) = _warned(folder, head, [*rows, rows[0]])
    assert mean.startswith(f"a row is there twice: row {len(rows) + 2} is row 2 again")
    (all_of_them,) = _warned(folder, head, [*rows, *rows])
    timed = sum(bool(row.split(",")[4]) for row in rows)
    assert all_of_them.startswith(f"{timed} rows repeat earlier ones: ")
    single = [f"50,469.0,0.1766,1,0.0{60 + k},true," for k in range(6)]
    failed = ["50,469.0,0.1766,1,,false,"] * 3
    assert _warned(folder, head, [*single, single[2], *failed]) == []
    (copied,) = _warned(folder, head, [*single, *single, *failed])
    assert copied.startswith("6 rows repeat earlier ones: row 8 is row 2 again; this looks like")


HEAD = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s,engaged\n"


@pytest.fixture
def planar(tmp_path: Path) -> Path:
    return good_set(tmp_path, sensor=False, traces=False)


def times(planar: Path, *values: float, n: int = 1) -> None:
    rows = "".join(f"50,469.0,0.1766,{n},{value:.6g},\n" for value in values)
    (planar / "shifts.csv").write_text(HEAD + rows)


def _stated(planar: Path, text: str) -> Bench:
    """Read a set with results and terms of bench tests."""
    state(planar, text)
    bench = load_bench(planar)
    require_terms(bench, EFFECTS)
    measured_facts(bench, EFFECTS)
    return bench


DRAG = '[[measured]]\neffect = "drag_torque"\nvalue = 2.2\nstandard_error = 0.1'
TERMS = '[[tests]]\nname = "{}"\n{}\n'
MENU = {"more shifts", *(effect.test.name for effect in EFFECTS.values())}


def test_errors_and_results_and_terms_of_bench_tests_are_keys_of_the_data_set(planar: Path) -> None:
    errors = "[errors]\nsystematic.mismatch_rpm = 0.5\neach_point.force_N = 3\n"
    bench = _stated(planar, f"{DRAG}\n{TERMS.format('traces', 'possible = false')}{errors}")
    assert bench.errors.systematic == Tolerance(mismatch_rpm=0.5)
    assert bench.errors.each_point == Tolerance(force_N=3.0)
    assert bench.measured == (Measured(effect="drag_torque", value=2.2, standard_error=0.1),)
    assert bench.tests == (TestTerms(name="traces", hours=None, possible=False),)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (DRAG.replace("drag_torque", "drag_torqe"), "did you mean 'drag_torque'"),
        (DRAG.replace("= 0.1", "= 0.0"), "must be above 0"),
        (DRAG.replace("value", 'parameter = "drag"\nvalue'), "must be one of: drag_Nm"),
        (DRAG.replace("drag_torque", "detent_force"), "must be one of: detent_N, position_mm"),
        (DRAG.replace("drag_torque", "reversed_mismatch"), "none to measure"),
        (DRAG.replace("drag_torque", "contact_friction"), "is left out, but must be one of"),
        (TERMS.format("more shift", ""), "which is not a bench test; did you mean 'more shifts'"),
        (TERMS.format("traces", "hours = -1.0"), "tests.0.hours is -1.0, but it must be above 0"),
        (
            "".join(TERMS.format(name, "possible = false") for name in MENU),
            "leaves no bench test that is possible",
        ),
    ],
)
def test_wrong_results_and_terms_are_sentences(planar: Path, text: str, words: str) -> None:
    with pytest.raises(DogshapeError, match=words):
        _stated(planar, text)


@pytest.mark.parametrize(
    ("reading", "failed", "unknown"), [("not_made", 2, 0), ("failed", 12, 0), ("unknown", 2, 10)]
)
def test_empty_cells_read_as_stated(planar: Path, reading: str, failed: int, unknown: int) -> None:
    rows = "50,469.0,0.1766,3,0.1,\n50,469.0,0.1766,2,,false\n50,469.0,0.1766,10,,\n"
    (planar / "shifts.csv").write_text(HEAD + rows + "5,469.0,0.1766,1,,true\n")
    state(planar, f'[record]\nempty_cells = "{reading}"')
    cell, other = load_bench(planar).cells
    assert (cell.engaged, cell.failed, cell.unknown) == (3, failed, unknown)
    assert (cell.n, cell.time) == (3, pytest.approx(0.1))
    assert (other.engaged, other.failed, other.unknown) == (1, 0, 0)


def _silent(force: float, meaning: EmptyCells, **cause: Mapping[str, float]) -> Inference:
    """Diagnose means of shifts with a cause, beside rows of three at a force without a time."""
    bench = simulated_bench(cause)
    slips, profile = [cell.point.mismatch for cell in bench.cells[::3]], ForceProfile(force, 0.1766)
    rows = [Reading(50, OperatingPoint(slip, profile), 3, None, None) for slip in slips]
    cells = (*bench.cells, *(cell.with_empty(meaning) for cell in gather(rows)))
    record = bench.record.model_copy(update={"empty_cells": meaning})
    clutch = replace(bench.clutch, timeout=0.5)  # below the flight of a ring that hardly moves
    return simulated_diagnosis(replace(bench, clutch=clutch, cells=cells, record=record))


def test_a_meaning_of_empty_cells_that_decides_is_stated_beside_the_answer() -> None:
    """Shifts at 60 N fail by 100 N of friction, which times from 235 N on hardly show."""
    found = _silent(60.0, "unknown", sleeve_friction={"friction_N": 100.0})
    one, other = found.record_meanings
    assert (one.verdict.causes, other.verdict.causes) == ((), ("sleeve_friction",))
    assert found.verdict.causes == other.verdict.causes
    clause = f"If shifts without a time were not made ({chance(one.probability)})"
    assert [remark for remark in remarks(found) if remark.startswith(clause)]
    for meaning, reading in (("not_made", one), ("failed", other)):
        stated = _silent(60.0, meaning, sleeve_friction={"friction_N": 100.0})
        assert (stated.record_meanings, stated.verdict) == ((), reading.verdict)
        # Of a reading, what moves no probability of the whole answer is simulated less.
        one_round = 0.25 * USUAL.emulated_nats * 2.0**-USUAL.emulated_decay
        assert stated.leading in reading.posterior
        probability = reading.posterior[stated.leading]
        assert probability == pytest.approx(stated.posterior[stated.leading], abs=one_round)


def test_failures_that_nothing_explains_decide_nothing() -> None:
    found = _silent(600.0, "unknown", actuation_delay={"delay_s": 0.08})
    assert [one.probability > 0.9 for one in found.record_meanings] == [True, False]
    assert found.verdict.causes == ("actuation_delay",)
    assert not [remark for remark in remarks(found) if "without a time" in remark]


CYCLES = (0.12, 0.17, 0.09, 0.11, 0.21)
FINER = (0.121, 0.174, 0.093, 0.112, 0.215)


@pytest.mark.parametrize(
    ("values", "step"),
    [
        (CYCLES, 0.01),
        *((one, 0.0) for one in (FINER, CYCLES[:3], (0.121, *CYCLES), (0.122, 0.174, 0.096))),
    ],
)
def test_times_show_a_control_cycle(planar: Path, values: tuple[float, ...], step: float) -> None:
    times(planar, *values)
    bench = load_bench(planar)
    assert bench.clock_step == pytest.approx(step)
    said = [warning.sentence for warning in bench.warnings]
    assert [
        "all 5 times of single shifts are multiples of 10 ms" in one
        and one.endswith("state that key, with 0 where the clock is finer")
        for one in said
    ] == [True] * (step > 0.0)


def test_a_step_that_the_times_do_not_have_is_refused(planar: Path) -> None:
    times(planar, *CYCLES, 0.1234)
    state(planar, "[errors]\nclock_step_ms = 10.0")
    words = r"10 ms, but 1 of 6 times of single shifts .* of it \(row 7: 0.1234 s\)"
    with pytest.raises(DogshapeError, match=words):
        load_bench(planar)


def test_a_bench_keeps_how_its_shafts_turned(planar: Path, tmp_path: Path) -> None:
    """``[drive]`` of a data set, and of the study that is made of it; a standing ring has none."""
    folder = tmp_path / "turning"
    shutil.copytree(planar, folder)
    text = (folder / "bench.toml").read_text()
    assert "drive" not in study_of(load_bench(folder), "own")
    drive = '[drive]\nshaft_speed_rpm = 800.0\nengine_side = "output"\noutput_torque_Nm = -4.0\n\n'
    (folder / "bench.toml").write_text(text.replace("[contact]", f"{drive}[contact]"))
    bench = load_bench(folder)
    assert bench.clutch.drive == Drive(800 * RPM, "output", output_torque=(-4.0,))
    study = build_study(validate(StudyFile, study_of(bench, "own"), "own"))
    assert study.clutch.drive.sliding_speed(3.0) == pytest.approx(800 * RPM)
    (folder / "bench.toml").write_text(
        text.replace("[sliding]", "[sliding]\ninitial_speed_rpm = 5.0")
    )
    with pytest.raises(DogshapeError, match=r"drive\.shaft_speed_rpm"):
        load_bench(folder)


def test_keys_that_nothing_uses_may_stay_in_a_file(planar: Path) -> None:
    """A friction velocity of earlier files, and pressure and time of a static reading."""
    bench = load_bench(planar)
    file = planar / "bench.toml"
    text = file.read_text().replace("[contact]\n", "[contact]\nfriction_velocity_m_s = 1.0\n")
    file.write_text(text)
    state(planar, "[[actuator_calibration]]\npressure_mbar = 750.0\nmax_force_time_s = 0.25")
    same = load_bench(planar)
    assert (same.clutch, same.cells, same.warnings) == (bench.clutch, bench.cells, bench.warnings)
