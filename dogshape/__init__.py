"""Simulate, search, check and diagnose dog clutches.

A problem is a frozen value, a verb turns it into a frozen result that carries it:

>>> import dogshape as ds
>>> study = ds.Study("mq200", chamfer_deg=11, count=18)
>>> study.shift(mismatch_rpm=50, force_N=469, angle_deg=10).time_s  # doctest: +SKIP
0.0747
"""

from __future__ import annotations

from importlib import import_module
from inspect import isfunction
from typing import TYPE_CHECKING, Any

from dogshape.python_words import in_python

if TYPE_CHECKING:
    from dogshape.bench import Bench
    from dogshape.check import Check
    from dogshape.comparison import Comparison
    from dogshape.drawn import DrawnExpectation, expect_draws
    from dogshape.expectation import Expectation
    from dogshape.fitted import Fitted, fit
    from dogshape.gap import Diagnosis, diagnose
    from dogshape.pipeline.progress import Progress
    from dogshape.plan import Plan, plan_shifts
    from dogshape.predictions import Predictions
    from dogshape.result import Result
    from dogshape.shift import Shift
    from dogshape.side_by_side import SideBySide, compare
    from dogshape.sim.effect import BenchTest, Effect, Parameter
    from dogshape.sim.errors import DogshapeError, InputError
    from dogshape.strength import Strength
    from dogshape.study import Study
    from dogshape.study_result import StudyResult, load_result
    from dogshape.update import Update, update_diagnosis
    from dogshape.whatif import WhatIf

__all__ = [
    "Bench",
    "BenchTest",
    "Check",
    "Comparison",
    "Diagnosis",
    "DogshapeError",
    "DrawnExpectation",
    "Effect",
    "Expectation",
    "Fitted",
    "InputError",
    "Parameter",
    "Plan",
    "Predictions",
    "Progress",
    "Result",
    "Shift",
    "SideBySide",
    "Strength",
    "Study",
    "StudyResult",
    "Update",
    "WhatIf",
    "compare",
    "diagnose",
    "expect_draws",
    "fit",
    "load_result",
    "plan_shifts",
    "update_diagnosis",
]

#: Module of each public name. They are loaded when asked for, since simulation, search and pages
#: take seconds to load and the command line wants none of them for a quick answer.
_HOMES = {
    "Bench": "dogshape.bench",
    "BenchTest": "dogshape.sim.effect",
    "Check": "dogshape.check",
    "Comparison": "dogshape.comparison",
    "Diagnosis": "dogshape.gap",
    "DogshapeError": "dogshape.sim.errors",
    "DrawnExpectation": "dogshape.drawn",
    "Effect": "dogshape.sim.effect",
    "Expectation": "dogshape.expectation",
    "Fitted": "dogshape.fitted",
    "InputError": "dogshape.sim.errors",
    "Parameter": "dogshape.sim.effect",
    "Plan": "dogshape.plan",
    "Predictions": "dogshape.predictions",
    "Progress": "dogshape.pipeline.progress",
    "Result": "dogshape.result",
    "Shift": "dogshape.shift",
    "SideBySide": "dogshape.side_by_side",
    "Strength": "dogshape.strength",
    "Study": "dogshape.study",
    "StudyResult": "dogshape.study_result",
    "compare": "dogshape.side_by_side",
    "Update": "dogshape.update",
    "diagnose": "dogshape.gap",
    "expect_draws": "dogshape.drawn",
    "fit": "dogshape.fitted",
    "load_result": "dogshape.study_result",
    "plan_shifts": "dogshape.plan",
    "update_diagnosis": "dogshape.update",
    "WhatIf": "dogshape.whatif",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"dogshape has no '{name}'; it has {', '.join(__all__)}")
    found = getattr(import_module(_HOMES[name]), name)
    return in_python(found) if isfunction(found) else found


def __dir__() -> list[str]:
    return sorted(__all__)
