"""Shifts of a journal that a file of banks has too, which the journal need not keep.

A row does not say which series it is of. So rows are gathered that differ by the angle alone; they
are a series of the file where they are as many as it has, evenly over one pitch, from the same
first shift. Baselines stay: a bank at more operating points repeats some of their shifts for its
numerical error, for which a time alone is not enough.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dogshape.diagnosis.prediction.bank_store import key_from
from dogshape.sim.statistics.shift_records import Record

ANGLE = "relative_angle_deg"
LAST = "outcome"  #: key of a row before which its inputs stand
SAME = 1e-6  #: of a pitch, by which rounded angles may differ


def held_shifts(rows: Iterable[Record], series: Mapping[str, Mapping[str, Any]]) -> set[str]:
    """List the keys of shifts that ``series`` of a file of banks have, without the baselines'."""
    held: set[str] = set()
    for mine in _gathered(rows):
        found = series.get(key_from(mine[0]["key"], len(mine)))
        if found is not None and "numerics" not in found and _even(mine):
            held.update(row["key"] for row in mine)
    return held


def _gathered(rows: Iterable[Record]) -> list[list[Record]]:
    """Gather rows that differ by the angle alone, each in the order of it."""
    gathered: dict[str, list[Record]] = {}
    for row in rows:
        gathered.setdefault(json.dumps(_bare(row)), []).append(row)
    return [sorted(mine, key=_angle) for mine in gathered.values()]


def _bare(row: Record) -> list[tuple[str, Any]]:
    """List the inputs of a shift without its angle."""
    every = list(row.items())
    end = list(row).index(LAST)
    return [(name, value) for name, value in every[:end] if name not in ("key", ANGLE)]


def _angle(row: Record) -> float:
    return float(row[ANGLE])


def _even(rows: Sequence[Record]) -> bool:
    """Test that rows are evenly spaced over one pitch."""
    step = 360.0 / float(rows[0]["count"]) / len(rows)
    first = _angle(rows[0])
    return all(
        math.isclose(_angle(row) - first, place * step, abs_tol=SAME * step)
        for place, row in enumerate(rows)
    )
