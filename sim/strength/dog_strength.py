r"""Strength of a dog by closed forms, and everything that a design is checked against.

- flank pressure :math:`F/A` over what touches; shear :math:`1.5 F/(b s)` (parabola over a
  rectangle)
- root bending: tension in the fillet (``root_tension``) against the static strength of the
  case; behind a rim thinner than 1.2 heights times :math:`Y_B = 1.6 \ln(2.242\,h/s_R)` (ISO 6336-3,
  of spur gears; below half a height the formula ends)
- equivalent stress of the core :math:`\sqrt{\sigma_c^2 + 3 \tau^2}` below the case depth *t*:
  :math:`\sigma_c = \sigma_n (1 + (K - 1) f)`, :math:`f = (r^{-2} + 3 r^{-4})/4`, :math:`r = 1 +
  t/\varrho` (Kirsch 1898)
- flank strike: fillet and flank under the force of ``sim.strength.strike``
- fatigue: one load cycle a shift, or Miner's sum over a spectrum (``sim.strength.materials``); the
  abuse torque is carried once and meets the static limits alone

Sources: DIN 5466-1 (pressure), ISO 6336-3 and -5 (root, life factor, alternating load).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

from dogshape.sim.elementwise import each, hypot, largest, log, smallest, sqrt, tan, where
from dogshape.sim.errors import require_between
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, flank_contact, side_angle
from dogshape.sim.strength.checks import Check, Rule, feasible
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.locking import locking_checks
from dogshape.sim.strength.manufacture import (
    ManufacturingLimits,
    Spread,
    Tolerances,
    clearance_check,
    contact_check,
    losses,
    manufacturing_checks,
    tip_core_check,
)
from dogshape.sim.strength.materials import (
    ENDURANCE_CYCLES,
    MATERIALS,
    STATIC_CYCLES,
    Material,
    reserve,
)
from dogshape.sim.strength.strike import Strike
from dogshape.sim.units import DEG, MM, MPA


@dataclass(frozen=True)
class Load:
    """Tangential force on one dog, N, on a flank, at a height above the floor, m."""

    force: float
    flank: Flank
    lever: float


#: Where the fit ends: longest dog for its root width, and steepest flank (tangent). Beyond,
#: the relief by either stays what it is there.
LONGEST, STEEPEST = 1.2, math.tan(math.radians(30.0))


class Tension(NamedTuple):
    """Coefficients of the first principal stress."""

    notch: float
    sharpness: float
    lean: float
    spread: float
    near: float
    axial: float


TENSION = Tension(0.341, 0.615, -0.557, -0.162, 1.068, 0.314)


def root_nominal(dog: Dog, load: Load, by: Tension = TENSION) -> float:
    """Return the tension at the root on the loaded side without the notch, Pa."""
    width, lean = dog.root_width, tan(side_angle(dog, load.flank))
    arm = 0.5 * width - load.lever * lean
    nominal = (
        6.0 * load.lever / width**2
        + by.near / sqrt(width * load.lever)
        - by.axial * lean * largest(0.0, 6.0 * arm / width**2 + 1.0 / width)
    )
    # However steep the flank, a third of the bending stays.
    return load.force / dog.radial_width * largest(nominal, 2.0 * load.lever / width**2)


def root_tension(dog: Dog, root_radius: float, load: Load, by: Tension = TENSION) -> float:
    r"""Return the largest first principal stress in the loaded flank's fillet, Pa.

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
    """Return the tension in the fillet over the nominal one, at least 1."""
    lean = smallest(tan(side_angle(dog, flank)), STEEPEST)
    return largest(1.0, _notch(dog, root_radius, by) * (1.0 + by.lean * lean))


def outside_fit(dog: Dog, root_radius: float) -> list[str]:
    """Return in words what of a design lies outside the fit of the closed form."""
    ratios = (
        ("radial width over root width", dog.radial_width / dog.root_width, 0.3, LONGEST),
        ("root width over root radius", dog.root_width / root_radius, 6.0, 50.0),
        ("height over root width", dog.height / dog.root_width, 0.35, 1.2),
        ("steepest side angle, deg", max(dog.traction, dog.braking) / DEG, 0.0, 30.0),
    )
    return [
        f"{name} is {value:.3g}, but the root formula was fitted to {low:g} to {high:g}"
        for name, value, low, high in ratios
        if not low <= value <= high
    ]


def _notch(dog: Dog, root_radius: float, by: Tension) -> float:
    require_between("root_radius_mm", root_radius / MM, 0.01, 10.0, "correct the fillet")
    sharp = 1.0 + by.notch * (dog.root_width / root_radius) ** by.sharpness
    length = smallest(dog.radial_width / dog.root_width, LONGEST)
    return sharp * (1.0 + by.spread * length)


