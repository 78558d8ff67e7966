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
from dogshape.sim.statistics.shift_records import Record, angle_of, quantity_of, result_of

if TYPE_CHECKING:
    import pandas as pd


POINT_KEYS = ("mismatch_rpm", "force_N", "force_rise_s")  #: keys of an operating point
#: Columns of a row beside the design's variables, in edge units.
COLUMNS = (
    *POINT_KEYS[:2],
    *("mean_s", "standard_error_s", "sd_s", "engaged", "shifts", "seed"),
)
DECIMALS = 9  #: of an input in a row: its way through SI may cost the last digits
NO_SEED = -1  #: seed in a row of angles that were given and not drawn
MIN_SHIFTS = 3  #: of a row
POINT_TOLERANCE = 1e-6  #: of equal operating points, 1/min and N
WEIGHT_TOLERANCE = 1e-9  #: of equal weights


@dataclass(frozen=True)
class Mix:
    """Weighted operating points."""

    points: Array  #: mismatch, 1/min, and force, N, (q, 2)
    weights: Array  #: of sum one, (q,)
    retry: float  #: time that a shift which does not engage costs, s

    def match(self, points: Array) -> Mask:
        """Mark which points of the mix equal points (p, 2), (p, q) of bool."""
        difference = np.abs(points[:, None, :] - self.points)
        return np.asarray((difference < POINT_TOLERANCE).all(axis=2), dtype=bool)

    def equals(self, mix: Mix) -> bool:
        """Test whether a mix has equal points, in equal order, and equal weights."""
        return (
            self.points.shape == mix.points.shape
            and np.allclose(self.points, mix.points, rtol=0.0, atol=POINT_TOLERANCE)
            and np.allclose(self.weights, mix.weights, atol=WEIGHT_TOLERANCE)
        )


@dataclass(frozen=True)
class Grid:
    """Designs that were simulated at every point of a mix."""

    x: Array  #: designs, (n, d), edge units
    means: Array  #: mean time of a shift that engages, s, (n, q); NaN where none does
    errors: Array  #: standard error of the mean, s, (n, q)
    sds: Array  #: standard deviation of a shift, s, (n, q)
    engaged: Array  #: number of shifts that engaged, by their share of the pitch, (n, q)
    shifts: Array  #: number of simulated shifts, (n, q)

    def subset(self, designs: Any) -> Grid:
        """Select designs by indices or by a mask, (n,)."""
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
        import pandas as pd  # noqa: PLC0415  slow to load, and a prediction does without

        grid = self.grid
        designs = np.repeat(grid.x, len(self.mix.points), axis=0)
        table = pd.DataFrame(designs, columns=list(self.variables))
        table[list(COLUMNS[:2])] = np.tile(self.mix.points, (len(self), 1))
        values = grid.means, grid.errors, grid.sds, grid.engaged, grid.shifts
        table[list(COLUMNS[2:7])] = np.stack(values, axis=2).reshape(-1, 5)
        integers = {name: int for name in ("count", "shifts") if name in table}
        origin = {"contact_set": self.physics.get("contact_set"), **self.engine}
        return table.astype(integers).assign(**origin)


def grid_of(rows: Array, mix: Mix) -> Grid:
    """Collect the designs of rows (n, d + 8) that have every point of a mix, in sorted order.

    Equal rows count once; rows of several seeds at one point are weighted by their shifts.
    """
    rows = np.unique(np.nan_to_num(rows, nan=0.0), axis=0)
    width = rows.shape[1] - len(COLUMNS)
    x, design = np.unique(rows[:, :width], axis=0, return_inverse=True)
    row, point = np.nonzero(mix.match(rows[:, width : width + 2]))
    mean, error, sd, engaged, shifts = rows[row, width + 2 : width + 7].T
    terms = [shifts, engaged, engaged * mean, (engaged * error) ** 2, engaged * sd**2]
    sums = np.zeros((len(x), len(mix.points), len(terms)))
    np.add.at(sums, (design.ravel()[row], point), np.column_stack(terms))
    complete = (sums[:, :, 0] > 0).all(axis=1)
    shifts, engaged, time, variance, spread = np.moveaxis(sums[complete], 2, 0)
    with np.errstate(invalid="ignore"):
        return Grid(
            x=x[complete],
            means=time / engaged,
            errors=variance**0.5 / engaged,
            sds=(spread / engaged) ** 0.5,
            engaged=engaged,
            shifts=shifts,
        )


def row_of(design: Sequence[float], shifts: Sequence[Record]) -> list[float] | None:
    """Summarise shifts of a design at one operating point and of one seed as a row.

    ``design`` is in edge units. None for fewer than ``MIN_SHIFTS`` shifts, and for drawn angles
    that are not even, as of a draw that was cut off.
    """
    ordered = sorted(shifts, key=lambda shift: angle_of(shift).relative_angle_deg)
    angles = np.array([angle_of(shift).relative_angle_deg for shift in ordered])
    seed = shifts[0].get("seed")
    pitch = 360.0 / angle_of(shifts[0]).dogs
    gaps = np.diff(angles, append=angles[:1] + pitch)
    even = bool(np.allclose(gaps, pitch / len(ordered), rtol=1e-6))
    if len(ordered) < MIN_SHIFTS or (seed is not None and not even):
        return None
    results = [result_of(shift) for shift in ordered]
    valid_count = sum(result.outcome is not Outcome.DIVERGED for result in results)
    times = np.array([r.shift_time for r in results if r.shift_time is not None])
    mean = error = np.nan
    sd = 0.0
    if len(times) > 0:
        mean = float(times.mean())
        error = variance_of_mean(times, even=even and len(times) == len(ordered)) ** 0.5
    if len(times) > 1:
        sd = float(times.std(ddof=1))
    point = [round(ordered[0][key], DECIMALS) for key in POINT_KEYS[:2]]
    seed = NO_SEED if seed is None else seed
    return [*design, *point, mean, error, sd, len(times), valid_count, seed]


def rows_of(variables: Sequence[str], shifts: Iterable[Record]) -> Array:
    """Summarise shifts by design, operating point and seed as rows, (n, d + 8)."""
    groups: dict[tuple[Any, ...], list[Record]] = defaultdict(list)
    for shift in shifts:
        values = _round_values(shift, (*variables, *POINT_KEYS))
        groups[values, shift.get("seed")].append(shift)
    rows = []
    for (values, _), group in groups.items():
        row = row_of(values[: len(variables)], group)
        if row is not None:
            rows.append(row)
    return np.array(rows, dtype=float).reshape(-1, len(variables) + len(COLUMNS))


def _round_values(shift: Record, keys: Sequence[str]) -> tuple[float, ...]:
    """Return values of a shift, or their defaults, to ``DECIMALS`` decimals."""
    return tuple(round(quantity_of(shift, key), DECIMALS) for key in keys)
