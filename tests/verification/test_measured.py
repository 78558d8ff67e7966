"""Facts of an effect from readings at rest and direct tests, and what they do to a posterior."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.stand_file import Calibration, Measured, Sensor
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.inference.static_readings import (
    Fact,
    facts_of,
    gap_decrease,
    log_density,
    log_unknown,
    measured_facts,
)
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, UNKNOWN
from tests.diagnoses import EFFECTS, simulated_bench, simulated_diagnosis
from tests.fits import SETTING, space_of

DELAY = ("actuation_delay",)


def _diagnosed(*measured: Measured, advise: bool = False) -> Inference:
    """Diagnose shifts with a delay of 80 ms and some results of direct tests."""
    bench: Bench = simulated_bench({"actuation_delay": {"delay_s": 0.08}})
    return simulated_diagnosis(replace(bench, measured=measured), advise=advise)


def test_the_evidence_is_the_integral_over_shifts_and_test_together() -> None:
    """Against a fine grid of the prior, and the neutral value where the effect is absent."""
    told = Measured(effect="actuation_delay", value=0.081, standard_error=0.004)
    alone, both = _diagnosed(), _diagnosed(told)
    (fact,) = measured_facts(both.bench, EFFECTS)
    one = both.fits[DELAY]
    shares = ((np.arange(4000) + 0.5) / 4000)[:, None]
    values = one.space.values(shares)[:, 0]
    likely = both.likelihood.terms(both.model.predict(DELAY, shares)).log_likelihood
    whole = likely + fact.log_density(values)
    exact = logsumexp(whole) - np.log(4000)
    assert one.log_evidence == pytest.approx(exact, abs=4.0 * one.error + 0.02)
    mean = np.average(values, weights=np.exp(whole - whole.max()))
    assert one.intervals["delay_s"].mean == pytest.approx(mean, abs=5e-4)
    gain = both.fits[NONE].log_evidence - alone.fits[NONE].log_evidence
    assert gain == pytest.approx(float(fact.log_density(np.zeros(1))[0]))


def test_a_test_that_contradicts_the_shifts_is_for_unknown() -> None:
    """The shifts show 80 ms; the test shows 20 ms: nothing known is both."""
    other = Measured(effect="actuation_delay", value=0.02, standard_error=0.0005)
    plain, found = _diagnosed(), _diagnosed(other)
    assert plain.posterior[DELAY] > 0.8
    assert found.posterior.get(DELAY, 0.0) < 0.05
    assert found.posterior[UNKNOWN] > 10.0 * plain.posterior.get(UNKNOWN, 0.0)


def test_what_is_measured_is_a_fact_of_the_record_and_no_advice() -> None:
    told = Measured(effect="actuation_delay", value=0.08, standard_error=0.003)
    found = _diagnosed(told, advise=True)
    assert found.verdict.causes == DELAY
    (fact,) = [one for one in found.to_dict()["facts"] if one["effect"] == "actuation_delay"]
    assert fact["value"] == pytest.approx(0.08)
    assert "counts with the shifts" in fact["sentence"]
    direct = [one for one in found.tests if one.kind == "direct"]
    assert direct
    assert not any(one.effects == DELAY for one in direct)


STAND = load_bench("mq200_stand")
DRAG = Fact("drag_torque", "drag_Nm", 0.0, 1.5, 0.1, "")


def _bench(stiffness: float, ratio: float, start: float) -> Bench:
    """Return the stand with readings on a line: N/m at the arm, and m without force."""
    readings = tuple(
        Calibration(arm_displacement_mm=1e3 * (start + force / stiffness), arm_force_N=force)
        for force in (90.0, 120.0, 180.0, 250.0)
    )
    return replace(
        STAND, sensor=Sensor(linkage_ratio=ratio, linkage_efficiency=0.5), calibration=readings
    )


def test_a_line_of_known_slope_gives_its_compliance_and_ratio() -> None:
    travel = STAND.clutch.dog.travel
    compliance, scale = facts_of(_bench(1e5, 3.0, 2.4 * travel), USUAL.static_error)
    # 0.01 mm/N at the arm: over the squared ratio 1.11 mm/kN, with half the force lost 2.22.
    assert compliance.value == pytest.approx(1.5 * 10.0 / 9.0)
    assert abs(compliance.value - 10.0 / 9.0) < 2.0 * compliance.error
    assert scale.value == pytest.approx(2.4 / 3.0)
    assert (compliance.neutral, scale.neutral) == (0.0, 1.0)


def test_the_published_stand_is_as_compliant_as_its_table_says() -> None:
    """Thesis Table 2: 28.6 N/mm at the arm, 14.0 mm without force for 4.7 mm of the sleeve."""
    compliance, scale = facts_of(STAND, USUAL.static_error)
    assert "35 mm/kN at the arm" in compliance.sentence
    assert compliance.value == pytest.approx(0.5 * (1.0 / 0.233 + 1.0 / 0.291), rel=0.01)
    assert scale.value == pytest.approx(1.0 - 0.066, abs=0.001)


def test_a_fact_counts_at_its_parameter_and_where_its_effect_is_absent_at_neutral() -> None:
    """A drag of 1.5 N m beside a delay: density at each value, or at none."""
    both = space_of(("actuation_delay", "drag_torque"))
    values = np.array([[0.1, 1.5], [0.2, 1.2], [0.0, 0.0]])
    width = np.log(2.0 * np.pi) / 2.0
    found = log_density([DRAG], both, values) - width
    assert found == pytest.approx(norm.logpdf(values[:, 1], 1.5, 0.1))
    alone = log_density([DRAG, DRAG], space_of(("actuation_delay",)), values[:, :1])
    assert alone - 2.0 * width == pytest.approx([2.0 * norm.logpdf(0.0, 1.5, 0.1)] * 3)
    assert log_density([], both, values).tolist() == [0.0, 0.0, 0.0]


def test_unknown_finds_nothing_or_anything_within_the_range() -> None:
    (parameter,) = EFFECTS["actuation_delay"].parameters
    wide = parameter.high - parameter.low
    assert (parameter.scale, parameter.low) == ("uniform", 0.0)
    fact = Fact("actuation_delay", parameter.name, 0.0, 0.5 * wide, 0.01 * wide, "")
    # A narrow reading within the range has the density of the range, at its end half of it.
    inside = 0.5 / wide * np.sqrt(2.0 * np.pi)
    assert np.exp(log_unknown(fact, EFFECTS)) == pytest.approx(inside, rel=1e-3)
    absent = np.exp(log_unknown(replace(fact, value=0.0), {}))
    assert absent == pytest.approx(0.5 / fact.error + 0.5 * inside, rel=1e-3)


def _predict(hypothesis: tuple[str, ...], shares: Any) -> Any:
    """Predict 300 ms, and 10 ms more for each mm/kN at the first of two points."""
    more = 0.01 * space_of(hypothesis).values(shares)[0, 0] if hypothesis else 0.0
    return SimpleNamespace(mean=0.3 + np.array([[more, 0.0, 0.0]]))


@pytest.mark.parametrize(
    ("gaps", "part"), [((0.02, 0.138), 0.0), ((0.04, 0.0), 0.04), ((-0.03, 0.0), -0.04)]
)
def test_a_fact_alone_explains_its_part_of_the_gap(gaps: tuple[float, float], part: float) -> None:
    """4 mm/kN are 40 ms at the first point: the whole gap there, or as much too much."""
    fact = Fact("linkage_compliance", "compliance_mm_kN", 0.0, 4.0, 0.2, "")
    model: Any = SimpleNamespace(setting=SETTING, effects=EFFECTS, predict=_predict)
    seen: Any = SimpleNamespace(mean=0.3 + np.array([*gaps, 9.0]), count=np.array([10, 10, 0]))
    assert gap_decrease(fact, model, seen) == pytest.approx(part / np.sqrt(2.0), abs=1e-9)
