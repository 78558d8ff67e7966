"""Blocks of work: one clutch at one operating point with its relative angles.

A block is a value that can be sent to another process; ``sim.statistics.batch`` simulates it there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.expectation import even_phases
from dogshape.sim.statistics.shift_records import Record, content_key, inputs
from dogshape.sim.statistics.uncertainty import Uncertainty, Variant


@dataclass(frozen=True)
class Block:
    """One clutch at one operating point, at relative angles in rad.

    ``seed`` is that of the angles' draw, None where they were given. ``variants`` has for each
    angle the draw of what is uncertain; it is empty where all is certain. Clutch and operating
    point are the nominal ones. ``fine`` is set where shifts are repeated with a smaller tolerance.
    """

    clutch: Clutch
    point: OperatingPoint
    angles: tuple[float, ...]
    seed: int | None = None
    variants: tuple[Variant, ...] = ()
    fine: bool = False

    @property
    def inputs(self) -> list[Record]:
        """Inputs of the block's shifts, in the order of the angles."""
        return [
            inputs(self.clutch, self.point, angle, variant)
            for angle, variant in zip(self.angles, self.each_variant, strict=True)
        ]

    @cached_property
    def keys(self) -> list[str]:
        """Content keys of the block's shifts, in the order of the angles."""
        return [content_key(given) for given in self.inputs]

    @cached_property
    def first_key(self) -> str:
        """Content key of the first shift."""
        return self.only([0]).keys[0]

    @property
    def each_variant(self) -> tuple[Variant | None, ...]:
        """The draw of each angle, None where all is certain."""
        return self.variants or (None,) * len(self.angles)

    def only(self, places: Sequence[int]) -> Block:
        """Return the block with the angles at ``places`` alone."""
        return replace(
            self,
            angles=tuple(self.angles[k] for k in places),
            variants=tuple(self.variants[k] for k in places) if self.variants else (),
        )

    def refined(self, place: int) -> Block:
        """Return the shift at ``place`` alone, with a tolerance thirty times smaller."""
        return replace(self.only([place]), clutch=self.clutch.refined(), seed=None, fine=True)


def even_blocks(
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    count: int,
    seed: int,
    base: int | None = None,
    *,
    uncertainty: Uncertainty | None = None,
) -> list[Block]:
    """Return a block for each operating point, at ``count`` evenly spaced angles of its own.

    ``seed`` and ``base`` as for ``sim.statistics.expectation.even_phases``.
    """
    return [
        even_block(clutch, point, count, (seed, index), base, uncertainty=uncertainty)
        for index, point in enumerate(points)
    ]


def even_block(
    clutch: Clutch,
    point: OperatingPoint,
    count: int,
    draw: tuple[int, int],
    base: int | None = None,
    *,
    uncertainty: Uncertainty | None = None,
) -> Block:
    """Return one operating point at ``count`` evenly spaced angles.

    ``draw`` is seed and index, with ``base`` as for ``sim.statistics.expectation.even_phases``.
    """
    phases = even_phases(count, *draw, base)
    angles = tuple((phases * clutch.dog.pitch_angle).tolist())
    variants = uncertainty.variants(point, count, *draw, base) if uncertainty else ()
    return Block(clutch, point, angles, draw[0], variants)


def listed_blocks(
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    angles: tuple[float, ...],
    seed: int,
    uncertainty: Uncertainty | None = None,
) -> list[Block]:
    """Return a block for each operating point at given ``angles`` in rad.

    ``seed`` is that of what is uncertain.
    """
    count = len(angles)
    return [
        Block(
            clutch,
            point,
            angles,
            variants=uncertainty.variants(point, count, seed, index) if uncertainty else (),
        )
        for index, point in enumerate(points)
    ]
