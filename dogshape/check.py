"""Designs at once: their closed forms, the time by the compiled engine and by the surrogate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.checked import Checked
from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.search.tolerance_effects import spread_record, time_spread
from dogshape.pipeline.simulate.design import Measured, design_of, margins_within
from dogshape.pipeline.train.found_surrogates import own_surrogate
from dogshape.pipeline.train.training_rows import mix_over
from dogshape.result import ms
from dogshape.sim.errors import GeometryError
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.strength.tolerance import Spread
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import Expected, interval
from dogshape.surrogate.query import Answer, ask, time_record
from dogshape.surrogate.validation_figures import Validation

LEAST_ANGLES = 16  #: at an operating point
SHIFTS = 672  #: of the compiled engine for a design, over all points
#: Standard error of the compiled engine's expected time against Drake's, over the time. Medians are
#: 0.01 % with the design set and up to 0.8 % with the published one (docs/evidence/engines.txt).
ENGINE_ERROR = 0.01
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Quick:
    """Shifts of a design by the compiled engine: its expected time and what landings demand.

    ``engaged`` is the least share engaged at a point, ``refusal`` why there is no time; ``rows``
    are what a surrogate learns from, (k, d + 8).
    """

    expected: Expected | None
    engaged: float
    refusal: str
    measured: Measured
    rows: Array
    shifts: int


@dataclass(frozen=True)
class Guess:
    """Prediction of a surrogate for a design.

    Parameters
    ----------
    answer : expected shift time with its interval, and what speaks against trusting it.
    spread : change of the time within the tolerances, s.
    validation : figures of the surrogate on designs that it had not seen.
    path : its file.
    """

    answer: Answer
    spread: Spread
    validation: Validation
    path: Path


@dataclass(frozen=True, repr=False)
class Check(Checked):
    """Quick answer about one design: its checks, and its expected shift time.

    The compiled engine simulates the design, landing included, and the interval has its error in
    it. A surrogate that is named answers in its place, and the landing is not judged. A clutch
    that does not engage, or a dog that cannot be made, has no time.

    Parameters
    ----------
    mix : the operating points that were asked about.
    quick : shifts of the compiled engine; None for a named surrogate and a dog that cannot be made.
    guess : prediction of the surrogate; None where there is none of the study's physics.
    refusal : why there is no time; empty where there is one.
    """

    mix: Mix
    quick: Quick | None = None
    guess: Guess | None = None
    refusal: str = ""

    @property
    def expected(self) -> Expected | None:
        """Expected shift time with its interval; None where there is none."""
        if self.quick is not None:
            return self.quick.expected
        return None if self.guess is None else self.guess.answer.expected

    @property
    def time_s(self) -> float | None:
        """Expected shift time, s; None where there is none."""
        return None if self.expected is None else self.expected.time

    @property
    def interval_s(self) -> tuple[float, float] | None:
        """Interval that holds the expected shift time with 95 %, s."""
        return None if self.expected is None else (self.expected.low, self.expected.high)

    @property
    def shifts(self) -> int:
        """Number of shifts of the compiled engine."""
        return 0 if self.quick is None else self.quick.shifts

    @property
    def missed(self) -> bool:
        """Test that the surrogate misses the simulated time by more than both intervals."""
        if self.quick is None or self.guess is None:
            return False
        return misses(self.guess.answer.expected, self.quick.expected)

    @property
    def said(self) -> list[str]:
        """Landing in words, where the compiled engine simulated it."""
        return self.landing_of(self.shifts, "planar")

    @property
    def facts(self) -> dict[str, str]:
        """Expected time with its interval, verdict and smallest margin."""
        found, name = self.expected, "compiled engine" if self.quick else "surrogate"
        if found is None:
            return {"shift time": f"none: {self.refusal}", **self.verdict}
        time = f"{ms(found.time)} (95 %: {ms(found.low)} to {ms(found.high)})"
        facts = {f"shift time by the {name}": time}
        if self.guess is not None:
            warnings = "; ".join(self.guess.answer.warnings)
            facts["in the surrogate's trained range"] = f"no: {warnings}" if warnings else "yes"
        return {**facts, **self.verdict}

    def to_dict(self) -> dict[str, Any]:
        """Give the expected time, the surrogate's prediction, and every check."""
        return {
            **time_record(self.expected, self.refusal),
            **({} if self.quick is None else {"engaged": self.quick.engaged}),
            "operating_points": len(self.mix.points),
            "engine": "planar" if self.quick else self.config.clutch.solver.engine,
            "shifts_planar": self.shifts,
            **self._guessed,
            **self.record,
        }

    @property
    def _guessed(self) -> dict[str, Any]:
        if self.guess is None:
            return {"in_range": True, "distance": 0.0, "warnings": [*self.notes], "q2": None,
                    "surrogate": None, "predicted": None}  # fmt: skip
        answer = self.guess.answer
        return {
            "in_range": answer.in_range,
            "distance": answer.distance,
            "warnings": [*answer.warnings, *self.notes],
            "q2": self.guess.validation.q2,
            "surrogate": str(self.guess.path),
            "predicted": time_record(answer.expected, answer.refusal),
            "missed_by_surrogate": self.missed,
            "time_within_tolerances": spread_record(self.guess.spread),
        }


