"""Shifts of a design whose operation is searched, as the search sees them.

To a search set-point, force and rise time are variables of the design, and an operating point is
one of the study's own. A shift of such a design has the moved point in its record instead. The
surrogate learns from records in which both stand as the search has them, so that designs that are
operated differently meet at the same points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import RPM


def as_searched(
    operation: Mapping[str, float], point: OperatingPoint, shifts: Sequence[Record]
) -> Sequence[Record]:
    """Rewrite the shifts of one operating point to the study's own ``point`` and ``operation``.

    They stay as they are where no operation is searched.
    """
    if not operation:
        return shifts
    own = {"mismatch_rpm": point.mismatch / RPM, **point.profile.record, **operation}
    return [{**shift, **own} for shift in shifts]
