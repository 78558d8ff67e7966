"""Prices of a study's limits: the best expected shift time if one limit were another.

Designs that fill the space, and more about the best of them under each limit, are checked by
closed forms and predicted by the surrogate. Where an upper bound L becomes f L a design passes with
a margin of 1 - f, where a lower one does with f - 1: so one pool of designs gives all curves.
Landing and other simulated limits are left out, as nothing predicts them here. Where a study bounds
the smallest margin with tolerances at their worst, margins are taken there, and the price of that
limit itself is what the best time gains with tolerances left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Protocol

import numpy as np
import plotly.graph_objects as go
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import BLUE, GREEN, GREY, INK, ORANGE, RED, Row, styled
from dogshape.pipeline.reports.kit.text import check_name
from dogshape.pipeline.simulate.design import WORST, design_of
from dogshape.sim.errors import DogshapeError
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.dog_strength import margin_losses
from dogshape.surrogate.covariance import Array

FACTORS = (0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.25, 1.5)  #: on a limit
FILLING = 13  #: power of two of designs that fill the space
ABOUT = 16  #: more designs about each of the best, in each round
NEAR = (
    0.08,
    0.04,
    0.02,
    0.01,
    0.005,
)  #: shares of the ranges about it, one for each round
CLEAR = 2e-4  #: s for a tenth of a limit from which it has a price
#: Natural step of a limit by its unit, for what a step costs.
STEPS = {"mm": 0.1, "N": 1000.0, "MPa": 100.0, "deg": 1.0, "": 0.01, "s": 0.001}


#: Colour, dash and mark of a line each; there are no more lines than these.
SERIES = (
    (BLUE, "solid", "circle"),
    (ORANGE, "dash", "square"),
    (GREEN, "dot", "diamond"),
    (RED, "dashdot", "triangle-up"),
    (INK, "longdash", "x"),
    (GREY, "solid", "cross"),
)


class Times(Protocol):
    """Expected times of designs."""

    def predict(self, designs: Array) -> tuple[Array, Array]:
        """Predict expected times of designs (m, d) with their errors, each (m,), s."""


@dataclass(frozen=True)
class Pool:
    """Designs (m, d) with predicted times in s, (m,), and the margin of each check, (m, c).

    ``nominal`` are the margins without tolerances.
    """

    designs: Array
    times: Array
    margins: Array
    nominal: Array

    def best(self, place: int, needed: float) -> int | None:
        """Find the fastest design that keeps all limits, with another margin of one check."""
        least = np.zeros(self.margins.shape[1])
        least[place] = needed
        return self._fastest(self.margins, least)

    @property
    def best_nominal(self) -> int | None:
        """The fastest design that keeps all limits at nominal size."""
        return self._fastest(self.nominal, np.zeros(self.nominal.shape[1]))

    def joined(self, other: Pool) -> Pool:
        """Join the designs of two pools."""
        pairs = zip(astuple(self), astuple(other), strict=True)
        return Pool(*(np.concatenate(pair) for pair in pairs))

    def _fastest(self, margins: Array, least: Array) -> int | None:
        fit = np.flatnonzero((margins >= least).all(axis=1))
        return int(fit[np.argmin(self.times[fit])]) if fit.size else None


def prices(study: Setup, times: Times, seed: int = 1) -> list[Row]:
    """Compute what each limit of a study costs, dearest first.

    Each row has the check's ``name``, ``key``, ``unit`` and ``limit``, the ``price_s`` of a tenth
    of the limit (between 0.9 and 1.1 of it), and a ``curve`` of limits with the best time in s
    under each, None where no design passes. Limits that are zero have no price, but for that on
    tolerances at their worst: its ``price_s`` is what the best time, ``as_is_s``, loses on that
    ``without_s`` it; it has no curve.
    """
    checks = _checks(study, study.prototype)
    if not checks or not study.variables:
        return []
    pool = _pool(study, times, checks, seed)
    found = _price_of_tolerances(study, pool)
    for place, check in enumerate(checks):
        if check.limit <= 0.0:
            continue
        curve = []
        for factor in FACTORS:
            best = pool.best(place, _needed(check, factor))
            curve.append((factor * check.limit, None if best is None else float(pool.times[best])))
        at = dict(zip(FACTORS, (time for _, time in curve), strict=True))
        low, high = at[0.9], at[1.1]
        price = None if low is None or high is None else 0.5 * abs(high - low)
        found.append(
            {
                "name": check.name,
                "key": check.rule.key,
                "unit": check.unit,
                "limit": check.limit,
                "at_most": check.rule.at_most,
                "price_s": price,
                "curve": curve,
            }
        )
    return sorted(found, key=lambda row: -(row["price_s"] or 0.0))


def _price_of_tolerances(study: Setup, pool: Pool) -> list[Row]:
    """Compute what the limit on tolerances at their worst costs; none without it."""
    if WORST not in (study.file.search.limits or {}):
        return []
    ends = (pool.best(0, 0.0), pool.best_nominal)
    as_is, without = (None if end is None else float(pool.times[end]) for end in ends)
    return [
        {
            "name": WORST,
            "key": f"search.limits.{WORST}",
            "unit": "",
            "limit": (study.file.search.limits or {})[WORST],
            "at_most": False,
            "price_s": None if as_is is None or without is None else as_is - without,
            "as_is_s": as_is,
            "without_s": without,
            "curve": [],
        }
    ]


def dear(rows: Sequence[Row]) -> list[Row]:
    """Select the limits that have a price."""
    return [row for row in rows if row["price_s"] is None or row["price_s"] >= CLEAR]


def step_price(row: Row) -> tuple[float, float] | None:
    """Give the natural step of a limit in its unit, and the ms that the step costs."""
    step = STEPS.get(row["unit"])
    if step is None or row["price_s"] is None or not row["curve"]:
        return None
    return step, 1e3 * row["price_s"] * step / (0.1 * row["limit"])


def at_factor(row: Row, factor: float) -> float | None:
    """Read the best time in s where the limit is ``factor`` times as large."""
    if not row["curve"]:
        return row["as_is_s"] if factor == 1.0 else None
    time: float | None = dict(zip(FACTORS, (t for _, t in row["curve"]), strict=True))[factor]
    return time


def prices_figure(rows: Sequence[Row]) -> go.Figure:
    """Draw the best predicted time over each dear limit, as a share of what it is."""
    figure = go.Figure()
    curved = [row for row in rows if row["curve"]]
    for (color, dash, symbol), row in zip(SERIES, curved, strict=False):
        times = [None if t is None else 1e3 * t for _, t in row["curve"]]
        sign = "≤" if row["at_most"] else "≥"
        figure.add_scatter(
            x=[100.0 * factor for factor in FACTORS],
            y=times,
            mode="lines+markers",
            name=f"{check_name(row['name'])} {sign} {row['limit']:.4g} {row['unit']}".strip(),
            line={"color": color, "dash": dash},
            marker={"symbol": symbol, "size": 8},
            customdata=[[limit, row["unit"]] for limit, _ in row["curve"]],
            hovertemplate="limit %{customdata[0]:.4g} %{customdata[1]}: %{y:.1f} ms",
        )
    figure.add_vline(x=100.0, line_dash="dot", line_color="grey")
    figure.update_xaxes(title="limit, % of what the study asks")
    figure.update_yaxes(title="best expected shift time, ms")
    return styled(figure, height=380)


def _needed(check: Check, factor: float) -> float:
    """Give the margin to the limit as it is that a design needs under ``factor`` times of it."""
    return 1.0 - factor if check.rule.at_most else factor - 1.0


def _checks(study: Setup, params: dict[str, float]) -> tuple[Check, ...]:
    """Work out the checks of a design that need no simulation; none of what is no dog."""
    try:
        checks = design_of(study, params).checks
    except DogshapeError:
        return ()
    return tuple(check for check in checks if check.name != WORST)


def _margins(study: Setup, designs: Array, count: int) -> tuple[Array, Array]:
    """Compute the margins of the designs that count and the nominal ones; no dog has none."""
    rows, nominal = np.full((2, len(designs), count), -np.inf)
    worst = WORST in (study.file.search.limits or {})
    for place, row in enumerate(designs.tolist()):
        params = study.named(row)
        if not (checks := _checks(study, params)):
            continue
        rows[place] = nominal[place] = [check.margin for check in checks]
        if worst and (rows[place] < 0.0).sum() <= 1:
            lost = margin_losses(study.dog_with(params), study.limits)
            rows[place] -= [lost[c.name].worst_case if c.name in lost else 0.0 for c in checks]
    return rows, nominal


def _pool(study: Setup, times: Times, checks: Sequence[Check], seed: int) -> Pool:
    """Fill the space, then look about the best design under each limit."""
    bounds = np.array(list(study.variables.values()))
    whole = np.array([name == "count" for name in study.variables])
    rng = np.random.default_rng(seed)

    def real(shares: Array) -> Array:
        designs = bounds[:, 0] + np.clip(shares, 0.0, 1.0) * (bounds[:, 1] - bounds[:, 0])
        return np.where(whole, np.rint(designs), designs)

    def looked_at(designs: Array) -> Pool:
        margins, nominal = _margins(study, designs, len(checks))
        # What breaks two limits or one by far can be the best under none of the curves.
        near = ((margins < 0.0).sum(axis=1) <= 1) | (nominal >= 0.0).all(axis=1)
        designs, margins, nominal = designs[near], margins[near], nominal[near]
        found = times.predict(designs)[0] if len(designs) else np.zeros(0)
        return Pool(designs, found, margins, nominal)

    sampler = qmc.Sobol(len(bounds), seed=rng)
    pool = looked_at(real(sampler.random_base2(FILLING)))
    for near in NEAR:
        every = {
            pool.best(place, _needed(check, factor))
            for place, check in enumerate(checks)
            for factor in FACTORS
        } | {pool.best_nominal}
        elite = sorted(place for place in every if place is not None)
        if not elite:
            break
        span = bounds[:, 1] - bounds[:, 0]
        about = np.repeat((pool.designs[elite] - bounds[:, 0]) / span, ABOUT, axis=0)
        pool = pool.joined(looked_at(real(about + rng.normal(0.0, near, about.shape))))
    return pool
