"""The pages in a real browser: they draw, say no error and fit the window."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.animation import write_animation
from pipeline.config import Study, load_study
from pipeline.folder import StudyFolder
from pipeline.report import write_report
from pipeline.study import Run, run_study
from sim.clutch import OperatingPoint
from sim.engagement import engage
from sim.plant import ClutchPlant
from sim.units import DEG
from tests.conftest import SMALL, needed

CHROMIUM = shutil.which("chromium")

#: Put into a page: its errors, its overflow and what its figures drew.
PROBE = """
<script>
window.addEventListener("error", e => document.body.dataset.error = e.message);
window.addEventListener("load", () => setTimeout(() => {
  const figures = [...document.querySelectorAll(".js-plotly-plot")];
  document.body.dataset.figures = figures.length;
  document.body.dataset.drawn = figures.filter(f => f.querySelector(".trace")).length;
  document.body.dataset.wide = document.documentElement.scrollWidth > window.innerWidth;
}, 800));
</script>
"""


def _look(page: Path, tmp_path: Path) -> dict[str, str]:
    """Open a page without a network and return what the probe found."""
    needed(CHROMIUM is not None, "chromium")
    assert CHROMIUM is not None
    probed = tmp_path / "probed.html"
    probed.write_text(page.read_text().replace("<body>", f"<body>{PROBE}", 1))
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
        "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--disable-sync", f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1150,900",
        "--virtual-time-budget=6000", "--dump-dom", probed.as_uri(),
    ]  # fmt: skip
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    body = re.search(r"<body([^>]*)>", dom)
    assert body is not None
    found = dict(re.findall(r'data-(\w+)="([^"]*)"', body.group(1)))
    return {key: html.unescape(value) for key, value in found.items()} | {"dom": dom}


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a small study by a sampler that also proposes infeasible designs."""
    folder = tmp_path_factory.mktemp("report")
    study = load_study("mq200", [*SMALL, "search.sampler=tpe"])
    run_study(study, Run(StudyFolder(folder), jobs=2))
    return folder


def test_report_in_a_browser(reported: Path, tmp_path: Path) -> None:
    seen = _look(reported / "report.html", tmp_path)
    assert "error" not in seen
    assert seen["figures"] == seen["drawn"] == "3"
    assert seen["wide"] == "false"
    for words in ("Pareto front", "prototype", "infeasible", "Margins of each check", "versions"):
        assert words in seen["dom"]


def test_report_needs_no_network(reported: Path) -> None:
    page = (reported / "report.html").read_text()
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="?(http|//)', page)


def test_report_before_the_first_design_passes(tmp_path: Path) -> None:
    study = load_study(
        "mq200", [*SMALL, "search.sampler=random", "search.trials=2",
                  "material.allowable_pressure_MPa=2"]
    )  # fmt: skip
    result = run_study(study, Run(StudyFolder(tmp_path), jobs=1))
    assert result["best"] is None
    page = write_report(StudyFolder(tmp_path)).read_text()
    assert "No design of this search passes every check" in page


def test_animation_in_a_browser(
    plant: ClutchPlant,
    point: Callable[[float, float], OperatingPoint],
    small_study: Study,
    tmp_path: Path,
) -> None:
    page = tmp_path / "shift.html"
    write_animation(engage(plant, point(50, 235.2), 6 * DEG), page)
    seen = _look(page, tmp_path)
    assert "error" not in seen
    assert seen["figures"] == seen["drawn"] == "1"
    assert seen["wide"] == "false"
    assert "0.0 ms, 0.00 mm, free fly" in seen["dom"]
