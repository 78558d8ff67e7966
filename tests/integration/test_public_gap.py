"""The diagnosis in the public package, on a clutch of closed form whose cause is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.diagnosis.bench.bench_data import Bench
from tests.conftest import Said
from tests.diagnosed import simulated_bench, simulated_diagnosis

Dogshape = Callable[..., Said]
CAUSE = {"actuation_delay": {"delay_s": 0.08}}
#: Keys of the record that other programs read.
KEYS = {
    *("bench", "engine", "verdict", "causes", "hypotheses", "confusable", "inclusion", "gap"),
    *("where", "record", "readings", "next_test", "tests", "discrepancy", "margin_s", "noise"),
}


@pytest.fixture(scope="module")
def found() -> ds.Diagnosis:
    return ds.Diagnosis(simulated_diagnosis(simulated_bench(CAUSE), advise=True))


def test_a_diagnosis_is_what_the_command_line_prints(
    found: ds.Diagnosis, dogshape: Dogshape, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files have the same as the record that is printed."""

    def known(_: Bench, means: Any) -> Any:
        assert means.engine == "planar"
        return found.inference

    monkeypatch.setattr("dogshape.gap.diagnosed", known)
    out = tmp_path / "out"
    said = dogshape("gap", "mq200_adams", "--bank", tmp_path, "--out", out, "--json")
    assert said.status == 0, said.err
    record = json.loads(json.dumps(found.to_dict()))
    assert record["report"] is None
    assert said.json == record | {"report": str(out / "report.html")}
    kept = json.loads((out / "gap.json").read_text(encoding="utf-8"))
    assert kept["hypotheses"] == said.json["hypotheses"]
    assert kept.keys() >= KEYS
    assert (out / "report.html").stat().st_size > 1_000_000
    assert (out / "cells.csv").read_text(encoding="utf-8").count("\n") == 13
    text = " ".join(dogshape("gap", "mq200_adams", "--bank", tmp_path).out.split())
    assert record["summary"] in text
    assert "next test: " in text


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
