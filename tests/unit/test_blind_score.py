"""Marks of blind cases on made-up results, intervals of figures, and the seal."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.sim.errors import InputError, StorageError
from dogshape.validation.blind import sealed
from dogshape.validation.blind.case_marks import CHANCE, gap_size, mark_of
from dogshape.validation.blind.cases import WHICH
from dogshape.validation.blind.intervals import calibration, mean, share
from dogshape.validation.blind.score import score_field

FREE = [[0.1, 0.2, 0.3, 0.4]]


def _truth(kind: str, parameters: dict[str, Any], shift: float, **more: Any) -> dict[str, Any]:
    return {
        "kind": kind, "form": "means", "causes": sorted(parameters), "parameters": parameters,
        "outside": {}, "times_s": [[t + shift for t in FREE[0]]], "engine": "planar",
        "stand": "half", "places": [0], "yardstick": {"engine_off_in_margins": 0.5}, **more,
    }  # fmt: skip


CASES = {
    "case_00": _truth("single", {"moving_mass": {"added_mass_kg": 2.0}}, 0.3),
    "case_01": _truth("single", {"sleeve_friction": {"friction_N": 50.0}}, 0.01),
    "case_02": _truth("none", {}, 0.0),
    "case_03": _truth(
        "pair", {"actuation_delay": {"delay_s": 0.1}, "moving_mass": {"added_mass_kg": 1.0}}, 0.5
    ),
    "case_04": _truth("outside", {}, 0.4, causes=["unknown"], outside={"drift": 0.5}),
}


def _found(
    chances: dict[tuple[str, ...], float], verdict: str, causes: list[str], **more: Any
) -> dict[str, Any]:
    hypotheses = [
        {"effects": list(h), "probability": p, "evidence_probability": p, "parameters": {}}
        for h, p in chances.items()
    ]
    hypotheses[0]["parameters"] = more.pop("parameters", {})
    record = {"verdict": verdict, "causes": causes, "hypotheses": hypotheses, **more}
    return {"diagnosis": record, "time_s": 3.0}


MASS = ("moving_mass",)
RESULTS = {
    "case_00": _found(
        {MASS: 0.9, (): 0.1}, "effect", ["moving_mass"],
        parameters={"added_mass_kg": {"mean": 2.1, "low": 1.5, "high": 2.5}},
        plain={"smallest_rmse": ["actuation_lag"], "aicc": [
            {"effects": ["moving_mass"], "weight": 0.7}, {"effects": [], "weight": 0.3}]},
    ),
    "case_01": _found(
        {("viscous_damping",): 0.6, ("sleeve_friction",): 0.35, (): 0.05}, "ambiguous", [],
        classes=[[["viscous_damping"], ["sleeve_friction"]], [["moving_mass"], []]],
    ),
    "case_02": _found({MASS: 0.85, (): 0.15}, "effect", ["moving_mass"]),
    "case_03": _found({("actuation_delay",): 0.7, ("actuation_delay", "moving_mass"): 0.3},
                      "ambiguous", ["actuation_delay"]),
    "case_04": {"refused": "the times cannot be", "time_s": 1.0},
}  # fmt: skip


def test_marks_are_those_of_the_record() -> None:
    marks = {n: mark_of(n, CASES[n], {"reference_s": FREE}, RESULTS[n]) for n in CASES}
    assert [m.right for m in marks.values()] == [True, False, False, False, True]
    assert [m.right_class for m in marks.values()] == [True, True, False, False, True]
    assert [m.named_right for m in marks.values()] == [True, False, False, False, False]
    assert [m.found for m in marks.values()] == [1, 0, 0, 1, 1]
    assert [len(m.credible) for m in marks.values()] == [1, 2, 2, 2, 0]
    assert marks["case_00"].inside == (True,)
    assert marks["case_04"].refused
    assert marks["case_00"].plain == ("actuation_lag",)


def test_classes_are_those_of_the_record() -> None:
    odd, pair = ("lag + play",), ("actuation_lag", "moving_mass")
    chances: dict[tuple[str, ...], float] = {odd: 0.5, pair: 0.3, (): 0.2}
    truth = _truth("single", {}, 0.3, causes=list(pair))
    result = _found(chances, "ambiguous", [], classes=[[list(odd), list(pair)]])
    mark = mark_of("case_00", truth, {"reference_s": FREE}, result)
    assert mark.group == {odd, pair}
    assert mark.right_class


def test_chance_alone_has_no_size_whatever_skips_a_slot() -> None:
    """Ten draws at 28 points, a late one and two odd points among them, against 24 others."""
    generator = np.random.default_rng(5)
    sizes = []
    for _ in range(40):
        mine, free = (generator.normal(0.06, 0.003, (28, n)) for n in (10, 24))
        mine[3, 2] = free[8, 1] = 0.3
        mine[5, :4] = mine[20, :4] = 0.09
        sizes.append(gap_size(mine.tolist(), free.tolist()))
    # The reference errs too, by the root of 10/24 of one error.
    assert np.mean(sizes) < 1.1
    assert max(sizes) < 2.0
    least = np.sort(generator.normal(size=100_000) ** 2)[:90_000]
    assert pytest.approx(least.mean(), rel=0.02) == CHANCE


def test_a_gap_is_measured_in_sampling_errors() -> None:
    """A shift by s of four readings of spread s0 is s / (s0 / 2) errors."""
    spread = math.sqrt(0.05 / 3.0)
    size = gap_size([[t + 0.3 for t in FREE[0]]], FREE)
    assert size == pytest.approx(math.sqrt((0.3 / (0.5 * spread)) ** 2 - CHANCE))
    assert gap_size([[t + 0.01 for t in FREE[0]]], FREE) == 0.0
    assert gap_size([[None, None]], FREE) == math.inf


def test_wilson_interval() -> None:
    """8 of 10: 0.490 to 0.943 (Newcombe 1998, formula 3)."""
    found = share([True] * 8 + [False] * 2)
    assert (found["low"], found["high"]) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert share([])["value"] is None


def test_bootstrap_of_a_mean_has_the_width_of_its_error() -> None:
    values = [math.sin(k) for k in range(200)]
    found = mean(values)
    error = math.sqrt(sum(v * v for v in values) / 200) / math.sqrt(200)
    assert found["high"] - found["low"] == pytest.approx(3.92 * error, rel=0.1)
    assert mean([None])["n"] == 0


def test_calibration_error_of_probabilities_that_are_true_as_often_as_they_say() -> None:
    sure = [[(0.95, True)]] * 19 + [[(0.95, False)]]
    assert calibration(sure)["value"] == pytest.approx(0.0, abs=1e-12)
    assert calibration([[(0.95, False)]] * 5)["value"] == pytest.approx(0.95)


def _sealed(folder: Path) -> Path:
    """A set with made-up data, sealed as ``make`` does it."""
    for name in CASES:
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "cases" / name / "shifts.csv").write_text(f"{name}\n")
    references = {"planar_half": {"times_s": FREE}}
    text = json.dumps({"salt": "1f", "set": WHICH, "references": references, "cases": CASES})
    hashes = {name: sealed.hash_of(folder / "cases" / name) for name in CASES}
    digest = hashlib.sha256(text.encode()).hexdigest()
    (folder / "key.json").write_text(text)
    manifest = {"format": sealed.FORMAT, "set": WHICH, "cases": hashes, "key_sha256": digest}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def _diagnose(folder: Path) -> dict[str, Any]:
    result = RESULTS[folder.name]
    if "refused" in result:
        raise InputError(result["refused"])
    return result["diagnosis"]


def test_a_run_never_opens_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the key gone and every way to open it watched, all cases are diagnosed."""
    folder = _sealed(tmp_path)
    key = (folder / "key.json").read_bytes()
    (folder / "key.json").unlink()
    opened: list[str] = []
    plain = Path.open

    def watched(self: Path, *args: Any, **more: Any) -> Any:
        opened.append(self.name)
        return plain(self, *args, **more)

    monkeypatch.setattr(Path, "open", watched)
    counted: list[int] = []
    found = sealed.run(folder, _diagnose, advance=counted.append)
    assert set(found) == set(CASES)
    assert "key.json" not in opened
    assert "manifest.json" in opened
    assert sum(counted) == len(CASES)
    (folder / "key.json").write_bytes(key)
    assert score_field(folder)["cases"] == len(CASES)


