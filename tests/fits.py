"""Hand-made fits and diagnoses, on which advice and plans have closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.terms import Hypothesis
from dogshape.sim.effect import Effect, Parameter
from tests.toy import EFFECTS, bench_of, points_of

Array = NDArray[np.float64]
POINTS = points_of((235.2, 641.5))
BENCH = bench_of({}, np.random.default_rng(1), shifts=10, points=POINTS)
SETTING = setting_of(BENCH)
CELLS = len(POINTS)
#: Constants of the advice and of the errors, as the diagnosis has them.
SETTINGS = SimpleNamespace(
    named=0.8,
    unlisted=0.15,
    imitated=0.5,
    hour=0.04,
    test_error=0.05,
    model_error=0.0,
    least_error=1e-9,
    unlisted_sizes=(0.1, 0.8),
    flight_freedom=5.0,
    discrepancy=0.05,
    spread_share=0.2,
    spread_error=0.0,
    prior=lambda name: 0.05,
)


@dataclass(frozen=True)
class Space:
    """Parameters of some effects as a unit cube."""

    effects: tuple[Effect, ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, effect by effect."""
        return tuple(p for effect in self.effects for p in effect.parameters)

    def columns(self, name: str) -> slice:
        """Find the columns of an effect."""
        sizes = [len(effect.parameters) for effect in self.effects]
        place = [effect.name for effect in self.effects].index(name)
        return slice(sum(sizes[:place]), sum(sizes[: place + 1]))

    def values(self, shares: Array) -> Array:
        """Return the values at shares (m, p)."""
        columns = [[p.at(s) for s in shares[:, k].tolist()] for k, p in enumerate(self.parameters)]
        return np.array(columns).T.reshape(shares.shape)


@dataclass(frozen=True)
class Predicted:
    """Predicted shift times, (m, C)."""

    mean: Array
    sd: Array
    error: Array
    engaged: Array
    delay: Array


def predicted(
    mean: Array, sd: float = 0.02, error: float = 1e-3, engaged: float = 1.0
) -> Predicted:
    """Make a prediction of one spread and error from means (m, C)."""
    ones = np.ones_like(mean)
    return Predicted(mean, sd * ones, error * ones, engaged * ones, 0.0 * ones)


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis: equally weighted draws."""

    space: Space
    shares: Array
    predicted: Predicted
    offset: Array

    @property
    def values(self) -> Array:
        """Values of the draws, (K, p)."""
        return self.space.values(self.shares)


def fit_of(
    hypothesis: Hypothesis, shares: float | Array = 0.5, time: float = 0.3, count: int = 64
) -> Fit:
    """Fit a hypothesis by draws of its shares, and one mean time everywhere."""
    space = Space(tuple(EFFECTS[name] for name in hypothesis))
    rows = np.broadcast_to(shares, (count, len(space.parameters)))
    mean = np.full((count, CELLS), time)
    return Fit(space, np.array(rows), predicted(mean), 0.0 * mean)


def diagnosis_of(
    posterior: Mapping[Hypothesis, float],
    fits: Mapping[Hypothesis, Fit],
    bench: Bench = BENCH,
    **more: Any,
) -> Any:
    """Make a diagnosis of a posterior; shifts at each point as the bench has them, of 0.3 s."""
    seen = SimpleNamespace(count=np.full(CELLS, 10.0), mean=np.full(CELLS, 0.3))
    names = {name for h in fits for name in h} | set(more.pop("menu", ()))
    given = {
        "bench": bench,
        "posterior": dict(posterior),
        "fits": dict(fits),
        "effects": {name: EFFECTS[name] for name in sorted(names)},
        "settings": SETTINGS,
        "model": SimpleNamespace(setting=SETTING),
        "seen": seen,
        "readings": (),
    }
    return SimpleNamespace(**(given | more))


def at_times(fit: Fit, mean: Array) -> Fit:
    """Return a fit with other mean times, (K, C) or (C,)."""
    whole = np.broadcast_to(mean, fit.predicted.mean.shape)
    return replace(fit, predicted=replace(fit.predicted, mean=np.array(whole)))
