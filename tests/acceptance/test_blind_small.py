"""A small sealed set of one engine through all three verbs: made, diagnosed, scored."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from dogshape.validation.blind import cases
from tests.conftest import Said


def test_a_small_sealed_set_is_diagnosed_and_scored(
    dogshape: Callable[..., Said], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cases, "COUNTS", {"planar": cases.COUNTS["planar"]})
    folder = tmp_path / "blind"
    asked = ("--size", "small", "--seed", 3, "--jobs", 1)
    made = dogshape("blind", "make", folder, *asked, "--json")
    assert made.status == 0, made.err
    key = folder / "key.json"
    assert made.json["key_sha256"] == hashlib.sha256(key.read_bytes()).hexdigest()
    # The diagnosis never sees the key: it lies elsewhere until the score.
    hidden = tmp_path / "sealed.json"
    key.rename(hidden)
    ran = dogshape("blind", "run", folder, "--jobs", 2, "--json")
    assert ran.status == 0, ran.err
    hidden.rename(key)
    score = dogshape("blind", "score", folder, "--json").json
    truths = json.loads(key.read_text(encoding="utf-8"))["cases"]
    assert score["cases"] == len(truths) == len(ran.json["cases"]) == 4
    assert score["code"] == {"changed": [], "figures_as_sealed": True}
    # What is clear is found, and nothing is said to be where there is none.
    figures = {one["name"]: one["figure"]["value"] for one in score["headline"]}
    assert figures["cause_right"] == figures["unknown_recognised"] == figures["none_said"] == 1.0
    assert figures["false_alarms"] == figures["false_unknown"] == 0.0
    assert score["bands"]["clear"]["named_wrongly"]["value"] == 0.0
