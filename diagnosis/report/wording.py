"""Words of a diagnosis: headline, summary paragraph, and numbers with their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Diagnosis, Reading
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.inference.verdict import Verdict
from dogshape.diagnosis.terms import UNKNOWN, listed, plain
from dogshape.sim.effect import Effect
from dogshape.sim.units import suffix_of, unit_of

OPEN = 0.05  #: probability from which an open effect, or a reading of the record, is stated
LIKELY = 0.5  #: probability from which the size of an open effect is compared with its source
MOST = 4  #: open effects, or possible hypotheses, in a sentence
BEYOND = 1.5  #: times the usual size from which a size is called large
#: Readings of a record by key and value, as the clause "where ...".
READINGS = {
    ("time_zero", "command"): "times start with the command",
    ("time_zero", "force"): "times start with the force",
    ("sense", "as_noted"): "the rings turn in the sense of the table",
    ("sense", "reversed"): "the rings turn in the reversed sense",
    ("displacement_at", "sleeve"): "displacement is read at the sleeve",
    ("displacement_at", "actuator"): "displacement is read at the actuator",
}


def chance(probability: float) -> str:
    """Write a probability in whole percent, never 0 or 100."""
    if probability < 0.005:
        return "< 1 %"
    return f"{100.0 * probability:.0f} %" if probability <= 0.99 else "> 99 %"


def shown(name: str, value: float) -> tuple[float, str]:
    """Return a parameter's value and unit as people read them; seconds become ms."""
    return (1e3 * value, "ms") if suffix_of(name) == "_s" else (value, unit_of(name))


def quantity(name: str) -> str:
    """Return the name of a parameter without its unit."""
    return name.removesuffix(suffix_of(name)).replace("_", " ")


def between(name: str, low: float, high: float) -> str:
    """Return a range of a parameter with its unit."""
    unit = shown(name, low)[1]
    ends = [f"{shown(name, end)[0]:.3g}" for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {unit}".rstrip()


def described(name: str, value: Interval) -> str:
    """Return a parameter with mean, 90 % interval and unit."""
    mean, unit = shown(name, value.mean)
    amount = f"{mean:.3g} {unit}".rstrip()
    return f"{quantity(name)} {amount} ({between(name, value.low, value.high)})"


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
    more = " and others" if len(verdict.credible) > MOST else ""
    return f"Open: {listed([plain(h, effects) for h in verdict.credible[:MOST]], 'or')}{more}"


def summary(found: Diagnosis) -> str:
    """Return the finding as one paragraph: gap, cause, sizes, open questions."""
    gaps, points = found.held_out, sum(one.gap is not None for one in found.gaps)
    said = [
        f"Bench and simulation differ by {ms(gaps.baseline)} (root mean square over {points} "
        f"operating point{'s' if points > 1 else ''}), chance alone by {ms(gaps.chance)}.",
        _cause(found),
        *_large_sizes(found),
    ]
    answer = found.verdict.kind, found.verdict.causes
    for one in found.readings:
        if one.probability > OPEN and (one.verdict.kind, one.verdict.causes) != answer:
            other = headline_of(one.verdict, found.effects)
            said.append(
                f"If {reading_name(one)} ({chance(one.probability)}), the answer is: "
                f"{other[:1].lower()}{other[1:]}."
            )
    return " ".join(said)


def _cause(found: Diagnosis) -> str:
    """State the cause with its sizes, and the effects that may stand beside it."""
    verdict, causes = found.verdict, found.verdict.causes

    def sized(name: str) -> str:
        sizes = found.sizes.get(name, {})
        words = ", ".join(between(key, one.low, one.high) for key, one in sizes.items())
        return f"{found.effects[name].plain} {words}".rstrip()

    if verdict.kind == "none":
        return f"The gap without scatter is below {ms(found.margin_s)} with {chance(found.within)}."
    if verdict.kind == "unknown":
        return "No known effect, alone or with others, explains all of the data."
    open_ = [(sized(n), p) for n, p in found.inclusion.items() if n not in causes and p > OPEN]
    alone = found.posterior.get(tuple(sorted(causes)), 0.0)
    rest = [("nothing more" if causes else "no effect", alone)]
    rest.append(("an unknown cause", found.posterior.get(UNKNOWN, 0.0)))
    open_ = sorted(open_, key=lambda one: -one[1])[:MOST] + [one for one in rest if one[1] > OPEN]
    beside = [f"{words} ({chance(p)})" for words, p in open_]
    if not causes:
        return f"The cause is open. Parts and their probabilities: {listed(beside)}."
    sizes = listed([sized(name) for name in causes])
    if any(found.sizes.get(name) for name in causes):
        sizes += " (90 % intervals over all plausible hypotheses)"
    if verdict.kind == "effect":
        return f"Cause, with {chance(found.posterior[found.leading])}: {sizes}."
    return f"Part of the cause: {sizes}. Open beside: {listed(beside, 'or') or 'nothing'}."


def _large_sizes(found: Diagnosis) -> list[str]:
    """State sizes of probable effects beyond those of an ordinary source, masses at the arm."""
    large, ratio = [], found.bench.sensor.linkage_ratio or 1.0
    for effect, sizes in found.sizes.items():
        for parameter in found.effects[effect].parameters:
            name, (most, source) = parameter.name, parameter.ordinary or (np.inf, "")
            size = sizes[name].mean / (ratio**2 if suffix_of(name) == "_kg" else 1.0)
            if size > BEYOND * most and found.inclusion.get(effect, 0.0) > LIKELY:
                amounts = ["{:.2g} {}".format(*shown(name, value)) for value in (size, most)]
                large.append(
                    f"{quantity(name).capitalize()} of {amounts[0]} is {size / most:.2g} times "
                    f"that of {source} ({amounts[1]}); {found.effects[effect].test.name} "
                    "measures it."
                )
    return large


def reading_name(one: Reading) -> str:
    """Return a reading of the record as a clause."""
    words = f"{one.key.replace('_', ' ')} is {one.value.replace('_', ' ')}"
    return READINGS.get((one.key, one.value), words)


def findings_record(bench: Bench) -> dict[str, Any]:
    """List the corrections of a data set and its suspicious values, as records."""
    keys = ("quantity", "found", "looks_like", "correction", "sentence")
    return {
        "corrections": list(bench.corrections),
        "warnings": [{key: getattr(one, key) for key in keys} for one in bench.warnings],
    }
