r"""How much of a pair's gap each of its effects makes that the other does not.

A pair whose weaker effect moves the means by less than they scatter looks like the stronger one
alone, to any method. With :math:`\bar t` the means of the pair and :math:`\bar t_e` those without
the effect *e*, at even angles of the same engine, the size of *e* beside its partner is the root
mean square over the operating points of

.. math:: z = (\bar t - \bar t_e) / (\sigma_0 / \sqrt n),

:math:`\sigma_0/\sqrt n` the sampling error of the case's means. A pair can be seen whole where both
effects have at least two sampling errors.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.blind.effects import truth_of
from diagnosis.blind.engine import Draw, Engine
from diagnosis.blind.marks import LEAST
from diagnosis.blind.sealed import pool, read, write
from diagnosis.blind.stand import Point, Stand, Truth, read_stand

Record = dict[str, Any]

ANGLES = 8  #: even ones, at each operating point
KEPT = "partners.json"  #: beside the cases


def partner_gaps(folder: Path, key: Record, jobs: int = 1) -> dict[str, float]:
    """Return for each pair of a set the size of its weaker effect, in sampling errors.

    It takes 45 s of processor time a pair at 28 operating points, and is kept in the folder.
    """
    seal = hashlib.sha256(json.dumps(key).encode()).hexdigest()
    path = folder / KEPT
    if path.exists() and (kept := read(path, "remove it")).get("key") == seal:
        return {name: float(value) for name, value in kept["weaker"].items()}
    pairs = {name: case for name, case in key["cases"].items() if case["kind"] == "pair"}
    points = tuple(Point(*point) for point in key["points"])
    with pool(jobs) as submit:
        pending = {
            name: submit(weaker_of, read_stand(folder / "cases" / name), points, case, key)
            for name, case in pairs.items()
        }
        found = {name: float(future.result()) for name, future in pending.items()}
    write(path, json.dumps({"key": seal, "weaker": found}, indent=1))
    return found


def weaker_of(stand: Stand, points: Sequence[Point], case: Record, key: Record) -> float:
    """Return the size of the weaker effect of a pair beside the other, in sampling errors."""
    every = case["parameters"]
    whole = even_means(stand, points, truth_of(every, {}))
    errors = np.array(
        [
            _sampling_error(free, len(mine))
            for free, mine in zip(key["reference_s"], case["times_s"], strict=True)
        ]
    )
    sizes = []
    for name in every:
        rest = {other: values for other, values in every.items() if other != name}
        z = (whole - even_means(stand, points, truth_of(rest, {}))) / errors
        sizes.append(float(np.sqrt(np.nanmean(z**2))))
    return min(sizes)


def even_means(stand: Stand, points: Sequence[Point], truth: Truth) -> np.ndarray:
    """Return mean times at even angles, weighted as the truth draws them, s, (points,)."""
    turns = (np.arange(ANGLES) + 0.5) / ANGLES
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    engine, found = Engine(stand, truth), []
    for point in points:
        times = np.array([engine.shift(point, Draw(t * stand.pitch)).time for t in turns], float)
        having = np.isfinite(times)
        found.append(np.average(times[having], weights=weights[having]) if having.any() else np.nan)
    return np.array(found)


def _sampling_error(free: Sequence[float | None], count: int) -> float:
    base = [t for t in free if t is not None]
    spread = float(np.std(base, ddof=1)) if len(base) > 1 else LEAST
    return max(LEAST, spread) / float(np.sqrt(count))
