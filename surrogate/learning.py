"""From data to a surrogate: fitting it to what was simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, once
from dogshape.surrogate.engaged_share import Share, fit_share
from dogshape.surrogate.fitting import WHOLE, Effort, fit_process
from dogshape.surrogate.mix_learning import conditioned
from dogshape.surrogate.model import SMOOTH, TERMS, Surrogate, require_enough
from dogshape.surrogate.process_targets import (
    design_coordinates,
    row_inputs,
    spread_targets,
    time_targets,
)


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
