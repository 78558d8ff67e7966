"""The pages in a real browser: they draw, say no error and fit the window."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dogshape.designs import write_data_sheet
from dogshape.pipeline.drafts.study_folder import write_study
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.named_design import named_design
from dogshape.pipeline.reports.report import Report
from dogshape.pipeline.reports.shift_page import write_animation
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG, MM, MS
from tests.browser import WITH_WEBGL, WITHOUT_WEBGL, Chromium
from tests.integration.studies import Finished

#: What the page of a shift shows.
SEEN = """(() => {
  const solid = document.getElementById("solid"), pictures = [document.getElementById("section")];
  if (solid.viewer) { solid.viewer.render(); pictures.push(solid.viewer.renderer.domElement); }
  const hash = text => [...text].reduce((h, c) => (31 * h + c.charCodeAt()) | 0, 0);
  const axis = document.getElementById("curves")._fullLayout.xaxis;
  return {now: document.getElementById("now").textContent, pose: solid.dataset.pose,
          shot: pictures.map(picture => hash(picture.toDataURL())), range: axis.range,
          left: axis.p2l(parseFloat(document.getElementById("cursor").style.left) - axis._offset)};
})()"""
MIDDLE = "scrub.value = 0.5 * scrub.max; scrub.dispatchEvent(new Event('input'))"


def test_report_in_a_browser_and_on_paper(reported: Finished, tmp_path: Path) -> None:
    result, folder = reported.result, reported.folder
    with Chromium(tmp_path) as browser:
        browser.look_at_report(folder / "report.html")
        text = browser.ask("document.body.textContent")
        csv = browser.ask("document.querySelector('a[href$=\".csv\"]').getAttribute('href')")
        links = browser.ask(
            "[...document.querySelectorAll('a[href^=shifts]')].map(a => a.getAttribute('href'))"
        )
        printed = browser.print_pdf()
    for part in ("own dog", "tip width", "versions", "by angle", "% within", "worst point minus"):
        assert part in text
    assert 4 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 10
    boxes = set(re.findall(rb"/MediaBox\s*\[([^\]]*)\]", printed))
    assert {tuple(round(float(side)) for side in box.split()) for box in boxes} == {
        (0, 0, 595, 842)
    }
    # All designs, and pages of shifts that are there.
    table = pd.read_csv(folder / csv)
    simulated = [row for row in result["trials"] if row["expected_shift_time_s"] is not None]
    for name in ("trial", "chamfer_deg", "expected_shift_time_s", "smallest_margin"):
        assert table[name].tolist() == pytest.approx([row[name] for row in simulated])
    assert len(links) == 2 * len({0} | {row["trial"] for row in result["front"]})
    assert all((folder / link).stat().st_size < 1_500_000 for link in links)
    with Chromium(tmp_path, "1400,900", WITH_WEBGL) as browser:
        seen = browser.look(folder / links[-1])
        assert (seen["faults"], seen["loads"], seen["high"]) == ([], 0, False)
        assert browser.ask("document.getElementById('solid').dataset.state") == "drawn"


def test_a_table_that_is_cut_says_that_it_scrolls(tmp_path: Path) -> None:
    names = [f"design{k}" for k in range(30)]
    narrow = Table(("name", "time"), [["own dog", "95 ms"]])
    page = Report("tables").add("Wide", Table(["", *names], [["time", *names]])).add("Few", narrow)
    page.save(tmp_path / "page.html")
    with Chromium(tmp_path / "profile") as browser:
        browser.look(tmp_path / "page.html")
        frames = "[...document.querySelectorAll('.scroll')]"
        hint = "getComputedStyle(frame, '::before').content"
        hints = browser.ask(f"{frames}.map(frame => {hint})")
    assert [words.startswith('"scroll right') for words in hints] == [True, False]


#: A solenoid, a wide ring that tips and torque for several failures.
SOLENOID = (
    "actuation={kind='solenoid', start_force_N=60, end_force_N=180, stroke_mm=6, voltage_V=12, "
    "resistance_ohm=2.1, inductance_mH=9, return_preload_N=25}",
    "operating={mismatch_rpm=[-25, 10, 25], force_N=[100]}",
    "dog.count=60", "dog.height_mm=2", "dog.outer_diameter_mm=110", "dog.inner_diameter_mm=94",
    "dog.backlash_mm=0.4", "dog.axial_gap_mm=0.6", "load.torque_Nm=4500", "dog.chamfer_deg=2",
)  # fmt: skip
#: Number of columns that the table of margins has parts in.
MARGIN_COLUMNS = "document.getElementById('margins-to-the-limits').getClientRects().length"


@pytest.mark.parametrize(
    ("name", "settings"),
    [("mq200_paper", ()), ("mq200", ()), ("ev_disconnect", SOLENOID), ("own", ())],
    ids=["mq200_paper", "mq200", "solenoid", "assumed values"],
)
def test_a_data_sheet_prints_on_one_page(
    tmp_path: Path, name: str, settings: tuple[str, ...]
) -> None:
    why = "a reason that goes on for more than one line: " + 30 * "why, "
    if name == "own":
        name = str(tmp_path / name)
        write_study(Path(name), "ev_disconnect", {"actuation.kind": "motor", "dog.count": 20})
    design = named_design(name, settings, chosen=False)
    page = write_data_sheet(design, tmp_path / "sheet.html", {"why": why})
    with Chromium(tmp_path / "profile") as browser:
        browser.look(page)
        assert browser.ask(MARGIN_COLUMNS) == 1
        words = browser.ask("document.body.textContent")
        assert re.findall(rb"/Count (\d+)", browser.print_pdf()) == [b"1"]
    assert "\N{MICRO SIGN}m" in words
    for note in notes_of(design.design_study):
        assert note in words.replace("\N{NO-BREAK SPACE}", " ")
    assert ("the root formula was fitted to" in words) == bool(settings)


@pytest.mark.parametrize(
    "asked",
    [
        pytest.param((50.0, 469.0, 10.0, 8.0, True), id="engaged"),
        pytest.param((-50.0, 315.5, 8.0, 8.0, False), id="negative mismatch, no WebGL"),
        pytest.param((0.0, 641.5, 0.0, 4.5, True), id="blocked"),
    ],
)
def test_shift_in_a_browser(
    clutch: Clutch, point: Callable[[float, float], OperatingPoint], tmp_path: Path,
    asked: tuple[float, float, float, float, bool],
) -> None:  # fmt: skip
    """Slider, phase and playing each move the cursor, the views and the numbers shown."""
    page, (mismatch, force, angle, chamfer, webgl) = tmp_path / "shift.html", asked
    plant = ClutchPlant(replace(clutch, dog=replace(clutch.dog, chamfer=chamfer * DEG)))
    result = engage(plant, point(mismatch, force), angle * DEG)
    write_animation(result, page)
    # What a screen of 1400 by 900 shows below the browser's own bars: all of the page.
    with Chromium(tmp_path, "1400,900", WITH_WEBGL if webgl else WITHOUT_WEBGL) as browser:
        seen = browser.look(page)
        assert (seen["faults"], seen["cut"], seen["loads"]) == ([], [], 0)
        assert (seen["wide"], seen["high"]) == (False, False)
        # However high the window, the ring is wider than its view is high by less than a third.
        assert (
            browser.ask("parseFloat(getComputedStyle(solid.parentNode.parentNode).maxHeight)") < 450
        )
        assert seen["figures"] == seen["drawn"] == ["curves"]
        start = browser.ask(SEEN)
        middle = browser.ask(f"{MIDDLE}; {SEEN}")
        browser.ask("document.querySelectorAll('.phase')[1].click()")
        phase = browser.ask(SEEN)
        browser.ask("play.click()")
        browser.wait(f"{SEEN}.left > {phase['left']}")
    end, trace = result.trace.time[-1], result.trace
    for step, share in ((start, 0.0), (middle, 0.5)):
        assert step["left"] == pytest.approx(1e3 * share * end, abs=0.2)
        if webgl:
            turned, height = (float(value) for value in step["pose"].split())
            at = np.interp(share * end, trace.time, trace.relative_angle)
            way = np.interp(share * end, trace.time, trace.displacement)
            assert turned == pytest.approx(-at, abs=1e-3)
            assert height == pytest.approx((result.clutch.dog.travel - way) / MM, abs=1e-2)
    # The section and, where there is one, the view of the solids.
    assert len(start["shot"]) == 1 + webgl
    assert all(a != b for a, b in zip(start["shot"], middle["shot"], strict=True))
    assert middle["now"].startswith(f"{500 * end:.2f} ms")
    # The second phase that took any time now fills the width, and holds the cursor.
    shown = [p for p in result.phases if p.end > p.start][1]
    assert phase["range"] == pytest.approx([shown.start / MS, shown.end / MS])
    assert shown.name in phase["now"]
