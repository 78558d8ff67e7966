"""Words of a diagnosis: headline, summary paragraph, and numbers with their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.inference.static_readings import explained
from dogshape.diagnosis.inference.verdict import Verdict
from dogshape.diagnosis.terms import UNKNOWN, listed, plain
from dogshape.sim.effect import Effect
from dogshape.sim.units import short, suffix_of, unit_of

OPEN = 0.05  #: probability from which an open effect, or a reading of the record, is stated
LIKELY = 0.5  #: probability from which the size of an open effect is compared with its source
MOST = 4  #: open effects in a sentence
EXPLAINED = 0.1  #: share of the gap below which a reading at rest is refuted as its cause
WIDE = 0.2  #: share of its larger end from which a range has two digits
BEYOND = 1.5  #: times the usual size from which a size is called large
#: Readings of a record by key and value, as the clause "where ...".
READINGS = {
    ("time_zero", "command"): "times start with the command",
    ("time_zero", "force"): "times start with the force",
    ("sense", "as_noted"): "the rings turn in the sense of the table",
    ("sense", "reversed"): "the rings turn in the reversed sense",
    ("displacement_at", "sleeve"): "displacement is read at the sleeve",
    ("displacement_at", "actuator"): "displacement is read at the actuator",
    ("empty_cells", "not_made"): "shifts without a time were not made",
    ("empty_cells", "failed"): "shifts without a time failed",
}


def chance(probability: float) -> str:
    """Write a probability in whole percent, never 0 or 100."""
    if probability < 0.005:
        return "< 1 %"
    return f"{100.0 * probability:.0f} %" if probability <= 0.99 else "> 99 %"


def quantity(name: str) -> str:
    """Return the name of a parameter without its unit."""
    return name.removesuffix(suffix_of(name)).replace("_", " ")


def amount(name: str, *values: float, digits: int = 0) -> str:
    """Return a value or range of a parameter with its unit; seconds become ms."""
    digits = digits or 3 - (max(values) - min(values) > WIDE * max(map(abs, values)))
    factor, unit = (1e3, "ms") if suffix_of(name) == "_s" else (1.0, unit_of(name))
    shown = dict.fromkeys(short(factor * value, digits) for value in values)
    return f"{' to '.join(shown)} {unit}".rstrip()


def described(name: str, value: Interval) -> str:
    """Return a parameter with mean, 90 % interval and unit."""
    ends = amount(name, value.low, value.high)
    digits = 3 - (value.high - value.low > WIDE * abs(value.mean))
    return f"{quantity(name)} {amount(name, value.mean, digits=digits)} ({ends})"


def ms(seconds: float) -> str:
    """Return a time in ms."""
    return f"{1e3 * seconds:.3g} ms"


def headline_of(verdict: Verdict, effects: Mapping[str, Effect]) -> str:
    """Return a verdict in a line."""
    names = listed([effects[name].plain for name in verdict.causes])
    if verdict.kind == "effect":
        return f"{'Causes' if len(verdict.causes) > 1 else 'Cause'}: {names}"
    if verdict.kind == "none":
        return "No effect needed: the gap lies within the margin"
    if verdict.kind == "unknown":
        return "Unknown: no known effect explains the gap"
    if names:
        return f"Part of the cause: {names}; the rest is open"
    return f"Open: {plain(verdict.credible[0], effects)} is most probable"


def summary(found: Diagnosis) -> str:
    """Return the finding as one paragraph: gap, cause, refuted readings, sizes, questions."""
    gaps, points = found.held_out, sum(one.gap is not None for one in found.gaps)
    said = [
        f"Bench and simulation differ by {ms(gaps.baseline)} (root mean square over {points} "
        f"operating point{'s' if points > 1 else ''}); chance alone leaves {ms(gaps.chance)}.",
        _cause(found),
        _refuted(found),
        *_sizes(found),
    ]
    answer = found.verdict.kind, found.verdict.causes
    for one in found.readings:
        if one.probability > OPEN and (one.verdict.kind, one.verdict.causes) != answer:
            reading = f"{READINGS[one.key, one.value]} ({chance(one.probability)})"
            said.append(f"If {reading}, the answer is '{headline_of(one.verdict, found.effects)}'.")
    return " ".join(part for part in said if part)


def _cause(found: Diagnosis) -> str:
    """State the cause with its sizes, and the effects that may stand beside it."""
    verdict, causes = found.verdict, found.verdict.causes

    def sized(name: str) -> str:
        sizes = found.sizes.get(name, {})
        # A number without a unit has its quantity before it.
        heads = {key: "" if unit_of(key) else f"{quantity(key)} " for key in sizes}
        words = ", ".join(heads[k] + amount(k, one.low, one.high) for k, one in sizes.items())
        return f"{found.effects[name].plain} {'with ' * words[:1].isalpha()}{words}".rstrip()

    if verdict.kind == "none":
        return f"The gap without scatter is below {ms(found.margin_s)} with {chance(found.within)}."
    if verdict.kind == "unknown":
        return "No known effect, alone or with others, explains all of the data."
    parts = [(sized(n), p) for n, p in found.inclusion.items() if n not in causes]
    alone, unknown = (found.posterior.get(one, 0.0) for one in (tuple(sorted(causes)), UNKNOWN))
    rest = [("nothing more" if causes else "no effect", alone), ("an unknown cause", unknown)]
    every = [*sorted(parts, key=lambda one: -one[1])[:MOST], *rest]
    beside = [f"{words} ({chance(p)})" for words, p in every if p > OPEN]
    if not causes:
        return f"The cause is open: {listed(beside, 'or')}."
    sizes = listed([sized(name) for name in causes])
    if any(found.sizes.get(name) for name in causes):
        sizes += " (90 % intervals over all plausible hypotheses)"
    if verdict.kind == "effect":
        return f"Cause, with {chance(found.posterior[found.leading])}: {sizes}."
    return f"Part of the cause: {sizes}. Open beside: {listed(beside, 'or') or 'nothing'}."


def _refuted(found: Diagnosis) -> str:
    """State the parts of the gap that readings at rest explain, where these are next to nothing."""
    said, whole = [], found.held_out.baseline
    for fact in found.facts:
        rival = fact.effect in found.effects and fact.effect not in found.verdict.causes
        if rival and (part := explained(fact, found.model, found.seen)) < EXPLAINED * whole:
            size = amount(fact.parameter, fact.value, digits=2)
            effect = found.effects[fact.effect].plain
            said.append(f"{effect} ({size}) explains {max(0.0, 1e3 * part):.0f} ms")
    return f"Alone and as read at rest, {listed(said)} of {1e3 * whole:.0f} ms." if said else ""


def _sizes(found: Diagnosis) -> list[str]:
    """State masses also at the arm of the actuator, and sizes beyond an ordinary source.

    A mass that an arm with a known ratio moves is that at the sleeve over the ratio squared.
    """
    ratio, at_arm, large = found.bench.sensor.linkage_ratio, [], []
    for effect in found.sizes:
        share = 1.0 if effect in found.verdict.causes else found.inclusion.get(effect, 0.0)
        for parameter in found.effects[effect].parameters if share > OPEN else ():
            name, size = parameter.name, found.sizes[effect][parameter.name].mean
            said = f"{quantity(name)} of {amount(name, size, digits=2)} is"
            if suffix_of(name) == "_kg" and ratio is not None:
                at_arm.append(f"{said} {amount(name, size / ratio**2, digits=2)}")
                continue
            most, source = parameter.ordinary or (np.inf, "")
            if share <= LIKELY or size < BEYOND * most:
                continue
            direct = [t for t in found.tests if t.kind == "direct" and effect in t.effects]
            test = min(direct, key=lambda t: t.hours, default=None)
            measured = f"; {test.name} measures it in {test.hours:.2g} h" if test else ""
            large.append(
                f"{said[:1].upper()}{said[1:]} {size / most:.2g} times that of {source} "
                f"({amount(name, most, digits=2)}){measured}."
            )
    arm = f"At the arm, {listed(at_arm)} (ratio {ratio or 1.0:.3g} squared)." if at_arm else ""
    return [arm, *large]


def findings_record(bench: Bench) -> dict[str, Any]:
    """List the corrections of a data set and its suspicious values, as records."""
    keys = ("quantity", "found", "looks_like", "correction", "sentence")
    warnings = [{key: getattr(one, key) for key in keys} for one in bench.warnings]
    return {"corrections": list(bench.corrections), "warnings": warnings}
