"""The finding in words that need no statistics."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.belief import Probabilities, inclusion
from diagnosis.heldout import HeldOut
from diagnosis.hypotheses import UNKNOWN
from diagnosis.parameters import Interval
from diagnosis.spread import Hypothesis
from diagnosis.verdict import Verdict

Intervals = Mapping[Hypothesis, Mapping[str, Interval]]


def plain(hypothesis: Hypothesis) -> str:
    """Return a hypothesis as people say it."""
    if hypothesis == UNKNOWN:
        return "something that no known effect explains"
    return " together with ".join(name.replace("_", " ") for name in hypothesis) or "no effect"


def in_words(verdict: Verdict, belief: Probabilities, found: Intervals, gaps: HeldOut) -> str:
    """Return the finding in one paragraph."""
    return " ".join(
        part for part in (_size(gaps), _cause(verdict, belief, found), _far(gaps)) if part
    )


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"


def _size(gaps: HeldOut) -> str:
    if gaps.baseline is None or gaps.floor is None:
        return "There are no times to compare."
    return (
        f"Bench and simulation differ by {_ms(gaps.baseline)} (root mean square), where scatter "
        f"and numerics alone would make {_ms(gaps.floor)}."
    )


def _cause(verdict: Verdict, belief: Probabilities, found: Intervals) -> str:
    top = verdict.group[0] if verdict.group else next(iter(belief))
    if verdict.kind == "effect":
        hypothesis = tuple(verdict.causes)
        chance = f"{100.0 * belief[hypothesis]:.0f} %"
        return (
            f"The cause is {plain(hypothesis)} with a probability of {chance}"
            f"{_values(found.get(hypothesis, {}))}."
        )
    if verdict.kind == "none":
        return f"No effect is needed to explain that ({100.0 * belief[top]:.0f} %)."
    if verdict.kind == "unknown":
        return "None of the known effects, alone or in pairs, explains it."
    return _open(verdict, belief)


def _open(verdict: Verdict, belief: Probabilities) -> str:
    those = [f"{plain(h)} ({100.0 * belief[h]:.0f} %)" for h in verdict.credible[:5]]
    sure = [n.replace("_", " ") for n, p in inclusion(belief).items() if n in verdict.causes]
    part = f"{' and '.join(sure)} is part of it; " if sure else ""
    return f"The data leave open what makes it: {part}possible are {', '.join(those)}."


def _values(values: Mapping[str, Interval]) -> str:
    if not values:
        return ""
    parts = [f"{n} {v.mean:.3g} ({v.low:.3g} to {v.high:.3g})" for n, v in values.items()]
    return ": " + ", ".join(parts)


def _far(gaps: HeldOut) -> str:
    if gaps.held_out is None or gaps.shrink is None or gaps.shrink == 0.0:
        return ""
    return (
        f"At operating points that the fit never saw the difference becomes {_ms(gaps.held_out)}."
    )
