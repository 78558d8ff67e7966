"""A diagnosis of a table in one command: its reading, its folder, its questions and refusals."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pandas as pd
import pytest
from openpyxl import Workbook
from typer.testing import CliRunner

import dogshape as ds
from dogshape.bench.bench_data import Bench
from dogshape.bench.bench_draft import read_tables
from dogshape.bench.foreign_table import read_foreign
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.sim.errors import DataError, InputError
from tests.conftest import Call
from tests.diagnoses import diagnosis_of

TABLE = """\
dn [1/min];F_shift [N];t_shift [ms]
50;469;116
50;469;131
100;469;84
100;642;71
"""
QUESTION = TABLE.replace("[ms]\n", "[ms];Remark\n").replace(";131\n", ";131;x\n")


def _diagnosed(bench: Bench, _: Any) -> Any:
    posterior = {("sleeve_friction",): 0.9, ("moving_mass",): 0.06, NONE: 0.02, UNKNOWN: 0.02}
    return diagnosis_of(posterior, bench)


@pytest.fixture(autouse=True)
def _by_rule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnose without simulations, in a folder whose temporary files are seen."""
    monkeypatch.setattr("dogshape.gap.diagnose_bench", _diagnosed)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))


def _files() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*") if path.is_file())


def test_a_table_is_diagnosed_and_nothing_is_left(dogshape: Call) -> None:
    Path("m 1.csv").write_text(TABLE)
    said = dogshape("diagnose", "m 1.csv", "--json")
    assert said.status == 0, said.err
    reading = said.json["reading"]
    assert (reading["rows"], reading["shifts"], reading["with_time"]) == (4, 4, 4)
    assert set(reading) == {"rows", "shifts", "with_time", "columns", "left_out", "assumed",
                            "warnings"}  # fmt: skip
    assert said.json["bench"] == "m_1"
    # Before the long work: the table of readings, then the assumptions.
    assert said.err.index("t_shift [ms]") < said.err.index("assumed: m 1.csv: each row is one")
    assert _files() == ["m 1.csv"]
    text = dogshape("diagnose", "m 1.csv").out
    assert "read: 4 rows, 4 shifts, 4 of them with a time" in text
    assert "assumed: m 1.csv: each row is one shift" in text
    assert ds.diagnose("mq200_adams").to_dict()["reading"] is None


@pytest.mark.parametrize("asks", [False, True])
def test_a_table_is_read_once(dogshape: Call, monkeypatch: pytest.MonkeyPatch, asks: bool) -> None:
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: asks)
    read = Mock(wraps=read_foreign)
    monkeypatch.setattr("dogshape.bench.bench_draft.read_foreign", read)
    Path("m.csv").write_text(TABLE)
    assert dogshape("diagnose", "m.csv").status == 0
    assert read.call_count == 1


def test_tables_that_are_read_may_be_diagnosed_twice() -> None:
    Path("m.csv").write_text(TABLE)
    tables = read_tables(ds.BenchDraft("m.csv"))
    first, second = (ds.diagnose(tables).to_dict()["reading"] for _ in range(2))
    assert first == second == ds.diagnose("m.csv").to_dict()["reading"]


def test_a_written_diagnosis_of_a_table_takes_new_readings(dogshape: Call) -> None:
    """The data set is copied with its traces, so that the update needs no other folder."""
    time = [k * 1e-3 for k in range(200)]
    trace = pd.DataFrame({
        "t_s": time, "displacement_mm": [min(4.7, 0.05 * k) for k in range(200)],
        "force_N": [min(469.0, 5.0 * k) for k in range(200)],
        "sliding_speed_rpm": [0.0] * 200, "output_speed_rpm": [50.0] * 200,
    })  # fmt: skip
    trace.to_csv("shift.csv", index=False)
    Path("m.csv").write_text(
        "mismatch_rpm;force_N;force_rise_s;shift_time_s;trace\n50;469;0.1766;0.116;shift.csv\n"
        "100;469;0.1766;0.084;\n"
    )
    said = dogshape("diagnose", "m.csv", "--out", "out", "--correct", "trace_force=given")
    if said.status:
        Path("m.csv").write_text(Path("m.csv").read_text().replace("shift.csv", ""))
        said = dogshape("diagnose", "m.csv", "--out", "out")
    assert said.status == 0, said.err
    data = Path("out/data")
    assert (data / "bench.toml").is_file()
    Path("new.csv").write_text(
        "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s,engaged,trace\n"
        "149,469,0.1766,1,0.09,true,\n"
    )
    update = dogshape("update-diagnosis", "out", "new.csv", "--json")
    assert update.status == 0, update.err
    assert update.json["shifts"] == 1
    assert (data / "shifts.csv").read_text().count("\n") == 4
    assert not list(Path("tmp").iterdir())


