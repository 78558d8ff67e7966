r"""Equivalence: is what bench and simulation differ by too small to need anything done.

The gap of a cell is what the effects of a hypothesis change, and the discrepancy beside them
(``diagnosis.likelihood.discrepancy``), both drawn given the data, scatter of the shifts left out.
The mean time is that of all shifts, late ones too.
Over its margin, a share of the mean time but at least so many seconds, it is averaged as a root
mean square over the cells; a share engaged counts over its own margin. Bench and simulation are
equivalent where that stays below one (the two one-sided tests of Schuirmann 1987, as a posterior
probability). A gap of no known effect is never equivalent: nobody knows what it does elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.stand_file import Margin
from dogshape.diagnosis.likelihood.discrepancy import posterior_draws
from dogshape.diagnosis.likelihood.scores import PredictionSummary, Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.terms import Array, Hypothesis

DRAWN = 2000  #: values over all hypotheses


@dataclass(frozen=True)
class Interval90:
    """Posterior median, and the ends of 90 %."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, draws: Array) -> Interval90:
        """Summarise draws."""
        low, median, high = np.quantile(draws, (0.05, 0.5, 0.95))
        return cls(float(median), float(low), float(high))

    def as_dict(self) -> dict[str, Any]:
        """Write the numbers by name."""
        return {"median": self.median, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Equivalence:
    """Gap between bench and simulation, scatter left out, beside the margin.

    Parameters
    ----------
    margin : that nothing needs doing below, and its root mean square over the cells, s.
    probability : that the gap is within it.
    gap : root mean square over the cells, s, with its interval.
    left : the same of what the effects leave, which is the discrepancy.
    share : amplitude of the discrepancy, as share of a mean time.
    """

    margin: Margin
    margin_rms: float
    probability: float
    gap: Interval90
    left: Interval90
    share: Interval90

    def as_dict(self) -> dict[str, Any]:
        """Write the record ``discrepancy``."""
        return {
            "margin_share": self.margin.share,
            "margin_least_s": self.margin.least,
            "within_margin": self.probability,
            "gap_rms_s": self.gap.as_dict(),
            "left_rms_s": self.left.as_dict(),
            "amplitude": self.share.as_dict(),
        }


def equivalence(
    problem: Problem,
    scored: Mapping[Hypothesis, Scored],
    raw: Mapping[Hypothesis, float],
    unknown: float,
    margin: Margin,
) -> Equivalence | None:
    """Compute the probability that the gap is within its margin; None without a baseline.

    ``raw`` has the probability of each hypothesis by evidence: effects that cannot be seen count
    with what they may do. ``unknown`` is that of no known effect after all checks.
    """
    base = scored[NONE].rows.predicted
    having = (problem.seen.shifts > 0) & np.isfinite(base.mean[0])
    known = {h: p for h, p in raw.items() if h in scored}
    whole = sum(known.values())
    if not having.any() or whole <= 0.0:
        return None
    limit = margin.of(base.mean[0])[having]
    generator = np.random.default_rng(1)
    parts: list[tuple[Array, Array, Array, Array]] = []
    for hypothesis, probability in known.items():
        count = round(DRAWN * probability / whole)
        if count:
            parts.append(_gaps(problem, scored[hypothesis], base, count, generator))
    gaps, left, engaged, amplitude = (np.concatenate(one) for one in zip(*parts, strict=True))
    over = (gaps[:, having] / limit) ** 2 + (
        engaged[:, having] / problem.settings.decision.engaged_margin
    ) ** 2
    within = float((np.nan_to_num(over, nan=np.inf).mean(axis=1) < 1.0).mean())
    return Equivalence(
        margin,
        _rms(limit),
        within * (1.0 - unknown),
        Interval90.of(_rms_of(gaps[:, having])),
        Interval90.of(_rms_of(left[:, having])),
        Interval90.of(amplitude),
    )


def _gaps(
    problem: Problem,
    one: Scored,
    base: PredictionSummary,
    count: int,
    generator: np.random.Generator,
) -> tuple[Array, Array, Array, Array]:
    """Draw gaps, discrepancies, changes of the share engaged, (n, cells), and amplitudes, (n,)."""
    rows = one.rows.only(one.draw(count, generator))
    left, amplitude = posterior_draws(rows.slopes, problem.discrepancy, rows.joint, generator)
    gaps = rows.predicted.mean - base.mean + left
    return gaps, left, rows.predicted.engaged - base.engaged, amplitude


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def _rms_of(values: Array) -> Array:
    """Return root mean squares over cells (n, cells), (n,)."""
    found: Array = np.sqrt(np.nanmean(values**2, axis=1))
    return found
