"""Effects and Sobol indices of a study's variables, from its surrogate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import islice

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.train.filling import filling_designs
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range
from dogshape.surrogate.sensitivity import (
    EVEN,
    LOG,
    SAMPLES,
    WHOLE,
    Indices,
    Input,
    effects,
    indices,
)

Say = Callable[[str], None]

DESIGNS = 150  #: feasible designs that an effect is the mean over
APART = 70_000  #: added to the seed of the surrogate's data, so that none of these is among them
BOX = 0.1  #: half width of the box of the indices, in shares of the search range


def learned(study: Setup, surrogate: Surrogate, over: Over, say: Say) -> Row:
    """Compute effects and indices over the operating points of ``over``."""
    say(f"effects over {DESIGNS} feasible designs")
    effect = _effects_record(study, surrogate, over)
    say("Sobol indices")
    return {"effects": effect, "indices": _indices_record(study, surrogate, over)}


def _effects_record(study: Setup, surrogate: Surrogate, over: Over) -> Row:
    names = surrogate.data.variables
    seed = study.file.surrogate.seed + APART
    designs = islice(filling_designs(study, seed, border=False), DESIGNS)
    x = study.rows(designs)
    return {
        "designs": len(x),
        "outside_trained_range": 1.0 - float(in_range(surrogate, x).mean()),
        "mean_expected_shift_time_s": float(over.predict(x)[0].mean()),
        "variables": [
            {
                "variable": one.variable,
                "values": _rounded(one.values),
                "effect_s": _rounded(one.effect),
                "low_s": _rounded(one.low),
                "high_s": _rounded(one.high),
                "distinguishable": one.clear,
            }
            for one in effects(over, names, x)
        ],
    }


def _indices_record(study: Setup, surrogate: Surrogate, over: Over) -> list[Row]:
    """Record the indices over designs, and over designs and operating points at once."""
    cut, retry = len(surrogate.data.variables), study.clutch.timeout + study.retraction
    box, seed = _box(study, surrogate.data), study.file.surrogate.seed + 1
    alone = indices(box, lambda z: over.predict(z)[0], SAMPLES, seed)
    found = [_index_record("designs", alone)]
    operating = _operating_inputs(study)
    if operating:
        fixed = {"mismatch_rpm": study.mismatches[0],
                 "force_N": _middle(study.forces)}  # fmt: skip

        def times(z: Array) -> Array:
            given = {one.name: z[:, cut + k] for k, one in enumerate(operating)}
            points = [given.get(name, np.full(len(z), value)) for name, value in fixed.items()]
            return surrogate.times_at(z[:, :cut], np.column_stack(points), retry)

        whole = indices([*box, *operating], times, SAMPLES, seed)
        found.append(_index_record("designs and operating points", whole))
    return found


def _box(study: Setup, data: Dataset) -> list[Input]:
    """Return the box about the study's own design, within the simulated designs.

    A design beyond them has its box about the nearest value that was simulated.
    """
    sides = []
    for name, values in zip(data.variables, data.x.T, strict=True):
        known_low, known_high = float(values.min()), float(values.max())
        low, high = study.variables[name]
        centre = min(max(study.prototype[name], known_low), known_high)
        half = BOX * (high - low)
        if name == "count":
            half = max(1.0, round(half))
        ends = max(centre - half, known_low), min(centre + half, known_high)
        sides.append(Input(name, *ends, WHOLE) if name == "count" else Input(name, *ends))
    return sides


def _operating_inputs(study: Setup) -> list[Input]:
    """List mismatch and force over the study's ranges, without one that has a single value."""
    given = {"mismatch_rpm": study.mismatches, "force_N": study.forces}
    return [
        Input(name, min(values), max(values), LOG if min(values) > 0.0 else EVEN)
        for name, values in given.items()
        if min(values) < max(values)
    ]


def _middle(values: Sequence[float]) -> float:
    """Return the value in the middle, the upper one of two."""
    ordered = sorted(set(values))
    return ordered[len(ordered) // 2]


def _index_record(over: str, found: Indices) -> Row:
    return {
        "over": over,
        "inputs": [
            {
                "variable": one.name,
                "first": float(found.first[k]), "first_half_width": float(found.first_half[k]),
                "total": float(found.total[k]), "total_half_width": float(found.total_half[k]),
            }
            for k, one in enumerate(found.inputs)
        ],
    }  # fmt: skip


def _rounded(values: Iterable[float]) -> list[float]:
    """Round numbers to six digits for JSON."""
    return [float(f"{value:.6g}") for value in values]
