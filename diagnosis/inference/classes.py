"""Classes of hypotheses that a data set cannot tell apart, and effects that it cannot see.

A hypothesis imitates another one as well as its best values do. Two hypotheses are one class if
half the squared distance of their signatures (``diagnosis.likelihood.signature``) stays below a
limit both ways: no data of this kind and number would part them. The distance that errors of
emulation alone add is subtracted. A dead time and a shifted time zero are always one class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.diagnosis.inference.posterior import Probabilities
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Scored
from dogshape.diagnosis.likelihood.signature import Metric, squared
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.settings import USUAL, Decision
from dogshape.diagnosis.terms import Array, Hypothesis, Table

DECISION = USUAL.decision
APART = DECISION.apart  #: expected log Bayes factor below which two hypotheses are one class
DRAWN = 2000  #: values drawn from each posterior


@dataclass(frozen=True)
class Confusion:
    """Expected log Bayes factors between plausible hypotheses, and their classes.

    ``apart[i, j]`` is for data that hypothesis *i* makes, judged against the best of *j*.
    """

    hypotheses: tuple[Hypothesis, ...]
    apart: Array
    classes: tuple[tuple[Hypothesis, ...], ...]

    def class_of(self, hypothesis: Hypothesis) -> tuple[Hypothesis, ...]:
        """Find the class of a hypothesis, itself included."""
        for group in self.classes:
            if hypothesis in group:
                return group
        return (hypothesis,)


@dataclass(frozen=True)
class _Placed(Table):
    """Signatures (m, k), and the squared distance that errors of emulation make, (m,)."""

    points: Array
    noise: Array


def _placed(predicted: PredictionSummary, metric: Metric, baseline: PredictionSummary) -> _Placed:
    # What the errors have in common with the baseline's is common to all hypotheses, and the error
    # of the model is none of the emulation's.
    own = _emulated(predicted) - _emulated(baseline)
    noise = np.nan_to_num(np.maximum(0.0, own)) @ metric.precision
    return _Placed(metric.of(predicted), noise)


def _emulated(predicted: PredictionSummary) -> Array:
    """Return the variance of emulated means (m, cells), without that of the model."""
    return predicted.error**2 - predicted.model**2


def _nearest(mine: _Placed, theirs: _Placed) -> Array:
    """Return the squared distance of each of mine from the nearest of theirs, (m,)."""
    whole = squared(mine.points, theirs.points)
    # Chosen with the noise in: values of large error would else be the nearest to anything.
    place = whole.argmin(axis=1)
    left: Array = whole[np.arange(len(place)), place] - mine.noise - theirs.noise[place]
    return np.maximum(0.0, left)


def confusion(
    scored: Sequence[Scored],
    metric: Metric,
    posterior: Probabilities,
    baseline: PredictionSummary,
    limits: Decision = DECISION,
) -> Confusion:
    """Group the plausible hypotheses into classes; unknown is in none."""
    those = [one for one in scored if posterior.get(one.hypothesis, 0.0) > limits.plausible]
    generator = np.random.default_rng(1)
    every = [_placed(one.rows.predicted, metric, baseline) for one in those]
    drawn = [
        placed.only(one.draw(DRAWN, generator)) for one, placed in zip(those, every, strict=True)
    ]
    apart = np.array(
        [[0.5 * _nearest(mine, theirs).mean() for theirs in every] for mine in drawn]
    ).reshape(len(those), len(those))
    names = tuple(one.hypothesis for one in those)
    return Confusion(names, apart, _groups(names, np.maximum(apart, apart.T) < limits.apart))


def _groups(names: tuple[Hypothesis, ...], near: np.ndarray) -> tuple[tuple[Hypothesis, ...], ...]:
    """Return groups in which each is near all others, from the most probable on."""
    groups: list[list[int]] = []
    for place in range(len(names)):
        for group in groups:
            if all(near[place, other] for other in group):
                group.append(place)
                break
        else:
            groups.append([place])
    return tuple(tuple(names[k] for k in group) for group in groups)


def invisible(
    scored: Sequence[Scored], metric: Metric, visible: float = DECISION.visible
) -> dict[str, float]:
    """Compute the share of each effect's prior that the data cannot tell from none."""
    baseline = next(one for one in scored if one.hypothesis == NONE).rows.predicted
    nothing = metric.of(baseline)
    found = {}
    for one in scored:
        if len(one.hypothesis) == 1:
            weak = squared(metric.of(one.rows.predicted), nothing)[:, 0] < visible
            before = np.exp(one.log_prior - one.log_prior.max())
            found[one.hypothesis[0]] = float(before[weak].sum() / before.sum())
    return found


def structured(found: Confusion) -> list[list[list[str]]]:
    """List the classes of more than one hypothesis, each hypothesis as its effects."""
    return [[list(h) for h in group] for group in found.classes if len(group) > 1]


def in_short(effects: Sequence[str]) -> str:
    """Write a hypothesis as ``confusable`` has it."""
    return " + ".join(effects) or "none"


def confusable(found: Confusion, aliases: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """List classes of several hypotheses as names, and effects with their aliases."""
    groups = [[in_short(h) for h in group] for group in structured(found)]
    named = {name for hypothesis in found.hypotheses for name in hypothesis}
    return groups + [[name, *aliases[name]] for name in sorted(named) if aliases.get(name)]
