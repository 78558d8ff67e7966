r"""Dog on dog: what a face and its edge bear at the hardest landing, and their wear over the life.

The simulation gives the load per length :math:`w = F/(N b)` for each class of overlap *L* (its
lower end). A rounded crest takes *c* from either face. Where :math:`L - 2 c` is flat, the case
bears :math:`w/(L - 2 c)` up to its yield stress, the core :math:`w/(L - 2 c + 2 t)` up to its proof
stress; else two cylinders meet, :math:`p_H = \sqrt{w E^*/(\pi R)}`, :math:`R = \varrho/2`,
:math:`E^* = E/(2 (1 - \nu^2))`, up to the shakedown limit of a line contact, four times the yield
stress in shear or 0.77 HV (Johnson, *Contact Mechanics*, 1985). Where the share :math:`K_s` of the
dogs lands (``sim.strength.load_case``), loads grow by :math:`1/\sqrt{K_s}`.

Landings are those of rigid rings and no bound, and the hardest of a sample grows with it: with
``load.landing_share`` the checks take the load that this share of all shifts exceeds. A blow peaks
near :math:`v \sqrt{k m}`, so loads follow the root of the contact's stiffness *k*; its dissipation
makes that less.

*Interval.* A few shifts decide a demand. Beyond the threshold *u* that the share :math:`\zeta` of
the shifts exceeds, excesses have a generalised Pareto distribution (Coles 2001, ch. 4): the share
*p* exceeds :math:`u + \sigma ((p/\zeta)^{-\xi} - 1)/\xi`. The posterior of :math:`\xi`,
:math:`\sigma` (on a grid) and :math:`\zeta` (Beta) gives the interval of 95 %. Where the hardest of
*n* landings counts, *p* is that of the hardest of *n* new ones, an exponential variate over *n*.
Even angles scatter less than random ones, so the interval errs on the wide side.

*Wear* (Archard 1953): a sliding contact loses :math:`k F s`. A shift rubs with :math:`F s \le
E/\mu`, *E* what the contact takes (an upper bound). Over *n* shifts a dog of *N*, *b* wide, loses
per width :math:`V' = k n E/(2 \mu N b)`. Overlaps are even, so the loss falls linearly from
:math:`\Delta` at the crest to none at the braking edge: :math:`V' = \Delta f/2` on a face of width
*f*. Then gap :math:`g + 2\Delta`, height :math:`h - 2\Delta`, depth of the face :math:`d - \Delta`;
without a chamfer the whole face sinks. A roof wears to both edges. Each landing takes the same from
an edge's section, so the square of its radius grows evenly. Rates *k*: 1e-7 to 1e-5 mm3/(N m)
(Rabinowicz 1995).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.elementwise import Array, empirical_distribution, sqrt
from dogshape.sim.errors import InputError, refusal, require_ranges, within
from dogshape.sim.shift.geometry import LAND, SHARPEST, Dog, tip_radius
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.strength.checks import RULES, Check, checks_of
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import MM, MPA

MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  #: Pa, of two like bodies


def edge_pressure(line_load: float, radius: float) -> float:
    """Compute the pressure of Hertz of two like edges, Pa; load in N/m, their radius in m."""
    return sqrt(line_load * MODULUS / (math.pi * 0.5 * radius))


Landing = tuple[float, ...]  #: load in N/m for each class of ``OVERLAPS``
NO_LANDING = (0.0,) * len(OVERLAPS)


def hardest(landings: Iterable[Landing]) -> Landing:
    """Return the largest load in each class of overlap; zeros where there is none."""
    return tuple(map(max, zip(*landings, strict=True))) or NO_LANDING


LANDING_RULES = tuple(rule for rule in RULES.values() if rule.group == "impact")


class Demand(NamedTuple):
    """Load of a landing on faces, on the core below them and on edges, Pa."""

    face: float = 0.0
    core: float = 0.0
    edge: float = 0.0


def exceeded(demands: Array, weights: Sequence[float], share: float) -> Demand:
    """Compute what the ``share`` in (0, 1) of all shifts exceeds, of each pressure for itself.

    ``demands`` as of ``demands_of``, ``weights`` of the shifts need not add up to one. A value
    stands in the middle of its weight; between two the quantile runs straight, and beyond the
    largest nothing is known.
    """
    mass = np.array(weights) / sum(weights)
    return Demand(
        *(float(np.interp(1.0 - share, *empirical_distribution(one, mass))) for one in demands.T)
    )


@dataclass(frozen=True)
class TailPrior:
    """Settings of the posterior of a tail: excesses over a threshold."""

    tail_share: float = (
        0.15  #: of the shifts whose excess is fitted, three times ``share`` at least
    )
    shape_mean: float = -0.1  #: of xi; loads have an end, for the speed of a ring has; judged
    shape_sd: float = 0.3  #: judged: an exponential, a bounded and a heavy tail lie within it
    scale_ends: tuple[float, float] = (0.1, 10.0)  #: of sigma over the mean excess, log-uniform
    grid: int = 81  #: values of either parameter
    draws: int = 4000
    seed: int = 20261124


TAIL = TailPrior()
LEVELS = (0.025, 0.975)  #: ends of the interval of a demand


class Tail(NamedTuple):
    """Excesses of shifts over a threshold."""

    threshold: float  #: in the unit of the values
    excesses: Array  #: over the threshold, (m,), the largest first
    counts: Array  #: number of shifts that each excess stands for, (m,)
    share: float  #: of all shifts that exceed the threshold
    shifts: float  #: number of all shifts; with weights that differ, the effective one


class TailGrid(NamedTuple):
    """Posterior of a generalised Pareto distribution on a grid of its parameters."""

    shapes: Array  #: xi, (g,)
    scales: Array  #: sigma in the unit of the values, (g,)
    chances: Array  #: of sum one, (g,)


def tail_of(values: Array, weights: Array, tail_share: float) -> Tail | None:
    """Select the largest of ``values`` (n,), those that the ``tail_share`` of all shifts exceeds.

    ``weights`` of the shifts, (n,), need not add up to one. None where no value is positive.
    """
    shifts = weights.sum() ** 2 / (weights**2).sum()
    mass = weights / weights.sum()
    order = np.argsort(values, kind="stable")[::-1]
    ordered, above = values[order], np.cumsum(mass[order])
    reached = int(np.searchsorted(above, min(tail_share, 1.0))) + 1
    count = min(reached, int((values > 0.0).sum()))
    if count == 0:
        return None
    threshold = float(ordered[count]) if count < len(values) else 0.0
    return Tail(
        threshold,
        excesses=ordered[:count] - threshold,
        counts=shifts * mass[order][:count],
        share=float(above[count - 1]),
        shifts=shifts,
    )


def tail_posterior(tail: Tail, prior: TailPrior = TAIL) -> TailGrid:
    """Compute the posterior of shape and scale from excesses that are not all zero."""
    mean_excess = float(tail.excesses.mean())
    narrow, wide = (mean_excess * factor for factor in prior.scale_ends)
    reach = 4.0 * prior.shape_sd
    shapes = prior.shape_mean + np.linspace(-reach, reach, prior.grid)
    shapes = np.where(np.abs(shapes) < 1e-6, 1e-6, shapes)
    xi, sigma = np.meshgrid(shapes, np.geomspace(narrow, wide, prior.grid), indexing="ij")
    inside = 1.0 + xi[..., None] * tail.excesses / sigma[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        densities = -np.log(sigma[..., None]) - (1.0 + 1.0 / xi[..., None]) * np.log(inside)
    possible = np.all(inside > 0.0, axis=-1)
    densities = np.where(np.expand_dims(possible, -1), densities, 0.0)
    logs = np.where(possible, (tail.counts * densities).sum(-1), -np.inf)
    logs -= 0.5 * ((xi - prior.shape_mean) / prior.shape_sd) ** 2
    chances = np.exp(logs - logs.max()).ravel()
    return TailGrid(xi.ravel(), sigma.ravel(), chances / chances.sum())


def tail_draws(
    tail: Tail, posterior: TailGrid, share: float | None, prior: TailPrior = TAIL
) -> Array:
    """Draw what the ``share`` of all shifts exceeds, (``prior.draws``,).

    The hardest of as many new shifts where ``share`` is None.
    """
    rng = np.random.default_rng(prior.seed)
    drawn = rng.choice(posterior.chances.size, prior.draws, p=posterior.chances)
    within_tail, below_tail = tail.shifts * tail.share, tail.shifts * (1.0 - tail.share)
    tail_shares = rng.beta(within_tail + 0.5, below_tail + 0.5, prior.draws)
    level = rng.exponential(1.0 / tail.shifts, prior.draws) if share is None else share
    ratio = np.minimum(level / tail_shares, 1.0)  # at 1 the threshold itself
    xi, sigma = posterior.shapes[drawn], posterior.scales[drawn]
    return np.asarray(tail.threshold + sigma * np.expm1(-xi * np.log(ratio)) / xi)


def tail_interval(
    values: Array, weights: Array, share: float | None, prior: TailPrior = TAIL
) -> tuple[float, float]:
    """Compute the 95 % interval of what the ``share`` of all shifts exceeds; None for the hardest.

    ``values`` of shifts, (n,), with ``weights``, which need not add up to one. The hardest is that
    of as many new shifts.
    """
    tail = tail_of(values, weights, max(prior.tail_share, 3.0 * (share or 0.0)))
    if tail is None:
        return 0.0, 0.0
    if not tail.excesses.any():
        return tail.threshold, tail.threshold
    draws = tail_draws(tail, tail_posterior(tail, prior), share, prior)
    low, high = np.quantile(draws, LEVELS)
    return float(low), float(high)


@dataclass(frozen=True, eq=False)
class Landings:
    """Landings of simulated shifts: loads in N/m by class of ``OVERLAPS``, (n, k), weights (n,)."""

    loads: Array
    weights: Array

    def demand(self, dog: Dog, limits: Limits, scale: float = 1.0) -> Demand:
        """Compute what landings ``scale`` times as hard make the dogs bear.

        That is the hardest, or with ``load.landing_share`` what this share exceeds.
        """
        loads, share = scale * self.loads, limits.load.landing_share
        if share is None:
            return demand_of(dog, hardest(map(tuple, loads.tolist())), limits)
        return exceeded(demands_of(dog, loads, limits), self.weights.tolist(), share)

    def interval(self, dog: Dog, limits: Limits) -> tuple[Demand, Demand]:
        """Compute the 95 % intervals of the demand, which hold the demand itself."""
        demands, share = demands_of(dog, self.loads, limits), limits.load.landing_share
        ends = [tail_interval(column, self.weights, share) for column in demands.T]
        values = self.demand(dog, limits)
        low = Demand(*(min(end, own) for (end, _), own in zip(ends, values, strict=True)))
        high = Demand(*(max(end, own) for (_, end), own in zip(ends, values, strict=True)))
        return low, high


def demand_of(dog: Dog, landing: Landing, limits: Limits) -> Demand:
    """Compute what a landing makes faces, core and edges bear."""
    return Demand(*demands_of(dog, np.array([landing]), limits)[0].tolist())


def demands_of(dog: Dog, landings: Any, limits: Limits) -> Array:
    """Compute what landings in N/m, (n, k), make faces, core and edges bear, (n, 3)."""
    radius = tip_radius(dog, limits.root_radius)
    flats = np.array(OVERLAPS) - 2.0 * radius * dog.crest_cut
    shares = np.broadcast_to(limits.load.landing(dog, landings.ravel()), landings.size)
    loads = landings * (1.0 / np.sqrt(shares)).reshape(landings.shape)
    wide, spread = flats >= LAND, 2.0 * limits.material.case_depth
    face = (loads[:, wide] / flats[wide]).max(axis=1, initial=0.0)
    core = (loads[:, wide] / (flats[wide] + spread)).max(axis=1, initial=0.0)
    edge = edge_pressure(loads[:, ~wide].max(axis=1, initial=0.0), radius)
    return np.array([face, core, edge]).T


def demand_checks(
    demand: Demand, limits: Limits, interval: tuple[Demand, Demand] | None = None
) -> tuple[Check, ...]:
    """Return the checks of a landing, or of what a share of landings exceeds, in its interval."""
    face, edge = limits.material.case_yield / limits.load.safety, limits.material.edge_pressure
    limiting = (face, limits.allowable_stress, edge)
    checks = checks_of(zip((rule.name for rule in LANDING_RULES), demand, limiting, strict=True))
    if interval is None:
        return checks
    ends = zip(*interval, strict=True)
    return tuple(
        replace(check, interval=(low / MPA, high / MPA))
        for check, (low, high) in zip(checks, ends, strict=True)
    )


RATES, HEIGHT = "1e-7 is well lubricated, 1e-5 hardly", "give the height in mm"


@dataclass(frozen=True)
class Wear:
    """Wear of the faces, by a rate (m3/(N m)) or a measured loss of height, and of the edges (m).

    Both at the end of the life; without ``edge_radius`` edges stay as they are.
    """

    rate: float | None = within("rate_mm3_Nm", 0.0, 1e-2, None, remedy=RATES)
    crest_loss: float | None = within("crest_loss_mm", 0.0, 2.0, None, remedy=HEIGHT)
    edge_radius: float | None = within("edge_radius_mm", SHARPEST / MM, 10.0, None)

    def __post_init__(self) -> None:
        given = [v for v in (self.rate, self.crest_loss) if v is not None]
        if len(given) != 1 and (given or self.edge_radius is None):
            raise InputError(
                "[wear] needs one of wear.rate_mm3_Nm (Archard) and wear.crest_loss_mm (measured); "
                "give one and not both"
            )
        require_ranges(self, "wear", "give the radius in mm")

    def loss(self, dog: Dog, energy: float, friction: float, shifts: float) -> float:
        """Compute the height that ``shifts`` take from the crest of a dog, m.

        ``energy`` in J is that of a shift in the mean, ``friction`` the dynamic coefficient.
        """
        if self.rate is None or energy <= 0.0:
            return 0.0
        if friction <= 0.0:
            raise InputError(
                "wear.rate_mm3_Nm follows the work of friction, but contact.dynamic_friction is 0; "
                "give wear.crest_loss_mm"
            )
        work = shifts * energy / friction
        volume = self.rate * work / (2.0 * dog.count * dog.radial_width)
        return 2.0 * volume / (dog.face_width + dog.back_width)

    def edges(self, dog: Dog, share: float) -> float:
        """Compute the radius of a dog's edges at a share of the life, m."""
        if self.edge_radius is None:
            return dog.edge_radius
        if self.edge_radius < dog.edge_radius:
            rule = f"edges do not get sharper than dog.edge_radius_mm = {dog.edge_radius / MM:.6g}"
            radius, remedy = self.edge_radius / MM, "give the radius at the end of the life"
            raise InputError(refusal("wear.edge_radius_mm", radius, "mm", rule, remedy))
        new, old = dog.edge_radius**2, self.edge_radius**2
        return math.sqrt(new + share * (old - new))


def worn(dog: Dog, loss: float) -> Dog:
    """Return the dog of a pair whose crests have lost the height ``loss``, m.

    Raises GeometryError where nothing of the dog is left.
    """
    lower = replace(
        dog,
        height=dog.height - 2.0 * loss,
        axial_gap=dog.axial_gap + 2.0 * loss,
        chamfer=0.0,
        chamfer_back=0.0,
        crest=1.0,
    )
    back, face = (max(0.0, drop - loss) for drop in dog.drops_at(dog.mean_radius))
    if face == back == 0.0:
        return lower

    def fall(drop: float, share: float, lean: float) -> float:
        return math.atan2(drop, share * lower.tip_width + drop * math.tan(lean))

    return replace(
        lower,
        crest=dog.crest,
        chamfer=fall(face, dog.crest, dog.braking),
        chamfer_back=fall(back, 1.0 - dog.crest, dog.traction),
    )
