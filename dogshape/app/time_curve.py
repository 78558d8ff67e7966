"""Predicted shift time over one field of the live page, by the surrogate."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dogshape.app.page import Json
from dogshape.pipeline.config.schema import flat_name
from dogshape.pipeline.config.study_file import RequestedPoint, points_of
from dogshape.pipeline.reports.text import PLACE
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.elementwise import Array, Mask
from dogshape.sim.errors import DogshapeError
from dogshape.study import Study
from dogshape.surrogate.query import ask, compare_physics
from dogshape.surrogate.store import Stored

DOG_TABLES = ("dog", "output_dog")
STEPS = 40  #: of the curve


@dataclass(frozen=True)
class TimeCurve:
    """Predicted times with their 95 % intervals over a field, s, (n,); NaN without a time.

    ``feasible`` is whether no closed-form check fails, (n,).
    """

    values: Array
    times: Array
    low: Array
    high: Array
    feasible: Mask


def predict_curve(
    study: Study, key: str, values: Array, *, place: Json, stored: Stored, surrogate: Path | None
) -> TimeCurve | str:
    """Predict over ``values`` of a field; a sentence where the surrogate has no others of it.

    ``place`` is the operating point, ``stored`` the surrogate and ``surrogate`` its file.
    """
    table = key.rpartition(".")[0]
    name = flat_name(key)
    if table in DOG_TABLES and name in stored.surrogate.data.variables:
        return _curve_of_variable(study, name, values, place=place, surrogate=surrogate)
    if key in PLACE and place:
        return _curve_over_points(study, key, values, place=place, stored=stored)
    if key in PLACE:
        return "the times are means over all operating points"
    if not table:
        return "the times are means over the relative angle"
    with suppress(DogshapeError):
        other_study = study.replace_keys({key: float(values[-1])})
        if not compare_physics(stored.surrogate.data, other_study.config.physics):
            return "the shift time does not depend on it"
    return "the surrogate has one value of it"


def slider_values(ends: tuple[float, float], *, is_whole: bool) -> Array:
    """Return values between the ends of a slider, evenly spaced or all whole numbers."""
    low, high = ends
    if is_whole:
        return np.arange(round(low), round(high) + 1, dtype=float)
    return np.linspace(low, high, STEPS + 1)


def _curve_of_variable(
    study: Study, name: str, values: Array, *, place: Json, surrogate: Path | None
) -> TimeCurve:
    """Predict over a variable of the search, a key of the dog."""
    predictions = study.predict(pd.DataFrame({name: values}), surrogate=surrogate, **place)
    times = predictions.times
    return TimeCurve(values, times.time, times.low, times.high, predictions.checks.feasible)


def _curve_over_points(
    study: Study, key: str, values: Array, *, place: Json, stored: Stored
) -> TimeCurve:
    """Predict over mismatch or force of one operating point; the checks stay those of the study."""
    config = study.config
    rows = []
    for value in values:
        mix = study_mix(config, points_of(config, RequestedPoint(**(place | {key: float(value)}))))
        expected = ask(stored.surrogate, config.prototype, mix, config.physics).expected
        row = [np.nan] * 3
        if expected is not None:
            row = [expected.time, expected.low, expected.high]
        rows.append(row)
    times, low, high = np.array(rows).T
    return TimeCurve(values, times, low, high, np.ones(len(values), dtype=bool))
