"""Bench data sets: what a stand or another simulator delivers about one clutch.

A folder with ``bench.toml`` (clutch, stand) and ``shifts.csv``, one row a shift or
the mean of ``n_shifts`` shifts at one operating point. A cell without a time is
kept: whether it was tried is in ``engaged``, which may be empty as well.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from pydantic import Field

from sim.actuation import ForceProfile
from sim.bundled import bundled_root
from sim.clutch import Clutch, OperatingPoint, solver_for
from sim.contact import contact_set
from sim.edge import DogSection, OutputSection, Section, SlidingSection, rings, validate
from sim.errors import DataError, did_you_mean, refusal, require_between
from sim.units import DEG, MM, RPM

COLUMNS = (
    "mismatch_rpm",
    "force_N",
    "force_rise_s",
    "n_shifts",
    "shift_time_s",
    "engaged",
    "trace",
)


class _Contact(Section):
    # The solver's fall to dynamic friction lies at ten stiction velocities, as in the
    # published set; the friction velocity is read and not used.
    static_friction: float
    dynamic_friction: float
    stiction_velocity_m_s: float
    friction_velocity_m_s: float


class _Sensor(Section):
    displacement_at: str = "sleeve"
    linkage_ratio: float | None = None
    linkage_efficiency: float | None = None


class _BenchFile(Section):
    name: str
    source: str
    timeout_s: float
    shift_travel_mm: float
    relative_angles_deg: Annotated[list[float], Field(min_length=2)] | None = None
    dog: DogSection
    sliding: SlidingSection
    output: OutputSection
    contact: _Contact
    sensor: _Sensor | None = None
    actuator_calibration: list[dict[str, float]] = Field(default_factory=list)


@dataclass(frozen=True)
class Cell:
    """One operating point of a data set.

    ``time`` is the mean shift time in s over the ``n`` shifts that have one, None
    where there is none.
    """

    point: OperatingPoint
    time: float | None
    n: int


@dataclass(frozen=True)
class Bench:
    """A data set: the clutch as the bench knows it, and its operating points.

    ``relative_angles`` are those of the bench in rad, where it says them.
    """

    name: str
    source: str
    clutch: Clutch
    cells: tuple[Cell, ...]
    relative_angles: tuple[float, ...] | None


def load_bench(where: str | Path) -> Bench:
    """Read a data set; every mistake raises DataError with file, row and column."""
    folder = _find(where)
    file = _settings(folder / "bench.toml")
    angles = file.relative_angles_deg
    return Bench(
        name=file.name,
        source=file.source,
        clutch=_clutch(file),
        cells=_cells(_table(folder / "shifts.csv"), folder / "shifts.csv"),
        relative_angles=tuple(a * DEG for a in angles) if angles else None,
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


def _settings(path: Path) -> _BenchFile:
    try:
        data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; a data set needs bench.toml") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise DataError(f"{path} is not valid TOML: {error}; correct the line") from error
    return validate(_BenchFile, data, str(path))


def _clutch(file: _BenchFile) -> Clutch:
    dog = file.dog.dog()
    contact = replace(
        contact_set("adams2019"),
        name="bench",
        static_friction=file.contact.static_friction,
        dynamic_friction=file.contact.dynamic_friction,
        stiction_velocity=file.contact.stiction_velocity_m_s,
    )
    left = dog.travel - file.shift_travel_mm * MM
    if not 0.0 < left < dog.height:
        rule = f"it must lie below the full travel of {dog.travel / MM:.6g} mm and past entry"
        remedy = "give the travel at which a shift counts as finished"
        raise DataError(refusal("shift_travel_mm", file.shift_travel_mm, "mm", rule, remedy))
    require_between("timeout_s", file.timeout_s, 1e-3, 60.0, "give it in seconds")
    both = rings(file.sliding, file.output)
    return Clutch(dog, both, contact, solver_for(contact), file.timeout_s, left)


def _table(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; a data set needs shifts.csv") from error
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError, OSError) as error:
        raise DataError(f"{path} is not a table of comma separated values: {error}") from error
    for column in table.columns:
        if column not in COLUMNS:
            hint = did_you_mean(str(column), COLUMNS)
            raise DataError(f"{path}, row 1: '{column}' is not a known column; {hint}")
    for column in COLUMNS:
        if column not in table.columns:
            raise DataError(f"{path}, row 1: the column '{column}' is missing; add it")
    if table.empty:
        raise DataError(f"{path} has no rows; a data set needs at least one shift")
    return table


def _cells(table: pd.DataFrame, path: Path) -> tuple[Cell, ...]:
    """Gather rows by operating point, in the order in which these first appear."""
    found: dict[tuple[float, float, float], list[tuple[float, int]]] = {}
    for row, record in enumerate(table.to_dict("records"), start=2):
        key = tuple(
            _number(path, row, record, column)
            for column in ("mismatch_rpm", "force_N", "force_rise_s")
        )
        times = found.setdefault((key[0], key[1], key[2]), [])
        count = _number(path, row, record, "n_shifts")
        if count < 1 or count != int(count):
            raise _bad(path, row, "n_shifts", record, "a whole number of at least 1")
        if record["engaged"] not in ("true", "false", ""):
            raise _bad(path, row, "engaged", record, "true, false or empty")
        if record["shift_time_s"]:
            time = _number(path, row, record, "shift_time_s")
            if not 0.0 < time < 60.0:
                raise _bad(path, row, "shift_time_s", record, "a time in s, above 0 and below 60")
            times.append((time, int(count)))
    return tuple(_cell(key, times) for key, times in found.items())


def _cell(key: tuple[float, float, float], times: list[tuple[float, int]]) -> Cell:
    mismatch, force, rise = key
    point = OperatingPoint(mismatch * RPM, ForceProfile(force, rise))
    total = sum(count for _, count in times)
    mean = sum(time * count for time, count in times) / total if total else None
    return Cell(point, mean, total)


def _number(path: Path, row: int, record: dict[Any, Any], column: str) -> float:
    try:
        value = float(record[column])
    except ValueError:
        raise _bad(path, row, column, record, "a number") from None
    if not np.isfinite(value):
        raise _bad(path, row, column, record, "a finite number")
    return value


def _bad(path: Path, row: int, column: str, record: dict[Any, Any], rule: str) -> DataError:
    return DataError(
        f"{path}, row {row}, column {column} is '{record[column]}', but it must be {rule}; "
        "correct the cell"
    )
