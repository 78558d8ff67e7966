"""Explanations of figures that seem to contradict each other: a likely cause that is not named,
and odds that are even where probabilities are not.
"""

from __future__ import annotations

import math

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.classes import APART
from dogshape.diagnosis.inference.next_test import HOUR, MISLED
from dogshape.diagnosis.inference.posterior import inclusion
from dogshape.diagnosis.inference.predictive_check import ADEQUATE
from dogshape.diagnosis.inference.verdict import CREDIBLE, MODEL_FORM, MOST, NAMED, PART
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, plain
from dogshape.diagnosis.report.wording import NUMBERS, chance
from dogshape.diagnosis.terms import Hypothesis

FEW_SHIFTS, FEW_POINTS = 10, 3  #: below which a data set tells next to nothing
#: Limits of the code that the page states.
LIMITS = {
    "fit": f"{ADEQUATE:g}",
    "odds": f"{math.exp(APART):.2g} : 1",
    "named": chance(NAMED),
    "credible": chance(CREDIBLE),
    "hour": chance(HOUR),
    "misled": chance(MISLED),
}


def why_not_named(found: Diagnosis) -> str:
    """Explain why the most probable hypothesis is not called the cause.

    Empty where it is, or has too little probability for that.
    """
    top = max(found.posterior, key=lambda h: found.posterior[h])
    if found.verdict.kind != "ambiguous" or top == UNKNOWN or found.posterior[top] <= NAMED:
        return ""
    reasons = _reasons(found, top)
    those = "; and ".join(reasons) or "others may hold as well"
    what = "No effect at all" if top == NONE else "The most probable hypothesis"
    return f"{what} has {chance(found.posterior[top])} and is yet not settled: {those}."


def _reasons(found: Diagnosis, top: Hypothesis) -> list[str]:
    reasons = []
    p = found.fits.get(top, 0.0)
    if p < ADEQUATE:
        reasons.append(f"the data lie further from it than chance allows (p = {p:.2g})")
    if len(top) > MOST:
        reasons.append(
            f"of more than {NUMBERS[MOST]} effects each is named only if it is part of the cause "
            f"with more than {chance(PART)}, whatever else is"
        )
    if top == NONE and found.equivalence is not None:
        within = chance(found.equivalence.probability)
        reasons.append(f"that the gap lies within the margin has {within} only")
    form = [found.effects[name].plain for name in top if name in MODEL_FORM]
    if form:
        reasons.append(
            f"{' and '.join(form)} is a property of the simulated contact, by which simulations "
            "differ among themselves: only a direct test names it"
        )
    part = inclusion(found.posterior)
    open_ones = [name for name in top if part[name] <= PART]
    if open_ones and len(top) <= MOST:
        reasons.append(f"an effect is named from {chance(PART)}, whatever else is")
    reasons += [
        f"{found.effects[name].plain} is part of the cause with {chance(part[name])} only"
        for name in open_ones
    ]
    return reasons


def few_data(found: Diagnosis) -> str:
    """Explain that so few shifts or operating points tell next to nothing; empty of enough."""
    timed = [cell for cell in found.bench.cells if cell.n]
    shifts = sum(cell.n for cell in timed)
    if shifts >= FEW_SHIFTS and len(timed) >= FEW_POINTS:
        return ""
    made = "One shift has" if shifts == 1 else f"{shifts} shifts have"
    where = "one operating point" if len(timed) == 1 else f"{len(timed)} operating points"
    return (
        f"{made} a time, at {where}. Causes are told by how times change with mismatch and force, "
        "and by their scatter, of which so few tell next to nothing: what is said below is mostly "
        "what was held probable before. 'dogshape gap plan' says which shifts tell most."
    )


def empty_cells(found: Diagnosis) -> str:
    """Explain how operating points without a time were read, and what another reading would say.

    Empty where the data set says of every shift whether it engaged.
    """
    cells = [cell for cell in found.bench.cells if cell.unknown]
    if not cells:
        return ""
    shifts = sum(cell.unknown for cell in cells)
    points = f"{len(cells)} operating points" if len(cells) > 1 else "one operating point"
    said = (
        f"At {points} the table has {shifts} shifts without a time, and does not say whether they "
        "were tried. They are read as not measured."
    )
    failed = found.other.get("unknown_as_failed")
    if not failed:
        return said
    first = max(failed, key=lambda h: failed[h])
    same = (
        "the same would lead"
        if first == max(found.posterior, key=found.posterior.__getitem__)
        else f"{plain(first, found.effects)} would lead"
    )
    return f"{said} Read as tried and failed, {same}, with {chance(failed[first])}."


def why_alike(found: Diagnosis) -> str:
    """Explain unequal probabilities of one class of hypotheses; empty where all are even."""
    for group in found.confusion.classes:
        chances = sorted((found.posterior[h] for h in group), reverse=True)
        if len(group) > 1 and chances[0] > math.exp(APART) * chances[-1]:
            return (
                f"That one of a class has {chance(chances[0])} and another {chance(chances[-1])} "
                "is no contradiction. These odds compare the sizes with which one imitates the "
                "other best. Probabilities weigh every size that was held possible: a cause that "
                "must be tuned to a narrow range, or was less probable before the data, has less. "
                "So which of a class leads hangs on those ranges, and a test has to part them."
            )
    return ""
