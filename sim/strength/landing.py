r"""Dog on dog: loads of face and edge at the hardest landing, and wear over the life.

The simulation gives the load per length :math:`w_0 = F/(N b)` for each class of overlap *L*. Its
layer is softer than the dogs. A blow of the same energy :math:`u` (per length; :math:`w_0^2/(2 K
L)` in a layer of the stiffness *K*, :math:`\tfrac25 F (F/K)^{2/3}/b` under the law IMPACT) loads
dogs of the stiffness *k* (``dog_stiffness``; two in series, per length) by

.. math:: w = \sqrt{2 u k(w)}.

It is an upper estimate: the peak :math:`w_0` contains the layer's dissipation, and the force of the
actuator and slip of the rings in a longer blow. Where the share :math:`K_l` of the dogs
lands (``load_case``), loads grow by :math:`1/\sqrt{K_l}`.

A rounded crest takes *c* from either face, and :math:`f = L - 2 c` is flat. Below the roundings the
case bears :math:`w/L` up to its yield stress, as load spreads by *c* to either side: a strip at the
distance *c* from a corner of a right angle collapses at 2 to :math:`2 + \pi` times the yield stress
in shear for :math:`c/f` of 0 to 1 (footings beside a cut). The core bears :math:`w/(f + 2 t)`, *t*
the case depth, up to its proof stress.

*Edges* without a flat are two cylinders, :math:`p = \sqrt{w E^*/(\pi R)}`, :math:`1/R =
1/\varrho_1 + 1/\varrho_2`, :math:`E^* = E/(2 (1 - \nu^2))`, on a strip of the half width :math:`a =
2 w/(\pi p)`; an even pressure on :math:`\tfrac12 e^{5/4} a` has the same compliance. Its middle
lies :math:`L/2` from both sharp crests. Up to the shakedown limit of a line contact, four times the
yield stress in shear or 0.77 HV (Johnson, *Contact Mechanics*, 1985), edges stay. New ones that
bear more bed in until their radius has grown so far that the pressure is the limit :math:`p_l`:
:math:`a = 2 w/(\pi p_l)`, :math:`R' = w E^*/(\pi p_l^2)`. Both approach by :math:`\tfrac12 a^2
(1/R - 1/R')`; each has the share of its curvature, the bedding depth. It must stay small against
the case. A flat bears the mean of that pressure, :math:`\pi p_l/4`, and the roundings beside it the
rest of the load, as an edge does.

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
from dogshape.sim.errors import InputError, Refusal
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.clutch import ContactSet
from dogshape.sim.shift.geometry import LAND, SHARPEST, Dog, tip_radius
from dogshape.sim.shift.pair import dog_pair
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.strength.checks import RULES, LimitCheck, checks_of, smallest_margin
from dogshape.sim.strength.dog_stiffness import Strip, face_compliance
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import MM

MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  #: Pa, of two like bodies


#: Width of an even pressure that is as compliant as that of Hertz, over the latter's half width.
EVEN_WIDTH = 0.5 * math.exp(1.25)
#: Half of the width of all classes of overlap but the last two, m.
HALF_CLASS = 0.5e-4
MIN_LINE_LOAD = 1.0  #: N/m, of which a width of contact is computed
BLOW_ITERATIONS = 3  #: of stiffness and load, which depends on its square root alone


def edge_pressure(line_load: float, curvature: float) -> float:
    """Compute the Hertz pressure of two cylinders, Pa.

    ``line_load`` in N/m, ``curvature`` the sum of both, 1/m.
    """
    return sqrt(line_load * curvature * MODULUS / math.pi)


class Bedding(NamedTuple):
    """Edge that has bedded in, m."""

    depth: float
    radius: float  #: of the edge after it


def bedding_of(pressure: float, radius: float, mate_radius: float, limit: float) -> Bedding:
    """Compute the bedding of the sharper of two edges with radii in m.

    ``pressure`` is that of Hertz on new edges, ``limit`` the one up to which they stay, Pa. A plane
    mate has an infinite radius.
    """
    sharper = min(radius, mate_radius)
    curvature = 1.0 / radius + 1.0 / mate_radius
    ratio = max(pressure / limit, 1.0) ** 2
    half_width = 2.0 * limit * ratio / (curvature * MODULUS)
    approach = 0.5 * half_width**2 * curvature * (1.0 - 1.0 / ratio)
    return Bedding(approach / (curvature * sharper), radius=sharper * ratio)


Landing = tuple[float, ...]  #: hardest load in N/m for each class of ``OVERLAPS``
NO_LANDING = (0.0,) * len(OVERLAPS)


def hardest(landings: Iterable[Landing]) -> Landing:
    """Return the largest load in each class of overlap, N/m; zeros without a landing."""
    return tuple(map(max, zip(*landings, strict=True))) or NO_LANDING


LANDING_RULES = tuple(rule for rule in RULES.values() if rule.group == "impact")


class Demand(NamedTuple):
    """Pressures of a landing, Pa: on face, core below it and new edges by Hertz."""

    face: float = 0.0
    core: float = 0.0
    edge: float = 0.0  #: on an edge
    ridge: float = 0.0  #: of an edge on a face of another slope


EDGE, RIDGE = 2, 3  #: places in ``Demand``


def demand_quantile(demands: Array, weights: Sequence[float], share: float) -> Demand:
    """Compute the pressure that ``share`` in (0, 1) of all shifts exceeds, for each kind.

    ``demands`` (n, 4) as of ``demands_of``; ``weights`` (n,) need not add up to one. The quantile
    is linear between the middles of the weights and constant beyond the largest.
    """
    probabilities = np.array(weights) / sum(weights)
    quantiles = []
    for pressures in demands.T:
        distribution = empirical_distribution(pressures, probabilities)
        quantiles.append(float(np.interp(1.0 - share, *distribution)))
    return Demand(*quantiles)


@dataclass(frozen=True)
class TailPrior:
    """Settings of the posterior of a tail: excesses over a threshold."""

    tail_share: float = 0.15  #: of the shifts, whose excesses are fitted; at least 3 ``share``
    shape_mean: float = -0.1  #: of xi; loads are bounded as the speed of a ring is; judged
    shape_sd: float = 0.3  #: judged: includes an exponential, a bounded and a heavy tail
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
    counts: Array  #: number of shifts that each excess represents, (m,)
    share: float  #: of all shifts that exceed the threshold
    shifts: float  #: number of all shifts; the effective one for unequal weights


class TailGrid(NamedTuple):
    """Posterior of a generalised Pareto distribution on a grid of its parameters."""

    shapes: Array  #: xi, (g,)
    scales: Array  #: sigma in the unit of the values, (g,)
    probabilities: Array  #: of sum one, (g,)


def tail_of(values: Array, weights: Array, tail_share: float) -> Tail | None:
    """Select the tail: the largest of ``values`` (n,) with a probability of ``tail_share``.

    ``weights`` of the shifts, (n,), need not add up to one. None if no value is positive.
    """
    shifts = weights.sum() ** 2 / (weights**2).sum()
    order = np.argsort(values, kind="stable")[::-1]
    probabilities = (weights / weights.sum())[order]
    sorted_values = values[order]
    exceedances = np.cumsum(probabilities)
    tail_count = int(np.searchsorted(exceedances, min(tail_share, 1.0))) + 1
    count = min(tail_count, int((values > 0.0).sum()))
    if count == 0:
        return None
    threshold = float(sorted_values[count]) if count < len(values) else 0.0
    return Tail(
        threshold,
        excesses=sorted_values[:count] - threshold,
        counts=shifts * probabilities[:count],
        share=float(exceedances[count - 1]),
        shifts=shifts,
    )


def tail_posterior(tail: Tail, prior: TailPrior) -> TailGrid:
    """Compute the posterior of shape and scale from excesses that are not all zero."""
    mean_excess = float(tail.excesses.mean())
    smallest_scale, largest_scale = (mean_excess * factor for factor in prior.scale_ends)
    scales = np.geomspace(smallest_scale, largest_scale, prior.grid)
    half_width = 4.0 * prior.shape_sd
    shapes = prior.shape_mean + np.linspace(-half_width, half_width, prior.grid)
    shapes = np.where(np.abs(shapes) < 1e-6, 1e-6, shapes)
    xi, sigma = np.meshgrid(shapes, scales, indexing="ij")
    bases = 1.0 + xi[..., None] * tail.excesses / sigma[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        log_densities = -np.log(sigma[..., None]) - (1.0 + 1.0 / xi[..., None]) * np.log(bases)
    in_support = np.all(bases > 0.0, axis=-1)
    log_densities = np.where(np.expand_dims(in_support, -1), log_densities, 0.0)
    logs = np.where(in_support, (tail.counts * log_densities).sum(-1), -np.inf)
    logs -= 0.5 * ((xi - prior.shape_mean) / prior.shape_sd) ** 2
    probabilities = np.exp(logs - logs.max()).ravel()
    return TailGrid(xi.ravel(), sigma.ravel(), probabilities / probabilities.sum())


def tail_draws(tail: Tail, posterior: TailGrid, share: float | None, prior: TailPrior) -> Array:
    """Draw the value that ``share`` of all shifts exceeds, (``prior.draws``,).

    With ``share`` None the largest value of as many new shifts.
    """
    rng = np.random.default_rng(prior.seed)
    grid_size = posterior.probabilities.size
    indices = rng.choice(grid_size, prior.draws, p=posterior.probabilities)
    tail_shifts = tail.shifts * tail.share
    other_shifts = tail.shifts * (1.0 - tail.share)
    tail_shares = rng.beta(tail_shifts + 0.5, other_shifts + 0.5, prior.draws)
    level = rng.exponential(1.0 / tail.shifts, prior.draws) if share is None else share
    ratio = np.minimum(level / tail_shares, 1.0)  # at 1 the threshold itself
    xi = posterior.shapes[indices]
    sigma = posterior.scales[indices]
    return np.asarray(tail.threshold + sigma * np.expm1(-xi * np.log(ratio)) / xi)


def tail_interval(values: Array, weights: Array, share: float | None) -> tuple[float, float]:
    """Compute the 95 % interval of the value that ``share`` of all shifts exceeds.

    ``values`` of shifts, (n,), with ``weights`` (n,), which need not add up to one. With ``share``
    None that of the largest value of as many new shifts.
    """
    tail = tail_of(values, weights, max(TAIL.tail_share, 3.0 * (share or 0.0)))
    if tail is None:
        return 0.0, 0.0
    if not tail.excesses.any():
        return tail.threshold, tail.threshold
    draws = tail_draws(tail, tail_posterior(tail, TAIL), share, TAIL)
    low, high = np.quantile(draws, LEVELS)
    return float(low), float(high)


@dataclass(frozen=True, eq=False)
class Landings:
    """Landings of simulated shifts."""

    loads: Array  #: line load by class of ``OVERLAPS``, N/m, (n, k)
    weights: Array  #: of the shifts, (n,)

    def demand(self, dog: Dog, limits: Limits) -> Demand:
        """Compute the demand of the hardest landing, or of the one that a share exceeds.

        ``load.landing_share`` is that share.
        """
        share = limits.load.landing_share
        if share is None:
            return demand_of(dog, hardest(map(tuple, self.loads.tolist())), limits)
        return demand_quantile(demands_of(dog, self.loads, limits), self.weights.tolist(), share)

    def interval(self, dog: Dog, limits: Limits) -> tuple[Demand, Demand]:
        """Compute the 95 % interval of the demand, widened to contain it."""
        share = limits.load.landing_share
        demands = demands_of(dog, self.loads, limits)
        low, high = [], []
        for pressures, nominal in zip(demands.T, self.demand(dog, limits), strict=True):
            low_end, high_end = tail_interval(pressures, self.weights, share)
            low.append(min(low_end, nominal))
            high.append(max(high_end, nominal))
        return Demand(*low), Demand(*high)


def demand_of(dog: Dog, landing: Landing, limits: Limits) -> Demand:
    """Compute the demand of a landing."""
    return Demand(*demands_of(dog, np.array([landing]), limits)[0].tolist())


class Crests(NamedTuple):
    """Crests of both rings as they land on each other."""

    dog: Dog  #: of the sliding ring
    mate: Dog
    radius: float  #: of the sliding dog's crest, m
    mate_radius: float
    cuts: float  #: length that both roundings take from an overlap, m
    pressure_limit: float  #: up to which an edge stays, Pa

    @property
    def curvature(self) -> float:
        """Sum of the curvatures of both edges, 1/m."""
        return 1.0 / self.radius + 1.0 / self.mate_radius

    @property
    def widest(self) -> float:
        """Largest overlap, by the narrower dog, m."""
        return min(max(ring.face_width, ring.back_width) for ring in (self.dog, self.mate))


def crests_of(dog: Dog, limits: Limits) -> Crests:
    """Return the crests of the sliding dog and its mate as made."""
    mate = dog_pair(dog, limits.output_dog).output
    radius = tip_radius(dog, limits.root_radius)
    mate_radius = tip_radius(mate, limits.root_radius)
    cuts = radius * dog.crest_cut + mate_radius * mate.crest_cut
    pressure_limit = min(material.edge_pressure for material in limits.ring_materials)
    return Crests(dog, mate, radius, mate_radius, cuts, pressure_limit)


def class_middles(crests: Crests) -> Array:
    """Compute the middles of the classes of overlap up to the width of the faces, m, (k,)."""
    widest = crests.widest
    lows = np.array(OVERLAPS)
    middles = lows + HALF_CLASS
    middles[-2] = 0.5 * (lows[-2] + lows[-1])
    middles[-1] = 0.5 * (lows[-1] + max(widest, lows[-1]))
    return np.minimum(middles, widest)


def landing_stiffness(crests: Crests, overlaps: Any, line_loads: Any, factor: float = 1.0) -> Array:
    """Compute the stiffness of a pair of dogs per length as they land, N/m2.

    ``overlaps`` in m and ``line_loads`` in N/m, arrays of one shape; ``factor`` is
    ``load.dog_stiffness_factor``.
    """
    loads = np.maximum(line_loads, MIN_LINE_LOAD)
    pressure = np.minimum(edge_pressure(loads, crests.curvature), crests.pressure_limit)
    edge_width = EVEN_WIDTH * 2.0 * loads / (math.pi * pressure)
    width = np.maximum(overlaps - crests.cuts, np.minimum(edge_width, crests.widest))
    start = np.maximum(0.5 * (overlaps - width), 0.0)
    dogs = (crests.dog, crests.mate)
    compliance = sum(
        ring.radial_width * face_compliance(ring, Strip(start, width)) for ring in dogs
    )
    stiffness: Array = factor / np.asarray(compliance)
    return stiffness


def blow_energies(line_loads: Array, overlaps: Array, width: float, contact: ContactSet) -> Array:
    """Compute the energy of simulated landings per length of a pair of dogs, J/m.

    ``line_loads`` in N/m, ``width`` of the dogs along the radius in m.
    """
    if contact.impact is not None:
        forces = line_loads * width
        return 0.4 * forces * (forces / contact.impact.stiffness) ** (2.0 / 3.0) / width
    return 0.5 * line_loads**2 / (contact.stiffness * overlaps)


def elastic_loads(crests: Crests, landings: Array, limits: Limits) -> Array:
    """Compute the line loads of elastic dogs, N/m, (n, k), of simulated ``landings`` (n, k)."""
    load = limits.load
    dog = crests.dog
    overlaps = np.broadcast_to(class_middles(crests), landings.shape)
    energies = blow_energies(landings, overlaps, dog.radial_width, load.contact)
    loads = landings
    for _ in range(BLOW_ITERATIONS):
        stiffness = landing_stiffness(crests, overlaps, loads, load.stiffness_factor)
        even_loads = np.sqrt(2.0 * energies * stiffness)
        forces = (even_loads * dog.radial_width).ravel()
        pair_stiffness = (stiffness * dog.radial_width).ravel()
        shares: Any = load.landing(dog, forces, pair_stiffness)  # type: ignore[arg-type]
        loads = even_loads / np.sqrt(np.broadcast_to(shares, forces.size)).reshape(landings.shape)
    return loads


def demands_of(dog: Dog, landings: Any, limits: Limits) -> Array:
    """Compute the fields of ``Demand``, Pa, (n, 4), of simulated ``landings`` in N/m, (n, k).

    ``dog`` is that of the sliding ring; both rings bear one load. Where slopes are unlike, an edge
    also bears on a plane face.
    """
    crests = crests_of(dog, limits)
    loads = elastic_loads(crests, landings, limits)
    overlaps = np.array(OVERLAPS)
    flat_widths = np.maximum(overlaps - crests.cuts, 0.0)
    has_flat = flat_widths >= LAND
    flat_loads = loads[:, has_flat]
    core_spread = 2.0 * min(material.case_depth for material in limits.ring_materials)
    face = (flat_loads / overlaps[has_flat]).max(axis=1, initial=0.0)
    core = (flat_loads / (flat_widths[has_flat] + core_spread)).max(axis=1, initial=0.0)
    flat_pressure = 0.25 * math.pi * crests.pressure_limit
    edge_load: Any = (loads - flat_pressure * flat_widths).max(axis=1, initial=0.0)
    edge = edge_pressure(edge_load, crests.curvature)
    ridge: Any = np.zeros_like(face)
    pair = dog_pair(dog, limits.output_dog)
    if max(pair.faces.slope_rise, pair.backs.slope_rise) > 0.0:
        flat_load: Any = flat_loads.max(axis=1, initial=0.0)
        ridge = edge_pressure(flat_load, 1.0 / min(crests.radius, crests.mate_radius))
    return np.array([face, core, edge, ridge]).T


class LandingLoad(NamedTuple):
    """Load of a landing that decides a check."""

    check: str
    overlap: float  #: middle of its class, m
    force: float  #: on the most loaded of elastic dogs, N
    simulated_force: float  #: on each dog in the softer layer of the simulation, N


def landing_load(dog: Dog, limits: Limits, landings: Landings) -> LandingLoad | None:
    """Find the landing behind the landing check with the smallest margin; None without a load.

    Where ``load.landing_share`` sets a quantile, the landing is the one nearest to it.
    """
    demand = landings.demand(dog, limits)
    check = smallest_margin(demand_checks(dog, demand, limits))
    names = [rule.name for rule in LANDING_RULES]
    kind = names.index(check.name)
    if kind == EDGE and demand.ridge > demand.edge:
        kind = RIDGE
    if demand[kind] == 0.0:
        return None
    demands = demands_of(dog, landings.loads, limits)[:, kind]
    landing = landings.loads[int(np.argmin(np.abs(demands - demand[kind])))]
    # A row for each class of overlap alone.
    demands_by_class = demands_of(dog, np.diag(landing), limits)[:, kind]
    place = int(np.argmax(demands_by_class))
    crests = crests_of(dog, limits)
    elastic_load = elastic_loads(crests, np.array([landing]), limits)[0, place]
    return LandingLoad(
        check.name,
        overlap=float(class_middles(crests)[place]),
        force=float(elastic_load * dog.radial_width),
        simulated_force=float(landing[place] * dog.radial_width),
    )


def bedding(dog: Dog, demand: Demand, limits: Limits) -> Bedding:
    """Compute the bedding of the edges of both rings, the deeper of edge and ridge."""
    crests = crests_of(dog, limits)
    smaller_radius = min(crests.radius, crests.mate_radius)
    return max(
        bedding_of(demand.edge, crests.radius, crests.mate_radius, crests.pressure_limit),
        bedding_of(demand.ridge, smaller_radius, math.inf, crests.pressure_limit),
    )


def demand_checks(
    dog: Dog, demand: Demand, limits: Limits, interval: tuple[Demand, Demand] | None = None
) -> tuple[LimitCheck, ...]:
    """Return the checks of a landing, with the ``interval`` of the demand."""
    materials = limits.ring_materials
    safety = limits.load.safety
    allowables = (
        min(material.case_yield for material in materials) / safety,
        min(material.proof_stress for material in materials) / safety,
        limits.load.edge_bedding_share * min(material.case_depth for material in materials),
    )

    def checks(end: Demand) -> tuple[LimitCheck, ...]:
        values = (end.face, end.core, bedding(dog, end, limits).depth)
        names = (rule.name for rule in LANDING_RULES)
        return checks_of(zip(names, values, allowables, strict=True))

    if interval is None:
        return checks(demand)
    return tuple(
        replace(check, interval=(low.value, high.value))
        for check, low, high in zip(checks(demand), *map(checks, interval), strict=True)
    )


RATE_REMEDY = "1e-7 is well lubricated, 1e-5 hardly"
HEIGHT_REMEDY = "give the height in mm"


@dataclass(frozen=True)
class Wear:
    """Wear at the end of the life: of the faces by a rate or a measured loss, and of the edges.

    ``rate`` in m3/(N m), ``crest_loss`` and ``edge_radius`` in m; None leaves edges as they are.
    """

    rate: float | None = quantity("rate_mm3_Nm", 0.0, 1e-2, None, remedy=RATE_REMEDY)
    crest_loss: float | None = quantity("crest_loss_mm", 0.0, 2.0, None, remedy=HEIGHT_REMEDY)
    edge_radius: float | None = quantity("edge_radius_mm", SHARPEST / MM, 10.0, None)

    def __post_init__(self) -> None:
        face_values = [value for value in (self.rate, self.crest_loss) if value is not None]
        if len(face_values) != 1 and (face_values or self.edge_radius is None):
            raise InputError(
                "[wear] needs one of wear.rate_mm3_Nm (Archard) and wear.crest_loss_mm (measured); "
                "give one and not both"
            )
        require_ranges(self, "wear", "give the radius in mm")

    def loss(self, dog: Dog, energy: float, friction: float, shifts: float) -> float:
        """Compute the loss of height at the crest of a dog after ``shifts``, m.

        ``energy`` in J is the mean one of a shift, ``friction`` the dynamic coefficient.
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

    def edge_radius_at(self, dog: Dog, share: float) -> float:
        """Compute the radius of a dog's edges at a share of the life, m."""
        if self.edge_radius is None:
            return dog.edge_radius
        if self.edge_radius < dog.edge_radius:
            new_radius = f"dog.edge_radius_mm = {dog.edge_radius / MM:.6g}"
            sentence = Refusal(
                "wear.edge_radius_mm",
                self.edge_radius / MM,
                "mm",
                rule=f"edges do not get sharper than {new_radius}",
                remedy="give the radius at the end of the life",
            )
            raise InputError(sentence)
        new_square = dog.edge_radius**2
        worn_square = self.edge_radius**2
        return math.sqrt(new_square + share * (worn_square - new_square))


def wear_crests(dog: Dog, loss: float) -> Dog:
    """Return the dog of a pair whose crests have lost the height ``loss``, m.

    Raises GeometryError if nothing of the dog is left.
    """
    flat_dog = replace(
        dog,
        height=dog.height - 2.0 * loss,
        axial_gap=dog.axial_gap + 2.0 * loss,
        chamfer=0.0,
        chamfer_back=0.0,
        crest=1.0,
    )
    back_drop, face_drop = (max(0.0, drop - loss) for drop in dog.drops_at(dog.mean_radius))
    if face_drop == back_drop == 0.0:
        return flat_dog

    def face_angle(drop: float, share: float, flank_angle: float) -> float:
        width = share * flat_dog.tip_width + drop * math.tan(flank_angle)
        return math.atan2(drop, width)

    return replace(
        flat_dog,
        crest=dog.crest,
        chamfer=face_angle(face_drop, dog.crest, dog.braking),
        chamfer_back=face_angle(back_drop, 1.0 - dog.crest, dog.traction),
    )
