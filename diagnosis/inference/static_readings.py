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

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.likelihood.observed import Observed
from dogshape.diagnosis.prediction.curve import Space
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.terms import NONE, Array
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, require_known
from dogshape.sim.units import MM

LEAST = 3  #: readings that a line needs
SURE = 1.645  #: standard errors to the ends of 90 %
ANY = 200  #: values of a range that a test may find of something not listed
SPREAD = 0.05  #: share of a value by which a fact is uncertain at least


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
        """Give the record of a fact, with the ends of 90 %."""
        low, high = (self.value + sign * SURE * self.error for sign in (-1.0, 1.0))
        own = {k: v for k, v in vars(self).items() if k not in ("neutral", "error")}
        return {**own, "low": low, "high": high}

    def log_density(self, values: Array) -> Array:
        """Compute the log density of the reading at values (m,) of the parameter, (m,)."""
        return np.asarray(-0.5 * ((values - self.value) / self.error) ** 2 - np.log(self.error))


def log_density(facts: Sequence[Fact], space: Space, values: Array) -> Array:
    """Compute the log density of facts at values (m, p) of a hypothesis, (m,)."""
    own = [(e.name, p.name) for e in space.effects for p in e.parameters]
    found = np.zeros(len(values))
    for fact in facts:
        key, column = (fact.effect, fact.parameter), np.full(len(values), fact.neutral)
        found += fact.log_density(values[:, own.index(key)] if key in own else column)
    return found


def log_unknown(fact: Fact, effects: Mapping[str, Effect]) -> float:
    """Compute the log density of a fact where no known effect is the cause."""
    effect = effects.get(fact.effect) or registry.load()[fact.effect]
    (parameter,) = (p for p in effect.parameters if p.name == fact.parameter)
    values = [fact.neutral, *(parameter.at((k + 0.5) / ANY) for k in range(ANY))]
    return float(logsumexp(fact.log_density(np.array(values)), b=[0.5, *[0.5 / ANY] * ANY]))


def facts_of(bench: Bench) -> tuple[Fact, ...]:
    """Derive the facts from the static readings of a data set."""
    ratio, efficiency = bench.sensor.linkage_ratio, bench.sensor.linkage_efficiency
    pairs = [(c.arm_force_N, c.arm_displacement_mm) for c in bench.calibration]
    known = [(f, x) for f, x in pairs if f is not None and x is not None]
    if ratio is None or len(known) < LEAST or np.ptp([f for f, _ in known]) <= 0.0:
        return ()
    force, way = np.array(known).T * [[1.0], [MM]]
    line, matrix = np.polyfit(force, way, 1, cov="unscaled")
    slope, start = map(float, line)
    scatter = float(np.sqrt(((way - start - slope * force) ** 2).sum() / (len(known) - 2)))
    slope_error, start_error = (scatter * np.sqrt(np.diag(matrix))).tolist()
    given, travel = 1.0 if efficiency is None else efficiency, bench.clutch.dog.travel
    value = start / travel / ratio
    said = (
        f"without force the actuator moves {start / MM:.3g} mm for {travel / MM:.3g} mm of the "
        f"sleeve, a ratio of {start / travel:.3g} instead of {ratio:.3g}, so that forces at the "
        f"sleeve would be {value:.3g} of the nominal ones"
    )
    error = max(start_error / travel / ratio, SPREAD * value)
    scale = Fact("force_scale", "force_factor", 1.0, value, error, said)
    if slope <= 0.0:
        return (scale,)
    # The compliance at the sleeve lies between the given efficiency and none lost.
    ends = np.array([slope / ratio**2, slope / (ratio**2 * given)]) * 1e6
    value = float(ends.mean())
    spread = float(np.hypot(np.ptp(ends) / 12.0**0.5, value * slope_error / slope))
    said = (
        f"static readings of the actuator give {slope * 1e6:.3g} mm/kN at the arm, which is "
        f"{ends[0]:.3g} to {ends[1]:.3g} mm/kN at the sleeve (without loss, or with an efficiency "
        f"of {given:.3g})"
    )
    error = max(spread, SPREAD * value)
    return Fact("linkage_compliance", "compliance_mm_kN", 0.0, value, error, said), scale


def measured_facts(bench: Bench, effects: Mapping[str, Effect]) -> tuple[Fact, ...]:
    """List the facts of direct tests, whether their effects are in question or not.

    Raises InputError for a result that is of no effect, DataError for one of no parameter.
    """
    found, known = [], {**registry.load(), **effects}
    for one in bench.measured:
        require_known(f"{bench.name}: effect in [[measured]]", one.effect, "an effect", known)
        names = [parameter.name for parameter in known[one.effect].parameters]
        name = one.parameter or (names[0] if len(names) == 1 else "")
        if name not in names:
            given = f"'{one.parameter}'" if one.parameter else "left out"
            raise DataError(
                f"{bench.name}: the parameter of {one.effect} in [[measured]] is {given}, but must "
                f"be one of: {', '.join(names) or 'none, as the effect has none to measure'}"
            )
        sentence = (
            f"a direct test gives {name} = {one.value:.4g} (standard error "
            f"{one.standard_error:.2g}), which counts with the shifts"
        )
        neutral = known[one.effect].neutral(setting_of(bench))[name]
        found.append(Fact(one.effect, name, neutral, one.value, one.standard_error, sentence))
    return tuple(found)


def explained(fact: Fact, model: Model, seen: Observed) -> float:
    """Compute the decrease of the gap by an effect of the fact's size alone, s.

    That is of its root mean square over the operating points, negative where the gap grows. Other
    parameters of the effect are neutral.
    """
    effect = model.effects[fact.effect]
    values = effect.neutral(model.setting) | {fact.parameter: fact.value}
    shares = np.array([[p.share(values[p.name]) for p in effect.parameters]])
    before, after = (
        float(np.sqrt(((seen.mean - model.predict(h, some).mean[0])[seen.count > 0] ** 2).mean()))
        for h, some in ((NONE, np.zeros((1, 0))), ((fact.effect,), shares))
    )
    return before - after
