"""Tables of a stand and how to read them: rows in the project's units, with all faults at once."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pandas import DataFrame

from dogshape.bench.decoding import TableLimits
from dogshape.bench.draft_arguments import no_column
from dogshape.bench.foreign_readings import TableReader
from dogshape.bench.foreign_table import ForeignTable, read_foreign, read_sheet, table_of
from dogshape.bench.quantities import SHIFTS, TRACE
from dogshape.bench.raw_sheet import OTHER_BOOKS, file_of, is_workbook
from dogshape.bench.reading_report import ReadingReport
from dogshape.bench.row_marks import RowChoice
from dogshape.bench.table import COLUMNS, NUMBERS
from dogshape.bench.traces import READERS
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.interface import argument

PUBLISHED = "mq200_stand"  #: the published clutch as its stand knows it
OF_TRACES = "trace."  #: before the name of a quantity that is a column of traces
QUOTES = ("cells", "none")  #: what quotation marks of a text enclose
#: Copies of traces by path in the folder: the user's file, and the rows of a table in it.
Traces = dict[str, tuple[Path, tuple[int, ...]]]
#: Suffixes of tables, also of those that are refused with a remedy.
TABLE_SUFFIXES = frozenset((".csv", ".dat", ".lvm", ".tsv", ".txt", ".xlsx", *OTHER_BOOKS))


@dataclass(frozen=True)
class BenchDraft:
    """Content of a bench folder before it is written: tables of a stand and how to read them.

    ``dogshape.write_bench`` writes the folder, ``dogshape.diagnose`` takes the draft in its place.
    Example: ``ds.BenchDraft("measured.csv", columns={"shift_time_s": "t 90 %:ms"})``

    Parameters
    ----------
    tables : one or several CSV or .xlsx files, ``FILE.xlsx#SHEET`` for a sheet; none for a folder
        with an empty table to fill in.
    origin : study or bench with clutch, contact, set values and rise times of the force.
    columns : column, ``COLUMN:UNIT``, formula, or value for all rows, by quantity.
    rise_s : rise time of the force of rows without one, s; None for that of the origin.
    values : values of ``bench.toml`` by dotted key.
    decimal : decimal sign of the tables, ``.`` or ``,``; None to find it.
    rows : rows of the file that are shifts, such as ``2-41,45``; empty to find them.
    drop, keep : ``COLUMN=VALUE`` of rows that are no shifts, and of those that alone are shifts.
    fill_down : whether an empty set value is that of the row above.
    limits : sizes up to which tables are read.
    quotes : ``cells`` where quotation marks enclose cells of a text, ``none`` where they are
        ordinary signs.
    """

    tables: str | Path | Sequence[str | Path] = ()
    origin: str = PUBLISHED
    columns: Mapping[str, str] = field(default_factory=dict)
    rise_s: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)
    decimal: str | None = None
    rows: str = ""
    drop: Sequence[str] = ()
    keep: Sequence[str] = ()
    fill_down: bool = False
    limits: TableLimits = field(default_factory=TableLimits)
    quotes: str = QUOTES[0]

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of the tables, with the sheet behind a workbook."""
        tables = (self.tables,) if isinstance(self.tables, str | Path) else self.tables
        return tuple(map(Path, tables))

    @property
    def folder_name(self) -> str:
        """Name of a folder after the first table."""
        return self.paths[0].stem.replace(" ", "_") if self.paths else "my_bench"

    @property
    def choice(self) -> RowChoice:
        """Answers of the user on rows."""
        return RowChoice(tuple(self.drop), tuple(self.keep), bool(self.rows), self.fill_down)

    @property
    def quoted(self) -> bool:
        """Whether quotation marks enclose cells."""
        return self.quotes == QUOTES[0]

    @property
    def ranges(self) -> list[range]:
        """Rows of the file that are shifts; raises InputError for a text that names none."""
        spans = [re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part) for part in self.rows.split(",")]
        if self.rows and not all(spans):
            fault = f"{argument('rows')} is '{self.rows}'"
            raise InputError(f"{fault}, but must name rows, such as 2-41,45")
        return [range(int(span[1]), int(span[2] or span[1]) + 1) for span in spans if span]