#: m2 that a flank is taken to touch with at least, so that any design has a finite pressure.
SMALLEST_AREA = 1e-8
THICK, THINNEST = 1.2, 0.5  #: heights of a rim: no effect above, no formula below


@dataclass(frozen=True)
class Limits:
    """Everything that a design is checked against.

    ``seated_tolerance`` is how far short of full depth a shift may end, m; without ``strike`` no
    flank strike is judged.
    """

    load: LoadCase = field(default_factory=LoadCase)
    material: Material = MATERIALS["16MnCr5"]
    manufacturing: ManufacturingLimits = field(default_factory=ManufacturingLimits)
    tolerances: Tolerances = field(default_factory=Tolerances)
    seated_tolerance: float = 5e-5
    strike: Strike | None = None

    @property
    def root_radius(self) -> float:
        """Radius of root fillets and tip edges, m."""
        return self.manufacturing.root_radius

    def with_root_radius(self, radius: float) -> Limits:
        """Return the same limits for another radius of root and tip edges, m."""
        if radius == self.root_radius:
            return self
        return replace(self, manufacturing=replace(self.manufacturing, root_radius=radius))

    @property
    def allowable_stress(self) -> float:
        """Proof stress of the core over safety, Pa."""
        return self.material.proof_stress / self.load.safety

    @property
    def static_root_stress(self) -> float:
        """Local root stress that a few loads leave sound, over safety, Pa."""
        return self.material.endurance(STATIC_CYCLES) / self.load.safety

    @property
    def fatigue_stress(self) -> float:
        """Local root stress that the shifts of the life leave sound, over safety, Pa."""
        return self.endurance(self.load.shifts)

    def endurance(self, cycles: float) -> float:
        """Return the local root stress that ``cycles`` loads both ways leave sound, over safety."""
        load = self.load
        return self.material.endurance(cycles) * load.reversal / load.safety_fatigue


def root_load(dog: Dog, limits: Limits, flank: Flank, torque: float | None = None) -> Load:
    """Return the load of the most loaded dog on a flank; under its static torque by default."""
    level = flank_contact(dog, limits.root_radius, flank).level(limits.load.load_height)
    return Load(limits.load.force_per_dog(dog, flank, torque), flank, level)


def rim_factor(dog: Dog, limits: ManufacturingLimits) -> float:
    """Return the factor by which a thin rim raises the stress of the root, at least 1."""
    if limits.rim is None:
        return 1.0
    thin = largest(1.0, 1.6 * log(2.242 * dog.height / limits.rim))
    return where(limits.rim >= THICK * dog.height, 1.0, thin)


@dataclass(frozen=True)
class Root:
    """Flank and root of a dog under a torque, stresses in Pa.

    ``pressure`` is the mean one under the design torque, ``nominal`` the tension without the
    factors ``notch`` and ``rim``; ``below`` is the share of the notch left below the case.
    """

    pressure: float
    nominal: float
    shear: float
    notch: float
    rim: float
    below: float

    @property
    def tension(self) -> float:
        """Tension in the fillet, Pa."""
        return self.notch * self.nominal * self.rim

    @property
    def core(self) -> float:
        """Tension below the case, Pa."""
        return self.nominal * (1.0 + (self.notch - 1.0) * self.below) * self.rim

    @property
    def equivalent(self) -> float:
        """Equivalent stress of the core, Pa."""
        return hypot(self.core, math.sqrt(3.0) * self.shear)


def root_of(dog: Dog, limits: Limits, flank: Flank, torque: float | None = None) -> Root:
    """Compute what a torque does to a flank and its root; by default its static torque."""
    radius, case = limits.root_radius, limits.load
    contact = flank_contact(dog, radius, flank)
    load = Load(case.force_per_dog(dog, flank, torque), flank, contact.level(case.load_height))
    # The allowable is of flanks that carry for life: misuse, which comes once, is not in it.
    lasting = case.force_per_dog(dog, flank, case.design_torque * case.share_of(flank))
    depth = 1.0 + limits.material.case_depth / radius
    return Root(
        lasting / largest(contact.area, SMALLEST_AREA),
        root_nominal(dog, load),
        1.5 * load.force / (dog.radial_width * dog.root_width),
        notch_factor(dog, radius, flank),
        rim_factor(dog, limits.manufacturing),
        (depth**-2 + 3.0 * depth**-4) / 4.0,
    )


