"""The report of a diagnosis: every part where there is something to say, and none else."""

from __future__ import annotations

import html
import io
import itertools
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.reading import Reading, gather
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.parameter_intervals import Interval
from dogshape.diagnosis.inference.verdict import NAMED, decide
from dogshape.diagnosis.report.phase_times import PHASES, PhaseGap
from dogshape.diagnosis.report.wording import between, chance, described, ms
from dogshape.pipeline.diagnose.extras import Extras, Optimum, Remark, SoWhat
from dogshape.pipeline.reports.gap import before_after as before
from dogshape.pipeline.reports.gap import (
    charts,
    influence_figure,
    joint_figure,
    predicted_figure,
    reasons,
)
from dogshape.pipeline.reports.gap import gap_map_figure as gapmap
from dogshape.pipeline.reports.gap import hypothesis_cards as answers
from dogshape.pipeline.reports.gap.gap_page import publish
from dogshape.pipeline.reports.gap.odds_matrix import alike_figure, class_in_words, odds
from dogshape.pipeline.reports.gap.point_rows import cells_of
from dogshape.sim.units import RPM
from tests.browser import PROBE, REPORT_PROBE, look, print_pdf
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of()
#: The toy's lag makes all shifts later by the same, as a delay does; drag changes nothing.
NAMES = ("actuation_delay", "actuation_lag", "drag_torque", "moving_mass")
FEW = ("actuation_delay", "moving_mass", "drag_torque")
PAPER = 0.82  #: height of a figure on paper, as paper.js has it
MINUS = "\N{MINUS SIGN}"
#: Parts that every report has, and those of figures.
ALWAYS = ["causes-part", "readings", "next", "provenance"]
DRAWN = [
    *("map", "causes", "joint", "before", "held_out", "foretold", "influence", "alike", "bounds"),
]

EXTRAS = Extras(
    phases=tuple(
        PhaseGap(name, 0.02 + 0.08 * (name == "before motion"), 0.021, 0.002, 30, 60)
        for name in PHASES
    ),
    so_what=SoWhat(
        Optimum({"chamfer_deg": 8.1, "height_mm": 3.2}, 0.1034, 0.1821),
        Optimum({"chamfer_deg": 8.4, "height_mm": 3.1}, 0.1041, 0.1812),
        0.0009,
        "The best design hardly moves.",
    ),
    remarks=(
        Remark("actuation_delay", "for", "valves take 40 ms & more"),
        Remark("actuation_lag", "against", "the pressure rose at once"),
    ),
    unknown_cells="The unknown point was read as not tried.",
    provenance={"command": "dogshape gap toy <here>"},
)


def _changed(reading: Reading) -> Reading:
    """Return a reading of the toy with two points that have no time."""
    place = round(reading.point.mismatch / RPM), reading.point.profile.force
    if place == (249, 235.2):
        return replace(reading, time=None, engaged=False)
    if place == (149, 235.2):
        return replace(reading, time=None, engaged=None)
    return reading


def _with_holes(bench: Bench) -> Bench:
    readings = [_changed(reading) for reading in bench.readings]
    partly = next(r for r in readings if round(r.point.mismatch / RPM) == 100)
    readings.append(replace(partly, row=999, n=1, time=None, engaged=False))
    return replace(bench, cells=gather(readings))


@pytest.fixture(scope="module")
def full() -> Diagnosis:
    """Aliases at points of which some did not engage, or nobody knows."""
    bench = _with_holes(bench_of({"delay_s": 0.08}, np.random.default_rng(1), shifts=20))
    bench = replace(bench, name="rig <b>7</b>", source="made & measured")
    return diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in NAMES}, pairs=[])


