"""Bench data sets: shifts of one clutch on a stand or in another simulator.

A folder with ``bench.toml`` (clutch, stand), ``shifts.csv``, one row a shift or the mean of
``n_shifts`` shifts at one operating point, and time series of single shifts in ``traces``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.bench.corrections import Finding, corrected, parse
from dogshape.bench.slips import examine, found_step, impossible, require_no_slip
from dogshape.bench.stand_file import EmptyCells, Stand, load_stand
from dogshape.bench.table import Sheet, load_sheet
from dogshape.bench.traces import BenchTrace, bad_cell
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.interface import verb
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root

FORCE_REMEDY = "correct it, or the numbers of [actuation]"  #: for a force beyond an actuator's


@dataclass(frozen=True)
class Reading:
    """One row: a shift, or ``n`` shifts at one operating point, 0 where none was made.

    ``row`` counts the lines of ``shifts.csv`` from 1; ``time`` is the (mean) shift time and ``sd``
    its standard deviation, s; ``place`` is that in the series of all shifts. A source may not say
    whether shifts ``engaged``; a time says that they did.
    """

    row: int
    point: OperatingPoint
    n: int
    time: float | None
    engaged: bool | None
    trace: BenchTrace | None = None
    sd: float | None = None
    place: float | None = None


@dataclass(frozen=True)
class Cell:
    """All readings at one operating point.

    Each of its shifts is one of three: ``engaged``, ``failed`` (tried, not engaged before
    the time-out) and ``unknown``, of which the source does not say whether it was tried.
    """

    point: OperatingPoint
    readings: tuple[Reading, ...]

    @property
    def n(self) -> int:
        """Number of shifts that have a time, alone or within a mean."""
        return sum(r.n for r in self.readings if r.time is not None)

    @property
    def time(self) -> float | None:
        """Mean of the ``n`` shift times, s, None without any."""
        total = sum(r.time * r.n for r in self.readings if r.time is not None)
        return total / self.n if self.n else None

    @property
    def times(self) -> Array:
        """Times of single shifts, s, (k,); those within means are not among them."""
        return np.array([r.time for r in self.readings if r.n == 1 and r.time is not None])

    @property
    def engaged(self) -> int:
        """Number of shifts known to have engaged."""
        return sum(r.n for r in self.readings if r.engaged)

    @property
    def failed(self) -> int:
        """Number of shifts that were tried and did not engage."""
        return sum(r.n for r in self.readings if r.engaged is False)

    @property
    def unknown(self) -> int:
        """Number of shifts of which nothing is known: not tried, or not engaged."""
        return sum(r.n for r in self.readings if r.engaged is None)

    @property
    def tried(self) -> int:
        """Number of shifts known to have been tried."""
        return self.engaged + self.failed

    @property
    def traces(self) -> tuple[BenchTrace, ...]:
        """Traces of its shifts."""
        return tuple(r.trace for r in self.readings if r.trace is not None)

    def with_empty(self, meaning: EmptyCells) -> Cell:
        """Return the cell with unknown shifts as ``record.empty_cells`` has them."""
        if meaning == "unknown":
            return self
        changes: dict[str, Any] = {"engaged": False} if meaning == "failed" else {"n": 0}
        readings = tuple(replace(r, **changes) if r.engaged is None else r for r in self.readings)
        return replace(self, readings=readings)


def gather(readings: Sequence[Reading]) -> tuple[Cell, ...]:
    """Gather readings by operating point, in the order in which these first appear."""
    readings_by_point: dict[OperatingPoint, list[Reading]] = {}
    for reading in readings:
        readings_by_point.setdefault(reading.point, []).append(reading)
    return tuple(
        Cell(point, tuple(cell_readings)) for point, cell_readings in readings_by_point.items()
    )


@dataclass(frozen=True, kw_only=True)
class Bench(Stand):
    """A data set: its stand, and its operating points.

    ``corrections`` are those that were made, ``warnings`` what looks odd in the corrected data.
    ``folder`` is where it was read from, None for one that was made otherwise.
    """

    cells: tuple[Cell, ...]
    warnings: tuple[Finding, ...] = ()
    folder: Path | None = None

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All rows, in the order of the table."""
        rows = [reading for cell in self.cells for reading in cell.readings]
        return tuple(sorted(rows, key=lambda reading: reading.row))


