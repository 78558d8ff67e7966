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
from dogshape.sim.versions import bundled_root, engine_versions
from dogshape.surrogate.dataset import COLUMNS, Dataset, Mix, grid_of
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import MissingError, Stored, load


def with_rows(study: Setup, rows: Array | Sequence[Sequence[float | None]]) -> Dataset:
    """Collect the designs of rows (n, d + 8) that have every operating point of the study."""
    names = tuple(study.variables)
    low, high = np.array(list(study.variables.values()), dtype=float).T
    mix = study_mix(study)
    table = np.array(rows, dtype=float).reshape(-1, len(names) + len(COLUMNS))
    return Dataset(names, low, high, study.physics, engine_versions(), mix, grid_of(table, mix))


def row_record(rows: Array) -> list[list[float | None]]:
    """Convert rows (n, m) to lists for JSON, None where a number is missing."""
    return [[number_or_none(float(value)) for value in row] for row in rows]


def study_mix(study: Setup, points: Sequence[OperatingPoint] | None = None) -> Mix:
    """Mix operating points, by default the study's, by their weights, with the time of a retry."""
    points = study.points if points is None else points
    # The mean angle that a set-point has to pass: the surrogate distinguishes no others.
    quarter_pitch = np.array([0.25 * study.clutch.dog.pitch_angle])
    freed_time = study.set_point.passages(quarter_pitch)[0]
    retry_time = study.clutch.timeout + study.retraction
    weights = np.array([point.weight for point in points])
    rows = [(point.mismatch / RPM, point.profile.force) for point in points]
    hang_time = float(np.nan_to_num(freed_time, nan=retry_time))
    return Mix(np.array(rows), weights / weights.sum(), hang_time)


def stored_surrogate(study: Setup, file: str | Path | None) -> tuple[Stored, Path]:
    """Load the surrogate for a study, and return it with its path; DataError if there is none.

    The first of these: ``file``; the fit of the study's space; the package's with the same
    physics; that of the study's search; and the package's with the same name, whose differences
    are listed on use.
    """
    space_file = StudyFolder(default_out(study, "-space")).surrogate
    search_file = StudyFolder(default_out(study)).surrogate
    if file is None and not space_file.is_file():
        for path in sorted(bundled_root().glob("*/surrogate.json")):
            stored = load(path)
            if not compare_physics(stored.surrogate.data, study.physics):
                return stored, path
    candidates = (space_file, search_file, bundled_root() / study.name / "surrogate.json")
    existing = next((path for path in candidates if path.is_file()), search_file)
    path = Path(file or existing)
    return load(path), path


def matching_surrogate(study: Setup, file: str | Path | None) -> tuple[Stored, Path] | None:
    """Load the surrogate as ``stored_surrogate``; None if all have other physics.

    A surrogate that ``file`` names may have other physics.
    """
    try:
        stored, path = stored_surrogate(study, file)
    except MissingError:
        if file is not None:
            raise
        return None
    if file is None and compare_physics(stored.surrogate.data, study.physics):
        return None
    return stored, path