def is_table(where: str | Path) -> bool:
    """Test that a path names a table: a file that is there, a sheet, or a table's suffix."""
    path = Path(where)
    if path.is_dir() or path.name == "bench.toml":
        return False
    return path.is_file() or is_workbook(path) or path.suffix.lower() in TABLE_SUFFIXES


@dataclass(frozen=True)
class DraftTables:
    """Tables of a draft as they were read, with the report of the reading.

    ``rows`` have file and row beside the columns of ``shifts.csv``.
    """

    draft: BenchDraft
    rows: DataFrame
    report: ReadingReport


class StepLine(NamedTuple):
    """Line about a step of reading a table."""

    file: str
    step: str
    line: str


@dataclass(frozen=True)
class ReadingSteps:
    """Lines of the finished steps of reading tables, and the report of the reading."""

    lines: list[StepLine]
    report: ReadingReport

    def to_dict(self) -> dict[str, Any]:
        """Convert steps and report to values of JSON."""
        return {
            "steps": [line._asdict() for line in self.lines],
            **self.report.to_dict(),
            "assumed": self.report.assumed,
            "faults": list(dict.fromkeys(self.report.faults)),
        }


def explain_reading(draft: BenchDraft) -> ReadingSteps:
    """Read the tables of a draft; list the lines of each step, and faults instead of raising.

    InputError for a draft without a table or with one that is not there.
    """
    _require_readable(draft)
    lines: list[StepLine] = []
    report = ReadingReport()
    for path in draft.paths:
        try:
            sheet, stated = read_sheet(path, draft.limits, draft.ranges, quoted=draft.quoted)
            lines += [StepLine(str(path), "raw sheet", line) for line in sheet.lines()]
            table = table_of(sheet, stated, draft.ranges)
        except FileNotFoundError:
            raise InputError(f"there is no {path}; give a CSV or .xlsx of the stand") from None
        except DataError as error:
            report.faults.append(str(error))
            continue
        reader, _ = _read_rows(table, draft, report)
        lines += [
            StepLine(str(path), step, line) for step, line in reader.lines() if step != "raw sheet"
        ]
    return ReadingSteps(lines, report)


def read_tables(draft: BenchDraft) -> DraftTables:
    """Read the rows of all tables; the report has the faults."""
    _require_readable(draft)
    report = ReadingReport()
    frames = [pd.DataFrame(columns=["file", "row", *COLUMNS])]
    for path in draft.paths:
        try:
            table = read_foreign(path, draft.ranges, limits=draft.limits, quoted=draft.quoted)
        except DataError as error:
            report.faults.append(str(error))
            continue
        frames.append(_read_rows(table, draft, report)[1])
    rows = pd.concat(frames[len(frames) > 1 :], ignore_index=True)
    return DraftTables(draft, rows, report)


def _require_readable(draft: BenchDraft) -> None:
    """Raise InputError for tables of one file name, and for another decimal sign."""
    files_by_name: dict[str, set[Path]] = {}
    for path in draft.paths:
        file = file_of(path)
        files_by_name.setdefault(file.name, set()).add(file.resolve())
    same_file_names = any(len(files) > 1 for files in files_by_name.values())
    if same_file_names or len({path.name for path in draft.paths}) < len(draft.paths):
        raise InputError(
            "two of the tables have the same file name, but both are kept beside each other; "
            "rename one"
        )
    if draft.decimal not in (None, ".", ","):
        fault = f"{argument('decimal')} is '{draft.decimal}'"
        raise InputError(f"{fault}, but must be a point or a comma: . or ,")
    if draft.quotes not in QUOTES:
        fault = f"{argument('quotes')} is '{draft.quotes}'"
        raise InputError(f"{fault}, but must be {' or '.join(QUOTES)}")


def _read_rows(
    table: ForeignTable, draft: BenchDraft, report: ReadingReport
) -> tuple[TableReader, DataFrame]:
    """Read the rows of a table, with its file and their numbers, and complete them."""
    columns = {k: v for k, v in draft.columns.items() if not k.startswith(OF_TRACES)}
    reader = TableReader(table, SHIFTS, columns, draft.decimal, report, choice=draft.choice)
    values = {"file": str(table.path), "row": reader.table.rows, **reader.read()}
    return reader, _completed(pd.DataFrame(values), reader)


