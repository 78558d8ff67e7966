"""Designs at once: their closed forms, and the time by the surrogate or the compiled engine.

Whoever asks often wants the answer at once, so nothing that is slow to load belongs here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dogshape.checked import Checked
from dogshape.pipeline.config.asked_points import points_of
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.tolerance_effects import margins_within, spread_record, time_spread
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.train.found_surrogates import own_surrogate
from dogshape.pipeline.train.training_rows import mix_over
from dogshape.result import ms
from dogshape.sim.strength.tolerance import Spread
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import Expected
from dogshape.surrogate.query import Answer, ask
from dogshape.surrogate.validation_figures import Validation

LEAST_ANGLES = 16  #: at an operating point
SHIFTS = 672  #: of the compiled engine for a design without a surrogate, over all points
#: Standard error of the compiled engine's expected time against Drake's, over the time. Medians are
#: 0.01 % with the design set and up to 0.8 % with the published one (docs/evidence/engines.txt).
ENGINE_ERROR = 0.01
NORMAL_95 = 1.96


@dataclass(frozen=True, repr=False)
class Check(Checked):
    """Quick answer about one design: its checks, and its expected shift time.

    The time is the surrogate's prediction. Where there is no surrogate of the study's physics the
    compiled engine simulates the design, landing included, and the interval has its error in it.

    Parameters
    ----------
    answer : expected shift time with its interval, and what speaks against trusting it.
    mix : the operating points that were asked about.
    spread : how far the time moves within the tolerances, s; None without a surrogate.
    validation : figures of the surrogate on designs that it had not seen; None without one.
    surrogate : its file; None without one.
    shifts : of the compiled engine, 0 with a surrogate.
    """

    answer: Answer
    mix: Mix
    spread: Spread | None = None
    validation: Validation | None = None
    surrogate: Path | None = None
    shifts: int = 0

    @property
    def time_s(self) -> float:
        """Predicted expected shift time, s."""
        return self.answer.expected.time

    @property
    def interval_s(self) -> tuple[float, float]:
        """Interval that holds the expected shift time with 95 %, s."""
        return self.answer.expected.low, self.answer.expected.high

    @property
    def said(self) -> list[str]:
        """Landing in words, where the compiled engine simulated it."""
        return self.landing_of(self.shifts, "planar")

    @property
    def facts(self) -> dict[str, str]:
        """Predicted time with its interval, verdict and smallest margin."""
        low, high = self.interval_s
        time = f"{ms(self.time_s)} (95 %: {ms(low)} to {ms(high)})"
        if self.shifts:
            return {"shift time by the compiled engine": time, **self.verdict}
        trained = "yes" if self.answer.in_range else f"no: {'; '.join(self.answer.warnings)}"
        return {"predicted shift time": time, "in the trained range": trained, **self.verdict}

    def to_dict(self) -> dict[str, Any]:
        """Give the predicted time, its move within tolerances, and every check."""
        answer, expected = self.answer, self.answer.expected
        return {
            "expected_shift_time_s": expected.time,
            "low_s": expected.low,
            "high_s": expected.high,
            "standard_error_s": expected.error,
            "sd_s": expected.sd,
            "engaged": expected.engaged,
            "operating_points": len(self.mix.points),
            "engine": "planar" if self.shifts else self.config.clutch.solver.engine,
            "in_range": answer.in_range,
            "distance": answer.distance,
            "warnings": [*answer.warnings, *self.notes],
            **self._origin,
            **self.record,
        }

    @property
    def _origin(self) -> dict[str, Any]:
        """Source of the time: the surrogate, or shifts of the compiled engine."""
        if self.spread is None or self.validation is None:
            return {"q2": None, "surrogate": None, "shifts_planar": self.shifts}
        return {
            "q2": self.validation.q2,
            "surrogate": str(self.surrogate),
            "time_within_tolerances": spread_record(self.spread),
        }


def check_design(
    config: Setup,
    mismatch_rpm: float | None = None,
    force_N: float | None = None,
    surrogate: Path | None = None,
) -> Check:
    """Check the design of a study at once.

    Parameters
    ----------
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    surrogate : its file; None for that of the study's results, or the package's, or without
        either for the compiled engine.

    Raises
    ------
    InputError, DataError
        For one half of an operating point, or a named surrogate of other physics or not there.
    """
    points = points_of(config, mismatch_rpm, force_N)
    mix = mix_over(config, points)
    found = own_surrogate(config, surrogate)
    if found is None:
        return _simulated(replace(config, points=points), mix)
    stored, path = found
    model, own = stored.surrogate, config.prototype
    answer = ask(model, own, mix, config.physics)
    design = design_of(config, {})
    within = margins_within(config, design)
    spread = time_spread(config, model, own, mix)
    return Check(config, design, within, answer, mix, spread, stored.validation, path)


def _simulated(config: Setup, mix: Mix) -> Check:
    """Check a design by the compiled engine."""
    # Half a second that an answer of the surrogate does not need.
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415
    from dogshape.pipeline.simulate.executor import scratch_executor  # noqa: PLC0415
    from dogshape.pipeline.simulate.point_plans import whole_plan  # noqa: PLC0415

    quick = replace(config, clutch=config.clutch.with_engine("planar"))
    angles = max(SHIFTS // len(config.points), LEAST_ANGLES)
    plan, seed = whole_plan(quick, angles), config.file.expectation.seed
    one = evaluate(quick, [config.clutch.dog], scratch_executor(1), [plan], seed)[0]
    found = one.expectation
    error = math.hypot(found.standard_error, ENGINE_ERROR * found.mean)
    weights = mix.weights / mix.weights.sum()
    variance = sum(w * p.sd**2 for w, p in zip(weights, found.points, strict=True))
    expected = Expected(
        time=found.mean,
        low=max(found.mean - NORMAL_95 * error, 0.0),
        high=found.mean + NORMAL_95 * error,
        error=error,
        sd=math.sqrt(variance),
        engaged=found.engaged,
    )
    design = design_of(config, {}, one.measured)
    within = margins_within(config, design)
    return Check(config, design, within, Answer(expected, 0.0, ()), mix, shifts=found.shifts)
