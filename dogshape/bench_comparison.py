"""A bench data set beside the simulation of its operating points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dogshape.bench.bench_data import load_bench, require_shifts
from dogshape.diagnosis.comparison import ANGLES, PointGaps, compare
from dogshape.diagnosis.report.wording import findings_record
from dogshape.pipeline.progress import Progress
from dogshape.pipeline.record import (
    Figure,
    Frame,
    Table,
    frame_of,
    number_or_none,
    percent,
    tabulate,
)
from dogshape.pipeline.reports.text import ENGINES, numerical_words, time_text
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.pipeline.store.result_records import BenchPoint
from dogshape.result import Result
from dogshape.running import Angles, in_radians, receiver
from dogshape.sim.errors import InputError
from dogshape.sim.interface import argument
from dogshape.sim.statistics.blocks import repeat_count
from dogshape.sim.statistics.shift_records import clutch_record

DRAKE_SHIFT_S = 0.5  #: processor time of a shift in Drake, of repeated finer ones too
MIN_COMPARED_ANGLES = 3  #: relative angles at each operating point, for an estimate of the spread


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Bench and simulated mean shift time at every operating point of a data set.

    ``compared`` has the operating points with their differences, and the data set.
    """

    compared: PointGaps

    def to_parts(self) -> list[str | Table]:
        """Tabulate operating points, with lines on the gap and on doubtful values of the set."""
        from dogshape.pipeline.reports.gap_page import examined_lines  # noqa: PLC0415  # plotly

        comparison = self.compared
        relative = comparison.relative_rms
        engaged, attempts, simulated = comparison.engaged
        engagement = (
            f"{engaged} of {attempts}, simulated {percent(simulated)}" if attempts else "not said"
        )
        parts: list[str | Table] = [
            tabulate(BenchPoint, self.rows),
            "z: bench less simulated, over s.e.",
            f"data: {comparison.bench.name}",
            f"operating points: {len(comparison.differences)}",
            f"root-mean-square gap: {time_text(comparison.rmse)}",
            f"relative: {'-' if relative is None else percent(relative)}",
            f"engaged: {engagement}",
        ]
        error = comparison.numerical_error
        if error is not None:
            parts.append(numerical_words(error))
        return [*parts, *examined_lines(comparison.bench)]

    @property
    def rows(self) -> list[BenchPoint]:
        """Operating points by the declared keys."""
        return [BenchPoint.of(difference) for difference in self.compared.differences]

    def to_dict(self) -> dict[str, Any]:
        """Convert operating points, gap and doubtful values of the set to values of JSON."""
        result = self.compared
        error = result.numerical_error
        engaged, attempts, simulated = result.engaged
        simulated_share = simulated if attempts else None
        return {
            "name": result.bench.name,
            "engine": result.bench.clutch.solver.engine,
            "points": [row.to_dict() for row in self.rows],
            "rmse_s": result.rmse,
            "relative_rms": result.relative_rms,
            "engaged": {
                "engaged": engaged,
                "tried": attempts,
                "simulated_share": simulated_share,
            },
            "numerical_error_s": None if error is None else number_or_none(error.size),
            **findings_record(result.bench),
        }

    def plot(self) -> Figure:
        """Draw bench times beside the simulated ones with their 90 % band, a panel a force."""
        from dogshape.pipeline.reports.charts import TimeMark, times_by_point  # noqa: PLC0415

        rows = self.rows
        simulated = [TimeMark.of(row, row.simulated_s, row.standard_error_s) for row in rows]
        measured = [TimeMark.of(row, row.bench_s, None) for row in rows]
        return times_by_point({"simulation": simulated, "bench": measured})

    def to_frame(self) -> Frame:
        """Tabulate bench, simulation, standard error and z, a row for each operating point."""
        return frame_of(self.rows)


def validate(
    bench: str | Path,
    angles: Angles = None,
    *,
    correct: Sequence[str] = (),
    jobs: int = 0,
    cluster: str | None = None,
    journal: str | Path | None = None,
    progress: Progress | bool | None = None,
    engine: str | None = None,
) -> Comparison:
    """Simulate the operating points of a bench data set and compare.

    DataError or InputError for data that cannot be true, with file, row, column and the correction,
    for a set without a time or an outcome of any shift, and for fewer than three angles.
    Example: ``ds.validate("mq200_adams", 24)``

    Parameters
    ----------
    bench : folder with ``bench.toml`` and ``shifts.csv``, or name of a set that the package brings.
    angles : how many evenly spaced relative angles, or the angles themselves, deg; None for those
        of the set, or sixteen.
    correct : corrections of units and axes that the user confirms, ``"time=ms"``.
    jobs, cluster, journal, progress : as in ``Study.expect``.
    engine : ``drake`` or ``planar``; None for that of the set's study.
    """
    data = load_bench(bench, correct)
    default_angles = data.relative_angles or ANGLES
    relative_angles = default_angles if angles is None else in_radians(angles)
    count = relative_angles if isinstance(relative_angles, int) else len(relative_angles)
    if angles is not None and count < MIN_COMPARED_ANGLES:
        raise InputError(
            f"{argument('angles')} is '{angles}', but a comparison needs at least three; give more"
        )
    require_shifts(data, times=False)
    if engine is not None:
        data = replace(data, clutch=data.clutch.with_engine(engine))
    shifts = len(data.cells) * count
    propagated = 4 * shifts if data.errors else 0  # at most: either side of force and mismatch
    question = data.name, clutch_record(data.clutch), relative_angles
    options = RunOptions(jobs, cluster, journal, receiver(progress))
    work = shifts + propagated + repeat_count(shifts)
    with options.executor("validate", question, work) as (executor, counter):
        counter.say(_work_words(data.clutch.solver.engine, work, journal))
        return Comparison(compare(data, executor.run, relative_angles, checked=True))


def _work_words(engine: str, shifts: int, journal: str | Path | None) -> str:
    """Announce the shifts of a comparison, their time, and the folder of finished ones."""
    words = f"{shifts} shifts by {ENGINES[engine]}"
    if engine == "drake":
        words += (
            f", about {math.ceil(DRAKE_SHIFT_S * shifts / 60.0)} min of one core; the compiled "
            f"engine takes seconds ({argument('engine', 'planar')})"
        )
    if journal is not None:
        words += f"; a stopped run leaves its finished shifts in {journal}"
    return words
