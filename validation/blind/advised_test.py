"""Diagnosis of a blind case as a user gets it, and the check of the test that it advises.

The outcome comes from the case's truth, never from the diagnosis: true parameters as shares of
their ranges with the error of the test, more shifts of the same engine, or marks of traces. The
diagnosis then updates its probabilities (``diagnosis.next_test.settle``). The case is *settled* if
the truth, or all of it that data can show, is named then, and *misled* if a hypothesis with a cause
that does not act is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.flight_marks import joined_marks
from dogshape.diagnosis.bench.stand_file import Place
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.inference.verdict import nameable
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.next_test import settle
from dogshape.diagnosis.prediction.model import Model
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions, diagnose_bench, models_of
from dogshape.sim.effects import load
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.units import MM, RPM
from dogshape.validation.blind.cases import Case, case_of
from dogshape.validation.blind.data import draws, engine_of, measured_rows, timely
from dogshape.validation.blind.stand import Point, read_stand

Names = tuple[str, ...]

ENGINE = "planar"  #: that simulates for the diagnosis


@dataclass(frozen=True)
class Advised:
    """Outcome of the advised test of one case: its name and kind, and what leads after it.

    ``settled`` on the truth, ``misled`` to a cause that does not act; ``foreseen`` is the chance to
    settle that the diagnosis gives it.
    """

    test: str
    kind: str
    top: Names
    probability: float
    settled: bool
    misled: bool
    foreseen: float


def judged_by_test(
    folder: Path, case: Case, diagnosis: Diagnosis, right: Sequence[Names]
) -> Advised | None:
    """Make the advised test of a case by its truth; None where no hypothesis predicts it.

    ``right`` are the hypotheses on which to settle is right. The same case gives the same outcome.
    """
    test = diagnosis.tests[0]
    outcome = outcome_of(folder, case, diagnosis, test)
    after: Mapping[Names, float] = settle(diagnosis, test, outcome)
    top = max(after, key=lambda h: after[h])
    sure = after[top] > diagnosis.settings.named and nameable(top, diagnosis.settings)
    wrong = not set(top) <= set(right[0])
    return Advised(
        test.name, test.kind, top, float(after[top]),
        sure and top in right, sure and wrong, test.settles,
    )  # fmt: skip


def outcome_of(
    folder: Path, case: Case, diagnosis: Diagnosis, test: NextTest
) -> Sequence[float] | str:
    """Make the outcome of a test; NaN for what is not shown."""
    generator = np.random.default_rng([case.seed, 73])
    if test.kind == "record":
        return {"time_zero": "command", "displacement_at": case.sensor}[test.question]
    if test.kind == "direct":
        exact = readings_of(case, diagnosis, test)
        return generator.normal(exact, diagnosis.settings.test_error).tolist()
    assert test.cell is not None
    asked = diagnosis.bench.cells[test.cell].point
    point = Point(asked.mismatch, asked.profile.force, asked.profile.rise)
    return _shifted(folder, case, test, point, generator)


def readings_of(case: Case, diagnosis: Diagnosis, test: NextTest) -> list[float]:
    """Compute the exact readings of a direct test, as shares of the parameters' ranges.

    An effect without parameters reads 1 where it is there, else 0. What is outside the list reads
    as what acts: a valve that sticks as its mean delay, a dog that stands out as a smaller gap.
    """
    truth = case.truth
    more = {"delay_s": truth.waiting[0], "gap_offset_mm": -truth.high_dog / MM}
    found = []
    for name in test.effects:
        effect, given = diagnosis.effects[name], case.parameters.get(name)
        if not effect.parameters:
            found.append(float(given is not None))
        for one in effect.parameters:
            neutral = one.neutral_of(diagnosis.model.setting)
            value = (given or {}).get(one.name, neutral) + more.get(one.name, 0.0)
            found.append(one.share(value))
    return found


def _shifted(
    folder: Path, case: Case, test: NextTest, point: Point, generator: np.random.Generator
) -> list[float]:
    """Shift again: mean time of timely shifts in s and share engaged, or marks of the flight."""
    stand, truth = read_stand(folder), case.truth
    engine, fade = engine_of(case.engine, stand, truth), 1.0 - truth.drift
    # They come after the series, when all that drifts away is gone.
    made = draws(truth, stand, 1, test.shifts, int(generator.integers(2**31)))[0]
    keep = test.kind == "traces"
    shifts = [engine.shift(point, replace(one, fade=fade), keep) for one in made]
    if not keep:
        times = np.array([[shift.time for shift in shifts]], dtype=float)
        wait = min(stand.timeout, stand.pitch / abs(point.mismatch))
        engaged = float(np.isfinite(times).mean())
        soon = timely(times, np.array([wait]))
        return [float(np.nanmean(soon)) if engaged else np.nan, engaged]
    tables = [measured_rows(truth, point, one, fade, generator) for one in shifts]
    units = (1.0, MM, 1.0, RPM, RPM)
    traces = [BenchTrace(Path("trace"), *(t * units).T) for t in tables if t is not None]
    if not traces:
        return []
    profile = ForceProfile(point.force, point.rise)
    return joined_marks(traces, profile, stand.gap)[:, 0].tolist()


def diagnose_folder(folder: Path) -> dict[str, Any]:
    """Diagnose a blind case."""
    return diagnose_bench(load_bench(folder), _means(1)).to_dict()


def likelihood_of(folder: Path, sensor: str, model: Model | None = None) -> Likelihood:
    """Build the likelihood of a data set whose displacement is read at a side of the linkage.

    ``model`` is that of its clutch and points, where it is known. A clutch is simulated where no
    bank has it.
    """
    bench: Bench = load_bench(folder)
    record = bench.record.model_copy(update={"displacement_at": cast(Place, sensor)})
    bench = replace(bench, clutch=bench.clutch.with_engine(ENGINE), record=record)
    means = _means(0)
    if model is None:
        (model,) = models_of(bench, load(None), means).values()
    return Likelihood(bench, observe(bench, model), model, means.settings)


def advised(folder: Path, truth: Mapping[str, Any], right: Sequence[Names]) -> Advised | None:
    """Diagnose a case again, make the test that it advises by the truth, and judge the outcome."""
    return judged_by_test(
        folder, case_of(truth), diagnose_bench(load_bench(folder), _means(1)), right
    )


def _means(jobs: int) -> BankOptions:
    return BankOptions(jobs=jobs, engine=ENGINE)
