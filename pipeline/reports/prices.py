"""Prices of a study's limits: the best expected shift time if one limit were another.

Designs that fill the space, and more about the best of them under each limit, are checked by
closed forms and predicted by the surrogate. Where an upper bound L becomes f L a design passes with
a margin of 1 - f, where a lower one does with f - 1: so one pool of designs answers for all limits.
Landing and other simulated limits are left out. Where a study bounds the smallest margin at
worst-case tolerances, margins are taken there. Tolerances are a limit too: f times as large they
take f times as much from each margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import qmc

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.charts import Row
from dogshape.pipeline.reports.text import check_name, in_ms
from dogshape.pipeline.simulate.design import WORST, design_of
from dogshape.sim.errors import DogshapeError
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.dog_strength import margin_losses
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.model import Surrogate

FACTORS = {"less_s": 0.9, "now_s": 1.0, "more_s": 1.1}  #: on a limit, by the key of the best time
FILLING = 13  #: power of two of designs that fill the space
ABOUT = 16  #: more designs about each of the best, in each round
NEAR = (0.08, 0.04, 0.02, 0.01, 0.005)  #: shares of the ranges about it, one for each round
CLEAR = 2e-4  #: s for a tenth of a limit from which it has a price
#: Natural step of a limit by its unit, for what a step costs.
STEPS = {"mm": 0.1, "N": 1000.0, "MPa": 100.0, "deg": 1.0, "": 0.01, "s": 0.001, "%": 10.0}
TOLERANCES = "tolerances at their worst"  #: row of all tolerances together, in % of what they are


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


def prices(study: Setup, times: Surrogate, seed: int = 1) -> list[Row]:
    """Compute what each limit of a study costs, in the order of its checks.

    Each row has the check's ``name``, ``key``, ``unit``, ``limit`` and ``at_most``, and the best
    times in s with a tenth less of the limit, the limit as it is, a tenth more of it, and
    ``without_s`` it; None where no design passes. Limits that are zero have no price.
    """
    checks = _checks(study, study.prototype)
    if not checks or not study.variables:
        return []
    pool, found = _pool(study, times, checks, seed), list[Row]()
    for place, check in enumerate(checks):
        if check.limit > 0.0:
            found.append({
                "name": check.name, "key": check.rule.key, "unit": check.unit,
                "limit": check.limit, "at_most": check.rule.at_most,
                **{key: pool.time(place, _needed(check, f)) for key, f in FACTORS.items()},
                "without_s": pool.time(place, -np.inf),
            })  # fmt: skip
    if pool.losses.any():
        found.append({
            "name": TOLERANCES, "key": "[tolerance]", "unit": "%", "limit": 100.0, "at_most": True,
            **{key: pool.time(None, tolerances=factor) for key, factor in FACTORS.items()},
            "without_s": pool.time(None, tolerances=0.0),
        })  # fmt: skip
    return found


def price_of(row: Row) -> float | None:
    """Compute the price of a tenth of a limit, s; None where no design keeps a tighter one."""
    less, more = row["less_s"], row["more_s"]
    return None if less is None or more is None else 0.5 * abs(less - more)


def prices_table(rows: Sequence[Row]) -> Table:
    """Tabulate the limits that have a price, the dearest first; those of the same times once."""
    found: dict[tuple[float | None, ...], Row] = {}
    for row in rows:
        times = tuple(row[key] for key in (*FACTORS, "without_s"))
        price, saved = price_of(row), (row["now_s"] or 0.0) - (row["without_s"] or 0.0)
        if price is None or max(price, saved) >= CLEAR:
            one = found.setdefault((row["limit"], *times), {**row, "names": [], "worth": saved})
            one["names"].append(f"{check_name(row['name'])} {row['key']}")
            one["worth"] = max(one["worth"], price or 0.0)
    lines = []
    for row in sorted(found.values(), key=lambda one: -one["worth"]):
        price, step = price_of(row), STEPS.get(row["unit"])
        words = ""
        if price is not None and step is not None:
            words = f"{1e4 * price * step / row['limit']:.2g} ms per {step:g} {row['unit']}".strip()
        lines.append([
            "\n".join(row["names"]),
            f"{'≤' if row['at_most'] else '≥'} {row['limit']:.4g} {row['unit']}",
            *(in_ms(row[key]) if row[key] is not None else "no design"
              for key in (*FACTORS, "without_s")),
            words,
        ])  # fmt: skip
    heads = "limit", "as it is", "a tenth less, ms", "as it is, ms", "a tenth more, ms"
    note = (
        "Best expected shift time that the surrogate predicts of any design which keeps all other "
        "limits, if one were another. Limits that are not listed cost nothing. Without landing and "
        "other simulated limits, and without the surrogate's error."
    )
    return Table((*heads, "without it, ms", "price"), lines, note=note)


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
            if worst:
                lost = margin_losses(study.dog_with(params), study.limits)
                losses[place] += [lost[c.name].worst_case if c.name in lost else 0 for c in checks]
    return rows, losses


def _pool(study: Setup, times: Surrogate, checks: Sequence[Check], seed: int) -> Pool:
    """Fill the space, then look about the best design under each limit."""
    bounds = np.array(list(study.variables.values()))
    whole = np.array([name == "count" for name in study.variables])
    rng = np.random.default_rng(seed)

    def pooled(shares: Array) -> Pool:
        designs = bounds[:, 0] + np.clip(shares, 0.0, 1.0) * np.ptp(bounds, axis=1)
        designs = np.where(whole, np.rint(designs), designs)
        margins, losses = _margins(study, designs, len(checks))
        # What breaks two limits or one by far can be the best under none of the cases.
        near = (margins < 0.0).sum(axis=1) <= 1
        designs, margins, losses = designs[near], margins[near], losses[near]
        found = times.predict(designs)[0] if len(designs) else np.zeros(0)
        return Pool(designs, found, margins, losses)

    pool = pooled(qmc.Sobol(len(bounds), seed=rng).random_base2(FILLING))
    for near in NEAR:
        every = {
            pool.best(place, needed)
            for place, check in enumerate(checks)
            for needed in (-np.inf, *(_needed(check, factor) for factor in FACTORS.values()))
        }
        every |= {pool.best(None, tolerances=factor) for factor in (0.0, *FACTORS.values())}
        elite = sorted(place for place in every if place is not None)
        if not elite:
            break
        about = np.repeat((pool.designs[elite] - bounds[:, 0]) / np.ptp(bounds, axis=1), ABOUT, 0)
        more = pooled(about + rng.normal(0.0, near, about.shape))
        pool = Pool(
            np.concatenate([pool.designs, more.designs]),
            np.concatenate([pool.times, more.times]),
            np.concatenate([pool.margins, more.margins]),
            np.concatenate([pool.losses, more.losses]),
        )
    return pool
