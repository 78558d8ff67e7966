"""The data set of a diagnosis, kept in its folder, and new readings that join it.

``data``         ``bench.toml``, ``shifts.csv`` and traces as they were given
``data/asked.json``  corrections and effects of the request, and digests of joined files

New readings are joined in ``joining`` beside it, which takes the place of ``data`` once the new
diagnosis is written. So a run that is stopped leaves the folder as it was, or finished.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, readings_of
from dogshape.diagnosis.bench.clock import found_step, rows_off
from dogshape.diagnosis.bench.corrections import Correction, corrected, parse
from dogshape.diagnosis.bench.near_points import NEAR, near_points
from dogshape.diagnosis.bench.slips import examine, require_no_slip
from dogshape.diagnosis.bench.stand_file import Stand, load_stand
from dogshape.diagnosis.bench.table import COLUMNS, NUMERIC, Row, Sheet, load_sheet
from dogshape.sim.errors import DataError, StorageError, number
from dogshape.sim.files import write_whole
from dogshape.sim.texts import read_table
from dogshape.sim.units import MS

DATA, JOINING, BEFORE, ASKED = "data", "joining", "data.before", "asked.json"
COPIED = 8  #: equal rows in a row, from which on they are copies
DIFFERENT = 5  #: of these that differ from each other: a stand may repeat few values
Cells = dict[str, str]  #: a row of a table as it is read


@dataclass(frozen=True)
class Asked:
    """Request of a diagnosis beside its data, and the files that joined since.

    ``joined`` has a digest for each, in their order.
    """

    corrections: tuple[str, ...] = ()
    effects: str | None = None
    joined: tuple[str, ...] = ()

    def write(self, folder: Path) -> None:
        """Write to the folder of the data."""
        write_whole(folder / ASKED, json.dumps(vars(self), indent=1) + "\n")


@dataclass(frozen=True)
class Joined:
    """A data set with new readings, in a folder that waits to become that of the diagnosis."""

    bench: Bench
    new: Sheet
    folder: Path
    asked: Asked

    def settle(self) -> None:
        """Let the joined data take the place of the earlier ones."""
        _settle(self.folder)


def _settle(fresh: Path) -> None:
    """Give a finished folder the place of the data; a stop between leaves ``BEFORE``."""
    data, before = fresh.with_name(DATA), fresh.with_name(BEFORE)
    shutil.rmtree(before, ignore_errors=True)
    if data.is_dir():
        os.replace(data, before)
    os.replace(fresh, data)
    shutil.rmtree(before, ignore_errors=True)


def keep_data(bench: Bench, folder: Path, effects: Path | None) -> None:
    """Copy the data set of a diagnosis into its folder; a set that was made in memory has none."""
    if bench.folder is None:
        return
    fresh = folder / JOINING
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    traces = [r.trace.path.relative_to(bench.folder) for r in bench.readings if r.trace is not None]
    for name in (Path("bench.toml"), Path("shifts.csv"), *traces):
        (fresh / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(bench.folder / name, fresh / name)
    where = None if effects is None else str(effects.resolve())
    Asked(tuple(map(str, bench.corrections)), where).write(fresh)
    _settle(fresh)


def asked_of(folder: Path) -> Asked:
    """Read what the diagnosis in a folder was asked for.

    Raises StorageError where the folder holds no data set of a diagnosis, or a damaged one.
    """
    data = folder / DATA
    if not data.is_dir() and (folder / BEFORE).is_dir():
        os.replace(folder / BEFORE, data)  # stopped between two names
    path = data / ASKED
    if not path.is_file():
        raise StorageError(
            f"{folder} holds no diagnosis with its data; make it with: dogshape gap BENCH_DIR "
            f"--out {folder}"
        )
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return Asked(tuple(found["corrections"]), found["effects"], tuple(found["joined"]))
    except (ValueError, KeyError, TypeError) as error:
        raise StorageError(
            f"{path} is damaged ({type(error).__name__}); diagnose the data set again with --out"
        ) from error


def joined(folder: Path, new: Path, asked: Asked) -> Joined:
    """Join new readings to the data set of the diagnosis in a folder.

    Parameters
    ----------
    new : table with the columns of ``shifts.csv`` and in the same units; corrections of the data
        set are made on it too.

    Raises
    ------
    DataError
        The table is wrong, has slips of units by itself, has joined before or repeats rows, or has
        set values that are nearly those of the bench.
    """
    try:
        digest = hashlib.sha256(new.read_bytes()).hexdigest()[:16]
    except OSError as error:
        rule = "name a table with the columns of shifts.csv"
        raise DataError(f"{new} cannot be read ({error.strerror}); {rule}") from error
    if digest in asked.joined:
        place = asked.joined.index(digest) + 1
        raise DataError(
            f"{new} joined this diagnosis already (update {place}), and copies would count as "
            "shifts of their own; give new readings"
        )
    data = folder / DATA
    stand = load_stand(data / "bench.toml")
    sheet = _examined(stand, new, asked.corrections)
    held, _ = _corrected(stand, data / "shifts.csv", asked.corrections)
    if not any(one.startswith("points=") for one in asked.corrections):
        _require_same_points(held, sheet)
    _require_no_copies(held, sheet)
    if stand.clock_step is None:
        _require_one_clock(held, sheet)
    target = folder / JOINING
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(data, target)
    own = Path("traces") / f"update-{len(asked.joined) + 1}"
    added = [_moved(row, new, target, own) for row in _rows(new)]
    rows = _in_series(_rows(data / "shifts.csv"), added)
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(target / "shifts.csv", text.getvalue())
    now = replace(asked, joined=(*asked.joined, digest))
    now.write(target)
    return Joined(load_bench(target, asked.corrections), sheet, target, now)


def _examined(stand: Stand, new: Path, corrections: Sequence[str]) -> Sheet:
    """Return the new rows, corrected; rows that cannot be true by themselves are refused."""
    sheet, asked = _corrected(stand, new, corrections)
    remedy = "write them as the data set of the diagnosis has them"
    require_no_slip(str(new), examine(stand, sheet, asked), remedy)
    readings_of(stand, sheet, asked)
    return sheet


def _corrected(
    stand: Stand, path: Path, corrections: Sequence[str]
) -> tuple[Sheet, tuple[Correction, ...]]:
    """Read a table and make the corrections of a data set, which are given back."""
    sheet, asked = load_sheet(path), parse((*stand.corrections, *corrections))
    for correction in asked:
        sheet = corrected(sheet, correction, stand.sensor)
    return sheet, asked


def _rows(path: Path) -> list[Cells]:
    table = read_table(path, NUMERIC, COLUMNS)
    return [dict(zip(table.head, cells, strict=True)) for _, cells in table.rows]


def _in_series(before: list[Cells], added: list[Cells]) -> list[Cells]:
    """Put new rows behind the series of earlier ones.

    Where only one of both says the places of all its shifts, neither does afterwards.
    """
    timed = [row for row in (*before, *added) if row["shift_time_s"]]
    if all(row.get("order") for row in timed):
        last = max((float(row["order"]) for row in before if row.get("order")), default=0.0)
        added = [
            {**row, "order": f"{last + float(row['order']):.9g}"} if row.get("order") else row
            for row in added
        ]
    both = [*before, *added]
    for column in ("order", "timestamp"):
        if not all(row.get(column) for row in timed):
            both = [{**row, column: ""} for row in both]
    return both


def _moved(row: Cells, new: Path, target: Path, own: Path) -> Cells:
    """Copy the trace of a new row to a folder of its update, and return the row with its path."""
    name = row.get("trace", "")
    if not name:
        return row
    place = target / own / name
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(new.parent / name, place)
    return {**row, "trace": (own / name).as_posix()}


def _require_same_points(held: Sheet, new: Sheet) -> None:
    """Raise DataError for set values that are nearly, but not just, those of the bench."""
    rows = (*held.rows, *new.rows)
    for place, other in sorted(near_points(rows).items()):
        if max(place, other) >= len(held.rows):
            row, like = rows[max(place, other)], rows[min(place, other)]
            raise DataError(
                f"{new.path}, row {row.row} has {_set_values(row)}, but there are "
                f"{_set_values(like)} already, and other set values are another operating point; "
                f"write the same, or ones that differ by more than {NEAR:.0%}"
            )


def _set_values(row: Row) -> str:
    return f"{number(row.mismatch)} 1/min, {number(row.force)} N and {number(row.rise)} s"


def _require_no_copies(held: Sheet, new: Sheet) -> None:
    """Raise DataError where new rows are rows of the bench, one after the other.

    Rounded times may agree by chance. Time stamps identify a shift, where all rows have one; the
    order counts from the first shift of each table and does not.
    """
    stamped = all(row.timestamp is not None for one in (held, new) for row in one.rows)

    def numbers(row: Row) -> tuple[float | None, ...]:
        stamp = row.timestamp if stamped else None
        return row.mismatch, row.force, row.rise, float(row.n), row.time, row.sd, stamp

    ours, theirs = ([numbers(row) for row in one.rows] for one in (held, new))
    found = SequenceMatcher(None, ours, theirs, autojunk=False).find_longest_match()
    same = theirs[found.b : found.b + found.size]
    # A mean that is not measured yet is no copy of one that was not.
    means = [k for k, row in enumerate(new.rows) if row.n > 1 and row.time and theirs[k] in ours]
    if found.size >= COPIED and len(set(same)) >= DIFFERENT:
        first, last = new.rows[found.b].row, new.rows[found.b + found.size - 1].row
        which, like = f"rows {first} to {last} repeat", held.rows[found.a].row
    elif means:
        which = f"row {new.rows[means[0]].row} repeats"
        like = held.rows[ours.index(theirs[means[0]])].row
    else:
        return
    raise DataError(
        f"{new.path}: {which} rows of the bench from row {like} of its table on, and copies would "
        "count as shifts of their own; leave them out (a timestamp in each row of bench and table "
        "distinguishes shifts with equal times)"
    )


def _require_one_clock(held: Sheet, new: Sheet) -> None:
    """Raise DataError for times in the steps of a clock beside others that are finer."""
    step = found_step(held) or found_step(new)
    for one in (held, new):
        if off := rows_off(one, step):
            raise DataError(
                f"{one.path}, row {off[0].row} has {number(off[0].time or 0.0)} s, but all single "
                f"times of {(new if one is held else held).path} are multiples of "
                f"{number(step / MS)} ms, and a data set has one clock; diagnose them apart, or "
                "state errors.clock_step_ms = 0 in bench.toml and diagnose again"
            )
