"""Design at once: its closed forms, the time by the compiled engine and by the surrogate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.record import Table, frame_of
from dogshape.pipeline.reports.text import ENGINES, interval_text, time_text
from dogshape.pipeline.search.tolerance_effects import ToleranceTime, checks_within, tolerance_time
from dogshape.pipeline.simulate.design import (
    Design,
    Measured,
    Within,
    design_of,
    margins_within,
    weakest_within,
)
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.pipeline.store.result_records import CheckRow, check_table
from dogshape.pipeline.train.training_rows import mix_over, own_surrogate
from dogshape.result import Result
from dogshape.sim.errors import GeometryError
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.locking import blocking_force
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Expected, interval
from dogshape.surrogate.query import Answer, ask, time_record
from dogshape.surrogate.validation_figures import Validation

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go


@dataclass(frozen=True, repr=False)
class Checked(Result):
    """One design with its checks.

    Parameters
    ----------
    config : the study that was asked.
    design : its dog with every check.
    within : margins left within the tolerances, by check and kind; minus infinity for no dog.
    """

    config: Setup
    design: Design
    within: Within

    @property
    def feasible(self) -> bool:
        """Whether every check passes."""
        return self.design.feasible

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the checks that fail."""
        return tuple(self.design.failed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the design: a root outside its formula's fit, units in doubt."""
        return tuple(notes_of(self.config))

    @property
    def blocking_force_N(self) -> float:
        """Force that the blocking mechanism has to hold, N."""
        return blocking_force(self.config.clutch.dog, self.config.limits.load)

    @property
    def verdict(self) -> dict[str, str]:
        """Facts of the checks: feasible or not, and the smallest margins with their checks."""
        weakest = smallest_margin(self.design.checks)
        open_ones = ", before its landing is simulated" if self.design.not_checked else ""
        verdict = "yes" if self.feasible else f"no ({', '.join(self.failed)})"
        name, worst = weakest_within(self.config, self.design)
        return {
            "feasible": verdict + open_ones,
            "smallest margin": f"{weakest.margin:.1%}, {weakest.name}",
            "at worst-case tolerances": "no dog" if math.isinf(worst) else f"{worst:.1%}, {name}",
        }

    @property
    def rows(self) -> list[CheckRow]:
        """Every check with its margins, by the declared keys."""
        return [CheckRow(**one) for one in checks_within(self.design, self.within)]

    @property
    def check_parts(self) -> list[str | Table]:
        """Table of the checks, then verdict, warnings and what the blocking mechanism holds."""
        facts = [f"{name}: {value}" for name, value in self.verdict.items()]
        return [
            check_table(self.rows),
            "",
            "margin: distance to the limit over the limit, at nominal size, with every tolerance "
            "at its worst, and by root sum of squares (no tolerances for the landing)",
            *facts,
            *(f"warning: {note}" for note in self.notes),
            f"the blocking mechanism has to hold {self.blocking_force_N:.0f} N",
        ]

    def landing_of(self, shifts: int, engine: str) -> list[str]:
        """Explain which shifts the checks of the landing are from; nothing without them."""
        if self.design.not_checked or not shifts:
            return []
        share = self.config.limits.load.landing_share
        taken = "the hardest" if share is None else f"what {share:.3g} of the shifts exceed"
        angles = shifts // len(self.config.points)
        return [
            f"landing: {taken} of {shifts} shifts by {ENGINES[engine]}, {angles} angles at each "
            "operating point; other angles or another number of them ('check' and 'strength' have "
            "their own) give another sample of it"
        ]

    @property
    def record(self) -> dict[str, Any]:
        """Give the checks as JSON takes them."""
        return {
            "feasible": self.design.feasible,
            "not_checked": self.design.not_checked,
            "checks": checks_within(self.design, self.within),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each check: value and limit in ``unit``, margins as shares."""
        return frame_of(self.rows)

    def plot(self) -> go.Figure:
        """Draw the margin of each check, and what is left of it in the worst case."""
        from dogshape.pipeline.reports.charts import margins  # noqa: PLC0415  # loads plotly

        return margins(self.design.checks, self.within)


LEAST_ANGLES = 16  #: at an operating point
SHIFTS = 672  #: of the compiled engine for a design, over all points
#: Standard error of the compiled engine's expected time against Drake's, over the time. Medians are
#: 0.01 % with the design set and up to 0.8 % with the published one (docs/evidence/engines.txt).
ENGINE_ERROR = 0.01
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Quick:
    """Shifts of a design by the compiled engine: its expected time and what landings demand.

    ``engaged`` is the least share engaged at a point, ``refusal`` why there is no time.
    """

    expected: Expected | None
    engaged: float
    refusal: str
    measured: Measured
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
    spread: ToleranceTime
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
    def parts(self) -> list[str | Table]:
        """Expected time, the surrogate's prediction beside it, and the checks."""
        found, open_ones = self.expected, self.design.not_checked
        if found is None:
            lines = [f"no shift time: {self.refusal}"]
        else:
            source = f"{self.shifts} shifts of the compiled engine, 1 % of its error against Drake"
            lines = [
                f"expected shift time {_interval(found)} "
                f"({'surrogate' if self.quick is None else f'{source} included'}); single shifts "
                f"scatter by {time_text(found.sd)}, {found.engaged:.1%} engage where fewest do",
                *_retries(found),
            ]
        lines += [] if self.guess is None else self._surrogate_lines(self.guess)
        if open_ones and not self.refusal:
            lines.append("landing not judged: the surrogate knows none; leave out --surrogate")
        return [*lines, "", *self.check_parts, *self.landing_of(self.shifts, "planar")]

    def _surrogate_lines(self, guess: Guess) -> list[str]:
        answer, expected, q2, lines = guess.answer, guess.answer.expected, guess.validation.q2, []
        if self.quick is not None:
            time = answer.refusal if expected is None else _interval(expected)
            lines = [f"surrogate {guess.path}: {time}"]
            lines += [] if expected is None else _retries(expected)
        if self.missed:
            lines.append(
                "warning: the surrogate misses the simulated time by more than its interval"
            )
        lines += [f"warning: {one}; the surrogate extrapolates" for one in answer.warnings]
        lines.append(f"distance to the next simulated design: {answer.distance:.1f} usual spacings")
        if not guess.validation.useful:
            lines.append(
                f"warning: on designs that it has not seen the surrogate has Q2 {q2:.2f}; "
                "simulate more designs before relying on it"
            )
        if expected is not None:
            lines.append(
                f"within the tolerances: {1e3 * guess.spread.worst_case_s:.2g} ms in the worst "
                f"case, {1e3 * guess.spread.root_sum_square_s:.2g} ms by root sum of squares"
            )
        return lines

    @property
    def facts(self) -> dict[str, str]:
        """Expected time with its interval, verdict and smallest margin."""
        found, name = self.expected, "compiled engine" if self.quick else "surrogate"
        if found is None:
            return {"shift time": f"none: {self.refusal}", **self.verdict}
        facts = {f"shift time by the {name}": _interval(found)}
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
            "time_within_tolerances": self.guess.spread.to_dict(),
        }


def _interval(found: Expected) -> str:
    """Print a time with its 95 % interval."""
    return interval_text(found.time, found.low, found.high)


def _retries(found: Expected) -> list[str]:
    """Split an interval into shifts that engage and retries, where retries count."""
    if not found.retries and not found.retries_error:
        return []
    bare, error = found.without_retries
    return [
        f"without retries {time_text(bare, 1.96 * error)}, retries "
        f"{time_text(found.retries, 1.96 * found.retries_error)} (95 %)"
    ]


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
    return Guess(answer, tolerance_time(config, model, own, mix), stored.validation, path)


def simulate_quickly(config: Setup) -> Quick:
    """Simulate the design of a study by the compiled engine at all of its operating points."""
    # Half a second that an answer of the surrogate does not need.
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415
    from dogshape.pipeline.simulate.executor import scratch_executor  # noqa: PLC0415

    angles = max(SHIFTS // len(config.points), LEAST_ANGLES)
    seed = config.file.expectation.seed
    (one,) = evaluate(config.in_engine("planar"), [{}], scratch_executor(1), angles, seed)
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
    return Quick(expected, found.engaged, refusal, one.measured, found.shifts)
