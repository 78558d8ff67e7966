"""Predictions of the surrogate for a table of designs, as a table."""

from __future__ import annotations

import csv
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import Design, design_of
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.errors import DogshapeError, InputError, number_rule
from dogshape.sim.texts import TextTable, listed, read_table
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import Surrogate, interval
from dogshape.surrogate.query import in_range, require_same_physics

if TYPE_CHECKING:
    import pandas as pd

TIMES = (
    "expected_shift_time_s", "low_s", "high_s", "standard_error_s", "distance", "in_range",
)  # fmt: skip
CHECKS = ("feasible", "smallest_margin", "worst_check", "reason")
NEAR = 0.7  #: likeness of a column's name to a variable's from which it is taken for a misspelling
TOLD = 10  #: faulty cells that a refusal lists


@dataclass(frozen=True)
class Asked:
    """Designs of a table: its text, and a row of numbers in edge units for each, (n, d).

    ``filled`` are variables without a column, at the study's value; ``kept`` are columns that
    are none of a variable.
    """

    table: TextTable
    designs: Array
    filled: Mapping[str, float]
    kept: tuple[str, ...]


@dataclass(frozen=True)
class Answers:
    """Checks of each design, and predicted times where there is such a design.

    ``times`` (n, 5) are NaN where there is none; ``known`` tells which lie in the trained range.
    """

    checked: Sequence[Design]
    times: Array
    known: np.ndarray


@dataclass(frozen=True)
class Predicted:
    """Designs that were asked about, in ``variables``, with what is known of each."""

    variables: tuple[str, ...]
    asked: Asked
    answers: Answers


def predict(study: Setup, surrogate: Surrogate, mix: Mix, table: TextTable) -> Predicted:
    """Predict the designs of a table.

    Variables that the table lacks take the study's value. Other columns are kept. A design that
    cannot be has no time, and a reason.
    """
    require_same_physics(surrogate.data, study.physics)
    variables = surrogate.data.variables
    asked = _asked(study, variables, table)
    return Predicted(variables, asked, _answers(study, surrogate, mix, asked.designs))


def beside(source: Path) -> Path:
    """Give the file of the answers to a table: NAME-times.csv beside it."""
    return source.with_name(f"{source.stem}-times.csv")


def require_another(source: Path, target: Path) -> None:
    """Raise InputError where the answers would overwrite the table."""
    if target.resolve() == source.resolve():
        raise InputError(f"--out is {target}, the table that is read; name another file")


def text_table(designs: str | Path | pd.DataFrame, variables: tuple[str, ...]) -> TextTable:
    """Read designs as a table of text, from a file or a frame, whose rows count from 1."""
    if isinstance(designs, str | Path):
        try:
            return read_table(Path(designs), variables)
        except FileNotFoundError:
            raise InputError(
                f"there is no table of designs at {designs}; check --designs"
            ) from None
    rows = enumerate(designs.itertuples(index=False, name=None), start=1)
    cells = tuple((number, tuple(str(cell) for cell in row)) for number, row in rows)
    return TextTable(Path("designs"), tuple(str(name) for name in designs.columns), cells)


def _asked(study: Setup, variables: tuple[str, ...], table: TextTable) -> Asked:
    _require_columns(table, variables)
    if not table.rows:
        raise InputError(f"{table.path} holds no design below its line of names; add some")
    filled = {name: study.prototype[name] for name in variables if name not in table.head}
    return Asked(
        table,
        _designs(table, variables, filled),
        filled,
        tuple(name for name in table.head if name not in variables),
    )


def _require_columns(table: TextTable, variables: tuple[str, ...]) -> None:
    """Raise with all columns at once that look like a variable and are none."""
    table.require(())
    faults = []
    for name in table.head:
        near = difflib.get_close_matches(name.lower(), variables, n=1, cutoff=NEAR)
        if name in variables:
            if table.head.count(name) > 1:
                faults.append(f"the column '{name}' is there twice; keep one")
        elif name in (*TIMES, *CHECKS):
            faults.append(f"'{name}' is a column of the answers; take it away")
        elif name in DogSection.model_fields:
            faults.append(
                f"'{name}' is the same for all designs that the surrogate knows; take the column "
                f"away (--set dog.{name}=VALUE needs a surrogate of its own)"
            )
        elif near:
            faults.append(
                f"'{name}' is no variable; did you mean '{near[0]}'? (a note needs another name)"
            )
    if not faults and not set(table.head) & set(variables):
        faults.append(f"there is no column of a variable; valid are {', '.join(variables)}")
    if faults:
        raise InputError(listed(f"{table.path}, row 1", dict.fromkeys(faults)))


