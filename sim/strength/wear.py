r"""Wear of the faces over the life, and the shape of a worn dog.

Archard (1953): a sliding contact loses :math:`k F s`. A shift rubs with :math:`F s \le E/\mu`, *E*
what the contact takes (an upper bound). Over *n* shifts a dog of *N*, *b* wide, loses per width
:math:`V' = k n E/(2 \mu N b)`. Overlaps are even, so the loss falls linearly from :math:`\Delta` at
the crest to none at the braking edge: :math:`V' = \Delta f/2` on a face of width *f*. Then gap
:math:`g + 2\Delta`, height :math:`h - 2\Delta`, depth of the face :math:`d - \Delta`; without a
chamfer the whole face sinks. A roof wears to both edges. Each landing takes the same from an edge's
section, so the square of its radius grows evenly. Rates *k*: 1e-7 to 1e-5 mm3/(N m) (Rabinowicz
1995).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dogshape.sim.errors import InputError, refusal, require_ranges, within
from dogshape.sim.shift.geometry import SHARPEST, Dog
from dogshape.sim.units import MM


@dataclass(frozen=True)
class Wear:
    """Wear of the faces, by a rate (m3/(N m)) or a measured loss of height, and of the edges (m).

    ``crest_loss`` and ``edge_radius`` are those at the end of the life; edges stay as they are
    without the latter, and faces need not wear with it.
    """

    rate: float | None = within(
        "rate_mm3_Nm", 0.0, 1e-2, None, remedy="1e-7 is well lubricated, 1e-5 hardly"
    )
    crest_loss: float | None = within(
        "crest_loss_mm", 0.0, 2.0, None, remedy="give the height in mm"
    )
    edge_radius: float | None = within("edge_radius_mm", SHARPEST / MM, 10.0, None)

    def __post_init__(self) -> None:
        given = [v for v in (self.rate, self.crest_loss) if v is not None]
        if len(given) != 1 and (given or self.edge_radius is None):
            raise InputError(
                "[wear] needs one of wear.rate_mm3_Nm (Archard) and wear.crest_loss_mm (measured); "
                "give one and not both"
            )
        require_ranges(self, "wear", "give the radius in mm")

    def loss(self, dog: Dog, energy: float, friction: float, shifts: float) -> float:
        """Compute the height that ``shifts`` take from the crest of a dog, m.

        ``energy`` in J is that of a shift in the mean, ``friction`` the dynamic coefficient.
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

    def edges(self, dog: Dog, share: float) -> float:
        """Compute the radius of a dog's edges at a share of the life, m."""
        if self.edge_radius is None:
            return dog.edge_radius
        if self.edge_radius < dog.edge_radius:
            rule = f"edges do not get sharper than dog.edge_radius_mm = {dog.edge_radius / MM:.6g}"
            radius, remedy = self.edge_radius / MM, "give the radius at the end of the life"
            raise InputError(refusal("wear.edge_radius_mm", radius, "mm", rule, remedy))
        new, old = dog.edge_radius**2, self.edge_radius**2
        return math.sqrt(new + share * (old - new))


def worn(dog: Dog, loss: float) -> Dog:
    """Return the dog of a pair whose crests have lost the height ``loss``, m.

    Raises GeometryError where nothing of the dog is left.
    """
    lower = replace(
        dog, height=dog.height - 2.0 * loss, axial_gap=dog.axial_gap + 2.0 * loss,
        chamfer=0.0, chamfer_back=0.0, crest=1.0,
    )  # fmt: skip
    back, face = (max(0.0, drop - loss) for drop in dog.drops_at(dog.mean_radius))
    if face == back == 0.0:
        return lower

    def fall(drop: float, share: float, lean: float) -> float:
        return math.atan2(drop, share * lower.tip_width + drop * math.tan(lean))

    return replace(
        lower, crest=dog.crest, chamfer=fall(face, dog.crest, dog.braking),
        chamfer_back=fall(back, 1.0 - dog.crest, dog.traction),
    )  # fmt: skip
