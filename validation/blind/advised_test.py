"""Diagnosis of a blind case as a user gets it, and the check of its advised test.

The outcome comes from the case's truth, never from the diagnosis: true parameters with the errors
of their instruments, more shifts of the same engine, or marks of traces. The diagnosis then updates
its probabilities (``diagnosis.next_test.update_posterior``). The *rise* is that of the probability
of the truth, or its visible part; the case is *misled* if a hypothesis with a cause that does not
act is named. The best test in hindsight is that of the menu with the largest rise.
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
from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.next_test import ReadQuantity, quantities_of, update_posterior
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
    """Outcome of the advised test of a case, beside that of the best test in hindsight."""

    test: str  #: name
    kind: str
    hours: float
    top: Names  #: leading hypothesis after the test
    probability: float  #: of the leading hypothesis
    misled: bool  #: whether a cause that does not act is named
    rise: float  #: of the probability of the truth
    foreseen: float  #: gain by the diagnosis
    realised: (
        float  #: gain: 1 where the answer after the test is right, less its probability before
    )
    best_test: str  #: name of the best test in hindsight
    best_rise: float  #: of the probability of the truth by that test


def judge_test(
    folder: Path, case: Case, diagnosis: Inference, correct: Sequence[Names]
) -> Advised | None:
    """Make the tests of a case by its truth, and judge the advised one.

    ``correct`` are hypotheses that are correct to name, the truth first. The same case gives the
    same outcomes.
    """
    advised = diagnosis.tests[0]
    probability_before = _probability(diagnosis.posterior, correct)
    posteriors: dict[str, Mapping[Names, float]] = {}
    rises: dict[str, float] = {}
    for test in hindsight_menu(diagnosis.tests):
        outcome = outcome_of(folder, case, diagnosis, test)
        posteriors[test.name] = update_posterior(diagnosis, test, outcome)
        rises[test.name] = _probability(posteriors[test.name], correct) - probability_before
    posterior = posteriors[advised.name]
    top = max(posterior, key=lambda h: posterior[h])
    named = diagnosis.settings.names(top, posterior[top])
    best_test = max(rises, key=lambda name: rises[name])
    return Advised(
        test=advised.name,
        kind=advised.kind,
        hours=advised.hours,
        top=top,
        probability=float(posterior[top]),
        misled=named and not set(top) <= set(correct[0]),
        rise=rises[advised.name],
        foreseen=advised.gain,
        realised=float(top in correct) - diagnosis.posterior.get(top, 0.0),
        best_test=best_test,
        best_rise=rises[best_test],
    )


def hindsight_menu(tests: Sequence[NextTest]) -> list[NextTest]:
    """List the first test and all others; of more shifts at a point the largest number alone."""
    max_shifts = max((test.shifts for test in tests if test.kind == "shifts"), default=0)
    first, *further = tests
    return [first, *(t for t in further if t.kind != "shifts" or t.shifts == max_shifts)]


def _probability(posterior: Mapping[Names, float], hypotheses: Sequence[Names]) -> float:
    """Sum the probabilities of some hypotheses."""
    return float(sum(posterior.get(hypothesis, 0.0) for hypothesis in hypotheses))


def outcome_of(
    folder: Path, case: Case, diagnosis: Inference, test: NextTest
) -> Sequence[float] | str:
    """Make the outcome of a test by the truth of a case; NaN for a quantity that it cannot show."""
    generator = np.random.default_rng([case.seed, OUTCOME_SEED])
    if test.kind == "record":
        return {"time_zero": "command", "displacement_at": case.sensor}[test.question]
    if test.kind == "direct":
        effects = [diagnosis.effects[name] for name in test.effects]
        presence_error = diagnosis.settings.presence_error
        quantities = quantities_of(effects, diagnosis.model.setting, presence_error)
        readings = zip(quantities, readings_of(case, quantities), strict=True)
        return [float(generator.normal(exact, read.error.at(exact))) for read, exact in readings]
    assert test.cell is not None
    cell_point = diagnosis.bench.cells[test.cell].point
    point = Point(cell_point.mismatch, cell_point.profile.force, cell_point.profile.rise)
    return _repeat_shifts(folder, case, test, point=point, generator=generator)


def readings_of(case: Case, quantities: Sequence[ReadQuantity]) -> list[float]:
    """Compute the exact readings of a direct test, in the parameters' units.

    An effect without parameters reads 1 where it acts, else 0. A valve that sticks reads as its
    mean delay, a high dog as a smaller gap.
    """
    truth = case.truth
    offsets = {"delay_s": truth.delay_moments[0], "gap_offset_mm": -truth.high_dog / MM}
    readings = []
    for read in quantities:
        values = case.parameters.get(read.effect.name)
        if read.parameter is None:
            readings.append(float(values is not None))
            continue
        name = read.parameter.name
        value = (values or {}).get(name, read.neutral)
        readings.append(value + offsets.get(name, 0.0))
    return readings


def _repeat_shifts(
    folder: Path, case: Case, test: NextTest, *, point: Point, generator: np.random.Generator
) -> list[float]:
    """Simulate the shifts of a test: mean time, s, and share engaged, or marks of the flight."""
    stand = read_stand(folder)
    truth = case.truth
    engine = engine_of(case.engine, stand, truth)
    seed = int(generator.integers(2**31))
    (draws,) = draw_shifts(truth, stand, point_count=1, shift_count=test.shifts, seed=seed)
    keep = test.kind == "traces"
    shifts = [engine.shift(point, replace(draw, progress=1.0), keep) for draw in draws]
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
        rows = measured_rows(truth, point, shift, progress=1.0, generator=generator)
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
