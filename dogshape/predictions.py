"""Many designs without simulation: a table in, the surrogate's answers beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.record import Frame, Result, Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.train.design_table import Predicted, predict, require_another, text_table
from dogshape.pipeline.train.training_rows import mix_over, stored_surrogate
from dogshape.sim.files import write_frame

NAMED = 5  #: rows of a table without an answer that are listed one by one


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    ``written`` is the table with the answers; None where none was written.
    """

    config: Setup
    predicted: Predicted
    written: Path | None = None

    @property
    def notes(self) -> list[str]:
        """Columns that the study filled in, and those only copied."""
        given = self.predicted.filled.items()
        filled = ", ".join(f"{name} = {value:.6g}" for name, value in given)
        kept = ", ".join(self.predicted.kept)
        return [
            *([f"the table has no column for, and the study gives, {filled}"] if filled else []),
            *([f"columns copied, and no part of the question: {kept}"] if kept else []),
        ]

    def to_parts(self) -> list[str | Table]:
        """Give rows without an answer, counts, and the best design."""
        record, lines = self.to_dict(), list[str]()
        for words, more, key in (
            ("is no design", "are no designs", "impossible"),
            ("has no time", "have no time", "without_time"),
        ):
            rows = record[key]
            lines += [f"row {one['row']} {words}: {one['reason']}" for one in rows[:NAMED]]
            left = len(rows) - NAMED
            lines += [f"and {left} more rows {more}"] if left > 0 else []
        best, time = record["best_feasible"], "-"
        if best is not None:
            time = f"{time_text(best['expected_shift_time_s'])}, row {best['row']}"
        return [
            *lines,
            f"wrote {record['file']}: designs {record['n']}, in the trained range "
            f"{record['in_range']}, feasible before landing {record['feasible']}, impossible "
            f"{len(record['impossible'])}, least time of a feasible one {time}",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give counts, impossible rows with their reasons, and the best designs."""
        return self.predicted.record(self.written)

    def to_frame(self) -> Frame:
        """Give a row for each design: its keys, predicted time, interval, checks; kept columns."""
        return self.predicted.frame()


def predict_designs(
    config: Setup,
    designs: str | Path | Frame,
    out: str | Path | None,
    place: tuple[float | None, float | None],
    surrogate: str | Path | None,
) -> Predictions:
    """Predict the shift times of designs as ``Study.predict`` does, for a study that is read."""
    mix = mix_over(config, points_of(config, *place))
    stored, _ = stored_surrogate(config, None if surrogate is None else Path(surrogate))
    target = None if out is None else Path(out)
    if target is not None and isinstance(designs, str | Path):
        require_another(Path(designs), target)
    table = text_table(designs, stored.surrogate.data.variables)
    found = Predictions(config, predict(config, stored.surrogate, mix, table), target)
    if target is not None:
        write_frame(found.to_frame(), target, digits=6)
    return found