def bundled_benches() -> dict[str, Path]:
    """List the folders of the data sets that the package brings, by name."""
    return {p.name: p for p in sorted((bundled_root() / "bench").iterdir()) if p.is_dir()}


def load_bench(where: str | Path, corrections: Iterable[str] = ()) -> Bench:
    """Read a data set, a folder or a bundled name.

    ``corrections`` are made beside those that ``bench.toml`` asks for, such as ``time=ms``. Every
    mistake raises DataError with file, row and column, and data that cannot be true as they stand
    with the correction that would explain them; InputError is for corrections that are wrong.
    """
    bundled = bundled_benches()
    folder = Path(where) if Path(where).is_dir() else bundled.get(str(where))
    if folder is None:
        raise DataError(
            f"there is no data set at {where}; give a folder with bench.toml and shifts.csv, or "
            f"one of the bundled sets ({', '.join(bundled)})"
        )
    stand = load_stand(folder / "bench.toml")
    sheet, corrections_made = corrected_sheet(stand, folder / "shifts.csv", corrections)
    findings = examine(stand, sheet, corrections_made)
    require_no_slip(str(sheet.path), findings)
    step = found_step(sheet) if stand.clock_step is None else stand.clock_step
    fields = {**vars(stand), "corrections": corrections_made, "clock_step": step}
    cells = gather(readings_of(stand, sheet, corrections_made))
    cells = tuple(cell.with_empty(stand.record.empty_cells) for cell in cells)
    return Bench(**fields, cells=cells, warnings=findings, folder=folder)


def corrected_sheet(
    stand: Stand, path: Path, corrections: Iterable[str]
) -> tuple[Sheet, tuple[str, ...]]:
    """Read a table and make the corrections of its data set, which are given back."""
    corrections_made = parse((*stand.corrections, *corrections))
    sheet = load_sheet(path, stand.clutch.actuator)
    for correction in corrections_made:
        sheet = corrected(sheet, correction, stand.sensor)
    return sheet, corrections_made


def require_shifts(bench: Bench, *, times: bool) -> None:
    """Raise DataError where nothing is known of any shift, or with ``times`` none has a time."""
    timed, engaged, attempts = (
        sum(getattr(cell, name) for cell in bench.cells) for name in ("n", "engaged", "tried")
    )
    if not timed and not attempts:
        raise DataError(
            f"{bench.name} has no shift with a time and none that is known to have engaged or "
            "failed, so that there is nothing to compare; fill shift_time_s or engaged"
        )
    if times and not timed:
        raise DataError(
            f"{bench.name} has no shift with a time ({engaged} of {attempts} tried ones engaged), "
            f"but a diagnosis needs times; {verb('validate')} compares the shares that engaged"
        )


def readings_of(stand: Stand, sheet: Sheet, asked: tuple[str, ...]) -> list[Reading]:
    """Return the rows of a table as readings; numbers that cannot be true raise DataError.

    ``asked`` are the corrections that the user asked for; ``time=given`` allows early times.
    """
    readings = []
    for row in sheet.rows:
        try:
            point = OperatingPoint(row.mismatch * RPM, ForceProfile(row.force, row.rise))
            if stand.clutch.actuator is not None:
                stand.clutch.actuator.require_force(row.force, "force_N", FORCE_REMEDY)
                stand.clutch.actuator.require_reach(row.force, stand.clutch.shift_travel)
        except InputError as error:
            raise DataError(f"{sheet.path}, row {row.row}: {error}") from error
        if rule := impossible(stand, row, asked):
            raise bad_cell(sheet.path, row.row, "column shift_time_s", f"{row.time:.6g}", rule)
        fields = row.n, row.time, row.engaged, row.trace, row.sd, row.place
        readings.append(Reading(row.row, point, *fields))
    return readings


def setting_of(bench: Bench) -> Setting:
    """Build the setting of a bench: its clutch at its first operating point, without effects."""
    sensor = "actuator" if bench.record.displacement_at == "actuator" else "sleeve"
    return Setting(bench.clutch, bench.cells[0].point, sensor=sensor)  # type: ignore[arg-type]
