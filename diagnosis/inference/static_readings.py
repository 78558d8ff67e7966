r"""Readings beside the shifts: facts about an effect, from the actuator at rest or a direct test.

Static readings of the actuator after engagement, displacement *x* over force *F* at the arm, lie on
a line :math:`x = x_0 + F/k` where the linkage is elastic. With the linkage's ratio *i* and
efficiency :math:`\eta` a compliance at the arm is :math:`c = (1/k)/(i^2 \eta)` at the sleeve, where
forces are :math:`i \eta` times those at the arm; :math:`\eta` is at most one. The travel without
force gives the ratio again, :math:`i = x_0/\text{travel}`, and so by how much the nominal forces
at the sleeve are off.

What a direct test shows (``[[measured]]`` of the data set) counts with the shifts: the evidence of
each hypothesis is that of both, with the parameter's neutral value where the effect is absent. Of
*unknown* the test finds nothing, half, or anything within the prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.stand_file import Measured
from dogshape.diagnosis.inference.evidence import effective
from dogshape.diagnosis.inference.parameter_intervals import intervals
from dogshape.diagnosis.likelihood.scores import Scored
from dogshape.diagnosis.likelihood.time_parts import log_sum
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, did_you_mean
from dogshape.sim.units import MM

LEAST = 3  #: readings that a line needs
SURE = 1.645  #: standard errors to the ends of 90 %
ANY = 200  #: values of a prior that a test may find of something not listed
SPREAD = 0.05  #: share of a value by which a fact is uncertain at least


@dataclass(frozen=True)
class Fact:
    """A parameter of an effect measured without shifts: value and standard error, in its unit.

    ``neutral`` is what it is without the effect.
    """

    effect: str
    parameter: str
    neutral: float
    value: float
    error: float
    sentence: str

    @property
    def low(self) -> float:
        """Lower end of 90 %."""
        return self.value - SURE * self.error

    @property
    def high(self) -> float:
        """Upper end of 90 %."""
        return self.value + SURE * self.error

    def log_density(self, values: Array) -> Array:
        """Return the logarithm of the density of the reading at values (m,) of the parameter."""
        score = (values - self.value) / self.error
        return -0.5 * score**2 - np.log(self.error)


def facts_of(bench: Bench) -> tuple[Fact, ...]:
    """Derive the facts from the static readings of a data set."""
    ratio, efficiency = bench.sensor.linkage_ratio, bench.sensor.linkage_efficiency
    pairs = [(c.arm_force, c.arm_displacement) for c in bench.calibration]
    known = [(f, x) for f, x in pairs if f is not None and x is not None]
    if ratio is None or len(known) < LEAST:
        return ()
    force, way = np.array(known).T
    if np.ptp(force) <= 0.0:
        return ()
    line, matrix = np.polyfit(force, way, 1, cov="unscaled")
    slope, start = map(float, line)
    scatter = float(np.sqrt(((way - start - slope * force) ** 2).sum() / (len(known) - 2)))
    errors = (scatter * np.sqrt(np.diag(matrix))).tolist()
    given = 1.0 if efficiency is None else efficiency
    found = [_compliance(slope, errors[0], ratio, given)] if slope > 0.0 else []
    return (*found, _scale(start, errors[1], ratio, bench.clutch.dog.travel))


def _compliance(slope: float, error: float, ratio: float, efficiency: float) -> Fact:
    """Return the compliance at the sleeve, between the given efficiency and none lost."""
    ends = np.array([slope / ratio**2, slope / (ratio**2 * efficiency)]) * 1e6
    value = float(ends.mean())
    spread = float(np.hypot(np.ptp(ends) / 12.0**0.5, value * error / slope))
    sentence = (
        f"static readings of the actuator give {slope * 1e6:.3g} mm/kN at the arm, which is "
        f"{ends[0]:.3g} to {ends[1]:.3g} mm/kN at the sleeve (without loss, or with an efficiency "
        f"of {efficiency:.3g})"
    )
    error = max(spread, SPREAD * value)
    return Fact("linkage_compliance", "compliance_mm_kN", 0.0, value, error, sentence)


def _scale(start: float, error: float, ratio: float, travel: float) -> Fact:
    """Return the force over the nominal one, if the ratio is that of travels without force."""
    value = start / travel / ratio
    sentence = (
        f"without force the actuator moves {start / MM:.3g} mm for {travel / MM:.3g} mm of the "
        f"sleeve, a ratio of {start / travel:.3g} instead of {ratio:.3g}, so that forces at the "
        f"sleeve would be {value:.3g} of the nominal ones"
    )
    spread = max(error / travel / ratio, SPREAD * value)
    return Fact("force_scale", "force_factor", 1.0, value, spread, sentence)


def require_measured(bench: Bench, effects: Mapping[str, Effect]) -> None:
    """Raise DataError for the result of a direct test that is of no effect or parameter."""
    for one in bench.measured:
        if one.effect not in effects:
            hint = did_you_mean(one.effect, effects)
            raise DataError(f"{bench.name}: '{one.effect}' in [[measured]] is no effect; {hint}")
        names = [parameter.name for parameter in effects[one.effect].parameters]
        if _parameter(one, effects[one.effect]) not in names:
            given = f"'{one.parameter}'" if one.parameter else "left out"
            raise DataError(
                f"{bench.name}: the parameter of {one.effect} in [[measured]] is {given}, but must "
                f"be one of: {', '.join(names) or 'none, as the effect has none to measure'}"
            )


def measured_facts(bench: Bench, effects: Mapping[str, Effect]) -> tuple[Fact, ...]:
    """List the facts of direct tests, whether their effects are in question or not."""
    known = ((one, _effect(one.effect, effects)) for one in bench.measured)
    return tuple(_measured(bench, effect, one) for one, effect in known if effect)


def _effect(name: str, effects: Mapping[str, Effect]) -> Effect | None:
    """Find an effect in question, or else of the program's own."""
    return effects.get(name) or registry.load().get(name)


