"""Tables of designs, and of spreadsheets: what is refused, filled in, and answered."""

from __future__ import annotations

import csv
from pathlib import Path

import pandas as pd
import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.bench.texts import read_table
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.design import design_of
from dogshape.sim.units import RPM
from tests.conftest import Call, CommandResult


def _asked(dogshape: Call, text: str, *more: object) -> CommandResult:
    Path("designs.csv").write_text(text)
    return dogshape("predict", "mq200_paper", "designs.csv", *more)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hight_mm\n3\n", "row 1: 'hight_mm' is no variable; did you mean 'height_mm'?"),
        ("note\nx\n", "there is no column of a variable; valid are chamfer_deg"),
        ("count,count\n15,16\n", "the column 'count' is there twice; keep one"),
        ("count,outer_diameter_mm\n15,52\n", "'outer_diameter_mm' is the same for all designs"),
        ("count,feasible\n15,True\n", "'feasible' is a column of the answers; take it away"),
        ("count\n15.5\n", "row 2, column count is '15.5', but it must be a whole number"),
        ("height_mm\nabc\n", "row 2, column height_mm is 'abc', but it must be a number"),
        ("count\n", "holds no design below its line of names"),
        ("", "it is empty"),
    ],
)
def test_bad_tables_are_one_sentence(dogshape: Call, text: str, words: str) -> None:
    assert words in _asked(dogshape, text).sentence
    assert not Path("designs-times.csv").exists()


def test_what_the_study_fills_in_is_said(dogshape: Call) -> None:
    said = _asked(dogshape, "name,count,height_mm\na,18,3.5\n", "--json")
    assert said.status == 0
    filled = said.json["filled"]
    assert filled == {"chamfer_deg": 8.0, "traction_deg": 12.0, "braking_deg": 22.0}
    assert said.json["kept"] == ["name"]
    assert "the study gives, chamfer_deg = 8, traction_deg = 12, braking_deg = 22" in said.err
    assert "columns copied, and no part of the question: name" in said.err


def test_what_cannot_be_a_dog_has_a_reason_and_no_time(dogshape: Call) -> None:
    said = _asked(dogshape, "count,height_mm\n18,-3\n900,3.7\n15,3.7\n15,3.0\n")
    assert said.status == 1
    assert "row 2 is no design: dog.height_mm is -3 mm" in said.out
    assert "wrote designs-times.csv: designs 4" in said.out
    assert "impossible 2" in said.out
    answers = csv.DictReader(Path("designs-times.csv").read_text().splitlines())
    negative, crowded, prototype, low = answers
    for row, reason in ((negative, "dog.height_mm is -3 mm"), (crowded, "tip width")):
        assert reason in row["reason"]
        assert row["feasible"] == "False"
        assert row["expected_shift_time_s"] == row["worst_check"] == ""
        assert row["in_range"] == "False"
    study = load_study("mq200_paper")
    for row, params in ((prototype, {}), (low, {"height_mm": 3.0})):
        design = design_of(study, params)
        worst = min(design.checks, key=lambda check: check.margin)
        assert float(row["expected_shift_time_s"]) > 0.0
        assert row["feasible"] == str(design.feasible)
        assert row["verdict"] == ("not_judged" if design.feasible else "fails")
        assert row["worst_check"] == worst.name
        assert float(row["smallest_margin"]) == pytest.approx(worst.margin, rel=1e-3)
        assert row["reason"] == ""
        assert row["not_judged"] == "flank_strike landing engagement"
    best = "row 4: dogshape check mq200_paper --set dog.height_mm=3.7 --set dog.count=15"
    assert f"landing and engagement of {best}" in " ".join(said.out.split())
    record = _asked(dogshape, "count,height_mm\n18,-3\n15,3.7\n", "--json").json
    assert [one["row"] for one in record["impossible"]] == [2]
    assert record["verdict"]["state"] == {"not_judged": 1, "fails": 1}
    open_ones = [one["check"] for one in record["verdict"]["not_judged"]]
    assert open_ones == ["flank_strike", "landing", "engagement"]
    assert record["best"]["row"] == 3
    none = _asked(dogshape, "count,height_mm\n18,-3\n", "--json")
    assert (none.status, none.json["best"], none.json["best_feasible"]) == (1, None, None)


RUNS = [
    ["Bench 7", None, None],
    [None, None, None],
    ["dn [1/min]", "F [kN]", "t [ms]"],
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
    assert said.sentence == "dogshape: m.xlsx is no workbook; save it as .xlsx or as CSV"


def test_designs_of_a_workbook_are_answered_in_one(dogshape: Call) -> None:
    designs = [["note", "chamfer_deg", "count"], ["a", 11.5, 18], ["b", 12, 20]]
    _book("d.xlsx", Sheet1=designs)
    assert dogshape("predict", "mq200_paper", "d.xlsx").status == 0
    found = pd.read_excel("d-times.xlsx")
    assert found["note"].tolist() == ["a", "b"]
    assert found["chamfer_deg"].tolist() == [11.5, 12.0]
    pd.DataFrame(designs[1:], columns=designs[0]).to_csv("d.csv", index=False)
    assert dogshape("predict", "mq200_paper", "d.csv").status == 0
    same = pd.read_csv("d-times.csv")
    assert found["expected_shift_time_s"].to_numpy() == pytest.approx(
        same["expected_shift_time_s"].to_numpy(), rel=1e-5
    )


def test_a_time_series_is_written_as_csv_or_workbook(dogshape: Call) -> None:
    point = ("--mismatch-rpm", "50", "--force-N", "469", "--angle-deg", "10")
    engine = ("--engine", "planar")
    for name in ("t.csv", "t.xlsx"):
        assert dogshape("shift", "mq200", *point, *engine, "--trace", name).status == 0
    csv, book = pd.read_csv("t.csv"), pd.read_excel("t.xlsx")
    pd.testing.assert_frame_equal(csv, book, check_dtype=False, rtol=1e-8)


def test_cells_of_a_workbook_are_read_as_they_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "t.xlsx"
    _book(str(path), a=[["time", "x"], [pd.Timestamp("2024-05-31 14:06"), 0.469], ["0,5", None]])
    rows = read_table(path, ("x",)).rows
    assert rows == ((2, ("2024-05-31 14:06:00", "0.469")), (3, ("0,5", "")))
