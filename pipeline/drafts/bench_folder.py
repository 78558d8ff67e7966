"""A bench folder from foreign tables: rows in the project's units, and a commented ``bench.toml``.

What a table does not say is taken from a clutch that is known, or left to a default; either is
told. The folder is examined as every data set is before it is written, and all faults are told at
once.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.foreign_columns import SHIFTS, TRACE, Match
from dogshape.diagnosis.bench.foreign_table import (
    ForeignTable,
    Report,
    answers_of,
    counts_of,
    match_columns,
    numbers_of,
    read_foreign,
)
from dogshape.diagnosis.bench.mdf4 import SUFFIXES
from dogshape.diagnosis.bench.slips import examine, impossible
from dogshape.diagnosis.bench.stand_file import Stand, load_stand
from dogshape.diagnosis.bench.table import COLUMNS, Sheet
from dogshape.diagnosis.bench.table import Row as SheetRow
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.drafts.bench_template import TEMPLATE
from dogshape.pipeline.drafts.series_columns import place_in_series
from dogshape.pipeline.drafts.sources import PUBLISHED, Source, source_of
from dogshape.pipeline.drafts.targets import drafted
from dogshape.sim.errors import DataError, DogshapeError, InputError, number
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM

Row = dict[str, Any]  #: a table of a TOML file
TIMEOUTS = (1.0, 2.0, 5.0, 10.0, 20.0, 60.0)  #: s, of which the first that holds all times is taken
OF_TRACES = "trace."  #: before the name of a quantity that is a column of traces


@dataclass(frozen=True)
class BenchDraft:
    """Content of a bench folder before it is written.

    Parameters
    ----------
    tables : CSV files of the stand; none gives a table to fill in.
    origin : study or bench whose clutch, contact and rise of the force are taken.
    columns : quantity to ``COLUMN`` or ``COLUMN:UNIT``, where the guess is not to decide.
    rise_s : rise time of the force for all rows that have none; None takes the origin's.
    values : values of ``bench.toml`` by dotted key.
    """

    tables: tuple[Path, ...] = ()
    origin: str = PUBLISHED
    columns: Mapping[str, str] = field(default_factory=dict)
    rise_s: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)


def guessed(tables: Sequence[Path], columns: Mapping[str, str]) -> tuple[list[Row], list[str]]:
    """Match the columns of tables: a row for each match, and the faults."""
    rows, report = [], Report()
    for path in tables:
        for match in match_columns(read_foreign(path), SHIFTS, _of_shifts(columns), report):
            rows.append(_told(path, match, match.unit.text if match.unit else None))
    return rows, report.faults


def _told(path: Path, match: Match, unit: str | None) -> Row:
    name = match.quantity.name
    return {"file": str(path), "quantity": name, "column": match.column.head, "unit": unit}


def _of_shifts(columns: Mapping[str, str]) -> dict[str, str]:
    return {k: v for k, v in columns.items() if not k.startswith(OF_TRACES)}


def write_bench(out: Path, draft: BenchDraft, *, force: bool = False) -> Row:
    """Write a bench folder that ``validate`` and ``gap`` take as it is; tell what was assumed.

    Raises
    ------
    DataError
        For all faults of tables, rows and traces at once.
    StorageError
        For a folder that holds files, without ``force``.
    """
    source, report = source_of(draft.origin), Report()
    with drafted(out, force) as folder:
        rows, told = _rows(draft, source, report, folder)
        report.require(", ".join(map(str, draft.tables)) or str(out))
        values, assumed = _values(draft, source, rows, out)
        report.assumed += assumed
        (folder / "bench.toml").write_text(with_values(TEMPLATE, values), encoding="utf-8")
        (folder / "shifts.csv").write_text(_table(rows), encoding="utf-8")
        _examine(folder, rows, report)
        report.require(", ".join(map(str, draft.tables)) or str(out))
        warnings = _warnings(folder, out)
        for path in draft.tables:
            (folder / "as_measured").mkdir(exist_ok=True)
            shutil.copyfile(path, folder / "as_measured" / path.name)
    return {
        "folder": str(out),
        "rows": len(rows),
        "shifts": sum(row["n"] for row in rows),
        "with_time": sum(row["n"] for row in rows if row["time"] is not None),
        "columns": told,
        "assumed": list(dict.fromkeys(report.assumed)),
        "warnings": warnings,
    }


def _rows(
    draft: BenchDraft, source: Source, report: Report, folder: Path
) -> tuple[list[Row], list[Row]]:
    if not draft.tables:
        report.assumed.append(
            "shifts.csv has the operating points of the origin, to be filled in: one row for each "
            "shift or mean"
        )
        return _empty_rows(source), []
    names = [path.name for path in draft.tables]
    if len(set(names)) < len(names):
        raise InputError(
            "two of the tables have the same file name, but both are kept beside each other; "
            "rename one"
        )
    rows: list[Row] = []
    told: list[Row] = []
    for path in draft.tables:
        try:
            table = read_foreign(path)
        except DataError as error:
            report.faults.append(str(error))
            continue
        matches = match_columns(table, SHIFTS, _of_shifts(draft.columns), report)
        found, used = _table_rows(table, matches, draft, source, report)
        told += used
        traces = next((m for m in matches if m.quantity.name == "trace"), None)
        if traces is not None:
            cells = [cell for _, cell in table.cells(traces.column)]
            _copy_traces(table.path, list(zip(found, cells, strict=True)), draft, report, folder)
        report.require_one_sign(path)
        rows += found
    return rows, told


def _empty_rows(source: Source) -> list[Row]:
    return [
        {"file": "", "row": 0, "mismatch": m, "force": f, "rise": source.rise(f)[0], "n": 10,
         "time": None, "engaged": None, "trace": ""}
        for m in source.mismatches for f in source.forces
    ]  # fmt: skip


def _table_rows(
    table: ForeignTable, matches: list[Match], draft: BenchDraft, source: Source, report: Report
) -> tuple[list[Row], list[Row]]:
    """Convert the rows of a table, as far as its columns are known."""
    by, told = {match.quantity.name: match for match in matches}, []
    size = len(table.rows)
    columns: dict[str, list[float | None]] = {}
    for name in ("mismatch_rpm", "force_N", "force_rise_s", "shift_time_s"):
        columns[name] = [None] * size
        if name in by:
            needed = name in ("mismatch_rpm", "force_N")
            columns[name], unit = numbers_of(table, by[name], report, needed=needed)
            told.append(_told(table.path, by[name], unit.text if unit else None))
    counts = counts_of(table, by["n_shifts"], report) if "n_shifts" in by else [1] * size
    answers = answers_of(table, by["engaged"], report) if "engaged" in by else [None] * size
    told += [_told(table.path, by[n], None) for n in ("n_shifts", "engaged", "trace") if n in by]
    if "n_shifts" not in by:
        report.assumed.append(f"{table.path}: each row is one shift, as no column counts them")
    rows = []
    for place, (row, _) in enumerate(table.rows):
        rows.append({
            "file": str(table.path), "row": row, "mismatch": columns["mismatch_rpm"][place],
            "force": columns["force_N"][place], "rise": columns["force_rise_s"][place],
            "n": counts[place], "time": columns["shift_time_s"][place],
            "engaged": answers[place], "trace": "",
        })  # fmt: skip
    _fill_rises(rows, draft, source, report)
    told += place_in_series(table, by, rows, report)
    late = [str(r["row"]) for r in rows if r["engaged"] is False and r["time"] is not None]
    if late:
        report.assumed.append(
            f"{table.path}: times of shifts that did not engage are left out (row "
            f"{', '.join(late)})"
        )
    for one in rows:
        one["time"] = None if one["engaged"] is False else one["time"]
    silent = sum(row["time"] is None and row["engaged"] is None for row in rows)
    if silent:
        report.assumed.append(
            f"{table.path}: nothing is known of rows without a time ({silent}); a column engaged "
            "with yes and no says which of them were tried and failed"
        )
    return rows, told


def _fill_rises(rows: list[Row], draft: BenchDraft, source: Source, report: Report) -> None:
    lacking = [row for row in rows if row["rise"] is None and row["force"] is not None]
    if not lacking:
        return
    if draft.rise_s is not None:
        for row in lacking:
            row["rise"] = draft.rise_s
        report.assumed.append(f"the force rises in {number(draft.rise_s)} s where no row says it")
        return
    found = {row["force"]: source.rise(row["force"]) for row in lacking}
    for row in lacking:
        row["rise"] = round(found[row["force"]][0], 6)
    times = sorted(rise for rise, _ in found.values())
    said = (
        f"the force rises in {number(times[0])} to {number(times[-1])} s, by its size as in "
        f"'{source.name}'; --rise-s says another time"
    )
    beyond = [force for force, (_, within) in found.items() if not within]
    if beyond:
        said += f"; {number(min(beyond))} to {number(max(beyond))} N lie beyond its forces"
    report.assumed.append(said)


def _copy_traces(
    beside: Path, rows: list[tuple[Row, str]], draft: BenchDraft, report: Report, folder: Path
) -> None:
    """Write the traces that a column names in the project's units; other files than CSV as is."""
    said = {k.removeprefix(OF_TRACES): v for k, v in draft.columns.items() if OF_TRACES in k}
    target = folder / "traces"
    for row, name in rows:
        if not name:
            continue
        path = beside.parent / name.replace("\\", "/")
        if not path.is_file():
            report.faults.append(
                f"{beside}, row {row['row']}: there is no trace {path}; add the file, or empty "
                "the cell"
            )
            continue
        target.mkdir(exist_ok=True)
        row["trace"] = f"traces/{path.name}"
        if path.suffix.lower() in (".tdms", *SUFFIXES):
            shutil.copyfile(path, target / path.name)
            continue
        row["trace"] = f"traces/{path.stem}.csv"
        try:
            text = _trace_text(path, said, report)
        except DataError as error:
            report.faults.append(str(error))
            continue
        (target / f"{path.stem}.csv").write_text(text, encoding="utf-8")