def _parameter(one: Measured, effect: Effect) -> str | None:
    names = [parameter.name for parameter in effect.parameters]
    return names[0] if one.parameter is None and len(names) == 1 else one.parameter


def _measured(bench: Bench, effect: Effect, one: Measured) -> Fact:
    name = _parameter(one, effect)
    assert name is not None, "which parameter it is is required before"
    sentence = (
        f"a direct test gives {name} = {one.value:.4g} (standard error {one.standard_error:.2g}), "
        "which counts with the shifts"
    )
    neutral = effect.neutral(setting_of(bench))[name]
    return Fact(one.effect, name, neutral, one.value, one.standard_error, sentence)


def shown(facts: Sequence[Fact]) -> frozenset[str]:
    """Return the effects that facts show to be there, beyond the errors of 90 %."""
    return frozenset(f.effect for f in facts if not f.low <= f.neutral <= f.high)


def read_directly(bench: Bench, effects: Mapping[str, Effect]) -> frozenset[str]:
    """Return the effects of readings at rest, and those that direct tests show to be there."""
    return frozenset(f.effect for f in facts_of(bench)) | shown(measured_facts(bench, effects))


def readings_in_words(
    bench: Bench, effects: Mapping[str, Effect], scored: Mapping[Hypothesis, Scored]
) -> list[tuple[Fact, str]]:
    """List all facts, each with what it tells."""
    at_rest = [(fact, against(fact, scored)) for fact in facts_of(bench)]
    return at_rest + [(fact, fact.sentence) for fact in measured_facts(bench, effects)]


def informed(
    scored: Mapping[Hypothesis, Scored], facts: Sequence[Fact]
) -> dict[Hypothesis, Scored]:
    """Return hypotheses with the evidence of shifts and facts together."""
    found = dict(scored)
    for fact in facts:
        for hypothesis, one in found.items():
            told = given(one, fact)
            if fact.effect not in hypothesis:
                # Where the data of some cells are left out it counts as well.
                found[hypothesis] = replace(told, log_prior=one.log_prior + log_neutral(fact))
                continue
            # A narrow fact leaves few of the values that were chosen for the shifts.
            few = 1.0 / effective(told.log_prior + told.rows.whole)
            found[hypothesis] = replace(told, error=math.hypot(one.error, math.sqrt(few)))
    return found


def log_unknown(fact: Fact, effects: Mapping[str, Effect]) -> float:
    """Return the logarithm of the density of a fact where nothing known is the cause."""
    effect = _effect(fact.effect, effects)
    assert effect is not None, "a fact is of an effect that there is"
    (parameter,) = (p for p in effect.parameters if p.name == fact.parameter)
    values = np.array([parameter.at(float(share)) for share in (np.arange(ANY) + 0.5) / ANY])
    anything = log_sum(fact.log_density(values), axis=0) - math.log(ANY)
    return float(np.logaddexp(log_neutral(fact), anything)) - math.log(2.0)


def given(found: Scored, fact: Fact) -> Scored:
    """Return a hypothesis with its evidence where a fact is known beside the shifts.

    Without the effect the parameter has its neutral value.
    """
    if fact.effect not in found.hypothesis:
        return replace(found, log_evidence=found.log_evidence + log_neutral(fact))
    place = [p.name for p in found.space.parameters].index(fact.parameter)
    values = found.space.values(found.rows.shares)[:, place]
    log = found.log_prior + fact.log_density(values)
    return replace(found, log_prior=log).with_table(found.rows.log_likelihood)


def log_neutral(fact: Fact) -> float:
    """Return the logarithm of the density of a fact where its effect is absent."""
    return float(fact.log_density(np.array([fact.neutral]))[0])


def against(fact: Fact, scored: Mapping[Hypothesis, Scored]) -> str:
    """Describe the agreement of a fact with the values that the effect alone would need."""
    alone = scored.get((fact.effect,))
    if alone is None:
        return fact.sentence
    needed = intervals(alone)[fact.parameter]
    ends = f"{needed.low:.3g} to {needed.high:.3g}"
    agrees = needed.low <= fact.high and fact.low <= needed.high
    how = "which agrees with" if agrees else "which contradicts"
    name = fact.effect.replace("_", " ")
    return f"{fact.sentence}; {how} the {ends} that {name} alone would need"