def _designs(table: TextTable, variables: tuple[str, ...], filled: Mapping[str, float]) -> Array:
    """Return the designs in edge units, (n, d); cells that are no numbers raise."""
    x = np.empty((len(table.rows), len(variables)))
    faults = []
    for place, name in enumerate(variables):
        if name in filled:
            x[:, place] = filled[name]
            continue
        for row, ((number, _), text) in enumerate(zip(table.rows, table.column(name), strict=True)):
            try:
                x[row, place] = float(text)
            except ValueError:
                x[row, place] = np.nan
            whole = name != "count" or x[row, place] % 1.0 == 0.0
            if not (np.isfinite(x[row, place]) and whole):
                rule = "a whole number" if name == "count" else number_rule(text)
                faults.append((number, f"row {number}, column {name} is '{text}', but it must be "
                               f"{rule}; correct the cell"))  # fmt: skip
    if faults:
        told = [fault for _, fault in sorted(faults)]
        more = [f"and {len(told) - TOLD} more cells"] if len(told) > TOLD else []
        raise InputError(listed(str(table.path), [*told[:TOLD], *more]))
    return x


def _checked(study: Setup, params: dict[str, float]) -> Design:
    """Return a design with its checks; values that no dog can have are no design either."""
    try:
        return design_of(study, params)
    except DogshapeError as error:
        return Design(params, None, (), str(error))


def _answers(study: Setup, surrogate: Surrogate, mix: Mix, x: Array) -> Answers:
    names = surrogate.data.variables
    checked = [_checked(study, dict(zip(names, row.tolist(), strict=True))) for row in x]
    real = np.array([design.dog is not None for design in checked])
    times, known = np.full((len(x), 5), np.nan), np.zeros(len(x), dtype=bool)
    if real.any():
        time, error = Over(surrogate, mix).predict(x[real])
        low, high = interval(time, error)
        times[real] = np.column_stack([time, low, high, error, surrogate.distance(x[real])])
        known[real] = in_range(surrogate, x[real], mix)
    return Answers(checked, times, known)


def write_predicted(found: Predicted, target: Path) -> None:
    """Write the table again with the answers beside it, as CSV."""
    table, answers = found.asked.table, found.answers
    with target.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle)
        writer.writerow([*table.head, *TIMES, *CHECKS])
        for (_, cells), design, times, known in zip(
            table.rows, answers.checked, answers.times.tolist(), answers.known.tolist(), strict=True
        ):
            if design.dog is None:
                writer.writerow([*cells, *[""] * len(TIMES), False, "", "", design.refusal])
                continue
            worst = min(design.checks, key=lambda check: check.margin)
            numbers = (f"{number:.6g}" for number in times)
            checked = (design.feasible, f"{worst.margin:.4g}", worst.name, "")
            writer.writerow([*cells, *numbers, known, *checked])


def predicted_rows(found: Predicted) -> list[dict[str, Any]]:
    """List each design with kept columns, variables, predicted times and checks, by name."""
    asked, answers = found.asked, found.answers
    kept = [asked.table.column(name) for name in asked.kept]
    rows = []
    for place, design in enumerate(answers.checked):
        worst = min(design.checks, key=lambda check: check.margin, default=None)
        checks = (
            design.feasible,
            None if worst is None else worst.margin,
            "" if worst is None else worst.name,
            design.refusal,
        )
        rows.append(
            dict(zip(asked.kept, (column[place] for column in kept), strict=True))
            | dict(zip(found.variables, asked.designs[place].tolist(), strict=True))
            | dict(zip(TIMES[:-1], answers.times[place].tolist(), strict=True))
            | {TIMES[-1]: bool(answers.known[place])}
            | dict(zip(CHECKS, checks, strict=True))
        )
    return rows


def predicted_record(found: Predicted, target: Path | None) -> dict[str, Any]:
    """Give what was asked and answered, as JSON takes it; ``target`` is where it was written."""
    variables, asked, answers = found.variables, found.asked, found.answers
    real = np.array([design.dog is not None for design in answers.checked])
    feasible = np.array([design.feasible for design in answers.checked])
    impossible = [
        {"row": number, "reason": design.refusal}
        for (number, _), design in zip(asked.table.rows, answers.checked, strict=True)
        if design.dog is None
    ]

    def best(among: np.ndarray) -> dict[str, Any] | None:
        if not among.any():
            return None
        row = int(np.where(among, answers.times[:, 0], np.inf).argmin())
        return {
            "row": asked.table.rows[row][0],
            **dict(zip(variables, asked.designs[row].tolist(), strict=True)),
            "expected_shift_time_s": float(answers.times[row, 0]),
        }

    return {
        "file": None if target is None else str(target),
        "n": len(answers.checked),
        "in_range": int(answers.known.sum()),
        "feasible": int(feasible.sum()),
        "impossible": impossible,
        "filled": dict(asked.filled),
        "kept": list(asked.kept),
        "best": best(real),
        "best_feasible": best(feasible),
    }
