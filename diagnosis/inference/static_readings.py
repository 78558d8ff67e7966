r"""Readings beside the shifts: facts about an effect, from the actuator at rest or a direct test.

Static readings of the actuator, displacement *x* over force *F* at the arm, lie on a line
:math:`x = x_0 + F/k` where the linkage is elastic: with its ratio *i* and efficiency :math:`\eta`
:math:`(1/k)/(i^2 \eta)` at the sleeve. The travel without force gives the ratio again,
:math:`i = x_0/\text{travel}`, and so the factor of the forces at the sleeve.

The result of a direct test (``[[measured]]``) counts with the shifts, neutral where the effect is
absent. Of *unknown* the test finds nothing, half, or anything within the range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import logsumexp

from dogshape.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.likelihood.observed import Observations
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.terms import NONE, Array, Hypothesis
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, require_known
from dogshape.sim.units import MM

MIN_READINGS = 3  #: that a line needs
SIGMAS_90 = 1.645  #: standard errors to the ends of 90 %
RANGE_VALUES = 200  #: of a range, where a test reads something unlisted


@dataclass(frozen=True)
class Fact:
    """Parameter measured without shifts, and its value without the effect, in its unit."""

    effect: str
    parameter: str
    neutral: float
    value: float
    error: float
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """Write the record of a fact, with the ends of 90 %."""
        return {
            "effect": self.effect,
            "parameter": self.parameter,
            "value": self.value,
            "sentence": self.sentence,
            "low": self.value - SIGMAS_90 * self.error,
            "high": self.value + SIGMAS_90 * self.error,
        }

    def log_density(self, values: Array) -> Array:
        """Compute the log density of the reading at values (m,) of the parameter, (m,)."""
        return np.asarray(-0.5 * ((values - self.value) / self.error) ** 2 - np.log(self.error))


def log_density(facts: Sequence[Fact], space: ParameterSpace, values: Array) -> Array:
    """Compute the log density of facts at values (m, p) of a hypothesis, (m,)."""
    parameters = [(effect.name, p.name) for effect in space.effects for p in effect.parameters]
    log = np.zeros(len(values))
    for fact in facts:
        column = np.full(len(values), fact.neutral)
        if (fact.effect, fact.parameter) in parameters:
            column = values[:, parameters.index((fact.effect, fact.parameter))]
        log += fact.log_density(column)
    return log


def log_unknown(fact: Fact, effects: Mapping[str, Effect]) -> float:
    """Compute the log density of a fact where no known effect is the cause."""
    effect = effects.get(fact.effect) or registry.load()[fact.effect]
    (parameter,) = (p for p in effect.parameters if p.name == fact.parameter)
    range_values = [parameter.at((k + 0.5) / RANGE_VALUES) for k in range(RANGE_VALUES)]
    weights = [0.5, *[0.5 / RANGE_VALUES] * RANGE_VALUES]
    logs = fact.log_density(np.array([fact.neutral, *range_values]))
    return float(logsumexp(logs, b=weights))


def facts_of(bench: Bench, min_error: float) -> tuple[Fact, ...]:
    """Derive the facts from the static readings of a data set.

    ``min_error`` is the least standard error of a value, as a share of it.
    """
    ratio = bench.sensor.linkage_ratio
    pairs = [(c.arm_force_N, c.arm_displacement_mm) for c in bench.calibration]
    readings = [(f, x) for f, x in pairs if f is not None and x is not None]
    if ratio is None or len(readings) < MIN_READINGS or np.ptp([f for f, _ in readings]) <= 0.0:
        return ()
    force, displacement = np.array(readings).T * [[1.0], [MM]]
    line, matrix = np.polyfit(force, displacement, 1, cov="unscaled")
    slope, start = map(float, line)
    square_sum = ((displacement - start - slope * force) ** 2).sum()
    scatter = float(np.sqrt(square_sum / (len(readings) - 2)))
    slope_error, start_error = (scatter * np.sqrt(np.diag(matrix))).tolist()
    force_fact = _force_fact(bench.clutch.dog.travel, ratio, start, start_error, min_error)
    if slope <= 0.0:
        return (force_fact,)
    efficiency = bench.sensor.linkage_efficiency
    fact = _compliance_fact(ratio, efficiency, slope, slope_error, min_error)
    return fact, force_fact


def _force_fact(
    travel: float, ratio: float, start: float, start_error: float, min_error: float
) -> Fact:
    """Derive the factor of the forces from the travel without force.

    ``travel`` of the sleeve, and ``start`` of the actuator with its standard error, are in m.
    """
    value = start / travel / ratio
    sentence = (
        f"without force the actuator moves {start / MM:.3g} mm for {travel / MM:.3g} mm of the "
        f"sleeve, a ratio of {start / travel:.3g} instead of {ratio:.3g}, so that forces at the "
        f"sleeve would be {value:.3g} of the nominal ones"
    )
    return Fact(
        effect="force_scale",
        parameter="force_factor",
        neutral=1.0,
        value=value,
        error=max(start_error / travel / ratio, min_error * value),
        sentence=sentence,
    )


def _compliance_fact(
    ratio: float, efficiency: float | None, slope: float, slope_error: float, min_error: float
) -> Fact:
    """Derive the compliance at the sleeve from that at the arm, ``slope``, m/N.

    It lies between the stated efficiency of the linkage and no loss.
    """
    nominal_efficiency = 1.0 if efficiency is None else efficiency
    ends = np.array([slope / ratio**2, slope / (ratio**2 * nominal_efficiency)]) * 1e6
    value = float(ends.mean())
    error = float(np.hypot(np.ptp(ends) / 12.0**0.5, value * slope_error / slope))
    sentence = (
        f"static readings of the actuator give {slope * 1e6:.3g} mm/kN at the arm, which is "
        f"{ends[0]:.3g} to {ends[1]:.3g} mm/kN at the sleeve (without loss, or with an efficiency "
        f"of {nominal_efficiency:.3g})"
    )
    return Fact(
        effect="linkage_compliance",
        parameter="compliance_mm_kN",
        neutral=0.0,
        value=value,
        error=max(error, min_error * value),
        sentence=sentence,
    )


def measured_facts(bench: Bench, effects: Mapping[str, Effect]) -> tuple[Fact, ...]:
    """List the facts of direct tests, whether their effects are in question or not.

    Raises InputError for a result that is of no effect, DataError for one of no parameter.
    """
    facts = []
    all_effects = {**registry.load(), **effects}
    for result in bench.measured:
        label = f"{bench.name}: effect in [[measured]]"
        require_known(label, result.effect, "an effect", all_effects)
        effect = all_effects[result.effect]
        names = [parameter.name for parameter in effect.parameters]
        name = result.parameter
        if not name and len(names) == 1:
            name = names[0]
        if name not in names:
            value = f"'{result.parameter}'" if result.parameter else "left out"
            raise DataError(
                f"{bench.name}: the parameter of {result.effect} in [[measured]] is {value}, but "
                f"must be one of: {', '.join(names) or 'none, as the effect has none to measure'}"
            )
        sentence = (
            f"a direct test gives {name} = {result.value:.4g} (standard error "
            f"{result.standard_error:.2g}), which counts with the shifts"
        )
        fact = Fact(
            effect=result.effect,
            parameter=name,
            neutral=effect.neutral(setting_of(bench))[name],
            value=result.value,
            error=result.standard_error,
            sentence=sentence,
        )
        facts.append(fact)
    return tuple(facts)


def gap_decrease(fact: Fact, model: Model, observed: Observations) -> float:
    """Compute the decrease of the gap by an effect of the fact's size alone, s.

    The gap is the root mean square over the operating points; the decrease is negative where it
    grows. Other parameters of the effect are neutral.
    """
    effect = model.effects[fact.effect]
    values = effect.neutral(model.setting) | {fact.parameter: fact.value}
    shares = np.array([[p.share(values[p.name]) for p in effect.parameters]])
    gap = _gap(model, NONE, np.zeros((1, 0)), observed)
    return gap - _gap(model, (fact.effect,), shares, observed)


def _gap(model: Model, hypothesis: Hypothesis, shares: Array, observed: Observations) -> float:
    """Compute the root mean square gap with a hypothesis at shares (1, p), s."""
    residual = (observed.mean - model.predict(hypothesis, shares).mean[0])[observed.count > 0]
    return float(np.sqrt((residual**2).mean()))
