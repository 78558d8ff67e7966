"""Hypotheses as the report shows them: names, sizes, reasons and doubts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.predictive_check import ADEQUATE
from dogshape.diagnosis.inference.static_readings import facts_of
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, plain
from dogshape.diagnosis.report.wording import between, chance, described, ms, quantity
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.diagnose.extras import Remark

MOST = 8  #: hypotheses with a line of their own
LEAST = 0.005  #: probability below which one has none
END = 0.05  #: share of a prior that counts as its end
MANY = 1000.0  #: odds above which only that is said


@dataclass(frozen=True)
class Answer:
    """One hypothesis in words; ``p_value`` is None where it was not worth to look."""

    name: str
    probability: float
    inside: bool
    sizes: tuple[str, ...]
    p_value: float | None
    reasons: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def fit(self) -> str:
        """Whether the data may be the hypothesis's own, in a word; empty where nobody looked."""
        if self.p_value is None:
            return ""
        return "yes" if self.p_value >= ADEQUATE else "no"

    @property
    def chance(self) -> str:
        """Probability in percent."""
        return chance(self.probability)


def shown_hypotheses(found: Diagnosis) -> list[Hypothesis]:
    """Select the hypotheses that are worth a line, most probable first."""
    worth = [h for h, p in found.posterior.items() if p >= LEAST or h in found.verdict.credible]
    # Where no known effect fits, the nearest one is shown too.
    return list(dict.fromkeys([*worth[:MOST], found.leading]))


def answers_of(found: Diagnosis, remarks: Sequence[Remark]) -> list[Answer]:
    """Describe the most probable hypotheses in words."""
    return [_answer(found, hypothesis, remarks) for hypothesis in shown_hypotheses(found)]


def short(found: Diagnosis, hypothesis: Hypothesis) -> str:
    """Name a hypothesis for an axis, a line for each effect."""
    if hypothesis == UNKNOWN:
        return "unknown: no known effect"
    names = [found.effects[name].plain for name in hypothesis]
    return ",<br>".join(names) or plain(hypothesis, found.effects)


def by_chance(found: Diagnosis) -> tuple[str, float | None]:
    """Return the gap by chance alone, were the leading hypothesis true: name and s."""
    if found.leading == NONE or found.chance is None:
        return "scatter and numerics alone", found.before_after.floor
    return "chance alone", found.chance


def _answer(found: Diagnosis, hypothesis: Hypothesis, remarks: Sequence[Remark]) -> Answer:
    mine = [remark for remark in remarks if remark.effect in hypothesis]
    reasons, doubts = _from_data(found, hypothesis)
    return Answer(
        plain(hypothesis, found.effects),
        found.posterior[hypothesis],
        hypothesis in found.verdict.credible,
        tuple(described(n, i) for n, i in found.intervals.get(hypothesis, {}).items()),
        found.fits.get(hypothesis),
        (*reasons, *(r.sentence for r in mine if r.speaks == "for")),
        (*doubts, *(r.sentence for r in mine if r.speaks == "against")),
    )


def _from_data(found: Diagnosis, hypothesis: Hypothesis) -> tuple[list[str], list[str]]:
    """List reasons for a hypothesis in the data, and doubts."""
    said = [
        _odds(found, hypothesis),
        _fit(found, hypothesis),
        _far(found, hypothesis),
        _alike(found, hypothesis),
        _ends(found, hypothesis),
        *_at_rest(found, hypothesis),
    ]
    reasons = [words for good, words in said if good and words]
    return reasons, [words for good, words in said if not good and words]


def _odds(found: Diagnosis, hypothesis: Hypothesis) -> tuple[bool, str]:
    """Compare the hypothesis with no effect, before weak values are folded into it."""
    if hypothesis in (NONE, UNKNOWN):
        return True, ""
    log = found.scored[hypothesis].log_evidence - found.scored[NONE].log_evidence
    if log < math.log(3.0):
        return False, "explains the times hardly better than no effect at all"
    times = f"more than {MANY:.0f}" if log > math.log(MANY) else f"{math.exp(log):.0f}"
    return True, f"explains the times {times} times better than no effect"


def _fit(found: Diagnosis, hypothesis: Hypothesis) -> tuple[bool, str]:
    p = found.fits.get(hypothesis)
    if p is None:
        return True, ""
    shown = f"p = {p:.2g}" if p >= 0.001 else "p < 0.001"
    if p < ADEQUATE:
        return False, f"times and shares engaged lie further from it than chance allows ({shown})"
    return True, f"the data scatter about it as they should ({shown})"


def _far(found: Diagnosis, hypothesis: Hypothesis) -> tuple[bool, str]:
    """Describe its predictions at held-out points; known of the first two hypotheses."""
    gaps = found.before_after if hypothesis == found.leading else None
    if found.rival is not None and hypothesis == found.rival[0]:
        gaps = found.rival[1]
    if gaps is None or hypothesis == NONE or gaps.held_out is None or gaps.baseline is None:
        return True, ""
    left = f"of {ms(gaps.baseline)} it leaves {ms(gaps.held_out)} at operating points held out"
    return (gaps.shrink or 0.0) > 0.5, left


def _alike(found: Diagnosis, hypothesis: Hypothesis) -> tuple[bool, str]:
    others = [h for h in found.confusion.class_of(hypothesis) if h != hypothesis]
    names = [plain(h, found.effects) for h in others[:1]]
    names += [f"{len(others) - 1} more (below)"] if len(others) > 1 else []
    if hypothesis != UNKNOWN:
        names += [alias for name in hypothesis for alias in found.effects[name].aliases]
    return False, f"these data cannot tell it from {' or '.join(names)}" if names else ""


def _ends(found: Diagnosis, hypothesis: Hypothesis) -> tuple[bool, str]:
    """Name the sizes that lie at an end of their prior range."""
    if hypothesis in (NONE, UNKNOWN):
        return False, ""
    sizes, space = found.intervals[hypothesis], found.scored[hypothesis].space
    # A low end at or below the neutral value asks for no more.
    ends = [
        quantity(parameter.name)
        for parameter in space.parameters
        if parameter.share(sizes[parameter.name].low) > 1.0 - END
        or (
            parameter.neutral_of(space.setting) > parameter.low
            and parameter.share(sizes[parameter.name].high) < END
        )
    ]
    return False, f"{' and '.join(ends)} at the end of the range held possible" if ends else ""


def _at_rest(found: Diagnosis, hypothesis: Hypothesis) -> list[tuple[bool, str]]:
    """Compare readings of the stand at rest with the sizes that the hypothesis needs."""
    said = []
    for fact in facts_of(found.bench):
        if fact.effect in hypothesis:
            needed = found.intervals[hypothesis][fact.parameter]
            agrees = needed.low <= fact.high and fact.low <= needed.high
            name, ends = quantity(fact.parameter), between(fact.parameter, fact.low, fact.high)
            said.append((agrees, f"at rest the stand shows a {name} of {ends}"))
    return said
