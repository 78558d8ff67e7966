"""The design that the paper's study keeps as its best, simulated again at angles of its own."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import VARIABLES, load_study
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.sim.versions import bundled_root

KEPT = json.loads((bundled_root() / "mq200_paper" / "result.json").read_text(encoding="utf-8"))


def test_best_design_beats_the_prototype_by_many_standard_errors() -> None:
    """All 28 operating points, six angles that neither search nor confirmation used."""
    study = load_study("mq200_paper")
    best_design = {key: KEPT["best"][key] for key in VARIABLES}
    design = design_of(study, best_design)
    assert design.feasible
    assert design.dog is not None
    both = evaluate(study, [{}, best_design], scratch_executor(), 6, seed=20_000)
    prototype, best = (found.expectation for found in both)
    gain = prototype.mean - best.mean
    assert prototype.engaged == best.engaged == 1.0
    assert gain > 5.0 * math.hypot(prototype.standard_error, best.standard_error)
    assert gain / prototype.mean == pytest.approx(KEPT["confirmation"]["gain_share"], abs=0.04)
    # What the surrogate of the package says of both, none of which it was fitted to.
    known, _ = stored_surrogate(study, None)
    for params, found in ((study.prototype, prototype), (best_design, best)):
        x = np.array([params[name] for name in study.variables], dtype=float)
        answer = known.surrogate.expected(x, study_mix(study))
        within = 2.5 * math.hypot(answer.error, found.standard_error)
        assert abs(answer.time - found.mean) < within
        # It tells: what it leaves open is small against what there is to gain. The best design
        # lies at the border of what can be made, where the surrogate is least sure.
        assert within < 0.25 * gain
