"""Dogs in columns: the geometry of many designs at once, as ``Dog`` has it of one.

Formulas are those of ``sim.shift.geometry`` and ``sim.shift.flank`` for sharp edges.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dogshape.sim.shift.flank import Flank
from dogshape.sim.shift.geometry import LAND, LENGTHS
from dogshape.sim.units import MM

Column = NDArray[np.float64]
Marks = NDArray[np.bool_]
QUARTER = 0.25 * math.pi
STEEP = math.radians(60.0)


@dataclass(frozen=True, eq=False)
class Dogs:
    """Columns of dogs with sharp edges, fields as of ``Dog``, each (n,); no shape is refused."""

    count: Column
    chamfer: Column
    traction: Column
    braking: Column
    height: Column
    outer_diameter: Column
    inner_diameter: Column
    axial_gap: Column

    def moved(self, deviations: Mapping[str, Column]) -> Dogs:
        """Return the dogs with some dimensions off by ``deviations``, none below zero."""
        off = {name: np.maximum(0.0, getattr(self, name) + by) for name, by in deviations.items()}
        return replace(self, **off)

    @cached_property
    def mean_radius(self) -> Column:
        """Mean radius of the annulus, m."""
        return 0.25 * (self.outer_diameter + self.inner_diameter)

    @cached_property
    def inner_radius(self) -> Column:
        """Inner radius of the annulus, m."""
        return 0.5 * self.inner_diameter

    @cached_property
    def outer_radius(self) -> Column:
        """Outer radius of the annulus, m."""
        return 0.5 * self.outer_diameter

    @cached_property
    def radial_width(self) -> Column:
        """Length of a dog along the radius, m."""
        return self.outer_radius - self.inner_radius

    @cached_property
    def pitch_angle(self) -> Column:
        """Angle from one dog to the next, rad."""
        return 2.0 * math.pi / self.count

    @cached_property
    def slope(self) -> Column:
        """Tangent of the chamfer."""
        return np.asarray(np.tan(self.chamfer))

    @cached_property
    def leans(self) -> dict[Flank, Column]:
        """Tangent of either side angle."""
        return {"traction": np.tan(self.traction), "braking": np.tan(self.braking)}

    def side_angle(self, flank: Flank) -> Column:
        """Return the side angle of a flank, rad."""
        return self.traction if flank == "traction" else self.braking

    @cached_property
    def _leaning(self) -> Column:
        return 0.5 * self.height * (self.leans["traction"] + self.leans["braking"])

    def tip_width_at(self, radius: Column) -> Column:
        """Return the width at crest height at ``radius``, m."""
        return 0.5 * self.pitch_angle * radius - self._leaning

    def root_width_at(self, radius: Column) -> Column:
        """Return the width at the root at ``radius``, m."""
        return 0.5 * self.pitch_angle * radius + self._leaning

    def edge_drop_at(self, radius: Column) -> Column:
        """Return the depth below the crest at which the face meets the braking flank, m."""
        return self.tip_width_at(radius) * self.slope / (1.0 - self.slope * self.leans["braking"])

    @cached_property
    def cuts(self) -> dict[Flank, Column]:
        """Lengths that a rounding of crest and braking edge takes along its sides, over radius."""
        corners: dict[Flank, Column] = {
            "traction": self.traction - self.chamfer,
            "braking": self.chamfer + self.braking,
        }
        return {flank: 1.0 / np.tan(QUARTER + 0.5 * one) for flank, one in corners.items()}

    def lost(self, root_radius: Column | float, flank: Flank, radius: Column) -> Column:
        """Return the height that a flank lacks at its tip at ``radius``, m."""
        taken = root_radius * np.cos(self.side_angle(flank)) * self.cuts[flank]
        return np.asarray(self.edge_drop_at(radius) + taken if flank == "braking" else taken)

    def contact_area(self, root_radius: float, flank: Flank) -> Column:
        """Return the area that touches at full depth, projected on the axial plane, m2."""
        inner, outer = (
            self.height - 2.0 * self.lost(root_radius, flank, r)
            for r in (self.inner_radius, self.outer_radius)
        )
        return self.radial_width * _mean_positive(inner, outer)

    def root_radius_room(self) -> Column:
        """Return the largest radius of roots for which fillets and roundings fit, m."""
        narrow, low = self.tip_width_at(self.inner_radius), self.edge_drop_at(self.outer_radius)
        drop = self.edge_drop_at(self.inner_radius) * self.leans["braking"]
        face = (narrow + drop) * np.hypot(1.0, self.slope)
        fillets = [1.0 / np.tan(QUARTER + 0.5 * one) for one in (self.traction, self.braking)]
        cuts = [self.cuts["traction"], self.cuts["braking"]]
        flanks = [self.height / np.cos(self.traction), (self.height - low) / np.cos(self.braking)]
        rooms = [(narrow, sum(fillets)), (face, sum(cuts))]
        rooms += [(flank, fillets[k] + cuts[k]) for k, flank in enumerate(flanks)]
        least = np.minimum.reduce([(length - LAND) / taken for length, taken in rooms])
        return np.maximum(0.0, least)

    def possible(self) -> Marks:
        """Mark the dogs that ``Dog`` takes, (n,) of bool."""
        kept = (self.count == np.trunc(self.count)) & (self.count >= 2.0)
        for angle in (self.chamfer, self.traction, self.braking):
            kept &= (angle >= 0.0) & (angle < STEEP)
        for name in ("height", "outer_diameter", "inner_diameter", "axial_gap"):
            low, high = LENGTHS[f"{name}_mm"]
            length = getattr(self, name) / MM
            kept &= (length >= low / MM) & (length <= high / MM)
        kept &= self.inner_diameter < self.outer_diameter
        kept &= self.tip_width_at(self.inner_radius) > 0.0
        kept &= self.slope * self.leans["braking"] < 1.0
        kept &= self.height - self.edge_drop_at(self.mean_radius) > 0.5 * self.height
        return np.asarray(kept, dtype=bool)


def _mean_positive(a: Column, b: Column) -> Column:
    """Return the mean of the positive part of lines from ``a`` to ``b``."""
    top = np.maximum(np.maximum(a, b), 0.0)
    apart = np.abs(a - b)
    part = 0.5 * top**2 / np.where(apart > 0.0, apart, 1.0)
    return np.where(np.minimum(a, b) >= 0.0, 0.5 * (a + b), part)
