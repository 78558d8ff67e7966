"""A bench data set as a problem: what a stand or another simulator delivers about a clutch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.diagnosis.bench.bench_data import Bench as BenchData
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    import pandas as pd

    from dogshape.comparison import Comparison
    from dogshape.diagnosis.bench.bench_data import Reading
    from dogshape.gap import Diagnosis


def _series(reading: Reading) -> dict[str, float]:
    """Return spread and place in the series of a row, as far as it has them."""
    known = {"shift_time_sd_s": reading.sd, "place": reading.place}
    return {name: value for name, value in known.items() if value is not None}


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

        rows = [
            {
                "mismatch_rpm": reading.point.mismatch / RPM,
                "force_N": reading.point.profile.force,
                "force_rise_s": reading.point.profile.rise,
                "n_shifts": reading.n,
                "shift_time_s": reading.time,
                "engaged": reading.engaged,
                "trace": None if reading.trace is None else str(reading.trace.path),
                **_series(reading),
            }
            for reading in self.data.readings
        ]
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
        """Simulate the operating points (``dogshape.comparison.simulate_bench``).

        ``keep`` is a folder in which a run that was stopped leaves its finished shifts.
        """
        from dogshape.comparison import simulate_bench  # noqa: PLC0415
        from dogshape.running import Where  # noqa: PLC0415

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
        return f"Bench({', '.join([f'{data.name}: {counts}', *map(str, data.corrections)])})"

    def _repr_html_(self) -> str:
        return f"<code>{escape(repr(self))}</code>"
