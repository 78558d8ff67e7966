r"""The dogs of both rings, and the lengths that follow from the two.

The sliding ring has the dog of ``[dog]``; the output ring has that dog with the dimensions of
``[output_dog]`` in place of its own. Number, annulus and side angles are those of both rings, or
flanks would not lie on each other. A ring's *pitch plane* holds the radial lines of its flanks
(``sim.shift.geometry``): half the height above the root of the sliding dog. At full depth the pitch
planes of both rings coincide, and flanks lie on each other once the play is turned.

With heights :math:`h_1, h_2` of sliding and output dog and axial gap *g* the crest of the higher
dog meets the floor of the lower at the depth :math:`h = \min(h_1, h_2)`, so the travel is :math:`g
+ h` and the open pair is :math:`g + h_1 + h_2` long from root to root. A lower output dog lacks the
end of its tip, a higher one stands between deeper slots: below the pitch plane its root is

.. math:: d_2 = \max\left(\tfrac{h_1}{2}, h_2 - \tfrac{h_1}{2}\right)

deep. With ``slots_per_dog`` of *s* one ring, that of output or sliding dogs, has a dog at every
*s*-th pitch, and its other dogs are missing or, with ``low_height``, lower. As the other ring has
all, the pair repeats after one pitch, at every angle all :math:`N/s` high dogs touch alike, and
force and torque are *N/s* times those of one; the :math:`N - N/s` low ones add theirs. A low dog
has the flanks and the root of a high one and a tip as far below its crest as it is lower. It lies
within the high one: it touches deeper by that way, and only where a high dog touches too.

A dog that leaves the play *j* to half a pitch is :math:`(\vartheta r - j)/2` wide in its
pitch plane, so the play of the pair is :math:`(j_1 + j_2)/2`. The ridges of two dogs that face each
other overlap by the mean of both ``crest_overlap``.

Two faces of slopes :math:`a \le b` and widths :math:`f_a, f_b` whose ridges overlap by *L* touch at
the displacement :math:`g + a L + (b - a) \max(0, L - f_a)`: the ridge of the steeper on the flatter
face, then the edge of the flatter on the steeper. They part at :math:`L = f_a + f_b`.

One dog of a pair is rigid, the other carries the compliant layer of both. Which one does not matter
for faces that are parallel; a rigid ridge that slides on a flatter compliant face would plough
through the layer and lose power to its dissipation (``sim.shift.slide``). So the dog that falls
less is the rigid one, of equal falls that with the rounder edges, else that of the output ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dogshape.sim.elementwise import largest, smallest, tan, where
from dogshape.sim.errors import GeometryError, InputError, Refusal
from dogshape.sim.quantity import quantities_of, quantity, record_quantities, require_ranges
from dogshape.sim.shift.geometry import Dog, Dogs, field_values
from dogshape.sim.units import MM


@dataclass(frozen=True)
class OutputDog:
    """Dimensions in which the output ring's dog differs from that of the sliding ring, SI units.

    None stands for the dimension of the sliding dog.
    """

    chamfer: float | None = quantity("chamfer_deg", 0.0, 60.0, None)
    height: float | None = quantity("height_mm", 0.2, 100.0, None)
    edge_radius: float | None = quantity("edge_radius_mm", 0.0, 10.0, None)
    crest: float | None = quantity("crest", 0.0, 1.0, None)
    chamfer_back: float | None = quantity("chamfer_back_deg", 0.0, 60.0, None)
    backlash: float | None = quantity("backlash_mm", 0.0, 50.0, None)
    #: slots of one ring for each high dog of the other, whose further dogs are missing or low
    slots_per_dog: int | None = quantity("slots_per_dog", 1, 100, None)
    #: of the further dogs above the root of all; None: they are missing
    low_height: float | None = quantity("low_height_mm", 0.2, 100.0, None)
    is_sliding_sparse: bool = False  #: whether dogs of the sliding ring are missing or low

    def __post_init__(self) -> None:
        require_ranges(self, "output_dog", "check the value and its unit")
        if self.is_sliding_sparse and (self.slots_per_dog or 1) == 1:
            raise InputError(
                f"output_dog.sparse_ring is 'sliding', but without output_dog.{SLOTS} no ring "
                f"lacks a dog; give output_dog.{SLOTS} = 2 for every second dog, or leave it out"
            )
        if self.low_height is not None and (self.slots_per_dog or 1) == 1:
            rule = f"low dogs stand between those that output_dog.{SLOTS} leaves high"
            remedy = f"give output_dog.{SLOTS} = 2 for every second dog"
            height = self.low_height / MM
            raise InputError(Refusal("output_dog.low_height_mm", height, "mm", rule, remedy))

    @property
    def given(self) -> dict[str, Any]:
        """Dimensions that are given, SI units."""
        values = {name: getattr(self, name) for name in quantities_of(OutputDog)}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def record(self) -> dict[str, float]:
        """Dimensions that are given, by their keys in a record and in the units of files."""
        items = record_quantities(self).items()
        return {f"{OUTPUT_PREFIX}{key}": value for key, value in items if value is not None}

    def _shape_beside(self, sliding: Dog) -> dict[str, Any]:
        """Return the given dimensions of the high dog beside a ``sliding`` one, SI units."""
        return {name: value for name, value in self.given.items() if name not in RING_NAMES}

    def beside(self, sliding: Dog, nominal: Dog | None = None) -> Dog:
        """Return the output dog beside a ``sliding`` dog, or beside each of ``Dogs``.

        Deviations of the sliding dog from its ``nominal`` one are those of the output dog too;
        dimensions stop at 0. Raises GeometryError for an impossible shape.
        """
        changes = self._shape_beside(sliding)
        if not changes:
            return sliding
        if nominal is not None:
            is_missing = _missing_dimensions(changes)
            for name, dimension in changes.items():
                deviation = getattr(sliding, name) - getattr(nominal, name)
                deviated = largest(0.0, dimension + deviation)
                changes[name] = where(is_missing.get(name, False), dimension, deviated)
        height = changes.get("height", sliding.height)
        if np.any(height != sliding.height):
            pitch_depth = 0.5 * sliding.height
            changes["root_depth"] = largest(pitch_depth, height - pitch_depth)
        try:
            return replace(sliding, **changes)
        except GeometryError as error:
            raise GeometryError(f"output ring: {error}") from error

    def low_beside(self, sliding: Dog, nominal: Dog | None = None) -> Dog | None:
        """Return the low dog beside a ``sliding`` dog, or beside each of ``Dogs``; None for none.

        Its height deviates as that of the sliding dog does from its ``nominal`` one. Raises
        GeometryError for an impossible shape.
        """
        if self.low_height is None:
            return None
        high = sliding if self.is_sliding_sparse else self.beside(sliding, nominal)
        height = self.low_height
        if nominal is not None:
            height = largest(0.0, height + (sliding.height - nominal.height))
        try:
            return replace(high, height=height, root_depth=high.dedendum)
        except GeometryError as error:
            ring = sparse_ring(is_sliding=self.is_sliding_sparse)
            raise GeometryError(f"low dogs of the {ring}: {error}") from error

    def possible_beside(self, sliding: Dog, nominal: Dog | None = None) -> bool:
        """Whether the output dogs beside ``Dogs`` keep all rules of a shape, (n,); always of one.

        Raises GeometryError for an impossible shape beside one dog.
        """
        output = self.beside(sliding, nominal)
        low = self.low_beside(sliding, nominal)
        return output.possible if low is None else output.possible & low.possible

    def pair_with(self, sliding: Dog) -> Pair:
        """Build the pair with a ``sliding`` dog, or with each of ``Dogs``."""
        return Pair(
            sliding,
            self.beside(sliding),
            self.slots_per_dog or 1,
            low=self.low_beside(sliding),
            is_sliding_sparse=self.is_sliding_sparse,
        )


class OutputDogs(OutputDog):
    """Output dogs of many designs: a dimension is a number or an array (n,), by ``Dogs.row``."""

    __hash__ = object.__hash__
    __eq__ = object.__eq__

    def __post_init__(self) -> None:
        """Accept any dimension."""

    @classmethod
    def of(cls, output_dog: OutputDog, **columns: Any) -> OutputDogs:
        """Build output dogs of one, with ``columns`` (n,) in place of some dimensions."""
        return cls(**(field_values(output_dog) | columns))

    def _shape_beside(self, sliding: Dog) -> dict[str, Any]:
        row = sliding.row if isinstance(sliding, Dogs) else None
        return {
            name: dimension[row] if np.ndim(dimension) else dimension
            for name, dimension in super()._shape_beside(sliding).items()
        }


def _missing_dimensions(shape: Mapping[str, Any]) -> dict[str, bool]:
    """Test whether a dog of given dimensions lacks a face or play, which does not deviate then."""
    crest = shape.get("crest")
    return {
        "chamfer": crest == 0.0,
        "chamfer_back": crest == 1.0,
        "backlash": shape.get("backlash") == 0.0,
    }


def sparse_ring(*, is_sliding: bool) -> str:
    """Name the ring whose dogs are missing or low."""
    return "sliding ring" if is_sliding else "output ring"


OUTPUT_PREFIX = "output_dog_"  #: of the keys of the output dog in a flat record
SLOTS = "slots_per_dog"
#: Dimensions of the ring or of its low dogs, not of a high dog.
RING_NAMES = (SLOTS, "low_height")
ALIKE = OutputDog()  #: both rings have one dog
MIN_HEIGHT_SHARE = 0.5  #: of the sliding dog's height; a crest in the pitch plane has no flank


class Slope(NamedTuple):
    """Two faces, or two backs, that meet."""

    slope: float  #: tangent of the flatter one
    flat_width: float  #: of the flatter one, along the circumference, m
    slope_rise: float  #: tangent of the steeper less that of the flatter one
    reach: float  #: sum of both widths, m


class RingDogs(NamedTuple):
    """Dogs of one ring."""

    dog: Dog
    pitches: int = 1  #: from a high dog to the next
    low: Dog | None = None  #: dog at the pitches between; None: missing


@dataclass(frozen=True)
class Pair:
    """Dogs of sliding and output ring; of many pairs ``Dogs``.

    Raises GeometryError where the output dog is at most half as high as the sliding one, low dogs
    are higher than the high ones, or undercut dogs do not pass each other.
    """

    sliding: Dog
    output: Dog
    slots_per_dog: int = 1  #: slots of the full ring for each high dog of the sparse one
    low: Dog | None = None  #: low dog of the sparse ring between the high ones; None: missing
    is_sliding_sparse: bool = False  #: whether the sliding ring is the sparse one

    def __post_init__(self) -> None:
        if isinstance(self.sliding, Dogs):
            return
        if not self._has_even_dogs:
            rule = (
                f"dogs in every such slot of the {self.sliding.count} of dog.count must be evenly "
                "spaced, and two at least"
            )
            remedy = "use a divisor of dog.count"
            name = f"output_dog.{SLOTS}"
            raise GeometryError(Refusal(name, self.slots_per_dog, "", rule, remedy))
        if not self._is_high_enough:
            least = MIN_HEIGHT_SHARE * self.sliding.height
            rule = f"it must exceed half of dog.height_mm, {least / MM:.4g} mm"
            remedy = "use a higher output dog or a lower sliding dog"
            height = self.output.height / MM
            raise GeometryError(Refusal("output_dog.height_mm", height, "mm", rule, remedy))
        if self.low is not None and self.shortening < 0.0:
            ring = sparse_ring(is_sliding=self.is_sliding_sparse)
            rule = f"the high dogs of the {ring} have {self.sparse.height / MM:.4g} mm"
            height = self.low.height / MM
            raise GeometryError(
                Refusal("output_dog.low_height_mm", height, "mm", rule, "use a lower height")
            )
        if self.passing_play < 0.0:
            rule = "undercut flanks must pass each other on the way in (0 mm)"
            remedy = "use more backlash, less undercut or a larger chamfer"
            name = "play of unlike rings at the mouth of a slot"
            raise GeometryError(Refusal(name, self.passing_play / MM, "mm", rule, remedy))

    @property
    def _is_high_enough(self) -> bool:
        """Whether the crest of the output dog stands above its pitch plane."""
        return self.output.height > MIN_HEIGHT_SHARE * self.sliding.height

    @property
    def _has_even_dogs(self) -> bool:
        """Whether the dogs of the sparse ring are two at least and evenly spaced."""
        count = self.sliding.count
        return (count % self.slots_per_dog == 0) & (count >= 2 * self.slots_per_dog)

    @property
    def possible(self) -> bool:
        """Whether both dogs and the pair keep all rules of a shape; (n,) of bool for ``Dogs``."""
        dogs = self.sliding.possible & self.output.possible & self._has_even_dogs
        if self.low is not None:
            dogs = dogs & self.low.possible & (self.shortening >= 0.0)
        return dogs & self._is_high_enough & (self.passing_play >= 0.0)

    @property
    def alike(self) -> bool:
        """Whether both rings have one dog, and all of their dogs."""
        is_same = self.output is self.sliding or self.output == self.sliding
        return is_same and self.slots_per_dog == 1

    @property
    def touching_count(self) -> int:
        """Number of dogs that touch at once from the crests on: high dogs of the sparse ring."""
        return touching_count(self.sliding, self.slots_per_dog)

    @property
    def sparse(self) -> Dog:
        """High dog of the ring whose other dogs are missing or low."""
        return self.sliding if self.is_sliding_sparse else self.output

    @property
    def is_sparse_rigid(self) -> bool:
        """Whether the dogs of the sparse ring are the rigid ones."""
        return self.is_sliding_rigid == self.is_sliding_sparse

    @property
    def sliding_dogs(self) -> RingDogs:
        """Dogs of the sliding ring."""
        if not self.is_sliding_sparse:
            return RingDogs(self.sliding)
        return RingDogs(self.sliding, self.slots_per_dog, self.low)

    @property
    def output_dogs(self) -> RingDogs:
        """Dogs of the output ring."""
        if self.is_sliding_sparse:
            return RingDogs(self.output)
        return RingDogs(self.output, self.slots_per_dog, self.low)

    @property
    def low_count(self) -> int:
        """Number of low dogs of the sparse ring."""
        return 0 if self.low is None else self.sliding.count - self.touching_count

    @property
    def shortening(self) -> float:
        """Way of a low dog's crest below those of the high ones, m; 0 without low dogs."""
        return 0.0 if self.low is None else self.sparse.height - self.low.height

    @property
    def rigid(self) -> Dog:
        """Dog without a compliant layer: the one whose tip falls less."""
        return self.sliding if self.is_sliding_rigid else self.output

    @property
    def compliant(self) -> Dog:
        """Dog with the compliant layer of both."""
        return self.output if self.is_sliding_rigid else self.sliding

    @property
    def is_sliding_rigid(self) -> bool:
        """Whether the sliding dog is the rigid one."""
        falls = [dog.chamfer + dog.chamfer_back for dog in (self.sliding, self.output)]
        if falls[0] == falls[1]:
            return self.sliding.edge_radius > self.output.edge_radius
        return falls[0] < falls[1]

    @property
    def depth(self) -> float:
        """Axial way from crests on crests to full depth, m."""
        return smallest(self.sliding.height, self.output.height)

    @property
    def travel(self) -> float:
        """Axial way from the start of the shift to full depth, m."""
        return self.sliding.axial_gap + self.depth

    @property
    def axial_length(self) -> float:
        """Room the pair needs along the shaft when open, root to root, m."""
        return self.sliding.axial_gap + (self.sliding.height + self.output.height)

    @property
    def backlash(self) -> float:
        """Play of the seated pair along the circumference at the mean radius, m."""
        return 0.5 * (self.sliding.backlash + self.output.backlash)

    @property
    def backlash_angle(self) -> float:
        """Play of the seated pair, rad."""
        return 0.5 * (self.sliding.backlash_angle + self.output.backlash_angle)

    @property
    def entry_play(self) -> float:
        """Width of a slot's mouth less the width of the tip that enters it, at mean radius, m."""
        return self.depth * self.sliding.lean + self.backlash

    @property
    def passing_play(self) -> float:
        """Play with which flanks first face each other on the way in, at the inner radius, m."""
        inner = self.sliding.inner_radius
        drops = [largest(*dog.drops_at(inner)) for dog in (self.sliding, self.output)]
        return self.backlash_angle * inner + (self.depth - sum(drops)) * self.sliding.lean

    @property
    def crest_overlap(self) -> float:
        """Overlap of two faces at dogs facing dogs, ridge to ridge at the mean radius, m."""
        return 0.5 * (self.sliding.crest_overlap + self.output.crest_overlap)

    @property
    def edge_radius(self) -> float:
        """Mean radius of the edges of both dogs, m."""
        return 0.5 * (self.sliding.edge_radius + self.output.edge_radius)

    @property
    def faces(self) -> Slope:
        """Faces that meet where ridges overlap."""
        dogs = (self.sliding, self.output)
        return _slope(*((dog.tangents[0], dog.face_width) for dog in dogs))

    @property
    def backs(self) -> Slope:
        """Backs that meet where the overlap of the ridges is negative."""
        dogs = (self.sliding, self.output)
        return _slope(*((tan(dog.chamfer_back), dog.back_width) for dog in dogs))


def touching_count(dog: Dog, slots_per_dog: int) -> int:
    """Count the dogs of a ring with so many slots of the other ring for each."""
    return dog.count if slots_per_dog == 1 else dog.count // slots_per_dog


def _slope(first: tuple[float, float], second: tuple[float, float]) -> Slope:
    """Join two faces, each by the tangent of its fall and its width in m."""
    (flat, width), (steep, _) = sorted((first, second))
    return Slope(flat, width, steep - flat, first[1] + second[1])


@lru_cache(maxsize=64)  # a pair is asked for with every shift
def dog_pair(sliding: Dog, output_dog: OutputDog = ALIKE) -> Pair:
    """Build the pair of a sliding dog and the output dog beside it."""
    return output_dog.pair_with(sliding)
