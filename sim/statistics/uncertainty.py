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
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.errors import InputError
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.distribution import Distribution, Values

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
