"""Many designs without simulation: a table in, the surrogate's answers beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, points_of
from dogshape.pipeline.record import Frame, Result, Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.train.design_table import TIMES, predict, text_table
from dogshape.pipeline.train.training_rows import mix_over, stored_surrogate
from dogshape.sim.errors import InputError
from dogshape.sim.files import write_frame
from dogshape.sim.texts import TextTable, file_of

NAMED = 5  #: rows of a table without an answer that are listed one by one


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    ``answers`` has the columns of ``design_table.predict`` by the rows of the ``table``;
    ``filled`` are variables without a column, at the study's value. ``written`` is the table with
    the answers; None where none was written.
    """

    config: Setup
    table: TextTable
    filled: dict[str, float]
    answers: Frame
    written: Path | None = None

    @property
    def kept(self) -> list[str]:
        """Columns of the table that are none of a variable."""
        return [name for name in self.table.head if name == "real" or name not in self.answers]

    @property
    def notes(self) -> list[str]:
        """Columns that the study filled in, and those only copied."""
        filled = ", ".join(f"{name} = {value:.6g}" for name, value in self.filled.items())
        kept = ", ".join(self.kept)
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
        answers, time = self.answers, self.answers[TIMES[0]]
        names = list(answers)[: list(answers).index(TIMES[0])]

        def reasons(marked: Any) -> list[dict[str, Any]]:
            return [{"row": row, "reason": why} for row, why in answers["reason"][marked].items()]

        def best(marked: Any) -> dict[str, Any] | None:
            if (known := time[marked].dropna()).empty:
                return None
            row = known.idxmin()
            return {"row": int(row), **answers.loc[row, [*names, TIMES[0]]].astype(float).to_dict()}

        return {
            "file": None if self.written is None else str(self.written),
            "n": len(answers),
            "in_range": int(answers["in_range"].sum()),
            "feasible": int(answers["feasible"].sum()),
            "impossible": reasons(~answers["real"]),
            "without_time": reasons(answers["real"] & time.isna()),
            "filled": self.filled,
            "kept": self.kept,
            "best": best(answers["real"]),
            "best_feasible": best(answers["feasible"]),
        }

    def to_frame(self) -> Frame:
        """Give a row for each design: its keys, predicted time, interval, checks; kept columns."""
        found = self.answers.drop(columns="real")
        for place, name in enumerate(self.kept):
            found.insert(place, name, self.table.column(name))
        return found


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
    source = file_of(Path(designs)).resolve() if isinstance(designs, str | Path) else None
    if target is not None and target.resolve() == source:
        raise InputError(f"--out is {target}, the table that is read; name another file")
    variables = stored.surrogate.data.variables
    table = text_table(designs, variables)
    answers = predict(config, stored.surrogate, mix, table)
    filled = {name: config.prototype[name] for name in variables if name not in table.head}
    found = Predictions(config, table, filled, answers, target)
    if target is not None:
        write_frame(found.to_frame(), target, digits=6)
    return found
