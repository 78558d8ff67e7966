r"""Strength of the teeth of a sleeve, which are rooted radially along the engaged length.

The sleeve has internal teeth, the ring that it couples external ones. The diameters of the dogs
bound the radial height *w* of contact about the pitch circle, radius *r*; *L* is the length that
touches at full depth, *F* the force on the most loaded tooth (``sim.strength.load_case``), with the
load sharing of pitch errors. Tooth thickness :math:`s(r) = \tfrac12 (\vartheta - \varphi) r`, pitch
:math:`\vartheta` and backlash :math:`\varphi` as angles.

- pressure :math:`F/(w L)`: the flank pressure of all dogs, DIN 5466-1; its factors of length and
  pitch errors, :math:`k_l k_{\varphi\beta}`, are one over the load sharing
- shear at the pitch circle :math:`\tau = F/(L s(r))` (Dudley 1957)
- bending of a cantilever from its root circle, lever :math:`l = h_t - w/2`, tooth height
  :math:`h_t`: :math:`\sigma_n = 6 F l/(L s_R^2)`, :math:`s_R = s(r - l) + 2 l \tan\varphi_p` of the
  external tooth, whose root is the narrower one; :math:`\varphi_p` the pressure angle
- tension in the fillet :math:`Y_S \sigma_n`, :math:`Y_S = (1.2 + 0.13\,s_R/l)\,
  q^{1/(1.21 + 2.3\,l/s_R)}`, :math:`q = s_R/(2 \varrho) \ge 1` (ISO 6336-3, to *q* = 8;
  extrapolated beyond)
- hoop stress of the sleeve, rim *t* outside the root circle :math:`r_i = r + l`, :math:`r_o = r_i +
  t`: :math:`\frac{T}{r}\frac{\tan\varphi_p}{2\pi t L} + \frac{\varrho_m \omega^2}{4} [(3 + \nu)
  r_o^2 + (1 - \nu) r_i^2]`, thin rim under the radial force of the flanks and rotating annulus
  (Dudley 1957; Timoshenko)
- back-taper against jumping out is an undercut: retention of ``sim.strength.locking``

Dudley, *When splines need stress control*, Product Engineering 28 (1957), in Machinery's Handbook.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.sim.elementwise import largest
from dogshape.sim.errors import InputError, Refusal
from dogshape.sim.quantity import quantity, require_ranges
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.materials import DENSITY, POISSON
from dogshape.sim.units import DEG, MM, RPM


@dataclass(frozen=True)
class Sleeve:
    """Teeth of a sleeve: keys of ``[sleeve]``, SI.

    ``tooth_height`` is radial, from root to tip circle; None is the radial height of contact.
    ``speed`` loads the rim in rad/s.
    """

    tooth_height: float | None = quantity("tooth_height_mm", 0.1, 100.0, None)
    pressure_angle: float = quantity("pressure_angle_deg", 0.0, 45.0, 30.0 * DEG)
    speed: float = quantity("speed_rpm", 0.0, 1e5, 0.0)

    def __post_init__(self) -> None:
        require_ranges(self, "sleeve", "correct the sleeve")

    def require_height(self, dog: Dog) -> None:
        """Raise InputError if the teeth of a dog are lower than their contact."""
        if self.tooth_height is None or self.tooth_height >= dog.radial_width:
            return
        width = dog.radial_width / MM
        rule = f"the teeth touch over (outer - inner diameter)/2 = {width:.6g} mm of it"
        remedy = "raise it, or leave it out for teeth of that height"
        sentence = Refusal(
            "sleeve.tooth_height_mm", self.tooth_height / MM, "mm", rule=rule, remedy=remedy
        )
        raise InputError(sentence)

    def text(self, dog: Dog) -> str:
        """Describe the teeth in words."""
        height = (self.lever(dog) + 0.5 * dog.radial_width) / MM
        words = f"sleeve, teeth {height:.4g} mm high, pressure angle {self.pressure_angle / DEG:g}°"
        return f"{words}, {self.speed / RPM:g} 1/min" if self.speed > 0.0 else words

    def lever(self, dog: Dog) -> float:
        """Compute the distance from root to pitch circle, m."""
        height = dog.radial_width if self.tooth_height is None else self.tooth_height
        return height - 0.5 * dog.radial_width


def tooth_thickness(dog: Dog, radius: float) -> float:
    """Compute the thickness of a tooth with radial flanks at half its length, m."""
    return 0.5 * (dog.pitch_angle - dog.backlash_angle) * radius


def root_thickness(dog: Dog, sleeve: Sleeve) -> float:
    """Compute the thickness of an external tooth at its root circle, m."""
    lever = sleeve.lever(dog)
    root_radius = dog.mean_radius - lever
    return tooth_thickness(dog, root_radius) + 2.0 * lever * math.tan(sleeve.pressure_angle)


def fillet_room(dog: Dog, sleeve: Sleeve) -> float:
    """Compute the largest root radius that fits between two external teeth, m; at least 0."""
    pitch = dog.pitch_angle * (dog.mean_radius - sleeve.lever(dog))
    floor = pitch - root_thickness(dog, sleeve)
    half_corner = math.tan(0.25 * math.pi - 0.5 * sleeve.pressure_angle)
    return largest(0.0, floor / (2.0 * half_corner))


def bending(dog: Dog, sleeve: Sleeve, force: float, length: float) -> float:
    """Compute the nominal bending stress of a tooth at its root circle, Pa.

    ``force`` on the tooth in N, engaged ``length`` in m, as below.
    """
    return 6.0 * force * sleeve.lever(dog) / (length * root_thickness(dog, sleeve) ** 2)


def stress_correction(dog: Dog, sleeve: Sleeve, fillet: float) -> float:
    """Compute the stress correction factor Y_S of a ``fillet`` radius in m (ISO 6336-3)."""
    slenderness = sleeve.lever(dog) / root_thickness(dog, sleeve)
    notch = largest(1.0, root_thickness(dog, sleeve) / (2.0 * fillet))
    return (1.2 + 0.13 / slenderness) * notch ** (1.0 / (1.21 + 2.3 * slenderness))


def root_shear(dog: Dog, sleeve: Sleeve, force: float, length: float) -> float:
    """Compute the mean shear stress at the root circle, Pa."""
    return force / (length * root_thickness(dog, sleeve))


def pitch_shear(dog: Dog, force: float, length: float) -> float:
    """Compute the mean shear stress at the pitch circle, Pa."""
    return force / (length * tooth_thickness(dog, dog.mean_radius))


def hoop_stress(dog: Dog, sleeve: Sleeve, rim: float, torque: float, length: float) -> float:
    """Compute the hoop stress of a sleeve with a ``rim`` in m under a ``torque`` in N m, Pa."""
    radial_force = torque / dog.mean_radius * math.tan(sleeve.pressure_angle)
    inner = dog.mean_radius + sleeve.lever(dog)
    radii = (3.0 + POISSON) * (inner + rim) ** 2 + (1.0 - POISSON) * inner**2
    return radial_force / (2.0 * math.pi * rim * length) + 0.25 * DENSITY * sleeve.speed**2 * radii


def require_face(sleeve: Sleeve | None) -> None:
    """Raise InputError for solids of a sleeve, which has no dogs on a face."""
    if sleeve is not None:
        raise InputError(
            "STL and STEP have dogs on a face, and dog.mount is 'sleeve'; write drawing and data "
            "sheet, or set dog.mount = 'face' for a ring with the ends of these teeth"
        )
