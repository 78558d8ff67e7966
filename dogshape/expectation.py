"""Expected shift time over the random relative angle, at one operating point or a study's mix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.reports.kit.result_charts import means_by_point
from dogshape.pipeline.simulate.evaluation import expectation_of
from dogshape.pipeline.simulate.precision import FIRST, expect_to
from dogshape.pipeline.store.result_records import expectation_record
from dogshape.result import Result, ms
from dogshape.running import Where, angles_text, require_angles
from dogshape.sim.errors import InputError, require_between
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
        mean = self.mean
        timed = {
            "expected shift time": ms(mean.mean, mean.standard_error),
            "engaged": f"{mean.engaged:.1%}",
        }
        return {
            **(timed if mean.engages else {"engagement": mean.engaged_words}),
            "operating points": str(len(mean.points)),
            "shifts": str(mean.shifts),
        }

    def to_dict(self) -> dict[str, Any]:
        """Give mean, errors, and an entry for each operating point."""
        engine, mechanism = self.config.clutch.solver.engine, self.config.mechanism
        more = {"mechanism": mechanism} if mechanism else {}
        return {"engine": engine, **expectation_record(self.mean), **more}

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
) -> Expectation:
    """Simulate the expected shift time.

    Parameters
    ----------
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    force_rise_s : rise time of the force at that point, s.
    angles : how many evenly spaced relative angles, or the angles themselves, deg; None for the
        study's number.
    precision : wanted relative standard error, which finds the number of angles.

    Raises
    ------
    InputError, GeometryError
        For one half of an operating point, a precision out of range, a dog that cannot be made.
    """
    require_makeable(config.clutch.dog, config.limits.manufacturing)
    require_angles(angles)
    if force_rise_s is not None and force_N is None:
        raise InputError("--force-rise-s goes with one operating point; give its speed and force")
    points = points_of(config, mismatch_rpm, force_N, force_rise_s, OWN_RISE)
    if precision is not None and angles is not None:
        raise InputError("--precision finds the number of angles itself; leave out --angles")
    asked = config.config_hash, mismatch_rpm, force_N, force_rise_s, angles_text(angles), precision
    if precision is None:
        return Expectation(config, _at_angles(config, where, points, angles, asked))
    require_between("--precision", precision, 1e-3, 1.0, "give for instance 0.01")
    with where.executor("expect", asked, FIRST * len(points)) as running:
        found = expect_to(config, points, precision, running.executor, running.counter)
        error = numerical_error(found.blocks, found.rows, running.executor.run)
    return Expectation(config, replace(found.expectation, numerical_error=error))


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
    with where.executor("expect", asked, shifts + repeated(shifts)) as running:
        rows = running.executor.run(blocks)
        error = numerical_error(blocks, rows, running.executor.run)
    found = expectation_of(config, points, rows, even=even)
    return replace(found, numerical_error=error)
