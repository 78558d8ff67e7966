"""Diagnosis of a blind case as a user gets it, and the check of its advised test.

The outcome comes from the case's truth, never from the diagnosis: true parameters as shares of
their ranges with the error of the test, more shifts of the same engine, or marks of traces. The
diagnosis then updates its probabilities (``diagnosis.next_test.update_posterior``). The case is
*settled* if the truth, or its visible part, is named then, and *misled* if a hypothesis with a
cause that does not act is named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.flight_marks import joined_marks
from dogshape.bench.stand_file import Place
from dogshape.bench.traces import BenchTrace
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.inference.verdict import is_nameable
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.next_test import update_posterior
from dogshape.diagnosis.prediction.model import Model
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, diagnose_bench, models_of
from dogshape.sim.effects import load
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.cases import Case, case_of
from dogshape.validation.blind.data import draw_shifts, engine_of, mask_late, measured_rows
from dogshape.validation.blind.stand import Point, read_stand

Names = tuple[str, ...]

ENGINE = "planar"  #: of the diagnosis
OUTCOME_SEED = 73  #: beside a case's seed, of the outcome of a test


@dataclass(frozen=True)
class Advised:
    """Outcome of the advised test of a case."""

    test: str  #: name
    kind: str
    top: Names  #: leading hypothesis after the test
    probability: float  #: of the leading hypothesis
    settled: bool  #: whether the truth is named
    misled: bool  #: whether a cause that does not act is named
    foreseen: float  #: probability to settle by the diagnosis


def judge_test(
    folder: Path, case: Case, diagnosis: Diagnosis, correct: Sequence[Names]
) -> Advised | None:
    """Make the advised test of a case by its truth, and judge the diagnosis after it.

    ``correct`` are hypotheses that are correct to name, the truth first. The same case gives the
    same outcome.
    """
    test = diagnosis.tests[0]
    outcome = outcome_of(folder, case, diagnosis, test)
    posterior: Mapping[Names, float] = update_posterior(diagnosis, test, outcome)
    top = max(posterior, key=lambda h: posterior[h])
    named = posterior[top] > diagnosis.settings.named and is_nameable(top, diagnosis.settings)
    return Advised(
        test=test.name,
        kind=test.kind,
        top=top,
        probability=float(posterior[top]),
        settled=named and top in correct,
        misled=named and not set(top) <= set(correct[0]),
        foreseen=test.settles,
    )


def outcome_of(
    folder: Path, case: Case, diagnosis: Diagnosis, test: NextTest
) -> Sequence[float] | str:
    """Make the outcome of a test by the truth of a case; NaN for a quantity that it cannot show."""
    generator = np.random.default_rng([case.seed, OUTCOME_SEED])
    if test.kind == "record":
        return {"time_zero": "command", "displacement_at": case.sensor}[test.question]
    if test.kind == "direct":
        exact = readings_of(case, diagnosis, test)
        return generator.normal(exact, diagnosis.settings.test_error).tolist()
    assert test.cell is not None
    cell_point = diagnosis.bench.cells[test.cell].point
    point = Point(cell_point.mismatch, cell_point.profile.force, cell_point.profile.rise)
    return _repeat_shifts(folder, case, test, point=point, generator=generator)


def readings_of(case: Case, diagnosis: Diagnosis, test: NextTest) -> list[float]:
    """Compute the exact readings of a direct test, as shares of the parameters' ranges.

    An effect without parameters reads 1 where it acts, else 0. A valve that sticks reads as its
    mean delay, a high dog as a smaller gap.
    """
    truth = case.truth
    offsets = {"delay_s": truth.delay_moments[0], "gap_offset_mm": -truth.high_dog / MM}
    readings = []
    for name in test.effects:
        effect = diagnosis.effects[name]
        values = case.parameters.get(name)
        if not effect.parameters:
            readings.append(float(values is not None))
        for parameter in effect.parameters:
            neutral = parameter.neutral_of(diagnosis.model.setting)
            value = (values or {}).get(parameter.name, neutral)
            readings.append(parameter.share(value + offsets.get(parameter.name, 0.0)))
    return readings


def _repeat_shifts(
    folder: Path, case: Case, test: NextTest, *, point: Point, generator: np.random.Generator
) -> list[float]:
    """Simulate the shifts of a test: mean time, s, and share engaged, or marks of the flight."""
    stand = read_stand(folder)
    truth = case.truth
    engine = engine_of(case.engine, stand, truth)
    fade = 1.0 - truth.drift  # after the series the drift is complete
    seed = int(generator.integers(2**31))
    (draws,) = draw_shifts(truth, stand, point_count=1, shift_count=test.shifts, seed=seed)
    keep = test.kind == "traces"
    shifts = [engine.shift(point, replace(draw, fade=fade), keep) for draw in draws]
    if not keep:
        times = np.array([[shift.time for shift in shifts]], dtype=float)
        engaged = float(np.isfinite(times).mean())
        if not engaged:
            return [np.nan, engaged]
        wait = min(stand.timeout, stand.pitch / abs(point.mismatch))
        return [float(np.nanmean(mask_late(times, np.array([wait])))), engaged]
    units = (1.0, MM, 1.0, RPM, RPM)
    traces = []
    for shift in shifts:
        rows = measured_rows(truth, point, shift, fade=fade, generator=generator)
        if rows is not None:
            traces.append(BenchTrace(Path("trace"), *(rows * units).T))
    if not traces:
        return []
    profile = ForceProfile(point.force, point.rise)
    return joined_marks(traces, profile, stand.gap)[:, 0].tolist()


def diagnose_folder(folder: Path) -> dict[str, Any]:
    """Diagnose the blind case in a folder; return the record of the diagnosis."""
    return diagnose_bench(load_bench(folder), _bank_options(1)).to_dict()


def likelihood_of(folder: Path, sensor: str, model: Model | None = None) -> Likelihood:
    """Build the likelihood of a data set with its sensor at a side of the linkage.

    Without ``model``, that of its clutch and points, a clutch that no bank has is simulated.
    """
    bench: Bench = load_bench(folder)
    record = bench.record.model_copy(update={"displacement_at": cast(Place, sensor)})
    bench = replace(bench, clutch=bench.clutch.with_engine(ENGINE), record=record)
    options = _bank_options(0)
    if model is None:
        (model,) = models_of(bench, load(None), options).values()
    return Likelihood(bench, observe(bench, model), model, options.settings)


def make_advised_test(
    folder: Path, truth: Mapping[str, Any], correct: Sequence[Names]
) -> Advised | None:
    """Diagnose a case again, make its advised test by the truth, and judge the outcome."""
    diagnosis = diagnose_bench(load_bench(folder), _bank_options(1))
    return judge_test(folder, case_of(truth), diagnosis, correct)


def _bank_options(jobs: int) -> BankOptions:
    return BankOptions(jobs=jobs, engine=ENGINE)
