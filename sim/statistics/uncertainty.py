"""Quantities that differ from shift to shift: friction, dissipation, shift force, inertia.

Each is a factor on its nominal value. The *n* shifts of an operating point have the *n* even
angles, each with one independent draw of the factors, the same for all designs: the standard error
of the mean includes the factors as scatter from angle to angle. If the number of angles is doubled,
the earlier angles keep their factors.

Distributions: ``normal`` (mean, sd), ``uniform`` (low, high), ``triangular`` (low, mode, high),
``lognormal`` (median *m*, factor *k*: two values of three lie between m/k and m k). ``low`` and
``high`` truncate a normal or lognormal: the quantile at *u* is :math:`F^{-1}(F(low) + u
(F(high) - F(low)))`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.clutch_tables import Section
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint

#: Numbers of each distribution; a normal and a lognormal may also have low and high.
NEEDS = {
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
    "lognormal": ("median", "factor"),
    "triangular": ("low", "mode", "high"),
}
TRUNCATED = ("normal", "lognormal")  #: distributions that low and high may truncate
MIN_TRUNCATED_SHARE = 1e-3  #: of a distribution within its truncation


class Distribution(Section):
    """A distribution of the value of a key, in the unit of the key.

    ``distribution`` is one of ``NEEDS``, which lists its numbers.
    """

    distribution: str
    mean: float | None = None
    sd: float | None = None
    median: float | None = None
    factor: float | None = None
    low: float | None = None
    mode: float | None = None
    high: float | None = None

    def checked(self, key: str) -> Distribution:
        """Return the distribution; raises InputError for its first mistake at ``key`` of a file."""
        for fault in self._faults():
            raise InputError(f"{key}{fault}")
        return self

    def _faults(self) -> Iterator[str]:
        """Yield the mistakes, as the end of a sentence that begins with the key."""
        kind = self.distribution
        if kind not in NEEDS:
            hint = did_you_mean(kind, NEEDS)
            yield f".distribution is '{kind}', which is not a distribution; {hint}"
        yield from self._faults_of_names()
        yield from self._faults_of_values()
        if kind in TRUNCATED and not {"low", "high"}.isdisjoint(self.given):
            low_share, high_share = map(NormalDist().cdf, self._deviates)
            if high_share - low_share < MIN_TRUNCATED_SHARE:
                remnant = f"next to nothing of the {kind} distribution"
                yield f": {remnant} lies between its low and high; widen them"

    def _faults_of_names(self) -> Iterator[str]:
        kind = self.distribution
        needed = NEEDS[kind]
        optional = ("low", "high") if kind in TRUNCATED else ()
        for name in needed:
            if name not in self.given:
                yield f" lacks '{name}': a {kind} distribution needs {', '.join(needed)}; add it"
        for name, value in self.given.items():
            if name not in (*needed, *optional):
                yield f".{name} is nothing that a {kind} distribution has; remove it"
            if not math.isfinite(value):
                yield f".{name} is {value}, but it must be finite; correct it"

    def _faults_of_values(self) -> Iterator[str]:
        values = self.given
        low, high = self.bounds
        mode_rule = f"lie between low = {low:.6g} and high = {high:.6g}; correct it"
        for name, holds, rule in (
            ("low", low < high, f"lie below high = {high:.6g}; exchange or correct them"),
            ("mode", low <= values.get("mode", low) <= high, mode_rule),
            ("sd", values.get("sd", 1.0) > 0.0, "be more than 0; correct it"),
            ("median", values.get("median", 1.0) > 0.0, "be more than 0; correct it"),
            ("factor", values.get("factor", 2.0) > 1.0, "be more than 1; correct it"),
        ):
            if not holds:
                yield f".{name} is {values.get(name, low):.6g}, but it must {rule}"

    @property
    def given(self) -> dict[str, float]:
        """Numbers of the distribution in the file, by name."""
        return self.model_dump(exclude={"distribution"}, exclude_none=True)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value, infinite without one."""
        minimum = 0.0 if self.distribution == "lognormal" else -math.inf
        low = minimum if self.low is None else max(self.low, minimum)
        high = math.inf if self.high is None else self.high
        return low, high

    @property
    def text(self) -> str:
        """Description in words; unequal distributions differ in it."""
        numbers = [f"{name} {value:.12g}" for name, value in self.given.items()]
        return ", ".join([self.distribution, *numbers])

    def _numbers(self, *names: str) -> list[float]:
        """List numbers that this kind of distribution has; KeyError for a missing one."""
        values = self.given
        return [values[name] for name in names]

    @property
    def _deviates(self) -> Array:
        """Bounds of a normal or lognormal as deviates of the standard normal distribution, (2,)."""
        bounds = np.array(self.bounds)
        if self.distribution == "normal":
            mean, sd = self._numbers("mean", "sd")
            return np.array((bounds - mean) / sd)
        median, factor = self._numbers("median", "factor")
        logs = [
            math.log(max(bound / median, 1e-300)) for bound in self.bounds
        ]  # the lower may be 0
        return np.array(logs) / math.log(factor)

    def at(self, shares: Array) -> Array:
        """Compute the quantiles of the distribution at ``shares`` (n,), (n,)."""
        # numpy's exponential ends in other digits where a processor has wider registers.
        from scipy.special import exp2, ndtr, ndtri  # noqa: PLC0415  slow to load, only draws need it

        low, high = self.bounds
        low_share, high_share = (0.0, 1.0)
        if self.distribution in TRUNCATED:
            low_share, high_share = ndtr(self._deviates)
        u = low_share + shares * (high_share - low_share)
        if self.distribution == "normal":
            mean, sd = self._numbers("mean", "sd")
            quantiles = ndtri(u) * sd + mean
        elif self.distribution == "lognormal":
            median, factor = self._numbers("median", "factor")
            quantiles = exp2(math.log2(factor) * ndtri(u)) * median
        else:
            if self.distribution == "triangular":
                (mode,) = self._numbers("mode")
                top = (mode - low) / (high - low)
                u = np.where(u < top, np.sqrt(top * u), 1.0 - np.sqrt((1.0 - top) * (1.0 - u)))
            quantiles = u * (high - low) + low
        return np.clip(quantiles, low, high)


