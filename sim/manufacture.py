"""What can be made: limits on the shape, before anything is loaded or simulated.

A search left to itself runs to dogs that the chamfer has eaten and calls free
flight a shift. These rules are checked first and cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.checks import Check
from sim.errors import GeometryError
from sim.geometry import Dog


@dataclass(frozen=True)
class ManufacturingLimits:
    """Smallest dimensions, m.

    ``tip_width`` keeps a case-hardened tip from hardening through (case depth of
    about 0.4 mm from either side leaves a core); ``slot_width`` lets a cutter
    reach the floor of the slot, which is as wide as a tip; ``flank_height`` is that
    of the braking flank.
    """

    tip_width: float = 1.5e-3
    slot_width: float = 1.5e-3
    flank_height: float = 1.5e-3


def manufacturing_checks(dog: Dog, limits: ManufacturingLimits) -> tuple[Check, ...]:
    """Return the manufacturability checks of a dog, lengths in mm."""
    narrow = dog.tip_width_at(dog.inner_radius)
    slot = dog.pitch_angle * dog.inner_radius - dog.root_width_at(dog.inner_radius)
    rows = (
        ("tip_width", narrow, limits.tip_width, "width of the tip at the inner radius"),
        ("slot_width", slot, limits.slot_width, "width of the slot's floor at the inner radius"),
        (
            "flank_height",
            dog.braking_flank_height,
            limits.flank_height,
            "height of the braking flank: height less the drop of the face at its edge",
        ),
    )
    return tuple(
        Check(name, value * 1e3, limit * 1e3, "mm", False, rule)
        for name, value, limit, rule in rows
    )


def require_makeable(dog: Dog, limits: ManufacturingLimits) -> None:
    """Raise GeometryError with the first rule that the dog breaks."""
    for check in manufacturing_checks(dog, limits):
        if not check.passed:
            raise GeometryError(
                f"{check.rule} is {check.value:.4g} {check.unit}, but it must be at least "
                f"{check.limit:.4g} {check.unit} to be made; use fewer or lower dogs, a smaller "
                f"chamfer or side angle, or lower the limit manufacturing.{check.name}_mm."
            )
