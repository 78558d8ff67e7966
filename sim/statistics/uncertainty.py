r"""Quantities that differ from shift to shift: friction, dissipation, shift force, inertia.

Each is a factor on its nominal value with a distribution of its own. The relative angle is
uncertain already and sampled evenly; the factors are further dimensions of the same sample. The
*n* shifts of an operating point have the *n* even angles, each with one draw of the factors, so
that uncertainty costs no shift more. Draws are the same for all designs: designs differ by their
shape and not by their luck. The mean is unbiased, since every draw has the right distribution
and does not know its angle.

The standard error over even angles (``sim.statistics.expectation``) takes the factors for scatter
from angle to angle, which is right for draws that are independent of each other. A Sobol sequence
over the factors, dealt to the angles, would leave 2 to 10 % less scatter of the mean (planar shifts
at twelve and six angles). But its standard error would be up to five times too large where a factor
alone decides.

Finer draws hold coarser ones: where the number of angles is doubled, every angle that was there
keeps its factors, and its shift need not be simulated again.

Distributions by name, with truncation:

``normal``
    mean :math:`\mu`, standard deviation :math:`\sigma`.
``uniform``
    between low and high.
``lognormal``
    median *m* and factor *k*: two values of three lie between m/k and m k
    (:math:`\sigma = \ln k` of the logarithm).
``triangular``
    between low and high with the peak at the mode.

``low`` and ``high`` cut off a normal or lognormal: with distribution function *F* the value at
the share *u* is :math:`F^{-1}(F(low) + u (F(high) - F(low)))`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.clutch_tables import Section
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint

Values = NDArray[np.float64]

#: What each distribution needs; a normal and a lognormal may have low and high besides.
NEEDS = {
    "normal": ("mean", "sd"),
    "uniform": ("low", "high"),
    "lognormal": ("median", "factor"),
    "triangular": ("low", "mode", "high"),
}
LEAST = 1e-3  #: share of a distribution that a truncation must leave


class Distribution(Section):
    """A distribution in place of a number, in the unit of the key that it stands for (``named``).

    Parameters
    ----------
    distribution : one of ``NEEDS``.
    mean, sd, median, factor, low, mode, high : those that the kind needs, None for the others.
    """

    distribution: str
    mean: float | None = None
    sd: float | None = None
    median: float | None = None
    factor: float | None = None
    low: float | None = None
    mode: float | None = None
    high: float | None = None
    _key: str = ""

    def named(self, key: str) -> Distribution:
        """Return the distribution that stands at ``key`` of a file; InputError for mistakes."""
        found = self.model_copy()
        found._key = key
        found._require()
        return found

    @property
    def key(self) -> str:
        """Key that the distribution stands for."""
        return self._key

    def _require(self) -> None:
        kind, key = self.distribution, self._key
        if kind not in NEEDS:
            hint = did_you_mean(kind, NEEDS)
            raise InputError(f"{key}.distribution is '{kind}', which is not a distribution; {hint}")
        needed = NEEDS[kind]
        for name in needed:
            if name not in self.given:
                whole = ", ".join(needed)
                raise InputError(
                    f"{key} lacks '{name}': a {kind} distribution needs {whole}; add it"
                )
        allowed = {*needed, *(("low", "high") if kind in ("normal", "lognormal") else ())}
        for name, value in self.given.items():
            if name not in allowed:
                raise InputError(
                    f"{key}.{name} is nothing that a {kind} distribution has; remove it"
                )
            if not math.isfinite(value):
                raise InputError(f"{key}.{name} is {value}, but it must be finite; correct it")
        self._require_values()
        if self._share_kept() < LEAST:
            raise InputError(
                f"{key}: next to nothing of the {kind} distribution lies between its low and high; "
                "widen them"
            )

    def _require_values(self) -> None:
        low, high = self.bounds
        if not low < high:
            raise InputError(
                f"{self.key}.low is {low:.6g}, but it must lie below high = {high:.6g}; "
                "exchange or correct them"
            )
        if self.mode is not None and not low <= self.mode <= high:
            raise InputError(
                f"{self.key}.mode is {self.mode:.6g}, but it must lie between low = {low:.6g} "
                f"and high = {high:.6g}; correct it"
            )
        for name, least in (("sd", 0.0), ("median", 0.0), ("factor", 1.0)):
            value = self.given.get(name)
            if value is not None and value <= least:
                rule = f"it must be more than {least:.6g}"
                raise InputError(f"{self.key}.{name} is {value:.6g}, but {rule}; correct it")

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
        numbers = (f"{name} {value:.12g}" for name, value in self.given.items())
        return ", ".join([self.distribution, *numbers])

    def at(self, shares: Values) -> Values:
        """Return the values below which so large ``shares`` of the distribution lie, (n,)."""
        curve = self._curve()
        low, high = curve.cdf(self.bounds)
        values: Values = curve.ppf(low + shares * (high - low))
        return np.clip(values, *self.bounds)

    def _share_kept(self) -> float:
        if self.low is None and self.high is None:
            return 1.0
        if self.distribution in ("uniform", "triangular"):
            return 1.0
        low, high = self._curve().cdf(self.bounds)
        return float(high - low)

    def _curve(self) -> Any:
        """Return the distribution without its truncation, as scipy has it."""
        from scipy import stats  # noqa: PLC0415  slow to load, and a certain study does without

        if self.distribution == "normal":
            return stats.norm(self.mean, self.sd)
        if self.distribution == "lognormal":
            return stats.lognorm(math.log(self.factor or 0.0), scale=self.median)
        low, high = self.bounds
        if self.distribution == "uniform":
            return stats.uniform(low, high - low)
        mode = self.mode if self.mode is not None else low
        return stats.triang((mode - low) / (high - low), low, high - low)


def sobol_shares(count: int, dimensions: int, seed: int) -> Values:
    """Return the first ``count`` places of a scrambled Sobol sequence, (count, dimensions).

    Each in (0, 1).
    """
    from scipy.stats import qmc  # noqa: PLC0415  slow to load, and a certain study does without

    sequence = qmc.Sobol(dimensions, seed=np.random.default_rng(seed))
    whole = sequence.random_base2(max(0, math.ceil(math.log2(count))))
    return np.clip(whole[:count], 1e-12, 1.0 - 1e-12)


#: in the order of the draws
FACTORS = ("friction_factor", "force_factor", "inertia_factor", "dissipation_factor")
STREAM = 101  #: keeps the draws of the factors apart from that of the angles

Order = NDArray[np.int64]


@dataclass(frozen=True)
class Variant:
    """One draw of the factors: what a shift has in place of its nominal values.

    Parameters
    ----------
    friction, force, inertia : factors on both coefficients of friction, on the final shift force
        and on the output ring's inertia.
    rise : rise time that belongs to the force as it is drawn, s.
    source : the distributions in words, by their keys.
    dissipation : factor on the contact's dissipation.
    """

    friction: float
    force: float
    inertia: float
    rise: float
    source: tuple[tuple[str, str], ...]
    dissipation: float = 1.0

    def clutch(self, clutch: Clutch) -> Clutch:
        """Return the clutch as drawn."""
        contact, rings = clutch.contact, clutch.rings
        drawn = replace(
            contact,
            static_friction=contact.static_friction * self.friction,
            dynamic_friction=contact.dynamic_friction * self.friction,
            dissipation=contact.dissipation * self.dissipation,
        )
        inertia = rings.output_inertia * self.inertia
        return replace(clutch, contact=drawn, rings=replace(rings, output_inertia=inertia))

    def point(self, point: OperatingPoint) -> OperatingPoint:
        """Return the operating point as drawn."""
        profile = replace(point.profile, force=point.profile.force * self.force, rise=self.rise)
        return replace(point, profile=profile)


@dataclass(frozen=True)
class Uncertainty:
    """Distributions of the factors that are uncertain; those absent are one.

    ``rise`` is the rise time of the shift force by its final value.
    """

    distributions: tuple[Distribution, ...]
    rise: RiseTable

    def __post_init__(self) -> None:
        for one in self.distributions:
            low, high = one.bounds
            if not 0.0 < low < high <= 10.0:
                raise InputError(
                    f"{one.key} lies between {low:.6g} and {high:.6g}, but a factor must be "
                    "positive and at most 10; give low and high"
                )

    @property
    def source(self) -> tuple[tuple[str, str], ...]:
        """The distributions in words, by their keys."""
        return tuple((_name(one), one.text) for one in self.distributions)

    def of(self, name: str) -> Distribution | None:
        """Return the distribution of a factor; None for one that is certain."""
        return next((one for one in self.distributions if _name(one) == name), None)

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the least and the largest value of a factor."""
        found = [one.bounds for one in self.distributions if _name(one) == name]
        return found[0] if found else (1.0, 1.0)

    def variants(
        self, point: OperatingPoint, count: int, seed: int, index: int, base: int | None = None
    ) -> tuple[Variant, ...]:
        """Return the draws of an operating point's angles, ``count`` of them in their order.

        ``seed``, ``index`` and ``base`` as for ``sim.statistics.expectation.even_phases``.
        """
        rng = np.random.default_rng([seed, index, STREAM])
        shares = rng.random((count, len(self.distributions)))
        shares = shares[draw_order(count, seed, index, base)]
        drawn = {
            _name(one): one.at(column)
            for one, column in zip(self.distributions, shares.T, strict=True)
        }
        factors = np.column_stack([drawn.get(name, np.ones(count)) for name in FACTORS])
        source = self.source  # in words, alike for all
        return tuple(self._variant(point, row, source) for row in factors)

    def _variant(
        self, point: OperatingPoint, factors: Values, source: tuple[tuple[str, str], ...]
    ) -> Variant:
        friction, force, inertia, dissipation = (float(factor) for factor in factors)
        profile = point.profile
        rise = profile.rise
        if self.rise.gives(profile):  # a rise time that was given by hand stays
            rise = self.rise.profile(profile.force * force).rise
        return Variant(friction, force, inertia, rise, source, dissipation)


def draw_order(count: int, seed: int, index: int, base: int | None = None) -> Order:
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


def _name(distribution: Distribution) -> str:
    return distribution.key.rpartition(".")[2]
