"""A small sealed set through all three verbs: made by the second engine, diagnosed, scored."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from tests.conftest import Said


def test_a_small_sealed_set_is_diagnosed_and_scored(
    dogshape: Callable[..., Said], tmp_path: Path
) -> None:
    folder = tmp_path / "blind"
    made = dogshape("blind", "make", folder, "--size", "small", "--which", "tuning", "--json")
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
    assert score["cases"] == len(truths) == len(ran.json["cases"])
    # What is said to be a cause is one, and nothing is said to be where there is none.
    assert score["all"]["named_causes_true"]["value"] == 1.0
    assert score["none"]["false_alarms"]["value"] == 0.0
    assert score["outside"]["wrong_effect_named"]["value"] == 0.0
    assert score["visible"]["n"] >= 3
    assert score["visible"]["top_class"]["value"] >= 0.5
