"""Folders to begin with: a study or a bench of one's own (``dogshape init``)."""

from __future__ import annotations

from typing import Any

from dogshape.pipeline.drafts.bench_folder import BenchDraft, guessed, write_bench
from dogshape.pipeline.drafts.sources import source_of
from dogshape.pipeline.drafts.study_folder import askable, use_of, write_study
from dogshape.pipeline.drafts.targets import require_free

__all__ = [
    "CLUTCH",
    "USE",
    "BenchDraft",
    "askable",
    "default_use",
    "default_values",
    "guessed",
    "require_free",
    "write_bench",
    "write_study",
]

#: Words for the keys of a clutch that are worth a question.
CLUTCH = {
    "dog.count": "number of dogs",
    "dog.chamfer_deg": "chamfer of the face, deg",
    "dog.traction_deg": "side angle of the traction flank, deg",
    "dog.braking_deg": "side angle of the braking flank, deg",
    "dog.height_mm": "height of the dogs, mm",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    "sliding.mass_kg": "moving mass with all that moves along, kg",
    "sliding.inertia_kgm2": "inertia of the shifted ring and what turns with it, kg m2",
    "output.inertia_kgm2": "inertia of the other side, referred to the dogs, kg m2",
}
#: Words for the keys of what a study's clutch has to do.
USE = {
    "load.torque_Nm": "rated torque at the dogs, N m",
    "actuation.force_N": "forces that the actuator can have, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "operating.mismatch_rpm": "mismatches at which it shifts, 1/min",
    "operating.force_N": "forces with which it shifts, N",
}


def default_values(origin: str) -> dict[str, Any]:
    """Give the values of the clutch that a draft would begin with, by dotted key.

    Raises InputError where ``origin`` is neither a study nor a bench.
    """
    return source_of(origin).dog_values


def default_use(origin: str) -> dict[str, Any]:
    """Give the values of ``USE`` that a draft of a study would begin with, by dotted key.

    Those that its file says otherwise, as by a distribution, are left out. Raises InputError as
    ``default_values`` does.
    """
    return use_of(origin, USE)
