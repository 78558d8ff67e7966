"""Expected shift time over relative angle and operating points, also at draws of a study's keys."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtri

from dogshape.bench.texts import read_table
from dogshape.pipeline.config.study_file import (
    ALL_POINTS,
    RequestedPoint,
    Setup,
    load_study,
    points_of,
    settings_of,
)
from dogshape.pipeline.progress import Progress, WorkCounter
from dogshape.pipeline.record import (
    Figure,
    Frame,
    Table,
    frame_of,
    number_or_none,
    percent,
    tabulate,
)
from dogshape.pipeline.reports.text import (
    ENGINES,
    engaged_text,
    hang_words,
    interval_text,
    numerical_words,
    quantile_words,
    time_text,
)
from dogshape.pipeline.simulate.design import SIMULATED
from dogshape.pipeline.simulate.evaluation import (
    FIRST_ANGLES,
    expect_to_precision,
    expectation_of,
    with_torques,
)
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.pipeline.store.result_records import (
    ExpectedTime,
    LimitRow,
    PointRow,
    TorqueLimitRow,
)
from dogshape.result import Result
from dogshape.running import Angles, in_radians, receiver
from dogshape.sim.errors import DataError, DogshapeError, InputError, require_between
from dogshape.sim.interface import argument
from dogshape.sim.statistics.blocks import even_blocks, numerical_error, repeat_count
from dogshape.sim.statistics.expectation import NO_TIME, MixExpectation
from dogshape.sim.units import DEG, RPM

DRAW_LABELS = ("draw", "hypothesis")  #: columns of draws that are no keys
INTERVAL_TAILS = 0.05, 0.95  #: lower and upper probability of the interval over draws
MIN_DRAW_ANGLES = 3  #: relative angles at an operating point of a draw, for a standard error
#: Standard normal quantiles of the error that all draws have in common, (50,).
COMMON_DEVIATIONS = ndtri((np.arange(50) + 0.5) / 50)


@dataclass(frozen=True, repr=False)
class Expectation(Result):
    """Expected shift time with its errors, over the relative angle and the operating points."""

    config: Setup
    mean: MixExpectation
    precision: float | None = None  #: wanted relative standard error of the engaged mean

    @property
    def shortfall(self) -> list[str]:
        """Warning of a relative standard error above the required precision; empty otherwise."""
        error = self.mean.relative_error
        precision = self.precision
        if precision is None or error <= precision:
            return []
        angles = max(point.n for point in self.mean.points)
        return [
            f"warning: precision not reached: relative standard error {error:.3g}, wanted "
            f"{precision:.3g} ({error - precision:.3g} more), with {angles} "
            "angles at each operating point; give a larger number of angles instead"
        ]

    @property
    def time_s(self) -> float | None:
        """Expected shift time, s, over all operating points; retries included.

        None where fewer than half of the shifts engage at some operating point.
        """
        return self.mean.time

    @property
    def standard_error_s(self) -> float:
        """Standard error of the expected shift time, s, by the angles and by rare hangs."""
        return self.mean.standard_error

    @property
    def interval_s(self) -> tuple[float, float]:
        """95 % interval of the expected shift time, s; NaN of too few shifts for an error."""
        return self.mean.interval()

    @property
    def engaged_mean_s(self) -> float | None:
        """Mean time of engaged shifts, s; None where none engages at some operating point."""
        return self.record.engaged_mean_s

    @property
    def hang_probability(self) -> float | None:
        """Posterior mean of the probability that a shift hangs and is tried again."""
        return self.record.hang_probability

    @property
    def hang_interval(self) -> tuple[float, float]:
        """Interval of that probability, 95 %."""
        return self.mean.hang_interval

    @cached_property
    def record(self) -> ExpectedTime:
        """Expected time and operating points by their declared keys."""
        return ExpectedTime.of(self.mean)

    def to_parts(self) -> list[str | Table]:
        """Tabulate operating points, with lines on expected time, hangs, entries and engine."""
        mean = self.mean
        record = self.record
        table = tabulate(PointRow, record.points)
        hangs = f"{hang_words(record)}; {self.config.retry_text}; "
        hangs += mean.losses if mean.lost else f"none of {mean.shifts} shifts hung"
        engine = f"simulated by {ENGINES[self.config.clutch.solver.engine]}"
        actuator = filter(None, [self.config.actuator_text])
        sources = [self.config.shafts_text, *actuator, engine, *self.shortfall]
        if not mean.engages:
            count = f"engages in {mean.shifts - mean.lost} of {mean.shifts} shifts"
            return [f"{count}: {NO_TIME}", table, hangs, *sources]
        engaged_mean = f"mean of engaged shifts {engaged_text(record)}{self._precision_words()}"
        parts: list[str | Table] = [table, self._time_line(), engaged_mean]
        quantiles = quantile_words(record.quantiles or ())
        if quantiles:
            parts.append(f"shift time over the life: {quantiles}")
        lines = [hangs, *self._numerical_line(), self._entry_line()]
        return [*parts, *lines, *self._limit_tables(), *sources]

    def _time_line(self) -> str:
        """Describe the expected time with its standard error, or its interval of few shifts."""
        mean = self.mean
        if not self.record.judges_hangs and self.record.standard_error_s is not None:
            angles = max(point.n for point in mean.points)
            time = interval_text(mean.mean, *mean.interval())
            return f"expected shift time {time}; {angles} angles are too few to judge hangs"
        error = (
            f"± {1e3 * mean.standard_error:.2f} ms (one standard error over angles, with that of "
            "hangs)"
        )
        if self.record.standard_error_s is None:
            error = "ms (of too few shifts to say by how much it errs)"
        return f"expected shift time {1e3 * mean.mean:.2f} {error}"

    def _numerical_line(self) -> list[str]:
        """Describe the numerical error beside the standard one; empty where not computed."""
        error = self.mean.numerical_error
        return [] if error is None else [numerical_words(error, self.record.standard_error_s)]

    def _precision_words(self) -> str:
        """Describe the precision that was asked for, which leaves rare hangs out."""
        if self.precision is None:
            return ""
        reached = f"{percent(self.mean.relative_error)} of {percent(self.precision)} wanted"
        return f" (precision {reached}, hangs left out)"

    def _entry_line(self) -> str:
        """Describe the share of direct entries, simulated and in closed form."""
        mean = self.mean
        direct = sum(counts[0] for point in mean.points for counts in point.by_angle)
        line = f"{direct} of {mean.shifts} shifts enter a slot without touching a face"
        closed = [p.direct_share for p in mean.points if p.direct_share is not None]
        if closed:
            mean_closed = sum(closed) / len(closed)
            line += f", {percent(direct / mean.shifts)}; closed form {percent(mean_closed)}"
        return line

    def _limit_tables(self) -> list[Table]:
        """Tabulate the simulated limits of engagement over mismatch and torque."""
        record = self.record
        tables = []
        if record.engagement_limits:
            tables.append(tabulate(LimitRow, record.engagement_limits))
        if record.engagement_torque_limits:
            tables.append(tabulate(TorqueLimitRow, record.engagement_torque_limits))
        return tables

    def shiftability(self) -> Frame:
        """Count shifts by entry, a row for each operating point and bin of its angles.

        ``direct_closed_form`` is the share of direct entries of the whole point, of flat tips.
        """
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        pitch = self.config.clutch.dog.pitch_angle / DEG
        rows = []
        for estimate in self.mean.points:
            mismatch = estimate.point.mismatch / RPM
            force = estimate.point.profile.force
            for k, counts in enumerate(estimate.by_angle):
                angle = (k + 0.5) * pitch / len(estimate.by_angle)
                rows.append((mismatch, force, angle, *counts, estimate.direct_share))
        entries = ("direct", "after_face_contact", "not_engaged")
        names = ("mismatch_rpm", "force_N", "angle_deg", *entries, "direct_closed_form")
        return pd.DataFrame(rows, columns=names)

    def plot_shiftability(self) -> Figure:
        """Map direct entry over mismatch and force, and over mismatch and relative angle."""
        from dogshape.pipeline.reports.charts import shiftability_figure  # noqa: PLC0415  slow to load

        return shiftability_figure({"": (self.record.points, self.config.clutch.dog.count)})

    def to_dict(self) -> dict[str, Any]:
        """Convert mean, errors and operating points to values of JSON."""
        mechanism = self.config.mechanism
        actuator = self.config.clutch.actuator
        low, high = self.interval_s if self.mean.engages else (math.nan, math.nan)
        precision: dict[str, Any] = {}
        if self.precision is not None:
            error = number_or_none(self.mean.relative_error)
            precision = {"precision": {"wanted": self.precision, "reached": error}}
        return {
            "engine": self.config.clutch.solver.engine,
            **self.record.to_dict(),
            "expected_shift_time_low_s": number_or_none(low),
            "expected_shift_time_high_s": number_or_none(high),
            "judges_hangs": self.record.judges_hangs,
            **({"actuator": actuator.record} if actuator else {}),
            **({"mechanism": mechanism} if mechanism else {}),
            **precision,
            "shafts": self.config.clutch.drive.text,
        }

    def plot(self) -> Figure:
        """Draw the mean time of each operating point with its 95 % interval."""
        from dogshape.pipeline.reports.charts import TimeMark, times_by_point  # noqa: PLC0415

        return times_by_point({"mean": list(map(TimeMark.with_retries, self.record.points))})

    def to_frame(self) -> Frame:
        """Tabulate operating points: mean, standard error, spread, share engaged."""
        return frame_of(self.record.points).drop(columns=["shiftability", "hang_prior"])


def simulate_mean(
    config: Setup,
    options: RunOptions,
    requested: RequestedPoint,
    angles: Angles,
    precision: float | None = None,
) -> Expectation:
    """Simulate the expected shift time as ``Study.expect`` does, for a study that is read."""
    config = config.search_setup
    clutch = config.clutch
    settings = config.file.expectation
    if requested.force_rise_s is not None and requested.force_N is None:
        rise = argument("force_rise_s")
        raise InputError(f"{rise} goes with one operating point; give its speed and force")
    points = points_of(config, requested, f", or give {argument('force_rise_s')}")
    if precision is not None and angles is not None:
        raise InputError(
            f"{argument('precision')} finds the number of angles itself; leave out "
            f"{argument('angles')}"
        )
    relative_angles = in_radians(settings.angles if angles is None else angles)
    question = config.config_hash, *requested, relative_angles, precision
    blocks = even_blocks(
        clutch, points, relative_angles, settings.seed, uncertainty=config.uncertainty
    )
    shifts = sum(len(block.angles) for block in blocks)
    shifts += repeat_count(shifts) + len(settings.limit_torques_Nm or ()) * shifts
    if precision is not None:
        require_between(argument("precision"), precision, 1e-3, 1.0, "give for instance 0.01")
        shifts = FIRST_ANGLES * len(points)
    with options.executor("expect", question, shifts) as (executor, counter):
        if precision is not None:
            mean, blocks, rows = expect_to_precision(config, points, precision, executor, counter)
        else:
            rows = executor.run(blocks)
            mean = expectation_of(config, points, rows, even=isinstance(relative_angles, int))
        error = numerical_error(blocks, rows, executor.run)
        mean = with_torques(config, mean, blocks, executor.run)
    return Expectation(config, replace(mean, numerical_error=error), precision)


@dataclass(frozen=True, repr=False)
class DrawnExpectation(Result):
    """Expected shift times of a study, one for each draw of some of its keys.

    ``times`` and their standard ``errors``, s, (draws,), are NaN of a draw in which too few shifts
    engage. All draws have the same relative angles, and so a common error.
    """

    studies: tuple[Setup, ...]
    times: np.ndarray
    errors: np.ndarray

    @property
    def interval_s(self) -> tuple[float, float]:
        """5 % and 95 % quantile over the draws, their common error included, s."""
        low, high = np.quantile(
            self.times[:, None] + self.error_s * COMMON_DEVIATIONS, INTERVAL_TAILS
        )
        return float(low), float(high)

    @property
    def error_s(self) -> float:
        """Standard error by angles and hangs, common to all draws, s."""
        return float(np.sqrt((self.errors**2).mean()))

    def to_parts(self) -> list[str | Table]:
        """Describe mean and 90 % interval over the draws."""
        count = len(self.times)
        engaging = np.isfinite(self.times).sum()
        if engaging < count:
            share = f"in {engaging} of {count} draws"
            return [f"engagement: enough shifts engage {share}: {NO_TIME} of the others"]
        mean = float(self.times.mean())
        low, high = self.interval_s
        return [
            f"expected shift time: {interval_text(mean, low, high, '90 %')}",
            f"draws: {count}",
            f"of that by angles and hangs: ± {time_text(self.error_s)}, the same in all draws",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Convert mean, interval and the time of each draw to values of JSON."""
        low, high = self.interval_s
        sd = float(self.times.std(ddof=1)) if len(self.times) > 1 else 0.0
        times = {SIMULATED: float(self.times.mean()), "low_s": low, "high_s": high, "sd_s": sd}
        return {
            "engine": self.studies[0].clutch.solver.engine,
            "draws": len(self.times),
            **{key: number_or_none(time) for key, time in times.items()},
            "standard_error_of_one_s": number_or_none(self.error_s),
            "times_s": [number_or_none(time) for time in self.times.tolist()],
        }

    def plot(self) -> Figure:
        """Draw the distribution of the expected shift time over the draws, ms."""
        from dogshape.pipeline.reports.result_figures import draws_figure  # noqa: PLC0415

        return draws_figure(self.times.tolist(), *self.interval_s)

    def to_frame(self) -> Frame:
        """Tabulate time and standard error, s, a row for each draw."""
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        return pd.DataFrame({SIMULATED: self.times, "standard_error_s": self.errors})


