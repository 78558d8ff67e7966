"""Set values that nearly agree: measured ones, which make one operating point into many.

What an operating point errs by is common to its shifts (the model, the emulator, an odd entry), so
shifts that a table spreads over many nearly equal points would count as so many independent ones,
and each point would be simulated by itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dogshape.diagnosis.bench.table import Row
from dogshape.diagnosis.terms import Array

NEAR = 0.01  #: of a set value, up to which two are those of one operating point


def near_points(rows: Sequence[Row]) -> dict[int, int]:
    """Return the places of rows whose set values are nearly those of another row, with its place.

    The others are those with the most shifts.
    """
    values = _set_values(rows)
    _, first, which = np.unique(values, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    shifts = np.bincount(which, weights=[row.n for row in rows])
    leaders = list[int]()
    found: dict[int, int] = {}
    for one in np.lexsort((first, -shifts)).tolist():
        place = int(first[one])
        near = [k for k in leaders if _alike(values[k], values[place])]
        if not near:
            leaders.append(place)
            continue
        found |= dict.fromkeys(np.flatnonzero(which == one).tolist(), near[0])
    return found


def joined_values(rows: Sequence[Row]) -> list[tuple[float, float, float]]:
    """Return mismatch, force and rise time of each row, the mean of its operating point's shifts.

    Rows with nearly the same set values are one point.
    """
    values, near = _set_values(rows), near_points(rows)
    groups: dict[tuple[float, ...], list[int]] = {}
    for place in range(len(rows)):
        groups.setdefault(tuple(values[near.get(place, place)].tolist()), []).append(place)
    whole = values.copy()
    for places in groups.values():
        mine = values[places]
        if (mine != mine[0]).any():
            whole[places] = np.average(mine, axis=0, weights=[rows[k].n for k in places])
    return [(float(n), float(force), float(rise)) for n, force, rise in whole]


def _set_values(rows: Sequence[Row]) -> Array:
    return np.array([(row.mismatch, row.force, row.rise) for row in rows])


def _alike(one: Array, other: Array) -> bool:
    size = np.maximum(abs(one), abs(other))
    return bool((abs(one - other) <= NEAR * size).all())