def _trace_text(path: Path, said: Mapping[str, str], report: Report) -> str:
    table, own = read_foreign(path), Report()
    matches = match_columns(table, TRACE, said, own)
    # A row without a value is no sample of that channel.
    columns = {m.quantity.name: numbers_of(table, m, own, needed=False)[0] for m in matches}
    own.require_one_sign(path)
    report.faults += own.faults
    report.assumed += [f"traces: {line}" for line in own.assumed if "not used" not in line]
    names = [one.name for one in TRACE if one.name in columns]
    lines = [",".join(names)]
    for values in zip(*(columns[name] for name in names), strict=True):
        lines.append(",".join("" if v is None else f"{v:.15g}" for v in values))
    return "\n".join(lines) + "\n"


def _table(rows: list[Row]) -> str:
    written = io.StringIO()
    writer = csv.writer(written, lineterminator="\n")
    more = [name for name in COLUMNS[7:] if any(row.get(name) is not None for row in rows)]
    writer.writerow((*COLUMNS[:7], *more))
    for row in rows:
        cells = [row["mismatch"], row["force"], row["rise"], row["n"], row["time"]]
        said = "" if row["engaged"] is None else str(row["engaged"]).lower()
        known = ["" if v is None else f"{v:.9g}" for v in cells]
        writer.writerow([*known, said, row["trace"], *(row.get(name) for name in more)])
    return written.getvalue()


