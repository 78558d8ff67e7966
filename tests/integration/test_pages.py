"""The pages in a real browser: they draw, say no error and fit the window."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.reports.shift_page import write_animation
from dogshape.pipeline.reports.study_page import write_report
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, MS
from tests.browser import PROBE, REPORT_PROBE, WITH_WEBGL, WITHOUT_WEBGL, look, print_pdf
from tests.conftest import SMALL

#: Put into the page of a shift: what slider, choice of a phase and playing change.
SHIFT_PROBE = """
<script>
function seen() {
  const solid = document.getElementById("solid"), pictures = [document.getElementById("section")];
  if (Solid.viewer) { Solid.viewer.render(); pictures.push(Solid.viewer.renderer.domElement); }
  const hash = text => [...text].reduce((h, c) => (31 * h + c.charCodeAt()) | 0, 0);
  const axis = document.getElementById("curves")._fullLayout.xaxis;
  return {now: document.getElementById("now").textContent, pose: solid.dataset.pose,
          shot: pictures.map(picture => hash(picture.toDataURL())),
          left: axis.p2l(parseFloat(document.getElementById("cursor").style.left) - axis._offset)};
}
function probe(said) {
  const scrub = document.getElementById("scrub");
  said.state = document.getElementById("solid").dataset.state;
  const steps = [seen()];
  scrub.value = 0.5 * scrub.max; scrub.dispatchEvent(new Event("input")); steps.push(seen());
  document.querySelectorAll(".phase")[1].click(); steps.push(seen());
  said.range = JSON.stringify(document.getElementById("curves").layout.xaxis.range);
  said.steps = JSON.stringify(steps);
  // Without a screen there are no pictures to wait for: let a timer ask for them.
  let at = 0;
  window.requestAnimationFrame = draw => setTimeout(() => draw(at += 16), 16);
  document.getElementById("play").click();
  setTimeout(() => said.played = JSON.stringify(seen()), 1000);
}
</script>
"""


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a small study by a sampler that also proposes infeasible designs."""
    folder = tmp_path_factory.mktemp("report")
    study = load_study("mq200_paper", [*SMALL, "search.sampler=tpe"])
    run_study(study, Run(StudyFolder(folder), jobs=1))
    return folder


