"""Field sets: their cases, data, seal and score; engines and emulator are small or made up."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.field_table import headline_of, passage
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effects import load
from dogshape.sim.errors import StorageError
from dogshape.validation.blind import cases as field_cases
from dogshape.validation.blind import expected_means, field_set, figures, sealed
from dogshape.validation.blind.advised_test import Advised, Stage, more_shifts
from dogshape.validation.blind.case_marks import Mark
from dogshape.validation.blind.cases import BEYOND, COMMON, Case, case_of
from dogshape.validation.blind.data import acting, series_draws, series_places, true_points
from dogshape.validation.blind.field_set import FieldWanted, base, in_margins, make_field
from dogshape.validation.blind.score import (
    FieldMark,
    between,
    by_chance,
    headline,
    score_field,
)
from dogshape.validation.blind.stand import Truth, read_points, read_stand
from dogshape.validation.blind.true_effects import RANGES
from dogshape.validation.blind.yardstick import Seen
from tests.conftest import Said

DRAWN = FieldWanted().cases
#: As many as are kept, whichever draw of a group that is.
CASES = tuple({one.group or -k: one for k, one in enumerate(DRAWN, 1)}.values())
HALF = read_points(base("half"))


def test_a_full_set_has_what_was_asked_for() -> None:
    kinds = Counter((one.engine, one.kind) for one in CASES)
    engines = {one.engine for one in CASES}
    # docs/blind.md has these numbers.
    assert Counter(one.engine for one in CASES) == {"planar": 162, "mujoco": 79, "drake": 68}
    assert Counter(one.kind for one in CASES) == {
        "none": 108, "single": 76, "pair": 46, "three": 20, "beyond": 18, "other": 10,
        "outside": 31,
    }  # fmt: skip
    assert sum(one.form == "traces" for one in CASES if one.outside) == 6
    assert engines == {"planar", "mujoco", "drake"}
    assert {one.stand for one in CASES} == {"half", "fine", "large"}
    assert sum(kinds[engine, "none"] for engine in engines) >= 100
    assert min(kinds[engine, "none"] for engine in engines) >= 20
    for one in CASES:
        assert 6 <= len(one.places) == len(one.numbers) <= 12
        assert 3 <= min(one.numbers) <= max(one.numbers) <= 50
        assert 0.01 <= one.force_error <= 0.03
        assert 0.01 <= one.speed_error <= 0.02
    assert len({len(set(one.numbers)) > 1 for one in CASES}) >= 1
    assert sum(len(set(one.numbers)) > 1 for one in CASES) > 0.9 * len(CASES)


def test_pairs_and_threes_have_no_common_effect_and_truths_beyond_are_beyond() -> None:
    for one in CASES:
        if one.kind in ("pair", "three"):
            assert not set(COMMON) & set(one.causes)
        if one.kind == "beyond":
            ((name, values),) = one.parameters.items()
            (inside,) = (r for r in RANGES[name] if r.name == BEYOND[name][0])
            assert not inside.low <= values[inside.name] <= inside.high
    laws = {tuple(v) for one in CASES if one.kind == "other"
            for v in one.parameters.values()}  # fmt: skip
    assert laws == {("mismatch_factor",), ("force_offset_N",)}


def test_of_each_group_the_clearest_draw_is_kept() -> None:
    plain, first = CASES[0], replace(CASES[0], group=1)
    cases = {"a": replace(plain, group=0), "b": first, "c": first, "d": replace(plain, group=2)}
    yards = {"b": {"noncentrality": 1.0}, "c": {"noncentrality": 5.0}, "d": {"noncentrality": 0.0}}
    assert field_set.kept_of(cases, yards) == {"a", "c", "d"}
    counts, draws = field_cases.COUNTS, field_cases.DRAWS
    many = {
        engine: dict(mine, single=mine["single"] * len(RANGES)) for engine, mine in counts.items()
    }
    more = sum(many[e][kind] * (n - 1) for e, mine in draws.items() for kind, n in mine.items())
    assert len(DRAWN) == len(CASES) + more
    for number in {one.group for one in DRAWN if one.group}:
        mine = [one for one in DRAWN if one.group == number]
        assert len({(one.engine, one.stand, one.kind) for one in mine}) == 1
        assert len(mine) == draws[mine[0].engine][mine[0].kind]
        if mine[0].kind == "single":
            assert len({one.causes for one in mine}) == 1


def test_each_case_is_read_back_from_the_key() -> None:
    assert all(case_of(json.loads(json.dumps(one.record()))) == one for one in CASES)


def test_nominal_values_are_off_by_their_errors() -> None:
    case = Case("none", "means", 5, places=(0,) * 14, numbers=(3,) * 14,
                force_error=0.03, speed_error=0.01)  # fmt: skip
    ratios = []
    for seed in range(60):
        mine = replace(case, seed=seed)
        true = true_points(mine, HALF)
        ratios += [(t.force / p.force, t.mismatch / p.mismatch)
                   for t, p in zip(true, HALF, strict=True)]  # fmt: skip
    off = np.std(np.array(ratios) - 1.0, axis=0)
    assert off == pytest.approx([0.03, 0.01], rel=0.1)
    assert true_points(case, HALF) == true_points(case, HALF)


def test_a_drift_goes_by_the_place_in_the_series() -> None:
    case = Case("outside", "singles", 5, outside={"drift": 0.5}, places=(0, 1), numbers=(3, 5))
    fades = [d.fade for mine in series_draws(case, read_stand(base("half"))) for d in mine]
    assert fades == pytest.approx(1.0 - 0.525 * np.arange(8) / 7)
    early, middle, late = expected_means.fades_of(case)
    assert middle == pytest.approx([np.mean(fades[:3]), np.mean(fades[3:])])
    assert np.mean([early, late], axis=0) == pytest.approx(middle)
    mixed = replace(case, shuffled=True)
    assert sorted(k for mine in series_places(mixed) for k in mine) == list(range(1, 9))
    assert series_places(mixed) != series_places(case)


def test_a_drift_that_is_said_is_recognised() -> None:
    drift = {"kind": "outside", "truth": ("unknown",), "outside": ("drift",), "verdict": "none"}
    plain = FieldMark(replace(ONE, **drift), "planar", "half", 50.0, (), False)
    assert not plain.recognised
    assert replace(plain, drift=True).recognised
    assert not replace(plain, drift=True, mark=replace(plain.mark, verdict="effect")).recognised


def test_a_measured_force_is_staged_lagged_and_scaled() -> None:
    point, times = HALF[0], np.linspace(0.0, 1.0, 300)
    staged = acting(Truth(stage=0.1, stage_time=0.4), point, times)
    assert staged[times < 0.39].max() == pytest.approx(0.1 * point.force, rel=1e-6)
    assert staged[-1] == pytest.approx(point.force)
    lagged = acting(Truth(lag=0.1, force_factor=0.8), point, times)
    # Long after the rise a lag runs behind a constant force by nothing.
    assert lagged[-1] == pytest.approx(0.8 * point.force, rel=1e-2)
    assert lagged[60] < 0.8 * acting(Truth(), point, times)[60]


class _Flat:
    """An emulator of one time, whatever the hypothesis."""

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        m = len(values)
        times = np.tile(0.1 + 0.01 * np.array([-1.0, 1.0]), (m, 1))
        return Prediction.plain(times, np.ones(m), np.full(m, 1e-3), np.full(m, 1e-3))


def _seen(folder: Path, jobs: int) -> Seen:
    names = ("actuation_delay", "force_scale", "moving_mass")
    effects = {name: effect for name, effect in load(None).items() if name in names}
    return Seen(_Flat(), effects, settings_of(load_bench(folder)))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small set of the compiled engine alone at few angles, stopped once before its seal."""
    folder = tmp_path_factory.mktemp("field") / "set"
    wanted = FieldWanted("small", 3)

    def stopped(*_: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(field_cases, "COUNTS", {"planar": field_cases.COUNTS["planar"]})
        patch.setitem(expected_means.ANGLES, "planar", 4)
        whole = field_set._seal
        patch.setattr(field_set, "_seal", stopped)
        with pytest.raises(KeyboardInterrupt):
            make_field(folder, wanted, _seen)
        patch.setattr(field_set, "_seal", whole)
        patch.setattr(field_set, "simulated", stopped)  # what is finished is not made again
        make_field(folder, wanted, _seen)
    return folder


def test_a_set_that_was_stopped_is_sealed_whole(made: Path) -> None:
    manifest, key = sealed.manifest_of(made), sealed.opened(made)
    assert set(manifest["cases"]) == set(key["cases"])
    assert [one["name"] for one in manifest["figures"]] == [one.name for one in figures.HEADLINES]
    for name, case in key["cases"].items():
        assert manifest["cases"][name] == sealed.hash_of(made / "cases" / name)
        yard = case["yardstick"]
        assert ("noncentrality" in yard) == (case["kind"] != "none")
        assert yard["engine_off_in_margins"] > 0.0
        # A flat emulator can do none of it: no effect is as good a rival as any.
        assert case["kind"] == "none" or yard["noncentrality"] > 0.0
    assert not (made / "making").exists()
    with pytest.raises(StorageError, match="has a set of cases already"):
        make_field(made, FieldWanted("small", 3), _seen)


def test_data_say_nothing_of_the_truth(made: Path) -> None:
    for name, case in sealed.opened(made)["cases"].items():
        with (made / "cases" / name / "shifts.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        stated = load_bench(made / "cases" / name).errors.each_point
        assert stated.force_share == pytest.approx(case["force_error"], rel=0.01)
        assert stated.mismatch_share == pytest.approx(case["speed_error"], rel=0.01)
        points = {(row["mismatch_rpm"], row["force_N"]) for row in rows}
        grid = read_points(base(case["stand"]))
        assert len(points) == len(case["places"])
        assert {float(f) for _, f in points} <= {p.force for p in grid}
        assert sum(int(row["n_shifts"]) for row in rows) == sum(case["numbers"])
        if case["form"] == "singles":
            order = [int(row["order"]) for row in rows]
            assert sorted(order) == list(range(1, len(rows) + 1))
            assert (order == sorted(order)) != case["shuffled"]


ONE = Mark(
    "case", "single", "means", ("a",), (), 5.0, "effect", ("a",), {("a",): 0.9, (): 0.1},
    frozenset({("a",)}), (("a",),), (), ("a",), {("a",): 0.9, (): 0.1}, 1.0,
)  # fmt: skip


def _mark(noncentrality: float = 50.0, **changes: Any) -> FieldMark:
    mark = replace(ONE, **changes)
    return FieldMark(mark, "planar", "half", noncentrality, (), False, evidence=mark.chances)


def test_bands_go_by_the_yardstick() -> None:
    assert [_mark(value).band for value in (38.0, 37.9, 9.0, 8.9)] == [
        "clear", "between", "between", "hidden",
    ]  # fmt: skip
    assert _mark(0.0, kind="none").band == "none"


def test_headline_figures_of_made_up_cases() -> None:
    wrong = {"causes": ("b",), "chances": {("b",): 0.9}, "group": frozenset({("b",)})}
    outside = {"kind": "outside", "truth": ("unknown",), "outside": ("drift",)}
    alone = frozenset({("unknown",)})
    unknown = {"verdict": "unknown", "causes": (), "chances": {("unknown",): 0.9}, "group": alone}
    none = {"kind": "none", "truth": (), "verdict": "none", "causes": (), "chances": {(): 0.9}}
    marks = [
        _mark(),
        _mark(**wrong),
        _mark(20.0, **wrong),
        _mark(20.0),
        _mark(**unknown),
        _mark(**outside, **unknown),
        _mark(**outside),
        _mark(0.0, **none),
        _mark(0.0, kind="none", truth=()),
        _mark(kind="pair", truth=("a", "b"), causes=("a", "b"), chances={("a", "b"): 0.9}),
    ]
    found = {name: (one["value"], one["n"]) for name, one in headline(marks, {}).items()}
    assert found["cause_right"] == (pytest.approx(2 / 4), 4)
    # Of seven that are named those of both thirds are right, and what is outside and absent is not.
    assert found["named_right"] == (pytest.approx(3 / 7), 7)
    assert found["unknown_recognised"] == (0.5, 2)
    assert found["false_unknown"] == (0.25, 4)
    assert found["both_of_a_pair"] == (1.0, 1)
    assert found["false_alarms"] == (0.5, 2)
    assert found["none_said"] == (0.5, 2)
    assert found["named_wrongly_between"] == (0.5, 2)
    assert found["left_open"] == (None, 0)
    assert found["named_as_seen"] == found["named_right"]
    assert found["coverage_90_seen"] == found["coverage_90"]
    far = [replace(one, off=1.2) for one in marks]
    assert headline(far, {})["none_said_within"]["n"] == 0
    assert headline(marks, {})["none_said_within"]["n"] == 2


def test_what_data_cannot_show_counts_apart() -> None:
    pair = {"kind": "pair", "truth": ("a", "b")}
    marks = [
        _mark(5.0, **pair, also=(("a",),)),
        _mark(5.0, **pair),
        replace(_mark(0.0, kind="none", truth=()), power=0.95),
    ]
    marks = [replace(one, evidence={("a",): 0.6, ("a", "b"): 0.35, (): 0.05}) for one in marks]
    found = {name: (one["value"], one["n"]) for name, one in headline(marks, {}).items()}
    assert found["named_right"] == (0.0, 3)
    assert found["named_as_seen"] == (pytest.approx(1 / 3), 3)
    assert found["coverage_90"] == (0.0, 3)
    assert found["coverage_90_seen"] == (pytest.approx(1 / 3), 3)
    assert found["coverage_90_evidence"] == (pytest.approx(2 / 3), 3)
    assert found["calibration_seen"] == (pytest.approx(abs(0.9 - 1 / 3)), 3)
    assert found["calibration_evidence"] == (pytest.approx(0.6), 3)
    assert found["none_said_shown"] == (0.0, 1)


def test_of_a_truth_everything_counts_that_has_what_is_seen_of_it() -> None:
    whole = ("a", "b", "c")
    assert between([("a",)], whole) == (("a",), ("a", "b"), ("a", "c"))
    assert between([()], ("a",)) == ((),)
    assert between([whole], whole) == ()
    assert between([("a", "b"), ("a", "c")], whole) == (("a", "b"), ("a", "c"))


def test_the_advised_test_is_made_by_the_engine_of_the_case() -> None:
    right = Advised("a test", "shifts", (0.1,), ("a",), frozenset({("a",)}), {("a",): 0.9})
    wrong = replace(right, chances={("b",): 0.9})
    marks = [_mark(name="one"), _mark(name="two"), _mark(name="three")]
    part = replace(right, truth=("a", "c"), group=frozenset({("a", "c")}))
    found = headline(marks, {"one": right, "two": wrong, "three": part})
    assert (found["advice_settled"]["value"], found["advice_settled"]["n"]) == (1 / 3, 3)
    assert found["advice_wrong"]["value"] == found["advice_part"]["value"] == 1 / 3
    left = replace(marks[0], open_with_test=True)
    assert not left.cause_open  # 0.9 is settled already
    chances = {("a",): 0.6, ("b",): 0.4}
    assert replace(left, mark=replace(left.mark, chances=chances)).cause_open
    grid = base("half")
    stages = [Stage(read_stand(grid), HALF, engine) for engine in ("planar", "drake")]
    mine = [more_shifts(Truth(), stage, HALF[0], 2, 5)[0] for stage in stages]
    assert mine[0] == pytest.approx(mine[1], rel=0.2)
    assert mine[0] != mine[1]


def test_a_gap_in_margins_is_five_percent_and_two_milliseconds_at_least() -> None:
    simulated = np.array([0.1, 0.1, 0.02])
    assert in_margins(simulated + np.array([0.005, 0.005, 0.002]), simulated) == pytest.approx(1.0)
    twice = simulated + np.array([0.01, np.nan, 0.0])
    assert in_margins(twice, simulated) == pytest.approx(2.0**0.5)


def test_right_probabilities_have_a_calibration_error_by_chance() -> None:
    """Of n at p in one bin the mean distance is that of a normal one: sqrt(2 p (1-p)/(pi n))."""
    many = [_mark(chances={("a",): 0.75}) for _ in range(400)]
    assert by_chance(many) == pytest.approx(np.sqrt(2 * 0.75 * 0.25 / (np.pi * 400)), rel=0.1)


def test_aims_are_met_or_missed() -> None:
    aims = {one.name: one for one in figures.HEADLINES}
    assert aims["cause_right"].aim == "at least 95 %"
    assert aims["coverage_90"].aim == "85 to 95 %"
    assert aims["calibration"].aim == "at most 0.05"
    assert aims["left_open"].aim == ""
    assert aims["coverage_90"].met(0.97) is False
    assert aims["false_alarms"].met(0.0) is True
    assert aims["left_open"].met(0.5) is None


def test_a_score_says_by_what_code(
    made: Path, dogshape: Callable[..., Said], monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = sealed.manifest_of(made)
    (made / "results").mkdir()
    plain = {"effects": [], "probability": 1.0, "evidence_probability": 1.0}
    found = {"verdict": "none", "causes": [], "hypotheses": [plain]}
    for name in manifest["cases"]:
        record = {"key_sha256": manifest["key_sha256"], "diagnosis": found, "time_s": 1.0}
        (made / "results" / f"{name}.json").write_text(json.dumps(record))
    score = score_field(made)
    assert score["code"] == {"changed": [], "figures_as_sealed": True}
    assert score["cases"] == 4
    said = dogshape("blind", "score", made)
    assert "scored by the code and the headline figures that were sealed" in said.out
    assert "no effect: one is named" in said.out
    monkeypatch.setattr(figures, "SCORING", ("figures.py",))
    said = dogshape("blind", "score", made)
    assert (
        "scored by other code than sealed: advised_test.py, case_marks.py, intervals.py" in said.out
    )


SCORE_TEXT = """$ dogshape blind score results/field

scored by the code and the headline figures that were sealed

figure                                       value (95 %)    n          aim  met
clear: cause or its class leads       0.90 (0.80 to 0.95)   96  at least 95 %   no
calibration error of the leading one  0.04 (0.02 to 0.07)  310   at most 0.05  yes
hidden: left open                                       -    0              -    -

figure                    value (95 %)  n
drake: something   0.50 (0.10 to 0.90)  2

calibration error of right probabilities at this number of cases: 0.021
"""


def test_results_are_written_from_a_score(tmp_path: Path) -> None:
    path = tmp_path / "score.txt"
    assert passage(path) is None
    path.write_text(SCORE_TEXT)
    lines = (passage(path) or "").splitlines()
    assert (
        lines[2]
        == "| clear: cause or its class leads | 90 % (80 to 95) | 96 | at least 95 % | no |"
    )
    assert lines[3].startswith(
        "| calibration error of the leading one | 0.04 (0.02 to 0.07) | 310 |"
    )
    assert lines[4] == "| hidden: left open | - | 0 |  |  |"
    assert lines[-1] == ("Calibration error of right probabilities at this number of cases: 0.021.")
    path.write_text("nothing")
    with pytest.raises(ValueError, match="no headline figures"):
        headline_of(path)
