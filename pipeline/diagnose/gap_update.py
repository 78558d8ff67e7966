"""Change of a diagnosis by new readings: both answers, the Bayes factor, and the largest residual.

In the folder of the diagnosis stand ``gap.json`` of the last diagnosis, ``gap-0.json`` of the first
one, ``gap-1.json`` of that after the first update, and ``updates.json``, a list of all updates.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.table import Row, Sheet
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.report.wording import chance, headline, ms
from dogshape.diagnosis.terms import UNKNOWN, Hypothesis, plain
from dogshape.sim.effect import Effect
from dogshape.sim.errors import StorageError, number
from dogshape.sim.files import write_whole

UPDATES, RECORD, TABLE = "updates.json", "gap.json", "cells.csv"
SHOWN = 0.001  #: probability from which a hypothesis is in the record of an update
CREDIBLE = 0.9  #: probability of the hypotheses that a headline names
MOST_ODDS = 1e6  #: odds above which only that is said
Record = dict[str, Any]  #: gap.json
Place = tuple[float, float]  #: mismatch, 1/min, and force, N


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
        raise StorageError(
            f"{path} is damaged ({type(error).__name__}); diagnose the data set again with --out"
        ) from error


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
    return f"{moved}{_odds(before, after, now, rival, effects)}{_missed(points, first, effects)}."


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


def _missed(points: Sequence[Record], first: Hypothesis, effects: Mapping[str, Effect]) -> str:
    """State the new mean that lies farthest from the earlier prediction, in standard errors."""
    those = [point for point in points if point["z"] is not None]
    if not those:
        return ""
    one = max(those, key=lambda point: abs(point["z"]))
    return (
        f"; largest residual of {plain(first, effects)}: {number(one['mismatch_rpm'])} 1/min and "
        f"{number(one['force_N'])} N, {ms(one['mean_s'])} measured, {ms(one['predicted_s'])} "
        f"predicted ({one['z']:+.1f} standard errors)"
    )


def _chances(record: Record) -> dict[Hypothesis, float]:
    return {tuple(one["effects"]): one["probability"] for one in record["hypotheses"]}
