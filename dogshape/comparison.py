"""A bench data set beside the simulation of its operating points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from dogshape.diagnosis.bench.bench_data import Bench as BenchData
from dogshape.diagnosis.bench.bench_data import require_something
from dogshape.diagnosis.bench.comparison import ANGLES, compare
from dogshape.diagnosis.bench.comparison import Comparison as Compared
from dogshape.diagnosis.report.wording import findings_record
from dogshape.pipeline.store.result_records import difference_record, engaged_record
from dogshape.result import Result, ms
from dogshape.running import Where, angles_text, require_angles
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.numerical_error import repeated
from dogshape.sim.statistics.shift_records import clutch_record
from dogshape.sim.units import DEG

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

LEAST = 3  #: angles of a comparison, of which a spread can be known


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Bench and simulated mean shift time at every operating point of a data set.

    Parameters
    ----------
    compared : the operating points with their differences, and the data set.
    """

    compared: Compared

    @property
    def rmse_s(self) -> float | None:
        """Root-mean-square gap, s; None without a bench time."""
        return self.compared.rmse

    @property
    def facts(self) -> dict[str, str]:
        """Data set, root-mean-square gap, and shares that engaged."""
        engaged, tried, simulated = self.compared.engaged
        relative = self.compared.relative_rms
        return {
            "data": self.compared.bench.name,
            "operating points": str(len(self.compared.differences)),
            "root-mean-square gap": ms(self.compared.rmse),
            "relative": "-" if relative is None else f"{relative:.1%}",
            "engaged": f"{engaged} of {tried}, {simulated:.0%} in the simulation"
            if tried else "not said",
        }  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Give each operating point, the gap over all of them, and what looks odd in the set."""
        result = self.compared
        return {
            "name": result.bench.name,
            "engine": result.bench.clutch.solver.engine,
            "points": [difference_record(d) for d in result.differences],
            "rmse_s": result.rmse,
            "relative_rms": result.relative_rms,
            "engaged": engaged_record(result),
            "numerical_error_s": result.numerical_error,
            **findings_record(result.bench),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each operating point: bench, simulation, standard error, z."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame(self.to_dict()["points"])

    def plot(self) -> go.Figure:
        """Draw bench times beside the simulated ones with their 90 % band, a panel a force."""
        from dogshape.pipeline.reports.gap.before_after import compared_figure  # noqa: PLC0415

        return compared_figure(self.compared)


def simulate_bench(
    bench: BenchData,
    where: Where,
    angles: int | Sequence[float] | None = None,
    engine: str | None = None,
) -> Comparison:
    """Simulate the operating points of a data set and compare.

    Parameters
    ----------
    bench : the data set.
    where : where the shifts run, and are kept.
    angles : how many evenly spaced relative angles, or the angles themselves, deg, at least
        three; None for those of the set, or sixteen.
    engine : ``drake`` or ``planar``; None for that of the set's study.

    Raises
    ------
    InputError, DataError
        For fewer angles, and for a data set in which nothing is known of any shift.
    """
    require_angles(angles)
    chosen: int | tuple[float, ...] | None
    if angles is None or isinstance(angles, int):
        chosen, given = angles, ANGLES if angles is None else angles
    else:
        chosen, given = tuple(angle * DEG for angle in angles), len(angles)
    if given < LEAST:
        raise InputError(
            f"--angles is '{angles_text(angles)}', but a comparison needs at least three; give more"
        )
    require_something(bench)
    if engine is not None:
        bench = replace(bench, clutch=bench.clutch.with_engine(engine))
    own = bench.relative_angles if angles is None else None
    shifts = len(bench.cells) * (len(own) if own else given)
    propagated = 4 * shifts if bench.errors else 0  # at most: either side of force and mismatch
    asked = bench.name, clutch_record(bench.clutch), angles_text(angles)
    with where.executor("validate", asked, shifts + propagated + repeated(shifts)) as running:
        return Comparison(compare(bench, running.executor.run, chosen, checked=True))
