"""A bench data set as a problem, and the simulation of its operating points beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.diagnosis.bench.bench_data import Bench as BenchData
from dogshape.diagnosis.bench.bench_data import load_bench, require_something
from dogshape.diagnosis.bench.comparison import ANGLES, compare
from dogshape.diagnosis.bench.comparison import Comparison as Compared
from dogshape.diagnosis.report.wording import findings_record
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.record import Table, frame_of, tabulate
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.store.result_records import BenchPoint, engaged_record
from dogshape.result import Result
from dogshape.running import Where, angles_text, require_angles
from dogshape.sim.errors import InputError
from dogshape.sim.statistics.blocks import repeated
from dogshape.sim.statistics.shift_records import clutch_record
from dogshape.sim.units import DEG, RPM

if TYPE_CHECKING:
    import pandas as pd
    import plotly.graph_objects as go

    from dogshape.gap import Diagnosis


@dataclass(frozen=True, init=False, repr=False)
class Bench:
    """A bench data set, examined for slips of units and axes as it is read.

    Parameters
    ----------
    where : folder with ``bench.toml`` and ``shifts.csv``, or name of a set that the package
        brings.
    correct : corrections of units and axes that the user confirms, ``"time=ms"``.

    Raises
    ------
    DataError, InputError
        For data that cannot be true, with file, row, column and the correction.

    Examples
    --------
    >>> Bench("mq200_adams").name
    'mq200_adams'
    """

    data: BenchData

    def __init__(self, where: str | Path, correct: Sequence[str] = ()) -> None:
        object.__setattr__(self, "data", load_bench(where, correct))

    @property
    def name(self) -> str:
        """Name of the data set."""
        return self.data.name

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each row of the set, columns as in ``shifts.csv``, corrected.

        ``place`` is ``order``, or ``timestamp`` in s where there is none.
        """
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        rows = []
        for reading in self.data.readings:
            series = {"shift_time_sd_s": reading.sd, "place": reading.place}
            rows.append({
                "mismatch_rpm": reading.point.mismatch / RPM,
                "force_N": reading.point.profile.force,
                "force_rise_s": reading.point.profile.rise,
                "n_shifts": reading.n,
                "shift_time_s": reading.time,
                "engaged": reading.engaged,
                "trace": None if reading.trace is None else str(reading.trace.path),
                **{name: value for name, value in series.items() if value is not None},
            })  # fmt: skip
        index = pd.Index([reading.row for reading in self.data.readings], name="row")
        return pd.DataFrame(rows, index=index)

    def validate(
        self,
        angles: int | Sequence[float] | None = None,
        *,
        engine: str | None = None,
        jobs: int = 0,
        keep: str | Path | None = None,
        progress: Progress = SILENT,
    ) -> Comparison:
        """Simulate the operating points (``simulate_bench``).

        ``keep`` is a folder in which a run that was stopped leaves its finished shifts.
        """
        where = Where(jobs, None, None if keep is None else Path(keep), progress)
        return simulate_bench(self.data, where, angles, engine)

    def diagnose(self, **options: Any) -> Diagnosis:
        """Find what makes the bench differ from the simulation (``dogshape.diagnose``)."""
        from dogshape.gap import diagnose  # noqa: PLC0415

        return diagnose(self.data, **options)

    def __repr__(self) -> str:
        data = self.data
        shifts = sum(reading.n for reading in data.readings)
        counts = f"{shifts} shifts at {len(data.cells)} operating points"
        return f"Bench({', '.join([f'{data.name}: {counts}', *data.corrections])})"

    def _repr_html_(self) -> str:
        return f"<code>{escape(repr(self))}</code>"


MIN_ANGLES = 3  #: of a comparison, of which a spread can be known
FLIPPED = 1e-3  #: s, numerical error that the steps of the solver alone do not make
FLIP = (
    "so large a numerical error is a shift that flipped: of those repeated with a finer tolerance "
    "one or more came into another slot, or did not engage; with more --angles one such shift "
    "counts less"
)


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
            "root-mean-square gap": time_text(self.compared.rmse),
            "relative": "-" if relative is None else f"{relative:.1%}",
            "engaged": f"{engaged} of {tried}, {simulated:.0%} in the simulation"
            if tried else "not said",
        }  # fmt: skip

    @property
    def parts(self) -> list[str | Table]:
        """Operating points, the gap over all of them, and what looks odd in the set."""
        from dogshape.pipeline.reports.gap_page import examined_lines  # noqa: PLC0415  # plotly

        error = self.compared.numerical_error
        lines = ["z: bench less simulated, over s.e."]
        lines += [f"{name}: {value}" for name, value in self.facts.items()]
        if error is not None:
            lines.append(f"numerical error of the mean: {error * 1e3:.2g} ms")
            lines += [FLIP] if error > FLIPPED else []
        return [tabulate(BenchPoint, self.rows), *lines, *examined_lines(self.compared.bench)]

    @property
    def rows(self) -> list[BenchPoint]:
        """Operating points by the declared keys."""
        return [BenchPoint.of(one) for one in self.compared.differences]

    def to_dict(self) -> dict[str, Any]:
        """Give each operating point, the gap over all of them, and what looks odd in the set."""
        result = self.compared
        return {
            "name": result.bench.name,
            "engine": result.bench.clutch.solver.engine,
            "points": [row.to_dict() for row in self.rows],
            "rmse_s": result.rmse,
            "relative_rms": result.relative_rms,
            "engaged": engaged_record(result),
            "numerical_error_s": result.numerical_error,
            **findings_record(result.bench),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each operating point: bench, simulation, standard error, z."""
        return frame_of(self.rows)

    def plot(self) -> go.Figure:
        """Draw bench times beside the simulated ones with their 90 % band, a panel a force."""
        from dogshape.pipeline.reports.charts import times_by_point  # noqa: PLC0415

        sides = {"simulation": ("simulated_s", "standard_error_s"), "bench": ("bench_s", "")}
        return times_by_point(self.to_dict()["points"], sides)


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
        chosen, count = angles, ANGLES if angles is None else angles
    else:
        chosen, count = tuple(angle * DEG for angle in angles), len(angles)
    if count < MIN_ANGLES:
        raise InputError(
            f"--angles is '{angles_text(angles)}', but a comparison needs at least three; give more"
        )
    require_something(bench)
    if engine is not None:
        bench = replace(bench, clutch=bench.clutch.with_engine(engine))
    if angles is None and bench.relative_angles:
        count = len(bench.relative_angles)
    shifts = len(bench.cells) * count
    asked = bench.name, clutch_record(bench.clutch), angles_text(angles)
    propagated = 4 * shifts if bench.errors else 0  # at most: either side of force and mismatch
    with where.executor("validate", asked, shifts + propagated + repeated(shifts)) as running:
        return Comparison(compare(bench, running.executor.run, chosen, checked=True))
