r"""Engaging and letting go: friction angles and the axial force of a loaded flank.

- The chamfer slides from rest when :math:`\tan\alpha > \mu_s`.
- A flank lets go under torque when its side angle exceeds the friction angle,
  :math:`\beta > \arctan \mu_s`; below it the flank is self-locking and the shift force
  has to pull the rings apart.
- Axial force of a flank that lets go: :math:`F_{ax} = K_A T/r \cdot \tan(\gamma - \rho)`,
  :math:`\rho = \arctan \mu`, positive pushes the rings apart. The blocking mechanism has to
  hold it at a low coefficient; from a negative one the flank holds itself.

Release is judged with the static coefficient, holding with a low dynamic one.
Source: Jasny et al. 2019 (rule and figures for the prototype).
"""

from __future__ import annotations

import math

from dogshape.sim.shift.flank import FLANKS, Flank, side_angle
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import DEG

_SOURCE = "Jasny et al. 2019, with the static coefficient"

_RELEASE = {
    "chamfer_release": "chamfer, which slides from rest above the friction angle",
    "traction_release": "traction flank, which is self-locking below the friction angle",
    "braking_release": "braking flank, which is self-locking below the friction angle",
}
_RULES = {
    name: Rule(
        name,
        "lock",
        meaning,
        "angle against arctan of the static coefficient",
        _SOURCE,
        "deg",
        "load.friction_release",
        False,
    )
    for name, meaning in _RELEASE.items()
} | {
    f"separating_force_{flank}": Rule(
        f"separating_force_{flank}",
        "lock",
        f"axial force that the {flank} flank puts on the blocking mechanism",
        "K_A T/r tan(side angle - rho), rho = arctan of the low dynamic coefficient",
        "Jasny et al. 2019; limit: the prototype's own force and 15 % (assumption)",
        "N",
        "load.separating_force_limit_N",
        True,
    )
    for flank in FLANKS
}


def axial_force(dog: Dog, torque: float, angle: float, friction: float) -> float:
    """Return the axial force of a flank under ``torque`` (N m), N; positive separates."""
    return torque / dog.mean_radius * math.tan(angle - math.atan(friction))


def separating_force(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Return the axial force of a loaded flank at low friction, N; positive separates."""
    return axial_force(dog, load.design_torque, side_angle(dog, flank), load.friction_hold)


def blocking_force(dog: Dog, load: LoadCase) -> float:
    """Compute the force on the blocking mechanism, N; 0 where both flanks hold themselves."""
    return max(0.0, *(separating_force(dog, load, flank) for flank in FLANKS))


def locking_checks(dog: Dog, load: LoadCase) -> tuple[Check, ...]:
    """Return the checks of release and holding."""
    locking = math.atan(load.friction_release) / DEG
    angles = (dog.chamfer, dog.traction, dog.braking)
    return (
        *(
            Check(_RULES[name], angle / DEG, locking)
            for name, angle in zip(_RELEASE, angles, strict=True)
        ),
        *(
            Check(
                _RULES[f"separating_force_{flank}"],
                separating_force(dog, load, flank),
                load.separating_force_limit,
            )
            for flank in FLANKS
        ),
    )
