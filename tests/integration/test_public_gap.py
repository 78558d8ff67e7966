"""The diagnosis in the public package, on a small set whose cause is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import dogshape as ds
from tests.conftest import Said

Dogshape = Callable[..., Said]


@pytest.fixture(scope="module")
def found() -> ds.Diagnosis:
    return ds.diagnose("mq200_adams")


def test_a_diagnosis_is_what_the_command_line_prints(
    found: ds.Diagnosis, dogshape: Dogshape, tmp_path: Path
) -> None:
    """Its files say the same as the record that is printed."""
    said = dogshape("gap", "mq200_adams", "--bank", tmp_path, "--out", tmp_path / "out", "--json")
    assert said.status == 0
    record = json.loads(json.dumps(found.to_dict()))
    assert record["report"] is None
    assert said.json == record | {"report": str(tmp_path / "out" / "report.html")}
    kept = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert kept["hypotheses"] == said.json["hypotheses"]
    assert (tmp_path / "out" / "report.html").stat().st_size > 1_000_000
    assert (tmp_path / "out" / "cells.csv").read_text(encoding="utf-8").count("\n") == 29


def test_the_published_model_needs_no_effect_that_matters(found: ds.Diagnosis) -> None:
    record = found.to_dict()
    assert record["gap"]["baseline_rmse_s"] < record["gap"]["floor_rmse_s"]
    chances = {tuple(h["effects"]): h["probability"] for h in record["hypotheses"]}
    assert sum(chances.values()) == pytest.approx(1.0)
    assert chances[("unknown",)] < 0.05
    # A dry friction that matters on the stand would be seen at once.
    assert record["bounds"]["sleeve_friction"]["high"] < 15.0


def test_probabilities_are_those_of_the_record(found: ds.Diagnosis) -> None:
    given = found.to_dict()["hypotheses"]
    assert found.probabilities.sum() == pytest.approx(1.0)
    assert list(found.probabilities) == [one["probability"] for one in given]
    assert found.probabilities.index[0] == (" + ".join(given[0]["effects"]) or "none")


def test_points_as_table_and_figure(found: ds.Diagnosis) -> None:
    frame = found.to_frame()
    assert len(frame) == 28
    apart = frame["bench_s"] - frame["simulated_s"] - frame["gap_s"]
    assert apart.notna().sum() == 25
    assert apart.abs().max() < 1e-12
    names = {trace.name for trace in found.plot().data}
    assert "bench" in " ".join(str(name) for name in names)


def test_the_page_is_one_file(found: ds.Diagnosis, tmp_path: Path) -> None:
    page = found.report(tmp_path / "gap.html").read_text(encoding="utf-8")
    assert "<html" in page
    assert list(tmp_path.iterdir()) == [tmp_path / "gap.html"]
    assert found.verdict in repr(found.to_dict()["verdict"])
