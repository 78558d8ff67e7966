r"""Dog on dog: what a face and its edge bear at the hardest landing of the simulation.

The simulation gives the load per length of the dogs, :math:`w = F/(N b)`, for each class of
overlap *L* of the faces (``sim.shift.loads``). Crests are rounded with the edge radius
:math:`\varrho`, or where the dog has none with the root radius, which takes
:math:`c = \varrho \cot(\psi/2)` from either face, :math:`\psi` being the angle at the crest
(``sim.shift.geometry``). What is flat then is :math:`L - 2 c`:

- flat enough, the case bears a mean pressure :math:`p = w/(L - 2 c)` up to its yield stress,
  a third of the hardness, and the core below it, the load having spread by the case
  depth *t* to either side, :math:`w/(L - 2 c + 2 t)` up to its proof stress;
- else rounding stands on rounding, and the pressure of Hertz for two cylinders is
  :math:`p_H = \sqrt{w E^*/(\pi R)}`, :math:`R = \varrho/2`, :math:`E^* = E/(2 (1 - \nu^2))`.

*L* is the lower end of the class. Where only the share :math:`K_s` of the dogs lands, loads
grow by :math:`1/\sqrt{K_s}`: with fewer dogs the contact is softer, the peak of a blow goes
with the root of its stiffness, and what is left is shared by fewer. The share is the load case's
load sharing, or with an accuracy class what dogs that stand out land first
(``sim.strength.load_case``).

An edge that is landed on for a life keeps its shape while the pressure of Hertz stays
below the shakedown limit of a line contact, four times the yield stress in shear (Johnson,
*Contact Mechanics*, 1985). With a yield stress of a third of the hardness that is
0.77 HV; more would flatten it landing by landing.

*Steel edges.* Two like cylinders of radius :math:`\varrho` under a load *w* for each length touch
on a strip of the half width :math:`a = \sqrt{4 w R/(\pi E^*)}`. The stiffness is
:math:`\pi E^*/(2 \ln(4 \varrho/a) - 2)` for each length (Hertz; Johnson, 5.57, for both halves).
The simulation has a bed of springs in its place, which stands for a dog that bends and is pressed.
Over a narrow overlap that is far softer than steel. With ``load.edge_contact = "line"`` the edges
bear a blow of the same energy on the line contact in series with the whole dog, which peaks with
more load. That it takes all of the energy makes it an upper bound: fork, shaft and ring give way
too.

Each landing is one of rigid rings on the contact's stiffness with the moving mass of the study,
and no bound: stiffer dogs land harder, and more angles than were simulated may hold harder ones.
So the hardest of a sample grows with the sample. With ``load.landing_share`` *s* the checks take
instead what the share *s* of all shifts exceeds: the quantile 1 - *s* of either pressure over the
mix, which more angles only make surer.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from itertools import pairwise

import numpy as np

from dogshape.sim.shift.geometry import LAND, Dog, crest_cut, tip_radius
from dogshape.sim.shift.loads import OVERLAPS, Landing
from dogshape.sim.strength.checks import Check, Rule
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import MPA

MODULUS = YOUNG / (2.0 * (1.0 - POISSON**2))  #: Pa, of two like bodies


def edge_pressure(line_load: float, radius: float) -> float:
    """Compute the pressure of Hertz of two like edges, Pa; load in N/m, their radius in m."""
    return math.sqrt(line_load * MODULUS / (math.pi * 0.5 * radius))


@dataclass(frozen=True)
class LineContact:
    """Two like edges of steel under a load per length.

    Parameters
    ----------
    radius : of either edge, m.
    load : N/m.
    """

    radius: float
    load: float

    @property
    def half_width(self) -> float:
        """Half of the strip that touches (Hertz), m."""
        return math.sqrt(4.0 * self.load * 0.5 * self.radius / (math.pi * MODULUS))

    @property
    def pressure(self) -> float:
        """Largest pressure, Pa."""
        return edge_pressure(self.load, self.radius)

    @property
    def approach(self) -> float:
        """Approach of both cylinders' axes, m."""
        return (
            self.load
            / (math.pi * MODULUS)
            * (2.0 * math.log(4.0 * self.radius / self.half_width) - 1.0)
        )

    @property
    def stiffness(self) -> float:
        """Load per length over approach, for a small change of load, Pa."""
        return math.pi * MODULUS / (2.0 * math.log(4.0 * self.radius / self.half_width) - 2.0)

    @property
    def energy(self) -> float:
        """Energy per length that the contact stores, N."""
        # w dz, with the logarithm's own part of 1/(4 pi E*).
        return 0.5 * self.load * self.approach - self.load**2 / (4.0 * math.pi * MODULUS)


def bed_energy(load: float, radius: float, stiffness: float) -> float:
    """Compute the energy per length of two rounded edges on a bed of springs in Pa/m, N."""
    depth = (0.75 * load / (stiffness * math.sqrt(radius))) ** (2.0 / 3.0)
    return 0.4 * load * depth


def flat_energy(load: float, overlap: float, stiffness: float) -> float:
    """Compute the energy per length of flat faces that overlap on a bed of springs in Pa/m, N."""
    return 0.5 * load**2 / (stiffness * overlap)


def blow_load(energy: float, radius: float, dog: float) -> float:
    """Compute the load per length of a blow, N/m, on a line contact in series with a dog.

    ``energy`` per length in N; ``dog`` the stiffness of a dog for each length, Pa.
    """
    # Takes a quarter of a second to load, which checks of studies without it do not need.
    from scipy.optimize import brentq  # noqa: PLC0415

    if energy <= 0.0:
        return 0.0
    alone = math.sqrt(2.0 * energy * dog)  # were all of the energy in the dog

    def left(w: float) -> float:
        return LineContact(radius, w).energy + 0.5 * w * w / dog - energy

    return float(brentq(left, 1e-6 * alone, alone))