def _values(draft: BenchDraft, source: Source, rows: list[Row], out: Path) -> tuple[Row, list[str]]:
    """Collect the values of ``bench.toml``, and what of them was assumed."""
    values: Row = {"name": out.resolve().name, **source.bench_values}
    assumed = []
    files = [f"{p.name} (SHA-256 {hashlib.sha256(p.read_bytes()).hexdigest()[:16]})"
             for p in draft.tables]  # fmt: skip
    values["source"] = ", ".join(files) or "not measured yet"
    given = dict(draft.values)
    if "source" in given and files:
        given["source"] = f"{given['source']}; {values['source']}"
    if any(row["trace"] for row in rows):
        assumed.append(
            "the traces' displacement and force are those at the sleeve; [sensor] says otherwise"
        )
    if not any(key.startswith(("dog.", "sliding.", "output.")) for key in given):
        assumed.append(f"dogs, masses and inertias are those of '{source.name}': check bench.toml")
    if not any(key.startswith("contact.") for key in given):
        assumed.append(f"the contact is that of '{source.name}'")
    moved = "" if "sliding.mass_kg" in given else source.moved_along
    assumed += [said for said in (moved, source.left_out) if said]
    longest = max((row["time"] for row in rows if row["time"] is not None), default=0.0)
    if "timeout_s" not in given and longest > values["timeout_s"]:
        values["timeout_s"] = next((t for t in TIMEOUTS if t >= longest), TIMEOUTS[-1])
        assumed.append(f"the stand gives up after {number(values['timeout_s'])} s")
    if "mismatch_sense" not in given:
        signed = any(float(row["mismatch"]) < 0.0 for row in rows)
        values["mismatch_sense"] = "known" if signed else "unknown"
        assumed.append(
            "the sign of the mismatch is the project's (docs/mismatch.md), as some are negative"
            if signed
            else "nobody noted which way the rings turned past each other (mismatch_sense), so a "
            "diagnosis weighs both"
        )
    if "dog.height_mm" in given or "dog.axial_gap_mm" in given:
        tolerance = source.clutch.dog.travel * 1e3 - values["shift_travel_mm"]
        whole = {**values, **given}
        travel = float(whole["dog.height_mm"]) + float(whole["dog.axial_gap_mm"])
        values["shift_travel_mm"] = float(f"{travel - tolerance:.9g}")
    return {**values, **given}, assumed


