"""A diagnosis as users get it: words, record with its settings, page, table, and a browser."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest

import dogshape as ds
from dogshape.bench.bench_data import Bench, gather
from dogshape.bench.stand_file import Sensor
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.range_ends import RangeEnd
from dogshape.diagnosis.report.wording import (
    amount,
    answered_meanings,
    cause_sentence,
    headline,
    remarks,
    summary,
)
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.pipeline.reports.gap_page import effect_table, publish
from dogshape.sim.units import RPM
from tests.browser import Chromium
from tests.conftest import Call
from tests.diagnoses import (
    DAMPED,
    HEAVY,
    NAMED,
    POSTERIOR,
    STAND,
    diagnosis_of,
    reading,
    simulated_bench,
    simulated_diagnosis,
    stand_diagnosis,
)


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
    return diagnosis_of(POSTERIOR, bench, record_meanings=readings_of)


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
    assert " ".join(parts) == (
        "effects next-test hypotheses residuals design-choice data-and-settings"
    )
    assert re.findall(r'href="#([^"]+)"', text) == parts
    for words in ("rig &lt;b&gt;7&lt;/b&gt;", "made &amp; measured", "from &lt;here&gt;"):
        assert words in text, words
    assert not re.search(r'<(script|link|img)[^>]*(src|href)="?(http|//)', text)


def test_the_table_lies_beside_the_report(full: Any, page: Path) -> None:
    table = pd.read_csv(page.parent / "cells.csv")
    assert len(table) == 28
    assert (table["bench_s"] - table["simulated_s"] - table["gap_s"]).abs().max() < 1e-12
    # The prediction is that of the fit to all other points.
    assert table["predicted_s"].tolist() == pytest.approx(full.held_out.mean.tolist())
    known = table["bench_error_s"].notna()
    assert known.tolist() == [cell.n > 0 for cell in full.bench.cells]


#: Pictures, those whose words leave their frame, and the height of the last sentence on them.
PICTURES = """(() => {
  const cut = [], pictures = [...document.querySelectorAll("svg.picture")];
  for (const picture of pictures) {
    const frame = picture.getBoundingClientRect();
    for (const text of picture.querySelectorAll("text")) {
      const box = text.getBoundingClientRect();
      if (box.left < frame.left - 1 || box.right > frame.right + 1 || box.bottom > frame.bottom + 1)
        cut.push(text.textContent);
    }
  }
  const captions = [...document.querySelectorAll("figcaption")];
  const bottoms = captions.map(caption => caption.getBoundingClientRect().bottom);
  return {count: pictures.length, cut, captions: captions.length, bottom: Math.max(...bottoms)};
})()"""


def test_report_in_a_browser_and_on_paper(page: Path, tmp_path: Path) -> None:
    """The first screen has three pictures with a sentence each; nothing comes from a network."""
    with Chromium(tmp_path) as browser:
        state = browser.look(page)
        assert (state["faults"], state["loads"], state["wide"]) == ([], 0, False)
        pictures = browser.ask(PICTURES)
        assert (pictures["count"], pictures["captions"], pictures["cut"]) == (4, 3, [])
        assert pictures["bottom"] < 1000
        assert 2 <= len(re.findall(rb"/Type\s*/Page\b", browser.print_pdf())) <= 5


def test_the_summary_has_three_sentences_and_the_remarks_what_measures_a_large_size() -> None:
    """No effect moves a time of this model, and 20 kg over 3.1914 squared are 2 kg at the arm."""
    found = stand_diagnosis()
    said = summary(found)
    assert len(re.findall(r"\.(?: [A-Z]|$)", said)) == 3
    assert said.startswith(
        "The bench is slower by 75 to 260 ms at all 25 points; largest at 5 1/min"
    )
    every, alone = found.sizes["actuation_delay"]["delay_s"], found.fits[HEAVY].intervals["delay_s"]
    assert (every.low, every.high) != (alone.low, alone.high)
    assert f"dead time of the actuation {amount('delay_s', every.low, every.high)} (96 %)" in said
    assert "mass of actuator and linkage" in said.partition("open beside:")[2]
    assert "The gap is 138 ms (root mean square, 25 operating points); 21 ms are left" in said
    for words in ("(62 %)", "nothing more (14 %)"):
        assert words in said
    said = " ".join(remarks(found))
    for words in (
        "Alone and as read at rest, elastic linkage (3.9 mm/kN) explains 0 ms",
        "At the arm, added mass of 20 kg is 2 kg (ratio 3.19 squared).",
        "Drag of 1.6 N m is 3.2 times that of bearings and seals of an input shaft (0.5 N m); "
        "run-down of the sliding ring measures it in 1 h.",
    ):  # fmt: skip
        assert words in said
    assert "Delay of" not in said
    assert amount("force_N", 199.6, digits=2) == "200 N"
    direct = diagnosis_of({HEAVY: 0.9, DAMPED: 0.1}, replace(STAND, sensor=Sensor()))
    assert "At the arm" not in " ".join(remarks(direct))
    assert "Added mass of 20 kg is 20 times that of fork and rod (1 kg)." in remarks(direct)
    elastic = {("linkage_compliance",): 0.96, ("contact_friction",): 0.04}
    behind = remarks(diagnosis_of(elastic, replace(STAND, sensor=Sensor())))
    assert "Mass behind of 5 kg is 5 times that of fork and rod (1 kg)." in behind
    rubbed = summary(diagnosis_of({("contact_friction",): 0.98, NONE: 0.02}))
    assert re.search(r"static friction 0\.\d+ to 0\.\d+, dynamic friction 0\.\d+ to", rubbed)


def test_sizes_of_geometry_are_compared_with_an_ordinary_range() -> None:
    """A gap of 0.3 mm is within half a millimetre, one of 1.1 mm is not."""
    posterior = {("axial_gap",): 0.98, NONE: 0.02}
    within = diagnosis_of(posterior)
    assert not [remark for remark in remarks(within) if "Gap offset" in remark]
    sizes = {"axial_gap": {"gap_offset_mm": Interval(1.1, 1.0, 1.2)}}
    beyond = diagnosis_of(posterior, sizes=sizes)
    assert remarks(beyond)[0] == (
        "Gap offset of 1.1 mm is above that of a neutral position without a stop (-0.5 to 0.5 mm)."
    )
    assert effect_table(beyond).rows[0][-1] == "above"


def test_a_size_at_the_end_of_its_range_is_said_in_verdict_table_and_text() -> None:
    end = RangeEnd("axial_gap", "gap_offset_mm", "high", 1.6)
    pressed = diagnosis_of({("axial_gap",): 0.98, NONE: 0.02}, range_ends=(end,))
    assert headline(pressed) == "Cause: axial gap off nominal (gap offset at the end of its range)"
    assert effect_table(pressed).rows[0][-1] == "range end"
    assert remarks(pressed)[0] == (
        "Axial gap off nominal, gap offset: the data want more than 1.6 mm; the list ends there."
    )


def test_one_probability_of_an_effect_in_table_and_text() -> None:
    named = diagnosis_of({NAMED: 0.87, HEAVY: 0.1, UNKNOWN: 0.03})
    table = effect_table(named)
    assert [row[1] for row in table.rows] == ["97 % ± 1", "97 % ± 1", "10 % ± 1"]
    said = cause_sentence(named)
    assert said.count("(97 %)") == 2
    assert said.endswith("nothing else acts, with 87 %.")


def test_a_key_of_the_record_that_only_has_its_prior_is_no_answer() -> None:
    causes = stand_diagnosis().verdict.causes
    command = reading("time_zero", "command", 0.41, causes)
    force = reading("time_zero", "force", 0.59, causes)
    same = diagnosis_of(POSTERIOR, record_meanings=(command, force))
    assert answered_meanings(same) == []
    other = reading("time_zero", "force", 0.59, ("drag_torque",))
    decides = diagnosis_of(POSTERIOR, record_meanings=(command, other))
    assert answered_meanings(decides) == [command, other]
    noted = reading("sense", "as_noted", 0.9, causes)
    turned = reading("sense", "reversed", 0.1, causes)
    shown = diagnosis_of(POSTERIOR, record_meanings=(command, force, noted, turned))
    assert answered_meanings(shown) == [noted, turned]


def test_a_contact_far_from_the_stated_one_is_said() -> None:
    posterior = {("axial_gap",): 0.98, NONE: 0.02}
    assert not [remark for remark in remarks(diagnosis_of(posterior)) if "contact" in remark]
    odd = diagnosis_of(posterior, odd_contact=("contact_stiffness",))
    assert remarks(odd)[0] == (
        "The contact of the dogs is another one: stiffness 0.08 times the stated one (0.04 to "
        "0.15; known within a factor of 3). Times of shifts do not tell stiffness from rebound; "
        "measure them, or look for another effect of the contact."
    )


def test_a_reading_of_the_record_that_decides_is_stated() -> None:
    same = reading("time_zero", "command", 0.7, stand_diagnosis().verdict.causes)
    other = reading("time_zero", "force", 0.3, ("drag_torque",))
    posterior = stand_diagnosis().posterior
    silent = diagnosis_of(posterior, record_meanings=(same, same))
    assert not [remark for remark in remarks(silent) if remark.startswith("If ")]
    said = remarks(diagnosis_of(posterior, record_meanings=(same, other)))
    assert said[-1] == (
        "If times start with the force (30 %), the answer is 'Part of the cause: drag torque "
        "on the sliding ring; the rest is open'."
    )


CAUSE = {"actuation_delay": {"delay_s": 0.08}}
#: Keys of the record that other programs read.
KEYS = {
    *("bench", "engine", "verdict", "causes", "hypotheses", "confusable", "inclusion", "gap"),
    *(
        "where",
        "where_sentence",
        "at_range_end",
        "contact",
        "record",
        "readings",
        "next_test",
        "tests",
        "discrepancy",
        "margin_s",
        "noise",
    ),
}


@pytest.fixture(scope="module")
def found() -> ds.Diagnosis:
    return ds.Diagnosis(simulated_diagnosis(simulated_bench(CAUSE), advise=True))


def test_a_diagnosis_is_what_the_command_line_prints(
    found: ds.Diagnosis, dogshape: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files have the same as the record that is printed."""

    def known(_: Bench, means: Any) -> Any:
        assert means.engine == "planar"
        return found.inference

    monkeypatch.setattr("dogshape.gap.diagnose_bench", known)
    out = tmp_path / "out"
    said = dogshape("diagnose", "mq200_adams", "--bank", tmp_path, "--out", out, "--json")
    assert said.status == 0, said.err
    record = json.loads(json.dumps(found.to_dict()))
    assert record["report"] is None
    assert said.json == record | {"report": str(out / "report.html")}
    kept = json.loads((out / "gap.json").read_text(encoding="utf-8"))
    assert kept["hypotheses"] == said.json["hypotheses"]
    assert kept.keys() >= KEYS
    assert 10_000 < (out / "report.html").stat().st_size < 1_500_000
    assert (out / "cells.csv").read_text(encoding="utf-8").count("\n") == 13
    lines = dogshape("diagnose", "mq200_adams", "--bank", tmp_path).out.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 100
    text = " ".join(" ".join(lines).split())
    heads = ("where: ", "which: ", "how far: ", "next test: ")
    assert [text.count(head) for head in heads] == [1, 1, 1, 1]
    assert sorted(heads, key=text.index) == [*heads]
    assert record["where_sentence"] in text