def line_load(load: float, radius: float, bed: float, dog: float) -> float:
    """Compute the load per length, N/m, of a line contact on a dog at the energy of a bed's load.

    ``bed`` in Pa/m; ``dog`` the stiffness of a dog for each length, Pa.
    """
    return blow_load(bed_energy(load, radius, bed), radius, dog)


#: Overlap in the middle of each class, m; the last one has no end.
MIDDLES = (*(0.5 * (low + high) for low, high in pairwise(OVERLAPS)), OVERLAPS[-1])


def hardest(landings: Iterable[Landing]) -> Landing:
    """Return the largest load in each class of overlap; zeros where there is none."""
    columns = list(zip(*(one.line_loads for one in landings), strict=True))
    return Landing(tuple(max(column) for column in columns)) if columns else Landing()


FACE_RULE = Rule(
    "face_pressure_impact", "impact", "mean pressure on the flat overlap of the faces, hardest "
    "landing", "w/((L - 2 c) sqrt(K_s)), w = F/(N b), c what a rounded crest takes",
    "simulated peak; limit: yield stress of the case, HV/3, over safety",
    "MPa", "material.surface_hardness_HV", True,
)  # fmt: skip
CORE_RULE = Rule(
    "core_pressure_impact", "impact", "mean pressure below the case of the faces, hardest landing",
    "w/((L - 2 c + 2 t) sqrt(K_s)), t case depth",
    "simulated peak; limit: proof stress of the core over safety",
    "MPa", "material.proof_stress_MPa", True,
)  # fmt: skip
EDGE_RULE = Rule(
    "edge_pressure_impact", "impact", "pressure of Hertz of rounded edge on rounded edge, hardest "
    "landing", "sqrt(w E*/(pi rho/2 sqrt(K_s)))",
    "simulated peak, or with load.edge_contact = 'line' a blow of its energy on steel edges; "
    "limit 0.77 HV, shakedown of a line contact (Johnson 1985)",
    "MPa", "material.surface_hardness_HV", True,
)  # fmt: skip
LANDING_RULES = (FACE_RULE, CORE_RULE, EDGE_RULE)


@dataclass(frozen=True)
class Demand:
    """Load of a landing on faces, on the core below them and on edges, Pa."""

    face: float = 0.0
    core: float = 0.0
    edge: float = 0.0


def exceeded(demands: Sequence[Demand], weights: Sequence[float], share: float) -> Demand:
    """Compute what the ``share`` of all shifts exceeds, of each pressure for itself.

    Parameters
    ----------
    demands : of single shifts.
    weights : of the same shifts; they need not add up to one.
    share : in (0, 1). A value stands in the middle of its weight; between two the quantile runs
        straight, and beyond the largest nothing is known.
    """
    if not demands:
        return Demand()
    columns, mass = [], np.array(weights) / sum(weights)
    for column in np.array([astuple(one) for one in demands]).T:
        order = np.argsort(column, kind="stable")
        places = np.cumsum(mass[order]) - 0.5 * mass[order]
        columns.append(float(np.interp(1.0 - share, places, column[order])))
    return Demand(*columns)


def landing_checks(dog: Dog, landing: Landing, limits: Limits) -> tuple[Check, ...]:
    """Return the checks of the hardest landing."""
    return demand_checks(demand_of(dog, landing, limits), limits)


def demand_of(dog: Dog, landing: Landing, limits: Limits) -> Demand:
    """Compute what a landing makes faces, core and edges bear."""
    radius = tip_radius(dog, limits.root_radius)
    lost = 2.0 * crest_cut(dog, radius)
    spread = 2.0 * limits.material.case_depth
    classes = [
        (overlap - lost, w * (1.0 / math.sqrt(limits.load.landing(dog, w))))
        for overlap, w in zip(OVERLAPS, landing.line_loads, strict=True)
    ]
    flats = [(flat, load) for flat, load in classes if flat >= LAND]
    face = max((load / flat for flat, load in flats), default=0.0)
    core = max((load / (flat + spread) for flat, load in flats), default=0.0)
    bed = limits.load.edge_bed
    if bed is not None:
        classes = [
            (flat, _on_steel(load, middle, dog, bed, radius) if flat < LAND else load)
            for (flat, load), middle in zip(classes, MIDDLES, strict=True)
        ]
    edge = max((load for flat, load in classes if flat < LAND), default=0.0)
    return Demand(face, core, edge_pressure(edge, radius))


def _on_steel(load: float, overlap: float, dog: Dog, bed: float, radius: float) -> float:
    """Compute the load per length of the same blow on steel edges, N/m.

    Sharp dogs of the simulation overlap with flat faces, rounded ones with two cylinders.
    """
    rounded = dog.edge_radius > 0.0
    energy = bed_energy(load, radius, bed) if rounded else flat_energy(load, overlap, bed)
    return blow_load(energy, radius, bed * dog.tip_width)


def demand_checks(demand: Demand, limits: Limits) -> tuple[Check, ...]:
    """Return the checks of a landing, or of what a share of landings exceeds."""
    material = limits.material
    return (
        Check(FACE_RULE, demand.face / MPA, material.case_yield / limits.load.safety / MPA),
        Check(CORE_RULE, demand.core / MPA, limits.allowable_stress / MPA),
        Check(EDGE_RULE, demand.edge / MPA, material.edge_pressure / MPA),
    )
