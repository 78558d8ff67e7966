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

import json
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.prediction.outliers import bulk
from dogshape.validation.blind.advised_test import stage_of
from dogshape.validation.blind.case_marks import counted, sampling_error
from dogshape.validation.blind.data import even_times
from dogshape.validation.blind.sealed import Advance, ignore, manifest_of, pool, read, write
from dogshape.validation.blind.stand import Point, Stand, Truth
from dogshape.validation.blind.true_effects import truth_of

Record = dict[str, Any]
Sizes = dict[str, float]  #: by effect

ANGLES = 8  #: even ones, at each operating point
KEPT = "partners.json"  #: beside the cases


def partner_gaps(
    folder: Path, key: Record, jobs: int = 1, advance: Advance | None = None
) -> dict[str, Sizes]:
    """Return for each pair of a set the size of each effect beside the other, in sampling errors.

    It takes 45 s of processor time a pair at 28 operating points. What is finished is kept in the
    folder; ``advance`` counts shifts.
    """
    path, seal = folder / KEPT, manifest_of(folder)["key_sha256"]
    found = _kept(folder)
    with pool(jobs) as submit:
        pending = {}
        for name, case in _left(folder, key).items():
            stage = stage_of(folder, key, name)
            pending[submit(sizes_of, stage.stand, stage.points, case, key)] = name
        for future in as_completed(pending):
            name = pending[future]
            found[name] = future.result()
            write(path, json.dumps({"key": seal, "sizes": found}, indent=1))
            (advance or ignore)(_shifts(key["cases"][name], key))
    return found


def shifts_left(folder: Path, key: Record) -> int:
    """Return how many shifts ``partner_gaps`` has to make."""
    return sum(_shifts(case, key) for case in _left(folder, key).values())


def _kept(folder: Path) -> dict[str, Sizes]:
    """Return what is known of this set; of another set it tells nothing."""
    path = folder / KEPT
    kept = read(path, "remove it") if path.exists() else {}
    if kept.get("key") != manifest_of(folder)["key_sha256"]:
        return {}
    return dict(kept["sizes"])


def _left(folder: Path, key: Record) -> dict[str, Record]:
    found = _kept(folder)
    cases: dict[str, Record] = key["cases"]
    return {n: case for n, case in cases.items() if case["kind"] == "pair" and n not in found}


def _shifts(case: Record, key: Record) -> int:
    """Return the shifts of a pair with both effects and without either."""
    return (1 + len(case["parameters"])) * len(key["points"]) * ANGLES


def sizes_of(stand: Stand, points: Sequence[Point], case: Record, key: Record) -> Sizes:
    """Return the size of each effect of a pair beside the other, in sampling errors."""
    every = case["parameters"]
    whole = even_means(stand, points, truth_of(every, {}))
    given = zip(key["reference_s"], case["times_s"], strict=True)
    errors = np.array([sampling_error(free, len(mine)) for free, mine in given])
    sizes = {}
    for name in every:
        rest = {other: values for other, values in every.items() if other != name}
        z = (whole - even_means(stand, points, truth_of(rest, {}))) / errors
        sizes[name] = float(np.sqrt(counted((z[np.isfinite(z)] ** 2).tolist())))
    return sizes


def even_means(stand: Stand, points: Sequence[Point], truth: Truth) -> np.ndarray:
    """Return mean times at even angles, weighted as the truth draws them, s, (points,)."""
    turns = (np.arange(ANGLES) + 0.5) / ANGLES
    weights = np.exp(truth.concentration * (np.cos(2.0 * np.pi * (turns - truth.centre)) - 1.0))
    times = np.array(even_times(stand, points, ANGLES, truth), float)
    having = np.isfinite(bulk(times))
    # Late shifts are left out, as in the size of a gap; where no shift engages there is no mean.
    share = np.where(having.any(axis=1), (having * weights).sum(axis=1), np.nan)
    found: np.ndarray = (np.where(having, times, 0.0) * weights).sum(axis=1) / share
    return found
