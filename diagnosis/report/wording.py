"""Words of a diagnosis: headline, summary, remarks, and numbers with their units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from dogshape.bench.bench_data import Bench
from dogshape.diagnosis.diagnosis import Inference, RecordMeaning
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.inference.static_readings import gap_decrease
from dogshape.diagnosis.inference.verdict import CauseVerdict
from dogshape.diagnosis.prediction.building import untried_effects
from dogshape.diagnosis.terms import NONE, UNKNOWN, hypothesis_name, join_words
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect, Parameter
from dogshape.sim.units import short, suffix_of, unit_of

MIN_STATED_PROBABILITY = 0.05  #: of an open effect, or of a meaning of the record
MIN_SIZED_PROBABILITY = 0.5  #: of an open effect whose size is compared with its source
MAX_OPEN_EFFECTS = 4  #: in a sentence
MIN_EXPLAINED_SHARE = 0.1  #: of the gap, below which a reading at rest is refuted as its cause
WIDE_RANGE_SHARE = 0.2  #: of its larger end, from which a range has two digits
MIN_BAYES_FACTOR = 3.0  #: of meanings of the record, from which the data decide between them
END_WORDS = ("its range", "their ranges")
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
        return "No effect needed"
    if verdict.kind == "unknown":
        return "Unknown: no known effect explains the gap"
    if names:
        return f"Part of the cause: {names}; the rest is open"
    return f"Open; most probable: {hypothesis_name(verdict.credible[0], effects)}"


def headline(diagnosis: Inference) -> str:
    """Write the verdict of a diagnosis in a line, with sizes of causes at an end of their range."""
    causes = diagnosis.verdict.causes
    quantities = [
        quantity(range_end.parameter)
        for range_end in diagnosis.range_ends
        if range_end.effect in causes
    ]
    line = headline_of(diagnosis.verdict, diagnosis.effects)
    if quantities:
        line += f" ({join_words(quantities)} at the end of {END_WORDS[len(quantities) > 1]})"
    return line


def summary(diagnosis: Inference) -> str:
    """Write the result in three sentences: where the gap is, which cause, how far it closes."""
    return " ".join([diagnosis.where, cause_sentence(diagnosis), shrink_sentence(diagnosis)])


def cause_sentence(diagnosis: Inference) -> str:
    """State the cause with sizes and probabilities, and the effects that may be part of it."""
    verdict = diagnosis.verdict
    if verdict.kind == "none":
        if diagnosis.within_margin > diagnosis.settings.named:
            margin = ms(diagnosis.margin_s)
            probability = chance(diagnosis.within_margin)
            return f"The gap without scatter is below {margin} with {probability}."
        return f"No effect acts, with {chance(diagnosis.posterior[NONE])}."
    if verdict.kind == "unknown":
        return "No known effect, alone or with one other, explains all of the data."
    open_effects = join_words(_open_effects(diagnosis), "or")
    if not verdict.causes:
        return f"The cause is open: {open_effects}."
    causes = join_words(
        [
            f"{_name_with_size(diagnosis, name)} ({chance(diagnosis.inclusion[name])})"
            for name in verdict.causes
        ]
    )
    if verdict.kind == "effect":
        word = "Causes" if len(verdict.causes) > 1 else "Cause"
        alone = chance(diagnosis.posterior[diagnosis.leading])
        return f"{word}: {causes}; nothing else acts, with {alone}."
    return f"Part of the cause: {causes}; open beside: {open_effects or 'nothing'}."


def shrink_sentence(diagnosis: Inference) -> str:
    """State the gap before, at points held out of the fit, and by chance, root mean square."""
    gaps = diagnosis.held_out
    points = sum(gap.gap is not None for gap in diagnosis.gaps)
    before = (
        f"The gap is {ms(gaps.baseline)} (root mean square, "
        f"{points} operating point{'s' if points > 1 else ''})"
    )
    after = ""
    if diagnosis.leading != NONE:
        name = hypothesis_name(diagnosis.leading, diagnosis.effects)
        after = f"; {ms(gaps.held_out)} are left at held-out points with {name}"
    return f"{before}{after}; chance alone leaves {ms(gaps.chance)}."


def _open_effects(diagnosis: Inference) -> list[str]:
    """List the effects that are no named cause, nothing, and an unknown cause, with chances."""
    causes = diagnosis.verdict.causes
    effects = [(name, p) for name, p in diagnosis.inclusion.items() if name not in causes]
    effects = sorted(effects, key=lambda item: -item[1])[:MAX_OPEN_EFFECTS]
    no_more = diagnosis.posterior.get(tuple(sorted(causes)), 0.0)
    items = [(_name_with_size(diagnosis, name), p) for name, p in effects]
    items.append(("nothing more" if causes else "no effect", no_more))
    items.append(("an unknown cause", diagnosis.posterior.get(UNKNOWN, 0.0)))
    return [f"{words} ({chance(p)})" for words, p in items if p > MIN_STATED_PROBABILITY]


def _name_with_size(diagnosis: Inference, name: str) -> str:
    """Write an effect's name with the ranges of its parameters."""
    sizes = []
    for key, interval in diagnosis.sizes.get(name, {}).items():
        # A number without a unit has its quantity before it.
        head = "" if unit_of(key) else f"{quantity(key)} "
        sizes.append(head + amount(key, interval.low, interval.high))
    words = ", ".join(sizes)
    preposition = "with " if words[:1].isalpha() else ""
    return f"{diagnosis.effects[name].plain} {preposition}{words}".rstrip()


