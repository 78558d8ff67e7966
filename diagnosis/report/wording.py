"""Finding in words without statistics: a headline, and one paragraph with units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dogshape.diagnosis.bench.input_errors import Propagated
from dogshape.diagnosis.bench.sense import REVERSED
from dogshape.diagnosis.inference.equivalence import Equivalence, Interval90
from dogshape.diagnosis.inference.held_out import HeldOut
from dogshape.diagnosis.inference.next_test import NextTest, why
from dogshape.diagnosis.inference.parameter_intervals import Interval
from dogshape.diagnosis.inference.posterior import Probabilities
from dogshape.diagnosis.inference.range_ends import RangeEnd
from dogshape.diagnosis.inference.sense_posterior import SenseAnswer
from dogshape.diagnosis.inference.series_drift import SeriesDrift
from dogshape.diagnosis.inference.verdict import NAMED, Verdict
from dogshape.diagnosis.prediction.hypotheses import NONE, in_common, plain, without
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.units import suffix_of, unit_of

Intervals = Mapping[Hypothesis, Mapping[str, Interval]]
Effects = Mapping[str, Effect]
NUMBERS = ("no", "one", "two", "three", "four", "five", "six")


@dataclass(frozen=True)
class Found:
    """Facts that are put into words; ``blind`` marks data that can show no effect."""

    verdict: Verdict
    posterior: Probabilities
    intervals: Intervals
    gaps: HeldOut
    test: NextTest
    effects: Effects
    leading: Hypothesis
    chance: float | None
    blind: bool = False
    senses: tuple[SenseAnswer, ...] = ()
    equivalence: Equivalence | None = None
    range_ends: tuple[RangeEnd, ...] = ()
    drift: SeriesDrift | None = None
    inputs: Propagated | None = None

    def named(
        self, hypotheses: Sequence[Hypothesis], *, chances: bool = False, less: Hypothesis = ()
    ) -> str:
        """Return hypotheses as people say them, with their probabilities where asked.

        ``less`` are effects that need no mention.
        """
        words = [
            ("nothing more" if less and h == less else plain(without(h, less), self.effects))
            + (f" ({chance(self.posterior[h])})" if chances else "")
            for h in hypotheses
        ]
        return ", ".join(words[:-1]) + " or " + words[-1] if len(words) > 1 else words[0]


def chance(probability: float) -> str:
    """Write a probability in whole percent, never 0 or 100."""
    if probability < 0.005:
        return "< 1 %"
    return f"{100.0 * probability:.0f} %" if probability <= 0.99 else "> 99 %"


def shown(name: str, value: float) -> tuple[float, str]:
    """Return a parameter's value and unit as people read them; seconds become ms."""
    return (1e3 * value, "ms") if suffix_of(name) == "_s" else (value, unit_of(name))


