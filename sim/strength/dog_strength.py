r"""Strength of a dog by closed forms, and the limits and checks of a design.

- flank pressure :math:`F/A` over what touches; shear :math:`1.5 F/(b s)` (parabola)
- root bending: tension in the fillet (``root_tension``) against the static strength of the case;
  behind a rim thinner than 1.2 heights times :math:`Y_B = 1.6 \ln(2.242\,h/s_R)` (ISO 6336-3)
- equivalent stress of the core :math:`\sqrt{\sigma_c^2 + 3 \tau^2}` below the case depth *t*:
  :math:`\sigma_c = \sigma_n (1 + (K - 1) f)`, :math:`f = (r^{-2} + 3 r^{-4})/4`, :math:`r = 1 +
  t/\varrho` (Kirsch 1898)
- fatigue: one load cycle a shift, or Miner's sum over a spectrum (``sim.strength.materials``); the
  abuse torque is carried once and meets the static limits alone
- teeth of a sleeve have a root, shear and rim of their own (``sim.strength.spline``)

Sources: DIN 5466-1 (pressure), ISO 6336-3 and -5 (root, life factor, alternating load).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.elementwise import hypot, largest, log, map_elements, smallest, sqrt, tan, where
from dogshape.sim.errors import require_between
from dogshape.sim.shift.geometry import FLANKS, Dog, Dogs, Flank, flank_contact, side_angle
from dogshape.sim.shift.pair import ALIKE, OutputDog
from dogshape.sim.strength.checks import (
    LimitCheck,
    checks_of,
    feasible,
    worse_check,
    worse_ring,
)
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import locking_checks
from dogshape.sim.strength.manufacture import (
    Kind,
    ManufacturingLimits,
    Spread,
    Tolerances,
    losses,
    manufacturing_checks,
    tolerance_checks,
)
from dogshape.sim.strength.materials import (
    ENDURANCE_CYCLES,
    MATERIALS,
    STATIC_CYCLES,
    Material,
    stress_reserve,
)
from dogshape.sim.strength.spline import (
    Sleeve,
    bending,
    fillet_room,
    hoop_stress,
    pitch_shear,
    root_shear,
    stress_correction,
)
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import DEG, MM


@dataclass(frozen=True)
class Load:
    """Tangential force on one dog."""

    force: float  #: N
    flank: Flank
    lever: float  #: height above the floor, m


#: Ends of the fit; the relief is constant beyond them.
MAX_LENGTH_RATIO = 1.2  #: radial width over root width
MAX_FLANK_SLOPE = math.tan(math.radians(30.0))


class Tension(NamedTuple):
    """Coefficients k_1 to k_6 of the first principal stress (``root_tension``)."""

    notch: float
    sharpness: float
    lean: float
    spread: float
    proximity: float
    axial: float


TENSION = Tension(
    notch=0.341,
    sharpness=0.615,
    lean=-0.557,
    spread=-0.162,
    proximity=1.068,
    axial=0.314,
)


def root_nominal(dog: Dog, load: Load, by: Tension = TENSION) -> float:
    """Compute the tension at the root on the loaded side without the notch, Pa."""
    width = dog.root_width
    slope = tan(side_angle(dog, load.flank))
    arm = 0.5 * width - load.lever * slope
    nominal = (
        6.0 * load.lever / width**2
        + by.proximity / sqrt(width * load.lever)
        - by.axial * slope * largest(0.0, 6.0 * arm / width**2 + 1.0 / width)
    )
    # A third of the bending remains for steep flanks.
    return load.force / dog.radial_width * largest(nominal, 2.0 * load.lever / width**2)


def root_tension(dog: Dog, root_radius: float, load: Load, by: Tension = TENSION) -> float:
    r"""Compute the largest first principal stress in the loaded flank's fillet, Pa.

    Force *F* at the height *l* above the floor on a flank that leans by :math:`\delta`, dog *b*
    long along the radius and *s* wide at the root, ``root_radius`` :math:`\rho` in m,
    :math:`e = s/2 - l \tan\delta`:

    .. math::
        \sigma_1 = \frac{F}{b} K (1 + k_3 \tan\delta) \left[ \frac{6 l}{s^2}
            + \frac{k_5}{\sqrt{s l}}
            - k_6 \tan\delta \left(\frac{6 e}{s^2} + \frac{1}{s}\right) \right], \quad
        K = \left(1 + k_1 (s/\rho)^{k_2}\right) (1 + k_4 b/s)

    Terms of Heywood (1948), then relief by the axial force of a leaning flank, fitted to finite
    elements by ``python -m benchmarks.root_stress``: 3.3 % rms on 56 unseen loads, at most 12 % too
    low. For rings of 52/44 mm on a hub, chamfer to 20, side angles 4 to 30 deg, height 1.6 to 6 mm,
    6 to 36 dogs, root radius 0.2 to 0.6 mm.
    """
    return notch_factor(dog, root_radius, load.flank, by) * root_nominal(dog, load, by)


def notch_factor(dog: Dog, root_radius: float, flank: Flank, by: Tension = TENSION) -> float:
    """Compute the tension in the fillet over the nominal one, at least 1."""
    require_between("root_radius_mm", root_radius / MM, 0.01, 10.0, "correct the fillet")
    length_ratio = smallest(dog.radial_width / dog.root_width, MAX_LENGTH_RATIO)
    slope = smallest(tan(side_angle(dog, flank)), MAX_FLANK_SLOPE)
    sharp = 1.0 + by.notch * (dog.root_width / root_radius) ** by.sharpness
    notch = sharp * (1.0 + by.spread * length_ratio)
    return largest(1.0, notch * (1.0 + by.lean * slope))


def outside_fit(dog: Dog, root_radius: float) -> list[str]:
    """Describe the proportions of a design that lie outside the fit of the closed form."""
    width = dog.root_width
    ratios = [
        ("radial width over root width", dog.radial_width / width, 0.3, MAX_LENGTH_RATIO),
        ("root width over root radius", width / root_radius, 6.0, 50.0),
        ("height over root width", dog.height / width, 0.35, 1.2),
    ]
    ratios += [(f"{f} side angle, deg,", side_angle(dog, f) / DEG, 0.0, 30.0) for f in FLANKS]
    sentences = []
    for name, value, low, high in ratios:
        if low <= value <= high:
            continue
        sentence = f"{name} is {value:.4g}, but the root formula was fitted to {low:g} to {high:g}"
        if value < low == 0.0:
            sentence += " and is 4 to 13 % too low at -4 to -8"
        sentences.append(sentence)
    return sentences


#: Smallest area of contact of a flank, m2: any design has a finite pressure.
SMALLEST_AREA = 1e-8
THICK_RIM = 1.2  #: heights of the dog; a thicker rim has no effect
THINNEST_RIM = 0.5  #: heights of the dog; the formula holds for no thinner rim


@dataclass(frozen=True)
class Limits:
    """Limits of all checks of a design.

    A shift may end ``seated_tolerance`` short of full depth, m. ``strikes`` are the ends of the
    range of the flank strike; without one it is not judged. Dogs without a ``sleeve`` stand on the
    face of a ring. Checks are those of the worse ring; ``output_material`` None is the sliding
    ring's. While one of unlike rings is checked, ``mate`` of the load case is the other dog.
    """

    load: LoadCase = field(default_factory=LoadCase)
    material: Material = MATERIALS["16MnCr5"]
    manufacturing: ManufacturingLimits = field(default_factory=ManufacturingLimits)
    tolerances: Tolerances = field(default_factory=Tolerances)
    seated_tolerance: float = 5e-5
    strikes: tuple[Strike, ...] = ()
    sleeve: Sleeve | None = None
    output_dog: OutputDog = ALIKE
    output_material: Material | None = None

    @property
    def has_unlike_rings(self) -> bool:
        """Whether the rings differ in dog or material."""
        return self.output_dog != ALIKE or self.output_material is not None

    @property
    def ring_materials(self) -> tuple[Material, ...]:
        """Materials of sliding and output ring; one if both have the same."""
        if self.output_material is None:
            return (self.material,)
        return self.material, self.output_material

    def beside(self, mate: Dog) -> Limits:
        """Return the limits of a dog beside the dog of the other ring."""
        return replace(self, load=replace(self.load, mate=mate))

    @property
    def root_radius(self) -> float:
        """Radius of root fillets and tip edges, m."""
        return self.manufacturing.root_radius

    def with_root_radius(self, radius: float) -> Limits:
        """Return the limits with another ``radius`` of root and tip edges, m."""
        return replace(self, manufacturing=replace(self.manufacturing, root_radius=radius))

    @property
    def allowable_stress(self) -> float:
        """Proof stress of the core over safety, Pa."""
        return self.material.proof_stress / self.load.safety

    @property
    def static_root_stress(self) -> float:
        """Static strength of the root, local stress over safety, Pa."""
        return self.material.endurance(STATIC_CYCLES) / self.load.safety

    def endurance(self, cycles: float) -> float:
        """Compute the endurable local root stress for ``cycles`` alternating loads, Pa."""
        load = self.load
        return self.material.endurance(cycles) * load.reversal / load.safety_fatigue


RingChecks = Callable[[Dog, Limits], tuple[LimitCheck, ...]]  #: checks of one ring


def root_load(dog: Dog, limits: Limits, flank: Flank, torque: float | None = None) -> Load:
    """Return the load of the most loaded dog on a flank; by default under the static torque."""
    return _at_load_height(dog, limits, flank, limits.load.force_per_dog(dog, flank, torque))


def _at_load_height(dog: Dog, limits: Limits, flank: Flank, force: float) -> Load:
    contact = flank_contact(dog, limits.root_radius, flank, limits.load.mate)
    level = contact.level(limits.load.load_height)
    return Load(force, flank, level)


class Root(NamedTuple):
    """Stresses of a root, Pa: tension in the fillet and below the case, mean shear."""

    tension: float
    core: float
    shear: float


def root_of(dog: Dog, limits: Limits, load: Load) -> Root:
    """Compute the stresses of a root, with the factor of a thin rim and the notch below a case."""
    radius = limits.root_radius
    depth = 1.0 + limits.material.case_depth / radius
    notch_share = (depth**-2 + 3.0 * depth**-4) / 4.0
    sleeve = limits.sleeve
    if sleeve is not None:
        length = engaged_length(dog, limits, load.flank)
        nominal = bending(dog, sleeve, load.force, length)
        notch = stress_correction(dog, sleeve, radius)
        return Root(
            tension=notch * nominal,
            core=nominal * (1.0 + (notch - 1.0) * notch_share),
            shear=root_shear(dog, sleeve, load.force, length),
        )
    nominal = root_nominal(dog, load)
    notch = notch_factor(dog, radius, load.flank)
    rim_factor = 1.0
    rim = limits.manufacturing.rim
    if rim is not None:
        thin_rim_factor = largest(1.0, 1.6 * log(2.242 * dog.height / rim))
        rim_factor = where(rim >= THICK_RIM * dog.height, 1.0, thin_rim_factor)
    return Root(
        tension=notch * nominal * rim_factor,
        core=nominal * (1.0 + (notch - 1.0) * notch_share) * rim_factor,
        shear=1.5 * load.force / (dog.radial_width * dog.root_width),
    )


def flank_pressure(dog: Dog, limits: Limits, flank: Flank, force: float) -> float:
    """Compute the mean pressure of a ``force`` in N on a flank, Pa."""
    return force / _contact_area(dog, limits, flank)


def engaged_length(dog: Dog, limits: Limits, flank: Flank) -> float:
    """Compute the mean length along the shaft that touches at full depth, m."""
    return _contact_area(dog, limits, flank) / dog.radial_width


def _contact_area(dog: Dog, limits: Limits, flank: Flank) -> float:
    contact = flank_contact(dog, limits.root_radius, flank, limits.load.mate)
    return largest(contact.area, SMALLEST_AREA)


def fatigue(dog: Dog, limits: Limits) -> tuple[float, float]:
    """Compute tension in the fillet and fatigue limit of the worse flank, Pa.

    Under a spectrum the tension is that of its largest torque, and the limit is that tension times
    the factor on all torques at which Miner's sum is 1.
    """
    case = limits.load

    def tension(flank: Flank, share: float) -> float:
        load = root_load(dog, limits, flank, share * case.design_torque)
        return root_of(dog, limits, load).tension

    if not case.spectrum:
        worst_tension = largest(*(tension(flank, case.share_of(flank)) for flank in FLANKS))
        return worst_tension, limits.endurance(case.shifts)
    endurance = limits.endurance(ENDURANCE_CYCLES)
    worst_tension = 0.0
    smallest_factor = math.inf
    for flank, sign in zip(FLANKS, (1.0, -1.0), strict=True):
        loads = [(sign * share, cycles) for share, cycles in case.spectrum if sign * share > 0.0]
        if not loads:
            continue
        tensions = [tension(flank, share) for share, _ in loads]
        reserve = partial(stress_reserve, limits.material, [cycles for _, cycles in loads])
        factor = map_elements(reserve, *(stress / endurance for stress in tensions))
        worst_tension = where(factor < smallest_factor, largest(*tensions), worst_tension)
        smallest_factor = smallest(factor, smallest_factor)
    return worst_tension, smallest_factor * worst_tension


def strike_torque(dog: Dog, limits: Limits, strike: Strike, flank: Flank) -> float:
    """Compute the torque of a strike on a flank, N m."""
    count = limits.load.touching(dog)
    stiffness = count * limits.load.stiffness(dog, flank) * dog.mean_radius**2
    return strike.torque(strike.speed(flank), stiffness)


def strike_force(dog: Dog, limits: Limits, strike: Strike, flank: Flank) -> float:
    """Compute the tangential force of a strike on the most loaded dog, N.

    A blow is shared as a landing is: the foremost dogs take its energy.
    """
    count = limits.load.touching(dog)
    mean_force = strike_torque(dog, limits, strike, flank) / (dog.mean_radius * count)
    return mean_force / sqrt(limits.load.blow(dog, mean_force, flank))


def within_tolerances(dog: Dog, limits: Limits, kind: Kind) -> tuple[LimitCheck, ...]:
    """Return the checks of contact ratio and clearance within the tolerances."""
    return tolerance_checks(
        dog,
        limits.root_radius,
        limits.tolerances,
        seated=limits.seated_tolerance,
        kind=kind,
        output_dog=limits.output_dog,
    )


def strength_checks(dog: Dog, limits: Limits) -> tuple[LimitCheck, ...]:
    """Return all checks of a design, or of ``Dogs``, that need no simulation.

    Values and limits are in the unit of each check: numbers, or arrays (n,) for ``Dogs``. Of unlike
    rings a check is that of the worse one.
    """
    return tuple(check for group in _GROUPS for check in _checks_of(group, dog, limits))


def keeps_limits(dog: Dog, limits: Limits) -> bool:
    """Test whether every check passes; stops at the first group that fails."""
    return all(feasible(_checks_of(group, dog, limits)) for group in _GROUPS)


def _checks_of(
    group: RingChecks, dog: Dog, limits: Limits, nominal: Dog | None = None
) -> Iterable[LimitCheck]:
    """Return the checks of a group, of unlike rings those of the worse one.

    ``nominal`` is the sliding dog from which ``dog`` deviates, as the output dog does then.
    """
    if not limits.has_unlike_rings or group is _tolerance_checks:
        return group(dog, limits)
    output = limits.output_dog.beside(dog, nominal)
    low = limits.output_dog.low_beside(dog, nominal)
    limits = bearing_limits(dog, limits, nominal)
    output_material = limits.output_material or limits.material
    sliding_limits = limits.beside(output)
    output_limits = replace(limits.beside(dog), material=output_material)
    sliding_checks = group(dog, sliding_limits)
    output_checks = group(output, output_limits)
    if low is not None and group is _shape_checks:  # loads are not above those of a high dog
        if limits.output_dog.is_sliding_sparse:
            low_checks = group(low, sliding_limits)
            sliding_checks = tuple(map(worse_check, sliding_checks, low_checks))
        else:
            low_checks = group(low, output_limits)
            output_checks = tuple(map(worse_check, output_checks, low_checks))
    checks = {check.name: check for check in sliding_checks}
    for check in output_checks:
        sliding = checks.get(check.name)
        checks[check.name] = worse_ring(sliding, check) if sliding else check
    return checks.values()


def bearing_limits(dog: Dog, limits: Limits, nominal: Dog | None = None) -> Limits:
    """Return the limits with the load that low dogs of a ring take, by touching area.

    ``dog`` is that of the sliding ring and ``nominal`` the one from which it deviates.
    """
    low = limits.output_dog.low_beside(dog, nominal)
    if low is None:
        return limits
    output = limits.output_dog.beside(dog, nominal)
    radius = limits.root_radius
    high, mate = (dog, output) if limits.output_dog.is_sliding_sparse else (output, dog)
    low_depth = smallest(high.height, mate.height) - (high.height - low.height)

    def low_share(flank: Flank) -> float:
        high_area = largest(flank_contact(high, radius, flank, mate).area, SMALLEST_AREA)
        low_area = flank_contact(low, radius, flank, mate, low_depth).area
        return smallest(low_area / high_area, 1.0)

    low_shares = (low_share("traction"), low_share("braking"))
    return replace(limits, load=replace(limits.load, low_shares=low_shares))


def margin_losses(dog: Dog, limits: Limits) -> dict[str, Spread]:
    """Compute the largest loss of each margin within the tolerances, by the name of the check.

    Contact ratio and clearance include the tolerances and are left out.
    """

    def margins(shape: Dog, root_radius: float, nominal: Dog) -> dict[str, float]:
        radii = np.unique(root_radius).tolist()
        if len(radii) == 1 or not (isinstance(shape, Dogs) and isinstance(nominal, Dogs)):
            return margins_of_radius(shape, radii[0], nominal)
        margins_by_name: dict[str, Any] = {}
        for radius in radii:
            has_radius: Any = root_radius == radius
            part = margins_of_radius(shape.select(has_radius), radius, nominal.select(has_radius))
            for name, margin in part.items():
                column = margins_by_name.setdefault(name, np.full(len(has_radius), math.inf))
                column[has_radius] = margin
        return margins_by_name

    def margins_of_radius(shape: Dog, root_radius: float, nominal: Dog) -> dict[str, float]:
        case = limits.with_root_radius(root_radius)
        checks = chain(*(_checks_of(group, shape, case, nominal) for group in _GROUPS[:-1]))
        margins_by_name = {check.name: check.margin for check in checks}
        if limits.output_dog == ALIKE:
            return margins_by_name
        possible = limits.output_dog.possible_beside(shape, nominal)
        return {n: where(possible, margin, -math.inf) for n, margin in margins_by_name.items()}

    return losses(dog, limits.root_radius, limits.tolerances, margins)


def _shape_checks(dog: Dog, limits: Limits) -> tuple[LimitCheck, ...]:
    """Return the checks of manufacture and of the soft core of the tip."""
    core = dog.tip_width_at(dog.inner_radius) - 2.0 * limits.material.case_depth
    core_checks = checks_of([("tip_core", core, limits.manufacturing.tip_core)])
    room = None if limits.sleeve is None else fillet_room(dog, limits.sleeve)
    return (*manufacturing_checks(dog, limits.manufacturing, room), *core_checks)


def _load_checks(dog: Dog, limits: Limits) -> tuple[LimitCheck, ...]:
    """Return the checks of pressure, root stresses, fatigue and rim."""
    case = limits.load
    # Thousands of designs are checked, each at every deviation: the stresses are computed once.
    roots = {flank: root_of(dog, limits, root_load(dog, limits, flank)) for flank in FLANKS}
    rows = []
    for flank in FLANKS:
        # The allowable pressure is for the whole life, so the abuse torque does not count.
        force = case.force_per_dog(dog, flank, case.design_torque * case.share_of(flank))
        pressure = flank_pressure(dog, limits, flank, force)
        rows.append((f"flank_pressure_{flank}", pressure, limits.material.allowable_pressure))
    static_limit = limits.static_root_stress
    is_sleeve = limits.sleeve is not None
    bending_name = "tooth_bending" if is_sleeve else "root_bending"
    for flank, root in roots.items():
        rows.append((f"{bending_name}_{flank}", root.tension, static_limit))
    shear_name = "tooth_shear" if is_sleeve else "shear_stress"
    shear = largest(*(_shear_stress(dog, limits, flank, root) for flank, root in roots.items()))
    equivalent = largest(*(hypot(r.core, math.sqrt(3.0) * r.shear) for r in roots.values()))
    rows += [
        (shear_name, shear, limits.allowable_stress / math.sqrt(3.0)),
        ("equivalent_stress", equivalent, limits.allowable_stress),
        ("root_fatigue", *fatigue(dog, limits)),
    ]
    rim = limits.manufacturing.rim
    if rim is not None and limits.sleeve is not None:
        hoops = []
        for flank in FLANKS:
            length = engaged_length(dog, limits, flank)
            torque = case.static_torque(flank)
            hoops.append(hoop_stress(dog, limits.sleeve, rim, torque, length))
        rows.append(("sleeve_hoop", largest(*hoops), limits.allowable_stress))
    elif rim is not None:
        rows.append(("rim", rim, THINNEST_RIM * dog.height))
    return checks_of(rows)


def _shear_stress(dog: Dog, limits: Limits, flank: Flank, root: Root) -> float:
    """Compute the shear stress of a root, or of a sleeve's tooth at the pitch circle, Pa."""
    if limits.sleeve is None:
        return root.shear
    force = limits.load.force_per_dog(dog, flank)
    return pitch_shear(dog, force, engaged_length(dog, limits, flank))


