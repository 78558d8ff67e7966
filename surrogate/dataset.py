"""Simulated operating points as data of the surrogate: one row a design at a point.

A row holds what the shifts of one design at one operating point gave: mean of those that
engaged, its standard error, their standard deviation, how many engaged of how many, and the
seed that drew their angles. Rows of different physics never meet in one data set.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.sim.errors import DataError
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import Record, content_key, result_of
from dogshape.surrogate.covariance import Array, Mask, Places

if TYPE_CHECKING:
    import pandas as pd

#: Columns of a row beside the design's variables, in edge units.
COLUMNS = (
    "mismatch_rpm", "force_N", "mean_s", "standard_error_s", "sd_s", "engaged", "shifts", "seed",
)  # fmt: skip
WHERE = ("mismatch_rpm", "force_N", "force_rise_s")  #: what an operating point is
DIGITS = 9  #: decimals of an input in a row: its way through SI may cost the last digits
GIVEN = -1  #: stands for the seed of angles that were given and not drawn


@dataclass(frozen=True)
class Dataset:
    """Rows of simulated operating points.

    Parameters
    ----------
    variables : names of the d design variables, in edge units.
    low, high : search range of each variable, (d,).
    rows : designs and then ``COLUMNS``, (n, d + 8); the mean is NaN where none engaged.
    physics : everything else that a shift depends on; rows share it.
    engine : versions of the programs that simulated the rows.
    levels : of rows in two levels, how many shifts each engine has and what corrects the compiled
        one (``surrogate.discrepancy``); empty where the rows are of one engine.
    """

    variables: tuple[str, ...]
    low: Array
    high: Array
    rows: Array
    physics: Record
    engine: Record
    levels: Record = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.rows)

    def column(self, name: str) -> Array:
        """Return one of ``COLUMNS``, (n,)."""
        return self.rows[:, len(self.variables) + COLUMNS.index(name)]

    @property
    def x(self) -> Array:
        """Designs, (n, d), edge units."""
        return self.rows[:, : len(self.variables)]

    @property
    def points(self) -> Array:
        """Mismatch in 1/min and force in N, (n, 2)."""
        cut = len(self.variables)
        return self.rows[:, cut : cut + 2]

    @cached_property
    def designs(self) -> Array:
        """Distinct designs, (k, d)."""
        return self._distinct[0]

    @cached_property
    def design_of_row(self) -> Places:
        """Place of each row's design in ``designs``, (n,)."""
        return self._distinct[1]

    @cached_property
    def _distinct(self) -> tuple[Array, Places]:
        designs, places = np.unique(self.x, axis=0, return_inverse=True)
        return designs, places.ravel()

    @property
    def shifts(self) -> int:
        """Number of simulated shifts behind the rows."""
        return int(self.column("shifts").sum())

    def scaled(self, x: Array) -> Array:
        """Scale designs (m, d) to the unit cube of the search range."""
        return (np.atleast_2d(x) - self.low) / (self.high - self.low)

    def subset(self, rows: Any) -> Dataset:
        """Return the data set with only ``rows``: places or (n,) of bool."""
        return replace(self, rows=self.rows[rows])

    def joined(self, other: Dataset) -> Dataset:
        """Return both sets of rows, each once, scaled as this one.

        DataError where physics or programs differ.
        """
        if self.variables != other.variables:
            raise DataError(
                f"rows over {', '.join(other.variables)} cannot join rows over "
                f"{', '.join(self.variables)}; fit them apart"
            )
        for kind, mine, theirs in (
            ("physics", self.physics, other.physics),
            ("programs", self.engine, other.engine),
            ("levels", self.levels, other.levels),
        ):
            if apart := differences(mine, theirs):
                raise DataError(
                    f"rows of different {kind} cannot be mixed: {apart}; fit them apart"
                )
        return replace(self, rows=once(np.concatenate([self.rows, other.rows])))

    @property
    def digest(self) -> str:
        """Hash of rows and physics."""
        content = np.ascontiguousarray(self.rows).tobytes()
        return hashlib.sha256(content + content_key(self.physics).encode()).hexdigest()[:20]

    def frame(self) -> pd.DataFrame:
        """Return the rows as a table with contact set and versions."""
        import pandas as pd  # noqa: PLC0415  slow to load, and asking does without

        table = pd.DataFrame(self.rows, columns=[*self.variables, *COLUMNS])
        whole = {c: int for c in ("count", "engaged", "shifts", "seed") if c in table}
        known = {"contact_set": self.physics.get("contact_set"), **self.engine}
        return table.astype(whole).assign(**known)


