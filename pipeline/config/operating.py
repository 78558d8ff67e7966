"""How a study operates its clutch: shift force, operating points, and what a search may change.

Operating points are a bundled set, a grid, a list, or a draw from distributions. A draw is made
once: points of a scrambled Sobol sequence with equal weights, so that search, mix and surrogate see
a list of points whatever they came from. A quantity that is a list while the other is drawn goes
with every draw.

Where ``[variables]`` holds keys of ``OPERATED``, they are searched with the shape. The points of a
design are then those of the study, with

- the mismatch moved so that its mean over the mix is the set-point: the spread about it is the
  error of the speed control, and stays;
- the final force times its factor, with the rise time that ``[actuation]`` has for it;
- that rise time times its factor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Discriminator, Field, Tag

from dogshape.sim.clutch_tables import Section, later
from dogshape.sim.errors import InputError, did_you_mean, refusal
from dogshape.sim.shift.actuation import ForceProfile, RiseTable
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.uncertainty import Distribution, sobol_shares
from dogshape.sim.texts import read_toml
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root

AXES = ("mismatch_rpm", "force_N")
OWN = (*AXES, "mismatch_weight", "force_weight", "samples", "seed")  #: keys of grid and draw
SAMPLES = 24  #: points that are drawn where the study does not say
DECIMALS = {"drawn": 3, "set-point": 6}  #: of drawn speeds and forces, and of the own set-point
TABLE = "duty_cycles.toml"  #: beside the bundled studies
MISMATCH, FORCE, RISE = "mismatch_set_rpm", "force_factor", "rise_factor"
OPERATED = (MISMATCH, FORCE, RISE)  #: keys of ``[variables]`` that are none of the dog
WIDEST = {MISMATCH: (-2000.0, 2000.0), FORCE: (0.01, 100.0), RISE: (0.1, 10.0)}

Numbers = Annotated[list[float], Field(min_length=1)]
Profiles = Callable[[float], ForceProfile]  #: the force profile of a nominal force in N


class ActuationSection(Section):
    """Rise time of the shift force by its final value; linear in between."""

    force_N: Numbers
    rise_s: Numbers

    @property
    def table(self) -> RiseTable:
        """Rise time by the nominal final force; raises InputError for mistakes."""
        return RiseTable(tuple(self.force_N), tuple(self.rise_s))


@dataclass(frozen=True)
class Actuation:
    """Rise times by the final force, and how the sleeve's force differs from the nominal one.

    Parameters
    ----------
    nominal : rise time by the nominal final force.
    delay, lag : dead time before the force starts and lag of first order behind its course, s.
    factor : of the force at the sleeve over the nominal one; the rise keeps its time.
    loss : constant part of the force at the sleeve that is lost, N; the rise keeps its time.
    rise_factor : of the rise time over the nominal one.
    """

    nominal: RiseTable
    delay: float = 0.0
    lag: float = 0.0
    factor: float = 1.0
    loss: float = 0.0
    rise_factor: float = 1.0

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

    @property
    def record(self) -> dict[str, float]:
        """Dead time, lag and loss as the record of a shift has them; empty where there are none."""
        found = {"force_delay_s": self.delay, "force_lag_s": self.lag, "force_loss_N": self.loss}
        return {key: value for key, value in found.items() if value != 0.0}


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
    mismatch_weight: Numbers | None = later()
    force_weight: Numbers | None = later()
    points: Annotated[list[PointSection], Field(min_length=1)] | None = later()
    samples: Annotated[int, Field(ge=1, le=4096)] | None = later()
    seed: Annotated[int, Field(ge=0)] | None = later()

    def operating_points(self, profile: Profiles) -> tuple[OperatingPoint, ...]:
        """Return the operating points; mistakes raise InputError."""
        rows = self._rows()
        try:
            return tuple(OperatingPoint(m * RPM, profile(f), w) for m, f, w in rows)
        except InputError as error:
            if self.set is None:
                raise
            raise InputError(f"operating.set '{self.set}': {error}") from error

    def axes(self, points: Sequence[OperatingPoint], factor: float = 1.0) -> list[list[float]]:
        """Return mismatches in 1/min and nominal forces in N of a study, each once, in their order.

        ``factor`` is the share of the nominal force that the points have.
        """
        found = (
            [round(point.mismatch / RPM, 9) for point in points],
            [point.profile.force / factor for point in points],
        )
        given = (getattr(self, name) for name in AXES)
        return [
            list(one) if isinstance(one, list) else list(dict.fromkeys(values))
            for one, values in zip(given, found, strict=True)
        ]

    def text(self, axes: Sequence[Sequence[float]], count: int) -> str:
        """Return in words which operating points a study has, ``count`` of them."""
        if self.points is not None or self.set is not None:
            kind = "listed" if self.set is None else f"of the set {self.set}"
            (slow, *_, fast), (weak, *_, strong) = (sorted([*values, *values]) for values in axes)
            ends = f"{slow:g} to {fast:g} 1/min with {weak:g} to {strong:g} N"
            return f"{count} {kind}, {ends}, by weight"
        parts = []
        for name, unit, values in zip(AXES, ("1/min", "N"), axes, strict=True):
            given = getattr(self, name)
            text = ", ".join(f"{value:g}" for value in values)
            if isinstance(given, Distribution):
                text = given.text
            parts.append(f"{text} {unit}")
        weighted = self.mismatch_weight is not None or self.force_weight is not None
        drawn = f"; {count} drawn" if self._distributed else ", weighted" if weighted else ""
        return f"{parts[0]}, each with {parts[1]}{drawn}"

    @property
    def _distributed(self) -> list[str]:
        return [name for name in AXES if isinstance(getattr(self, name), Distribution)]

    def _rows(self) -> Sequence[tuple[float, float, float]]:
        """Return mismatch in 1/min, nominal force in N and weight of each operating point."""
        if self.set is not None:
            self._refuse((*OWN, "points"), f"cannot stand beside operating.set = '{self.set}'")
            known = duty_cycles()
            if self.set not in known:
                hint = did_you_mean(self.set, known)
                raise InputError(
                    f"operating.set is '{self.set}', which is not a set of points; {hint}"
                )
            return known[self.set]
        if self.points is not None:
            self._refuse(OWN, "cannot stand beside operating.points")
            places = [(point.mismatch_rpm, point.force_N) for point in self.points]
            for place in places:
                if places.count(place) > 1:
                    raise InputError(
                        f"operating.points has {place[0]:.6g} 1/min with {place[1]:.6g} N twice; "
                        "give it once with the sum of both weights"
                    )
            return [(p.mismatch_rpm, p.force_N, p.weight) for p in self.points]
        if self._distributed:
            return self._drawn(self._distributed)
        self._refuse(("samples", "seed"), "is for a distribution, but all are lists")
        speeds = self._weighted("mismatch_rpm", "mismatch_weight")
        forces = self._weighted("force_N", "force_weight")
        return [(speed, force, v * w) for speed, v in speeds for force, w in forces]

    def _refuse(self, names: Sequence[str], rule: str) -> None:
        for name in names:
            if getattr(self, name) is not None:
                raise InputError(f"operating.{name} {rule}; remove one of the two")

    def _drawn(self, names: Sequence[str]) -> list[tuple[float, float, float]]:
        """Draw the quantities that are distributions."""
        count = self.samples or SAMPLES
        shares = sobol_shares(count, len(names), self.seed if self.seed is not None else 1)
        drawn = {
            name: np.round(
                getattr(self, name).named(f"operating.{name}").at(column), DECIMALS["drawn"]
            ).tolist()
            for name, column in zip(names, shares.T, strict=True)
        }
        speeds, forces = (drawn[n] if n in drawn else self._values(n) for n in AXES)
        self._refuse(("mismatch_weight", "force_weight"), "goes with a grid of lists")
        if len(names) == len(AXES):
            return [(m, f, 1.0) for m, f in zip(speeds, forces, strict=True)]
        return [(mismatch, force, 1.0) for mismatch in speeds for force in forces]

    def _values(self, name: str) -> list[float]:
        values = getattr(self, name)
        if values is None:
            raise InputError(
                f"'operating.{name}' is missing; add it, or list the points as [[operating.points]]"
            )
        if len({*values}) < len(values):
            raise InputError(f"operating.{name} has a value twice; give each once")
        return list(values)

    def _weighted(self, name: str, weight: str) -> list[tuple[float, float]]:
        values, weights = self._values(name), getattr(self, weight)
        if weights is None:
            return [(value, 1.0) for value in values]
        if len(weights) != len(values):
            raise InputError(
                f"operating.{weight} has {len(weights)} and operating.{name} {len(values)} values, "
                "but each needs its weight; give lists of equal length"
            )
        for value in weights:
            if not 0.0 < value < float("inf"):
                raise InputError(
                    f"operating.{weight} has {value:.6g}, but weights must be positive; "
                    "leave out what does not count"
                )
        return list(zip(values, weights, strict=True))


@lru_cache(maxsize=1)
def duty_cycles() -> dict[str, list[tuple[float, float, float]]]:
    """Read the bundled operating mixes, by name.

    A point is mismatch in 1/min, nominal final shift force in N, and weight.
    """
    return {
        name: [(float(m), float(force), float(weight)) for m, force, weight in entry["rows"]]
        for name, entry in read_toml(bundled_root() / TABLE).items()
    }


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


def require_ranges(
    points: Sequence[OperatingPoint],
    actuation: Actuation,
    ranges: Mapping[str, tuple[float, float]],
) -> None:
    """Refuse ranges of ``OPERATED`` whose ends no shift can have."""
    for key, (least, most) in WIDEST.items():
        for value in ranges.get(key, ()):
            if not least <= value <= most:
                unit = "1/min" if key == MISMATCH else ""
                rule = f"it must lie between {least:g} and {most:g} {unit}".rstrip()
                raise InputError(refusal(f"variables.{key}", value, unit, rule, "narrow the range"))
    for factor in ranges.get(FORCE, ()):
        try:
            operated_points(points, actuation, {FORCE: factor})
        except InputError as error:
            raise InputError(f"variables.{FORCE} of {factor:g}: {error}") from error
