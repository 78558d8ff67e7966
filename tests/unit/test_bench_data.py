"""Bench data sets: what is read, and errors with file, row and column."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.sim.errors import DogshapeError
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.conftest import Said


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
        ("5,235.2", "5,-235.2", "shift force is -235.2 N"),
    ],
)
def test_broken_tables(folder: Path, old: str, new: str, words: str) -> None:
    table = folder / "shifts.csv"
    table.write_text(table.read_text().replace(old, new, 1))
    with pytest.raises(DogshapeError) as refused:
        load_bench(folder)
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("count = 15", "cuont = 15", "'dog.cuont' is not a known key; did you mean 'dog.count'?"),
        ("timeout_s = 1.0", "timeout_s = -1.0", "timeout_s is -1 s"),
        ("shift_travel_mm = 4.65", "shift_travel_mm = 5.0", "shift_travel_mm is 5 mm"),
        ("count = 15", "count = ", "not valid TOML"),
    ],
)
def test_broken_settings(folder: Path, old: str, new: str, words: str) -> None:
    file = folder / "bench.toml"
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
    folder: Path, dogshape: Callable[..., Said]
) -> None:
    table, nothing = folder / "shifts.csv", "50,469.0,0.1766,10,,,"
    head = table.read_text().splitlines()[0]
    table.write_text(f"{head}\n{nothing}\n{nothing}\n")
    said = dogshape("validate", folder)
    assert said.status == 2
    assert "no shift with a time and none that is known to have engaged or failed" in said.sentence
    table.write_text(f"{head}\n50,469.0,0.1766,4,,false,\n50,469.0,0.1766,1,,true,\n{nothing}\n")
    refused = dogshape("gap", folder)
    assert refused.status == 2
    assert "has no shift with a time (1 of 5 tried ones engaged)" in refused.sentence
    assert "'dogshape validate' compares the shares" in refused.sentence
    record = dogshape("validate", folder, "--angles", 3, "--jobs", 1, "--json").json
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
