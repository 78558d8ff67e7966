"""Drift over the series: its size given the data, and whether it can be told from an effect.

Values are drawn from the posterior of all hypotheses, *unknown* among them, and with each the
coefficient of the drift (``diagnosis.likelihood.drift``). Where operating points were run in the
order of their mismatch or force, and none was repeated, a trend and an effect look alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dogshape.diagnosis.inference.equivalence import Interval90
from dogshape.diagnosis.inference.ranking import Ranking
from dogshape.diagnosis.likelihood.discrepancy import beside_draws, posterior_draws
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import UNKNOWN
from dogshape.diagnosis.terms import Array

DRAWN = 4000  #: values over all hypotheses
REPEAT = "repeat a reference point at the beginning, in the middle and at the end"


@dataclass(frozen=True)
class SeriesDrift:
    """Trend of the shift times over the series.

    Parameters
    ----------
    share : drift over the whole series as a share of the mean time, with its 90 % interval.
    slope : the same of the mean of all shifts, s.
    direction : probability that it has the sign of its median.
    significant : whether that is enough for it to be said.
    rank_correlation : of the order of the shifts with mismatch and force.
    in_order_of : of these, those that a drift cannot be told from.
    """

    share: Interval90
    slope: Interval90
    direction: float
    significant: bool
    rank_correlation: dict[str, float]
    in_order_of: tuple[str, ...]

    @property
    def worth_saying(self) -> bool:
        """Test that a reader of the verdict has to know of it."""
        return self.significant or bool(self.in_order_of)

    @property
    def sentence(self) -> str:
        """The drift in words."""
        slope = self.slope
        low, high = (f"{1e3 * end:.2g}" for end in (slope.low, slope.high))
        interval = f"90 % interval {low} to {high} ms"
        if self.significant:
            found = (
                f"Shift times drift by {1e3 * slope.median:+.2g} ms over the series ({interval}): "
                f"{REPEAT}."
            )
        else:
            found = f"No drift of the shift times over the series is seen ({interval})."
        if not self.in_order_of:
            return found
        those = " and ".join(
            f"{name} (rank correlation {self.rank_correlation[name]:.2f})"
            for name in self.in_order_of
        )
        names = " and ".join(self.in_order_of)
        return (
            f"{found} The operating points were run in the order of their {those}, so that a drift "
            f"of the stand cannot be told from an effect over {names}: run them in random order, "
            f"or {REPEAT}."
        )

    def as_dict(self) -> dict[str, Any]:
        """Write the record ``drift``."""
        return {
            "share": self.share.as_dict(),
            "slope_s": self.slope.as_dict(),
            "direction": self.direction,
            "significant": self.significant,
            "rank_correlation": self.rank_correlation,
            "in_order_of": list(self.in_order_of),
            "sentence": self.sentence,
        }


def series_drift(problem: Problem, ranking: Ranking) -> SeriesDrift | None:
    """Return the drift given the data; None where the order of the shifts is not known."""
    before, limits = problem.seen.drift, problem.settings.decision
    if before is None:
        return None
    share = before.mean + before.sd * _coefficients(problem, ranking)
    positive = float((share > 0.0).mean())
    direction = max(positive, 1.0 - positive)
    open_to = before.repeated < limits.drift_known
    apart = {n: r for n, r in before.order_of.items() if abs(r) > limits.in_order}
    return SeriesDrift(
        Interval90.of(share),
        Interval90.of(before.time * share),
        direction,
        direction > limits.drift_sure,
        before.order_of,
        tuple(apart) if open_to else (),
    )


def _coefficients(problem: Problem, ranking: Ranking) -> Array:
    """Draw the coefficient of the drift's direction over all hypotheses, (n,)."""
    generator, direction = np.random.default_rng(1), problem.seen.drift
    assert direction is not None
    found = []
    for hypothesis, probability in ranking.posterior.items():
        count = round(DRAWN * probability)
        if not count:
            continue
        if hypothesis == UNKNOWN:
            found.append(ranking.free.draw(direction.direction, count, generator))
            continue
        one = ranking.scored[hypothesis]
        rows = one.rows.only(one.draw(count, generator))
        parts = rows.slopes, problem.discrepancy, rows.joint
        off, _ = posterior_draws(*parts, generator)
        # The drift is the first of the errors beside the discrepancy.
        found.append(beside_draws(*parts, off, generator)[:, 0])
    return np.concatenate(found)
