"""The surrogate of times for a page: its rows, weights and what it takes to find its errors.

The page predicts as ``surrogate.model.Surrogate.expected`` does, with all rows and no shortcut.
The inverse root of the rows' covariance has half of its size and is kept with seven digits, which
moves no bound by more than a few millionths of the time.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.surrogate.covariance import Part
from dogshape.surrogate.mix_times import SHAPE, MixTimes
from dogshape.surrogate.model import Share, Surrogate
from dogshape.surrogate.process import ANGLES, WIDTH, timed
from dogshape.surrogate.query import CHAMFER, FAR, HOLDS


def packed(study: Setup, surrogate: Surrogate) -> Row:
    """Return all that the page needs to predict; arrays as text (``array_text``)."""
    data, process = surrogate.data, surrogate.times
    rows = process.covariance.split(process.inputs)[1]
    low, high = data.x.min(axis=0), data.x.max(axis=0)
    mix = study_mix(study)
    angles = [i for i, name in enumerate(data.variables) if name in ANGLES]
    return {
        "variables": list(data.variables),
        "low": data.low.tolist(),
        "high": data.high.tolist(),
        "simulated": [low.tolist(), high.tolist()],
        "points": [data.points.min(axis=0).tolist(), data.points.max(axis=0).tolist()],
        "holds": {
            "place": list(data.variables).index(CHAMFER) if CHAMFER in data.variables else None,
            "friction": data.physics["static_friction"],
            "reason": HOLDS,
            "engaged": LEAST_ENGAGED,
        },
        "ridge": {"angles": angles, "friction": data.physics["dynamic_friction"], "width": WIDTH},
        "designs": data.designs.tolist(),
        "spacing": surrogate.spacing,
        "far": FAR,
        "known": array_text(surrogate.known, "f8"),
        "place": array_text(data.design_of_row[timed(data)], "i4"),
        "rows": array_text(rows, "f8"),
        "weights": array_text(process.weights, "f8"),
        "root": array_text(process.whitening[np.tril_indices(len(rows))], "f4"),
        "centre": process.centre,
        "parts": [_part(part) for part in process.covariance.parts],
        "share": _share(surrogate.share, data.design_of_row),
        "mix": {"points": mix.points.tolist(), "weights": mix.weights.tolist()},
        "retry": mix.retry,
        "own": _own(surrogate.own),
    }


def _own(own: MixTimes | None) -> Row | None:
    """Return the processes over designs alone; the page works out their roots."""
    if own is None:
        return None
    names, physics = list(own.about.variables), own.about.physics
    low, span = (None, None) if own.spans is None else (end.tolist() for end in own.spans)
    shape = [
        {"place": names.index(name) if name in names else None, "value": physics.get(name)}
        for name in SHAPE
    ]
    return {
        "points": own.mix.points.tolist(),
        "weights": own.mix.weights.tolist(),
        "known": array_text(own.inputs, "f8"),
        "processes": [
            {
                "weights": array_text(process.weights, "f8"),
                "centre": process.centre,
                "noise": array_text(process.noise, "f8"),
                "parts": [_part(part) for part in process.covariance.parts],
            }
            for process in own.processes
        ],
        "angles": [i for i, name in enumerate(names) if name in ANGLES],
        "shape": None if own.spans is None else shape,
        "low": low,
        "span": span,
    }


def array_text(values: Any, kind: str) -> str:
    """Write an array as text: little-endian numbers of a kind (``f8``), in base 64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()).decode()


def _part(part: Part) -> Row:
    return {
        "rough": part.rough,
        "variance": part.variance,
        "growth": list(part.growth),
        "design": None if part.design is None else part.design.tolist(),
        "point": None if part.point is None else part.point.tolist(),
    }


def _share(share: Share, place: Any) -> Row:
    """Return the counts of shifts that engage, by row; without a length all rows count alike."""
    cut = share.designs
    return {
        "length": None if np.isinf(share.length) else share.length,
        "strength": share.strength,
        "overall": share.overall,
        "place": array_text(place, "i4"),
        "rows": array_text(share.inputs[:, cut:], "f8"),
        "engaged": array_text(share.engaged, "f8"),
        "lost": array_text(share.shifts - share.engaged, "f8"),
    }
