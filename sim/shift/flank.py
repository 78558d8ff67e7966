r"""Where two flanks touch at full depth.

Both tip edges of a dog are rounded with the edge radius :math:`\varrho`, or where the dog has none
with the root radius, so that they clear the fillets of the other ring. A rounding takes from its
flank, along the shaft, :math:`a = \varrho \cos\beta \cot(\psi/2)`, :math:`\psi` being the angle
of the material at the edge: :math:`90° + \beta - \alpha` at the crest,
:math:`90° + \alpha + \gamma` at the braking edge. Either ring lacks it at its own tip, so the
height that touches is

- traction: :math:`h - 2 a_\beta`, both crests being on that side;
- braking, at radius *r*: :math:`h - 2 (d(r) + a_\gamma)`, :math:`d(r)` the depth at
  which the face meets the flank there. The tip is wider outside, so less touches there.

Widths along the circumference overstate *d*, on the safe side: the area that is left by
0.3 % for the prototype, by 5 % for nine dogs.

Areas are projected on the plane through the axis: a pressure *p* on a leaning flank has
the tangential force *p* times that area, whatever the lean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from dogshape.sim.elementwise import cos, hypot, largest, smallest, tan, where
from dogshape.sim.shift.geometry import LAND, Dog

Flank = Literal["traction", "braking"]
FLANKS: tuple[Flank, ...] = ("traction", "braking")


def side_angle(dog: Dog, flank: Flank) -> float:
    """Return the side angle of a flank, rad."""
    return dog.traction if flank == "traction" else dog.braking


@dataclass(frozen=True)
class FlankContact:
    """Part of a flank that touches at full depth.

    Parameters
    ----------
    low, high : ends at the mean radius above the slot's floor, m.
    area : projected on the plane through the axis, m2.
    """

    low: float
    high: float
    area: float

    @property
    def height(self) -> float:
        """Height that touches at the mean radius, m; negative where nothing does."""
        return self.high - self.low

    def level(self, share: float) -> float:
        """Return the height above the floor at a share of what touches, m."""
        return self.low + share * self.height


def tip_radius(dog: Dog, root_radius: float) -> float:
    """Return the radius with which tip edges are made, m: their own, or that of the roots."""
    return dog.edge_radius or root_radius


def flank_contact(dog: Dog, root_radius: float, flank: Flank) -> FlankContact:
    """Compute the part of two flanks that touches at full depth; ``root_radius`` in m."""
    radii, cut = (dog.inner_radius, dog.mean_radius, dog.outer_radius), dog.edge_cuts
    taken = tip_radius(dog, root_radius) * cos(side_angle(dog, flank)) * cut[FLANKS.index(flank)]
    drops = [dog.edge_drop_at(r) for r in radii] if flank == "braking" else [0.0, 0.0, 0.0]
    inner, mean, outer = (drop + taken for drop in drops)
    area = dog.radial_width * _mean_positive(dog.height - 2.0 * inner, dog.height - 2.0 * outer)
    return FlankContact(mean, dog.height - mean, area)


def crest_loss(dog: Dog, root_radius: float) -> float:
    """Compute the height that the rounding takes from the crest, m.

    Centre of the rounding on the bisector of the crest, its top a radius higher.
    """
    corner, middle = 0.25 * math.pi, 0.5 * (dog.chamfer + dog.traction)
    half = corner + 0.5 * (dog.traction - dog.chamfer)
    return root_radius * (math.sin(corner + middle) / math.sin(half) - 1.0)


def crest_setback(dog: Dog, radius: float) -> float:
    """Compute how far the ridge of a rounded crest stands behind the sharp one, m.

    Along the circumference at the mean radius.
    """
    corner, middle = 0.25 * math.pi, 0.5 * (dog.chamfer + dog.traction)
    half = corner + 0.5 * (dog.traction - dog.chamfer)
    return radius * cos(corner + middle) / math.sin(half)


def crest_cut(dog: Dog, root_radius: float) -> float:
    """Compute the width of the face that the rounding of the crest takes, m."""
    return root_radius * dog.edge_cuts[0]


def root_radius_room(dog: Dog) -> float:
    """Return the largest radius of roots for which fillets and roundings fit side by side, m.

    On floor and face at the inner radius, where they are narrowest, on the traction flank,
    and on the braking flank at the outer radius, where it is lowest. Widths are taken along
    the circumference; ``sim.part.profile`` has the same between planes. Roundings have the same
    radius, or that of the dog's edges.
    """
    slope, _, braking = dog.tangents
    narrow, low = dog.tip_width_at(dog.inner_radius), dog.edge_drop_at(dog.outer_radius)
    face = (narrow + dog.edge_drop_at(dog.inner_radius) * braking) * hypot(1.0, slope)
    # Over its radius a fillet takes along floor and flank, and a rounding along its sides:
    fillets = [1.0 / tan(0.25 * math.pi + 0.5 * lean) for lean in (dog.traction, dog.braking)]
    cuts = dog.edge_cuts
    flanks = [dog.height / cos(dog.traction), (dog.height - low) / cos(dog.braking)]
    rooms = [(narrow, sum(fillets))]
    own = dog.edge_radius > 0.0
    for length, fillet, cut in zip(flanks, fillets, cuts, strict=True):
        rooms.append((length - dog.edge_radius * cut, fillet if own else fillet + cut))
    if not own:
        rooms.append((face, sum(cuts)))
    return largest(0.0, smallest(*((length - LAND) / taken for length, taken in rooms)))


def _mean_positive(a: float, b: float) -> float:
    """Return the mean of the positive part of a line from ``a`` to ``b``."""
    top, apart = largest(a, b, 0.0), abs(a - b)
    part = 0.5 * top**2 / where(apart > 0.0, apart, 1.0)
    return where(smallest(a, b) >= 0.0, 0.5 * (a + b), part)
