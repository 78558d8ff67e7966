"""The score of blind cases on made-up results, and the seal."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.sim.errors import InputError, StorageError
from dogshape.validation.blind import sealed
from dogshape.validation.blind.case_marks import CHANCE, gap_size, mark_of
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import Series
from dogshape.validation.blind.intervals import calibration, mean, share
from dogshape.validation.blind.mujoco_shift import Shift
from dogshape.validation.blind.pair_refit import Seen
from dogshape.validation.blind.pair_visibility import Size
from dogshape.validation.blind.score import VISIBLE, score, scored
from dogshape.validation.blind.stand import Point, Stand

PAIR_SIZES = {
    "actuation_delay": Size(beside=40.0, before=60.0, after=30.0),
    "moving_mass": Size(beside=2.5, before=3.0, after=2.2),
}
FREE = [[0.1, 0.2, 0.3, 0.4]]


def _truth(kind: str, parameters: dict[str, Any], shift: float, **more: Any) -> dict[str, Any]:
    return {
        "kind": kind, "strength": "clear", "form": "means", "causes": sorted(parameters),
        "parameters": parameters, "outside": {}, "times_s": [[t + shift for t in FREE[0]]], **more,
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
        {"effects": list(h), "probability": p, "parameters": {}} for h, p in chances.items()
    ]
    hypotheses[0]["parameters"] = more.pop("parameters", {})
    gap = {"shrink": 0.9, "rival": ["contact_friction"], "rival_shrink": 0.6}
    record = {"verdict": verdict, "causes": causes, "hypotheses": hypotheses, "gap": gap, **more}
    return {"diagnosis": {**record, "told": record}, "time_s": 3.0}


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


def test_a_certain_and_wrong_diagnosis_is_not_calibrated() -> None:
    wrong = {n: _found({("free_play",): 1.0}, "effect", ["free_play"]) for n in CASES}
    marks = [mark_of(n, CASES[n], {"reference_s": FREE}, wrong[n]) for n in CASES]
    found = scored(marks)["all"]
    assert found["calibration_error_of_top"]["value"] == 1.0
    assert found["precision_when_named"]["value"] == 0.0
    assert found["coverage_90"]["value"] == 0.0


def _score() -> dict[str, Any]:
    key = {"reference_s": FREE}
    return scored([mark_of(n, CASES[n], key, RESULTS[n]) for n in CASES])


def test_figures_count_what_they_say() -> None:
    found = _score()
    assert found["all"]["top_1"]["value"] == pytest.approx(2 / 5)  # mass, and the refused one
    assert found["all"]["top_class"]["value"] == pytest.approx(3 / 5)
    assert found["all"]["precision_when_named"] == share([True, False])
    assert found["all"]["coverage_90"]["value"] == pytest.approx(4 / 4)
    assert found["all"]["size_90"]["value"] == pytest.approx((1 + 2 + 2 + 2) / 4)
    assert found["all"]["parameter_coverage_90"] == share([True])
    assert found["none"]["false_alarms"]["value"] == 1.0
    assert found["pairs"]["both_found"]["value"] == 0.0
    assert found["pairs"]["one_found_or_both"]["value"] == 1.0
    assert found["outside"]["recognised"]["value"] == 1.0
    assert found["outside"]["verdicts"] == {"drift": ["refused"]}
    assert found["confusion"]["sleeve_friction"] == {"viscous_damping": 1}
    assert found["time_s"]["largest"] == 3.0
    # Two are ambiguous; their records say a next test without what is foretold of it.
    assert found["advised_test"]["all"]["ambiguous"] == 2
    assert found["advised_test"]["all"]["judged"] == 0
    json.dumps(found, allow_nan=False)


def test_classes_are_those_of_the_record_and_no_reading_of_words() -> None:
    """An effect whose name has a plus, and a record that has names alone."""
    odd, pair = ("lag + play",), ("actuation_lag", "moving_mass")
    chances: dict[tuple[str, ...], float] = {odd: 0.5, pair: 0.3, (): 0.2}
    confusable = [["lag + play", "actuation_lag + moving_mass"], ["lag + play", "none"]]
    classes = [[list(odd), list(pair)]]
    truth = _truth("single", {}, 0.3, causes=list(pair))
    for more in ({"classes": classes, "confusable": [["none"]]}, {"confusable": confusable[:1]}):
        result = _found(chances, "ambiguous", [], **more)
        mark = mark_of("case_00", truth, {"reference_s": FREE}, result)
        assert mark.group == {odd, pair}
        assert mark.right_class
    # What stands beside an effect without being a hypothesis is in no class.
    alias = _found({MASS: 0.9, (): 0.1}, "effect", [], confusable=[["moving_mass", "time zero"]])
    mark = mark_of("case_00", truth, {"reference_s": FREE}, alias)
    assert mark.group == {MASS}


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
    assert np.mean(sizes) < 0.55 * VISIBLE
    assert max(sizes) < VISIBLE
    least = np.sort(generator.normal(size=100_000) ** 2)[:90_000]
    assert pytest.approx(least.mean(), rel=0.02) == CHANCE


def test_only_gaps_beyond_two_errors_are_visible() -> None:
    """A shift by s of four readings of spread s0 is s / (s0 / 2) errors."""
    spread = math.sqrt(0.05 / 3.0)
    size = gap_size([[t + 0.3 for t in FREE[0]]], FREE)
    assert size == pytest.approx(math.sqrt((0.3 / (0.5 * spread)) ** 2 - CHANCE))
    assert gap_size([[t + 0.01 for t in FREE[0]]], FREE) == 0.0
    assert gap_size([[None, None]], FREE) == math.inf
    assert _score()["visible"]["n"] == 3


def test_what_no_method_can_see_counts_apart() -> None:
    """A mass beside a delay that hides it, and friction within the sampling error."""
    key = {"reference_s": FREE}
    marks = [mark_of(n, CASES[n], key, RESULTS[n]) for n in CASES]
    seen = scored(marks, None, {"case_03": PAIR_SIZES})["all"]
    assert seen["top_class_as_seen"]["value"] == seen["top_class"]["value"]
    small = {**PAIR_SIZES, "moving_mass": Size(beside=1.5, before=3.0, after=2.2)}
    hidden = scored(marks, None, {"case_03": small})
    assert hidden["all"]["top_class_as_seen"]["value"] == pytest.approx(4 / 5)
    assert hidden["pairs_both_visible"]["n"] == 0
    assert hidden["pairs_visible_after_refit"]["n"] == 1
    done = {**PAIR_SIZES, "moving_mass": Size(beside=2.5, before=3.0, after=1.9)}
    taken_over = scored(marks, None, {"case_03": done})
    assert taken_over["pairs_both_visible"]["n"] == 1
    assert taken_over["pairs_visible_after_refit"]["n"] == 0
    none = [mark_of("case_01", CASES["case_01"], key, _found({(): 0.9, MASS: 0.1}, "none", []))]
    assert scored(none)["all"]["top_class"]["value"] == 0.0
    assert scored(none)["all"]["top_class_as_seen"]["value"] == 1.0


def test_baselines_stand_beside_the_diagnosis_on_the_same_cases() -> None:
    beside = _score()["plain"]["singles"]
    assert beside["n"] == 1
    assert (beside["diagnosis"]["value"], beside["smallest_rmse"]["value"]) == (1.0, 0.0)
    assert beside["aicc"]["value"] == 1.0
    assert beside["aicc_precision_above_0.8"]["n"] == 0


def test_shrink_of_the_true_effect_stands_apart_from_that_of_the_best_wrong_one() -> None:
    shrink = _score()["shrink"]
    assert shrink["true_where_right"]["value"] == pytest.approx(0.9)
    assert shrink["best_rival_where_right"]["value"] == pytest.approx(0.6)


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


def _not_asked(_: Path) -> Seen:
    raise AssertionError("all pairs are known")


def _sealed(folder: Path) -> Path:
    """A set with made-up data, sealed as ``make`` does it."""
    for name in CASES:
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "cases" / name / "shifts.csv").write_text(f"{name}\n")
    text = json.dumps({"salt": "1f", "reference_s": FREE, "cases": CASES})
    hashes = {name: sealed.hash_of(folder / "cases" / name) for name in CASES}
    digest = hashlib.sha256(text.encode()).hexdigest()
    (folder / "key.json").write_text(text)
    # What was simulated of the pairs for an earlier score.
    kept = {effect: asdict(size) for effect, size in PAIR_SIZES.items()}
    (folder / "partners.json").write_text(json.dumps({"key": digest, "sizes": {"case_03": kept}}))
    manifest = {"format": sealed.FORMAT, "cases": hashes, "key_sha256": digest}
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
    told: list[int] = []
    found = sealed.run(folder, _diagnose, advance=told.append)
    assert set(found) == set(CASES)
    assert "key.json" not in opened
    assert "manifest.json" in opened
    assert sum(told) == len(CASES)
    (folder / "key.json").write_bytes(key)
    found = score(folder, _not_asked)
    assert found["cases"] == len(CASES)
    assert found["pairs_both_visible"]["n"] == 1
    assert found["marks"][3]["weaker_effect_in_errors"] == 2.5
    assert found["marks"][3]["weaker_effect_after_refit_in_errors"] == 2.2
    mass = found["marks"][3]["pair"]["moving_mass"]
    assert mass["log_likelihood_ratio_after_refit"] == pytest.approx(0.5 * 2.2**2)


def test_a_run_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)

    def stopped(case: Path) -> dict[str, Any]:
        if case.name == "case_02":
            raise KeyboardInterrupt
        return _diagnose(case)

    with pytest.raises(KeyboardInterrupt):
        sealed.run(folder, stopped)
    with pytest.raises(InputError, match=r"3 of 5 cases are not diagnosed yet.*blind run"):
        score(folder, _not_asked)
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
        score(folder, _not_asked)


def test_results_of_another_set_are_refused(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)
    sealed.run(folder, _diagnose)
    path = folder / "results" / "case_00.json"
    path.write_text(path.read_text().replace('"key_sha256": "', '"key_sha256": "0'))
    with pytest.raises(StorageError, match="another set of cases"):
        sealed.run(folder, _diagnose)


def test_making_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped in the third of five cases, the same command makes the other three alone."""
    made: list[int] = []

    def simulate(stand: Stand, points: Sequence[Point], case: Case, _: str) -> Series:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(case.seed)
        times = 0.05 + 1e-9 * case.seed
        return Series(tuple(points), ((Shift(times), Shift(None)),) * len(points))

    def even_times(*_: Any) -> list[list[float | None]]:
        return FREE

    monkeypatch.setattr(sealed, "simulate", simulate)
    monkeypatch.setattr(sealed, "even_times", even_times)
    wanted = sealed.Wanted(Path("studies/bench/mq200_adams"), size="small")
    with pytest.raises(KeyboardInterrupt):
        sealed.make(tmp_path, wanted)
    assert not (tmp_path / "manifest.json").exists()
    first, made[:] = list(made), [-1] * 3  # counted from there
    manifest = sealed.make(tmp_path, wanted)
    assert len(made) - 3 + len(first) == len(manifest["cases"]) == 5
    assert not set(first) & set(made)
    # What was finished, truth too, is gone, and the key has the times of both.
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cases", "key.json", "manifest.json"]
    cases = sealed.opened(tmp_path)["cases"]
    assert all(c["times_s"][0] == [0.05 + 1e-9 * c["seed"], None] for c in cases.values())
