"""Verdict: a named effect, none, unknown, or ambiguous.

Effects that the data of a kind cannot show count as absent: a draw whose prediction lies within the
data's errors of that without one of its effects counts with the hypothesis that lacks this effect.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.ranking import Ranking
from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.model import Predicted
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import NONE, REVERSED, UNKNOWN, Array, Hypothesis, forward

Kind = Literal["effect", "none", "unknown", "ambiguous"]
Probabilities = dict[Hypothesis, float]

FOLDED = 100  #: draws of a hypothesis
ALIKE = {"linkage_compliance": "moving_mass"}  #: a stiff linkage with mass is a mass


@dataclass(frozen=True)
class Verdict:
    """Decision of a diagnosis: named effects, and hypotheses that have 0.9 together."""

    kind: Kind
    causes: Sequence[str]
    credible: Sequence[Hypothesis]


class Within(NamedTuple):
    """Probability that the gap is below its margin: over all hypotheses, and if nothing acts."""

    gap: float
    none: float


def inclusion(posterior: Mapping[Hypothesis, float]) -> dict[str, float]:
    """Sum the probabilities of the hypotheses that have an effect, the largest first."""
    found: dict[str, float] = {}
    for hypothesis, probability in posterior.items():
        for name in hypothesis if hypothesis != UNKNOWN else ():
            found[name] = found.get(name, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def within_margin(likelihood: Likelihood, one: Fit) -> float:
    """Compute the probability by a hypothesis that the gap is below its margin.

    Scatter is left out, and what nuisances explain: a gap by the contact is no effect.
    """
    some, base = likelihood.having, likelihood.model.predict(NONE, np.zeros((1, 0)))
    plain = likelihood.late_mean(base)[0]
    moved = likelihood.late_mean(one.predicted) + one.offset - one.nuisance
    gaps = (moved - plain) / likelihood.bench.margin.of(plain)
    engaged = (one.predicted.engaged - base.engaged) / likelihood.settings.engaged_margin
    over = (gaps[:, some] ** 2 + engaged[:, some] ** 2).mean(axis=1)
    return float((over < 1.0).mean())


def nameable(hypothesis: Hypothesis, settings: Settings) -> bool:
    """Check that a hypothesis may be named as the whole cause, however probable it is."""
    return len(forward(hypothesis)) <= settings.named_at_once


def decide(
    posterior: Probabilities, fits: Mapping[Hypothesis, Fit], inside: Within, settings: Settings
) -> Verdict:
    """Decide on a verdict.

    *None* where the gap is within its margin, or nothing acts and its effect on the gap would show.
    *Unknown* where nothing listed explains the gap, or only what fails the predictive check.
    *Effect* where one hypothesis is named that passes it. Otherwise *ambiguous*, with the effects
    that are part of the cause under nearly all hypotheses.
    """
    order = sorted(posterior, key=lambda h: -posterior[h])
    top, part = order[0], inclusion(posterior)
    before = np.cumsum([0.0, *(posterior[h] for h in order)])[:-1]
    credible = tuple(h for h, p in zip(order, before, strict=True) if p < settings.credible)
    kind: Kind = "ambiguous"
    causes = tuple(sorted(n for n, p in part.items() if p > settings.part))
    # What takes the probability of wider hypotheses has the check of the narrowest of these.
    near = {h: min((n for n in fits if {*h} <= {*n}), key=len, default=h) for h in order}
    fails = [h for h, n in near.items() if n in fits and fits[n].p < settings.adequate]
    still = min(posterior[NONE], inside.none)
    if max(inside.gap, still) > settings.named:
        kind, causes = "none", ()
    elif posterior[UNKNOWN] + sum(posterior[h] for h in fails) > settings.named:
        kind, causes = "unknown", ()
    elif top not in fails and posterior[top] > settings.named and top != NONE:
        doubted = REVERSED not in top and part.get(REVERSED, 0.0) > 1.0 - settings.part
        if not doubted and nameable(top, settings):
            kind, causes = "effect", top
    return Verdict(kind, causes, credible)


def seen_apart(
    shares: Mapping[Hypothesis, Probabilities], raw: Mapping[Hypothesis, float]
) -> Probabilities:
    """Count what the data cannot show as absent: probabilities, the largest first.

    ``shares`` are those of the draws of each hypothesis that smaller ones predict (``unseen``).
    """
    found = dict(raw)
    for smaller in (s for parts in shares.values() for s in parts):
        found.setdefault(smaller, 0.0)
    for h in sorted(found, key=lambda h: -len(h)):
        whole = found[h]
        for smaller, share in shares.get(h, {}).items():
            found[smaller] += whole * share
            found[h] -= whole * share
        found[h] = max(0.0, found[h])  # shares of one may leave less than none by rounding
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def unseen(ranking: Ranking, one: Fit, known: Collection[Hypothesis]) -> Probabilities:
    """Compute the shares of a hypothesis' draws that fewer effects predict as well.

    What traces and direct tests lose by fewer effects counts as twice the loss of likelihood.
    """
    likelihood = ranking.likelihood
    rows = np.linspace(0, len(one.shares) - 1, FOLDED).astype(int)
    mine, shares = one.predicted.only(rows), one.shares[rows]
    beside = ranking.more(one.hypothesis, shares)
    options, distances = list[Hypothesis](), [np.full(rows.size, likelihood.settings.visible)]
    for name, replaced in itertools.product(forward(one.hypothesis), (False, True)):
        if replaced and name not in ALIKE:
            continue
        other = tuple(sorted({*one.hypothesis} - {name} | ({ALIKE[name]} if replaced else set())))
        if other not in known:
            continue
        parts = [np.zeros((rows.size, 0))]
        for effect in likelihood.model.space(other).effects:
            if effect.name in one.hypothesis:
                parts.append(shares[:, one.space.columns(effect.name)])
            else:  # the mass of the linkage is that of the ring
                mass = one.values[rows][:, one.space.columns(name)][:, -1]
                parts.append(effect.parameters[0].share(mass)[:, None])
        moved = np.hstack(parts)
        lost = np.maximum(beside - ranking.more(other, moved), 0.0)
        far = apart(likelihood, mine, likelihood.model.predict(other, moved))
        distances.append(far + 2.0 * lost)
        options.append(other)
    where = np.nanargmin(distances, axis=0)
    found = {h: float((where == k).mean()) for k, h in enumerate(options, start=1)}
    return {h: share for h, share in found.items() if share > 0.0}


def apart(likelihood: Likelihood, one: Predicted, other: Predicted) -> Array:
    """Compute squared distances of two predictions in the errors of the data, (m,)."""
    some, seen, settings = likelihood.having, likelihood.seen, likelihood.settings
    p = other.only((slice(None), some))
    variance = p.sd**2 / np.maximum(seen.count[some], 1.0) + likelihood.own_variance(other)[:, some]
    variance = variance + one.emulated[:, some] ** 2
    columns = likelihood.all_columns(other, settings.discrepancy)[:, some]
    moved = likelihood.late_mean(one) - likelihood.late_mean(other)
    found = squared_distance(moved[:, some], variance, columns)
    spread = np.log(one.sd[:, some] / other.sd[:, some])
    error = 0.5 / np.maximum(seen.freedom[some], 1.0) + settings.spread_share**2
    found = found + ((seen.freedom[some] > 0.0) * spread**2 / error).sum(axis=1)
    tried, share = seen.engaged + seen.failed, np.clip(other.engaged, 0.02, 0.98)
    margin = share * (1.0 - share) / np.maximum(tried, 1.0) + 0.02**2
    engaged = (tried > 0) * (one.engaged - other.engaged) ** 2 / margin
    return np.asarray(found + engaged.sum(axis=1))
