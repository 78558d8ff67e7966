r"""Expected time of a design in two levels: its compiled shifts, corrected by some of Drake's.

A search screens each design by the compiled engine at many relative angles of every operating
point. At *n* of the *N* angles, with the same draws of what is uncertain, Drake simulates it too.
With :math:`a` what a shift costs, :math:`e` one where it engages and :math:`E' = \bar a'/\bar e'`
the time by the compiled engine, an operating point has

.. math:: E = E' + \overline{(z - z')}_n, \qquad z = \frac{a - E' e}{\bar e'},

the first step of Newton's method to the ratio of the means that pairs correct. It is unbiased to
first order for any number of pairs, one too, and has no share of a few shifts as a divisor.

The variance is that of the compiled engine's mean over even angles, and of the mean difference.
Both engines part at single angles, where a shift comes into another slot, and few pairs have none
of these. So squares of differences, over the expected time, are shared by the ``ALIKE`` operating
points nearest in mismatch, and in a search by all of its designs.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import SIMULATED, objectives_of
from dogshape.sim.errors import InputError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import ShiftResult, nested, variance_of_mean
from dogshape.surrogate.covariance import Array

SAID = {SIMULATED, "smallest_margin"}  #: simulated objectives that two levels say
ALIKE = 8  #: points nearest in mismatch that share the spread of differences
FULL = 4  #: times the angles of a screen that designs of the front are screened with


@dataclass(frozen=True)
class LevelTimes:
    """Shifts of one design in two levels at q operating points.

    Parameters
    ----------
    weights : of the operating points, of sum one, (q,).
    cheap : times of the compiled engine with their retries, in the order of N even angles, (q, N),
        s; their mean is the expected time of the point.
    even : whether every shift of a point engaged, so that the error is that of even angles, (q,).
    apart : Drake's time less the compiled engine's at n of the angles, (q, n), s.
    """

    weights: Array
    cheap: Array
    even: tuple[bool, ...]
    apart: Array

    @property
    def many(self) -> int:
        """Angles of the compiled engine at each operating point."""
        return self.cheap.shape[1]

    @property
    def few(self) -> int:
        """Angles of Drake at each operating point."""
        return self.apart.shape[1]

    @cached_property
    def means(self) -> Array:
        """Expected times by the compiled engine, (q,), s."""
        means: Array = self.cheap.mean(axis=1)
        return means

    @property
    def compiled(self) -> float:
        """Expected time over all points by the compiled engine, s."""
        return float(self.weights @ self.means)

    @property
    def correction(self) -> float:
        """Mean difference of the pairs over all points, s."""
        return float(self.weights @ self.apart.mean(axis=1))

    @property
    def time(self) -> float:
        """Expected time of the design in two levels, s."""
        return self.compiled + self.correction

    @cached_property
    def compiled_variances(self) -> Array:
        """Variance of the compiled engine's mean at each point, (q,), s2."""
        pairs = zip(self.cheap, self.even, strict=True)
        return np.array([variance_of_mean(times, even=even) for times, even in pairs])

    @property
    def compiled_variance(self) -> float:
        """Variance of the compiled engine's expected time over all points, s2."""
        return float(self.weights**2 @ self.compiled_variances)

    @property
    def squares(self) -> Array:
        """Mean square of a point's relative differences about the design's own, (q,)."""
        pairs = self.apart.size
        relative = self.apart / self.means[:, None] - self.correction / self.compiled
        squares: Array = (relative**2).mean(axis=1) * pairs / max(1, pairs - 1)
        return squares

    def correction_variances(self, squares: Array) -> Array:
        """Compute the variance of each point's mean difference, (q,), s2.

        ``squares`` (q,) are those that are believed of a single difference (``common_squares``).
        """
        return squares * self.means**2 / self.few

    def correction_variance(self, squares: Array) -> float:
        """Compute the variance of the correction over all points, s2."""
        return float(self.weights**2 @ self.correction_variances(squares))

    @property
    def record(self) -> dict[str, Any]:
        """Shifts as JSON can hold them, times of the compiled engine in single precision."""
        packed = base64.b64encode(self.cheap.astype("<f4").tobytes()).decode("ascii")
        return {"cheap_s": packed, "even": [*self.even], "apart_s": self.apart.tolist()}

    @classmethod
    def of_record(cls, study: Setup, record: Mapping[str, Any]) -> LevelTimes:
        """Read shifts of a design of a study."""
        weights, apart = _weights(study), np.array(record["apart_s"], dtype=float)
        packed = np.frombuffer(base64.b64decode(record["cheap_s"]), dtype="<f4")
        cheap = packed.astype(float).reshape(len(weights), -1)
        return cls(weights, cheap, tuple(record["even"]), apart)


