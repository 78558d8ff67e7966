"""Verdicts on the toy bench: effects, none, unknown, aliases, and what the record holds."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest

from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.further_shifts import further_means
from dogshape.diagnosis.inference.next_test import EXACT, LEAST
from dogshape.diagnosis.inference.posterior import judged
from dogshape.diagnosis.inference.predictive_check import ADEQUATE
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, pairs_of, priors_of
from dogshape.sim.units import RPM
from tests.toy import EFFECTS, STRENGTHS, Toy, bench_of, points_of

SEPARATE = ("sleeve_friction", "moving_mass", "actuation_delay")
#: Of the toy's effects those that table data of ten shifts a point can part from each other.
FEW = ("actuation_delay", "force_scale", "moving_mass", "sleeve_friction", "drag_torque")
NO_PAIRS: list[tuple[str, ...]] = []
POINTS = points_of()


def _found(
    values: Mapping[str, float],
    names: tuple[str, ...] = FEW,
    pairs: list[tuple[str, ...]] = NO_PAIRS,
    extra: np.ndarray | None = None,
) -> Diagnosis:
    bench = bench_of(values, np.random.default_rng(1), extra=extra, shifts=20)
    return diagnose(bench, Toy(POINTS), {n: EFFECTS[n] for n in names}, pairs=pairs)


@pytest.mark.parametrize(
    ("name", "values"),
    [(name, values) for name in SEPARATE for values in STRENGTHS[name]],
    ids=str,
)
def test_an_effect_is_named_with_its_strength(name: str, values: Mapping[str, float]) -> None:
    found = _found(values)
    assert (found.verdict.kind, found.verdict.causes) == ("effect", (name,))
    for parameter, value in values.items():
        interval = found.intervals[(name,)][parameter]
        assert interval.low - 0.1 * value < value < interval.high + 0.1 * value
    assert found.before_after.shrink is not None
    assert found.before_after.shrink > 0.8


def test_no_effect_is_none_with_bounds_and_what_cannot_be_seen() -> None:
    found = _found({})
    record = found.as_dict()
    assert (found.verdict.kind, record["causes"]) == ("none", [])
    assert found.bounds["actuation_delay"].high < 0.01
    assert record["no_information"] == ["drag_torque"]
    assert not found.bounds["drag_torque"].informed


def test_data_that_can_show_no_effect_are_no_evidence_of_none() -> None:
    """Drag moves the toy's times by less than their errors, wherever in its prior it is."""
    found = _found({}, names=("drag_torque",))
    record = found.as_dict()
    assert record["no_information"] == ["drag_torque"]
    assert (record["verdict"], record["causes"]) == ("ambiguous", [])
    for text in (record["headline"], record["summary"]):
        assert "cannot show any effect" in text
    seen = _found({}, names=("drag_torque", "actuation_delay"))
    assert seen.verdict.kind == "none"
    assert "cannot show any" not in seen.as_dict()["summary"]


def test_a_wave_over_the_operating_points_is_unknown() -> None:
    found = _found({}, extra=0.04 * np.sin(1.3 * np.arange(len(POINTS))))
    assert found.verdict.kind == "unknown"
    assert found.posterior[UNKNOWN] > 0.8


def test_a_pair_is_found() -> None:
    names = ("actuation_delay", "sleeve_friction", "drag_torque")
    pairs = list(pairs_of(names))
    found = _found({"delay_s": 0.08, "friction_N": 80.0}, names, pairs)
    assert found.verdict.causes == ("actuation_delay", "sleeve_friction")


def test_where_no_pair_fits_a_third_effect_is_tried() -> None:
    names = ("actuation_delay", "sleeve_friction", "contact_friction", "drag_torque")
    rubbing = {"static_friction": 0.4, "dynamic_friction": 0.33}
    found = _found({"delay_s": 0.08, "friction_N": 80.0, **rubbing}, names, list(pairs_of(names)))
    three = ("actuation_delay", "contact_friction", "sleeve_friction")
    assert found.leading == three
    assert found.posterior[three] > 0.8
    # Three effects are never named as a whole, but each of them is part of the cause.
    assert (found.verdict.kind, set(found.verdict.causes)) == ("ambiguous", set(three))
    assert found.fits[three] > ADEQUATE
    interval = found.intervals[three]["dynamic_friction"]
    assert interval.low < 0.33 < interval.high


def test_a_pair_that_fits_is_not_given_a_third() -> None:
    names = ("actuation_delay", "sleeve_friction", "contact_friction")
    found = _found({"delay_s": 0.08, "friction_N": 80.0}, names, list(pairs_of(names)))
    assert max(len(h) for h in found.scored) == 2


def test_what_cannot_have_made_the_data_counts_as_unknown() -> None:
    folded = {NONE: 0.2, ("moving_mass",): 0.7, UNKNOWN: 0.1}
    found = judged(folded, {NONE: 0.5, ("moving_mass",): 0.1 * ADEQUATE})
    assert found == pytest.approx({UNKNOWN: 0.73, NONE: 0.2, ("moving_mass",): 0.07})
    assert next(iter(found)) == UNKNOWN


def test_an_unknown_gap_asks_for_traces_where_it_is_missed_most() -> None:
    found = _found({}, extra=0.04 * np.sin(1.3 * np.arange(len(POINTS))))
    assert found.leading != UNKNOWN
    assert found.tests[0].name.startswith("traces of 10 shifts at ")
    assert found.tests[0].information is None
    test = found.as_dict()["next_test"]
    assert "the nearest hypothesis misses the mean by" in test["why"]
    assert (test["kind"], test["shifts"], "foretold" in test) == ("traces", 10, False)


