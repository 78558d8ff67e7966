"""Quantities that differ from shift to shift: friction, dissipation, shift force, inertia.

Each is a factor on its nominal value. The *n* shifts of an operating point have the *n* even
angles, each with one independent draw of the factors, the same for all designs: the standard error
of the mean takes the factors for scatter from angle to angle. Where the number of angles is
doubled, every angle that was there keeps its factors.

Distributions: ``normal`` (mean, sd), ``uniform`` (low, high), ``triangular`` (low, mode, high),
``lognormal`` (median *m*, factor *k*: two values of three lie between m/k and m k). ``low`` and
``high`` cut off a normal or lognormal: the value at the share *u* is :math:`F^{-1}(F(low) + u
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

#: What each distribution needs; a normal and a lognormal may have low and high besides.
NEEDS = {
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
    "lognormal": ("median", "factor"),
    "triangular": ("low", "mode", "high"),
}
CUT = ("normal", "lognormal")  #: distributions that low and high may truncate
LEAST = 1e-3  #: share of a distribution that a truncation must leave


class Distribution(Section):
    """A distribution in place of a number, in the unit of the key that it stands for.

    ``distribution`` is one of ``NEEDS``; the numbers are those that it needs.
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
        """Return the distribution, which stands at ``key`` of a file; InputError for mistakes."""
        for fault in self._faults():
            raise InputError(f"{key}{fault}")
        return self

    def _faults(self) -> Iterator[str]:
        kind, given = self.distribution, self.given
        if kind not in NEEDS:
            hint = did_you_mean(kind, NEEDS)
            yield f".distribution is '{kind}', which is not a distribution; {hint}"
        needed, ends = NEEDS[kind], ("low", "high") if kind in CUT else ()
        for name in (name for name in needed if name not in given):
            yield f" lacks '{name}': a {kind} distribution needs {', '.join(needed)}; add it"
        for name, value in given.items():
            if name not in (*needed, *ends):
                yield f".{name} is nothing that a {kind} distribution has; remove it"
            if not math.isfinite(value):
                yield f".{name} is {value}, but it must be finite; correct it"
        low, high = self.bounds
        between = f"lie between low = {low:.6g} and high = {high:.6g}; correct it"
        for name, kept, rule in (
            ("low", low < high, f"lie below high = {high:.6g}; exchange or correct them"),
            ("mode", low <= given.get("mode", low) <= high, between),
            ("sd", given.get("sd", 1.0) > 0.0, "be more than 0; correct it"),
            ("median", given.get("median", 1.0) > 0.0, "be more than 0; correct it"),
            ("factor", given.get("factor", 2.0) > 1.0, "be more than 1; correct it"),
        ):
            if not kept:
                yield f".{name} is {given.get(name, low):.6g}, but it must {rule}"
        if kind in CUT and not {"low", "high"}.isdisjoint(given):
            below, above = map(NormalDist().cdf, self._ends)
            if above - below < LEAST:
                what = f"next to nothing of the {self.distribution} distribution"
                yield f": {what} lies between its low and high; widen them"

    @property
    def given(self) -> dict[str, float]:
        """The numbers that are given, by name."""
        return self.model_dump(exclude={"distribution"}, exclude_none=True)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest value, infinite where there is none."""
        least = 0.0 if self.distribution == "lognormal" else -math.inf
        low = least if self.low is None else max(self.low, least)
        return low, math.inf if self.high is None else self.high

    @property
    def text(self) -> str:
        """Description in words that tell any two distributions apart."""
        return ", ".join([self.distribution, *(f"{k} {v:.12g}" for k, v in self.given.items())])

    @property
    def _ends(self) -> Array:
        """Bounds of a normal or lognormal as deviates of the standard normal distribution, (2,)."""
        given, ends = self.given, np.array(self.bounds)
        if self.distribution == "normal":
            return np.array((ends - given["mean"]) / given["sd"])
        ends = np.log(np.maximum(ends / given["median"], 1e-300))  # the least bound is 0
        return np.array(ends / math.log(given["factor"]))

    def at(self, shares: Array) -> Array:
        """Return the values below which so large ``shares`` of the distribution lie, (n,)."""
        from scipy.special import ndtr, ndtri  # noqa: PLC0415  slow to load, and only draws need it

        (least, most), given = self.bounds, self.given
        low, high = ndtr(self._ends) if self.distribution in CUT else (0.0, 1.0)
        u = low + shares * (high - low)
        if self.distribution == "normal":
            u = ndtri(u) * given["sd"] + given["mean"]
        elif self.distribution == "lognormal":
            u = np.exp(math.log(given["factor"]) * ndtri(u)) * given["median"]
        else:
            if self.distribution == "triangular":
                top = (given["mode"] - least) / (most - least)
                u = np.where(u < top, np.sqrt(top * u), 1.0 - np.sqrt((1.0 - top) * (1.0 - u)))
            u = u * (most - least) + least
        return np.clip(u, least, most)


def sobol_shares(count: int, dimensions: int, seed: int) -> Array:
    """Return the first ``count`` places of a scrambled Sobol sequence in (0, 1), (count, dims)."""
    from scipy.stats import qmc  # noqa: PLC0415  slow to load, and a certain study does without

    sequence = qmc.Sobol(dimensions, seed=np.random.default_rng(seed))
    whole = sequence.random_base2(max(0, math.ceil(math.log2(count))))
    return np.clip(whole[:count], 1e-12, 1.0 - 1e-12)


MEAN_SHARES = 1000  #: quantiles in the mean of a factor
#: in the order of the draws
FACTORS = ("friction_factor", "force_factor", "inertia_factor", "dissipation_factor")
STREAM = 101  #: keeps the draws of the factors apart from that of the angles


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
        """Return the clutch as drawn."""
        rings = clutch.rings
        drawn = clutch.contact.scaled(self.friction, self.dissipation)
        inertia = rings.output_inertia * self.inertia
        return replace(clutch, contact=drawn, rings=replace(rings, output_inertia=inertia))

    def point(self, point: OperatingPoint) -> OperatingPoint:
        """Return the operating point as drawn."""
        profile = replace(point.profile, force=point.profile.force * self.force, rise=self.rise)
        return replace(point, profile=profile)


@dataclass(frozen=True)
class Uncertainty:
    """Distributions of the factors that are uncertain, by their names; those absent are one."""

    distributions: tuple[tuple[str, Distribution], ...]
    rise: RiseTable  #: of the shift force by its final value

    def __post_init__(self) -> None:
        for name, one in self.distributions:
            low, high = one.bounds
            if not 0.0 < low < high <= 10.0:
                raise InputError(
                    f"uncertain.{name} lies between {low:.6g} and {high:.6g}, but a factor must be "
                    "positive and at most 10; give low and high"
                )

    @property
    def source(self) -> tuple[tuple[str, str], ...]:
        """The distributions in words, by their keys."""
        return tuple((name, one.text) for name, one in self.distributions)

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of a factor."""
        return next((d.bounds for key, d in self.distributions if key == name), (1.0, 1.0))

    def mean(self, name: str) -> float:
        """Compute the mean of a factor."""
        shares = (np.arange(MEAN_SHARES) + 0.5) / MEAN_SHARES
        means = (d.at(shares).mean() for key, d in self.distributions if key == name)
        return float(next(means, 1.0))

    def variants(
        self, point: OperatingPoint, count: int, seed: int, index: int, base: int | None = None
    ) -> tuple[Variant, ...]:
        """Return the draws of an operating point's angles, ``count`` of them in their order.

        ``seed``, ``index`` and ``base`` as for ``sim.statistics.expectation.even_phases``.
        """
        rng = np.random.default_rng([seed, index, STREAM])
        shares = rng.random((count, len(self.distributions)))
        shares = shares[draw_order(count, seed, index, base)]
        columns = zip(self.distributions, shares.T, strict=True)
        drawn = {name: one.at(column) for (name, one), column in columns}
        factors = np.column_stack([drawn.get(name, np.ones(count)) for name in FACTORS])
        source, profile, found = self.source, point.profile, []
        by_table = self.rise.gives(profile)  # a rise time that was given by hand stays
        for friction, force, inertia, dissipation in factors.tolist():
            rise = self.rise.profile(profile.force * force).rise if by_table else profile.rise
            found.append(Variant(friction, force, inertia, rise, source, dissipation))
        return tuple(found)


def draw_order(count: int, seed: int, index: int, base: int | None = None) -> NDArray[np.int64]:
    """Assign a draw to each of the even angles, (count,), each draw once.

    The angles of a coarser draw keep what they had; those between them get the next ones.
    """
    base = base or count
    parts = count // base
    coarse = count if parts == 1 else count // 2 if parts % 2 == 0 else base
    if coarse == count:
        return np.arange(count)
    start = np.random.default_rng([seed, index]).random() * (coarse // base) % 1.0
    kept = np.arange(coarse) * (count // coarse) + int(start * (count // coarse))
    order = np.full(count, -1)
    order[kept] = draw_order(coarse, seed, index, base)
    order[order < 0] = np.arange(coarse, count)
    return order
