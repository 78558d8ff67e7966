"""Update of a diagnosis by new readings: its data set, both answers, and the Bayes factor.

In the folder of the diagnosis stand ``gap.json`` of the last diagnosis, ``gap-0.json`` of the first
one, ``gap-1.json`` of that after the first update, ``updates.json``, a list of all updates, and

``data``         ``bench.toml``, ``shifts.csv`` and traces as they were given
``data/asked.json``  corrections and effects of the request, and digests of joined files

New readings are joined in ``joining`` beside it, which takes the place of ``data`` once the new
diagnosis is written. So a run that is stopped leaves the folder as it was, or finished.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench, corrected_sheet, load_bench, readings_of
from dogshape.diagnosis.bench.slips import examine, found_step, require_no_slip, rows_off
from dogshape.diagnosis.bench.stand_file import load_stand
from dogshape.diagnosis.bench.table import COLUMNS, NEAR, NUMERIC, Row, Sheet, near_points
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, headline, ms
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis, plain
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError, StorageError, number
from dogshape.sim.files import write_whole
from dogshape.sim.texts import read_table
from dogshape.sim.units import MS

DATA, JOINING, BEFORE, ASKED = "data", "joining", "data.before", "asked.json"
UPDATES, RECORD, TABLE = "updates.json", "gap.json", "cells.csv"
COPIED = 8  #: equal rows in a row, from which on they are copies
DIFFERENT = 5  #: of these that differ from each other: a stand may repeat few values
SHOWN = 0.001  #: probability from which a hypothesis is in the record of an update
CREDIBLE = 0.9  #: probability of the hypotheses that a headline names
MOST_ODDS = 1e6  #: odds above which only that is said
Cells = dict[str, str]  #: a row of a table as it is read
Record = dict[str, Any]  #: gap.json
Place = tuple[float, float]  #: mismatch, 1/min, and force, N


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
    Asked(bench.corrections, where).write(fresh)
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
    found = _json(path)
    try:
        return Asked(tuple(found["corrections"]), found["effects"], tuple(found["joined"]))
    except (KeyError, TypeError) as error:
        raise _damaged(path, error) from error


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
    import pandas as pd  # noqa: PLC0415  # slow to load

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
    sheet, corrections = corrected_sheet(stand, new, asked.corrections)
    remedy = "write them as the data set of the diagnosis has them"
    require_no_slip(str(new), examine(stand, sheet, corrections), remedy)
    readings_of(stand, sheet, corrections)
    held, _ = corrected_sheet(stand, data / "shifts.csv", asked.corrections)
    if not any(one.startswith("points=") for one in asked.corrections):
        _require_same_points(held, sheet)
    _require_no_copies(held, sheet)
    if stand.clock_step is None:
        _require_one_clock(held, sheet)
    target = folder / JOINING
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(data, target)
    own = Path("traces") / f"update-{len(asked.joined) + 1}"
    added = _rows(new)
    for row in added:
        if name := row.get("trace", ""):
            place_of_trace = target / own / name
            place_of_trace.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(new.parent / name, place_of_trace)
            row["trace"] = (own / name).as_posix()
    rows = pd.DataFrame(_in_series(_rows(data / "shifts.csv"), added), columns=[*COLUMNS])
    write_whole(target / "shifts.csv", rows.to_csv(index=False, lineterminator="\n"))
    now = replace(asked, joined=(*asked.joined, digest))
    now.write(target)
    return Joined(load_bench(target, asked.corrections), sheet, target, now)


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
        for row in added:
            if row.get("order"):
                row["order"] = f"{last + float(row['order']):.9g}"
    lacking = {c: "" for c in ("order", "timestamp") if not all(row.get(c) for row in timed)}
    return [{**row, **lacking} for row in (*before, *added)]


def _require_same_points(held: Sheet, new: Sheet) -> None:
    """Raise DataError for set values that are nearly, but not just, those of the bench."""
    rows = (*held.rows, *new.rows)
    for place, other in sorted(near_points(rows).items()):
        if max(place, other) >= len(held.rows):
            row, like = (rows[one(place, other)] for one in (max, min))
            values, there = (
                f"{number(one.mismatch)} 1/min, {number(one.force)} N and {number(one.rise)} s"
                for one in (row, like)
            )
            raise DataError(
                f"{new.path}, row {row.row} has {values}, but there are {there} already, and other "
                "set values are another operating point; write the same, or ones that differ by "
                f"more than {NEAR:.0%}"
            )


def _require_no_copies(held: Sheet, new: Sheet) -> None:
    """Raise DataError where new rows are rows of the bench, one after the other.

    Rounded times may agree by chance. Time stamps identify a shift, where all rows have one; the
    order counts from the first shift of each table and does not.
    """
    stamped = all(row.timestamp is not None for one in (held, new) for row in one.rows)
    ours, theirs = (
        [(row.mismatch, row.force, row.rise, float(row.n), row.time, row.sd,
          row.timestamp if stamped else None) for row in one.rows]
        for one in (held, new)
    )  # fmt: skip
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


def require_no_updates(folder: Path) -> None:
    """Raise StorageError where a new diagnosis would replace the record of updates."""
    if (folder / UPDATES).is_file():
        raise StorageError(
            f"{folder} holds a diagnosis with updates ({UPDATES}), which a new one would replace; "
            "name another folder for --out, or join readings with 'dogshape gap update'"
        )


def updates_of(folder: Path, count: int) -> list[Record]:
    """Read the first updates of a folder; StorageError for a file that is damaged."""
    path = folder / UPDATES
    return list(_json(path))[:count] if path.is_file() else []


def before_of(folder: Path, count: int) -> tuple[Record, dict[Place, Record]]:
    """Read the diagnosis before an update: its record, and its operating points by their place.

    Both are kept under the number of updates that were made before.
    """
    kept = [folder / f"{Path(name).stem}-{count}{Path(name).suffix}" for name in (RECORD, TABLE)]
    for name, path in zip((RECORD, TABLE), kept, strict=True):
        if not path.is_file():
            if not (folder / name).is_file():
                raise StorageError(
                    f"{folder / name}, the record of the diagnosis, is missing; diagnose the data "
                    "set again with --out"
                )
            write_whole(path, (folder / name).read_bytes())
    with kept[1].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return dict(_json(kept[0])), {
        _place(float(row["mismatch_rpm"]), float(row["force_N"])): row for row in rows
    }


def write_updates(folder: Path, updates: Sequence[Record]) -> None:
    """Write all updates of a folder."""
    write_whole(folder / UPDATES, json.dumps(list(updates), indent=1, allow_nan=False) + "\n")


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise _damaged(path, error) from error


def _damaged(path: Path, error: Exception) -> StorageError:
    return StorageError(
        f"{path} is damaged ({type(error).__name__}); diagnose the data set again with --out"
    )


def _place(mismatch: float, force: float) -> Place:
    return round(mismatch, 6), round(force, 6)


def update_record(
    before: Record, cells: Mapping[Place, Record], found: Diagnosis, new: Sheet, count: int
) -> Record:
    """Compare a diagnosis with the one before.

    Parameters
    ----------
    before, cells : record and operating points of the earlier one.
    found : with the new readings.
    new : these alone.
    count : updates that were made before.
    """
    after, groups = found.to_dict(), dict[Place, list[Row]]()
    for row in new.rows:
        groups.setdefault(_place(row.mismatch, row.force), []).append(row)
    points = [_point(place, rows, cells.get(place, {})) for place, rows in groups.items()]
    return {
        "update": count + 1,
        "file": new.path.name,
        "rows": len(new.rows),
        "shifts": sum(row.n for row in new.rows),
        "points": points,
        "before": _state(before, found.effects),
        "after": _state(after, found.effects),
        "sentence": sentence(before, after, points, found.effects),
    }


def _state(record: Record, effects: Mapping[str, Effect]) -> Record:
    credible, whole = list[Hypothesis](), 0.0
    for hypothesis, probability in _chances(record).items():
        credible += [hypothesis] if whole < CREDIBLE else []
        whole += probability
    return {
        "verdict": record["verdict"],
        "causes": record["causes"],
        "headline": headline(record["verdict"], record["causes"], credible, effects),
        "probabilities": {
            " + ".join(h) or "none": p for h, p in _chances(record).items() if p >= SHOWN
        },
    }


def _point(place: Place, rows: Sequence[Row], cell: Mapping[str, Any]) -> Record:
    """Record the mean time of new rows of an operating point, and its earlier prediction."""
    timed = [(row.n, row.time) for row in rows if row.time is not None]
    n = sum(count for count, _ in timed)
    mean = sum(count * time for count, time in timed) / n if n else None

    def known(*names: str) -> float | None:
        return next((float(cell[name]) for name in names if cell.get(name)), None)

    expected, error = known("predicted_s", "simulated_s"), known("predicted_error_s")
    shifts, scatter, z = known("shifts"), known("bench_error_s"), None
    if mean is not None and expected is not None and scatter and shifts:
        z = (mean - expected) / math.hypot(error or 0.0, scatter * math.sqrt(shifts / n))
    shifted = sum(row.n for row in rows)
    return {"mismatch_rpm": place[0], "force_N": place[1], "shifts": shifted, "mean_s": mean,
            "predicted_s": expected, "z": z}  # fmt: skip


def sentence(
    before: Record, after: Record, points: Sequence[Record], effects: Mapping[str, Effect]
) -> str:
    """State the change of the leading hypothesis, the Bayes factor and the largest residual."""
    old, new = _chances(before), _chances(after)
    first, now = next(iter(old)), next(iter(new))
    if first == now:
        name = plain(now, effects)
        moved = f"The answer stays {name}: {chance(old[now])} before, {chance(new[now])} now"
    else:
        sides = [
            f"{plain(h, effects)} ({chance(old.get(h, 0.0))} before, {chance(new.get(h, 0.0))} now)"
            for h in (first, now)
        ]
        moved = f"The answer moves from {sides[0]} to {sides[1]}"
    rival = first if first != now else next((h for h in old if h not in (now, UNKNOWN)), first)
    missed = ""
    if those := [point for point in points if point["z"] is not None]:
        one = max(those, key=lambda point: abs(point["z"]))
        missed = (
            f"; largest residual of {plain(first, effects)}: {number(one['mismatch_rpm'])} 1/min "
            f"and {number(one['force_N'])} N, {ms(one['mean_s'])} measured, "
            f"{ms(one['predicted_s'])} predicted ({one['z']:+.1f} standard errors)"
        )
    return f"{moved}{_odds(before, after, now, rival, effects)}{missed}."


def _odds(
    before: Record, after: Record, now: Hypothesis, rival: Hypothesis, effects: Mapping[str, Effect]
) -> str:
    """State the Bayes factor of the new readings between two hypotheses, where it is known."""
    old, new = (
        {tuple(one["effects"]): one["evidence_probability"] for one in record["hypotheses"]}
        for record in (before, after)
    )
    values = [record.get(h, 0.0) for record in (new, old) for h in (now, rival)]
    if now == rival or UNKNOWN in (now, rival) or min(values) <= 0.0:
        return ""
    odds = values[0] / values[1] * values[3] / values[2]
    better, worse = (plain(h, effects) for h in ((now, rival) if odds >= 1.0 else (rival, now)))
    odds = max(odds, 1.0 / odds)
    said = f"{min(odds, MOST_ODDS):.2g}" if odds < 100.0 else f"{min(odds, MOST_ODDS):.0f}"
    more = "more than " if odds > MOST_ODDS else ""
    return f"; the new shifts alone are {more}{said} : 1 for {better} against {worse}"


def _chances(record: Record) -> dict[Hypothesis, float]:
    return {tuple(one["effects"]): one["probability"] for one in record["hypotheses"]}
