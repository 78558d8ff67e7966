"""Tables of spreadsheets: sheets of workbooks in, answers out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.sim.texts import read_table
from dogshape.sim.units import RPM
from tests.conftest import Said

Call = Callable[..., Said]
RUNS = [
    ["Bench 7", None, None],
    [None, None, None],
    ["n [1/min]", "F [kN]", "t [ms]"],
    [50, 0.469, 190.5],
    [149, 0.6415, 170],
]


def _book(path: str, **sheets: list[list[object]]) -> None:
    with pd.ExcelWriter(path) as book:
        for name, rows in sheets.items():
            pd.DataFrame(rows).to_excel(book, sheet_name=name, header=False, index=False)


def test_a_sheet_of_a_workbook_becomes_a_data_set(dogshape: Call) -> None:
    _book("m.xlsx", runs=RUNS, empty=[], notes=[["oil", "cold"]])
    said = dogshape("init", "bench", "m.xlsx")
    assert said.status == 2
    assert said.sentence == (
        "dogshape: m.xlsx: several sheets have cells; name one of runs, notes, as m.xlsx#runs"
    )
    assert "there is no sheet 'run'" in dogshape("init", "bench", "m.xlsx#run").sentence
    assert dogshape("init", "bench", "m.xlsx#runs").status == 0
    bench = load_bench("m")
    read = [(r.point.mismatch / RPM, r.point.profile.force, r.time) for r in bench.readings]
    assert read == [
        (pytest.approx(50.0), pytest.approx(469.0), pytest.approx(0.1905)),
        (pytest.approx(149.0), pytest.approx(641.5), pytest.approx(0.17)),
    ]
    assert Path("m/as_measured/m.xlsx").read_bytes() == Path("m.xlsx").read_bytes()


def test_a_file_that_is_no_workbook_is_refused(dogshape: Call) -> None:
    Path("m.xlsx").write_text("a;b\n1;2\n")
    said = dogshape("init", "bench", "m.xlsx")
    assert said.status == 2
    assert said.sentence == "dogshape: m.xlsx is no workbook; save it as .xlsx or as CSV"


def test_designs_of_a_workbook_are_answered_in_one(dogshape: Call) -> None:
    designs = [["note", "chamfer_deg", "count"], ["a", 11.5, 18], ["b", 12, 20]]
    _book("d.xlsx", Sheet1=designs)
    assert dogshape("check", "mq200_paper", "--designs", "d.xlsx").status == 0
    found = pd.read_excel("d-times.xlsx")
    assert found["note"].tolist() == ["a", "b"]
    assert found["chamfer_deg"].tolist() == [11.5, 12.0]
    pd.DataFrame(designs[1:], columns=designs[0]).to_csv("d.csv", index=False)
    assert dogshape("check", "mq200_paper", "--designs", "d.csv").status == 0
    same = pd.read_csv("d-times.csv")
    assert found["expected_shift_time_s"].to_numpy() == pytest.approx(
        same["expected_shift_time_s"].to_numpy(), rel=1e-5
    )


def test_a_time_series_is_written_as_csv_or_workbook(dogshape: Call) -> None:
    point = ("--mismatch-rpm", "50", "--force-N", "469", "--relative-angle-deg", "10")
    engine = ("--engine", "planar")
    for name in ("t.csv", "t.xlsx"):
        assert dogshape("shift", "mq200", *point, *engine, "--trace", name).status == 0
    csv, book = pd.read_csv("t.csv"), pd.read_excel("t.xlsx")
    pd.testing.assert_frame_equal(csv, book, check_dtype=False, rtol=1e-8)


def test_cells_of_a_workbook_are_read_as_they_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "t.xlsx"
    _book(str(path), a=[["time", "x"], [pd.Timestamp("2024-05-31 14:06"), 0.469], ["0,5", None]])
    rows = read_table(path, ("x",)).rows
    assert rows == ((2, ("2024-05-31 14:06:00", "0.4690")), (3, ("0,5", "")))
