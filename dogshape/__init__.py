"""Simulate, search, check and diagnose dog clutches.

A problem is a frozen value, a verb turns it into a frozen result that carries it.
"""

from __future__ import annotations

import ast
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.argument_types import check_types

# Public names. Modules are loaded when asked for: simulation, search and pages take seconds, which
# a quick answer does not need.
if TYPE_CHECKING:
    from dogshape.app.server import serve_app as serve_app
    from dogshape.bench.bench_draft import BenchDraft as BenchDraft
    from dogshape.bench.decoding import TableLimits as TableLimits
    from dogshape.bench_comparison import Comparison as Comparison
    from dogshape.bench_comparison import validate as validate
    from dogshape.check import Check as Check
    from dogshape.check import Strength as Strength
    from dogshape.comparison import SideBySide as SideBySide
    from dogshape.comparison import compare as compare
    from dogshape.expectation import DrawnExpectation as DrawnExpectation
    from dogshape.expectation import Expectation as Expectation
    from dogshape.expectation import expect_draws as expect_draws
    from dogshape.fitted import Fitted as Fitted
    from dogshape.fitted import fit as fit
    from dogshape.gap import Diagnosis as Diagnosis
    from dogshape.gap import Plan as Plan
    from dogshape.gap import Update as Update
    from dogshape.gap import diagnose as diagnose
    from dogshape.gap import plan_shifts as plan_shifts
    from dogshape.gap import update_diagnosis as update_diagnosis
    from dogshape.pipeline.drafts.bench_folder import write_bench as write_bench
    from dogshape.pipeline.progress import Progress as Progress
    from dogshape.predictions import Predictions as Predictions
    from dogshape.result import Result as Result
    from dogshape.shift import Shift as Shift
    from dogshape.sim.effect import BenchTest as BenchTest
    from dogshape.sim.effect import Effect as Effect
    from dogshape.sim.effect import InstrumentError as InstrumentError
    from dogshape.sim.effect import Ordinary as Ordinary
    from dogshape.sim.effect import Parameter as Parameter
    from dogshape.sim.errors import DogshapeError as DogshapeError
    from dogshape.sim.errors import InputError as InputError
    from dogshape.study import Study as Study
    from dogshape.study_result import StudyResult as StudyResult
    from dogshape.study_result import load_result as load_result

_HOMES = {
    alias.name: str(node.module)
    for node in ast.walk(ast.parse(Path(__file__).read_text(encoding="utf-8")))
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
    if alias.asname == alias.name
}
__all__ = sorted(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"dogshape has no '{name}'; it has {', '.join(__all__)}")
    value = getattr(import_module(_HOMES[name]), name)
    return check_types(value) if isfunction(value) else value


def __dir__() -> list[str]:
    return __all__