def fatigue(dog: Dog, limits: Limits) -> tuple[float, float]:
    """Return tension in the fillet and what its life leaves sound, Pa, of the worse flank.

    Under a spectrum the tension is that of its largest torque, and the limit is that tension times
    the factor on all torques at which Miner's sum is 1.
    """
    load = limits.load
    if not load.spectrum:
        torques = {flank: load.design_torque * load.share_of(flank) for flank in FLANKS}
        tensions = (root_of(dog, limits, *one).tension for one in torques.items())
        return largest(*tensions), limits.fatigue_stress
    found = []
    endurance = limits.endurance(ENDURANCE_CYCLES)
    for flank, sign in zip(FLANKS, (1.0, -1.0), strict=True):
        loads = [(sign * share, cycles) for share, cycles in load.spectrum if sign * share > 0.0]
        if loads:
            stresses = [
                root_of(dog, limits, flank, s * load.design_torque).tension for s, _ in loads
            ]
            bears = partial(reserve, limits.material, [cycles for _, cycles in loads])
            factor = each(bears, *(stress / endurance for stress in stresses))
            found.append((factor, largest(*stresses)))
    (factor, tension), *others = found
    for second, stress in others:
        worse = (second < factor) | ((second == factor) & (stress < tension))
        factor, tension = where(worse, second, factor), where(worse, stress, tension)
    return tension, factor * tension


def strike_torque(dog: Dog, limits: Limits, strike: Strike, flank: Flank) -> float:
    """Return the torque of a strike on a flank, N m."""
    stiffness = dog.count * limits.load.stiffness(dog) * dog.mean_radius**2
    return each(strike.torque, strike.speed(flank), stiffness)


def strike_force(dog: Dog, limits: Limits, strike: Strike, flank: Flank) -> float:
    """Return the tangential force of a strike on the dog that bears most, N.

    A blow is shared as a landing is: its energy is given, and what stands out takes it first.
    """
    torque = strike_torque(dog, limits, strike, flank)
    equal = torque / (dog.mean_radius * dog.count)
    return equal / sqrt(limits.load.blow(dog, equal))


def strength_checks(dog: Dog, limits: Limits) -> tuple[Check, ...]:
    """Return every check of a design, or of ``Dogs``, that needs no simulation.

    Values and limits are in the unit that each check names, of ``Dogs`` numbers or arrays (n,).
    """
    return tuple(check for group in _GROUPS for check in group(dog, limits))


def keeps_limits(dog: Dog, limits: Limits) -> bool:
    """Decide whether every check passes; cheap ones first, no further than the first failure."""
    return all(feasible(group(dog, limits)) for group in _GROUPS)


def margin_losses(dog: Dog, limits: Limits) -> dict[str, Spread]:
    """Compute the largest loss of each margin within the tolerances, by the check's name.

    Contact ratio and clearance are left out: they have the tolerances in them already.
    """

    def checks(shape: Dog, root_radius: float) -> list[Check]:
        case = limits.with_root_radius(root_radius)
        return [check for group in _GROUPS[:-1] for check in group(shape, case)]

    def margins(shape: Dog, root_radius: float) -> list[float]:
        return [check.margin for check in checks(shape, root_radius)]

    names = [check.name for check in checks(dog, limits.root_radius)]
    spreads = losses(dog, limits.root_radius, limits.tolerances, margins)
    return dict(zip(names, spreads, strict=True))


_RULES = {
    name: Rule(name, "load", meaning, formula, source, "MPa", key, True)
    for name, meaning, formula, source, key in (
        *((f"flank_pressure_{flank}", f"mean pressure on the {flank} flank",
           "F/A, A what touches at full depth", "DIN 5466-1; limit of the material set",
           "material.allowable_pressure_MPa") for flank in FLANKS),
        *((f"root_bending_{flank}", f"tension in the fillet below the loaded {flank} flank",
           "notch factor times nominal root stress, load at the load height",
           "Heywood 1948, fitted to finite elements; limit: static strength, ISO 6336-3",
           "material.bending_endurance_MPa") for flank in FLANKS),
        ("shear_stress", "shear stress of the root", "1.5 F/(b s)",
         "parabola over a rectangle; limit: proof stress of the core over safety and sqrt(3)",
         "material.proof_stress_MPa"),
        ("equivalent_stress", "equivalent stress of the core at the root, the worse flank",
         "sqrt(sigma_c^2 + 3 tau^2), sigma_c the tension below the case",
         "von Mises; limit: proof stress of the core over safety", "material.proof_stress_MPa"),
        ("root_fatigue", "tension in the fillet, the worse flank, over the shifts of the life",
         "as root bending; limit: bending_endurance 2 Y_NT(shifts) reversal/safety_fatigue, or at "
         "the largest torque of load.spectrum what it is when Miner's sum of all classes is 1",
         "ISO 6336-3, ISO 6336-5, ISO 6336-6", "load.shifts"),
    )
}  # fmt: skip

