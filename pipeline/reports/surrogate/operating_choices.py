"""Operating points that the page can be asked about: all of the study's, or one mismatch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.maps import thinned
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.sobol_indices import EVEN, LOG, Input

SINGLE = 4  #: mismatches that are shown on their own


@dataclass(frozen=True)
class Operating:
    """Operating points with the name that the page gives them; ``mismatch`` is None for all."""

    name: str
    mix: Mix
    mismatch: float | None


def choices(study: Setup) -> list[Operating]:
    """List all of the study's operating points, and single mismatches at the middle force."""
    mix, force = study_mix(study), middle(study.forces)
    single = [
        Operating(
            f"{mismatch:.4g} 1/min, {force:.4g} N",
            Mix(np.array([[mismatch, force]]), np.ones(1), mix.retry),
            mismatch,
        )
        for mismatch in thinned(sorted(set(study.mismatches)), SINGLE)
    ]
    if len(mix.points) == 1:
        return single
    return [Operating(f"all {len(mix.points)} operating points", mix, None), *single]


def operating_inputs(study: Setup) -> list[Input]:
    """Return mismatch and force over the study's ranges, without what has one value only."""
    given = {"mismatch_rpm": study.mismatches, "force_N": study.forces}
    return [
        Input(name, min(values), max(values), LOG if min(values) > 0.0 else EVEN)
        for name, values in given.items()
        if min(values) < max(values)
    ]


def middle(values: Sequence[float]) -> float:
    """Return the value in the middle, the upper one of two."""
    ordered = sorted(set(values))
    return ordered[len(ordered) // 2]
