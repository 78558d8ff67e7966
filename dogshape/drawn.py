"""Expected shift time over draws of a study's keys, such as a diagnosis leaves beside its study."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm

from dogshape.expectation import simulate_mean
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.progress import SILENT, Progress, WorkCounter
from dogshape.pipeline.store.result_schema import number_or_none
from dogshape.result import Result, ms
from dogshape.running import Where
from dogshape.sim.errors import DataError, DogshapeError, InputError
from dogshape.sim.statistics.expectation import NO_TIME
from dogshape.sim.texts import TextTable, read_table

if TYPE_CHECKING:
    import pandas as pd

LABELS = ("draw", "hypothesis")  #: columns that are no keys
TAILS = 0.05, 0.95  #: of the interval
LEAST = 3  #: angles at an operating point, of which fewer tell no error
COMMON = norm.ppf((np.arange(50) + 0.5) / 50)  #: deviations of what all draws err by


@dataclass(frozen=True, repr=False)
class DrawnExpectation(Result):
    """Expected shift times of a study, one for each draw of some of its keys.

    Parameters
    ----------
    studies : of each draw.
    times, errors : expected shift time and its standard error, s, (draws,); NaN of a draw in which
        too few shifts engage to have one. All draws have the same relative angles, so they err
        alike, and differences between two designs at the same draws are surer than each.
    """

    studies: tuple[Setup, ...]
    times: np.ndarray
    errors: np.ndarray

    @property
    def engages(self) -> bool:
        """Whether in every draw enough shifts engage for an expected time."""
        return bool(np.isfinite(self.times).all())

    @property
    def interval_s(self) -> tuple[float, float]:
        """Interval that holds 90 % of the draws with what all of them err by, s."""
        low, high = np.quantile(self.times[:, None] + self.error_s * COMMON, TAILS)
        return float(low), float(high)

    @property
    def error_s(self) -> float:
        """Standard error by the angles, which all draws have in common, s."""
        return float(np.sqrt((self.errors**2).mean()))

    @property
    def facts(self) -> dict[str, str]:
        """Mean over the draws, and the interval that holds 90 % of them with their common error."""
        if not self.engages:
            fit = f"in {np.isfinite(self.times).sum()} of {len(self.times)} draws"
            return {"engagement": f"enough shifts engage {fit}: {NO_TIME} of the others"}
        mean, (low, high) = float(self.times.mean()), self.interval_s
        return {
            "expected shift time": f"{ms(mean)} (90 %: {ms(low)} to {ms(high)})",
            "draws": str(len(self.times)),
            "of that by the angles": f"± {ms(self.error_s)}, the same in all draws",
        }

    def to_dict(self) -> dict[str, Any]:
        """Give mean, interval, and the time of each draw."""
        low, high = self.interval_s
        sd = float(self.times.std(ddof=1)) if len(self.times) > 1 else 0.0
        return {
            "engine": self.studies[0].clutch.solver.engine,
            "draws": len(self.times),
            "expected_shift_time_s": number_or_none(float(self.times.mean())),
            "low_s": number_or_none(low),
            "high_s": number_or_none(high),
            "sd_s": number_or_none(sd),
            "standard_error_of_one_s": number_or_none(self.error_s),
            "times_s": [number_or_none(time) for time in self.times.tolist()],
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each draw: time, standard error, mechanism."""
        import pandas as pd  # noqa: PLC0415  # half a second that the command line does not need

        rows = [study.mechanism for study in self.studies]
        times = {"expected_shift_time_s": self.times, "standard_error_s": self.errors}
        return pd.DataFrame(rows).fillna(0.0).assign(**times)


def expect_draws(
    study: str | Path,
    draws: str | Path,
    settings: Mapping[str, Any] | Iterable[str] = (),
    *,
    angles: int | None = None,
    jobs: int = 0,
    progress: Progress = SILENT,
) -> DrawnExpectation:
    """Simulate the expected shift time at each draw of some keys of a study.

    Parameters
    ----------
    study : as for ``Study``.
    draws : table whose columns are keys of the study, a row for each draw (``gap --write``).
    settings : further keys, for instance another dog; those of a draw give way to them.
    angles : relative angles at each operating point, at least 3; None for the study's number.
    jobs : worker processes, 0 for one a core.
    progress : is told how many draws are done.

    Raises
    ------
    InputError, DataError
        For a table, a key or a value that cannot be used, with its row, or too few angles.
    """
    if angles is not None and angles < LEAST:
        raise InputError(
            f"angles is {angles}, but must be at least {LEAST}: of fewer the error is not known, "
            "which all draws have in common"
        )
    table = _table(Path(draws))
    own = settings.items() if isinstance(settings, Mapping) else settings
    more = [one if isinstance(one, str) else f"{one[0]}={one[1]}" for one in own]
    studies = [_study(study, table, row, cells, more) for row, cells in table.rows]
    means = []
    with WorkCounter(progress, len(studies), unit="draws") as counter:
        for one in studies:
            means.append(simulate_mean(one, Where(jobs), angles=angles))
            counter.advance(1)
    times = [math.nan if mean.time_s is None else mean.time_s for mean in means]
    errors = np.array([mean.standard_error_s for mean in means])
    return DrawnExpectation(tuple(mean.config for mean in means), np.array(times), errors)


def _table(path: Path) -> TextTable:
    try:
        table = read_table(path, ())
    except FileNotFoundError as error:
        raise DataError(f"there is no {path}; name a table whose columns are keys") from error
    if not table.rows or set(table.head) <= set(LABELS):
        raise DataError(f"{path} has no draws; give a row for each, columns named like keys")
    return table


def _study(
    study: str | Path, table: TextTable, row: int, cells: tuple[str, ...], more: list[str]
) -> Setup:
    pairs = zip(table.head, cells, strict=True)
    keys = [f"{key}={cell}" for key, cell in pairs if key not in LABELS and cell]
    try:
        return load_study(study, [*keys, *more])
    except DogshapeError as error:
        raise type(error)(f"{table.path}, row {row}: {error}") from error