def test_the_record_has_the_contract(found: ds.Diagnosis) -> None:
    record = found.to_dict()
    assert (record["verdict"], record["causes"]) == ("effect", ["actuation_delay"])
    assert record["record"]["time_zero"] == "command"
    first, gap = record["hypotheses"][0], record["gap"]
    delay = first["parameters"]["delay_s"]
    assert delay["low"] < 0.08 < delay["high"]
    assert first.keys() >= {"effects", "probability", "evidence_probability", "predictive_p"}
    assert gap["baseline_rmse_s"] == pytest.approx(0.08, abs=0.002)
    assert gap["heldout_rmse_s"] < 0.01
    assert 0.9 < gap["shrink"] <= 1.0
    assert record["inclusion"]["actuation_delay"] > 0.95
    assert {"name", "why"} <= record["next_test"].keys()


def test_a_record_keeps_its_settings_and_they_decide(found: ds.Diagnosis) -> None:
    """A limit that nothing reaches names nothing."""
    other = replace(USUAL, named=1.0, part=1.0)
    never = simulated_diagnosis(simulated_bench(CAUSE), other)
    assert (never.verdict.kind, never.verdict.causes) == ("ambiguous", ())
    kept = json.loads(json.dumps(never.to_dict(), allow_nan=False))["settings"]
    assert kept == json.loads(json.dumps(asdict(other)))
    assert (kept["named"], found.to_dict()["settings"]["named"]) == (1.0, 0.8)
