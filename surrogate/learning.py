"""From data to a surrogate: fitting it to what was simulated.

Parameters of a covariance are the likeliest ones, found with scikit-learn. The likelihood of many
rows is dear (its cost grows with their cube), so parameters come from a random part of them and the
data from all.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Kernel

from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array, Covariance, Term, starting
from dogshape.surrogate.dataset import Dataset, Mix, Reference, once, reference_of
from dogshape.surrogate.mix_times import TERMS as MIX_TERMS
from dogshape.surrogate.mix_times import MixTimes
from dogshape.surrogate.model import (
    MIN_DESIGNS,
    SMOOTH,
    TERMS,
    Share,
    Surrogate,
    fit_share,
    require_enough,
)
from dogshape.surrogate.process import (
    Process,
    design_coordinates,
    row_inputs,
    spread_targets,
    time_targets,
)


@dataclass(frozen=True)
class Effort:
    """Cost limit of a fit: rows that parameters are fitted to, drawn by seed, and steps."""

    rows: int = 600
    steps: int = 60
    seed: int = 0


EXACT = 1e-4  #: least relative error of a time
WHOLE = Effort()  #: of a fit that is kept
EFFORT = Effort(rows=400, steps=60)  #: of the process of the mix
POINT_EFFORT = Effort(rows=250, steps=15)  #: of each point, from the parameters of the mix


class PointKernel(Kernel):  # type: ignore[misc]
    """The covariance as scikit-learn's Gaussian process takes it."""

    def __init__(self, covariance: Covariance, limits: Array) -> None:
        self.covariance = covariance
        self.limits = limits

    @property
    def theta(self) -> Array:
        """Parameters, (size,)."""
        return self.covariance.theta

    @theta.setter
    def theta(self, theta: Array) -> None:
        known = self.covariance
        self.covariance = Covariance(known.terms, known.designs, known.points, np.array(theta))

    @property
    def bounds(self) -> Array:
        """Bounds of the parameters, (size, 2)."""
        return self.limits

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Return the covariance, with its slopes where they are asked for."""
        if eval_gradient:
            return self.covariance.slopes(X)
        return self.covariance.between(X, X if Y is None else Y)

    def diag(self, X: Array) -> Array:
        """Return the variance of each input."""
        return self.covariance.variance(X)

    def is_stationary(self) -> bool:
        """Report that the kernel is not stationary: it grows with the mismatch."""
        return False


@contextmanager
def bounds_unsaid() -> Iterator[None]:
    """Leave out the warning of a length scale at its bound: its coordinate does not matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        yield


def fit_process(
    terms: tuple[Term, ...],
    designs: int,
    data: tuple[Array, Array, Array],
    start: Array | None = None,
    effort: Effort = WHOLE,
) -> Process:
    """Return the likeliest process of inputs (n, d + p), targets (n,), noise variances (n,).

    ``designs`` is d; ``start`` are parameters to begin with, (size,).
    """
    inputs, targets, noise = data
    first, bounds = starting(terms, designs, inputs.shape[1] - designs)
    theta = first if start is None else np.clip(start, bounds[:, 0], bounds[:, 1])
    covariance = Covariance(terms, designs, inputs.shape[1] - designs, theta)
    if effort.steps == 0:
        return Process(covariance, inputs, targets, noise)
    few = np.random.default_rng(effort.seed).permutation(len(targets))[: effort.rows]
    regressor = GaussianProcessRegressor(
        PointKernel(covariance, bounds), alpha=noise[few], optimizer=partial(_minimum, effort.steps)
    )
    with bounds_unsaid():
        regressor.fit(inputs[few], targets[few] - targets.mean())
    return Process(regressor.kernel_.covariance, inputs, targets, noise)


def _minimum(steps: int, objective: Any, theta: Array, bounds: Array) -> tuple[Array, float]:
    found = minimize(
        objective, theta, method="L-BFGS-B", jac=True, bounds=bounds, options={"maxiter": steps}
    )
    return found.x, found.fun


def mix_times(about: Dataset, rows: Array, mix: Mix) -> MixTimes:
    """Collect the designs of rows (n, d + 8) that engage at every point of a mix.

    ``about`` has their variables, ranges and physics. InputError for fewer than ``MIN_DESIGNS``.
    """
    data = Dataset(about.variables, about.low, about.high, rows, about.physics, about.engine)
    found = reference_of(data, mix)
    if len(found) < MIN_DESIGNS:
        raise InputError(
            f"{len(found)} designs engage at every operating point of the study, but the expected "
            f"time over them needs at least {MIN_DESIGNS}; raise surrogate.mix_shifts, or "
            "give 0 to learn it from single points"
        )
    return MixTimes(mix, about, found.x, found.means, _noise(found, mix), data.shifts)