def _strike_checks(dog: Dog, limits: Limits) -> tuple[LimitCheck, ...]:
    """Return the checks of root and flank in a strike, the worse of all strikes."""
    pressure_limit = limits.material.case_yield / limits.load.safety
    checks_by_strike = []
    for strike in limits.strikes:
        tension = pressure = 0.0
        for flank in strike.flanks:
            force = strike_force(dog, limits, strike, flank)
            load = _at_load_height(dog, limits, flank, force)
            tension = largest(tension, root_of(dog, limits, load).tension)
            pressure = largest(pressure, flank_pressure(dog, limits, flank, force))
        root_limit = limits.static_root_stress
        if strike.strikes is not None:
            root_limit = min(root_limit, limits.endurance(strike.strikes))
        rows = (
            ("flank_strike_root", tension, root_limit),
            ("flank_strike_flank", pressure, pressure_limit),
        )
        checks_by_strike.append(checks_of(rows, strike.ends))
    return tuple(reduce(worse_check, checks) for checks in zip(*checks_by_strike, strict=True))


def _tolerance_checks(dog: Dog, limits: Limits) -> tuple[LimitCheck, ...]:
    """Return the checks of contact ratio and clearance, which are of both rings."""
    return within_tolerances(dog, limits, "root_sum_square")


#: Groups of checks, cheap and often failing ones first; the last includes the tolerances.
_GROUPS: tuple[RingChecks, ...] = (
    _shape_checks,
    lambda dog, limits: locking_checks(dog, limits.load),
    _load_checks,
    _strike_checks,
    _tolerance_checks,
)