def expect_draws(
    study: str | Path,
    draws: str | Path,
    settings: Mapping[str, Any] | Iterable[str] = (),
    *,
    angles: int | None = None,
    jobs: int = 0,
    cluster: str | None = None,
    progress: Progress | bool | None = None,
    engine: str | None = None,
) -> DrawnExpectation:
    """Simulate the expected shift time at each draw of some keys of a study.

    InputError or DataError for a table, a key or a value that cannot be used, with its row, or too
    few angles. Example: ``ds.expect_draws("stand.toml", "stand-draws.csv", angles=8)``

    Parameters
    ----------
    study : as for ``Study``.
    draws : table whose columns are keys of the study, a row for each draw (``diagnose --write``).
    settings : further keys, for instance another dog; those of a draw give way to them.
    angles : relative angles at each operating point, at least 3; None for the study's number.
    jobs, cluster, engine : as in ``Study.expect``.
    progress : likewise; receives the number of finished draws.
    """
    if angles is not None and angles < MIN_DRAW_ANGLES:
        raise InputError(
            f"angles is {angles}, but must be at least {MIN_DRAW_ANGLES}: of fewer the error is "
            "not known, which all draws have in common"
        )
    keys = settings_of(settings)
    if engine is not None:
        keys["solver.engine"] = engine
    studies = _drawn_studies(study, Path(draws), keys)
    means = []
    with WorkCounter(receiver(progress), len(studies), unit="draws") as counter:
        for setup in studies:
            means.append(simulate_mean(setup, RunOptions(jobs, cluster), ALL_POINTS, angles))
            counter.advance(1)
    times = np.array([mean.time_s for mean in means], dtype=float)
    errors = np.array([mean.standard_error_s for mean in means])
    return DrawnExpectation(tuple(mean.config for mean in means), times, errors)


def _drawn_studies(study: str | Path, path: Path, common_keys: Mapping[str, Any]) -> list[Setup]:
    """Load a study for each row of a table of keys; ``common_keys`` take precedence."""
    try:
        table = read_table(path, ())
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; name a table whose columns are keys") from error
    if not table.rows or set(table.head) <= set(DRAW_LABELS):
        raise DataError(f"{path} has no draws; give a row for each, columns named like keys")
    studies = []
    for row, cells in table.rows:
        pairs = zip(table.head, cells, strict=True)
        keys = [f"{key}={cell}" for key, cell in pairs if key not in DRAW_LABELS and cell]
        try:
            studies.append(load_study(study, {**settings_of(keys), **common_keys}))
        except DogshapeError as error:
            raise type(error)(f"{path}, row {row}: {error}") from error
    return studies