@pytest.fixture(scope="module")
def seen_wide(reported: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What a wide window shows of the report."""
    folder = tmp_path_factory.mktemp("wide")
    return look(reported / "report.html", folder, PROBE + REPORT_PROBE, window="1280,900")


def test_report_in_a_browser(seen_wide: dict[str, str]) -> None:
    seen = seen_wide
    assert "error" not in seen
    assert seen["figures"] == seen["drawn"]
    assert seen["ids"].split() == ["front-0", "operating-points-0"]
    assert seen["wide"] == "false"
    assert seen["loads"] == "0"
    assert json.loads(seen["cut"]) == json.loads(seen["paper"]) == []
    # A4 less its margins of 12 mm is 703 px wide.
    assert {float(one) for one in seen["widths"].split()} == {700.0}
    for words in ("were not simulated", "prototype", "tip width", "versions"):
        assert words in seen["dom"]


def test_report_brings_its_designs_as_a_table(reported: Path, seen_wide: dict[str, str]) -> None:
    kind, _, data = seen_wide["csv"].partition(",")
    assert kind.startswith("data:text/csv")
    table = pd.read_csv(io.StringIO(unquote(data)))
    trials = json.loads((reported / "result.json").read_text())["trials"]
    simulated = [row for row in trials if row["expected_shift_time_s"] is not None]
    assert table["trial"].tolist() == [row["trial"] for row in simulated]
    for name in ("chamfer_deg", "expected_shift_time_s", "axial_length_mm", "smallest_margin"):
        assert table[name].tolist() == pytest.approx([row[name] for row in simulated])
    assert pd.read_csv(reported / "designs.csv").equals(table)


def test_report_links_pages_of_shifts_that_are_there(
    reported: Path, seen_wide: dict[str, str], tmp_path: Path
) -> None:
    links = json.loads(seen_wide["links"])
    result = json.loads((reported / "result.json").read_text())
    assert len(links) == 2 * len({0} | {row["trial"] for row in result["front"]})
    assert all((reported / link).is_file() for link in links)
    assert (reported / links[-1]).stat().st_size < 1_500_000
    # A copy of a page beside its code opens as any other.
    for name in ("plotly.js", "meshcat.js"):
        shutil.copy(reported / "shifts" / name, tmp_path)
    shown = look(reported / links[-1], tmp_path, PROBE + SHIFT_PROBE, WITH_WEBGL, "1400,900")
    assert "error" not in shown
    assert shown["state"] == "drawn"
    assert (shown["loads"], shown["high"]) == ("0", "false")


def test_report_prints_on_a_few_pages(reported: Path, tmp_path: Path) -> None:
    printed = print_pdf(reported / "report.html", tmp_path)
    assert 4 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 10
    boxes = re.findall(rb"/MediaBox\s*\[([^\]]*)\]", printed)
    assert {tuple(round(float(side)) for side in box.split()) for box in boxes} == {
        (0, 0, 595, 842)
    }


def test_report_is_written_again_without_what_it_links(reported: Path, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(reported, folder, ignore=shutil.ignore_patterns("shifts", "effects.json"))
    text = write_report(StudyFolder(folder)).read_text()
    assert 'href="shifts/' not in text
    assert "fastest shift" in text


def test_report_before_the_first_design_passes(tmp_path: Path) -> None:
    study = load_study(
        "mq200_paper", [*SMALL, "search.sampler=random", "search.trials=2",
                  "material.allowable_pressure_MPa=2"]
    )  # fmt: skip
    result = run_study(study, Run(StudyFolder(tmp_path), jobs=1))
    assert result["best"] is None
    page = write_report(StudyFolder(tmp_path)).read_text()
    assert "No design of this search passes every check" in page


@dataclass(frozen=True)
class Asked:
    """A shift in 1/min, N and degrees, and whether the browser has WebGL."""

    mismatch: float
    force: float
    angle: float
    chamfer: float
    webgl: bool


@pytest.mark.parametrize(
    "asked",
    [
        pytest.param(Asked(50.0, 469.0, 10.0, 8.0, True), id="engaged"),
        pytest.param(Asked(-50.0, 315.5, 8.0, 8.0, False), id="negative mismatch, no WebGL"),
        pytest.param(Asked(0.0, 641.5, 0.0, 4.5, True), id="blocked"),
    ],
)
def test_shift_in_a_browser(
    clutch: Clutch,
    point: Callable[[float, float], OperatingPoint],
    tmp_path: Path,
    asked: Asked,
) -> None:
    page = tmp_path / "shift.html"
    plant = ClutchPlant(clutch.with_dog(replace(clutch.dog, chamfer=asked.chamfer * DEG)))
    result = engage(plant, point(asked.mismatch, asked.force), asked.angle * DEG)
    write_animation(result, page)
    graphics = WITH_WEBGL if asked.webgl else WITHOUT_WEBGL
    # What a screen of 1400 by 900 shows below the browser's own bars: all of the page.
    seen = look(page, tmp_path, PROBE + SHIFT_PROBE, graphics, "1400,900")
    assert "error" not in seen
    assert seen["figures"] == seen["drawn"] == "1"
    assert seen["loads"] == "0"
    assert (seen["wide"], seen["high"]) == ("false", "false")
    assert seen["state"] == ("drawn" if asked.webgl else "missing")
    _assert_follows(result, seen)


def _assert_follows(result: Engagement, seen: dict[str, str]) -> None:
    """Slider and phase each move the cursor, the views and the numbers shown."""
    start, middle, phase = json.loads(seen["steps"])
    end, trace = result.trace.time[-1], result.trace
    for step, share in ((start, 0.0), (middle, 0.5)):
        assert step["left"] == pytest.approx(1e3 * share * end, abs=0.2)
        if seen["state"] == "drawn":
            turned, height = (float(value) for value in step["pose"].split())
            at = np.interp(share * end, trace.time, trace.relative_angle)
            way = np.interp(share * end, trace.time, trace.displacement)
            assert turned == pytest.approx(-at, abs=1e-3)
            assert height == pytest.approx((result.clutch.dog.travel - way) / MM, abs=1e-2)
    # The section and, where there is one, the view of the solids.
    assert all(a != b for a, b in zip(start["shot"], middle["shot"], strict=True))
    assert middle["now"].startswith(f"{500 * end:.2f} ms")
    # The second phase that took any time now fills the width, and holds the cursor.
    shown = [p for p in result.phases if p.end > p.start][1]
    assert json.loads(seen["range"]) == pytest.approx([shown.start / MS, shown.end / MS])
    assert shown.name in phase["now"]
    assert json.loads(seen["played"])["left"] > phase["left"]
