"""Rows that the surrogate learns from, out of the journal of shifts.

``stored_surrogate`` finds the surrogate of a study's results, or one that the package brings.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup, physics_of
from dogshape.pipeline.record import number_or_none
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.shift_records import (
    OPTIONAL,
    UNCERTAIN,
    Record,
    clutch_record,
    content_key,
)
from dogshape.sim.versions import bundled_root, engine
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, Mix, mix_of, rows_of
from dogshape.surrogate.query import other_physics
from dogshape.surrogate.store import MissingError, Stored, load


def dataset_of(study: Setup, shifts: Iterable[Record]) -> Dataset:
    """Collect the rows of all shifts that are of the study's physics and of these programs.

    Other shifts of a journal (repeats with a finer tolerance, another rise time) are left out. Rows
    are sorted: workers finish in any order, and a fit must not depend on it.
    """
    rows = rows_of(tuple(study.variables), shifts_of(study, shifts))
    return with_rows(study, rows[np.lexsort(np.nan_to_num(rows.T[::-1], nan=-1.0))])


def shifts_of(study: Setup, shifts: Iterable[Record]) -> list[Record]:
    """Select the shifts that are of the study's physics and of these programs."""
    programs, physics, table = engine(), study.physics_hash, study.actuation.table
    keys = {*clutch_record(study.clutch), "engine", *OPTIONAL, *UNCERTAIN}

    def is_of(shift: Record) -> bool:
        if any(shift[name] != version for name, version in programs.items()):
            return False
        record = {key: shift[key] for key in keys if key in shift}
        given = physics_of(record, list(study.variables), table)
        kinds = [kind for kind in ("", "drawn_") if f"{kind}force_N" in shift]
        profiles = (ForceProfile(shift[f"{k}force_N"], shift[f"{k}force_rise_s"]) for k in kinds)
        return content_key(given) == physics and all(table.gives(one) for one in profiles)

    return [shift for shift in shifts if is_of(shift)]


def with_rows(study: Setup, rows: Array) -> Dataset:
    """Make a data set of rows (n, d + 8) of the study's physics."""
    bounds = np.array(list(study.variables.values()), dtype=float)
    names = tuple(study.variables)
    return Dataset(names, bounds[:, 0], bounds[:, 1], rows, study.physics, engine())


def row_record(rows: Array) -> list[list[float | None]]:
    """Convert rows to lists that JSON can hold: None where a number is missing."""
    return [[number_or_none(float(value)) for value in row] for row in rows]


def mix_over(study: Setup, points: Sequence[OperatingPoint]) -> Mix:
    """Mix operating points by their weights, with the time of a retry in the study."""
    return mix_of(points, study.clutch.timeout + study.retraction)


def study_mix(study: Setup) -> Mix:
    """Mix the study's operating points by their weights."""
    return mix_over(study, study.points)


def space_out(study: Setup) -> Path:
    """Return the folder of designs that fill the space of a study."""
    return Path("results") / f"{study.name}-space"


def known_surrogate(study: Setup) -> Stored | None:
    """Return the surrogate that the package brings for the study's physics, None if it has none."""
    brought = _brought(study)
    return None if brought is None else brought[0]


def _brought(study: Setup) -> tuple[Stored, Path] | None:
    for path in sorted(bundled_root().glob("*/surrogate.json")):
        stored = load(path)
        if not other_physics(stored.surrogate.data, study.physics):
            return stored, path
    return None


def stored_surrogate(study: Setup, named: Path | None) -> tuple[Stored, Path]:
    """Return the surrogate to ask and its file.

    The one that is named; else that of the study's space, the package's of the same physics, that
    of the study's search, which knows fewer designs, and the package's of the same name, which
    says what it differs by. DataError where there is none.
    """
    space, own = (StudyFolder(root).surrogate for root in (space_out(study), default_out(study)))
    if named is None and not space.is_file() and (brought := _brought(study)) is not None:
        return brought
    others = (space, own, bundled_root() / study.name / "surrogate.json")
    path = named or next((path for path in others if path.is_file()), own)
    return load(path), path


def own_surrogate(study: Setup, named: Path | None) -> tuple[Stored, Path] | None:
    """Return the same, or None where there is none or only one of other physics that nobody named.

    DataError for a file that is named and not there, or damaged.
    """
    try:
        stored, path = stored_surrogate(study, named)
    except MissingError:
        if named is not None:
            raise
        return None
    apart = other_physics(stored.surrogate.data, study.physics)
    return None if apart and named is None else (stored, path)