def level_times(
    study: Setup, cheap: Sequence[Array], dear: Sequence[Array], seed: int, base: int
) -> LevelTimes:
    """Put the shifts of both engines together.

    Parameters
    ----------
    cheap, dear : at each operating point ``parts_of`` its shifts.
    seed, base : of the angles, as for ``sim.statistics.expectation.even_phases``.
    """
    lost = study.clutch.timeout + study.retraction
    times, even, apart = [], [], []
    for index, (many, few) in enumerate(zip(cheap, dear, strict=True)):
        size = many.shape[1]
        places = nested(few.shape[1], size, seed, index, base)
        engaged = float(many[1].mean())
        # Where none engages, the expectation is that of one in one shift more.
        share = engaged or 1.0 / (size + 1.0)
        mean = float(many[0].mean()) / share if engaged else study.clutch.timeout + size * lost
        scores = [(part[0] - mean * part[1]) / share for part in (many, few)]
        times.append(mean + scores[0] - scores[0].mean())
        even.append(engaged == 1.0)
        apart.append(scores[1] - scores[0][places])
    return LevelTimes(_weights(study), np.array(times), tuple(even), np.array(apart))


def parts_of(shifts: Sequence[ShiftResult], lost: float) -> Array:
    """Return times with costs of lost attempts, whether each engaged, and bare times, (3, n), s."""
    engaged = np.array([s.shift_time is not None for s in shifts], dtype=float)
    sound = np.array([s.outcome is not Outcome.DIVERGED for s in shifts], dtype=float)
    times = np.array([s.shift_time or 0.0 for s in shifts])
    return np.array([times + (sound - engaged) * lost, engaged, times])


def common_squares(study: Setup, squares: Array) -> Array:
    """Share mean squares of relative differences (q,) by the points alike in mismatch, (q,)."""
    speeds = np.array([abs(point.mismatch) for point in study.points])
    order = np.argsort(np.abs(np.subtract.outer(speeds, speeds)), axis=1, kind="stable")
    common: Array = squares[order[:, :ALIKE]].mean(axis=1)
    return common


def _weights(study: Setup) -> Array:
    weights = np.array([point.weight for point in study.points])
    return weights / weights.sum()


def holding(base: int, least: int) -> int:
    """Return the smallest number of angles, ``base`` doubled over and over, not below ``least``."""
    count = base
    while count < least:
        count *= 2
    return count


def compiled_angles(study: Setup) -> int:
    """Count the angles of the compiled engine at each operating point of a confirmed design."""
    search = study.file.search
    return holding(search.confirm_angles, FULL * (search.screen_angles or 1))


def require_levels(study: Setup) -> None:
    """Raise InputError for a study in two levels that two levels cannot say."""
    search = study.file.search
    if not study.two_levels:
        return
    named = f"search.levels = 2 of the study {study.name}"
    if study.clutch.solver.engine != "drake" or search.confirm_engine not in (None, "drake"):
        raise InputError(
            f"{named} has shifts of Drake correct the compiled engine's, but the study is that of "
            "the compiled engine; take solver.engine and search.confirm_engine out, or give "
            "--set search.levels=1"
        )
    if search.screen_angles is None:
        raise InputError(
            f"{named} needs the compiled shifts of a screen; give search.screen_angles, for "
            "instance 64"
        )
    if search.screen_angles != holding(search.pair_angles, search.screen_angles):
        raise InputError(
            f"{named}: search.screen_angles is {search.screen_angles}, but it must be "
            f"search.pair_angles ({search.pair_angles}) doubled over and over, so that both "
            f"engines have angles alike; give {holding(search.pair_angles, search.screen_angles)}"
        )
    told = {objective.name for objective in objectives_of(study) if objective.simulated}
    if others := sorted(told - SAID):
        raise InputError(
            f"{named} says expected times alone, but the study searches {', '.join(others)}; "
            "give search.levels = 1"
        )