def test_a_partner_that_cannot_be_seen_takes_no_probability() -> None:
    names = ("actuation_delay", "drag_torque", "contact_stiffness", "sleeve_friction")
    found = _found({"delay_s": 0.08}, names, list(pairs_of(names)))
    assert found.posterior[("actuation_delay",)] > 0.8
    assert found.raw[("actuation_delay",)] < found.posterior[("actuation_delay",)] - 0.03


def test_aliases_stay_ambiguous_and_the_next_test_parts_them() -> None:
    # The toy's lag makes every shift later by the same, as a delay does.
    found = _found({"delay_s": 0.08}, ("actuation_delay", "actuation_lag", "moving_mass"))
    assert found.verdict.kind == "ambiguous"
    assert set(found.verdict.group) == {("actuation_delay",), ("actuation_lag",)}
    assert found.verdict.group_probability > 0.95
    record = found.as_dict()
    assert record["next_test"]["name"] == "force at the sleeve over time"
    assert ["actuation_delay", "a shifted time zero of the record"] in record["confusable"]
    assert record["classes"] == [[["actuation_delay"], ["actuation_lag"]]]
    assert ["actuation_delay", "actuation_lag"] in record["confusable"]


def test_the_next_test_says_what_each_hypothesis_foretells() -> None:
    found = _found({"delay_s": 0.08}, ("actuation_delay", "actuation_lag", "moving_mass"))
    test = json.loads(json.dumps(found.as_dict()["next_test"], allow_nan=False))
    assert (test["kind"], test["parameters"]) == ("direct", ["delay_s", "lag_s"])
    foretold = {tuple(one["effects"]): one for one in test["foretold"]}
    assert set(foretold) == {UNKNOWN, *(h for h, p in found.posterior.items() if p > LEAST)}
    delay, lag = foretold[("actuation_delay",)], foretold[("actuation_lag",)]
    assert delay["mean"] == pytest.approx([0.08 / 0.4, 0.0], abs=0.02)
    assert lag["mean"][0] == 0.0
    assert min(*delay["sd"], *lag["sd"]) == EXACT


def test_more_shifts_foretell_the_mean_of_their_operating_point() -> None:
    found = _found({"delay_s": 0.08}, ("actuation_delay", "actuation_lag", "moving_mass"))
    test = next(t for t in found.tests if t.asked.kind == "shifts").as_dict()
    place = next(
        k
        for k, cell in enumerate(found.bench.cells)
        if (cell.point.mismatch / RPM, cell.point.profile.force)
        == pytest.approx((test["mismatch_rpm"], test["force_N"]))
    )
    one = next(f for f in test["foretold"] if f["effects"] == list(found.leading))
    said = further_means(found.scored[found.leading], observe(found.bench))
    spread = np.sqrt(said.variance[place] + said.single[place] / test["shifts"])
    assert one["mean"] == pytest.approx([said.mean[place]], rel=1e-5)
    assert one["sd"] == pytest.approx([spread], rel=1e-5)


def test_the_record_keeps_the_contract_and_is_json() -> None:
    record = json.loads(json.dumps(_found({"delay_s": 0.08}).as_dict(), allow_nan=False))
    asked = {"bench", "verdict", "causes", "hypotheses", "confusable", "gap", "where", "next_test"}
    assert asked <= set(record)
    rmse = {"baseline_rmse_s", "heldout_rmse_s", "floor_rmse_s", "shrink"}
    assert rmse <= set(record["gap"])
    assert {"name", "why"} <= set(record["next_test"])
    assert all({"mismatch_rpm", "force_N", "gap_s", "z"} <= set(one) for one in record["where"])
    chances = [h["probability"] for h in record["hypotheses"]]
    assert chances == sorted(chances, reverse=True)
    assert sum(chances) == pytest.approx(1.0, abs=1e-9)
    assert ["unknown"] in [h["effects"] for h in record["hypotheses"]]
    assert [] in [h["effects"] for h in record["hypotheses"]]
    assert set(record["hypotheses"][0]["parameters"]["delay_s"]) == {"mean", "low", "high"}
    assert len(record["where"]) == len(POINTS)
    assert -1.0 <= record["gap"]["shrink"] <= 1.0
    assert {"priors_halved", "priors_doubled"} == set(record["sensitivity"])


def test_wider_priors_cost_an_effect_the_factor_that_they_are_wider() -> None:
    found = _found({"delay_s": 0.05})
    narrow, wide = (found.other[key] for key in ("priors_halved", "priors_doubled"))
    assert narrow[("actuation_delay",)] >= wide[("actuation_delay",)]


def test_priors_are_those_of_effects_that_are_there_by_themselves() -> None:
    pairs = pairs_of(sorted(EFFECTS))
    every = [NONE, UNKNOWN, *((name,) for name in EFFECTS), *pairs]
    assert sum(priors_of(every).values()) == pytest.approx(1.0)
    names = [name for name in EFFECTS if name != REVERSED]
    assert len(pairs) == len(set(pairs)) == len(names) * (len(names) - 1) // 2
    prior = priors_of(every)
    one, other, both = (
        prior[h] for h in (("axial_gap",), ("detent_force",), ("axial_gap", "detent_force"))
    )
    assert both / one == pytest.approx(other / prior[NONE])
    assert prior[("actuation_delay",)] > 5.0 * one
    # The likeliest before the data are tried first, so that the others can be left early.
    assert pairs[0] == ("actuation_delay", "sleeve_friction")
