"""Simulated designs as data of the surrogate: times of each at every operating point of a study.

A row is one design at one operating point. A ``Dataset`` collects the rows of designs that have
every point of a ``Mix``, all of the same physics. Times are those of shifts that engage: one shift
in some hundreds may hang crest on crest and cost a second, and a mean would depend on that draw.
Shares engaged have a model of their own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import DEFAULTS, Record, result_of

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
class Mix:
    """Operating points (mismatch in 1/min and force in N, (q, 2)) with weights of sum one, (q,)."""

    points: Array
    weights: Array
    retry: float  #: time that a shift which does not engage costs, s

    def places(self, points: Array) -> Mask:
        """Mark which of these points each of others (p, 2) is, (p, q) of bool."""
        return np.asarray((np.abs(points[:, None, :] - self.points) < 1e-6).all(axis=2), dtype=bool)

    def equals(self, other: Mix) -> bool:
        """Check whether another mix has the same points in their order, and their weights."""
        return (
            self.points.shape == other.points.shape
            and np.allclose(self.points, other.points, rtol=0.0, atol=1e-6)
            and np.allclose(self.weights, other.weights, atol=1e-9)
        )


@dataclass(frozen=True)
class Grid:
    """Designs that were simulated at every point of a mix."""

    x: Array  #: designs, (n, d), edge units
    means: Array  #: mean time of a shift that engages, s, (n, q); NaN where none does
    errors: Array  #: its standard error, s, (n, q)
    sds: Array  #: standard deviation of a shift, s, (n, q)
    engaged: Array  #: number that engaged, by their share of the pitch, (n, q)
    shifts: Array  #: number that were made, (n, q)

    def subset(self, designs: Any) -> Grid:
        """Give the designs at places, or of a mask, alone."""
        return Grid(*(getattr(self, field.name)[designs] for field in fields(self)))


@dataclass(frozen=True)
class Dataset:
    """Simulated designs with the search range of each variable, (d,), edge units."""

    variables: tuple[str, ...]
    low: Array
    high: Array
    physics: Record  #: everything else that a shift depends on
    engine: Record  #: versions of the programs
    mix: Mix
    grid: Grid

    def __len__(self) -> int:
        return len(self.grid.x)

    @property
    def shifts(self) -> int:
        """Number of simulated shifts behind the data."""
        return int(self.grid.shifts.sum())

    @property
    def engaging(self) -> Grid:
        """Designs that engage at every point."""
        return self.grid.subset(np.isfinite(self.grid.means).all(axis=1))

    def scaled(self, x: Array) -> Array:
        """Scale designs (m, d) to the unit cube of the search range."""
        return (np.atleast_2d(x) - self.low) / (self.high - self.low)

    def frame(self) -> pd.DataFrame:
        """Return a row for each design and operating point, with contact set and versions."""
        import pandas as pd  # noqa: PLC0415  slow to load, and asking does without

        each, grid = np.repeat(self.grid.x, len(self.mix.points), axis=0), self.grid
        table = pd.DataFrame(each, columns=list(self.variables))
        table[list(COLUMNS[:2])] = np.tile(self.mix.points, (len(self), 1))
        values = grid.means, grid.errors, grid.sds, grid.engaged, grid.shifts
        table[list(COLUMNS[2:7])] = np.stack(values, axis=2).reshape(-1, 5)
        whole = {name: int for name in ("count", "shifts") if name in table}
        known = {"contact_set": self.physics.get("contact_set"), **self.engine}
        return table.astype(whole).assign(**known)


def grid_of(rows: Array, mix: Mix) -> Grid:
    """Collect the designs of rows (n, d + 8) that have every point of a mix, in sorted order.

    A row counts once; rows of several seeds at one point count by their shifts.
    """
    rows = np.unique(np.nan_to_num(rows, nan=0.0), axis=0)
    cut, size = rows.shape[1] - len(COLUMNS), len(mix.points)
    x, design = np.unique(rows[:, :cut], axis=0, return_inverse=True)
    row, point = np.nonzero(mix.places(rows[:, cut : cut + 2]))
    mean, error, sd, good, made = rows[row, cut + 2 : cut + 7].T
    sums = np.zeros((len(x), size, 5))
    parts = np.column_stack([made, good, good * mean, (good * error) ** 2, good * sd**2])
    np.add.at(sums, (design.ravel()[row], point), parts)
    whole = (sums[:, :, 0] > 0).all(axis=1)
    shifts, engaged, time, variance, spread = np.moveaxis(sums[whole], 2, 0)
    with np.errstate(invalid="ignore"):
        means, errors, sds = time / engaged, variance**0.5 / engaged, (spread / engaged) ** 0.5
    return Grid(x[whole], means, errors, sds, engaged, shifts)


def row_of(design: Sequence[float], shifts: Sequence[Record]) -> list[float] | None:
    """Return the row of a design's shifts at one operating point and of one seed.

    ``design`` in edge units. None for fewer than three shifts, and for a draw of even angles that
    was cut off.
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
    mean, error, sd = np.nan, np.nan, 0.0
    if len(times) > 0:
        mean = float(times.mean())
        error = variance_of_mean(times, even=even and len(times) == len(ordered)) ** 0.5
    if len(times) > 1:
        sd = float(times.std(ddof=1))
    where = (round(first[name], DIGITS) for name in WHERE[:2])
    return [*design, *where, mean, error, sd, len(times), sound, GIVEN if seed is None else seed]


def rows_of(variables: Sequence[str], shifts: Iterable[Record]) -> Array:
    """Return the rows of many shifts, grouped by design, operating point and seed, (n, d + 8)."""
    groups: dict[tuple[Any, ...], list[Record]] = defaultdict(list)
    for shift in shifts:
        design, where = (
            tuple(round(float(shift[n] if n in shift else DEFAULTS[n]), DIGITS) for n in names)
            for names in (variables, WHERE)
        )
        groups[design, where, shift.get("seed")].append(shift)
    found = (row_of(design, group) for (design, _, _), group in groups.items())
    rows = [row for row in found if row is not None]
    return np.array(rows, dtype=float).reshape(-1, len(variables) + len(COLUMNS))
