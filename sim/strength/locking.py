r"""Engaging and letting go: friction angles and the axial force of a loaded flank.

- The chamfer slides from rest when :math:`\tan\alpha > \mu_s`.
- A flank lets go under torque when its side angle exceeds the friction angle,
  :math:`\beta > \arctan \mu_s`; below it the flank is self-locking and the shift force
  has to pull the rings apart.
- Axial force of a flank that lets go: :math:`F_{ax} = K_A T/r \cdot \tan(\gamma - \rho)`,
  :math:`\rho = \arctan \mu`, positive pushes the rings apart. The blocking mechanism has to
  hold it at a low coefficient; from a negative one the flank holds itself.

*Spline.* The same torque presses the toothing that the ring sits on, at radius :math:`r_t`, and
its friction :math:`\mu_t T/r_t` opposes any way along the shaft (``sim.shift.mechanism``). So a
flank lets go by itself only where :math:`\tan(\beta - \rho) \ge \mu_t r/r_t`, which is a side
angle of :math:`\rho + \arctan(\mu_t r/r_t)`. Below it takes a pull of

.. math:: F = \mu_t T/r_t - T/r \cdot \tan(\beta - \rho)

at the rated torque *T*, since a shift out is commanded and meets no overload. The blocking
mechanism has :math:`\mu K_A T/r_t` less to hold, with the lower one of the spline's and of the
holding coefficient, and :math:`m a` more where the gearbox shakes ring and fork with the
acceleration *a*: the ring must not jump out. The braking flank has the coast torque. Where the
actuator may pull,
``release_by_itself`` is false and the pull alone is judged.

Release is judged with the static coefficient, holding with a low dynamic one.
Source: Jasny et al. 2019 (rule and figures for the prototype); the spline by equilibrium of the
ring.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

from dogshape.sim.elementwise import arctan, largest, tan
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.units import DEG

_RULES = {
    name: Rule(
        name, "lock", meaning, "angle against arctan of the static coefficient",
        "Jasny et al. 2019, with the static coefficient", "deg", "load.friction_release", False,
    )
    for name, meaning in {
        "chamfer_release": "chamfer, which slides from rest above the friction angle",
        **{
            f"{flank}_release": f"{flank} flank, which is self-locking below the friction angle"
            for flank in FLANKS
        },
    }.items()
} | {
    f"separating_force_{flank}": Rule(
        f"separating_force_{flank}", "lock",
        f"axial force that the {flank} flank puts on the blocking mechanism",
        "K_A T/r tan(side angle - rho), rho = arctan of the low dynamic coefficient",
        "Jasny et al. 2019; limit: the prototype's own force and 15 % (assumption)",
        "N", "load.separating_force_limit_N", True,
    )
    for flank in FLANKS
}  # fmt: skip
PULL_OUT_RULE = Rule(
    "pull_out_force", "lock",
    "axial force that pulls the ring out under the rated torque, the worse flank; below 0 it comes "
    "by itself",
    "mu_t T/r_t - T/r tan(side angle - rho), mu_t and r_t of the spline, rho static",
    "equilibrium of the ring; limit: load.pull_out_force_limit_N, or else the largest shift force "
    "of the operating points", "N", "load.pull_out_force_limit_N", True,
)  # fmt: skip


def axial_force(dog: Dog, torque: float, angle: float, friction: float) -> float:
    """Return the axial force of a flank under ``torque`` (N m), N; positive separates."""
    return torque / dog.mean_radius * tan(angle - arctan(friction))


def release_angle(dog: Dog, load: LoadCase) -> float:
    """Return the least side angle of a flank that lets go by itself, rad."""
    spline = load.spline_friction * dog.mean_radius / load.spline_radius
    return arctan(load.friction_release) + arctan(spline)


def pull_out_force(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Return the axial force that pulls the ring out under torque, N; below 0 it lets go."""
    torque = load.torque * load.share_of(flank)
    push = axial_force(dog, torque, side_angle(dog, flank), load.friction_release)
    return load.spline_friction * torque / load.spline_radius - push


def separating_force(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Return the axial force of a loaded flank at low friction, N; positive separates.

    What friction in the spline holds of it is taken off, and the ring's inertia is added.
    """
    torque = load.design_torque * load.share_of(flank)
    held = min(load.spline_friction, load.friction_hold) * torque / load.spline_radius
    pushed = axial_force(dog, torque, side_angle(dog, flank), load.friction_hold)
    return pushed - held + load.vibration_force


def blocking_force(dog: Dog, load: LoadCase) -> float:
    """Compute the force on the blocking mechanism, N; 0 where both flanks hold themselves."""
    return max(0.0, *(separating_force(dog, load, flank) for flank in FLANKS))


def locking_checks(dog: Dog, load: LoadCase) -> tuple[Check, ...]:
    """Return the checks of release and holding, and of pulling out where that has a limit."""
    slides, lets_go = math.atan(load.friction_release), release_angle(dog, load)
    angles = [("chamfer_release", dog.chamfer, slides)]
    if load.release_by_itself:
        angles += [
            ("traction_release", dog.traction, lets_go),
            ("braking_release", dog.braking, lets_go),
        ]
    checks = (
        *(Check(_rule(name, load), angle / DEG, least / DEG) for name, angle, least in angles),
        *(
            Check(
                _rule(f"separating_force_{flank}", load),
                separating_force(dog, load, flank),
                load.separating_force_limit,
            )
            for flank in FLANKS
        ),
    )
    if load.pull_out_force_limit is None:
        return checks
    pull = largest(*(pull_out_force(dog, load, flank) for flank in FLANKS))
    return (*checks, Check(PULL_OUT_RULE, pull, load.pull_out_force_limit))


def _rule(name: str, load: LoadCase) -> Rule:
    """Return a rule, its formula with spline and coast where the load case has them."""
    spline, vibration = load.spline_friction > 0.0, load.vibration_force > 0.0
    return _written(name, spline, load.coast_share != 1.0, vibration)


@lru_cache
def _written(name: str, spline: bool, coast: bool, vibration: bool) -> Rule:
    rule = _RULES[name]
    if spline and name in ("traction_release", "braking_release"):
        with_spline = "angle against arctan of the static coefficient + arctan(mu_t r/r_t), spline"
        return replace(rule, formula=with_spline)
    if name.startswith("separating"):
        formula = rule.formula
        if spline:
            formula += ", less min(mu_t, mu) K_A T/r_t that the spline holds"
        if coast and name.endswith("braking"):
            formula += "; T times load.coast_share"
        if vibration:
            formula += "; + m a, a the axial vibration"
        return replace(rule, formula=formula)
    return rule


def locking_friction(dog: Dog, load: LoadCase) -> tuple[float, str]:
    """Return the static friction above which a surface locks first, and that surface's check.

    A flank locks where its release angle reaches its side angle, the chamfer where it no longer
    slides from rest. Flanks do not count where the actuator may pull them out.
    """
    spline = math.atan(load.spline_friction * dog.mean_radius / load.spline_radius)
    found = {"chamfer_release": dog.chamfer}
    if load.release_by_itself:
        found |= {f"{flank}_release": side_angle(dog, flank) - spline for flank in FLANKS}
    name = min(found, key=lambda one: found[one])
    return math.tan(max(0.0, found[name])), name
