"""Verdict: a named effect, none, unknown, or ambiguous.

- *effect*: one hypothesis of one or two effects has more than 0.8 and passes the predictive check.
  Each of its effects is part of the cause with more than 0.95, under any hypothesis. An unknown
  sense of rotation (``diagnosis.bench.sense``) has to be as sure;
- *none*: bench and simulation are equivalent with more than 0.8
  (``diagnosis.inference.equivalence``), whatever small effect is likeliest. That no effect is seen
  in data that would not show one of that size is no *none*;
- *unknown*: a gap of no known effect has more than 0.8, with the probability of plausible
  hypotheses that fail the predictive check (``diagnosis.inference.posterior.judged``);
- *ambiguous* otherwise, also if a class has more than 0.8 but no member has: data of this kind
  cannot part its members. Effects that are part of the cause in any case are still named.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

from dogshape.diagnosis.bench.sense import REVERSED, forward
from dogshape.diagnosis.inference.classes import Confusion
from dogshape.diagnosis.inference.posterior import Probabilities, inclusion
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.settings import USUAL, Decision
from dogshape.diagnosis.terms import Hypothesis

DECISION = USUAL.decision
#: Effects that are properties of the simulation's contact rather than of the stand. What other
#: engines differ by looks like them, so that only a direct test names them.
MODEL_FORM = frozenset(DECISION.model_form)
NAMED = DECISION.named  #: probability from which a hypothesis is named
#: Effects that are named at once; of more, each that is part of the cause in any case.
MOST = DECISION.most
PART = DECISION.part  #: probability from which an effect is part of the cause, whatever else is
CREDIBLE = DECISION.credible  #: probability of the set that is given where nothing is named

Kind = Literal["effect", "none", "unknown", "ambiguous"]


@dataclass(frozen=True)
class Verdict:
    """Decision of the diagnosis.

    Parameters
    ----------
    kind : one of four.
    causes : effects that are named.
    credible : hypotheses that have 0.9 together, most probable first.
    group : class of the most probable hypothesis, and its probability.
    """

    kind: Kind
    causes: tuple[str, ...]
    credible: tuple[Hypothesis, ...]
    group: tuple[Hypothesis, ...]
    group_probability: float

    @property
    def answer(self) -> tuple[Kind, tuple[str, ...]]:
        """Kind and causes: two verdicts with the same answer differ in probabilities at most."""
        return self.kind, self.causes


def decide(
    posterior: Probabilities,
    confusion: Confusion,
    fits: Mapping[Hypothesis, float],
    within: float = 0.0,
    measured: Collection[str] = (),
    *,
    limits: Decision = DECISION,
) -> Verdict:
    """Decide on a verdict from probabilities, classes and predictive p-values.

    ``fits`` has the plausible hypotheses, unknown left out, ``within`` the probability that bench
    and simulation are equivalent, ``measured`` effects that a direct test of the stand has shown,
    ``limits`` the probabilities from which something is said.
    """
    ordered = sorted(posterior, key=lambda h: -posterior[h])
    top = ordered[0]
    group = confusion.class_of(top)
    kind = _kind(posterior, top, fits, limits)
    form = set(limits.model_form) - set(measured)
    if kind == "effect" and form & set(top):
        kind = "ambiguous"
    equivalent = kind != "unknown" and within > limits.named
    if equivalent or kind == "none":
        kind = "none" if equivalent else "ambiguous"
    causes: tuple[str, ...] = top if kind == "effect" else ()
    if kind == "ambiguous":
        causes = tuple(
            n for n, p in inclusion(posterior).items() if p > limits.part and n not in form
        )
    chance = sum(posterior[h] for h in group)
    return Verdict(kind, causes, _credible(posterior, limits.credible), group, chance)


def _kind(
    posterior: Probabilities,
    top: Hypothesis,
    fits: Mapping[Hypothesis, float],
    limits: Decision,
) -> Kind:
    if posterior.get(UNKNOWN, 0.0) > limits.named:
        return "unknown"
    fails = fits.get(top, 0.0) < limits.adequate
    if posterior[top] <= limits.named or fails or len(forward(top)) > limits.most:
        return "ambiguous"
    # Another hypothesis may share no cause with the most probable one: then that is not certain.
    part = inclusion(posterior)
    if any(part[name] <= limits.part for name in top):
        return "ambiguous"
    if top == NONE:
        return "none"
    # Sizes of effects are those of one sense.
    doubted = REVERSED not in top and part.get(REVERSED, 0.0) >= 1.0 - limits.part
    return "ambiguous" if doubted else "effect"


def _credible(posterior: Probabilities, share: float) -> tuple[Hypothesis, ...]:
    """Return the most probable hypotheses that have a share of the probability together."""
    found: list[Hypothesis] = []
    whole = 0.0
    for hypothesis in sorted(posterior, key=lambda h: -posterior[h]):
        if whole >= share:
            break
        found.append(hypothesis)
        whole += posterior[hypothesis]
    return tuple(found)
