r"""Visibility of a pair's second effect once the first one is refitted without it.

The partner alone, with other values, can move the means much as both do. Its residual is

.. math:: r(\theta) = d_e + \bar m(\theta^*) - \bar m(\theta), \qquad
          \Delta\chi^2 = \min_\theta r^T C^{-1} r,

with :math:`d_e` the change of the partner's means by the effect *e* in the engine that made the
data, at even angles and so without scatter, and :math:`\bar m` the partner's means by the emulator
of the diagnosis, at its true values :math:`\theta^*` and at others within its prior. The offset of
both engines at the true values cancels. *C* has all errors of a diagnosis without that offset:
sampling of the case's number of shifts, emulation and simulation of the pair
(``diagnosis.settings.Rules``), and those that operating points have in common.

:math:`\tfrac12 \Delta\chi^2` is the expected logarithm of the likelihood ratio of the pair over its
partner alone: where it is small no method with these errors can tell them apart by means. Its root
is a number of standard errors in all. Spreads of single shifts, outliers and traces, which may
tell more, are left out.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from dogshape.diagnosis.likelihood.cell_predictions import CellPredictions
from dogshape.diagnosis.likelihood.discrepancy import discrepancy_prior
from dogshape.diagnosis.prediction.hypotheses import NONE, Space
from dogshape.diagnosis.prediction.prediction import Emulator
from dogshape.diagnosis.settings import Rules
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim.effect import Effect
from dogshape.sim.setting import Setting
from dogshape.validation.blind.case_marks import names_of, timely

Record = dict[str, Any]  #: a case of a key, as it is kept in JSON

TRIED = (1, 65, 17)  #: values of each parameter at first, for none, one and two of them
ROUNDS = 8  #: grids about the best so far, each a third as wide
AROUND = 9  #: values of each parameter in these


@dataclass(frozen=True)
class Seen:
    """Settings with which a set is diagnosed.

    Parameters
    ----------
    emulator : of the diagnosis that is told nothing.
    effects : of the list, by name.
    settings : what the emulator's cells are, in its order.
    rules : of its likelihood.
    """

    emulator: Emulator
    effects: Mapping[str, Effect]
    settings: Sequence[Setting]
    rules: Rules = field(default_factory=Rules)

    def places(self, points: Sequence[Sequence[float]]) -> list[int]:
        """List the cells of operating points (mismatch in rad/s, force in N, rise in s)."""
        mine = [(s.point.mismatch, s.point.profile.force) for s in self.settings]
        return nearest([p[:2] for p in points], mine)

    def predictions(
        self, hypothesis: Hypothesis, values: Array, places: Sequence[int]
    ) -> CellPredictions:
        """Predict some cells at values (m, p) of a hypothesis."""
        return CellPredictions.of(
            [self.emulator.at(hypothesis, values, k) for k in places], self.rules
        )

    def simulated(self, points: Sequence[Sequence[float]]) -> Array:
        """Return mean times without any effect and without late shifts, s, (points,)."""
        return self.predictions(NONE, np.zeros((1, 0)), self.places(points)).mean[:, 0]

    def values(self, given: Record) -> Array:
        """List parameters by effect as the emulator takes them, (1, p)."""
        names = names_of(given)
        return np.array([[given[n][p.name] for n in names for p in self.effects[n].parameters]])


def nearest(points: Sequence[Sequence[float]], among: Sequence[Sequence[float]]) -> list[int]:
    """List the places of points (mismatch in rad/s, force in N) among others, rounding aside."""
    there = np.array(among)
    apart = abs(there[None] - np.array(points)[:, None]) / abs(there).max(axis=0)
    return [int(place) for place in apart.sum(axis=2).argmin(axis=1)]


@dataclass(frozen=True)
class Left:
    """Sizes of an effect beside its partner, in standard errors of all points together.

    ``before`` is without another fit of the partner, ``after`` with the best one.
    """

    before: float
    after: float


def left_by(
    seen: Seen, case: Record, points: Sequence[Sequence[float]], added: Mapping[str, Array]
) -> dict[str, Left]:
    """Compute what each effect of a pair leaves to be seen, by effect.

    Parameters
    ----------
    case, points : of the key.
    added : by effect what it adds to its partner's mean times, s, (points,); NaN for unknown.
    """
    places = seen.places(points)
    counts = np.array([timely(times).size for times in case["times_s"]], dtype=float)
    covariance = errors_of(seen, case, places, counts)
    found = {}
    for name, gap in added.items():
        partner = {n: values for n, values in case["parameters"].items() if n != name}
        found[name] = left_of(Refit(seen, partner, places, covariance), gap)
    return found


def errors_of(seen: Seen, case: Record, places: Sequence[int], counts: Array) -> Array:
    """Compute *C*, s^2, (points, points), from the pair at its true values.

    ``counts`` are the shifts within each mean; a point without any has an infinite error.
    """
    both = names_of(case["parameters"])
    predicted = seen.predictions(both, seen.values(case["parameters"]), places)
    base = seen.predictions(NONE, np.zeros((1, 0)), places)
    mismatch = np.array([seen.settings[k].point.mismatch for k in places])
    force = np.array([seen.settings[k].point.profile.force for k in places])
    prior = discrepancy_prior(mismatch, force, base.mean[:, 0], seen.rules)
    joint = np.nan_to_num(predicted.common)
    with np.errstate(divide="ignore"):
        own = predicted.sd[:, 0] ** 2 / counts + predicted.error[:, 0] ** 2
    return np.diag(own) + prior.covariance + joint @ joint.T


@dataclass(frozen=True)
class Refit:
    """A partner with its true parameters, by effect, at some cells with their errors *C*, s^2."""

    seen: Seen
    partner: Record
    places: Sequence[int]
    covariance: Array


def left_of(refit: Refit, added: Array) -> Left:
    """Compute what an effect leaves that adds to its partner's means, s, (points,)."""
    seen, names = refit.seen, names_of(refit.partner)
    here = seen.predictions(names, seen.values(refit.partner), refit.places).mean[:, 0]
    known = np.isfinite(added) & np.isfinite(here) & np.isfinite(np.diag(refit.covariance))
    if not known.any():
        return Left(0.0, 0.0)
    root = cho_factor(refit.covariance[np.ix_(known, known)], lower=True)
    cells = [place for place, one in zip(refit.places, known, strict=True) if one]
    space = Space(tuple(seen.effects[n] for n in names), seen.settings[0], frozenset(names))

    def squares(values: Array) -> Array:
        gaps = (added + here)[known, None] - seen.predictions(names, values, cells).mean
        # Values by which nothing engages where shifts do are as wrong as can be.
        out = ~np.isfinite(gaps).all(axis=0) | ~space.possible(values)
        found = (gaps * cho_solve(root, np.nan_to_num(gaps))).sum(axis=0)
        return np.where(out, np.inf, found)

    before = float((added[known] * cho_solve(root, added[known])).sum())
    return Left(math.sqrt(before), math.sqrt(min(before, _least(squares, space))))


def _least(squares: Callable[[Array], Array], space: Space) -> float:
    """Search the prior for the least of a function of values (m, p): grids that close in."""
    size = len(space.parameters)
    if not size:  # nothing to fit, as of the reversed sense
        return float(squares(np.zeros((1, 0)))[0])
    ticks = np.linspace(0.0, 1.0, TRIED[min(size, 2)])
    best, middle, width = np.inf, np.full(size, 0.5), 0.5
    for step in range(ROUNDS + 1):
        offsets = (ticks - 0.5) * 2.0 * width
        grid = np.array(list(itertools.product(offsets, repeat=size))).reshape(
            len(offsets) ** size, size
        )
        shares = np.clip(middle + grid, 0.0, 1.0)
        found = squares(space.values(shares))
        place = int(found.argmin())
        if found[place] < best:
            best, middle = float(found[place]), shares[place]
        # The neighbours of the first grid's best lie within the second one.
        width = 1.5 / (len(ticks) - 1) if step == 0 else width / 3.0
        ticks = np.linspace(0.0, 1.0, AROUND)
    return best