def remarks(diagnosis: Inference) -> list[str]:
    """List sentences on sizes, refuted readings, and readings of the record that decide."""
    sentences = [
        *_range_end_sentences(diagnosis),
        _contact_sentence(diagnosis),
        *_ordinary_sentences(diagnosis),
        _arm_sentence(diagnosis),
        _refutation(diagnosis),
        _large_sets_sentence(diagnosis),
        *_untried_sentences(diagnosis),
    ]
    answer = (diagnosis.verdict.kind, diagnosis.verdict.causes)
    for meaning in diagnosis.record_meanings:
        is_stated = meaning.probability > MIN_STATED_PROBABILITY
        if is_stated and (meaning.verdict.kind, meaning.verdict.causes) != answer:
            clause = (
                f"{RECORD_MEANINGS[meaning.key, meaning.value]} ({chance(meaning.probability)})"
            )
            verdict = headline_of(meaning.verdict, diagnosis.effects)
            sentences.append(f"If {clause}, the answer is '{verdict}'.")
    return [sentence for sentence in sentences if sentence]


def _large_sets_sentence(diagnosis: Inference) -> str:
    """Write the probability of the sets that are too large to name a cause, '' for little."""
    settings = diagnosis.settings
    probability = sum(p for h, p in diagnosis.posterior.items() if not settings.is_nameable(h))
    if probability < MIN_STATED_PROBABILITY:
        return ""
    count = settings.named_at_once
    return f"Sets of more than {count} effects have {chance(probability)} and name no cause."


def _untried_sentences(diagnosis: Inference) -> list[str]:
    """Write which effects the actuator of the stand has no use for, a sentence each."""
    effects = {**registry.load(), **diagnosis.effects}
    return [
        f"Not tried is {effects[name].plain}: {reason}."
        for name, reason in untried_effects(diagnosis.bench, effects).items()
    ]


def answered_meanings(diagnosis: Inference) -> list[RecordMeaning]:
    """List the meanings of keys of the record that the data decide, or that decide the verdict.

    A Bayes factor below 3 is not worth more than a bare mention (Kass and Raftery 1995, J. Am.
    Stat. Assoc. 90): the probability is the prior.
    """
    answered = []
    for key in dict.fromkeys(meaning.key for meaning in diagnosis.record_meanings):
        meanings = [meaning for meaning in diagnosis.record_meanings if meaning.key == key]
        factors = [meaning.probability / meaning.prior for meaning in meanings]
        verdicts = {(m.verdict.kind, tuple(m.verdict.causes)) for m in meanings}
        if max(factors) >= MIN_BAYES_FACTOR * min(factors) or len(verdicts) > 1:
            answered += meanings
    return answered


def listed_effects(diagnosis: Inference) -> list[str]:
    """List the named effects and the plausible ones, the most probable first."""
    return [
        name
        for name, probability in diagnosis.inclusion.items()
        if probability > MIN_STATED_PROBABILITY or name in diagnosis.verdict.causes
    ]


def size_lines(diagnosis: Inference, effect: str) -> list[str]:
    """Write each parameter of an effect with mean, 90 % interval and unit."""
    lines = []
    for name, interval in diagnosis.sizes.get(effect, {}).items():
        unit = amount(name, 0.0).partition(" ")[2]
        mean, low, high = (
            amount(name, value, digits=2).partition(" ")[0]
            for value in (interval.mean, interval.low, interval.high)
        )
        lines.append(f"{quantity(name)} {mean} ({low} to {high}) {unit}".rstrip())
    return lines


def excess_lines(diagnosis: Inference, effect: str) -> list[str]:
    """List extraordinary sizes and range ends of an effect, a line for each parameter."""
    pressed = {end.parameter for end in diagnosis.range_ends if end.effect == effect}
    lines = []
    for parameter in _sized_parameters(diagnosis, effect):
        words = [_excess(parameter, diagnosis.sizes[effect][parameter.name])]
        if parameter.name in pressed:
            words.append("range end")
        lines.append(", ".join(word for word in words if word))
    return lines


def _sized_parameters(diagnosis: Inference, effect: str) -> list[Parameter]:
    """List the parameters of an effect; none where no hypothesis with the effect is fitted."""
    return [*diagnosis.effects[effect].parameters] if effect in diagnosis.sizes else []


def _is_remarked(diagnosis: Inference, effect: str) -> bool:
    """Check that an effect is a cause or so probable that its sizes are compared."""
    probability = diagnosis.inclusion.get(effect, 0.0)
    return effect in diagnosis.verdict.causes or probability > MIN_SIZED_PROBABILITY


