"""Report of a diagnosis: page, record and table, and its figures in a browser."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

from dogshape.diagnosis.bench.bench_data import gather
from dogshape.pipeline.reports.gap_page import publish
from dogshape.sim.units import RPM
from tests.browser import Chromium
from tests.diagnosed import POSTERIOR, STAND, diagnosis_of, reading


@pytest.fixture(scope="module")
def full() -> Any:
    """A diagnosis of a set in which some shifts did not engage."""
    readings = [
        replace(one, time=None, engaged=False)
        if (round(one.point.mismatch / RPM), one.point.profile.force) == (249, 235.2) else one
        for one in STAND.readings
    ]  # fmt: skip
    bench = replace(STAND, name="rig <b>7</b>", source="made & measured", cells=gather(readings))
    readings_of = (reading("time_zero", "force", 0.3, ("drag_torque",)),)
    return diagnosis_of(POSTERIOR, bench, readings=readings_of)


@pytest.fixture(scope="module")
def page(full: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its report with history and a consequence that costs 0.9 ms."""
    time = SimpleNamespace(mean=0.1034)
    side = SimpleNamespace(params={"height_mm": 3.2}, without=time, with_effect=time)
    choice: Any = SimpleNamespace(
        chosen=side, best=side, regret=0.0009, sentence="The best design hardly moves."
    )
    folder = tmp_path_factory.mktemp("gap")
    return publish(full, folder, choice, {"update 1": "from <here>"})


def test_every_part_is_there_in_its_order(page: Path) -> None:
    text = page.read_text()
    parts = re.findall(r'<section id="([^"]+)"', text)
    assert " ".join(parts) == ("hypotheses next-test residuals design-choice data-and-settings")
    assert re.findall(r'href="#([^"]+)"', text) == parts
    for words in ("rig &lt;b&gt;7&lt;/b&gt;", "made &amp; measured", "from &lt;here&gt;"):
        assert words in text, words
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="?(http|//)', text)


def test_record_and_table_lie_beside_the_report(full: Any, page: Path) -> None:
    record = json.loads((page.parent / "gap.json").read_text())
    assert record == json.loads(json.dumps(full.to_dict()))
    table = pd.read_csv(page.parent / "cells.csv")
    assert len(table) == 28
    assert (table["bench_s"] - table["simulated_s"] - table["gap_s"]).abs().max() < 1e-12
    # The prediction is that of the fit to all other points.
    assert table["predicted_s"].tolist() == pytest.approx(full.held_out.mean.tolist())
    known = table["bench_error_s"].notna()
    assert known.tolist() == [cell.n > 0 for cell in full.bench.cells]


def test_report_in_a_browser_and_on_paper(page: Path, tmp_path: Path) -> None:
    with Chromium(tmp_path) as browser:
        browser.look_at_report(page)
        assert 2 <= len(re.findall(rb"/Type\s*/Page\b", browser.print_pdf())) <= 5
