r"""Engagement and release: friction angles and the axial force of a loaded flank.

- A face slides from rest when :math:`\tan\alpha > \mu_s`; of a roof both faces.
- A flank releases under torque when :math:`\beta \ge \rho + \arctan(\mu_t r/r_t)`, :math:`\rho =
  \arctan \mu_s`, with the friction :math:`\mu_t` of the spline at radius :math:`r_t`; below it
  takes the pull :math:`F = \mu_t T/r_t - T/r \tan(\beta - \rho)` at the share of the rated torque
  that is left as the ring is pulled out. Friction is at the upper end of its interval.
- *Retention*: friction that holds still gives way under vibration, so latch, detent or fork hold
  :math:`K_A T/r \tan\beta_w + m a`, with the axial vibration *a* of the gearbox; as the torque
  reverses :math:`m a` alone. A flank that holds itself is undercut after its wear: :math:`\beta_w =
  \max(\beta, \min(\beta, 0) + w)`, *w* the lean that wear gives a straight flank; one that leans
  more keeps its angle. With the lowest friction the force is :math:`K_A T/r \tan(\beta_w - \rho) -
  \mu_t K_A T/r_t + m a`: where that alone is not positive the flank holds by friction.

The braking flank has the coast torque. Source: Jasny et al. 2019; the spline by equilibrium. Field
reports of workshops: straight dogs worn to +1 degree jump out, undercut of 1.5 to 5 degrees holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dogshape.sim.elementwise import arctan, largest, smallest, tan, where
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.strength.checks import LimitCheck, checks_of
from dogshape.sim.strength.load_case import LoadCase


def axial_force(dog: Dog, torque: float, angle: float, friction: float) -> float:
    """Compute the axial force of a flank under ``torque`` (N m), N; positive separates."""
    return torque / dog.mean_radius * tan(angle - arctan(friction))


def release_angle(dog: Dog, load: LoadCase) -> float:
    """Compute the smallest side angle of a flank that releases by itself, rad."""
    spline = load.release_friction * dog.mean_radius / load.spline_radius
    return arctan(load.friction_release) + arctan(spline)


def pull_out_force(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Compute the axial force that pulls the ring out under torque, N; negative if it releases."""
    torque = load.torque * load.share_of(flank) * load.pull_out_share
    push = axial_force(dog, torque, side_angle(dog, flank), load.friction_release)
    return load.release_friction * torque / load.spline_radius - push


def worn_angle(dog: Dog, load: LoadCase, flank: Flank) -> float:
    """Compute the side angle of a flank at the end of its life, rad."""
    angle = side_angle(dog, flank)
    return largest(angle, smallest(angle, 0.0) + load.wear_angle)


def separating_force(dog: Dog, load: LoadCase, flank: Flank, friction: float = 0.0) -> float:
    """Compute the axial force of a worn, loaded flank and vibration, N; positive separates.

    ``friction`` is that of the flank; the toothing is frictionless.
    """
    torque = load.design_torque * load.share_of(flank)
    return axial_force(dog, torque, worn_angle(dog, load, flank), friction) + load.vibration_force


@dataclass(frozen=True)
class Retention:
    """Axial forces on a loaded, worn flank, N, positive if they separate."""

    flank: Flank
    frictionless: float  #: without any friction, as under vibration
    flank_friction: float  #: with the lowest friction of the flank and a frictionless toothing
    all_friction: float  #: with the lowest friction of flank and toothing
    held: float | None  #: holding force of latch, detent or fork; None if unknown

    @property
    def answer(self) -> str:
        """Mechanism that holds the ring, "not judged", or that nothing does, in words."""
        if self.frictionless <= 0.0:
            return "undercut"
        if self.held is not None and self.frictionless <= self.held:
            return "blocking mechanism"
        if self.all_friction <= (self.held or 0.0):
            return "friction alone"
        return "blocking mechanism, not judged" if self.held is None else "nothing: it jumps out"


