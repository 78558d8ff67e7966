"""Is *none* said where nothing needs doing, and only there.

The key of a set whose engine is cheap has the mean times of each case over even angles, without the
scatter of its shifts. Less what the diagnosis simulates without any effect they are the true gap,
which the diagnosis cannot know. It is within the margin where its root mean square over the
operating points, each over the margin of the diagnosis there, stays below one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dogshape.validation.blind.intervals import share

Record = dict[str, Any]


def true_ratio(case: Record, found: Record) -> float | None:
    """Compute the true gap over the margin; None where the record or the key has too little."""
    if "even_s" not in case or not found.get("discrepancy"):
        return None
    bench = np.array([_mean(times) for times in case["times_s"]])
    gaps = np.array([np.nan if row["gap_s"] is None else row["gap_s"] for row in found["where"]])
    even = np.array([np.nan if one is None else one for one in case["even_s"]], dtype=float)
    simulated = bench - gaps
    margin = found["discrepancy"]
    limit = np.maximum(margin["margin_share"] * simulated, margin["margin_least_s"])
    over = ((even - simulated) / limit) ** 2
    having = np.isfinite(over)
    return float(np.sqrt(over[having].mean())) if having.any() else None


def _mean(times: list[float | None]) -> float:
    ended = [time for time in times if time is not None]
    return float(np.mean(ended)) if ended else np.nan


def equivalence_figures(key: Record, results: Mapping[str, Record]) -> Record | None:
    """Count verdicts *none* by the true gap; None for a set whose key has no true gaps."""
    rows = []
    for name, case in key["cases"].items():
        found = results[name].get("diagnosis", {})
        ratio = true_ratio(case, found)
        if ratio is not None:
            rows.append((ratio, found["verdict"] == "none", found["discrepancy"]))
    if not rows:
        return None
    said = [ratio for ratio, none, _ in rows if none]
    return {
        "n": len(rows),
        "within_of_said_none": share(ratio < 1.0 for ratio in said),
        "largest_ratio_of_said_none": max(said, default=None),
        "said_none_of_within": share(none for ratio, none, _ in rows if ratio < 1.0),
    }
