"""Set values that nearly agree: measured ones, which make one operating point into many.

Errors of an operating point are common to its shifts (the model, the emulator, an odd entry), so
shifts that a table spreads over many nearly equal points would count as so many independent ones,
and each point would be simulated by itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dogshape.diagnosis.bench.table import Row
from dogshape.diagnosis.terms import Array

NEAR = 0.01  #: of a set value, up to which two are those of one operating point
SCATTER = 0.2  #: of a set value, up to which measured values lie off it
APART = 2.0  #: times the largest gap within groups of measured values, the least gap between them
DENSE = 0.09  #: of a set value, the largest gap between neighbours among its measured values
EACH = 3  #: measured values of a group, on average at least


def _joined_rows(values: Array) -> Array:
    """Number the groups of rows of which each is near another one, (rows,)."""
    from scipy.sparse import coo_array  # noqa: PLC0415  # slow to load, and few tables need it
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415
    from scipy.spatial import KDTree  # noqa: PLC0415

    unique, which = np.unique(values, axis=0, return_inverse=True)
    # A share of the larger value is a distance of logarithms; signs lie far apart.
    place = np.log(np.maximum(abs(unique), 1e-9)) + 100.0 * (unique < 0.0)
    near = -np.log1p(-NEAR) * (1.0 + 1e-9)
    pairs = KDTree(place).query_pairs(near, p=np.inf, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(unique),) * 2)
    found: Array = connected_components(links, directed=False)[1][which.ravel()]
    return found


def near_points(rows: Sequence[Row]) -> dict[int, int]:
    """Map rows whose set values are nearly those of other rows to such a row, by their places.

    The other row is that whose set values have the most shifts.
    """
    values = _set_values(rows)
    groups = _joined_rows(values)
    _, first, which = np.unique(values, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    shifts = np.bincount(which, weights=[row.n for row in rows])
    found: dict[int, int] = {}
    for group in np.unique(groups).tolist():
        places = np.flatnonzero(groups == group)
        lead = min(set(which[places].tolist()), key=lambda k: (-shifts[k], first[k]))
        found |= {int(k): int(first[lead]) for k in places if which[k] != lead}
    return found


def joined_values(rows: Sequence[Row]) -> list[tuple[float, float, float]]:
    """Compute mismatch, force and rise time of each row, the mean of its operating point's shifts.

    Rows with nearly the same set values are one point, as are points with nearly the same means.
    """
    values = _set_values(rows)
    weights = np.array([row.n for row in rows], dtype=float)
    groups, before = _joined_rows(values), 0
    while (count := int(groups.max()) + 1) != before:
        for group in range(count):
            mine = groups == group
            if (values[mine] != values[mine][0]).any():
                values[mine] = np.average(values[mine], axis=0, weights=weights[mine])
        before, groups = count, _joined_rows(values)
    return [(float(n), float(force), float(rise)) for n, force, rise in values]


def _set_values(rows: Sequence[Row]) -> Array:
    return np.array([(row.mismatch, row.force, row.rise) for row in rows])


def set_values(
    measured: Sequence[float], known: Sequence[float]
) -> tuple[Array, float, float] | None:
    """Group measured values about set values; None where they are no measured ones.

    Values are parted where gaps between neighbours jump. A group has the ``known`` set value that
    its mean agrees with, or else its mean. Round values are set values, and so are few that recur.
    Also returns the scatter, absolute and as a share.
    """
    values = np.array(measured, dtype=float)
    distinct, often = np.unique(values, return_counts=True)
    if distinct.size < 3 or all(v == float(f"{v:.2g}") or v % 5.0 == 0.0 for v in distinct):
        return None
    place = np.sign(distinct) * (20.0 + np.log(np.maximum(abs(distinct), 1e-9)))
    gaps = np.sort(np.diff(place))
    jumps = gaps[1:] / np.maximum(gaps[:-1], 1e-3)
    at = int(jumps.argmax())
    limit = (gaps[at] * gaps[at + 1]) ** 0.5 if jumps[at] >= APART else np.inf
    which = np.append(0, np.cumsum(np.diff(place) > limit))[np.searchsorted(distinct, values)]
    levels = np.array([_level(values[which == k], known) for k in range(which.max() + 1)])
    off = values - levels[which]
    least = 4 if (often > 1).mean() > 0.7 else 0
    dense = all(gap <= DENSE for gap in np.diff(place) if gap <= limit)
    few = levels.size * EACH > values.size or distinct.size < least * levels.size
    if few or not dense or not off.any() or max(abs(off / levels[which])) > SCATTER:
        return None
    freed = values.size - levels.size
    size, share = (float(np.sqrt((d**2).sum() / freed)) for d in (off, off / levels[which]))
    return levels[which], size, share


def _level(values: Array, known: Sequence[float]) -> float:
    """Give the set value of a group: the known one that its mean agrees with, or the mean."""
    mean, error = float(values.mean()), float(values.std() / values.size**0.5)
    near = min(known, key=lambda one: abs(one - mean), default=np.inf)
    return near if abs(near - mean) <= 0.02 * abs(mean) + 3.0 * error else float(f"{mean:.4g}")
