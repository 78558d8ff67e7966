"""Report of a diagnosis: page, record and table, and its figures in a browser."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import unquote

import pandas as pd
import pytest

from dogshape.diagnosis.bench.bench_data import Reading, gather
from dogshape.diagnosis.terms import NONE
from dogshape.pipeline.reports.gap_page import (
    cells_figure,
    cells_of,
    publish,
)
from dogshape.sim.units import RPM
from tests.browser import PROBE, REPORT_PROBE, look, print_pdf
from tests.diagnosed import EFFECTS, POSTERIOR, STAND, diagnosis_of, reading

MINUS = "\N{MINUS SIGN}"
PARTS = [
    "hypotheses", "next-test", "residuals", "design-choice", "data-and-settings",
]  # fmt: skip
FIGURES = ["residuals-1"]


def _changed(one: Reading) -> Reading:
    """Return a reading of the stand, with two points whose shifts failed or engaged in part."""
    place = round(one.point.mismatch / RPM), one.point.profile.force
    return replace(one, time=None, engaged=False) if place == (249, 235.2) else one


@pytest.fixture(scope="module")
def full() -> Any:
    """A diagnosis of a set in which some shifts did not engage."""
    readings = [_changed(one) for one in STAND.readings]
    partly = next(r for r in readings if round(r.point.mismatch / RPM) == 100)
    readings.append(replace(partly, row=999, n=1, time=None, engaged=False))
    bench = replace(STAND, name="rig <b>7</b>", source="made & measured", cells=gather(readings))
    readings_of = (reading("time_zero", "force", 0.3, ("drag_torque",)),)
    return diagnosis_of(POSTERIOR, bench, readings=readings_of)


def _extras() -> tuple[Any, ...]:
    """Make a consequence that costs 0.9 ms, and history."""

    def side(chamfer: float, without: float, within: float) -> Any:
        times = (SimpleNamespace(mean=time) for time in (without, within))
        params = {"chamfer_deg": chamfer, "height_mm": 3.2}
        without_times, with_times = times
        return SimpleNamespace(params=params, without=without_times, with_effect=with_times)

    choice: Any = SimpleNamespace(
        chosen=side(8.1, 0.1034, 0.1821), best=side(8.4, 0.1041, 0.1812), regret=0.0009,
        sentence="The best design hardly moves.",
    )  # fmt: skip
    return choice, {"update 1": "from <here>"}


@pytest.fixture(scope="module")
def page(full: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its report with everything."""
    return publish(full, tmp_path_factory.mktemp("gap"), *_extras())


def _ids(text: str) -> list[str]:
    return re.findall(r'<section id="([^"]+)"', text)


def test_every_part_is_there_in_its_order(page: Path) -> None:
    text = page.read_text()
    assert _ids(text) == PARTS
    figures = re.findall(r'<div id="([^"]+)" class="plotly-graph-div"', text)
    assert figures == FIGURES
    assert set(re.findall(r'href="#([^"]+)"', text)) == set(PARTS)
    for words in (
        "Part of the cause: dead time of the actuation", "The best design hardly moves.", "0.9 ms",
        "height h, mm", "run-down of the sliding ring", "times start with the force",
        "best rival, dead time of the actuation, drag torque on the sliding ring and oil damping",
        "chance alone", "4 of them without a time",
    ):  # fmt: skip
        assert words in text, words
    body = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert "shrink" not in body.partition('<a href="data:')[0]


def test_strings_are_escaped_and_nothing_is_loaded(full: Any, tmp_path: Path) -> None:
    delay = replace(EFFECTS["actuation_delay"], title="late</script><script>alert(1)</script>")
    effects = {**full.effects, "actuation_delay": delay}
    found = diagnosis_of(POSTERIOR, full.bench, effects=effects)
    text = publish(found, tmp_path, *_extras()).read_text()
    assert "rig &lt;b&gt;7&lt;/b&gt;" in text
    assert "made &amp; measured" in text
    assert "from &lt;here&gt;" in text
    assert "<script>alert(1)" not in text
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="?(http|//)', text)


def test_record_and_table_lie_beside_the_report_and_within(full: Any, page: Path) -> None:
    text = page.read_text()
    found = re.findall(r'<a href="(data:[^"]+)" download="\w+\.(json|csv)"', text)
    links = {kind: address for address, kind in found}
    record = json.loads((page.parent / "gap.json").read_text())
    assert record == json.loads(json.dumps(full.to_dict()))
    assert json.loads(unquote(links["json"].partition(",")[2])) == record
    table = pd.read_csv(page.parent / "cells.csv")
    assert pd.read_csv(io.StringIO(unquote(links["csv"].partition(",")[2]))).equals(table)
    assert len(table) == 28
    assert (table["bench_s"] - table["simulated_s"] - table["gap_s"]).abs().max() < 1e-12
    # The prediction is that of the fit to all other points.
    assert table["predicted_s"].tolist() == pytest.approx(full.held_out.mean.tolist())
    known = table["bench_error_s"].notna()
    assert known.tolist() == [cell.n > 0 for cell in full.bench.cells]


def test_bench_and_both_simulations_have_their_times(full: Any) -> None:
    sides = {trace.name: trace for trace in cells_figure(cells_of(full)).data}
    assert list(sides) == ["without effects", "leading hypothesis, point held out", "bench"]
    held_out = 1e3 * full.held_out.mean
    assert list(sides["leading hypothesis, point held out"].x) == pytest.approx(list(held_out))
    assert len(sides["bench"].x) == sum(cell.n > 0 for cell in full.bench.cells)
    alone = cells_figure(cells_of(diagnosis_of({NONE: 1.0}))).data
    assert [trace.name for trace in alone] == ["without effects", "bench"]


def test_report_in_a_browser(page: Path, tmp_path: Path) -> None:
    seen = look(page, tmp_path, PROBE + REPORT_PROBE, window="1280,900")
    assert "error" not in seen
    assert seen["ids"].split() == FIGURES
    assert seen["figures"] == seen["drawn"]
    assert (seen["wide"], seen["loads"]) == ("false", "0")
    assert json.loads(seen["cut"]) == json.loads(seen["paper"]) == []
    # A4 less its margins of 12 mm is 703 px wide.
    assert {float(one) for one in seen["widths"].split()} == {700.0}


def test_report_prints_on_a_few_pages(page: Path, tmp_path: Path) -> None:
    printed = print_pdf(page, tmp_path)
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 5
