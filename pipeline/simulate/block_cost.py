r"""Likely cost of a shift by its operating point, before it is simulated.

Slow shifts slide for long on faces, fast ones skip slots and strike often. So a shift takes least
at some 40 1/min and more on either side:

.. math:: c \propto (m_0/|m|)^a \;\text{below}\; m_0, \qquad
   c \propto (|m|/m_0)^b\,(F_0/F)^e \;\text{above}

with the mismatch *m* and the shift force *F*. The powers are a least squares fit to the processor
time of the prototype's shifts at the 28 operating points of the published study; of the scatter of
the logarithms, 0.34 in Drake and 0.19 in the compiled engine, 0.13 and 0.08 are left. Another
clutch has others. Shifts with a smaller tolerance take longer, and those with the mismatch
reversed, in which braking flanks lead (``dearness``). No result depends on it: it says which blocks
go first, so that a round ends evenly, and what a part of the work says of the time of the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dogshape.sim.statistics.blocks import Block
from dogshape.sim.units import RPM

EASY = 40.0 * RPM  #: mismatch of the shifts that take least, rad/s
SLOWEST = 1.0 * RPM  #: below it a shift takes no longer, rad/s
FORCE = 400.0  #: N


@dataclass(frozen=True)
class Powers:
    """Powers of the cost: of slow mismatches, of fast ones, and of the force there."""

    slow: float
    fast: float
    force: float


POWERS = {"drake": Powers(0.44, 0.47, 0.48), "planar": Powers(0.15, 0.28, 0.31)}


FINE, REVERSED = 2.2, 1.4  #: cost over that of the same shift as usual; measured, as above


def dearness(block: Block) -> float:
    """Return the cost of a shift of a block over that of a usual one at its operating point."""
    return (FINE if block.fine else 1.0) * (REVERSED if block.point.mismatch < 0.0 else 1.0)


def likely_cost(block: Block) -> float:
    """Return the likely cost of a shift of a block over that of the easiest one."""
    return dearness(block) * _at_point(block)


def _at_point(block: Block) -> float:
    by = POWERS["planar" if block.clutch.solver.engine == "planar" else "drake"]
    mismatch = max(abs(block.point.mismatch), SLOWEST)
    if mismatch < EASY:
        return float((EASY / mismatch) ** by.slow)
    return float((mismatch / EASY) ** by.fast * (FORCE / block.point.profile.force) ** by.force)


def dearest_first(blocks: Sequence[Block]) -> list[Block]:
    """Order blocks by their likely cost, so that workers end a round together."""
    return sorted(blocks, key=lambda block: -likely_cost(block) * len(block.angles))


def mean_cost(blocks: Sequence[Block]) -> float:
    """Return the likely cost of a shift at the points of some blocks, in the mean; 1 without any.

    It is that of shifts as usual, so that dearer ones count for more of them.
    """
    shifts = sum(len(block.angles) for block in blocks)
    whole = sum(_at_point(block) * len(block.angles) for block in blocks)
    return whole / shifts if shifts else 1.0