def once(rows: Array) -> Array:
    """Return each of the rows (n, k) once, in their order."""
    first = np.unique(np.nan_to_num(rows, nan=-1.0), axis=0, return_index=True)[1]
    return rows[np.sort(first)]


def among(x: Array, designs: Array) -> Mask:
    """Mark the rows of x (n, d) that equal one of the designs (k, d), (n,) of bool."""
    return (x[:, None, :] == designs[None, :, :]).all(axis=2).any(axis=1)


def differences(mine: Record, theirs: Record) -> str:
    """List the first three keys in which two records differ."""
    keys = [
        k
        for k in {**mine, **theirs}
        if content_key({"v": mine.get(k)}) != content_key({"v": theirs.get(k)})
    ]
    parts = [f"{k} is {_said(mine, k)} here and {_said(theirs, k)} there" for k in keys[:3]]
    return ", ".join(parts) + (f", and {len(keys) - 3} more" if len(keys) > 3 else "")


def _said(record: Record, key: str) -> Any:
    return record.get(key, "absent")


def row_of(design: Sequence[float], shifts: Sequence[Record]) -> list[float] | None:
    """Return the row of a design's shifts at one operating point and of one seed.

    ``design`` in edge units. None for fewer than three shifts, and for angles that lack a part
    of an evenly spaced draw: a run that was cut off says nothing of the mean yet.
    """
    ordered = sorted(shifts, key=lambda shift: float(shift["relative_angle_deg"]))
    angles = np.array([shift["relative_angle_deg"] for shift in ordered])
    seed, pitch = shifts[0].get("seed"), 360.0 / shifts[0]["count"]
    gaps = np.diff(angles, append=angles[:1] + pitch)
    even = bool(np.allclose(gaps, pitch / len(ordered), rtol=1e-6))
    if len(ordered) < 3 or (seed is not None and not even):
        return None
    first, results = ordered[0], [result_of(shift) for shift in ordered]
    sound = sum(result.outcome is not Outcome.DIVERGED for result in results)
    times = np.array([r.shift_time for r in results if r.shift_time is not None])
    mean = error = np.nan
    if len(times) > 0:
        mean = float(times.mean())
        error = variance_of_mean(times, even=even and len(times) == len(ordered)) ** 0.5
    sd = float(times.std(ddof=1)) if len(times) > 1 else 0.0
    origin = GIVEN if seed is None else seed
    return [
        *design, *(round(first[name], DIGITS) for name in WHERE[:2]), mean, error, sd,
        len(times), sound, origin,
    ]  # fmt: skip


def rows_of(variables: Sequence[str], shifts: Iterable[Record]) -> Array:
    """Return the rows of many shifts, grouped by design, operating point and seed, (n, d + 8)."""
    groups: dict[tuple[Any, ...], list[Record]] = defaultdict(list)
    for shift in shifts:
        design = tuple(round(float(shift[name]), DIGITS) for name in variables)
        where = tuple(round(shift[name], DIGITS) for name in WHERE)
        groups[design, where, shift.get("seed")].append(shift)
    found = [row_of(design, group) for (design, _, _), group in groups.items()]
    rows = [row for row in found if row is not None]
    return np.array(rows, dtype=float).reshape(-1, len(variables) + len(COLUMNS))