def _completed(rows: DataFrame, reader: TableReader) -> DataFrame:
    """Fill cells of a table from its other columns."""
    path, report = reader.table.path, reader.report
    numbers = [name for name in NUMBERS if name != "n_shifts"]
    rows[numbers] = rows[numbers].astype(float)
    rows["n_shifts"] = rows.n_shifts.astype(float).fillna(1.0).astype(int)
    failed = rows.engaged.eq(False)
    is_late = failed & rows.shift_time_s.notna()
    rows.loc[failed, "shift_time_s"] = np.nan
    rows.loc[(rows.n_shifts < 2) | rows.shift_time_s.isna(), "shift_time_sd_s"] = np.nan
    if rows.order[rows.shift_time_s.notna()].dropna().duplicated().any():
        report.faults.append(
            f"{path}: '{reader.matches['order'].head}' has a number twice, so it is no place in "
            f"the whole series; {no_column('order')} leaves it out"
        )
    silent = int((rows.shift_time_s.isna() & rows.engaged.isna()).sum())
    report.empty_rows += silent
    report.assumed += [
        f"{path}: {sentence}"
        for sentence, holds in (
            ("each row is one shift, as no column counts them", "n_shifts" not in reader.matches),
            (
                "times of shifts that did not engage are left out (row "
                f"{row_numbers(rows[is_late])})",
                is_late.any(),
            ),
            *(
                (
                    f"'{reader.matches[name].head}' is the order of the shifts, so a diagnosis "
                    f"looks for a drift; {no_column(name)} leaves it out",
                    True,
                )
                for name in ("order", "timestamp")
                if name in reader.matches
            ),
            (
                f"nothing is known of rows without a time ({silent}); record.empty_cells says "
                "whether they were tried, or a column engaged of each with yes and no",
                silent,
            ),
        )
        if holds
    ]
    return rows


def row_numbers(rows: DataFrame) -> str:
    """List the row numbers in the files, separated by commas."""
    return ", ".join(map(str, rows.row))


def copy_trace(
    row: Any, draft: BenchDraft, report: ReadingReport, folder: Path, traces: Traces
) -> str:
    """Write the trace of a row: CSV in the project's units, a recorder's file unchanged.

    Returns its path in the folder, and enters it in ``traces``.
    """
    path, target = Path(row.file).parent / row.trace.replace("\\", "/"), folder / "traces"
    if not path.is_file():
        report.faults.append(
            f"{row.file}, row {row.row}: there is no trace {path}; add the file, or empty the cell"
        )
        return ""
    target.mkdir(exist_ok=True)
    is_recorder_file = path.suffix.lower() in READERS
    name = _trace_name(path, path.suffix if is_recorder_file else ".csv", traces)
    traces[name] = path, ()
    if is_recorder_file:
        shutil.copyfile(path, folder / name)
        return name
    columns_of_trace = {
        k.removeprefix(OF_TRACES): v for k, v in draft.columns.items() if k.startswith(OF_TRACES)
    }
    trace_report = ReadingReport()
    try:
        table = read_foreign(path, sums=False, limits=draft.limits, quoted=draft.quoted)
        reader = TableReader(table, TRACE, columns_of_trace, draft.decimal, trace_report)
        columns = pd.DataFrame(reader.read(), dtype=float).dropna(axis="columns", how="all")
        columns.to_csv(folder / name, index=False, float_format="%.15g")
        traces[name] = path, reader.table.rows
    except DataError as error:
        report.faults.append(str(error))
    report.faults += trace_report.faults
    report.assumed += [f"traces: {line}" for line in trace_report.assumed]
    report.left_out += [item for item in trace_report.left_out if item.row is not None]
    return name


def _trace_name(path: Path, suffix: str, traces: Traces) -> str:
    """Give a trace a path in the folder that no other file has: with its folder before it."""
    stems = [path.stem, f"{path.parent.name}_{path.stem}"]
    stems += [f"{path.stem}_{count}" for count in range(2, len(traces) + 3)]
    names = [f"traces/{stem}{suffix}" for stem in stems]
    return next(name for name in names if traces.get(name, (path, ()))[0] == path)
