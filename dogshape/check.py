"""Designs without simulation: their closed forms and the surrogate's answer.

Whoever asks often wants the answer at once, so nothing that is slow to load belongs here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.checked import Checked
from dogshape.pipeline.config.asked_points import points_of
from dogshape.pipeline.config.study_file import Study as StudyConfig
from dogshape.pipeline.search.tolerance_effects import margins_within, spread_record, time_spread
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.train.found_surrogates import stored_surrogate
from dogshape.pipeline.train.training_rows import mix_over
from dogshape.result import ms
from dogshape.sim.strength.tolerance import Spread
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.query import Answer, ask
from dogshape.surrogate.validation_figures import Validation


@dataclass(frozen=True, repr=False)
class Check(Checked):
    """Quick answer about one design: its checks, and the shift time that the surrogate predicts.

    Parameters
    ----------
    answer : expected shift time with its interval, and what speaks against trusting it.
    spread : how far the time moves within the tolerances, s.
    mix : the operating points that were asked about.
    validation : figures of the surrogate on designs that it had not seen.
    surrogate : its file.
    """

    answer: Answer
    spread: Spread
    mix: Mix
    validation: Validation
    surrogate: Path

    @property
    def time_s(self) -> float:
        """Predicted expected shift time, s."""
        return self.answer.expected.time

    @property
    def interval_s(self) -> tuple[float, float]:
        """Interval that holds the expected shift time with 95 %, s."""
        return self.answer.expected.low, self.answer.expected.high

    @property
    def facts(self) -> dict[str, str]:
        """Predicted time with its interval, verdict and smallest margin."""
        low, high = self.interval_s
        trained = "yes" if self.answer.in_range else f"no: {'; '.join(self.answer.warnings)}"
        return {
            "predicted shift time": f"{ms(self.time_s)} (95 %: {ms(low)} to {ms(high)})",
            "in the trained range": trained,
            **self.verdict,
        }

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
            "engine": self.config.clutch.solver.engine,
            "in_range": answer.in_range,
            "distance": answer.distance,
            "warnings": list(answer.warnings),
            "q2": self.validation.q2,
            "surrogate": str(self.surrogate),
            "time_within_tolerances": spread_record(self.spread),
            **self.record,
        }


def check_design(
    config: StudyConfig,
    mismatch_rpm: float | None = None,
    force_N: float | None = None,
    surrogate: Path | None = None,
) -> Check:
    """Check the design of a study without simulating it.

    Parameters
    ----------
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    surrogate : its file; None for that of the study's results, or the package's.

    Raises
    ------
    InputError, DataError
        For one half of an operating point, a surrogate of other physics, or none at all.
    """
    mix = mix_over(config, points_of(config, mismatch_rpm, force_N))
    stored, path = stored_surrogate(config, surrogate)
    model, own = stored.surrogate, config.prototype
    answer = ask(model, own, mix, config.physics)
    design = design_of(config, {})
    within = margins_within(config, design)
    spread = time_spread(config, model, own, mix)
    return Check(config, design, within, answer, spread, mix, stored.validation, path)
