"""Is *none* said where nothing needs doing, and only there.

The engine of a set is asked once more for the mean times of each case over many even angles, which
have no scatter; late shifts are left out. Less the same means of the simulation without any effect
they are the true gap, which the diagnosis cannot know. It is within the margin where its root mean
square over the operating points, each over the margin of the diagnosis there, stays below one.
Things outside the list, some of which change over the series, are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.stand_file import USUAL_MARGIN, Margin
from dogshape.diagnosis.terms import Array
from dogshape.validation.blind.even_means import even_means
from dogshape.validation.blind.intervals import share
from dogshape.validation.blind.stand import Point, Stand
from dogshape.validation.blind.true_effects import truth_of

Record = dict[str, Any]  #: key, results and score of a set, as they are kept in JSON

ANGLES = 96  #: even angles; of eight a mean at slow points is off by as much as the margin


def true_means(
    stand: Stand, points: Sequence[Point], cases: Mapping[str, Record], engine: str
) -> dict[str, Array]:
    """Simulate the mean times of cases without scatter, s, (points,), by case."""
    return {
        name: even_means(stand, points, truth_of(case["parameters"], {}), engine, ANGLES)
        for name, case in cases.items()
        if not case["outside"]
    }


def in_margins(means: Array, simulated: Array, margin: Margin = USUAL_MARGIN) -> float:
    """Compute a gap in margins below which nothing needs doing, root mean square over points.

    Both are mean times in s, (points,).
    """
    return float(np.sqrt(np.nanmean(((means - simulated) / margin.of(simulated)) ** 2)))


def equivalence_figures(
    true: Mapping[str, Array], simulated: Array, results: Mapping[str, Record]
) -> Record:
    """Count verdicts *none* by the true gap.

    Parameters
    ----------
    true : mean times by case, s, (points,).
    simulated : the same without any effect, in the simulation.
    results : by case; those that were refused are left out.
    """
    rows = []
    for name, means in true.items():
        found = results[name].get("diagnosis", {})
        if not found.get("discrepancy"):
            continue
        margin = found["discrepancy"]
        limit = Margin(margin["margin_share"], margin["margin_least_s"])
        ratio = in_margins(means, simulated, limit)
        rows.append((ratio, found["verdict"] == "none"))
    said = [ratio for ratio, none in rows if none]
    return {
        "n": len(rows),
        "within_of_said_none": share(ratio < 1.0 for ratio in said),
        "largest_ratio_of_said_none": max(said, default=None),
        "said_none_of_within": share(none for ratio, none in rows if ratio < 1.0),
    }
