"""From data to a surrogate: fitting it to what was simulated."""

from __future__ import annotations

from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.engaged_share import Share, fit_share
from dogshape.surrogate.fitting import WHOLE, Effort, fit_process
from dogshape.surrogate.model import ALTERNATIVES, SMOOTH, USUAL, Surrogate, require_enough
from dogshape.surrogate.process_targets import (
    design_coordinates,
    row_inputs,
    spread_targets,
    time_targets,
)


def fit(
    data: Dataset,
    form: str = USUAL,
    like: Surrogate | None = None,
    effort: Effort = WHOLE,
) -> Surrogate:
    """Fit the surrogate to a data set; ``like`` is a fitted one to begin with.

    An effort of no steps keeps all parameters of ``like``.

    Raises InputError for fewer designs than ``surrogate.model.MIN_DESIGNS``.
    """
    require_enough(data)
    ridge = ALTERNATIVES[form].ridge
    designs = design_coordinates(data, data.x[:1], ridge).shape[1]
    first = None if like is None or like.form != form else like
    theta = None if first is None else first.times.covariance.theta
    spread_theta = None if first is None else first.spreads.covariance.theta
    terms = ALTERNATIVES[form].terms
    times = fit_process(terms, designs, time_targets(data, ridge), theta, effort)
    spreads = fit_process((SMOOTH,), designs, spread_targets(data, ridge), spread_theta, effort)
    counts = data.column("engaged"), data.column("shifts")
    where = row_inputs(data, ridge)
    if like is not None and effort.steps == 0:
        share = Share(designs, where, *counts, like.share.length, like.share.strength)
    else:
        share = fit_share(designs, where, counts, data.design_of_row)
    return Surrogate(data, form, times, spreads, share)