def _examine(folder: Path, rows: list[Row], report: Report) -> None:
    """Add what cannot be true to the faults: slips of whole columns, or else single rows."""
    try:
        stand = load_stand(folder / "bench.toml")
    except DogshapeError as error:
        report.faults.append(str(error).replace(str(folder / "bench.toml"), "bench.toml"))
        return
    plain = [
        SheetRow(r["row"], r["mismatch"], r["force"], r["rise"], r["n"], r["time"], r["engaged"])
        for r in rows
    ]
    certain = [f for f in examine(stand, Sheet(folder, tuple(plain))) if f.certain]
    for finding in certain:
        looks = f"this looks like {finding.looks_like}"
        report.faults.append(f"{finding.found}; {looks}; say unit or column with --column")
    for given, row in zip(rows, plain, strict=True):
        if not certain and (rule := _broken(stand, row)):
            report.faults.append(f"{given['file']}, row {given['row']}: {rule}; correct the row")


def _broken(stand: Stand, row: SheetRow) -> str | None:
    """Return the rule that a row breaks, None where it may be true."""
    try:
        OperatingPoint(row.mismatch * RPM, ForceProfile(row.force, row.rise))
    except InputError as error:
        return str(error).rstrip(".")
    rule = impossible(stand, row)
    if rule is None:
        return None
    plain = rule.partition(" (--correct")[0]
    return f"the shift time is {number(row.time or 0.0)} s, but it must be {plain}"


def _warnings(folder: Path, out: Path) -> list[str]:
    """Read the folder as ``gap`` does, and return its warnings."""
    try:
        bench = load_bench(folder)
    except DogshapeError as error:
        told = re.sub(r"--correct (\S+)", r"""--set 'corrections=["\1"]'""", str(error))
        raise type(error)(told.replace(str(folder), str(out))) from error
    return [finding.sentence for finding in bench.warnings]
