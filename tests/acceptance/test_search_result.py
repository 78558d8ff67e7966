"""The design that the README names, simulated again at angles of its own."""

from __future__ import annotations

import math

from pipeline.config import load_study
from pipeline.design import design_of
from pipeline.evaluation import evaluate
from pipeline.executor import scratch_executor

#: What ``make study`` found, rounded as in the README.
BEST = {
    "chamfer_deg": 13.20,
    "traction_deg": 12.07,
    "braking_deg": 19.90,
    "height_mm": 2.761,
    "count": 30,
}


def test_best_design_beats_the_prototype_by_many_standard_errors() -> None:
    """All 28 operating points, six angles that neither search nor confirmation used."""
    study = load_study("mq200")
    design = design_of(study, BEST)
    assert design.feasible
    assert design.dog is not None
    dogs = [study.clutch.dog, design.dog]
    both = evaluate(study, dogs, scratch_executor(), angles=6, seed=20_000)
    prototype, best = (found.expectation for found in both)
    gain = prototype.mean - best.mean
    assert prototype.engaged == best.engaged == 1.0
    assert gain > 5.0 * math.hypot(prototype.standard_error, best.standard_error)
    assert 0.26 < gain / prototype.mean < 0.40
