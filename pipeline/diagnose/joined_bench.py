"""The data set of a diagnosis, kept in its folder, and new readings that join it.

``data``         ``bench.toml``, ``shifts.csv`` and traces as they were given
``data/asked.json``  corrections and effects that the diagnosis was asked for, and what joined

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
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench, load_bench, readings_of
from dogshape.diagnosis.bench.corrections import Correction, corrected, parse
from dogshape.diagnosis.bench.slips import examine, require_no_slip
from dogshape.diagnosis.bench.stand_file import Stand, load_stand
from dogshape.diagnosis.bench.table import COLUMNS, NUMERIC, Sheet, load_sheet
from dogshape.pipeline.diagnose.new_readings import (
    require_no_copies,
    require_one_clock,
    require_same_points,
    require_same_rises,
)
from dogshape.sim.errors import DataError, StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.texts import read_table

DATA, JOINING, BEFORE, ASKED = "data", "joining", "data.before", "asked.json"
Row = dict[str, Any]  #: a row of a table as it is read


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
        data, before = self.folder.with_name(DATA), self.folder.with_name(BEFORE)
        shutil.rmtree(before, ignore_errors=True)
        os.replace(data, before)
        os.replace(self.folder, data)
        shutil.rmtree(before, ignore_errors=True)


def keep_data(bench: Bench, folder: Path, effects: Path | None) -> None:
    """Copy the data set of a diagnosis into its folder; one that was made in memory is not kept."""
    if bench.folder is None:
        return
    target = folder / DATA
    fresh = folder / JOINING
    shutil.rmtree(fresh, ignore_errors=True)
    _copied(bench, fresh)
    where = None if effects is None else str(effects.resolve())
    Asked(tuple(map(str, bench.corrections)), where).write(fresh)
    shutil.rmtree(target, ignore_errors=True)
    os.replace(fresh, target)


def _copied(bench: Bench, target: Path) -> None:
    """Copy head, table and traces of a data set."""
    assert bench.folder is not None
    target.mkdir(parents=True)
    for name in ("bench.toml", "shifts.csv"):
        shutil.copy(bench.folder / name, target / name)
    for trace in (r.trace for r in bench.readings if r.trace is not None):
        place = target / trace.path.relative_to(bench.folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(trace.path, place)


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
            f"{path} is damaged ({type(error).__name__}); diagnose the data set anew with --out"
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
    digest = digest_of(new)
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
    require_same_rises(held, sheet)
    if not any(one.startswith("points=") for one in asked.corrections):
        require_same_points(held, sheet)
    require_no_copies(held, sheet)
    if stand.clock_step is None:
        require_one_clock(held, sheet)
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


def digest_of(path: Path) -> str:
    """Return a digest of a file's content; DataError where there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError as error:
        raise DataError(
            f"{path} cannot be read ({error.strerror}); name a table with the columns of shifts.csv"
        ) from error


def _examined(stand: Stand, new: Path, corrections: Sequence[str]) -> Sheet:
    """Return the new rows, corrected; what cannot be true of them by themselves is refused."""
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


def _rows(path: Path) -> list[Row]:
    table = read_table(path, NUMERIC, COLUMNS)
    return [dict(zip(table.head, cells, strict=True)) for _, cells in table.rows]


def _in_series(before: list[Row], added: list[Row]) -> list[Row]:
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


def _moved(row: Row, new: Path, target: Path, own: Path) -> Row:
    """Copy the trace of a new row to a folder of its update, and return the row with its path."""
    name = row.get("trace", "")
    if not name:
        return row
    place = target / own / name
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(new.parent / name, place)
    return {**row, "trace": (own / name).as_posix()}
