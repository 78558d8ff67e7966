"""Words of a diagnosis: headline, summary paragraph, and numbers with their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.inference.static_readings import gap_decrease
from dogshape.diagnosis.inference.verdict import CauseVerdict
from dogshape.diagnosis.terms import UNKNOWN, hypothesis_name, join_words
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.units import short, suffix_of, unit_of

MIN_STATED_PROBABILITY = 0.05  #: of an open effect, or of a meaning of the record
MIN_SIZED_PROBABILITY = 0.5  #: of an open effect whose size is compared with its source
MAX_OPEN_EFFECTS = 4  #: in a sentence
MIN_EXPLAINED_SHARE = 0.1  #: of the gap, below which a reading at rest is refuted as its cause
WIDE_RANGE_SHARE = 0.2  #: of its larger end, from which a range has two digits
LARGE_SIZE_RATIO = 1.5  #: of a size over the usual one, from which it is called large
#: Meanings of a record by key and value, as the clause "where ...".
RECORD_MEANINGS = {
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
    """Write the name of a parameter without its unit."""
    return name.removesuffix(suffix_of(name)).replace("_", " ")


def amount(name: str, *values: float, digits: int | None = None) -> str:
    """Write a value or range of a parameter with its unit; seconds become ms.

    Three significant digits by default, two for a wide range.
    """
    if digits is None:
        is_wide = max(values) - min(values) > WIDE_RANGE_SHARE * max(map(abs, values))
        digits = 2 if is_wide else 3
    factor = 1.0
    unit = unit_of(name)
    if suffix_of(name) == "_s":
        factor = 1e3
        unit = "ms"
    numbers = dict.fromkeys(short(factor * value, digits) for value in values)
    return f"{' to '.join(numbers)} {unit}".rstrip()


def describe_parameter(name: str, value: Interval) -> str:
    """Write a parameter with mean, 90 % interval and unit."""
    ends = amount(name, value.low, value.high)
    is_wide = value.high - value.low > WIDE_RANGE_SHARE * abs(value.mean)
    mean = amount(name, value.mean, digits=2 if is_wide else 3)
    return f"{quantity(name)} {mean} ({ends})"


def ms(seconds: float) -> str:
    """Write a time in ms."""
    return f"{1e3 * seconds:.3g} ms"


def headline_of(verdict: CauseVerdict, effects: Mapping[str, Effect]) -> str:
    """Write a verdict in a line."""
    names = join_words([effects[name].plain for name in verdict.causes])
    if verdict.kind == "effect":
        return f"{'Causes' if len(verdict.causes) > 1 else 'Cause'}: {names}"
    if verdict.kind == "none":
        return "No effect needed: the gap lies within the margin"
    if verdict.kind == "unknown":
        return "Unknown: no known effect explains the gap"
    if names:
        return f"Part of the cause: {names}; the rest is open"
    return f"Open: {hypothesis_name(verdict.credible[0], effects)} is most probable"


def summary(diagnosis: Diagnosis) -> str:
    """Write the result as one paragraph: gap, cause, refuted readings, sizes, questions."""
    gaps = diagnosis.held_out
    points = sum(gap.gap is not None for gap in diagnosis.gaps)
    sentences = [
        f"Bench and simulation differ by {ms(gaps.baseline)} (root mean square over {points} "
        f"operating point{'s' if points > 1 else ''}); chance alone leaves {ms(gaps.chance)}.",
        _cause_sentence(diagnosis),
        _refutation(diagnosis),
        *_size_sentences(diagnosis),
    ]
    answer = (diagnosis.verdict.kind, diagnosis.verdict.causes)
    for meaning in diagnosis.record_meanings:
        is_stated = meaning.probability > MIN_STATED_PROBABILITY
        if is_stated and (meaning.verdict.kind, meaning.verdict.causes) != answer:
            clause = (
                f"{RECORD_MEANINGS[meaning.key, meaning.value]} ({chance(meaning.probability)})"
            )
            headline = headline_of(meaning.verdict, diagnosis.effects)
            sentences.append(f"If {clause}, the answer is '{headline}'.")
    return " ".join(sentence for sentence in sentences if sentence)


def _cause_sentence(diagnosis: Diagnosis) -> str:
    """State the cause with its sizes, and the effects that may be part of it."""
    verdict = diagnosis.verdict
    if verdict.kind == "none":
        margin = ms(diagnosis.margin_s)
        return f"The gap without scatter is below {margin} with {chance(diagnosis.within_margin)}."
    if verdict.kind == "unknown":
        return "No known effect, alone or with others, explains all of the data."
    open_effects = join_words(_open_effects(diagnosis), "or")
    if not verdict.causes:
        return f"The cause is open: {open_effects}."
    causes = join_words([_name_with_size(diagnosis, name) for name in verdict.causes])
    if any(diagnosis.sizes.get(name) for name in verdict.causes):
        causes += " (90 % intervals over all plausible hypotheses)"
    if verdict.kind == "effect":
        return f"Cause, with {chance(diagnosis.posterior[diagnosis.leading])}: {causes}."
    return f"Part of the cause: {causes}. Open beside: {open_effects or 'nothing'}."


def _open_effects(diagnosis: Diagnosis) -> list[str]:
    """List the effects that are no named cause, nothing, and an unknown cause, with chances."""
    causes = diagnosis.verdict.causes
    effects = [(name, p) for name, p in diagnosis.inclusion.items() if name not in causes]
    effects = sorted(effects, key=lambda item: -item[1])[:MAX_OPEN_EFFECTS]
    no_more = diagnosis.posterior.get(tuple(sorted(causes)), 0.0)
    items = [(_name_with_size(diagnosis, name), p) for name, p in effects]
    items.append(("nothing more" if causes else "no effect", no_more))
    items.append(("an unknown cause", diagnosis.posterior.get(UNKNOWN, 0.0)))
    return [f"{words} ({chance(p)})" for words, p in items if p > MIN_STATED_PROBABILITY]


def _name_with_size(diagnosis: Diagnosis, name: str) -> str:
    """Write an effect's name with the ranges of its parameters."""
    sizes = []
    for key, interval in diagnosis.sizes.get(name, {}).items():
        # A number without a unit has its quantity before it.
        head = "" if unit_of(key) else f"{quantity(key)} "
        sizes.append(head + amount(key, interval.low, interval.high))
    words = ", ".join(sizes)
    preposition = "with " if words[:1].isalpha() else ""
    return f"{diagnosis.effects[name].plain} {preposition}{words}".rstrip()


