"""A small sealed set of one engine through all three verbs: made, diagnosed, scored."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions
from dogshape.validation.blind import advised_test, cases
from tests.conftest import Call


def test_a_small_sealed_set_is_diagnosed_and_scored(
    dogshape: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cases, "COUNTS", {"planar": cases.COUNTS["planar"]})
    monkeypatch.setattr(cases, "SMALL_COUNTS", {"none": 1, "single": 1})
    # Few points and an early stop keep the simulations of a diagnosis short.
    monkeypatch.setattr(cases, "POINT_COUNTS", (5, 6))
    settings = replace(USUAL, converged=0.05)
    monkeypatch.setattr(advised_test, "BankOptions", partial(BankOptions, settings=settings))
    folder = tmp_path / "blind"
    made = dogshape("blind", "make", folder, "--small", "--seed", 3, "--jobs", 1, "--json")
    assert made.status == 0, made.err
    key = folder / "key.json"
    assert made.json["key_sha256"] == hashlib.sha256(key.read_bytes()).hexdigest()
    # The diagnosis never sees the key: it lies elsewhere until the score.
    hidden = tmp_path / "sealed.json"
    key.rename(hidden)
    ran = dogshape("blind", "run", folder, "--jobs", 1, "--json")
    assert ran.status == 0, ran.err
    hidden.rename(key)
    score = dogshape("blind", "score", folder, "--json").json
    truths = json.loads(key.read_text(encoding="utf-8"))["cases"]
    assert score["cases"] == len(truths) == len(ran.json["cases"]) == 3
    assert score["code"] == {"changed": [], "figures_as_sealed": True}
    # Nothing is named that is not there, and no effect where there is none.
    figures = {one["name"]: one["figure"] for one in score["headline"]}
    assert figures["false_alarms"]["value"] == 0.0
    assert not figures["wrong_sure"]["value"]
    assert figures["cpu_s"]["n"] == 3
