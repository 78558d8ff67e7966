"""Many designs without simulation: a table in, the surrogate's answers beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.record import Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.train.design_table import (
    Predicted,
    predict,
    require_another,
    text_table,
)
from dogshape.pipeline.train.training_rows import mix_over, stored_surrogate
from dogshape.result import Result

if TYPE_CHECKING:
    import pandas as pd


NAMED = 5  #: rows of a table without an answer that are listed one by one


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    Parameters
    ----------
    config : the study that was asked.
    predicted : the designs with what is known of each.
    written : table with the answers; None where none was written.
    """

    config: Setup
    predicted: Predicted
    written: Path | None = None

    @property
    def facts(self) -> dict[str, str]:
        """Numbers of designs in range, feasible and impossible; the best design."""
        record = self.to_dict()
        best = record["best_feasible"]
        return {
            "designs": str(record["n"]),
            "in the trained range": str(record["in_range"]),
            "feasible before landing": str(record["feasible"]),
            "impossible": str(len(record["impossible"])),
            "least time of a feasible one": "-"
            if best is None else f"{time_text(best['expected_shift_time_s'])}, row {best['row']}",
        }  # fmt: skip

    @property
    def notes(self) -> list[str]:
        """Columns that the study filled in, and those only copied."""
        record = self.to_dict()
        filled = ", ".join(f"{name} = {value:.6g}" for name, value in record["filled"].items())
        lines = [f"the table has no column for, and the study gives, {filled}"] if filled else []
        kept = ", ".join(record["kept"])
        return lines + ([f"columns copied, and no part of the question: {kept}"] if kept else [])

    @property
    def parts(self) -> list[str | Table]:
        """Rows without an answer, and the counts."""
        record, lines = self.to_dict(), list[str]()
        for words, more, key in (
            ("is no design", "are no designs", "impossible"),
            ("has no time", "have no time", "without_time"),
        ):
            rows = record[key]
            lines += [f"row {one['row']} {words}: {one['reason']}" for one in rows[:NAMED]]
            left = len(rows) - NAMED
            lines += [f"and {left} more rows {more}"] if left > 0 else []
        facts = ", ".join(f"{name} {value}" for name, value in self.facts.items())
        return [*lines, f"wrote {record['file']}: {facts}"]

    def to_dict(self) -> dict[str, Any]:
        """Give counts, impossible rows with their reasons, and the best designs."""
        return self.predicted.record(self.written)

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each design: its keys, predicted time, interval, checks; kept columns."""
        return self.predicted.frame()


def predict_designs(
    config: Setup,
    designs: str | Path | pd.DataFrame,
    out: Path | None = None,
    *,
    mismatch_rpm: float | None = None,
    force_N: float | None = None,
    surrogate: Path | None = None,
) -> Predictions:
    """Predict the shift times of many designs without simulating them.

    Parameters
    ----------
    designs : CSV file or frame, a row each, columns named as the study's variables; what is
        missing takes the study's value, other columns are kept.
    out : CSV file for the answers; None writes none.
    mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
    surrogate : its file; None for that of the study's results, or the package's.

    Raises
    ------
    InputError, DataError
        For columns and cells that cannot be read, with row, column and remedy.
    """
    mix = mix_over(config, points_of(config, mismatch_rpm, force_N))
    stored, _ = stored_surrogate(config, surrogate)
    if out is not None and isinstance(designs, str | Path):
        require_another(Path(designs), out)
    table = text_table(designs, stored.surrogate.data.variables)
    found = Predictions(config, predict(config, stored.surrogate, mix, table), out)
    if out is not None:
        found.predicted.write(out)
    return found
