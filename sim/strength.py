r"""Strength and self-locking of a dog, by closed forms.

Load of one dog with load sharing :math:`K_s` (share of the dogs that carry) and
application factor :math:`K_A`: :math:`F = K_A T / (r N K_s)`.

- flank pressure :math:`p = F/(b h_c)`; :math:`h_c` is height less chamfer drop. Traction
  flanks touch over the full height, both crests being on that side, so this
  is on the safe side there. Two braking flanks overlap by the height less twice the drop of
  the face at its edge, because either ring lacks it at its own crest.
- shear :math:`\tau = 1.5 F/(b s)`, :math:`s` the width at the root
- root bending with the load at the tip :math:`\sigma_b = 6 F h/(b s^2)`, equivalent
  :math:`\sqrt{(K_t \sigma_b)^2 + 3 \tau^2}`
- axial force of a loaded flank :math:`F_{ax} = K_A T/r \cdot \tan(\gamma - \rho)`,
  :math:`\rho = \arctan \mu`; positive pushes the rings apart. Release is judged with
  the static coefficient, holding with a low dynamic one.
- the chamfer slides from rest when :math:`\tan\alpha > \mu_s`.

Sources: Jasný et al. 2019 (self-locking); DIN 5466-1 (pressure form, load
sharing); ISO 6336-5 and EN 10084 (16MnCr5); Naunheimer et al. 2011 (application
factor). The MQ200 is rated at 200 N m and its dog ring turns at input speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sim.checks import Check
from sim.errors import require_between
from sim.geometry import Dog
from sim.manufacture import ManufacturingLimits, manufacturing_checks
from sim.units import DEG, MPA


@dataclass(frozen=True)
class LoadCase:
    """Torque (N m) with its factors, friction for release and hold, axial limit (N)."""

    torque: float = 200.0
    application_factor: float = 1.5
    load_sharing: float = 0.5
    friction_release: float = 0.12
    friction_hold: float = 0.05
    separating_force_limit: float = 5000.0

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("torque_Nm", self.torque, 1e-3, 1e5),
            ("application_factor", self.application_factor, 0.5, 10.0),
            ("load_sharing", self.load_sharing, 0.01, 1.0),
            ("friction_release", self.friction_release, 0.0, 1.0),
            ("friction_hold", self.friction_hold, 0.0, 1.0),
            ("separating_force_limit_N", self.separating_force_limit, 1.0, 1e6),
        ):
            require_between(f"load.{name}", value, low, high, "correct the load case")

    @property
    def design_torque(self) -> float:
        """Torque times application factor, N m."""
        return self.torque * self.application_factor

    def force_per_dog(self, dog: Dog) -> float:
        """Tangential force on the dog that carries most, N."""
        return self.design_torque / (dog.mean_radius * dog.count * self.load_sharing)


@dataclass(frozen=True)
class Material:
    """Strength of the dog's material, Pa; ``notch_factor`` of the root without unit.

    Default 16MnCr5, case-hardened, small section: proof stress of the core at
    least 735 MPa; allowable pressure of hard flanks that do not slide under load.
    """

    name: str = "16MnCr5 case-hardened"
    proof_stress: float = 735.0 * MPA
    allowable_pressure: float = 200.0 * MPA
    safety: float = 1.2
    notch_factor: float = 2.0

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("proof_stress_MPa", self.proof_stress / MPA, 10.0, 5000.0),
            ("allowable_pressure_MPa", self.allowable_pressure / MPA, 1.0, 5000.0),
            ("safety", self.safety, 0.5, 10.0),
            ("notch_factor", self.notch_factor, 1.0, 10.0),
        ):
            require_between(f"material.{name}", value, low, high, "correct the material")

    @property
    def allowable_stress(self) -> float:
        """Proof stress over safety, Pa."""
        return self.proof_stress / self.safety


@dataclass(frozen=True)
class Limits:
    """Everything that a design is checked against."""

    load: LoadCase = field(default_factory=LoadCase)
    material: Material = field(default_factory=Material)
    manufacturing: ManufacturingLimits = field(default_factory=ManufacturingLimits)


def flank_pressure(dog: Dog, load: LoadCase, height: float) -> float:
    """Return the mean pressure on a flank of which ``height`` (m) touches, Pa."""
    return load.force_per_dog(dog) / (dog.radial_width * height)


def shear_stress(dog: Dog, load: LoadCase) -> float:
    """Return the largest shear stress of the root, parabola over a rectangle, Pa."""
    return 1.5 * load.force_per_dog(dog) / (dog.radial_width * dog.root_width)


def bending_stress(dog: Dog, load: LoadCase) -> float:
    """Return the nominal bending stress of the root with the load at the tip, Pa."""
    lever = dog.height
    return 6.0 * load.force_per_dog(dog) * lever / (dog.radial_width * dog.root_width**2)


def root_stress(dog: Dog, load: LoadCase, material: Material) -> float:
    """Return the equivalent root stress with the notch factor on bending, Pa."""
    bending = material.notch_factor * bending_stress(dog, load)
    return math.hypot(bending, math.sqrt(3.0) * shear_stress(dog, load))


def axial_force(dog: Dog, torque: float, angle: float, friction: float) -> float:
    """Return the axial force of a flank under ``torque`` (N m), N; positive separates."""
    return torque / dog.mean_radius * math.tan(angle - math.atan(friction))


def strength_checks(dog: Dog, limits: Limits) -> tuple[Check, ...]:
    """Return every check of a design: make, load, lock and release.

    Values and limits are in the unit that each check names.
    """
    return (
        *manufacturing_checks(dog, limits.manufacturing),
        *_stress_checks(dog, limits.load, limits.material),
        *_locking_checks(dog, limits.load),
    )


def _stress_checks(dog: Dog, load: LoadCase, material: Material) -> tuple[Check, ...]:
    shear_limit = material.allowable_stress / math.sqrt(3.0)
    rows = (
        (
            "flank_pressure",
            flank_pressure(dog, load, dog.working_height),
            material.allowable_pressure,
            "F/(b h_c), h_c = height less chamfer drop (DIN 5466-1)",
        ),
        (
            "flank_pressure_braking",
            flank_pressure(dog, load, dog.braking_overlap),
            material.allowable_pressure,
            "F/(b h_o), h_o = overlap of two braking flanks at full depth",
        ),
        (
            "root_stress",
            root_stress(dog, load, material),
            material.allowable_stress,
            "sqrt((K_t 6 F h/(b s2))2 + 3 tau2) against proof stress over safety",
        ),
        (
            "shear_stress",
            shear_stress(dog, load),
            shear_limit,
            "1.5 F/(b s) against proof stress over safety and sqrt(3)",
        ),
    )
    return tuple(
        Check(name, value / MPA, limit / MPA, "MPa", True, rule)
        for name, value, limit, rule in rows
    )


def _locking_checks(dog: Dog, load: LoadCase) -> tuple[Check, ...]:
    locking = math.atan(load.friction_release) / DEG
    released = (
        ("chamfer_release", dog.chamfer, "chamfer above the friction angle: the face slides"),
        ("self_locking_traction", dog.traction, "traction flank above the friction angle"),
        ("self_locking_braking", dog.braking, "braking flank above the friction angle"),
    )
    held = (
        ("separating_force_traction", dog.traction, "T/r tan(traction - rho) with low friction"),
        ("separating_force_braking", dog.braking, "T/r tan(braking - rho) with low friction"),
    )
    torque = load.design_torque
    return (
        *(Check(name, angle / DEG, locking, "deg", False, rule) for name, angle, rule in released),
        *(
            Check(
                name,
                axial_force(dog, torque, angle, load.friction_hold),
                load.separating_force_limit,
                "N",
                True,
                rule,
            )
            for name, angle, rule in held
        ),
    )
