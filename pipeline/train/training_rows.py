"""From the journal of shifts to the rows that the surrogate learns from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dogshape.pipeline.config.study_file import Study, physics_of
from dogshape.pipeline.store.result_records import number_or_none
from dogshape.sim.shift.actuation import ForceProfile, RiseTable
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.shift_records import (
    OPTIONAL,
    UNCERTAIN,
    Record,
    clutch_record,
    content_key,
)
from dogshape.sim.versions import engine
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, rows_of
from dogshape.surrogate.mix import Mix, mix_of


def dataset_of(study: Study, shifts: Iterable[Record]) -> Dataset:
    """Return the rows of all shifts that are of the study's physics and of these programs.

    What else a journal holds (repeats with a finer tolerance, another rise time) is left out.
    """
    programs, physics, table = engine(), study.physics_hash, study.actuation.table
    keys = {*clutch_record(study.clutch), *OPTIONAL, *UNCERTAIN}

    def is_of(shift: Record) -> bool:
        if any(shift[name] != version for name, version in programs.items()):
            return False
        record = {key: shift[key] for key in keys if key in shift}
        given = physics_of(record, list(study.variables), table)
        return content_key(given) == physics and _rises_as(table, shift)

    own = [shift for shift in shifts if is_of(shift)]
    return with_rows(study, rows_of(tuple(study.variables), own))


def with_rows(study: Study, rows: Array) -> Dataset:
    """Return rows (n, d + 8) of the study's physics as a data set."""
    bounds = np.array(list(study.variables.values()), dtype=float)
    names = tuple(study.variables)
    return Dataset(names, bounds[:, 0], bounds[:, 1], rows, study.physics, engine())


def row_record(rows: Array) -> list[list[float | None]]:
    """Return rows as lists that JSON can hold: None where a number is missing."""
    return [[number_or_none(float(value)) for value in row] for row in rows]


def _rises_as(table: RiseTable, shift: Record) -> bool:
    """Tell whether the force of a shift rose as the study's table says, drawn or not."""
    kinds = [kind for kind in ("", "drawn_") if f"{kind}force_N" in shift]
    profiles = [ForceProfile(shift[f"{k}force_N"], shift[f"{k}force_rise_s"]) for k in kinds]
    return all(table.gives(profile) for profile in profiles)


def mix_over(study: Study, points: Sequence[OperatingPoint]) -> Mix:
    """Return operating points as a mix, with what a retry costs in the study."""
    return mix_of(points, study.clutch.timeout + study.retraction)


def study_mix(study: Study) -> Mix:
    """Return the study's operating points as a mix."""
    return mix_over(study, study.points)
