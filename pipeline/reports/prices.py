"""Prices of a study's limits: the best expected shift time if one limit were another.

Designs that fill the space, and more about the best of them under each limit, are checked by
closed forms and predicted by the surrogate. Where an upper bound L becomes f L a design passes with
a margin of 1 - f, where a lower one does with f - 1: so one pool of designs gives all curves.
Landing and other simulated limits are left out, as nothing predicts them here. Where a study bounds
the smallest margin at worst-case tolerances, margins are taken there. Tolerances are a limit too: f
times as large they take f times as much from each margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.look import Row
from dogshape.pipeline.simulate.design import WORST, design_of
from dogshape.sim.errors import DogshapeError
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.dog_strength import margin_losses
from dogshape.surrogate.covariance import Array

FACTORS = (0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.25, 1.5)  #: on a limit
FILLING = 13  #: power of two of designs that fill the space
ABOUT = 16  #: more designs about each of the best, in each round
NEAR = (0.08, 0.04, 0.02, 0.01, 0.005)  #: shares of the ranges about it, one for each round
CLEAR = 2e-4  #: s for a tenth of a limit from which it has a price
#: Natural step of a limit by its unit, for what a step costs.
STEPS = {"mm": 0.1, "N": 1000.0, "MPa": 100.0, "deg": 1.0, "": 0.01, "s": 0.001, "%": 10.0}
TOLERANCES = "tolerances at their worst"  #: row of all tolerances together, in % of what they are


class Times(Protocol):
    """Expected times of designs."""

    def predict(self, designs: Array) -> tuple[Array, Array]:
        """Predict expected times of designs (m, d) with their errors, each (m,), s."""


@dataclass(frozen=True)
class Pool:
    """Designs (m, d) with predicted times in s, (m,), margins of each check and losses, (m, c)."""

    designs: Array
    times: Array
    margins: Array
    losses: Array

    def best(self, place: int | None, needed: float = 0.0, tolerances: float = 1.0) -> int | None:
        """Find the fastest design that keeps all limits, with another margin of one check.

        ``tolerances`` is the factor on what they take from each margin.
        """
        left = self.margins - tolerances * self.losses
        if place is not None:
            left[:, place] -= needed
        fit = np.flatnonzero((left >= 0.0).all(axis=1))
        return int(fit[np.argmin(self.times[fit])]) if fit.size else None

    def time(self, place: int | None, needed: float = 0.0, tolerances: float = 1.0) -> float | None:
        """Find the time of that design, s."""
        best = self.best(place, needed, tolerances)
        return None if best is None else float(self.times[best])


def prices(study: Setup, times: Times, seed: int = 1) -> list[Row]:
    """Compute what each limit of a study costs, dearest first.

    Each row has the check's ``name``, ``key``, ``unit`` and ``limit``, the ``price_s`` of a tenth
    of the limit (between 0.9 and 1.1 of it), the best time ``without_s`` the limit, and a ``curve``
    of limits with the best time in s under each, None where no design passes. Limits that are zero
    have no price.
    """
    checks = _checks(study, study.prototype)
    if not checks or not study.variables:
        return []
    pool = _pool(study, times, checks, seed)
    found = []
    for place, check in enumerate(checks):
        if check.limit <= 0.0:
            continue
        found.append(
            {
                "name": check.name,
                "key": check.rule.key,
                "unit": check.unit,
                "limit": check.limit,
                "at_most": check.rule.at_most,
                **_priced([pool.time(place, _needed(check, factor)) for factor in FACTORS],
                          check.limit, pool.time(place, -np.inf)),
            }
        )  # fmt: skip
    if pool.losses.any():
        scaled = [pool.time(None, tolerances=factor) for factor in FACTORS]
        words: Row = {"name": TOLERANCES, "key": "[tolerance]", "unit": "%", "limit": 100.0}
        priced = _priced(scaled, 100.0, pool.time(None, tolerances=0.0))
        found.append({**words, "at_most": True, **priced})
    return sorted(found, key=lambda row: -max(row["price_s"] or 0.0, _saved(row)))


def _priced(times: Sequence[float | None], limit: float, without: float | None) -> Row:
    """Record the times under each of ``FACTORS``, and the price of a tenth of the limit."""
    at = dict(zip(FACTORS, times, strict=True))
    low, high = at[0.9], at[1.1]
    price = None if low is None or high is None else 0.5 * abs(high - low)
    curve = [(factor * limit, time) for factor, time in at.items()]
    return {"price_s": price, "curve": curve, "without_s": without}


def _saved(row: Row) -> float:
    """Compute the time that is saved without a limit, s; 0 where it is not known."""
    now, without = at_factor(row, 1.0), row.get("without_s")
    return 0.0 if now is None or without is None else now - without


def dear(rows: Sequence[Row]) -> list[Row]:
    """Select the limits that have a price; those of the same times are one row."""
    found: dict[tuple[float | None, ...], Row] = {}
    for row in rows:
        if row["price_s"] is None or max(row["price_s"], _saved(row)) >= CLEAR:
            times = (row["limit"], *(time for _, time in row["curve"]))
            one = found.setdefault(times, row)
            if one is not row:
                joined = {key: f"{one[key]}, {row[key]}" for key in ("name", "key")}
                found[times] = {**one, **joined}
    return list(found.values())


def step_price(row: Row) -> tuple[float, float] | None:
    """Give the natural step of a limit in its unit, and the ms that the step costs."""
    step = STEPS.get(row["unit"])
    if step is None or row["price_s"] is None:
        return None
    return step, 1e3 * row["price_s"] * step / (0.1 * row["limit"])


def at_factor(row: Row, factor: float) -> float | None:
    """Read the best time in s where the limit is ``factor`` times as large."""
    time: float | None = dict(zip(FACTORS, (t for _, t in row["curve"]), strict=True))[factor]
    return time


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
    """Compute margins of exact designs, and what tolerances take of them; of no dog none."""
    rows, losses = np.full((len(designs), count), -np.inf), np.zeros((len(designs), count))
    worst = WORST in (study.file.search.limits or {})
    exact = replace(study.limits, tolerances=study.limits.tolerances.without_sizes())
    bare = replace(study, limits=exact)
    for place, row in enumerate(designs.tolist()):
        params = study.named(row)
        if not (checks := _checks(bare, params)):
            continue
        rows[place] = [check.margin for check in checks]
        if (rows[place] < 0.0).sum() <= 1:
            losses[place] = rows[place] - [check.margin for check in _checks(study, params)]
        if worst and (rows[place] < 0.0).sum() <= 1:
            lost = margin_losses(study.dog_with(params), study.limits)
            losses[place] += [lost[c.name].worst_case if c.name in lost else 0.0 for c in checks]
    return rows, losses


def _pool(study: Setup, times: Times, checks: Sequence[Check], seed: int) -> Pool:
    """Fill the space, then look about the best design under each limit."""
    bounds = np.array(list(study.variables.values()))
    whole = np.array([name == "count" for name in study.variables])
    rng = np.random.default_rng(seed)

    def real(shares: Array) -> Array:
        designs = bounds[:, 0] + np.clip(shares, 0.0, 1.0) * (bounds[:, 1] - bounds[:, 0])
        return np.where(whole, np.rint(designs), designs)

    def looked_at(designs: Array) -> Pool:
        margins, losses = _margins(study, designs, len(checks))
        # What breaks two limits or one by far can be the best under none of the curves.
        near = (margins < 0.0).sum(axis=1) <= 1
        designs, margins, losses = designs[near], margins[near], losses[near]
        found = times.predict(designs)[0] if len(designs) else np.zeros(0)
        return Pool(designs, found, margins, losses)

    sampler = qmc.Sobol(len(bounds), seed=rng)
    pool = looked_at(real(sampler.random_base2(FILLING)))
    for near in NEAR:
        every = {
            pool.best(place, needed)
            for place, check in enumerate(checks)
            for needed in (-np.inf, *(_needed(check, factor) for factor in FACTORS))
        }
        every |= {pool.best(None, tolerances=factor) for factor in (0.0, *FACTORS)}
        elite = sorted(place for place in every if place is not None)
        if not elite:
            break
        span = bounds[:, 1] - bounds[:, 0]
        about = np.repeat((pool.designs[elite] - bounds[:, 0]) / span, ABOUT, axis=0)
        more = looked_at(real(about + rng.normal(0.0, near, about.shape)))
        pool = Pool(
            np.vstack([pool.designs, more.designs]),
            np.concatenate([pool.times, more.times]),
            np.vstack([pool.margins, more.margins]),
            np.vstack([pool.losses, more.losses]),
        )
    return pool