def test_a_fault_is_asked_about_once_and_a_clean_table_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    Path("m.csv").write_text(QUESTION)
    done = CliRunner().invoke(app, ["gap", "m.csv"], input="drop Remark=x\n")
    assert done.exit_code == 0, done.stderr
    assert "'Remark' has a sign in few rows" in done.stderr
    assert done.stderr.count("say one, as") == 1
    assert "read: 3 rows" in done.stdout
    assert "left out: row 3: --drop Remark=x" in done.stdout
    Path("m.csv").write_text(TABLE)
    done = CliRunner().invoke(app, ["gap", "m.csv"], input="")
    assert done.exit_code == 0, done.stderr
    assert "say one" not in done.stderr
    assert "is that right" not in done.stderr


@pytest.mark.parametrize("answer", ["sheet Data", "m.xlsx#Data", "--sheet 'Data'"])
def test_the_sheet_of_a_workbook_is_one_question(
    answer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    book = Workbook()
    for title, factor in (("Data", 1), ("old", 3)):
        sheet = book.create_sheet(title)
        for line in TABLE.splitlines():
            cells = line.split(";")
            sheet.append([float(c) * factor if c.isdecimal() else c for c in cells])
    del book["Sheet"]
    book.save("m.xlsx")
    done = CliRunner().invoke(app, ["gap", "m.xlsx", "--json"], input=f"{answer}\n")
    assert done.exit_code == 0, done.stderr
    assert done.stderr.count("say one, as") == 1
    record = done.stdout[done.stdout.index("{") :]  # behind the answer that the runner echoes
    reading = json.loads(record)["reading"]
    times = next(c for c in reading["columns"] if c["quantity"] == "shift_time_s")
    assert (times["least"], times["largest"]) == (0.071, 0.131)
    assert ds.diagnose("m.xlsx#old").to_dict()["reading"]["shifts"] == 4


def test_without_a_terminal_the_refusal_has_the_option(dogshape: Call) -> None:
    Path("m.csv").write_text(QUESTION)
    refused = dogshape("diagnose", "m.csv", "--out", "out")
    assert "m.csv: 'Remark' has a sign in few rows (row 3: 'x')" in refused.sentence
    assert "--drop 'Remark=*'" in refused.sentence
    assert _files() == ["m.csv"]
    said = dogshape("diagnose", "m.csv", "--json", "--drop", "Remark=*", "--set", "timeout_s=2",
                    "--from", "mq200_adams", "--rise-s", "0.1")  # fmt: skip
    assert said.json["reading"]["shifts"] == 3
    assert "no m2.csv" in dogshape("diagnose", "m2.csv").sentence


@pytest.mark.parametrize(
    "option", [("--set", "timeout_s=2"), ("--drop", "a=b"), ("--from", "mq200_adams"),
               ("--fill-down",), ("--quotes", "none"), ("--rise-s", "0.1")]
)  # fmt: skip
def test_a_folder_takes_no_option_of_reading(dogshape: Call, option: tuple[str, ...]) -> None:
    sentence = dogshape("diagnose", "mq200_adams", *option).sentence
    assert f"{option[0]} says how a table is read, but mq200_adams is no table" in sentence


def test_messages_name_the_rows_of_the_table(dogshape: Call) -> None:
    """Faults of the folder are those of the user's table, with the option of this verb."""
    text = "mismatch_rpm,force_N,shift_time_s\n50,469,116\n100,469,84\n100,642,71\n"
    Path("m.csv").write_text(text)
    said = dogshape("diagnose", "m.csv")
    sentence = said.err.splitlines()[-1]  # below the table of readings
    assert (said.status, sentence.startswith("dogshape: m.csv: ")) == (2, True)
    assert "--correct time=ms" in sentence
    assert "tmp" not in sentence
    assert dogshape("diagnose", "m.csv", "--correct", "time=ms").status == 0
    with pytest.raises(DataError, match=r'correct=\["time=ms"\]'):
        ds.diagnose("m.csv")
    draft = ds.BenchDraft("m.csv", values={"corrections": ["time=ms"]})
    assert ds.diagnose(draft).inference.bench.corrections == ("time=ms",)
    Path("low.csv").write_text(TABLE.replace(";84", ";4"))
    with pytest.raises(DataError, match=r"low\.csv, row 4") as refused:
        ds.diagnose("low.csv")
    assert "shifts.csv" not in str(refused.value)
    with pytest.raises(InputError, match="no table to diagnose"):
        ds.diagnose(ds.BenchDraft())
    with pytest.raises(ds.DogshapeError, match=r"m\.csv") as refused:
        ds.diagnose(ds.BenchDraft("m.csv", values={"corrections": ["time=ms"], "margin_ms": -1.0}))
    assert "bench.toml" not in str(refused.value)


@pytest.mark.parametrize(
    ("head", "cell", "option", "python"),
    [
        (
            "Schaltzeit [ms]",
            "116",
            "--column shift_time_s='t_shift [ms]'",
            'columns={"shift_time_s": "t_shift [ms]"}',
        ),
        ("Remark", "x", "--drop 'Remark=*'", 'drop=["Remark=*"]'),
        ("Remark", "x", "--keep 'Remark=*'", 'keep=["Remark=*"]'),
        ("Remark", "x", "--rows 2,4-5 names", 'rows="2,4-5" names'),
        ("n", "1,200", "--decimal ,", 'decimal=","'),
    ],
)
def test_questions_name_arguments_of_a_draft(
    dogshape: Call, head: str, cell: str, option: str, python: str
) -> None:
    """A question names an option on the command line, and in Python the argument."""
    lines = TABLE.splitlines()
    cells = (head, "", cell, "", "") if head == "Remark" else (head, *[cell] * 4)
    text = "\n".join(f"{line};{added}" for line, added in zip(lines, cells, strict=True))
    Path("m.csv").write_text(text)
    said = dogshape("init", "bench", "m.csv", "--out", "b")
    assert (said.status, option in said.err) == (2, True), said.err
    with pytest.raises((DataError, InputError)) as refused:
        ds.diagnose("m.csv")
    assert python in str(refused.value)
    assert "--" not in str(refused.value)


def test_a_limit_of_python_is_raised_as_its_message_says() -> None:
    Path("m.csv").write_text(TABLE)
    draft = ds.BenchDraft("m.csv", limits=ds.TableLimits(rows=2))
    with pytest.raises(DataError, match=r"limits=ds\.TableLimits\(rows=5\)"):
        ds.write_bench("b", draft)
    written = ds.write_bench("b", ds.BenchDraft("m.csv", limits=ds.TableLimits(rows=5)))
    assert written.reading.rows == 4


def test_a_draft_of_python_is_written_as_by_the_command_line(dogshape: Call) -> None:
    Path("m.csv").write_text(TABLE)
    draft = ds.BenchDraft([Path("m.csv")], values={"record.sense": "known"})
    written = ds.write_bench("a", draft)
    assert dogshape("init", "bench", "m.csv", "--out", "b", "--set",
                    "record.sense=known").status == 0  # fmt: skip
    assert (written.folder, written.reading.shifts) == (Path("a"), 4)
    for name in ("shifts.csv", "as_measured/m.csv"):
        assert Path("a", name).read_text() == Path("b", name).read_text()
    assert ds.diagnose("a").to_dict()["reading"] is None


def test_tables_of_one_file_name_are_refused_though_their_sheets_differ() -> None:
    for folder in ("x", "y"):
        Path(folder).mkdir()
        book = Workbook()
        for title in ("A", "B"):
            sheet = book.create_sheet(title)
            for line in TABLE.splitlines():
                cells = line.split(";")
                sheet.append([float(c) if c.isdecimal() else c for c in cells])
        book.save(f"{folder}/m.xlsx")
    with pytest.raises(InputError, match="have the same file name"):
        ds.write_bench("b", ds.BenchDraft(("x/m.xlsx#A", "y/m.xlsx#B")))
    written = ds.write_bench("b", ds.BenchDraft(("x/m.xlsx#A", "x/m.xlsx#B")))
    assert written.reading.shifts == 8
    assert [path.name for path in Path("b/as_measured").iterdir()] == ["m.xlsx"]
