r"""Share of manufactured clutches that keep every check which needs no simulation.

Each dimension is drawn about its nominal value: normal with the tolerance as three standard
deviations, or uniform between both of its ends. Where friction is uncertain, a factor from its
distribution scales both coefficients of the locking checks with it. Draws are independent of each
other and of the design, so that designs differ by their shape and not by their luck.

A draw has no tolerance left. So what touches and the gap between the crests are those of the draw,
not of the worst case: the gap loses what both crests stand higher, :math:`2\,\Delta h`.

Of *n* draws *k* keep all checks. The share is :math:`k/n`, its standard error
:math:`\sqrt{\tilde p (1 - \tilde p)/n}` with :math:`\tilde p = (k + 1/2)/(n + 1)` (Jeffreys), which
is not zero where all or none do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.uncertainty import Distribution, Values
from dogshape.sim.strength.dog_strength import Limits, keeps_limits
from dogshape.sim.strength.load_case import LoadCase, neighbour_share
from dogshape.sim.strength.tolerance import Tolerances, moved

DRAWS = 500
FIRST_DRAWS = 100  #: of the draws, that a search looks at before the rest
SEED = 20261124
SIGMAS = 3.0  #: standard deviations of a dimension in its tolerance
#: all dimensions: each keeps its column of the draws, whatever has no tolerance
NAMES = tuple(
    f.name
    for f in fields(Tolerances)
    if f.name not in ("contact_ratio", "clearance", "distribution")
)


class _NearLoad(LoadCase):
    """Load case whose load sharing is interpolated: draws of a design differ by little."""

    def _load_share(self, count: int, scatter: float, wave: float) -> float:
        if wave > 0.0:
            return super()._load_share(count, scatter, wave)
        return neighbour_share(count, scatter)


@lru_cache(maxsize=4096)
def kept_share(dog: Dog, limits: Limits, friction: Distribution | None = None) -> float:
    """Compute the share of ``DRAWS`` manufactured clutches that keep every closed-form check.

    ``friction`` is the distribution of the factor on both coefficients of the locking checks.
    """
    return float(np.mean(kept_draws(dog, limits, friction)))


def surely_below(dog: Dog, limits: Limits, friction: Distribution | None, least: float) -> bool:
    """Decide whether so many of the first draws fail that the share must be below ``least``.

    It ends with the last failure that may be, so that a search refuses poor designs at once.
    """
    allowed, failed = (1.0 - least) * DRAWS, 0
    for kept in islice(_draws(dog, limits, friction), FIRST_DRAWS):
        failed += not kept
        if failed > allowed:
            return True
    return False


def standard_error(share: float) -> float:
    """Compute the standard error of a share of the draws."""
    middle = (share * DRAWS + 0.5) / (DRAWS + 1.0)
    return math.sqrt(middle * (1.0 - middle) / DRAWS)


def kept_draws(dog: Dog, limits: Limits, friction: Distribution | None = None) -> list[bool]:
    """Return of each drawn clutch whether it keeps every closed-form check."""
    return [*_draws(dog, limits, friction)]


def _draws(dog: Dog, limits: Limits, friction: Distribution | None) -> Iterator[bool]:
    shares = _shares()
    sizes = limits.tolerances.dimensions
    deviations = {
        name: _deviations(limits.tolerances.distribution, sizes[name], column)
        for name, column in zip(NAMES, shares.T, strict=False)
        if name in sizes
    }
    factors = np.ones(DRAWS) if friction is None else friction.at(shares[:, -1])
    exact = limits.tolerances.without_sizes()
    bare = replace(limits, tolerances=exact, load=_near(limits.load))
    for k, factor in enumerate(factors.tolist()):
        off = {name: float(column[k]) for name, column in deviations.items()}
        yield _keeps(dog, bare, off, factor)


def _keeps(dog: Dog, limits: Limits, deviations: dict[str, float], factor: float) -> bool:
    """Decide whether a clutch keeps every check; one that cannot exist keeps none."""
    gap = deviations.get("axial_gap", 0.0) - 2.0 * deviations.get("height", 0.0)
    try:
        made, radius = moved(dog, limits.root_radius, {**deviations, "axial_gap": gap})
        load = limits.load
        if factor != 1.0:
            load = replace(
                load,
                friction_release=load.friction_release * factor,
                friction_hold=load.friction_hold * factor,
            )
        return keeps_limits(made, replace(limits, load=load).with_root_radius(radius))
    except DogshapeError:
        return False


def _near(load: LoadCase) -> LoadCase:
    return _NearLoad(**{f.name: getattr(load, f.name) for f in fields(load)})


def _deviations(kind: str, tolerance: float, shares: Values) -> Values:
    from scipy.special import ndtri  # noqa: PLC0415  slow to load, and few studies ask

    if kind == "uniform":
        return tolerance * (2.0 * shares - 1.0)
    drawn: Values = tolerance / SIGMAS * ndtri(shares)
    return drawn


@lru_cache(maxsize=1)
def _shares() -> Values:
    """Draw shares of the distributions, (draws, dimensions and friction), the same for all."""
    drawn = np.random.default_rng(SEED).random((DRAWS, len(NAMES) + 1))
    drawn.flags.writeable = False
    return drawn
