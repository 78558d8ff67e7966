"""Blocks of work: one clutch at one operating point with its relative angles.

A block is a value that can be sent to another process; ``sim.batch`` simulates it there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sim.clutch import Clutch, OperatingPoint
from sim.expectation import Phases, even_phases
from sim.records import content_key, inputs


@dataclass(frozen=True)
class Block:
    """One clutch at one operating point, at relative angles in rad.

    ``seed`` is that of the angles' draw, None where they were given.
    """

    clutch: Clutch
    point: OperatingPoint
    angles: tuple[float, ...]
    seed: int | None = None

    @property
    def keys(self) -> list[str]:
        """Content keys of the block's shifts, in the order of the angles."""
        return [content_key(inputs(self.clutch, self.point, angle)) for angle in self.angles]


def even_blocks(
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    count: int,
    seed: int,
    base: int | None = None,
) -> list[Block]:
    """Return a block for each operating point, at ``count`` evenly spaced angles of its own.

    ``seed`` and ``base`` as for ``sim.expectation.even_phases``.
    """
    phases = (even_phases(count, seed, index, base) for index in range(len(points)))
    return [phased_block(clutch, *both, seed) for both in zip(points, phases, strict=True)]


def phased_block(clutch: Clutch, point: OperatingPoint, phases: Phases, seed: int) -> Block:
    """Return a block at ``phases`` of a pitch, (n,), that were drawn with ``seed``."""
    return Block(clutch, point, tuple((phases * clutch.dog.pitch_angle).tolist()), seed)
