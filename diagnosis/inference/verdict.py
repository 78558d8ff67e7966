"""Verdict: a named effect, none, unknown, or ambiguous.

Effects that the data of a kind cannot show count as absent: a draw whose prediction lies within the
data's errors of that without one of its effects counts with the hypothesis that lacks this effect.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.inference.ranking import Ranking
from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.model import Prediction
from dogshape.diagnosis.settings import Settings
from dogshape.diagnosis.terms import (
    NONE,
    REVERSED,
    UNKNOWN,
    Array,
    Hypothesis,
    strip_sense,
)

Kind = Literal["effect", "none", "unknown", "ambiguous"]
Probabilities = dict[Hypothesis, float]

FOLDED_DRAWS = 100  #: draws of a hypothesis
EQUIVALENTS = {"linkage_compliance": "moving_mass"}  #: a stiff linkage with mass is a mass


@dataclass(frozen=True)
class CauseVerdict:
    """Decision of a diagnosis: named effects, and hypotheses that have 0.9 together."""

    kind: Kind
    causes: Sequence[str]
    credible: Sequence[Hypothesis]


class NoneEvidence(NamedTuple):
    """Evidence for *none* beside the posterior."""

    within_margin: float  #: probability that the gap is below its margin
    exclusion: float  #: share of the prior odds of any effect that the data exclude


def inclusion(posterior: Mapping[Hypothesis, float]) -> dict[str, float]:
    """Sum the probabilities of the hypotheses that have an effect, the largest first."""
    probabilities: dict[str, float] = {}
    for hypothesis, probability in posterior.items():
        if hypothesis == UNKNOWN:
            continue
        for name in hypothesis:
            probabilities[name] = probabilities.get(name, 0.0) + probability
    return dict(sorted(probabilities.items(), key=lambda item: -item[1]))


def margin_probability(likelihood: Likelihood, fitted: Fit) -> float:
    """Compute the probability by a hypothesis that the gap is below its margin.

    Without scatter and the share of nuisances: a gap by the contact is no effect.
    """
    points = likelihood.measured_points
    base = likelihood.model.predict(NONE, np.zeros((1, 0)))
    base_mean = likelihood.mean_with_late(base)[0]
    mean = likelihood.mean_with_late(fitted.predicted) + fitted.offset - fitted.nuisance
    gaps = (mean - base_mean) / likelihood.bench.margin.of(base_mean)
    engaged_change = fitted.predicted.engaged_share - base.engaged_share
    engaged = engaged_change / likelihood.settings.engaged_margin
    mean_square = (gaps[:, points] ** 2 + engaged[:, points] ** 2).mean(axis=1)
    return float((mean_square < 1.0).mean())


def excluded_share(
    prior: Mapping[Hypothesis, float], evidence: Mapping[Hypothesis, float]
) -> float:
    """Compute the share of the prior odds of effects against none that the data exclude.

    0 for data that would not show an effect; below 0 where the odds have risen, without bound where
    nothing is left of none.
    """
    odds = _effect_odds(evidence)
    return -math.inf if math.isinf(odds) else 1.0 - odds / _effect_odds(prior)


def _effect_odds(weights: Mapping[Hypothesis, float]) -> float:
    """Compute the odds of all sets of effects against none, in either sense of rotation.

    Infinite where none has no weight.
    """
    effects = 0.0
    none = 0.0
    for h, weight in weights.items():
        if not strip_sense(h):
            none += weight
        elif h != UNKNOWN:
            effects += weight
    return effects / none if none > 0.0 else math.inf


def credible_set(posterior: Probabilities, level: float) -> tuple[Hypothesis, ...]:
    """List the most probable hypotheses whose probability reaches ``level`` together."""
    order = sorted(posterior, key=lambda h: -posterior[h])
    cumulative = np.cumsum([0.0, *(posterior[h] for h in order)])[:-1]
    return tuple(h for h, p in zip(order, cumulative, strict=True) if p < level)


def decide(
    posterior: Probabilities,
    fits: Mapping[Hypothesis, Fit],
    none: NoneEvidence,
    settings: Settings,
) -> CauseVerdict:
    """Decide on a verdict.

    *None* where the gap is within its margin, or where nothing acts, passes the predictive check,
    and the data exclude effects.
    *Unknown* where nothing listed explains the gap, or only what fails the predictive check or is
    too large a set to be named. *Effect* where one hypothesis is named that passes it. Otherwise
    *ambiguous*, with the effects that are part of the cause under nearly all hypotheses.
    """
    order = sorted(posterior, key=lambda h: -posterior[h])
    credible = credible_set(posterior, settings.credible)
    inadequate = [h for h in order if not _is_adequate(h, fits, settings)]
    shows_none = none.exclusion > settings.excluded and NONE not in inadequate
    if none.within_margin > settings.named or (shows_none and posterior[NONE] > settings.named):
        return CauseVerdict("none", (), credible)
    explained = sum(
        p
        for h, p in posterior.items()
        if settings.is_nameable(h) and h != UNKNOWN and h not in inadequate
    )
    if 1.0 - explained > settings.named:
        return CauseVerdict("unknown", (), credible)
    if order[0] not in inadequate and _is_named(order[0], posterior, settings):
        return CauseVerdict("effect", order[0], credible)
    return CauseVerdict("ambiguous", parts_of(posterior, settings), credible)


def parts_of(posterior: Mapping[Hypothesis, float], settings: Settings) -> tuple[str, ...]:
    """List the effects that are part of the cause, in alphabetical order.

    Sets that are too large to be named count as unknown.
    """
    nameable = {h: p for h, p in posterior.items() if settings.is_nameable(h)}
    return tuple(sorted(name for name, p in inclusion(nameable).items() if p > settings.part))


def _is_named(top: Hypothesis, posterior: Probabilities, settings: Settings) -> bool:
    """Check that the most probable hypothesis is named as the cause."""
    if top == NONE or not settings.names(top, posterior[top]):
        return False
    # A hypothesis without the reversed sense is named only where that is improbable.
    reversed_probability = inclusion(posterior).get(REVERSED, 0.0)
    return REVERSED in top or reversed_probability <= 1.0 - settings.part


def _is_adequate(h: Hypothesis, fits: Mapping[Hypothesis, Fit], settings: Settings) -> bool:
    """Check that a hypothesis passes the predictive check, or has no fit to check.

    A hypothesis that takes the probability of wider ones has the check of the narrowest of these.
    """
    wider = [fitted for fitted in fits if {*h} <= {*fitted}]
    if not wider:
        return True
    return not fits[min(wider, key=len)].p < settings.adequate


def fold_invisible(
    shares: Mapping[Hypothesis, Probabilities], evidence: Mapping[Hypothesis, float]
) -> Probabilities:
    """Move probability of invisible effects to the smaller hypotheses, the largest first.

    ``shares`` are those of the draws of each hypothesis that smaller ones predict
    (``invisible_shares``).
    """
    posterior = dict(evidence)
    for smaller in itertools.chain.from_iterable(shares.values()):
        posterior.setdefault(smaller, 0.0)
    for h in sorted(posterior, key=lambda h: -len(h)):
        probability = posterior[h]
        for smaller, share in shares.get(h, {}).items():
            posterior[smaller] += probability * share
            posterior[h] -= probability * share
        posterior[h] = max(0.0, posterior[h])  # below 0 by rounding
    return dict(sorted(posterior.items(), key=lambda item: -item[1]))


def invisible_shares(
    ranking: Ranking, fitted: Fit, hypotheses: Collection[Hypothesis]
) -> Probabilities:
    """Compute the shares of a hypothesis' draws that smaller ``hypotheses`` predict as well.

    The loss of traces and direct tests by fewer effects counts as twice the loss of likelihood.
    """
    likelihood = ranking.likelihood
    rows = np.linspace(0, len(fitted.shares) - 1, FOLDED_DRAWS).astype(int)
    predicted = fitted.predicted.select(rows)
    side_log = ranking.side_likelihood(fitted.hypothesis, fitted.shares[rows])
    smaller_hypotheses = list[Hypothesis]()
    distances = [np.full(rows.size, likelihood.settings.visible)]
    for name, substitute in _removals(fitted.hypothesis):
        names = {*fitted.hypothesis} - {name}
        if substitute is not None:
            names.add(substitute)
        smaller = tuple(sorted(names))
        if smaller not in hypotheses:
            continue
        shares = _smaller_shares(likelihood, fitted, rows, name, smaller)
        loss = np.maximum(side_log - ranking.side_likelihood(smaller, shares), 0.0)
        prediction = likelihood.model.predict(smaller, shares)
        distances.append(prediction_distance(likelihood, predicted, prediction) + 2.0 * loss)
        smaller_hypotheses.append(smaller)
    nearest = np.nanargmin(distances, axis=0)  # 0 for none within the errors of the data
    shares_by_hypothesis = {}
    for k, smaller in enumerate(smaller_hypotheses, start=1):
        share = float((nearest == k).mean())
        if share > 0.0:
            shares_by_hypothesis[smaller] = share
    return shares_by_hypothesis


def _removals(hypothesis: Hypothesis) -> list[tuple[str, str | None]]:
    """List the effects to remove from a hypothesis, each with its substitute or None."""
    removals: list[tuple[str, str | None]] = []
    for name in strip_sense(hypothesis):
        removals.append((name, None))
        if name in EQUIVALENTS:
            removals.append((name, EQUIVALENTS[name]))
    return removals


def _smaller_shares(
    likelihood: Likelihood,
    fitted: Fit,
    rows: np.ndarray,
    removed: str,
    smaller: Hypothesis,
) -> Array:
    """Select the shares of a smaller hypothesis from draws (m,) of a fit, (m, p)."""
    columns = [np.zeros((rows.size, 0))]
    for effect in likelihood.model.space(smaller).effects:
        if effect.name in fitted.hypothesis:
            columns.append(fitted.shares[rows][:, fitted.space.columns(effect.name)])
        else:  # the mass of the linkage is that of the ring
            mass = fitted.values[rows][:, fitted.space.columns(removed)][:, -1]
            columns.append(effect.parameters[0].share(mass)[:, None])
    return np.hstack(columns)


def prediction_distance(
    likelihood: Likelihood, predicted: Prediction, smaller: Prediction
) -> Array:
    """Compute squared distances of predictions from smaller ones in the errors of data, (m,)."""
    points = likelihood.measured_points
    observed = likelihood.observed
    settings = likelihood.settings
    count = np.maximum(observed.count[points], 1.0)
    variance = likelihood.at_measured(smaller).sd ** 2 / count
    variance = variance + likelihood.mean_variance(smaller)[:, points]
    variance = variance + predicted.emulation_error[:, points] ** 2
    columns = likelihood.all_common_errors(smaller, settings.discrepancy)[:, points]
    change = likelihood.mean_with_late(predicted) - likelihood.mean_with_late(smaller)
    distance = squared_distance(change[:, points], variance, columns)
    log_sd_change = np.log(predicted.sd[:, points] / smaller.sd[:, points])
    freedom = observed.freedom[points]
    spread_variance = 0.5 / np.maximum(freedom, 1.0) + settings.spread_share**2
    spread_distance = (freedom > 0.0) * log_sd_change**2 / spread_variance
    distance = distance + spread_distance.sum(axis=1)
    shifts = observed.engaged_count + observed.failed_count
    share_error = settings.engaged_error
    share = np.clip(smaller.engaged_share, share_error, 1.0 - share_error)
    share_variance = share * (1.0 - share) / np.maximum(shifts, 1.0) + share_error**2
    share_change = predicted.engaged_share - smaller.engaged_share
    engaged_distance = (shifts > 0) * share_change**2 / share_variance
    return np.asarray(distance + engaged_distance.sum(axis=1))
