"""How a study operates its clutch: shift force, operating points, and what a search may change.

Operating points are a bundled set, a grid, a list, or a draw from distributions: once, points of a
scrambled Sobol sequence with equal weights. A list beside a distribution goes with every draw.

The points of a design that keys of ``OPERATED`` are searched for are those of the study, with the
mismatch moved so that its mean over the mix is the set-point (the spread about it is the error of
the speed control, and stays); the final force times its factor, with the rise time that
``[actuation]`` has for it; and that rise time times its factor.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag

from dogshape.sim.clutch_tables import Section, later
from dogshape.sim.errors import InputError, did_you_mean, require_ranges, within
from dogshape.sim.shift.actuation import ForceProfile, RiseTable
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.uncertainty import Distribution, sobol_shares
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root

#: Quantities of an operating point, each with its weights in a grid.
AXES = {"mismatch_rpm": "mismatch_weight", "force_N": "force_weight"}
SAMPLES = 24  #: points that are drawn where the study does not say
DECIMALS = {"drawn": 3, "set-point": 6}  #: of drawn speeds and forces, and of the own set-point
TABLE = "duty_cycles.toml"  #: beside the bundled studies
MISMATCH, FORCE, RISE = "mismatch_set_rpm", "force_factor", "rise_factor"
OPERATED = (MISMATCH, FORCE, RISE)  #: keys of ``[variables]`` that are none of the dog

Numbers = Annotated[list[float], Field(min_length=1)]
Weights = Annotated[list[Annotated[float, Field(gt=0.0)]], Field(min_length=1)]
Profiles = Callable[[float], ForceProfile]  #: the force profile of a nominal force in N


class ActuationSection(Section):
    """Rise time of the shift force by its final value; linear in between."""

    force_N: Numbers
    rise_s: Numbers


@dataclass(frozen=True)
class Actuation:
    """Rise times by the nominal final force, and how the sleeve's force differs from that.

    Dead time before the force starts and lag of first order behind its course, s; constant loss, N;
    factors on force and rise time. The rise keeps its time with a loss or a factor of the force.
    """

    nominal: RiseTable
    delay: float = within("delay_s", 0.0, 10.0, 0.0)
    lag: float = within("lag_s", 0.0, 10.0, 0.0)
    loss: float = within("force_loss_N", 0.0, 1e5, 0.0)
    factor: float = within("force_factor", 0.01, 10.0, 1.0)
    rise_factor: float = within("rise_factor", 0.01, 10.0, 1.0)

    def __post_init__(self) -> None:
        require_ranges(self, "mechanism", "correct the mechanism")

    @property
    def table(self) -> RiseTable:
        """Rise time by the final force at the sleeve, before the loss."""
        forces = tuple(self.factor * force for force in self.nominal.forces)
        return RiseTable(forces, tuple(self.rise_factor * rise for rise in self.nominal.rises))

    def profile(self, force: float, rise: float | None = None, other_way: str = "") -> ForceProfile:
        """Compute the force at the sleeve, N, from a nominal final ``force`` in N.

        A nominal ``rise`` in s overrides the table; ``other_way`` is what a user may do beside
        extending it where it lacks the force.
        """
        if rise is None:
            rise = self.nominal.profile(force, other_way).rise
        return self._shaped(self.factor * ForceProfile(force, rise).force, self.rise_factor * rise)

    def at_sleeve(self, force: float) -> ForceProfile:
        """Return the profile of a final ``force`` at the sleeve before the loss, N."""
        return self._shaped(force, self.table.profile(force).rise)

    def _shaped(self, force: float, rise: float) -> ForceProfile:
        return ForceProfile(force, rise, lag=self.lag, delay=self.delay, loss=self.loss)


#: A list of numbers or a distribution; tags have a space, which no key has.
Spread = Annotated[
    Annotated[Numbers, Tag("a list")] | Annotated[Distribution, Tag("a distribution")],
    Discriminator(lambda v: "a distribution" if isinstance(v, dict | Distribution) else "a list"),
]


class PointSection(Section):
    """One operating point of a list."""

    mismatch_rpm: float
    force_N: float
    weight: float = 1.0


class OperatingSection(Section):
    """Operating points: a set, grid, list or draw."""

    set: str | None = later()
    mismatch_rpm: Spread | None = later()
    force_N: Spread | None = later()
    mismatch_weight: Weights | None = later()
    force_weight: Weights | None = later()
    points: Annotated[list[PointSection], Field(min_length=1)] | None = later()
    samples: Annotated[int, Field(ge=1, le=4096)] | None = later()
    seed: Annotated[int, Field(ge=0)] | None = later()

    def operating_points(self, profile: Profiles) -> tuple[OperatingPoint, ...]:
        """Return the operating points; mistakes raise InputError."""
        rows = self._rows()
        (place, count), *_ = Counter(row[:2] for row in rows).most_common(1)
        if count > 1:
            raise InputError(
                f"[operating] has {place[0]:.6g} 1/min with {place[1]:.6g} N {count} times; "
                "give it once with the sum of the weights"
            )
        return tuple(OperatingPoint(m * RPM, profile(force), w) for m, force, w in rows)

    def _rows(self) -> Sequence[tuple[float, float, float]]:
        """Return mismatch in 1/min, nominal force in N and weight of each operating point."""
        names = [name for name in AXES if isinstance(getattr(self, name), Distribution)]
        beside, keys = "lists of values", [*AXES, *AXES.values()]
        if names:
            beside, keys = "a distribution", [*AXES, "samples", "seed"]
        for alone in ("points", "set"):
            if getattr(self, alone) is not None:
                beside, keys = f"operating.{alone}", [alone]
        for name, value in self:
            if value is not None and name not in keys:
                raise InputError(
                    f"operating.{name} cannot stand beside {beside}; remove one of the two"
                )
        if self.set is not None:
            known = read_toml(bundled_root() / TABLE)
            if self.set not in known:
                hint = did_you_mean(self.set, known)
                raise InputError(
                    f"operating.set is '{self.set}', which is not a set of points; {hint}"
                )
            return [(float(m), float(f), float(w)) for m, f, w in known[self.set]["rows"]]
        if self.points is not None:
            return [(p.mismatch_rpm, p.force_N, p.weight) for p in self.points]
        seed = 1 if self.seed is None else self.seed
        shares = iter(sobol_shares(self.samples or SAMPLES, len(names), seed).T if names else ())
        speeds, forces = (self._axis(name, shares) for name in AXES)
        if len(names) == len(AXES):
            return [(m, f, 1.0) for (m, _), (f, _) in zip(speeds, forces, strict=True)]
        return [(speed, force, v * w) for speed, v in speeds for force, w in forces]

    def _axis(self, name: str, shares: Iterator[NDArray[np.float64]]) -> list[tuple[float, float]]:
        """Return the values of an axis with their weights, drawn at the next of the shares."""
        values, key = getattr(self, name), AXES[name]
        if values is None:
            raise InputError(
                f"'operating.{name}' is missing; add it, or list the points as [[operating.points]]"
            )
        if isinstance(values, Distribution):
            drawn = values.named(f"operating.{name}").at(next(shares))
            values = np.round(drawn, DECIMALS["drawn"]).tolist()
        weights = getattr(self, key) or [1.0] * len(values)
        if len(weights) != len(values):
            raise InputError(
                f"operating.{key} has {len(weights)} and operating.{name} {len(values)} values, "
                "but each needs its weight; give lists of equal length"
            )
        return list(zip(values, weights, strict=True))


def own_set_point(points: Sequence[OperatingPoint]) -> dict[str, float]:
    """Return the keys of ``OPERATED`` as a study has them without any search."""
    weight = sum(point.weight for point in points)
    mean = sum(point.weight * point.mismatch for point in points) / weight
    return {MISMATCH: round(mean / RPM, DECIMALS["set-point"]), FORCE: 1.0, RISE: 1.0}


def operated_points(
    points: Sequence[OperatingPoint], actuation: Actuation, params: Mapping[str, float]
) -> tuple[OperatingPoint, ...]:
    """Return the operating points of a design; keys that are absent change nothing.

    Raises InputError for a force that ``[actuation]`` has no rise time for.
    """
    own = own_set_point(points)[MISMATCH]  # rounded alike, so that a study's own moves nothing
    move = (params.get(MISMATCH, own) - own) * RPM
    force, rise = params.get(FORCE, 1.0), params.get(RISE, 1.0)
    found = []
    for point in points:
        profile = point.profile
        if force != 1.0:
            profile = actuation.at_sleeve(profile.force * force)
        if rise != 1.0:
            profile = replace(profile, rise=profile.rise * rise)
        found.append(replace(point, mismatch=point.mismatch + move, profile=profile))
    return tuple(found)
