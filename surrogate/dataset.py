"""Simulated operating points as data of the surrogate: one row a design at a point.

A row holds what the shifts of one design at one operating point gave: mean of those that
engaged, its standard error, their standard deviation, how many engaged of how many, and the
seed that drew their angles. Rows of different physics never meet in one data set.

A ``Mix`` of operating points says where a clutch is shifted, and how often.

A ``Reference`` holds expected times from the simulation, to judge the surrogate. Times are those of
shifts that engage. One shift in some hundreds may hang crest on crest and cost a second. Dense
simulations of a design hold one such shift or none, and their mean would depend on that draw.
Shares engaged are compared by their counts instead, over all references.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import Record, content_key, result_of
from dogshape.sim.units import RPM
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
    """

    variables: tuple[str, ...]
    low: Array
    high: Array
    rows: Array
    physics: Record
    engine: Record

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


@dataclass(frozen=True)
class Mix:
    """Operating points with weights that add up to one.

    Parameters
    ----------
    points : mismatch in 1/min and force in N, (m, 2).
    weights : (m,).
    retry : time that a shift which does not engage costs, s.
    """

    points: Array
    weights: Array
    retry: float

    def at(self, index: int) -> Mix:
        """Return the mix that is one of the points alone."""
        return Mix(self.points[index : index + 1], np.ones(1), self.retry)


def mix_of(points: Sequence[OperatingPoint], retry: float) -> Mix:
    """Return the mix of weighted operating points; ``retry`` in s."""
    weights = np.array([point.weight for point in points])
    rows = [(point.mismatch / RPM, point.profile.force) for point in points]
    return Mix(np.array(rows), weights / weights.sum(), retry)


@dataclass(frozen=True)
class Reference:
    """Designs that were simulated at every point of a mix.

    Parameters
    ----------
    x : designs, (k, d), edge units.
    time, error : expected time of the shifts that engage over the mix, and its standard
        error, (k,), s.
    means, errors : of the shifts that engage at each point, (k, m), s.
    spreads : standard deviation of such a shift, (k, m), s.
    lost, shifts : how many did not engage, and how many were made, (k, m).
    """

    x: Array
    time: Array
    error: Array
    means: Array
    errors: Array
    spreads: Array
    lost: Array
    shifts: Array

    def __len__(self) -> int:
        return len(self.time)

    def of(self, designs: Array) -> Reference:
        """Return the references that are among ``designs`` (k, d)."""
        kept = among(self.x, designs)
        return Reference(*(getattr(self, field.name)[kept] for field in fields(self)))


def reference_of(data: Dataset, mix: Mix) -> Reference:
    """Return the designs of a data set that have every point of the mix and engage at each.

    Rows of several seeds at one point count by their shifts.
    """
    count, size = len(data.designs), len(mix.points)
    node = _node_of(data.points, mix.points)
    place = data.design_of_row
    engaged, shifts = np.zeros((count, size)), np.zeros((count, size))
    time, variance, spread = (np.zeros((count, size)) for _ in range(3))
    of_row = zip(
        place, node, data.column("engaged"), data.column("shifts"), data.column("mean_s"),
        data.column("standard_error_s"), data.column("sd_s"), strict=True,
    )  # fmt: skip
    for k, j, good, n, mean, error, sd in of_row:
        if j < 0:
            continue
        shifts[k, j] += n
        if good > 0:
            engaged[k, j] += good
            time[k, j] += good * mean
            variance[k, j] += (good * error) ** 2
            spread[k, j] += good * sd**2
    whole = (engaged > 0).all(axis=1)
    engaged, shifts = engaged[whole], shifts[whole]
    means, errors = time[whole] / engaged, np.sqrt(variance[whole]) / engaged
    return Reference(
        x=data.designs[whole],
        time=means @ mix.weights,
        error=np.sqrt(errors**2 @ mix.weights**2),
        means=means,
        errors=errors,
        spreads=np.sqrt(spread[whole] / engaged),
        lost=shifts - engaged,
        shifts=shifts,
    )


def _node_of(points: Array, nodes: Array) -> list[int]:
    """Return for each operating point (n, 2) its place among the nodes, -1 if it is none."""
    places = {tuple(np.round(node, 6)): j for j, node in enumerate(nodes)}
    return [places.get(tuple(np.round(point, 6)), -1) for point in points]
