"""Influence of the operating points in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dogshape.diagnosis.inference.influence import CellInfluence, Influence
from dogshape.diagnosis.prediction.hypotheses import plain
from dogshape.diagnosis.report.wording import chance
from dogshape.sim.effect import Effect

NAMED = 3  #: operating points that a sentence names
CLEAR = 0.02  #: change of the leading probability from which a point counts as influential
Point = tuple[float, float]  #: mismatch in 1/min and force in N
#: Verdicts as a table says them.
VERDICTS: Mapping[str, str] = {
    "effect": "cause found",
    "none": "no effect needed",
    "unknown": "unknown",
    "ambiguous": "not settled",
}
#: Verdicts that name nothing.
OTHERS: Mapping[str, str] = {
    "none": "no effect would be needed",
    "unknown": "no known effect would explain the gap",
}


def influence_in_words(
    found: Influence, points: Sequence[Point], effects: Mapping[str, Effect]
) -> str:
    """Describe the points that the answer hangs on, and whether any one decides the verdict."""
    return f"{_weighty(found, points, effects)} {verdict_in_words(found, points, effects)}"


def _cell(found: Influence, place: int) -> CellInfluence:
    one = found.cells[place]
    assert one is not None
    return one


def point_name(point: Point) -> str:
    """Name an operating point by mismatch and force."""
    return f"{point[0]:.4g} 1/min and {point[1]:.4g} N".replace("-", "\N{MINUS SIGN}")


def _weighty(found: Influence, points: Sequence[Point], effects: Mapping[str, Effect]) -> str:
    """Name the points that move the probability of the leading hypothesis most."""
    name = plain(found.leading, effects)
    now, whole = chance(found.probability), found.probability
    clear = [k for k in found.ordered if abs(_cell(found, k).probability - whole) > CLEAR]
    if not clear:
        worst = min(_cell(found, k).probability for k in found.ordered)
        return (
            f"No operating point carries the answer: without any one of them the probability of "
            f"{name}, now {now}, stays {chance(worst)} or more."
        )
    said = [
        f"{point_name(points[k])} (without it {chance(_cell(found, k).probability)})"
        for k in clear[:NAMED]
    ]
    few = "hangs on" if len(clear) <= NAMED else "hangs most on"
    listed = said[0] if len(said) == 1 else f"{', '.join(said[:-1])} and {said[-1]}"
    return f"The probability of {name}, {now}, {few} {listed}."


def verdict_in_words(
    found: Influence, points: Sequence[Point], effects: Mapping[str, Effect]
) -> str:
    """Describe whether the verdict would change without any single point."""
    changing = sorted(found.changing, key=found.ordered.index)
    if not changing:
        return "The verdict is the same without any single one."
    said = [
        f"without {point_name(points[k])} {_decision(_cell(found, k), found, effects)}"
        for k in changing[:NAMED]
    ]
    more = len(changing) - len(said)
    rest = f"; and so on for {more} more" if more else ""
    return f"The verdict hangs on {_count(len(changing))}: {'; '.join(said)}{rest}."


def _count(number: int) -> str:
    return "one point" if number == 1 else f"{number} points, each by itself"


def _decision(one: CellInfluence, found: Influence, effects: Mapping[str, Effect]) -> str:
    """Describe a verdict in a few words."""
    verdict = one.verdict
    if verdict.kind in OTHERS or not verdict.causes:
        return OTHERS.get(verdict.kind, "nothing would be settled")
    causes = " and ".join(effects[name].plain for name in verdict.causes)
    if verdict.kind == "effect":
        return f"the cause would be {causes}"
    fewer = set(verdict.causes) < set(found.verdict.causes)
    return f"part of the cause would be {causes}{' alone' if fewer else ''}"