def retention(dog: Dog, load: LoadCase, flank: Flank) -> Retention:
    """Compute the separating forces under torque on a flank, and the force that holds the ring."""
    torque = load.design_torque * load.share_of(flank)
    force = separating_force(dog, load, flank, friction=load.friction_hold)
    spline_force = load.spline_interval[0] * torque / load.spline_radius
    return Retention(
        flank,
        frictionless=separating_force(dog, load, flank),
        flank_friction=force,
        all_friction=force - spline_force,
        held=load.separating_force_limit,
    )


def retention_force(dog: Dog, load: LoadCase) -> float:
    """Compute the axial force that pulls in the weaker worn flank, N, less the vibration force.

    Without friction; negative if the flank pushes out.
    """
    return -largest(*(separating_force(dog, load, flank) for flank in FLANKS))


def blocking_force(dog: Dog, load: LoadCase) -> float:
    """Compute the force on the blocking mechanism, N; 0 if both flanks hold themselves."""
    return largest(0.0, -retention_force(dog, load))


def face_angle(dog: Dog) -> float:
    """Return the angle of the flatter face of the tip, rad."""
    roof_angle = smallest(dog.chamfer, dog.chamfer_back)
    angle = where(dog.crest == 0.0, dog.chamfer_back, roof_angle)
    return where(dog.crest == 1.0, dog.chamfer, angle)


def locking_checks(dog: Dog, load: LoadCase) -> tuple[LimitCheck, ...]:
    """Return the checks of release, and of retention and pull-out if they have a limit."""
    rows = []
    if load.faces_release:
        rows.append(("chamfer_release", face_angle(dog), math.atan(load.face_release_friction)))
    if load.release_by_itself:
        limit = release_angle(dog, load)
        rows += [(f"{flank}_release", side_angle(dog, flank), limit) for flank in FLANKS]
    if load.separating_force_limit is not None:
        limit = load.separating_force_limit
        rows += [
            (f"retention_{flank}", separating_force(dog, load, flank), limit) for flank in FLANKS
        ]
        if load.vibration_force > 0.0:
            rows.append(("retention_reversal", load.vibration_force, limit))
    if load.pull_out_force_limit is not None:
        pull = largest(*(pull_out_force(dog, load, flank) for flank in FLANKS))
        rows.append(("pull_out_force", pull, load.pull_out_force_limit))
    return checks_of(rows)


def locking_friction(dog: Dog, load: LoadCase) -> tuple[float, str]:
    """Compute the smallest static friction at which a surface locks, and name its check.

    A flank locks if its release angle reaches its side angle, a face if it no longer slides from
    rest. Surfaces that need not release by the load case do not count, nor faces with a friction of
    their own. Infinite, with an empty name, if no surface counts.
    """
    frictions: dict[str, float] = {}
    if load.faces_release and load.face_friction is None:
        frictions["chamfer_release"] = math.tan(face_angle(dog))
    if load.release_by_itself:
        for flank in FLANKS:
            friction = _flank_locking_friction(dog, load, side_angle(dog, flank))
            frictions[f"{flank}_release"] = friction
    if not frictions:
        return math.inf, ""
    name = min(frictions, key=lambda check: frictions[check])
    return max(0.0, frictions[name]), name


def _flank_locking_friction(dog: Dog, load: LoadCase, angle: float) -> float:
    r"""Compute the friction at which a flank with a side ``angle`` in rad locks.

    If the toothing has the friction of the flank above its nominal one: :math:`\arctan\mu +
    \arctan(\mu k) = \beta`, :math:`k = r/r_t`, a quadratic equation.
    """
    lever = dog.mean_radius / load.spline_radius
    fixed_friction = load.spline_friction_release
    spline_friction = load.spline_friction if fixed_friction is None else fixed_friction
    friction = math.tan(angle - math.atan(spline_friction * lever))
    if fixed_friction is not None or spline_friction == 0.0 or friction <= spline_friction:
        return friction
    slope = lever * math.tan(angle)
    return (math.sqrt((1.0 + lever) ** 2 + 4.0 * slope * math.tan(angle)) - 1.0 - lever) / (
        2.0 * slope
    )
