"""Marks and figures of made-up results, intervals, the seal, and the verbs."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from benchmarks.field_table import headline_of, passage
from dogshape.sim.errors import InputError, StorageError
from dogshape.validation.blind import advised_test, score, sealed
from dogshape.validation.blind.advised_test import Advised
from dogshape.validation.blind.score import headline, mark_of, score_field, share
from tests.conftest import Call


def _truth(kind: str, parameters: dict[str, Any], clear: float, **changes: Any) -> dict[str, Any]:
    yardstick = {"power": 0.95} if kind == "none" else {"noncentrality": clear}
    return {
        "kind": kind, "form": "means", "engine": "planar", "causes": sorted(parameters),
        "parameters": parameters, "outside": {}, "yardstick": yardstick, **changes,
    }  # fmt: skip


PAIR = {"actuation_delay": {"delay_s": 0.1}, "moving_mass": {"added_mass_kg": 1.0}}
CASES = {
    "case_00": _truth("single", {"moving_mass": {"added_mass_kg": 2.0}}, 50.0),
    "case_01": _truth("single", {"sleeve_friction": {"friction_N": 50.0}}, 50.0),
    "case_02": _truth("none", {}, 0.0),
    "case_03": _truth("pair", PAIR, 5.0),
    "case_04": _truth("outside", {}, 50.0, causes=["unknown"], outside={"hanging_valve": 0.9}),
}
CASES["case_03"]["yardstick"]["seen_as"] = [["actuation_delay"]]


def _result(
    probabilities: dict[tuple[str, ...], float], verdict: str, causes: list[str], **changes: Any
) -> dict[str, Any]:
    hypotheses = [
        {"effects": list(h), "probability": p, "evidence_probability": p, "predictive_p": 0.4}
        for h, p in probabilities.items()
    ]
    hypotheses[0]["parameters"] = changes.pop("parameters", {})
    leading = [list(max(probabilities, key=lambda h: probabilities[h]))]
    record = {"verdict": verdict, "causes": causes, "hypotheses": hypotheses, "next_test": None}
    return {"diagnosis": {**record, "credible_set": leading, **changes}, "cpu_s": 3.0}


MASS, DELAY = ("moving_mass",), ("actuation_delay",)
RESULTS: dict[str, dict[str, Any]] = {
    "case_00": _result(
        {MASS: 0.9, (): 0.1}, "effect", ["moving_mass"],
        parameters={"added_mass_kg": {"mean": 2.1, "low": 1.5, "high": 2.5}},
    ),
    "case_01": _result(
        {("viscous_damping",): 0.6, ("sleeve_friction",): 0.35, (): 0.05}, "ambiguous", [],
        next_test={"name": "slow push"},
    ),
    "case_02": _result({MASS: 0.97, (): 0.03}, "effect", ["moving_mass"]),
    "case_03": _result({DELAY: 0.7, (*DELAY, *MASS): 0.3}, "effect", ["actuation_delay"]),
    "case_04": {"refused": "the times cannot be", "cpu_s": 1.0},
}  # fmt: skip
TEST = Advised(
    test="slow push", kind="direct", hours=1.0, top=("sleeve_friction",), probability=0.9,
    misled=False, rise=0.55, foreseen=0.25, realised=0.65, best_test="drop", best_rise=0.6,
)  # fmt: skip


def _advise(folder: Path, truth: dict[str, Any], right: Any) -> Advised:
    assert (folder.name, right[0]) == ("case_01", ("sleeve_friction",))
    return TEST


MARKS = [mark_of(Path(n), n, CASES[n], RESULTS[n], _advise) for n in CASES]


def test_figures_of_made_up_results() -> None:
    figures = {
        name: (interval["value"], interval["n"]) for name, interval in headline(MARKS).items()
    }
    assert figures["single_named"] == figures["leads"] == (0.5, 2)
    assert figures["true_names"] == (pytest.approx(2 / 3), 3)
    assert figures["whole_truth"] == (pytest.approx(1 / 3), 3)
    assert figures["whole_seen"] == (pytest.approx(2 / 3), 3)
    assert figures["wrong_sure"] == (1.0, 1)
    assert figures["false_alarms"] == (1.0, 1)
    assert figures["none_shown"] == (0.0, 1)
    assert figures["outside_silent"] == figures["unknown"] == (1.0, 1)
    assert figures["credible"] == (0.5, 4)
    assert figures["sizes"] == (1.0, 1)
    assert figures["pairs_said"] == (pytest.approx(0.7), 1)
    assert figures["test_rise"] == (0.55, 1)
    assert figures["best_rise"] == (0.6, 1)
    assert figures["test_misleads"] == (0.0, 1)
    assert figures["test_foreseen"] == (pytest.approx(-0.4), 1)
    assert figures["cpu_s"] == (3.0, 5)
    assert figures["p_median"] == (0.4, 2)


def test_a_pair_is_named_whole_or_in_part() -> None:
    truth = {**CASES["case_03"], "yardstick": {"noncentrality": 50.0}}
    results = {
        "whole": _result({(*DELAY, *MASS): 0.9, DELAY: 0.1}, "effect", [*DELAY, *MASS]),
        "part": _result({DELAY: 0.6, (*DELAY, *MASS): 0.4}, "ambiguous", [*DELAY]),
        "wrong": _result({("free_play",): 0.6, (): 0.4}, "ambiguous", ["free_play"]),
    }
    marks = [mark_of(Path(n), n, truth, result, _advise) for n, result in results.items()]
    figures = headline(marks)
    assert (figures["pair_named"]["value"], figures["pair_named"]["n"]) == (pytest.approx(1 / 3), 3)
    assert figures["pair_part"]["value"] == figures["true_names"]["value"] == pytest.approx(2 / 3)
    assert (figures["wrong_sure"]["value"], figures["wrong_sure"]["n"]) == (0.5, 2)


def test_aims() -> None:
    both = score.Headline("p", "p-value", 0.4, 0.6, percent=False)
    assert both.aim == "0.4 to 0.6"
    assert [both.meets_aim(value) for value in (0.3, 0.5, 0.7, None)] == [False, True, False, None]
    bounds = ((0.85, None), (None, 0.0), (None, None))
    aims = [score.Headline("n", "named", low, high).aim for low, high in bounds]
    assert aims == ["at least 85 %", "at most 0 %", ""]


def test_wilson_interval() -> None:
    """8 of 10: 0.490 to 0.943 (Newcombe 1998, formula 3)."""
    interval = share([True] * 8 + [False] * 2)
    assert (interval["low"], interval["high"]) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert share([])["value"] is None


def _sealed(folder: Path) -> Path:
    """A set with made-up data, sealed as ``make`` does it."""
    for name in CASES:
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "cases" / name / "shifts.csv").write_text(f"{name}\n")
    text = json.dumps({"format": sealed.FORMAT, "salt": "1f", "cases": CASES})
    (folder / "key.json").write_text(text)
    manifest = {
        "format": sealed.FORMAT,
        "cases": {name: sealed.hash_of(folder / "cases" / name) for name in CASES},
        "key_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "figures": [asdict(one) for one in score.HEADLINES],
        "scoring_sha256": score.scoring_code(),
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def _diagnose(folder: Path) -> dict[str, Any]:
    result = RESULTS[folder.name]
    if "refused" in result:
        raise InputError(result["refused"])
    return result["diagnosis"]


def test_a_run_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    folder = _sealed(tmp_path)

    def stopped(case: Path) -> dict[str, Any]:
        if case.name == "case_02":
            raise KeyboardInterrupt
        return _diagnose(case)

    with pytest.raises(KeyboardInterrupt):
        sealed.run(folder, stopped)
    with pytest.raises(InputError, match=r"3 of 5 cases are not diagnosed yet.*blind run"):
        score_field(folder, _advise)
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
        score_field(folder, _advise)


def test_verbs_run_and_score_and_results_are_written_from_the_score(
    dogshape: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advised_test, "diagnose_folder", _diagnose)
    monkeypatch.setattr(advised_test, "make_advised_test", _advise)
    folder = _sealed(tmp_path / "set")
    assert "5 of 5 cases are not diagnosed yet" in dogshape("blind", "score", folder).err
    assert "has a set of cases already" in dogshape("blind", "make", folder).err
    assert "make it with: dogshape blind make" in dogshape("blind", "run", tmp_path / "no").err
    result = dogshape("blind", "run", folder, "--jobs", 1, "--json")
    assert set(result.json["cases"]) == set(CASES)
    assert dogshape("blind", "score", folder, "--json").json["clear"] == 3
    text = dogshape("blind", "score", folder).out
    assert "scored by the code and the headline figures that were sealed" in text
    path = tmp_path / "score.txt"
    path.write_text(text)
    assert [words for words, *_ in headline_of(path)] == [
        figure.words for figure in score.HEADLINES
    ]
    row = "| clear single cause: named | 50 % (9 to 91) | 2 | at least 85 % | no | 50 % (9 to 91) |"
    assert row in passage(path, path)  # type: ignore[operator]
    unknown = dogshape("blind", "run", folder, "--method", "guess")
    assert "--method guess is unknown; give one of: diagnosis, fit" in unknown.err
    own = tmp_path / "set" / "own"
    own.mkdir()
    assert (
        "5 of 5 cases are not diagnosed yet"
        in dogshape("blind", "score", folder, "--method", "own").err
    )
    for result_path in (folder / "results").glob("*.json"):
        record = json.loads(result_path.read_text())
        for key in ("next_test", "confusable"):
            record.get("diagnosis", {}).pop(key, None)
        (own / result_path.name).write_text(json.dumps(record))
    result = dogshape("blind", "score", folder, "--method", "own", "--json").json
    figures = {row["name"]: row["figure"] for row in result["headline"]}
    assert (figures["single_named"]["value"], figures["test_rise"]["n"]) == (0.5, 0)
    monkeypatch.setattr(score, "SCORING_FILES", ("score.py",))
    result = dogshape("blind", "score", folder)
    assert "scored by other code than sealed: advised_test.py, sealed.py" in result.out