def test_a_run_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)

    def stopped(case: Path) -> dict[str, Any]:
        if case.name == "case_02":
            raise KeyboardInterrupt
        return _diagnose(case)

    with pytest.raises(KeyboardInterrupt):
        sealed.run(folder, stopped)
    with pytest.raises(InputError, match=r"3 of 5 cases are not diagnosed yet.*blind run"):
        score_field(folder)
    again: list[str] = []

    def counted(case: Path) -> dict[str, Any]:
        again.append(case.name)
        return _diagnose(case)

    sealed.run(folder, counted)
    assert again == ["case_02", "case_03", "case_04"]


def test_another_key_or_other_data_are_refused(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)
    (folder / "cases" / "case_03" / "shifts.csv").write_text("better\n")
    with pytest.raises(StorageError, match="case_03 is not as it was made"):
        sealed.run(folder, _diagnose)
    (folder / "cases" / "case_03" / "shifts.csv").write_text("case_03\n")
    sealed.run(folder, _diagnose)
    text = (folder / "key.json").read_text()
    (folder / "key.json").write_text(text.replace("moving_mass", "free_play"))
    with pytest.raises(StorageError, match="not the key that was sealed"):
        score_field(folder)


def test_results_of_another_set_are_refused(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)
    sealed.run(folder, _diagnose)
    path = folder / "results" / "case_00.json"
    path.write_text(path.read_text().replace('"key_sha256": "', '"key_sha256": "0'))
    with pytest.raises(StorageError, match="another set of cases"):
        sealed.run(folder, _diagnose)


@pytest.mark.parametrize("change", [{"set": "published"}, {"format": 0}, {"cases": None}])
def test_a_manifest_of_another_kind_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    path = _sealed(tmp_path) / "manifest.json"
    manifest = json.loads(path.read_text()) | change
    path.write_text(json.dumps({k: v for k, v in manifest.items() if v is not None}))
    with pytest.raises(StorageError, match="no manifest of a field set; make it again"):
        sealed.run(tmp_path, _diagnose)