_RULES["rim"] = Rule(
    "rim", "load",
    "thickness of the ring behind the roots; below 1.2 heights it raises the stress of the root",
    "manufacturing.rim_mm against 0.5 h; root stress times Y_B = 1.6 ln(2.242 h/rim)",
    "ISO 6336-3, rim thickness factor, whose range ends there", "mm", "dog.height_mm", False,
)  # fmt: skip


def _load_checks(dog: Dog, limits: Limits) -> tuple[Check, ...]:
    # Thousands of designs are checked, each at every deviation: what they share is found once.
    roots = {flank: root_of(dog, limits, flank) for flank in FLANKS}
    tension = {flank: root.tension for flank, root in roots.items()}
    shear = largest(*(root.shear for root in roots.values()))
    equivalent = largest(*(root.equivalent for root in roots.values()))
    allowable = limits.allowable_stress
    pressure = limits.material.allowable_pressure
    rows = (
        *((f"flank_pressure_{f}", roots[f].pressure, pressure) for f in FLANKS),
        *((f"root_bending_{f}", tension[f], limits.static_root_stress) for f in FLANKS),
        ("shear_stress", shear, allowable / math.sqrt(3.0)),
        ("equivalent_stress", equivalent, allowable),
    )
    made = [Check(_RULES[name], value / MPA, limit / MPA) for name, value, limit in rows]
    lasting, endured = fatigue(dog, limits)
    made.append(Check(_RULES["root_fatigue"], lasting / MPA, endured / MPA))
    rim = limits.manufacturing.rim
    if rim is not None:
        made.append(Check(_RULES["rim"], rim / MM, THINNEST * dog.height / MM))
    return tuple(made)


_STRIKE_SOURCE = "two-mass impact coupled through the shafts (Rao); limit: "
_STRIKE_ROOT = Rule(
    "flank_strike_root", "load", "tension in the fillet when flanks strike, the worse flank",
    "as root bending, F = T/(r N sqrt(K_l)); T = sum |k D q/omega| over the modes of ring, wheel "
    "and shafts, or nu w sqrt(k J) of a second strike",
    f"{_STRIKE_SOURCE}static strength, or less where strike.strikes allow less, ISO 6336-3", "MPa",
    "material.bending_endurance_MPa", True,
)  # fmt: skip
_STRIKE_FLANK = replace(
    _STRIKE_ROOT,
    name="flank_strike_flank",
    meaning="mean pressure on the flank when flanks strike, the worse flank",
    formula="F/A, F as in flank_strike_root",
    source=f"{_STRIKE_SOURCE}yield stress of the case, HV/3, over safety",
    key="material.surface_hardness_HV",
)


def strike_checks(dog: Dog, limits: Limits) -> tuple[Check, ...]:
    """Return the checks of the flank strike, none where the study does not describe it."""
    strike = limits.strike
    if strike is None:
        return ()
    tension = pressure = 0.0
    for flank in strike.flanks:
        force = strike_force(dog, limits, strike, flank)
        contact = flank_contact(dog, limits.root_radius, flank)
        load = Load(force, flank, contact.level(limits.load.load_height))
        rim = rim_factor(dog, limits.manufacturing)
        tension = largest(tension, root_tension(dog, limits.root_radius, load) * rim)
        pressure = largest(pressure, force / largest(contact.area, SMALLEST_AREA))
    root = limits.static_root_stress
    if strike.strikes is not None:
        root = min(root, limits.endurance(strike.strikes))
    bears = limits.material.case_yield / limits.load.safety
    return (
        Check(_STRIKE_ROOT, tension / MPA, root / MPA),
        Check(_STRIKE_FLANK, pressure / MPA, bears / MPA),
    )


#: Checks that only some studies have, and what they want.
UNJUDGED = {
    "pull_out_force": "mechanism.spline_friction, or load.pull_out_force_limit_N",
    "flank_strike_root": "[strike], with ring_inertia_kgm2 and input_stiffness_Nm_rad",
    "flank_strike_flank": "[strike], with ring_inertia_kgm2 and input_stiffness_Nm_rad",
    "rim": "manufacturing.rim_mm",
}

#: Groups of checks, cheap and often failing ones first.
_GROUPS: tuple[Callable[[Dog, Limits], tuple[Check, ...]], ...] = (
    lambda dog, limits: (
        *manufacturing_checks(dog, limits.manufacturing),
        tip_core_check(dog, limits.manufacturing, limits.material.case_depth),
    ),
    lambda dog, limits: locking_checks(dog, limits.load),
    _load_checks,
    strike_checks,
    lambda dog, limits: (
        contact_check(dog, limits.root_radius, limits.tolerances, limits.seated_tolerance),
        clearance_check(dog, limits.tolerances),
    ),
)
