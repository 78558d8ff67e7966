"""From the journal of shifts to the rows that the surrogate learns from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pipeline.config import Study, physics_of, profile_for
from pipeline.records import number_or_none
from sim.clutch import OperatingPoint
from sim.records import Record, clutch_record, content_key
from sim.versions import versions
from surrogate.covariance import Array
from surrogate.dataset import Dataset, rows_of
from surrogate.mix import Mix, mix_of

ENGINE = ("dogshape", "drake")  #: programs whose versions a row depends on


def dataset_of(study: Study, shifts: Iterable[Record]) -> Dataset:
    """Return the rows of all shifts that are of the study's physics and of these programs.

    What else a journal holds (repeats with a finer tolerance, another rise time) is left out.
    """
    engine, keys, physics = _engine(), tuple(clutch_record(study.clutch)), study.physics_hash

    def is_of(shift: Record) -> bool:
        if any(shift[name] != version for name, version in engine.items()):
            return False
        record = {key: shift.get(key) for key in keys}
        given = physics_of(record, list(study.variables), study.file)
        return content_key(given) == physics and _rises_as(study, shift)

    own = [shift for shift in shifts if is_of(shift)]
    return with_rows(study, rows_of(tuple(study.variables), own))


def with_rows(study: Study, rows: Array) -> Dataset:
    """Return rows (n, d + 8) of the study's physics as a data set."""
    bounds = np.array(list(study.variables.values()), dtype=float)
    names = tuple(study.variables)
    return Dataset(names, bounds[:, 0], bounds[:, 1], rows, study.physics, _engine())


def row_record(rows: Array) -> list[list[float | None]]:
    """Return rows as lists that JSON can hold: None where a number is missing."""
    return [[number_or_none(float(value)) for value in row] for row in rows]


def _engine() -> Record:
    return {name: versions()[name] for name in ENGINE}


def _rises_as(study: Study, shift: Record) -> bool:
    """Tell whether the force of a shift rose as the study's table says."""
    force, known = shift["force_N"], study.file.actuation.force_N
    if not min(known) <= force <= max(known):
        return False
    return bool(abs(profile_for(study.file, force).rise - shift["force_rise_s"]) < 1e-9)


def mix_over(study: Study, points: Sequence[OperatingPoint]) -> Mix:
    """Return operating points as a mix, with what a retry costs in the study."""
    return mix_of(points, study.clutch.timeout + study.retraction)


def study_mix(study: Study) -> Mix:
    """Return the study's operating points as a mix."""
    return mix_over(study, study.points)
