"""Data and files of the surrogate of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import number_or_none
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root, engine
from dogshape.surrogate.dataset import COLUMNS, Dataset, Mix, grid_of
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import MissingError, Stored, load


def with_rows(study: Setup, rows: Array | Sequence[Sequence[float | None]]) -> Dataset:
    """Collect the designs of rows (n, d + 8) that have every operating point of the study."""
    low, high = np.array(list(study.variables.values()), dtype=float).T
    names, mix = tuple(study.variables), study_mix(study)
    whole = np.array(rows, dtype=float).reshape(-1, len(names) + len(COLUMNS))
    return Dataset(names, low, high, study.physics, engine(), mix, grid_of(whole, mix))


def row_record(rows: Array) -> list[list[float | None]]:
    """Convert rows to lists that JSON can hold: None where a number is missing."""
    return [[number_or_none(float(value)) for value in row] for row in rows]


def study_mix(study: Setup, points: Sequence[OperatingPoint] | None = None) -> Mix:
    """Mix operating points, by default the study's, by their weights, with the time of a retry."""
    points = study.points if points is None else points
    # The mean rest of faces on half a pitch: a surrogate knows no other.
    quarter = np.array([0.25 * study.clutch.dog.pitch_angle])
    freed, lost = study.set_point.passages(quarter)[0], study.clutch.timeout + study.retraction
    weights = np.array([point.weight for point in points])
    rows = [(point.mismatch / RPM, point.profile.force) for point in points]
    return Mix(np.array(rows), weights / weights.sum(), float(np.nan_to_num(freed, nan=lost)))


def stored_surrogate(study: Setup, named: str | Path | None) -> tuple[Stored, Path]:
    """Return the surrogate to ask and its file; DataError where there is none.

    The one that is named; else that of the study's space, the package's of the same physics, that
    of the study's search, and the package's of the same name, whose differences are named.
    """
    space, own = (StudyFolder(default_out(study, part)).surrogate for part in ("-space", ""))
    bundled = bundled_root().glob("*/surrogate.json")
    for path in sorted(bundled) if named is None and not space.is_file() else ():
        stored = load(path)
        if not compare_physics(stored.surrogate.data, study.physics):
            return stored, path
    others = (space, own, bundled_root() / study.name / "surrogate.json")
    path = Path(named or next((path for path in others if path.is_file()), own))
    return load(path), path


def own_surrogate(study: Setup, named: str | Path | None) -> tuple[Stored, Path] | None:
    """Return the same, None where none of the study's physics is there and none is named."""
    try:
        stored, path = stored_surrogate(study, named)
    except MissingError:
        if named is not None:
            raise
        return None
    apart = compare_physics(stored.surrogate.data, study.physics)
    return None if apart and named is None else (stored, path)
