"""Effects that the data of a kind cannot show, counted as absent.

A draw whose prediction lies within the data's errors of that without one of its effects counts with
the hypothesis that lacks this effect.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from dogshape.diagnosis.inference.fit import Fit
from dogshape.diagnosis.likelihood.likelihood import Likelihood, squared_distance
from dogshape.diagnosis.prediction.model import Predicted
from dogshape.diagnosis.terms import Array, Hypothesis, forward

Probabilities = dict[Hypothesis, float]

FOLDED = 100  #: draws of a hypothesis
ALIKE = {"linkage_compliance": "moving_mass"}  #: a stiff linkage with mass is a mass


Unseen = Mapping[Hypothesis, Probabilities]  #: shares of draws that smaller hypotheses predict


def unseen(
    likelihood: Likelihood, fits: Mapping[Hypothesis, Fit], known: Collection[Hypothesis]
) -> Unseen:
    """Compute for each fitted hypothesis the shares of its draws that fewer effects predict."""
    return {h: _unseen(likelihood, one, known) for h, one in fits.items() if forward(h)}


def seen_apart(shares: Unseen, raw: Mapping[Hypothesis, float]) -> Probabilities:
    """Count what the data cannot show as absent: probabilities, the largest first."""
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


def _unseen(likelihood: Likelihood, one: Fit, known: Collection[Hypothesis]) -> Probabilities:
    """Compute the shares of a hypothesis' draws that fewer effects predict as well."""
    rows = np.linspace(0, len(one.shares) - 1, FOLDED).astype(int)
    mine, shares = one.predicted.only(rows), one.shares[rows]
    best, where = np.full(rows.size, likelihood.settings.visible), np.full(rows.size, -1)
    options = list[Hypothesis]()
    for name in forward(one.hypothesis):
        smaller = tuple(n for n in one.hypothesis if n != name)
        for replaced in (None, ALIKE.get(name)):
            other = smaller if replaced is None else tuple(sorted({*smaller, replaced}))
            if other not in known or len(other) > len(one.hypothesis):
                continue
            columns = _shares_of(likelihood, one, other, shares, name)
            distance = apart(likelihood, mine, likelihood.model.predict(other, columns))
            better = distance < best
            best[better], where[better] = distance[better], len(options)
            options.append(other)
    return {h: float((where == k).mean()) for k, h in enumerate(options) if (where == k).any()}


def _shares_of(
    likelihood: Likelihood, one: Fit, other: Hypothesis, shares: Array, name: str
) -> Array:
    """Select the shares of the effects that another hypothesis has."""
    parts = []
    for effect in likelihood.model.space(other).effects:
        if effect.name not in one.hypothesis:
            mass = one.space.values(shares)[:, one.space.columns(name)][:, -1]
            (only,) = effect.parameters
            parts.append(np.array([[only.share(value)] for value in mass]))
        else:
            parts.append(shares[:, one.space.columns(effect.name)])
    return np.hstack(parts) if parts else np.zeros((len(shares), 0))


def apart(likelihood: Likelihood, one: Predicted, other: Predicted) -> Array:
    """Compute squared distances of two predictions in the errors of the data, (m,)."""
    some, seen = likelihood.having, likelihood.seen
    p = other.only((slice(None), some))
    variance = p.sd**2 / np.maximum(seen.count[some], 1.0) + likelihood.own_variance(other)[:, some]
    variance = variance + one.emulated[:, some] ** 2
    simulated = (other.mean - other.delay)[..., None]
    smooth = likelihood.settings.discrepancy * simulated * likelihood.smooth
    columns = np.concatenate([smooth, likelihood.columns(other)], axis=2)[:, some]
    moved = likelihood.late_mean(one) - likelihood.late_mean(other)
    found = squared_distance(moved[:, some], variance, columns)
    known = seen.freedom[some] > 0.0
    spread = np.log(one.sd[:, some] / other.sd[:, some])
    error = 0.5 / np.maximum(seen.freedom[some], 1.0) + likelihood.settings.spread_share**2
    found = found + np.where(known, spread**2 / error, 0.0).sum(axis=1)
    tried = seen.engaged + seen.failed
    share = np.clip(other.engaged, 0.02, 0.98)
    margin = share * (1.0 - share) / np.maximum(tried, 1.0) + 0.02**2
    engaged = np.where(tried > 0, (one.engaged - other.engaged) ** 2 / margin, 0.0)
    return np.asarray(found + engaged.sum(axis=1))
