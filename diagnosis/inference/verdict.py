"""Verdict: a named effect, none, unknown, or ambiguous."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from dogshape.diagnosis.bench.stand_file import Margin
from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, REVERSED, UNKNOWN, Hypothesis, forward

Kind = Literal["effect", "none", "unknown", "ambiguous"]


@dataclass(frozen=True)
class Verdict:
    """Decision of a diagnosis.

    Parameters
    ----------
    kind : one of four.
    causes : effects that are named.
    credible : hypotheses that have 0.9 together, the most probable first.
    """

    kind: Kind
    causes: tuple[str, ...]
    credible: tuple[Hypothesis, ...]


def inclusion(posterior: Mapping[Hypothesis, float]) -> dict[str, float]:
    """Sum the probabilities of the hypotheses that have an effect, the largest first."""
    found: dict[str, float] = {}
    for hypothesis, probability in posterior.items():
        for name in hypothesis if hypothesis != UNKNOWN else ():
            found[name] = found.get(name, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def within_margin(
    likelihood: Likelihood,
    fits: Mapping[Hypothesis, Fit],
    raw: Mapping[Hypothesis, float],
    margin: Margin,
) -> float:
    """Compute the probability that the gap is below its margin, scatter left out."""
    some = likelihood.having
    base = fits[NONE].predicted.only([0])
    plain = likelihood.late_mean(base)[0]
    limit = margin.of(plain)
    found = 0.0
    for h, one in fits.items():
        gaps = (likelihood.late_mean(one.predicted) + one.offset - plain) / limit
        engaged = (one.predicted.engaged - base.engaged) / likelihood.settings.engaged_margin
        over = (gaps[:, some] ** 2 + engaged[:, some] ** 2).mean(axis=1)
        found += raw.get(h, 0.0) * float((over < 1.0).mean())
    return found


def decide(
    posterior: Mapping[Hypothesis, float],
    fits: Mapping[Hypothesis, Fit],
    within: float,
    settings: Settings,
) -> Verdict:
    """Decide on a verdict.

    *None* where the gap is within its margin, *unknown* where nothing listed explains it, *effect*
    where one hypothesis is named that passes the predictive check. Otherwise *ambiguous*, with the
    effects that are part of the cause under nearly all hypotheses.
    """
    order = sorted(posterior, key=lambda h: -posterior[h])
    top, part = order[0], inclusion(posterior)
    credible, whole = list[Hypothesis](), 0.0
    for h in order:
        if whole >= settings.credible:
            break
        credible.append(h)
        whole += posterior[h]
    sure = {n for n, p in part.items() if p > settings.part}
    kind: Kind = "ambiguous"
    causes = tuple(sorted(sure))
    known = [h for h in credible if h in fits]
    fails = [h for h in known if fits[h].p < settings.adequate]
    if within > settings.named:
        kind, causes = "none", ()
    elif posterior[UNKNOWN] > settings.named or (known and len(fails) == len(known)):
        kind, causes = "unknown", ()
    elif top not in fails and posterior[top] > settings.named and top != NONE:
        doubted = REVERSED not in top and part.get(REVERSED, 0.0) > 1.0 - settings.part
        if not doubted and len(forward(top)) <= settings.named_at_once:
            kind, causes = "effect", top
    return Verdict(kind, causes, tuple(credible))