@pytest.fixture(scope="module")
def page(full: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its report with everything."""
    return publish(full, tmp_path_factory.mktemp("gap"), EXTRAS)


def _plain(values: dict[str, float], extra: np.ndarray | None = None) -> Diagnosis:
    bench = bench_of(values, np.random.default_rng(1), shifts=20, extra=extra)
    return diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in FEW}, pairs=[])


def _ids(text: str) -> list[str]:
    return re.findall(r'<h2 id="([^"]+)"', text)


def _figures(text: str) -> list[str]:
    return re.findall(r'<div id="([^"]+)" class="plotly-graph-div"', text)


def test_every_part_is_there(page: Path) -> None:
    text = page.read_text()
    assert _ids(text) == [
        "where", "causes-part", "joint-part", "before-part", "foretold-part", "influence-part",
        "alike-part", "bounds-part", "readings", "next", "along", "so-what", "provenance",
    ]  # fmt: skip
    assert _figures(text) == [*DRAWN, "phases"]
    for words in (
        "dead time of the actuation", "valves take 40 ms &amp; more", "the pressure rose at once",
        "The best design hardly moves.", "0.9 ms", "read as not tried", "height h, mm",
        "unknown shifts read as failed", "force at the sleeve over time", "no information",
    ):  # fmt: skip
        assert words in text
    # What the answer hangs on stands on the first page and is no part of its own.
    assert set(re.findall(r'href="#([^"]+)"', text)) - {"caveats"} == set(_ids(text))
    assert text.count('id="caveats"') == 1


def test_what_is_missing_leaves_no_heading(tmp_path: Path) -> None:
    text = publish(_plain({"delay_s": 0.08}), tmp_path).read_text()
    # One plausible hypothesis: nothing to compare, but for what it can never be told from.
    assert _figures(text) == [name for name in DRAWN if name != "alike"]
    assert not {"along", "so-what"} & set(_ids(text))
    assert "Not engaged" not in text
    assert "nobody knows" not in text


def test_without_a_time_there_is_no_map(tmp_path: Path) -> None:
    bench = bench_of({}, np.random.default_rng(1))
    failed = [replace(r, time=None, engaged=False) for r in bench.readings]
    bench = replace(bench, cells=gather(failed))
    found = diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in FEW}, pairs=[])
    text = publish(found, tmp_path).read_text()
    assert not {"where", "before-part"} & set(_ids(text))
    assert set(ALWAYS) <= set(_ids(text))
    assert "There are no times to compare." in text
    assert 'class="card' not in text


def test_strings_are_escaped_and_nothing_is_loaded(full: Diagnosis, tmp_path: Path) -> None:
    delay = replace(EFFECTS["actuation_delay"], title="late</script><script>alert(1)</script>")
    found = replace(full, effects={**full.effects, "actuation_delay": delay})
    text = publish(found, tmp_path, EXTRAS).read_text()
    assert "rig &lt;b&gt;7&lt;/b&gt;" in text
    assert "made &amp; measured" in text
    assert "dogshape gap toy &lt;here&gt;" in text
    assert "<script>alert(1)" not in text
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="?(http|//)', text)


def test_record_and_table_lie_beside_the_report_and_within(full: Diagnosis, page: Path) -> None:
    text = page.read_text()
    links = dict(re.findall(r'<a id="(json|csv)" href="([^"]+)"', text))
    record = json.loads((page.parent / "gap.json").read_text())
    assert record == json.loads(json.dumps(full.as_dict()))
    assert json.loads(unquote(links["json"].partition(",")[2])) == record
    table = pd.read_csv(page.parent / "cells.csv")
    assert pd.read_csv(io.StringIO(unquote(links["csv"].partition(",")[2]))).equals(table)
    where = pd.DataFrame(record["where"])
    assert table["gap_s"].tolist() == pytest.approx(where["gap_s"].tolist(), nan_ok=True)
    assert table["z"].tolist() == pytest.approx(where["z"].tolist(), nan_ok=True)
    assert (table["bench_s"] - table["simulated_s"] - table["gap_s"]).abs().max() < 1e-12


def test_the_leading_hypothesis_foretells_the_times(full: Diagnosis) -> None:
    cells = [cell for cell in cells_of(full) if cell.bench_s is not None]
    left = np.array([cell.bench_s - cell.foretold_s for cell in cells])
    errors = np.array([np.hypot(cell.bench_error_s, cell.foretold_error_s) for cell in cells])
    assert np.sqrt(np.mean(left**2)) < 0.1 * full.before_after.baseline
    assert np.mean(np.abs(left) < 1.645 * errors) > 0.8


@pytest.mark.parametrize(
    ("values", "extra", "headline", "paragraph"),
    [
        pytest.param(
            {"delay_s": 0.08}, None, "Cause found: dead time of the actuation",
            r"delay 79\.\d ms \(90 % interval 78\.\d to 80\.\d ms\)", id="effect",
        ),
        pytest.param(
            {}, None, "No effect needed: bench and simulation agree within the margin",
            "it lies within the margin, 5 % of the mean time", id="none",
        ),
        pytest.param(
            {}, 0.04 * np.sin(1.3 * np.arange(len(POINTS))),
            "Unknown: no known effect explains the difference",
            "None of the known effects, alone or together as far as they were tried", id="unknown",
        ),
    ],
)  # fmt: skip
def test_the_top_says_the_verdict_and_what_to_do(
    values: dict[str, float], extra: np.ndarray | None, headline: str, paragraph: str
) -> None:
    record = _plain(values, extra).as_dict()
    assert record["headline"] == headline
    assert re.search(paragraph, record["summary"])
    assert " ms (root mean square" in record["summary"]
    assert re.search(r"Next: .* h of work", record["summary"])
    assert "_" not in record["summary"]


def test_aliases_are_named_together(full: Diagnosis) -> None:
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(1), shifts=20)
    found = diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in NAMES}, pairs=[])
    assert found.as_dict()["headline"] == (
        "Two causes cannot be told apart: dead time of the actuation or slow rise of the "
        "shift force"
    )
    figure = alike_figure(found)
    assert list(figure.data[0].x) == ["A", "B"]
    assert figure.data[0].text[0].tolist() == ["1 : 1", "itself"]


def test_map_has_numbers_marks_and_frames(full: Diagnosis) -> None:
    figure = gapmap.gap_map_figure(cells_of(full))
    in_ms, in_errors = figure.data
    assert list(in_ms.x) == ["235.2", "315.5", "469", "641.5"]
    assert in_ms.text[4][0] == "+80<br>20/21"
    assert in_errors.text[4][0].startswith("+")
    marks = [a.text for a in figure.layout.annotations if a.text in ("not<br>engaged", "unknown")]
    assert sorted(marks) == ["not<br>engaged"] * 2 + ["unknown"] * 2
    clear = [cell for cell in cells_of(full) if cell.z is not None and abs(cell.z) >= 2.0]
    framed = [shape for shape in figure.layout.shapes if shape.line.width == 2]
    assert len(framed) == 2 * len(clear)


def test_points_that_are_no_grid_have_a_line_each(full: Diagnosis) -> None:
    cells = [
        replace(cell, mismatch_rpm=-5.0 * k, force_N=300.0 + k)
        for k, cell in enumerate(cells_of(full)[:20], start=1)
    ]
    figure = gapmap.gap_map_figure(cells)
    assert list(figure.data[0].x) == ["gap"]
    assert figure.data[0].y[-1] == f"{MINUS}100 1/min, 320 N"
    listed = before.before_figure(cells, "dead time")
    assert [trace.name for trace in listed.data] == [
        "without any effect", "with dead time", "bench",
    ]  # fmt: skip
    assert len(listed.data[0].y) == 20


def test_before_and_after_have_a_panel_for_each_force(full: Diagnosis) -> None:
    figure = before.before_figure(cells_of(full), "dead time")
    bench = [trace for trace in figure.data if trace.name == "bench"]
    after = [trace for trace in figure.data if trace.name == "with dead time"]
    assert (len(bench), len(after)) == (4, 4)
    assert figure.layout.xaxis.type == "log"
    assert len(bench[0].x) == 5  # two of seven have no time
    # Without a hypothesis there is no second curve.
    alone = before.before_figure(cells_of(full), "")
    assert {trace.name for trace in alone.data if trace.name} == {"without any effect", "bench"}


def test_bars_mark_the_credible_set_and_the_floor(full: Diagnosis) -> None:
    causes = charts.causes_figure(full)
    inside = next(trace for trace in causes.data if trace.name == "in the 90 % set")
    assert len(inside.x) == len(full.verdict.credible)
    assert sum(inside.x) >= 0.9
    gaps = charts.held_out_figure(full)
    shown = {trace.y[0]: trace.x[0] for trace in gaps.data}
    assert shown["no effect (before)"] == pytest.approx(1e3 * full.before_after.baseline)
    assert full.chance is not None
    assert shown["chance alone"] == pytest.approx(1e3 * full.chance)


def test_bounds_say_where_there_is_no_information(full: Diagnosis) -> None:
    figure = charts.bounds_figure(full)
    words = {a.y: a.text for a in figure.layout.annotations}
    assert words["drag torque on the sliding ring"] == "no information"
    assert re.fullmatch(r"at most \d+(\.\d+)? ms", words["dead time of the actuation"])
    dotted = next(trace for trace in figure.data if trace.name == "no information")
    assert dotted.line.dash == "dot"


def test_answers_say_what_speaks_for_and_against(full: Diagnosis) -> None:
    found = {one.name: one for one in answers.answers_of(full, EXTRAS.remarks)}
    delay, lag = found["dead time of the actuation"], found["slow rise of the shift force"]
    assert "valves take 40 ms & more" in delay.reasons
    assert any("more than 1000 times better" in line for line in delay.reasons)
    assert any("a shifted time zero of the record" in line for line in delay.doubts)
    assert "the pressure rose at once" in lag.doubts
    assert delay.inside
    assert re.fullmatch(r"delay [\d.]+ ms \([\d.]+ to [\d.]+ ms\)", delay.sizes[0])


def test_a_small_size_is_at_no_end_where_nothing_lies_beyond(full: Diagnosis) -> None:
    """A short dead time is not at the end of what is held possible, a long one is."""
    alone = ("actuation_delay",)

    def said(mean: float, low: float, high: float) -> str:
        sizes = {alone: {"delay_s": Interval(mean, low, high)}}
        return answers._ends(SimpleNamespace(intervals=sizes, scored=full.scored), alone)[1]

    assert said(0.015, 0.012, 0.017) == ""
    assert said(0.395, 0.39, 0.399) == "delay at the end of the range held possible"


def test_few_data_are_told_on_the_first_page(full: Diagnosis, tmp_path: Path) -> None:
    assert reasons.few_data(full) == ""
    points = POINTS[:2]
    bench = bench_of({}, np.random.default_rng(1), shifts=1, single=True, points=points)
    few = diagnose(bench, Toy(points), {n: EFFECTS[n] for n in FEW}, pairs=[])
    publish(few, tmp_path)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    caveats = text.partition('id="caveats"')[2].partition("</ul>")[0]
    assert "2 shifts have a time, at 2 operating points" in caveats


def test_readings_at_rest_speak_for_and_against(tmp_path: Path) -> None:
    stand = load_bench("mq200_stand")
    bench = bench_of({"force_factor": 0.5}, np.random.default_rng(1), shifts=20)
    bench = replace(bench, sensor=stand.sensor, calibration=stand.calibration)
    names = ("actuation_delay", "force_scale")
    found = diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in names}, pairs=[])
    every = answers.answers_of(found, ())
    scale = next(one for one in every if one.name == "shift force off nominal")
    assert any(line.startswith("at rest the stand shows") for line in scale.reasons + scale.doubts)
    text = publish(found, tmp_path).read_text()
    assert "What the stand shows beside the shifts" in text
    assert "given the force factor at rest" in text


def test_words_of_numbers() -> None:
    assert [chance(p) for p in (0.001, 0.5, 0.985, 0.999)] == ["< 1 %", "50 %", "98 %", "> 99 %"]
    assert described("friction_N", Interval(30.0, 20.0, 41.0)) == "friction 30 N (20 to 41 N)"
    assert between("force_factor", 0.6, 0.6) == "0.6"
    assert [odds(log) for log in (0.0, 1.0, 4.0, 9.0)] == [
        "1 : 1", "2.7 : 1", "55 : 1", "> 1000 : 1",
    ]  # fmt: skip
    phase = PhaseGap("travel", 0.02, 0.021, 0.001, 3, 6)
    assert charts.phase_words(phase) == f"{MINUS}1.0 ± 1.6"


@pytest.mark.parametrize("width", [1280, 800])
def test_report_in_a_browser(page: Path, tmp_path: Path, width: int) -> None:
    seen = look(page, tmp_path, PROBE + REPORT_PROBE, window=f"{width},900")
    assert "error" not in seen
    assert seen["ids"].split() == [*DRAWN, "phases"]
    assert seen["figures"] == seen["drawn"]
    assert (seen["wide"], seen["loads"]) == ("false", "0")
    assert json.loads(seen["cut"]) == json.loads(seen["paper"]) == []
    # A4 less its margins of 12 mm is 703 px wide.
    assert {float(one) for one in seen["widths"].split()} == {700.0}


#: Put into a report: chooses the second hypothesis of the joint posterior.
CHOOSE = """
<script>
function probe(said) {
  const corner = document.getElementById("corner");
  said.before = document.getElementById("joint").querySelectorAll(".subplot").length;
  corner.value = "1";
  corner.dispatchEvent(new Event("change"));
  setTimeout(() => {
    said.name = document.getElementById("corner-name").textContent;
    const frame = document.getElementById("joint");
    said.titles = frame.layout.annotations.length / 2;
    said.after = frame.querySelectorAll(".subplot").length;
  }, 500);
}
</script>
"""


def test_another_hypothesis_is_drawn_in_place(full: Diagnosis, page: Path, tmp_path: Path) -> None:
    corners = joint_figure.with_corners(full)
    assert len(corners) > 1
    seen = look(page, tmp_path, PROBE + CHOOSE, window="1280,900")
    assert "error" not in seen
    size = len(full.scored[corners[1]].space.parameters) + 1
    assert seen["titles"] == str(size)
    assert seen["after"] == str(size * (size + 1) // 2)
    assert seen["name"].startswith("slow rise of the shift force")


def test_corner_has_marginals_pairs_and_the_neutral_value(full: Diagnosis) -> None:
    figure = joint_figure.joint_figure(full, ("actuation_delay",))
    words = [a.text for a in figure.layout.annotations]
    size = described("delay_s", full.intervals["actuation_delay",]["delay_s"])
    assert words[0] == size.removeprefix("delay ")
    assert words[1] == "before: 0 to 400 ms"
    # One parameter and the discrepancy: two marginals, a pair with two regions.
    assert sum(trace.type == "contour" for trace in figure.data) == 2
    assert figure.layout.xaxis3.title.text == "discrepancy, % of time"


def test_predicted_means_stand_beside_the_bench(full: Diagnosis) -> None:
    figure = predicted_figure.predicted_figure(full)
    names = {trace.name for trace in figure.data}
    assert {"leading hypothesis", "best rival", "no effect"} <= names
    boxes = [trace for trace in figure.data if trace.type == "box"]
    assert len(boxes) == 3 * 4
    said = dict(predicted_figure.in_words(full))
    words = said["Leading hypothesis, dead time of the actuation"]
    assert re.match(r"holds (all|2\d of) 26", words)
    assert said["No effect"].startswith("holds ")
    assert "it fails at" in said["No effect"]


def test_each_point_has_its_influence(full: Diagnosis, page: Path) -> None:
    assert full.influence is not None
    left, right = influence_figure.influence_figure(full, full.influence).data
    one = full.influence.cells[4]
    assert one is not None
    assert left.z[1][0] == pytest.approx(one.log_bayes)
    assert right.z[1][0] == pytest.approx(one.probability - full.influence.probability)
    rows = influence_figure.rows_of(full, full.influence)
    assert len(rows) == 27  # of one nobody knows whether shifts were tried
    text = html.unescape(page.read_text())
    assert full.as_dict()["influence"]["sentence"] in text
    assert text.count("<summary>") == 1


def test_report_prints_on_a_few_pages(page: Path, tmp_path: Path) -> None:
    printed = print_pdf(page, tmp_path)
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 11


def test_chance_has_one_figure_on_the_page(full: Diagnosis, page: Path) -> None:
    text = page.read_text()
    assert full.chance is not None
    card = re.search(r'<div class="card gain"><span>([^<]*)</span><b>([^<]*) <small>', text)
    assert card is not None
    assert card.groups() == ("chance alone", ms(full.chance).split()[0])
    assert f"chance alone would leave {ms(full.chance)}" in text
    assert not re.search("chance would leave|scatter and numerics alone", text)


def test_the_page_takes_its_limits_from_the_code(
    full: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = {
        "fit": "0.017", "odds": "7.7 : 1", "named": "77 %", "credible": "97 %", "hour": "7 %",
        "misled": "3 %",
    }  # fmt: skip
    monkeypatch.setattr(reasons, "LIMITS", said)
    text = publish(full, tmp_path).read_text()
    for words in (
        "below 0.017",
        "below 7.7 : 1",
        "more than 77 %",
        "have 97 %",
        "less 7 %",
        "more than 3 % of",
    ):
        assert words in text, words


def test_a_likely_cause_that_is_not_named_has_its_reason(full: Diagnosis) -> None:
    even = replace(full, posterior={("actuation_delay",): 0.6, ("actuation_lag",): 0.4})
    assert reasons.why_not_named(even) == "", "the leader has too little for a reason"
    three = ("actuation_delay", "drag_torque", "moving_mass")
    two = three[:2]
    open_one = replace(full.verdict, kind="ambiguous", causes=())
    likely = {three: 0.86, two: 0.12, (): 0.02}
    found = replace(full, verdict=open_one, posterior=likely, fits={three: 0.3})
    said = reasons.why_not_named(found)
    assert "86 % and is yet not settled" in said
    assert "more than two effects" in said
    assert "mass of actuator and linkage is part of the cause with 86 % only" in said
    assert "dead time of the actuation is" not in said
    badly = replace(found, posterior={two: 0.97, (): 0.03}, fits={two: 0.004})
    assert "further from it than chance allows (p = 0.004)" in reasons.why_not_named(badly)


def test_every_likely_cause_that_is_left_open_has_a_reason(full: Diagnosis) -> None:
    """The words follow the decision: whatever ``decide`` leaves open above its limit is told."""
    pair, lone = ("actuation_delay", "moving_mass"), ("drag_torque",)
    for top, p, fit in itertools.product((pair, lone, ()), (0.7, 0.85, 0.97), (0.001, 0.4)):
        posterior = {top: p, ("actuation_lag",): 1.0 - p}
        verdict = decide(posterior, full.confusion, {top: fit})
        said = reasons.why_not_named(
            replace(full, posterior=posterior, verdict=verdict, fits={top: fit})
        )
        assert bool(said) == (verdict.kind == "ambiguous" and p > NAMED), (top, p, fit)
        assert "others may hold" not in said


def test_uneven_chances_in_a_class_are_explained(full: Diagnosis, page: Path) -> None:
    group = ("actuation_delay",), ("actuation_lag",)
    one_class = replace(full.confusion, classes=(group,))
    even = replace(full, confusion=one_class, posterior={group[0]: 0.5, group[1]: 0.5})
    assert reasons.why_alike(even) == ""
    uneven = reasons.why_alike(replace(even, posterior={group[0]: 0.86, group[1]: 0.09}))
    assert uneven.startswith("That one of a class has 86 % and another 9 %")


def test_names_have_room_for_their_lines_on_paper(full: Diagnosis) -> None:
    """A row is as high as its name's lines, on paper too, where figures are lower."""
    names = ["a,<br>b,<br>c", "d"]
    for count in (2, 5):
        height = 120 + count * charts.row_height(names)
        row = (PAPER * height - 100) / count  # less margins, which paper leaves as they are
        assert row > 3 * 17
    assert charts.row_height(["d"]) == 54


def test_the_number_of_hypotheses_is_not_read_as_unknown_ones(page: Path) -> None:
    text = html.unescape(page.read_text())
    assert re.search(r"\d+: 4 of one effect(, \d+ of two)?, no effect, and no known effect", text)


def test_console_and_page_name_effects_alike(full: Diagnosis) -> None:
    group = ("actuation_delay", "drag_torque"), ("actuation_lag", "drag_torque")
    said = class_in_words(group, full.effects, keys=True)
    assert said == (
        "dead time of the actuation (actuation_delay) or slow rise of the shift force "
        "(actuation_lag), each with drag torque on the sliding ring (drag_torque)"
    )
    assert class_in_words([(), ("drag_torque",)], full.effects) == (
        "no effect or drag torque on the sliding ring"
    )