def _refutation(diagnosis: Diagnosis) -> str:
    """State the parts of the gap that readings at rest explain, where these are small."""
    gap = diagnosis.held_out.baseline
    clauses = []
    for fact in diagnosis.facts:
        if fact.effect not in diagnosis.effects or fact.effect in diagnosis.verdict.causes:
            continue
        decrease = gap_decrease(fact, diagnosis.model, diagnosis.observed)
        if decrease < MIN_EXPLAINED_SHARE * gap:
            size = amount(fact.parameter, fact.value, digits=2)
            effect = diagnosis.effects[fact.effect].plain
            clauses.append(f"{effect} ({size}) explains {max(0.0, 1e3 * decrease):.0f} ms")
    if not clauses:
        return ""
    return f"Alone and as read at rest, {join_words(clauses)} of {1e3 * gap:.0f} ms."


def _size_sentences(diagnosis: Diagnosis) -> list[str]:
    """State masses also at the arm of the actuator, and sizes beyond an ordinary source.

    A mass that an arm with a known ratio moves is that at the sleeve over the ratio squared.
    """
    ratio = diagnosis.bench.sensor.linkage_ratio
    arm_clauses = []
    sentences = []
    for effect in diagnosis.sizes:
        probability = diagnosis.inclusion.get(effect, 0.0)
        if effect in diagnosis.verdict.causes:
            probability = 1.0
        if probability <= MIN_STATED_PROBABILITY:
            continue
        for parameter in diagnosis.effects[effect].parameters:
            size = diagnosis.sizes[effect][parameter.name].mean
            if suffix_of(parameter.name) == "_kg" and ratio is not None:
                arm_size = amount(parameter.name, size / ratio**2, digits=2)
                arm_clauses.append(f"{_size_clause(parameter, size)} {arm_size}")
            elif probability > MIN_SIZED_PROBABILITY:
                sentences.append(_large_size_sentence(diagnosis, effect, parameter, size))
    arm_sentence = ""
    if arm_clauses:
        arm_sentence = f"At the arm, {join_words(arm_clauses)} (ratio {ratio or 1.0:.3g} squared)."
    return [arm_sentence, *sentences]


def _size_clause(parameter: Parameter, size: float) -> str:
    """Write the size of a parameter as the head of a clause."""
    return f"{quantity(parameter.name)} of {amount(parameter.name, size, digits=2)} is"


def _large_size_sentence(
    diagnosis: Diagnosis, effect: str, parameter: Parameter, size: float
) -> str:
    """Compare a size with an ordinary source; empty for a size that is not large."""
    if parameter.ordinary is None:
        return ""
    ordinary_size, source = parameter.ordinary
    if size < LARGE_SIZE_RATIO * ordinary_size:
        return ""
    direct_tests = [t for t in diagnosis.tests if t.kind == "direct" and effect in t.effects]
    measurement = ""
    if direct_tests:
        test = min(direct_tests, key=lambda test: test.hours)
        measurement = f"; {test.name} measures it in {test.hours:.2g} h"
    clause = _size_clause(parameter, size)
    return (
        f"{clause[:1].upper()}{clause[1:]} {size / ordinary_size:.2g} times that of {source} "
        f"({amount(parameter.name, ordinary_size, digits=2)}){measurement}."
    )


def findings_record(bench: Bench) -> dict[str, Any]:
    """Write the corrections of a data set and its suspicious values as records."""
    keys = ("quantity", "found", "looks_like", "correction", "sentence")
    warnings = [{key: getattr(slip, key) for key in keys} for slip in bench.warnings]
    return {"corrections": list(bench.corrections), "warnings": warnings}