def misses(predicted: Expected | None, simulated: Expected | None) -> bool:
    """Test that a prediction misses a simulated time by more than both intervals."""
    if predicted is None or simulated is None:
        return False
    both = math.hypot(simulated.error, predicted.error)
    return abs(simulated.time - predicted.time) > NORMAL_95 * both


def check_design(
    config: Setup,
    mismatch_rpm: float | None = None,
    force_N: float | None = None,
    surrogate: Path | None = None,
) -> Check:
    """Check the design of a study: seconds by the compiled engine, at once by a named surrogate.

    Parameters
    ----------
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    surrogate : file of the surrogate that answers in place of the compiled engine. The one of the
        study's results, or the package's, is asked beside the engine.

    Raises
    ------
    InputError, DataError
        For one half of an operating point, or a named surrogate of other physics or not there.
    """
    points = points_of(config, mismatch_rpm, force_N)
    mix, refusal = mix_over(config, points), unmade(config)
    guess, quick = _guess(config, mix, surrogate, refusal), None
    if guess is not None and surrogate is not None:
        refusal = guess.answer.refusal
    elif not refusal:
        quick = simulate_quickly(replace(config, points=points))
        refusal = quick.refusal
    design = design_of(config, {}, None if quick is None else quick.measured)
    return Check(config, design, margins_within(config, design), mix, quick, guess, refusal)


def unmade(config: Setup) -> str:
    """Explain why the dog of a study cannot be made; empty for one that can."""
    try:
        require_makeable(config.clutch.dog, config.limits.manufacturing)
    except GeometryError as error:
        return str(error)
    return ""


def _guess(config: Setup, mix: Mix, named: Path | None, refusal: str) -> Guess | None:
    """Ask the surrogate of the study's physics about its own design; ``refusal`` of a time."""
    found = own_surrogate(config, named)
    if found is None:
        return None
    stored, path = found
    model, own = stored.surrogate, config.prototype
    answer = ask(model, own, mix, config.physics)
    if refusal:
        warnings = (*answer.warnings, "the dog cannot be made")
        answer = Answer(None, answer.distance, warnings, refusal)
    return Guess(answer, time_spread(config, model, own, mix), stored.validation, path)


def simulate_quickly(config: Setup) -> Quick:
    """Simulate the design of a study by the compiled engine at all of its operating points."""
    # Half a second that an answer of the surrogate does not need.
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415
    from dogshape.pipeline.simulate.executor import scratch_executor  # noqa: PLC0415
    from dogshape.pipeline.simulate.point_plans import whole_plan  # noqa: PLC0415

    quick = replace(config, clutch=config.clutch.with_engine("planar"))
    angles = max(SHIFTS // len(config.points), LEAST_ANGLES)
    plan, seed = whole_plan(quick, angles), config.file.expectation.seed
    one = evaluate(quick, [config.clutch.dog], scratch_executor(1), [plan], seed)[0]
    found = one.expectation
    mix = mix_over(config, config.points)
    lost = np.array([p.lost for p in found.points])
    expected, refusal = None, ""
    share = np.array([p.engaged for p in found.points])
    if found.mean_engaged is None or found.engaged < LEAST_ENGAGED:
        refusal = (
            f"engages in {found.shifts - lost.sum()} of {found.shifts} shifts, in "
            f"{found.engaged:.0%} where fewest do"
        )
    else:
        n = np.array([p.n for p in found.points])
        sd = np.array([p.sd for p in found.points])
        weights = mix.weights * mix.retry
        unsure = weights * np.sqrt(share * (1.0 - share) / n) / share**2
        error = math.hypot(found.standard_error, ENGINE_ERROR * found.mean)
        low, high = interval(np.array([found.mean]), np.array([error]))
        expected = Expected(
            time=found.mean,
            low=float(low[0]),
            high=float(high[0]),
            error=error,
            sd=math.sqrt(mix.weights @ sd**2),
            engaged=found.engaged,
            retries=float(weights @ ((1.0 - share) / share)),
            retries_error=float(np.linalg.norm(unsure)),
        )
    return Quick(expected, found.engaged, refusal, one.measured, one.rows, found.shifts)
