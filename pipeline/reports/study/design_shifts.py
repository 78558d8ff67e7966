"""The shifts of single designs, out of the journal of a study."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.simulate.evaluation import FRESH
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.shift_records import Record, clutch_record, content_key
from dogshape.sim.units import RPM

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shifts:
    """Finished shifts of a study by design, those repeated with a finer tolerance left out."""

    study: Study
    rows: tuple[Record, ...]
    groups: dict[str, list[Record]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        keys = tuple(clutch_record(self.study.clutch))
        groups: dict[str, list[Record]] = {}
        for row in self.rows:
            if row["outcome"] != Outcome.DIVERGED.value:
                groups.setdefault(content_key({key: row[key] for key in keys}), []).append(row)
        object.__setattr__(self, "groups", groups)

    def of(self, design: dict[str, float]) -> list[Record]:
        """Return the shifts of a design, given in edge units."""
        clutch = self.study.clutch.with_dog(self.study.dog_with(design))
        return self.groups.get(content_key(clutch_record(clutch)), [])

    def searched(self, design: dict[str, float]) -> list[Record]:
        """Return the shifts at the angles of the search."""
        return self._drawn(design, self.study.file.expectation.seed)

    def fresh(self, design: dict[str, float]) -> list[Record]:
        """Return the shifts at the angles of the confirmation, that the search did not use."""
        return self._drawn(design, self.study.file.expectation.seed + FRESH)

    def _drawn(self, design: dict[str, float], seed: int) -> list[Record]:
        return [row for row in self.of(design) if row.get("seed") == seed]


def read_shifts(study: Study, journal: ShiftJournal) -> Shifts:
    """Return the shifts of a journal."""
    return Shifts(study, tuple(journal.rows.values()))


def time_of(row: Record) -> float:
    """Return the time of a shift, s; infinite where it did not engage."""
    time = row["shift_time_s"]
    return math.inf if time is None else float(time)


def extremes(rows: Iterable[Record]) -> tuple[Record, Record] | None:
    """Return the fastest and the slowest of some shifts; None where there are none.

    A shift that does not engage is slower than any that does, and a blocked one the slowest.
    """

    def order(row: Record) -> tuple[float, bool, str]:
        return time_of(row), row["outcome"] == Outcome.BLOCKED.value, row["key"]

    ordered = sorted(rows, key=order)
    return (ordered[0], ordered[-1]) if ordered else None


def weights_of(study: Study, rows: Sequence[Record]) -> Array:
    """Return the weight of each shift (n,), of sum one: its operating point's, shared evenly."""
    given = {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}
    places = [place(row["mismatch_rpm"], row["force_N"]) for row in rows]
    counts = {one: places.count(one) for one in set(places)}
    weights = np.array([given.get(one, 0.0) / counts[one] for one in places])
    total = float(weights.sum())
    return weights / total if total > 0.0 else weights


def place(mismatch_rpm: float, force_N: float) -> tuple[str, str]:
    """Return an operating point as a key that rounding does not reach."""
    return f"{mismatch_rpm:.9g}", f"{force_N:.9g}"


def quantile(times: Array, weights: Array, share: float) -> float:
    """Return the least time within which a share of shifts is done, s; times (n,), weights (n,)."""
    order = np.argsort(times)
    reached = np.cumsum(weights[order])
    place = int(np.searchsorted(reached, share * reached[-1] * (1.0 - 1e-12)))
    return float(times[order][min(place, len(times) - 1)])
