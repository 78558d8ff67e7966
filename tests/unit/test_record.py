"""One declaration: record, table, frame, schema and reference page of a result follow from it."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import Any

import pytest
from openpyxl import load_workbook
from plotly.offline import get_plotlyjs_version
from rich.console import Console

from benchmarks.figures import key_table
from dogshape.cli.options import emit
from dogshape.pipeline.progress import SILENT, WorkCounter
from dogshape.pipeline.record import Bad, FileRecord, Record, Table, frame_of, tabulate
from dogshape.pipeline.reports.report import Report, plotly_code
from dogshape.pipeline.store.check_records import CheckRow, check_table
from dogshape.sim.clutch_tables import key, validate
from dogshape.sim.errors import InputError
from dogshape.terminal import ProgressBar, _count_text, print_parts


class Point(Record):
    """A point of a made-up result."""

    speed_rpm: float = key("speed", "1/min", head="speed, 1/min")
    time_s: float | None = key("time", "s", head="time, ms", scale=1e3, form=".1f")
    passed: bool = key("whether it passes", head="passed")
    spare: int | None = key("count; absent in earlier versions", "", None)


class StoredPoint(FileRecord, Point):
    """A point in a file."""


class Whole(Record):
    """The whole."""

    points: list[Point] = key("all points")


POINTS = [Point(speed_rpm=-50.0, time_s=0.0123, passed=True),
          Point(speed_rpm=5.0, time_s=None, passed=False, spare=3)]  # fmt: skip


def test_record_and_frame_have_the_keys_that_were_given() -> None:
    assert POINTS[0].to_dict() == {"speed_rpm": -50.0, "time_s": 0.0123, "passed": True}
    assert Whole(points=POINTS).to_dict()["points"][1]["spare"] == 3
    assert frame_of(POINTS)["time_s"].tolist()[0] == 0.0123


def test_a_record_of_a_file_has_the_order_of_the_file() -> None:
    """Also where a value was replaced; a frame has the order of the declaration."""
    values = {"passed": True, "spare": 3, "speed_rpm": 50.0, "time_s": None}
    point = StoredPoint(**values)
    assert list(point.to_dict()) == list(values)
    assert list(point.model_copy(update={"spare": 4}).to_dict().values()) == [True, 4, 50.0, None]
    assert list(StoredPoint.model_validate(values).to_dict()) == list(values)
    assert list(frame_of([point])) == list(Point.model_fields)


def test_console_and_page_print_the_cells_that_are_declared(tmp_path: Path) -> None:
    table, stream = tabulate(Point, POINTS), io.StringIO()
    assert list(table.heads) == ["speed, 1/min", "time, ms", "passed"]
    assert table.rows == [["\N{MINUS SIGN}50", "12.3", "yes"], ["5", "-", "no"]]
    assert tabulate(Point, POINTS, "time_s").rows == [["12.3"], ["-"]]
    print_parts(Console(file=stream, width=100), [table])
    Report("points").add("", table).save(tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    for words in (*table.heads, *table.rows[0]):
        assert words in stream.getvalue()
        assert words in page


def test_the_declaration_is_schema_and_reference_page() -> None:
    given: dict[str, Any] = {"points": [{"speed_rpm": 1.0, "time_s": None, "passed": True}]}
    assert validate(Whole, given, "it").to_dict() == given
    with pytest.raises(InputError, match=r"'points\.0\.sped_rpm' is not a known key"):
        validate(Whole, {"points": [{"sped_rpm": 1.0, "time_s": None, "passed": True}]}, "it")
    page = key_table(Whole, "made.json")
    for words in ("`made.json`: The whole.", "`points[]`: A point of a made-up result."):
        assert words in page
    assert page.count("| `time_s` | s | time |") == 1


def test_checks_stand_in_groups_and_failed_ones_are_marked() -> None:
    shared: dict[str, Any] = {
        "value": 1.0, "limit": 2.0, "unit": "mm", "at_most": True, "meaning": "", "formula": "",
        "source": "", "limit_key": "",
    }  # fmt: skip
    rows = [
        CheckRow(name="b", group="load", margin=-0.5, passed=False, **shared),
        CheckRow(name="a", group="make", margin=0.5, passed=True, **shared),
    ]
    table = check_table(rows, "name", "limit", "margin", "passed")
    assert [row[0] for row in table.rows] == ["manufacture", "a", "strength", "b"]
    assert set(table.looks.values()) == {"group"}
    assert table.rows[1][1:] == ["\N{LESS-THAN OR EQUAL TO} 2", "50 %", "yes"]
    assert [isinstance(cell, Bad) for cell in table.rows[3]] == [False, False, True, True]


def test_checks_cite_their_sources_in_the_last_column() -> None:
    shared: dict[str, Any] = {
        "value": 1.0, "limit": 2.0, "unit": "MPa", "margin": 0.5, "passed": True, "group": "load",
        "at_most": True, "meaning": "", "formula": "", "limit_key": "",
    }  # fmt: skip
    rows = [
        CheckRow(name="a", source="Heywood 1948; limit: ISO 6336-3", **shared),
        CheckRow(name="shear_stress", source="", **shared),
        CheckRow(name="b", source="", **shared),
    ]
    table = check_table(rows)
    assert table.heads[-1] == "follows"
    assert len(table.heads) - 1 in table.words
    assert [row[-1] for row in table.rows[1:]] == ["Heywood 1948, ISO 6336-3", "beam theory", "-"]


def test_a_report_is_built_of_sections(tmp_path: Path) -> None:
    page = Report("rig <b>7</b>", "Found & named")
    page.add("", Table(("", ""), [("fact", Bad("wrong"))]))
    page.add("Front <i>", Table(("a", "b"), [("1 ± 2 ms, S 3", "2\n3")], {0: "best"}), "a caption")
    page.add("Nothing", None, "a caption of nothing")
    page.save(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    for words in (
        "rig &lt;b&gt;7&lt;/b&gt;", "Found &amp; named", '<section id="front-i">', "2<br>3",
        '<a href="#front-i">', '<tr class="best">', '<p class="note">a caption</p>', "bad", "\xa02",
    ):  # fmt: skip
        assert words in text
    assert "caption of nothing" not in text
    assert "packed" not in text.partition("<script>")[0]
    assert text.index("wrong") < text.index("<nav>") < text.index("a caption")


def test_a_page_has_its_tables_as_a_workbook(tmp_path: Path) -> None:
    page = Report("rig: 7")
    facts = Table(("", ""), [("fact", "1")])
    margins = Table(("check", "margin"), [("a", "\N{MINUS SIGN}2.5"), ("=1+1", "50 %"), ("group",)])
    page.add("Margins [1]", margins, facts).add("Margins [1]", margins)
    page.save(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    found = re.search(r'download="rig 7.xlsx" href="data:[^,]*;base64,([^"]*)"', text)
    assert found
    workbook = load_workbook(io.BytesIO(base64.b64decode(found[1])))
    assert workbook.sheetnames == ["Margins  1", "Margins  1 2"]
    rows = [*workbook.worksheets[0].values]
    assert rows == [("check", "margin"), ("a", -2.5), ("'=1+1", "50 %"), ("group", None)]
    assert text.count('class="copy"') == 2


def test_the_pages_have_the_version_of_plotly_that_draws_their_figures() -> None:
    assert f"plotly.js (cartesian - minified) v{get_plotlyjs_version()}\n" in plotly_code()[:200]


@pytest.mark.parametrize("name", ["stand [v2] :smile:", "a[red]b", "[/red] x"])
def test_names_are_printed_as_they_are(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(("case", f"head {name}"), [(f"cell {name}", "1")])
    emit({}, False, lambda: [table, f"report: {name}/report.html", f"wrote {name}"])
    ProgressBar().say(f"kept in {name}")
    with WorkCounter(ProgressBar(), 1) as progress:
        progress.say(f"finished shifts are in {name}")
    out, err = capsys.readouterr()
    for words in (f"head {name}", f"cell {name}", f"report: {name}/report.html", f"wrote {name}"):
        assert words in out
    assert f"kept in {name}" in err
    assert f"finished shifts are in {name}" in err


@pytest.mark.parametrize(
    ("done", "elapsed", "words"),
    [(50, 1.0, "50 of 100 shifts"), (50, 10.0, "50 of 100 shifts, less than 1 min left"),
     (10, 20.0, "10 of 100 shifts, 3 min left")],
)  # fmt: skip
def test_progress_never_says_0_min_left(done: int, elapsed: float, words: str) -> None:
    counter = WorkCounter(SILENT, 100)
    counter.advance(done)
    assert _count_text(counter, elapsed) == words
