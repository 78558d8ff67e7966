r"""Engaging and letting go: friction angles and the axial force of a loaded flank.

- A face slides from rest when :math:`\tan\alpha > \mu_s`; of a roof both faces.
- A flank lets go under torque when :math:`\beta \ge \rho + \arctan(\mu_t r/r_t)`, :math:`\rho =
  \arctan \mu_s`, with the friction :math:`\mu_t` of the spline at radius :math:`r_t`; below it
  takes the pull :math:`F = \mu_t T/r_t - T/r \tan(\beta - \rho)` at the share of the rated torque
  that is left as the ring is pulled out. An undercut flank, :math:`\beta < 0`, holds itself.
- The blocking mechanism holds :math:`K_A T/r \tan(\gamma - \rho) - \mu K_A T/r_t + m a`, with the
  low dynamic coefficient, the lower one of spline and flank, and the axial vibration *a* of the
  gearbox.

The braking flank has the coast torque. Source: Jasny et al. 2019; the spline by equilibrium.
"""

from __future__ import annotations

import math

from dogshape.sim.elementwise import arctan, largest, smallest, tan, where
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.strength.checks import Check, checks_of
from dogshape.sim.strength.load_case import LoadCase


def axial_force(dog: Dog, torque: float, angle: float, friction: float) -> float:
    """Return the axial force of a flank under ``torque`` (N m), N; positive separates."""
    return torque / dog.mean_radius * tan(angle - arctan(friction))


def release_angle(dog: Dog, load: LoadCase) -> float:
    """Return the least side angle of a flank that lets go by itself, rad."""
    spline = load.spline_friction * dog.mean_radius / load.spline_radius
    return arctan(load.friction_release) + arctan(spline)


def pull_out_force(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Return the axial force that pulls the ring out under torque, N; below 0 it lets go."""
    torque = load.torque * load.share_of(flank) * load.pull_out_share
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


def face_angle(dog: Dog) -> float:
    """Return the fall of the flatter face of the tip, rad."""
    back, face = dog.chamfer_back, dog.chamfer
    return where(dog.crest == 1.0, face, where(dog.crest == 0.0, back, smallest(face, back)))


def locking_checks(dog: Dog, load: LoadCase) -> tuple[Check, ...]:
    """Return the checks of release, and of holding and pulling out where these have a limit."""
    rows = []
    if load.faces_release:
        rows.append(("chamfer_release", face_angle(dog), math.atan(load.friction_release)))
    if load.release_by_itself:
        least = release_angle(dog, load)
        rows += [(f"{flank}_release", side_angle(dog, flank), least) for flank in FLANKS]
    if (held := load.separating_force_limit) is not None:
        forces = ((flank, separating_force(dog, load, flank)) for flank in FLANKS)
        rows += [(f"separating_force_{flank}", force, held) for flank, force in forces]
    if load.pull_out_force_limit is not None:
        pull = largest(*(pull_out_force(dog, load, flank) for flank in FLANKS))
        rows.append(("pull_out_force", pull, load.pull_out_force_limit))
    return checks_of(rows)


def locking_friction(dog: Dog, load: LoadCase) -> tuple[float, str]:
    """Return the static friction above which a surface locks first, and that surface's check.

    A flank locks where its release angle reaches its side angle, a face where it no longer slides
    from rest. Those do not count that the load case lets hold.
    """
    spline = math.atan(load.spline_friction * dog.mean_radius / load.spline_radius)
    found = {"chamfer_release": face_angle(dog)} if load.faces_release else {}
    if load.release_by_itself:
        found |= {f"{flank}_release": side_angle(dog, flank) - spline for flank in FLANKS}
    if not found:
        return math.inf, ""
    name = min(found, key=lambda one: found[one])
    return math.tan(max(0.0, found[name])), name
