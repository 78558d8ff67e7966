"""From designs simulated at every point of a mix to processes of their expected times."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from dogshape.sim.errors import InputError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.fitting import Effort, bounds_unsaid, fit_process
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.mix_times import TERMS, MixTimes
from dogshape.surrogate.model import MIN_DESIGNS
from dogshape.surrogate.process import Process
from dogshape.surrogate.references import Reference, reference_of

EFFORT = Effort(rows=400, steps=60)  #: of the process of the mix
POINT_EFFORT = Effort(rows=250, steps=15)  #: of each point, from the parameters of the mix
EXACT = 1e-4  #: least relative error of a time


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
        return fit_process(TERMS, count, (inputs, targets[:, place], noise), start, effort)

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