def _noise(found: Reference, mix: Mix) -> Array:
    """Return the mean variance of the logarithms, of the expected time and at each point."""
    whole = ((found.error / (found.means @ mix.weights)) ** 2).mean()
    each = ((found.errors / found.means) ** 2).mean(axis=0)
    return np.maximum(np.concatenate([[whole], each]), EXACT**2)


def fitted(times: MixTimes, effort: Effort = EFFORT, *, points: bool = True) -> MixTimes:
    """Fit the process of the mix and, with ``points``, one for each of its points.

    Those of the points are apart from each other, and share the cores.
    """
    inputs, targets = times.inputs, times.logarithms
    count = inputs.shape[1]

    def process(place: int, start: Array | None, effort: Effort) -> Process:
        noise = np.full(len(inputs), times.noise[place])
        return fit_process(MIX_TERMS, count, (inputs, targets[:, place], noise), start, effort)

    first = process(0, None, effort)
    others = range(1, targets.shape[1] if points else 1)
    start = first.covariance.theta
    # Filters of warnings are one for all threads, so they are set around them.
    with bounds_unsaid(), ThreadPoolExecutor(os.cpu_count()) as threads:
        each = list(threads.map(lambda place: process(place, start, POINT_EFFORT), others))
    return replace(times, processes=(first, *each))


def conditioned(times: MixTimes, rows: Array) -> MixTimes:
    """Add designs of rows (n, d + 8) that have every point of the mix; length scales stay.

    Each has the error of its own rows. What the processes miss them by is the least size of their
    rough term. Designs that do not engage at every point are left out.
    """
    about = times.about
    data = Dataset(about.variables, about.low, about.high, rows, about.physics, about.engine)
    found = reference_of(data, times.mix)
    if len(found) == 0:
        return times
    more = replace(
        times,
        x=np.concatenate([times.x, found.x]),
        means=np.concatenate([times.means, found.means]),
        shifts=times.shifts + data.shifts,
        scaled=len(times.x) if times.scaled is None else times.scaled,
    )
    relative = np.column_stack([found.error / found.time, found.errors / found.means])
    noise = np.maximum(relative**2, EXACT**2)
    fresh = np.log(np.column_stack([found.time, found.means])) + 0.5 * noise
    where = times.coordinates(found.x)
    apart = [fresh[:, k] - process.mean(where) for k, process in enumerate(times.processes)]
    each = [
        Process(
            process.covariance.rougher(float((apart[k] ** 2).mean()), where[:, :0]),
            more.inputs,
            np.concatenate([process.targets, fresh[:, k]]),
            np.concatenate([process.noise, noise[:, k]]),
        )
        for k, process in enumerate(times.processes)
    ]
    return replace(more, processes=tuple(each))


def fit(data: Dataset, like: Surrogate | None = None, effort: Effort = WHOLE) -> Surrogate:
    """Fit the surrogate to a data set; ``like`` is a fitted one to begin with.

    An effort of no steps keeps all parameters of ``like``.

    Raises InputError for fewer designs than ``surrogate.model.MIN_DESIGNS``.
    """
    require_enough(data)
    designs = design_coordinates(data, data.x[:1]).shape[1]
    theta = None if like is None else like.times.covariance.theta
    spread_theta = None if like is None else like.spreads.covariance.theta
    times = fit_process(TERMS, designs, time_targets(data), theta, effort)
    spreads = fit_process((SMOOTH,), designs, spread_targets(data), spread_theta, effort)
    counts = data.column("engaged"), data.column("shifts")
    where = row_inputs(data)
    if like is not None and effort.steps == 0:
        share = Share(designs, where, *counts, like.share.length, like.share.strength)
    else:
        share = fit_share(designs, where, counts, data.design_of_row)
    return Surrogate(data, times, spreads, share)


def condition(surrogate: Surrogate, rows: Array) -> Surrogate:
    """Add simulated rows (n, d + 8) to a surrogate, whose length scales stay.

    What it misses them by is the least size of its rough term: it then follows them, and its
    intervals say that other designs may be missed as much.
    """
    data = replace(surrogate.data, rows=once(np.concatenate([surrogate.data.rows, rows])))
    there = replace(data, rows=rows[np.isfinite(replace(data, rows=rows).column("mean_s"))])
    start = surrogate
    if len(there):
        inputs, targets, _ = time_targets(there)
        apart = float(((targets - surrogate.times.mean(inputs)) ** 2).mean())
        covariance = surrogate.times.covariance
        covariance = covariance.rougher(apart, covariance.split(inputs)[1])
        start = replace(surrogate, times=replace(surrogate.times, covariance=covariance))
    model = fit(data, like=start, effort=Effort(steps=0))
    own = None if surrogate.own is None else conditioned(surrogate.own, rows)
    return replace(model, own=own)