def sobol_shares(count: int, dimensions: int, seed: int) -> Array:
    """Return the first ``count`` points of a scrambled Sobol sequence in (0, 1), (count, dims)."""
    from scipy.stats import qmc  # noqa: PLC0415  slow to load, and a certain study does without

    sequence = qmc.Sobol(dimensions, seed=np.random.default_rng(seed))
    points = sequence.random_base2(max(0, math.ceil(math.log2(count))))
    return np.clip(points[:count], 1e-12, 1.0 - 1e-12)


MEAN_QUANTILES = 1000  #: quantiles in the mean of a factor
#: Names of the factors, in the order of the draws.
FACTORS = ("friction_factor", "force_factor", "inertia_factor", "dissipation_factor")
FACTOR_STREAM = 101  #: separates the draws of the factors from those of the angles


@dataclass(frozen=True)
class Variant:
    """One draw of the factors on friction, final shift force, output inertia and dissipation."""

    friction: float
    force: float
    inertia: float
    rise: float  #: rise time of the force as drawn, s
    source: tuple[tuple[str, str], ...]  #: the distributions in words
    dissipation: float = 1.0

    def clutch(self, clutch: Clutch) -> Clutch:
        """Return the clutch with the drawn contact and output inertia."""
        inertia = clutch.rings.output_inertia * self.inertia
        return replace(
            clutch,
            contact=clutch.contact.scaled(self.friction, self.dissipation),
            rings=replace(clutch.rings, output_inertia=inertia),
        )

    def point(self, point: OperatingPoint) -> OperatingPoint:
        """Return the operating point with the drawn shift force."""
        profile = replace(point.profile, force=point.profile.force * self.force, rise=self.rise)
        return replace(point, profile=profile)


@dataclass(frozen=True)
class Uncertainty:
    """Distributions of the uncertain factors by name; other factors are one."""

    distributions: tuple[tuple[str, Distribution], ...]
    rise: RiseTable  #: of the shift force by its final value

    def __post_init__(self) -> None:
        for name, distribution in self.distributions:
            low, high = distribution.bounds
            if not 0.0 < low < high <= 10.0:
                raise InputError(
                    f"uncertain.{name} lies between {low:.6g} and {high:.6g}, but a factor must be "
                    "positive and at most 10; give low and high"
                )

    @property
    def source(self) -> tuple[tuple[str, str], ...]:
        """Distributions in words, by their keys."""
        return tuple((name, distribution.text) for name, distribution in self.distributions)

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the smallest and the largest value of a factor."""
        distribution = dict(self.distributions).get(name)
        return (1.0, 1.0) if distribution is None else distribution.bounds

    def mean(self, name: str) -> float:
        """Compute the mean of a factor; 1 for one without a distribution."""
        distribution = dict(self.distributions).get(name)
        if distribution is None:
            return 1.0
        shares = (np.arange(MEAN_QUANTILES) + 0.5) / MEAN_QUANTILES
        return float(distribution.at(shares).mean())

    def variants(
        self, point: OperatingPoint, count: int, seed: int, index: int, base: int | None = None
    ) -> tuple[Variant, ...]:
        """Draw the factors for each of ``count`` even angles of an operating point.

        ``seed``, ``index`` and ``base`` as for ``sim.statistics.expectation.even_phases``.
        """
        rng = np.random.default_rng([seed, index, FACTOR_STREAM])
        shares = rng.random((count, len(self.distributions)))
        shares = shares[draw_order(count, seed, index, base)]
        values = {}
        for (name, distribution), column in zip(self.distributions, shares.T, strict=True):
            values[name] = distribution.at(column)
        factors = np.column_stack([values.get(name, np.ones(count)) for name in FACTORS])
        profile = point.profile
        by_table = self.rise.gives(profile)  # a rise time from elsewhere stays
        source = self.source
        variants = []
        for friction, force, inertia, dissipation in factors.tolist():
            rise = self.rise.profile(profile.force * force).rise if by_table else profile.rise
            variants.append(
                Variant(
                    friction,
                    force,
                    inertia,
                    rise=rise,
                    source=source,
                    dissipation=dissipation,
                )
            )
        return tuple(variants)


def draw_order(count: int, seed: int, index: int, base: int | None) -> NDArray[np.int64]:
    """Assign the index of a draw to each of ``count`` even angles, (count,), each index once.

    Angles of a coarser grid keep their draws; the angles between them have the following ones.
    """
    base = base or count
    refinement = count // base
    if refinement == 1:
        return np.arange(count)
    coarse_count = count // 2 if refinement % 2 == 0 else base
    step = count // coarse_count
    start = np.random.default_rng([seed, index]).random() * (coarse_count // base) % 1.0
    coarse_angles = np.arange(coarse_count) * step + int(start * step)
    order = np.full(count, -1)
    order[coarse_angles] = draw_order(coarse_count, seed, index, base)
    order[order < 0] = np.arange(coarse_count, count)
    return order