def _excess(parameter: Parameter, size: Interval) -> str:
    """Write how far a whole interval lies beyond the ordinary range; empty for one that does not.

    A multiple of the largest ordinary size where the smallest is not stated.
    """
    ordinary = parameter.ordinary
    if ordinary is None or (ordinary.low <= size.high and size.low <= ordinary.high):
        return ""
    if math.isfinite(ordinary.low):
        return "below" if size.high < ordinary.low else "above"
    return f"{short(size.mean / ordinary.high, 2)} times"


def _ordinary_sentences(diagnosis: Inference) -> list[str]:
    """State sizes beyond an ordinary source, and the test that measures them.

    A mass behind an arm is compared at the arm, by another sentence.
    """
    sentences = []
    for effect in listed_effects(diagnosis):
        if not _is_remarked(diagnosis, effect):
            continue
        for parameter in _sized_parameters(diagnosis, effect):
            is_at_arm = suffix_of(parameter.name) == "_kg" and _arm_ratio(diagnosis) is not None
            excess = _excess(parameter, diagnosis.sizes[effect][parameter.name])
            if excess and not is_at_arm:
                sentences.append(_ordinary_sentence(diagnosis, effect, parameter, excess))
    return sentences


def _ordinary_sentence(diagnosis: Inference, effect: str, parameter: Parameter, excess: str) -> str:
    """Compare a size with its ordinary source."""
    ordinary = parameter.ordinary
    assert ordinary is not None  # it has an excess
    if excess.endswith("times"):
        limits = amount(parameter.name, ordinary.high, digits=2)
        comparison = f"{excess} that of {ordinary.source} ({limits})"
    else:
        limits = amount(parameter.name, ordinary.low, ordinary.high, digits=2)
        comparison = f"{excess} that of {ordinary.source} ({limits})"
    direct_tests = [t for t in diagnosis.tests if t.kind == "direct" and effect in t.effects]
    measurement = ""
    if direct_tests:
        test = min(direct_tests, key=lambda test: test.hours)
        measurement = f"; {test.name} measures it in {test.hours:.2g} h"
    clause = _size_clause(parameter, diagnosis.sizes[effect][parameter.name].mean)
    return f"{clause[:1].upper()}{clause[1:]} {comparison}{measurement}."


def _range_end_sentences(diagnosis: Inference) -> list[str]:
    """State the sizes that lie at an end of their range."""
    sentences = []
    for range_end in diagnosis.range_ends:
        if not _is_remarked(diagnosis, range_end.effect):
            continue
        effect = diagnosis.effects[range_end.effect].plain
        side = "less" if range_end.end == "low" else "more"
        sentences.append(
            f"{effect[:1].upper()}{effect[1:]}, {quantity(range_end.parameter)}: the data want "
            f"{side} than {amount(range_end.parameter, range_end.value)}; the list ends there."
        )
    return sentences


def _contact_sentence(diagnosis: Inference) -> str:
    """State that the contact is far from the stated one; shifts do not tell which property is."""
    if not diagnosis.odd_contact:
        return ""
    clauses = []
    for name in diagnosis.odd_contact:
        factor = diagnosis.contact[name]
        (parameter,) = diagnosis.model.nuisances[name].parameters
        known = short(diagnosis.settings.nuisance[name], 2)
        clauses.append(
            f"{quantity(parameter.name)} {short(factor.mean, 2)} times the stated one "
            f"({short(factor.low, 2)} to {short(factor.high, 2)}; known within a factor of {known})"
        )
    return (
        f"The contact of the dogs is another one: {join_words(clauses)}. Times of shifts do not "
        "tell stiffness from rebound; measure them, or look for another effect of the contact."
    )


def _arm_ratio(diagnosis: Inference) -> float | None:
    """Look up the ratio of the linkage."""
    return diagnosis.bench.sensor.linkage_ratio


def _arm_sentence(diagnosis: Inference) -> str:
    """State masses at the arm of the actuator: those at the sleeve over the ratio squared."""
    ratio = _arm_ratio(diagnosis)
    if ratio is None:
        return ""
    clauses = []
    for effect in listed_effects(diagnosis):
        for parameter in _sized_parameters(diagnosis, effect):
            if suffix_of(parameter.name) == "_kg":
                size = diagnosis.sizes[effect][parameter.name].mean
                arm_size = amount(parameter.name, size / ratio**2, digits=2)
                clauses.append(f"{_size_clause(parameter, size)} {arm_size}")
    if not clauses:
        return ""
    return f"At the arm, {join_words(clauses)} (ratio {ratio:.3g} squared)."


def _size_clause(parameter: Parameter, size: float) -> str:
    """Write the size of a parameter as the head of a clause."""
    return f"{quantity(parameter.name)} of {amount(parameter.name, size, digits=2)} is"


def _refutation(diagnosis: Inference) -> str:
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


def findings_record(bench: Bench) -> dict[str, Any]:
    """Write the corrections of a data set and its suspicious values as records."""
    keys = ("quantity", "found", "looks_like", "correction", "sentence")
    warnings = [{key: getattr(slip, key) for key in keys} for slip in bench.warnings]
    return {"corrections": list(bench.corrections), "warnings": warnings}
