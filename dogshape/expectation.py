"""Expected shift time over the random relative angle, at one operating point or a study's mix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.asked_points import points_of
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit.result_charts import means_by_point
from dogshape.pipeline.simulate.evaluation import expectation_of
from dogshape.pipeline.simulate.precision import FIRST, expect_to
from dogshape.pipeline.simulate.two_levels import expect_in_two_levels, first_shifts
from dogshape.pipeline.store.result_records import expectation_record
from dogshape.result import Result, ms
from dogshape.running import Where, angles_text, require_angles
from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.blocks import even_blocks, listed_blocks
from dogshape.sim.statistics.expectation import Expectation as Mean
from dogshape.sim.statistics.numerical_error import numerical_error, repeated
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

OWN_RISE = ", or give --force-rise-s"  #: for forces that the study's table lacks


@dataclass(frozen=True, repr=False)
class Expectation(Result):
    """Expected shift time with its errors, over the relative angle and the operating points."""

    config: Setup
    mean: Mean

    @property
    def time_s(self) -> float | None:
        """Expected shift time, s, over all operating points; retries included.

        None where fewer than half of the shifts engage at some operating point.
        """
        return self.mean.time

    @property
    def standard_error_s(self) -> float:
        """Standard error of the expected shift time, s."""
        return self.mean.standard_error

    @property
    def facts(self) -> dict[str, str]:
        """Time with its standard error, share engaged, and what it was simulated from.

        Without a time the shifts that engage lead.
        """
        mean, planar = self.mean, self.mean.planar_shifts
        beside = f", and {planar} of the compiled engine" if planar else ""
        timed = {
            "expected shift time": ms(mean.mean, mean.standard_error),
            "engaged": f"{mean.engaged:.1%}",
        }
        return {
            **(timed if mean.engages else {"engagement": mean.engaged_words}),
            "operating points": str(len(mean.points)),
            "shifts": f"{mean.shifts}{beside}",
        }

    @property
    def engines(self) -> dict[str, int]:
        """Engines behind the mean with the number of their shifts; two of them in two levels."""
        planar = self.mean.planar_shifts
        own = {self.config.clutch.solver.engine: self.mean.shifts}
        return {**own, "planar": planar} if planar else own

    def to_dict(self) -> dict[str, Any]:
        """Give mean, errors, and an entry for each operating point.

        ``engines`` has the shifts of each engine. In two levels ``n``, ``shifts``, ``engaged`` and
        what did not engage are Drake's, ``n_planar`` are shifts of the compiled engine beside.
        """
        engine, mechanism = self.config.clutch.solver.engine, self.config.mechanism
        more = {"mechanism": mechanism} if mechanism else {}
        record = expectation_record(self.mean)
        for entry, point in zip(record["points"], self.mean.points, strict=True):
            entry["n_planar"] = point.n_planar
        return {"engine": engine, "engines": self.engines, **record, **more}

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each operating point: mean, standard error, spread, share engaged."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame(self.to_dict()["points"])

    def plot(self) -> go.Figure:
        """Draw the mean time of each operating point with its standard error."""
        return means_by_point(self.to_dict()["points"])


def simulate_mean(
    config: Setup,
    where: Where,
    mismatch_rpm: float | None = None,
    force_N: float | None = None,
    force_rise_s: float | None = None,
    *,
    angles: int | Sequence[float] | None = None,
    precision: float | None = None,
    levels: int | None = None,
) -> Expectation:
    """Simulate the expected shift time.

    Parameters
    ----------
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    force_rise_s : rise time of the force at that point, s.
    angles : how many evenly spaced relative angles, or the angles themselves, deg; None for the
        study's number.
    precision : wanted relative standard error, which finds the number of angles.
    levels : with a precision, 2 for shifts of the compiled engine that some of Drake's at the same
        angles correct (``sim.statistics.two_levels``), 1 for the study's engine alone; None for 2
        where that is Drake.

    Raises
    ------
    InputError, GeometryError
        For one half of an operating point, a precision or levels out of range, a dog that cannot
        be made.
    """
    require_makeable(config.clutch.dog, config.limits.manufacturing)
    require_angles(angles)
    if force_rise_s is not None and force_N is None:
        raise InputError("--force-rise-s goes with one operating point; give its speed and force")
    points = points_of(config, mismatch_rpm, force_N, force_rise_s, OWN_RISE)
    if precision is not None and angles is not None:
        raise InputError("--precision finds the number of angles itself; leave out --angles")
    asked = config.config_hash, mismatch_rpm, force_N, force_rise_s, angles_text(angles), precision
    levels = _levels(config, precision, levels)
    if precision is None:
        return Expectation(config, _at_angles(config, where, points, angles, asked))
    require_between("--precision", precision, 1e-3, 1.0, "give for instance 0.01")
    one = levels == 1
    shifts = FIRST * len(points) if one else first_shifts(len(points), precision)
    with where.executor("expect", (*asked, levels), shifts) as running:
        method = expect_to if one else expect_in_two_levels
        found = method(config, points, precision, running.executor, running.counter)
        error = numerical_error(found.blocks, found.rows, running.executor.run)
    return Expectation(config, replace(found.expectation, numerical_error=error))


def _levels(config: Setup, precision: float | None, levels: int | None) -> int:
    """Return the number of levels; InputError for one that there is not."""
    compiled = config.clutch.solver.engine == "planar"
    if levels is None:
        return 1 if compiled or precision is None else 2
    if levels not in (1, 2):
        raise InputError(refusal("--levels", levels, "", "it must be 1 or 2", "give one of them"))
    if precision is None:
        raise InputError("--levels goes with --precision; --angles has one level. Leave one out")
    if levels == 2 and compiled:
        raise InputError(
            "--levels is 2, but a study of the compiled engine has one level; leave out --levels, "
            "or give --engine drake"
        )
    return levels


def _at_angles(
    config: Setup,
    where: Where,
    points: tuple[OperatingPoint, ...],
    angles: int | Sequence[float] | None,
    asked: tuple[Any, ...],
) -> Mean:
    """Simulate evenly spaced angles, or those that are listed, deg."""
    settings, unsure = config.file.expectation, config.uncertainty
    even = angles is None or isinstance(angles, int)
    if angles is None or isinstance(angles, int):
        count = settings.angles if angles is None else angles
        blocks = even_blocks(config.clutch, points, count, settings.seed, uncertainty=unsure)
    else:
        listed = tuple(angle * DEG for angle in angles)
        blocks = listed_blocks(config.clutch, points, listed, settings.seed, unsure)
    shifts = sum(len(block.angles) for block in blocks)
    again = repeated(shifts)
    with where.executor("expect", asked, shifts + again, again) as running:
        rows = running.executor.run(blocks)
        error = numerical_error(blocks, rows, running.executor.run)
    found = expectation_of(config, points, rows, even=even)
    return replace(found, numerical_error=error)