def between(name: str, low: float, high: float) -> str:
    """Return a range of a parameter with its unit."""
    unit = shown(name, low)[1]
    ends = [f"{shown(name, end)[0]:.3g}" for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {unit}".rstrip()


def quantity(name: str) -> str:
    """Return the name of a parameter without its unit."""
    return name.removesuffix(suffix_of(name)).replace("_", " ")


def described(name: str, value: Interval, of: str = "") -> str:
    """Return a parameter with its interval and unit; ``of`` says which interval it is."""
    mean, unit = shown(name, value.mean)
    amount = f"{mean:.3g} {unit}".rstrip()
    return f"{quantity(name)} {amount} ({of}{between(name, value.low, value.high)})"


def ms(seconds: float) -> str:
    """Return a time in ms."""
    return f"{1e3 * seconds:.3g} ms"


def headline(found: Found) -> str:
    """Return the verdict in a line."""
    verdict = found.verdict
    if verdict.kind == "effect":
        many = "Causes" if len(verdict.causes) > 1 else "Cause"
        return f"{many} found: {plain(verdict.causes, found.effects)}"
    if verdict.kind == "none":
        return "No effect needed: bench and simulation agree within the margin"
    if verdict.kind == "unknown":
        return "Unknown: no known effect explains the difference"
    if found.blind:
        return "Not settled: these data cannot show any effect"
    return _open_headline(found)


def _open_headline(found: Found) -> str:
    verdict, group = found.verdict, _worth(found)
    if verdict.causes and set(verdict.causes) == set(found.leading):
        return f"Likely causes: {_listed(verdict.causes, found)}"
    if verdict.causes:
        return f"Part of the cause found: {_listed(verdict.causes, found)}; the rest is open"
    if len(group) > 1 and verdict.group_probability > NAMED:
        count = NUMBERS[len(group)] if len(group) < len(NUMBERS) else str(len(group))
        what = "answers" if NONE in group else "causes"
        return f"{count.capitalize()} {what} cannot be told apart: {found.named(group[:4])}"
    likeliest = next(iter(found.posterior))
    if found.posterior[likeliest] > NAMED:
        return f"Not settled: {found.named([likeliest])} is likeliest"
    return f"Not settled: {found.named(verdict.credible[:3])}"


def _worth(found: Found) -> list[Hypothesis]:
    """Select members of the leading class for a headline: all above 0.05, or two."""
    group = sorted(found.verdict.group, key=lambda h: -found.posterior[h])
    return [h for place, h in enumerate(group) if place < 2 or found.posterior[h] > 0.05]


def in_words(found: Found) -> str:
    """Return the finding in one paragraph: how large, why, how sure, what to do next."""
    return " ".join(part for part in parts_in_words(found).values() if part)


def parts_in_words(found: Found) -> dict[str, str]:
    """Return the sentences of the paragraph by what they say; empty where there is nothing."""
    return {
        "size": _size(found),
        "cause": _cause(found),
        "beside": _beside(found),
        "sense": _senses(found),
        "left": _far(found),
        "ranges": ranges_in_words(found.range_ends, found.effects),
        "inputs": found.inputs.sentence if found.inputs else "",
        "drift": found.drift.sentence if found.drift and found.drift.worth_saying else "",
        "next": f"Next: {why(found.test, found.posterior, found.effects)}",
    }


def _size(found: Found) -> str:
    gaps = found.gaps
    if gaps.baseline is None or gaps.floor is None:
        return "There are no times to compare."
    size = (
        f"Shift times on the bench and in the simulation differ by {ms(gaps.baseline)} "
        "(root mean square over the operating points)"
    )
    # Chance has one figure: that under the leading hypothesis, where there is one.
    if found.leading != NONE and found.chance:
        return f"{size}."
    own = "where the simulation's own scatter and numerics would make"
    return f"{size}, {own} {ms(gaps.floor)}."


def _cause(found: Found) -> str:
    verdict, posterior = found.verdict, found.posterior
    if verdict.kind == "effect":
        values = found.intervals.get(verdict.causes, {})
        size = "; ".join(described(name, value, "90 % interval ") for name, value in values.items())
        return (
            f"The cause is {plain(verdict.causes, found.effects)}, with a probability of "
            f"{chance(posterior[verdict.causes])}" + (f": {size}." if size else ".")
        )
    if verdict.kind == "none":
        return _within(found)
    if verdict.kind == "unknown":
        return (
            "None of the known effects, alone or together as far as they were tried, explains all "
            "of the data."
        )
    if found.blind:
        return (
            "These data cannot show any effect: each of those known, as strong as it may be, would "
            "move them by less than two standard errors."
        )
    return _open(found)


def _within(found: Found) -> str:
    same = found.equivalence
    if same is None:
        return ""
    share, least = 100.0 * same.margin.share, ms(same.margin.least)
    likeliest = next(iter(found.posterior))
    looks = (
        f" What is left looks most like {plain(likeliest, found.effects)} "
        f"({chance(found.posterior[likeliest])}), too little of it to matter."
        if likeliest != NONE
        else ""
    )
    return (
        f"Without the scatter of the shifts the gap is {_ranged(same.gap)}. With a probability of "
        f"{chance(same.probability)} it lies within the margin, {share:.3g} % of the mean time and "
        f"at least {least} ({ms(same.margin_rms)} root mean square), below which nothing needs "
        f"doing.{looks}"
    )


def _beside(found: Found) -> str:
    """Describe what the simulation is off by beside named effects, or how large an open gap is."""
    same = found.equivalence
    if same is None or found.blind:
        return ""
    if found.verdict.kind == "ambiguous":
        return (
            f"Without the scatter of the shifts the gap is {_ranged(same.gap)}; within the margin, "
            f"where nothing needs doing, it is with {chance(same.probability)}."
        )
    if found.verdict.kind != "effect":
        return ""
    return (
        f"Beside it the simulation is off by {_ranged(same.left)}, smoothly over the operating "
        "points, as two honest simulations are."
    )


def _ranged(size: Interval90) -> str:
    return f"{ms(size.median)} (90 % interval {1e3 * size.low:.3g} to {ms(size.high)})"


def _open(found: Found) -> str:
    causes, those = found.verdict.causes, found.verdict.credible
    causes = tuple(sorted(causes))
    common = causes if set(causes) <= set(in_common(those)) else ()
    possible = found.named(those[:5], chances=True, less=common)
    more = len(those) - 5
    rest = f", and {more} more" if more > 0 else ""
    if not causes:
        return f"The data leave open why: possible are {possible}{rest}."
    verb = "are" if len(causes) > 1 else "is"
    beside = "the rest is " if common else "the data leave open: "
    named = _listed(causes, found)
    return f"{named[0].upper()}{named[1:]} {verb} part of the cause; {beside}{possible}{rest}."


def _listed(causes: Hypothesis, found: Found) -> str:
    """Return effects as a list in words."""
    return _joined([found.effects[name].plain for name in causes])


def _joined(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _senses(found: Found) -> str:
    """Describe the answer given either sense of rotation, where the sense was not noted."""
    if not found.senses:
        return ""
    given = [_given(found, one) for one in found.senses]
    return (
        "Which way the rings turned past each other was not noted, and sizes depend on it: "
        f"{'; '.join(given)}. {found.effects[REVERSED].test.how}"
    )


def _given(found: Found, one: SenseAnswer) -> str:
    """Return the most probable effects given a sense, with their sizes."""
    best = next(iter(one.posterior))
    sizes = [described(name, size) for name, size in one.sizes(best, found.intervals).items()]
    size = f": {', '.join(sizes)}" if sizes else ""
    sense = "the reversed sense" if one.reversed else "the sense of the table"
    return (
        f"with {sense} (probability {chance(one.probability)}) "
        f"{plain(best, found.effects)} ({chance(one.posterior[best])}){size}"
    )


def ranges_in_words(ends: Sequence[RangeEnd], effects: Effects) -> str:
    """Write sentences on the sizes at an end of their range, those of lone effects in one."""
    said = [range_sentence(one, effects) for one in ends if not one.alone]
    wider = [
        f"{effects[one.effect].plain} ({quantity(one.parameter.name)} "
        f"to {_size_of(one, one.moved)})"
        for one in ends
        if one.alone and one.remedy == "widened"
    ]
    if wider:
        said.append(
            "Alone, some effects would explain more beyond their range, which was widened, and the "
            f"data diagnosed again: {_joined(wider)}."
        )
    return " ".join(said)


def _size_of(one: RangeEnd, value: float) -> str:
    number, unit = shown(one.parameter.name, value)
    return f"{number:.4g} {unit}".rstrip()


def range_sentence(one: RangeEnd, effects: Effects) -> str:
    """Name sizes that lie at the end of their range, and what was done about it."""
    first = (
        f"With {effects[one.effect].plain}, {quantity(one.parameter.name)} lies at the end of the "
        f"range held possible, {_size_of(one, one.end)}, with a probability of "
        f"{chance(one.probability)}"
    )
    if one.remedy == "widened":
        wider = _size_of(one, one.moved)
        return f"{first}: the range was widened to {wider}, and the data diagnosed again."
    if one.remedy == "bound":
        return f"{first}; nothing physical lies beyond it, so the range was not widened."
    return f"{first}; it was not widened once more, so the size may lie beyond."


def _far(found: Found) -> str:
    gaps, leading = found.gaps, found.leading
    if gaps.held_out is None or not gaps.shrink or leading == NONE:
        return ""
    if found.verdict.kind == "unknown":
        nearest = plain(leading, found.effects)
        alone = f"; chance alone would leave {ms(found.chance)}" if found.chance else ""
        return f"The nearest, {nearest}, leaves {ms(gaps.held_out)} where it was not fitted{alone}."
    alone = f"; chance alone would leave {ms(found.chance)}" if found.chance else ""
    what = "it" if found.verdict.kind == "effect" else plain(leading, found.effects)
    return (
        f"With {what} in the simulation, {ms(gaps.held_out)} are left at operating points that the "
        f"fit never saw{alone}."
    )
