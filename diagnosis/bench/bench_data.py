"""Bench data sets: what a stand or another simulator delivers about one clutch.

A folder with ``bench.toml`` (clutch, stand), ``shifts.csv``, one row a shift or the mean of
``n_shifts`` shifts at one operating point, and time series of single shifts in ``traces``.
Before anything is made of the numbers they are examined for slips of units and axes: what
cannot be true is refused with the correction that would make it so, what merely looks odd
becomes a warning of the data set.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dogshape.diagnosis.bench.clock import clock_step
from dogshape.diagnosis.bench.corrections import Correction, corrected, parse
from dogshape.diagnosis.bench.nominal_errors import EXACT, NominalErrors
from dogshape.diagnosis.bench.reading import Cell, Reading, gather
from dogshape.diagnosis.bench.record import UNSAID, BenchRecord
from dogshape.diagnosis.bench.sense import Sense
from dogshape.diagnosis.bench.slips import Finding, examine, impossible, require_no_slip
from dogshape.diagnosis.bench.stand_file import (
    USUAL_MARGIN,
    Calibration,
    Margin,
    Measured,
    Sensor,
    Stand,
    TestTerms,
    load_stand,
)
from dogshape.diagnosis.bench.table import Row, Sheet, bad_cell, load_sheet
from dogshape.sim.errors import DataError, InputError, number
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root


@dataclass(frozen=True)
class Bench:
    """A data set: the clutch as the bench knows it, and its operating points.

    ``relative_angles`` are those of the bench in rad, where it says them. ``corrections`` are
    those that were asked for and made, ``warnings`` what looks odd in the corrected data.
    ``record`` says time zero, place of the sensor, reading of empty cells, and sense of rotation.
    ``folder`` is where it was read from, None for one that was made otherwise. ``tests`` has what
    tests cost at this stand, and which it cannot do, ``margin`` the gap that needs nothing done,
    ``errors`` those of nominal force and mismatch, ``measured`` has results of direct tests.
    ``clock_step`` is the step in s of which all times are multiples, 0 where there is none.
    """

    name: str
    source: str
    clutch: Clutch
    cells: tuple[Cell, ...]
    relative_angles: tuple[float, ...] | None
    sensor: Sensor
    calibration: tuple[Calibration, ...] = ()
    corrections: tuple[Correction, ...] = ()
    warnings: tuple[Finding, ...] = ()
    record: BenchRecord = UNSAID
    folder: Path | None = None
    tests: tuple[TestTerms, ...] = ()
    margin: Margin = USUAL_MARGIN
    errors: NominalErrors = EXACT
    measured: tuple[Measured, ...] = ()
    clock_step: float = 0.0

    @property
    def mismatch_sense(self) -> Sense:
        """Sense of rotation, known or unknown."""
        return self.record.sense

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All rows, in the order of the table."""
        rows = [reading for cell in self.cells for reading in cell.readings]
        return tuple(sorted(rows, key=lambda reading: reading.row))


def load_bench(where: str | Path, corrections: Iterable[str] = ()) -> Bench:
    """Read a data set.

    Parameters
    ----------
    where : a folder, or the name of a bundled set.
    corrections : such as ``time=ms`` (``diagnosis.bench.corrections``), beside those that
        ``bench.toml`` asks for.

    Raises
    ------
    DataError
        For every mistake, with file, row and column; for data that cannot be true as they
        stand, with the correction that would explain them.
    InputError
        For corrections that are unknown or contradict each other.
    """
    folder = _find(where)
    stand = load_stand(folder / "bench.toml")
    asked = parse((*stand.corrections, *corrections))
    sheet = load_sheet(folder / "shifts.csv")
    for correction in asked:
        sheet = corrected(sheet, correction, stand.sensor)
    findings = examine(stand, sheet, asked)
    require_no_slip(str(sheet.path), findings)
    readings = readings_of(stand, sheet, asked)
    return Bench(
        name=stand.name,
        source=stand.source,
        clutch=stand.clutch,
        cells=gather(readings),
        relative_angles=stand.relative_angles,
        sensor=stand.sensor,
        calibration=stand.calibration,
        corrections=asked,
        warnings=findings,
        record=stand.record,
        folder=folder,
        tests=stand.tests,
        margin=stand.margin,
        errors=stand.errors,
        measured=stand.measured,
        clock_step=clock_step(stand, sheet),
    )


def require_something(bench: Bench) -> None:
    """Raise DataError where nothing is known of any shift: no time, and no engagement."""
    if not any(cell.n or cell.tried for cell in bench.cells):
        raise DataError(
            f"{bench.name} has no shift with a time and none that is known to have engaged or "
            "failed, so that there is nothing to compare; fill shift_time_s or engaged"
        )


def require_times(bench: Bench) -> None:
    """Raise DataError where no shift has a time, which a diagnosis is made of."""
    require_something(bench)
    if not any(cell.n for cell in bench.cells):
        engaged, tried = (sum(getattr(c, n) for c in bench.cells) for n in ("engaged", "tried"))
        raise DataError(
            f"{bench.name} has no shift with a time ({engaged} of {tried} tried ones engaged), but "
            "a diagnosis needs times; 'dogshape validate' compares the shares that engaged"
        )


def _find(where: str | Path) -> Path:
    folder = Path(where)
    if folder.is_dir():
        return folder
    root = bundled_root() / "bench"
    bundled = root / str(where)
    if folder.name == str(where) and bundled.is_dir():
        return bundled
    names = ", ".join(sorted(p.name for p in root.iterdir() if p.is_dir()))
    raise DataError(
        f"there is no data set at {where}; give a folder with bench.toml and shifts.csv, "
        f"or one of the bundled sets ({names})"
    )


def readings_of(stand: Stand, sheet: Sheet, asked: tuple[Correction, ...]) -> list[Reading]:
    """Return the rows of a table as readings; numbers that cannot be true raise DataError."""
    return [_reading(stand, sheet, row, asked) for row in sheet.rows]


def _reading(stand: Stand, sheet: Sheet, row: Row, asked: tuple[Correction, ...]) -> Reading:
    """Return a row as a reading; numbers that cannot be true raise DataError."""
    try:
        point = OperatingPoint(row.mismatch * RPM, ForceProfile(row.force, row.rise))
    except InputError as error:
        raise DataError(f"{sheet.path}, row {row.row}: {error}") from error
    rule = impossible(stand, row, asked)
    if rule:
        raise bad_cell(sheet.path, row.row, "shift_time_s", number(row.time or 0.0), rule)
    n, engaged = row.n, row.engaged
    if engaged is None and stand.record.empty_cells == "not_made":
        n = 0
    if engaged is None and stand.record.empty_cells == "failed":
        engaged = False
    return Reading(row.row, point, n, row.time, engaged, row.trace, row.sd, row.place)


def setting_of(bench: Bench) -> Setting:
    """Return the first operating point of a bench, without effects."""
    sensor = "actuator" if bench.sensor.displacement_at == "actuator" else "sleeve"
    return Setting(bench.clutch, bench.cells[0].point, sensor=sensor)  # type: ignore[arg-type]
