"""Predictions for a table of designs by surrogate and closed forms, without simulation.

An impossible design has no time, and a reason.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dogshape.bench.raw_sheet import file_of
from dogshape.bench.texts import TextTable, is_plain, read_table
from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Place, Setup, points_of
from dogshape.pipeline.record import Figure, Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.simulate.design import Design, design_of, dogs_of, limits_of
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.result import Result
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, join_faults, number_rule
from dogshape.sim.files import write_frame
from dogshape.sim.interface import argument, key_argument
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.strength.verdict import Missing, missing_checks
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Surrogate, interval
from dogshape.surrogate.query import HOLDS, faces_hold, in_range, require_same_physics

CHUNK_SIZE = 5000  #: designs whose checks are computed together
TIME = "expected_shift_time_s"
TIMES = (
    TIME,
    "low_s",
    "high_s",
    "standard_error_s",
    "distance",
    "in_range",
)
CHECKS = ("feasible", "verdict", "smallest_margin", "worst_check", "reason")
NOT_JUDGED = "not_judged"  #: column of the answers: standard checks that no prediction judges
#: Verdict by whether every judged check passes; a prediction judges no landing.
STATES = {True: "not_judged", False: "fails"}
MIN_NAME_LIKENESS = 0.7  #: ``difflib`` ratio of a column to a variable, for a misspelling
MAX_LISTED_CELLS = 10  #: faulty cells in an error message
MAX_LISTED_ROWS = 5  #: rows without an answer in the printed result


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    ``feasible`` is a design that fails none of these; its verdict is ``not_judged``, since no
    prediction has a landing.

    ``answers`` has variables, times and checks by the rows of the ``table``; ``filled`` are
    variables without a column, at the study's value. ``written`` is the file of the answers; None
    without one.
    """

    config: Setup
    table: TextTable
    filled: dict[str, float]
    answers: pd.DataFrame
    written: Path | None = None

    @property
    def kept(self) -> list[str]:
        """Columns of the table that are no variable and are copied."""
        return [name for name in self.table.head if name == "real" or name not in self.answers]

    @property
    def notes(self) -> list[str]:
        """Sentences on columns filled by the study and on copied columns."""
        notes = []
        if self.filled:
            values = ", ".join(f"{name} = {value:.6g}" for name, value in self.filled.items())
            notes.append(f"the table has no column for, and the study gives, {values}")
        if self.kept:
            copied_columns = ", ".join(self.kept)
            notes.append(f"columns copied, and no part of the question: {copied_columns}")
        return notes

    def to_parts(self) -> list[str | Table]:
        """Describe rows without an answer, counts and the best design."""
        record = self.to_dict()
        best = record["best_feasible"]
        time = "-"
        commands = []
        if best is not None:
            time = f"{time_text(best[TIME])}, row {best['row']}"
            command = self.command(best)
            if command:
                commands = [f"landing and engagement of row {best['row']}: {command}"]
        return [
            *_row_lines(record["impossible"], "is no design", "are no designs"),
            *_row_lines(record["without_time"], "has no time", "have no time"),
            f"wrote {record['file']}: designs {record['n']}, in the trained range "
            f"{record['in_range']}, without a failed check {record['feasible']}, impossible "
            f"{len(record['impossible'])}, least time of one without a failed check {time}",
            f"not judged: {', '.join(check.text for check in self.not_judged)}",
            *commands,
        ]

    def command(self, design: Mapping[str, float]) -> str:
        """Compose the command that simulates a design, with its landing.

        Empty where a variable is of the operation and no key of the dog.
        """
        variables = self._variables
        if set(variables) & set(OPERATED):
            return ""
        keys = " ".join(
            f"--set dog.{name}={design[name]:.10g}" for name in variables if name not in self.filled
        )
        return f"dogshape check {self.config.name} {keys}"

    @property
    def _variables(self) -> list[str]:
        columns = list(self.answers)
        return columns[: columns.index(TIME)]

    @property
    def not_judged(self) -> tuple[Missing, ...]:
        """Standard checks that a prediction leaves open, for the study's own dog."""
        dog = self.config.clutch.dog
        limits = self.config.limits
        judged = (check.name for check in strength_checks(dog, limits))
        return missing_checks(dog, limits, judged)

    def to_dict(self) -> dict[str, Any]:
        """Convert counts, rows without an answer, and the best designs to values of JSON."""
        answers = self.answers
        real = answers["real"]
        verdicts = answers["verdict"]
        return {
            "file": None if self.written is None else str(self.written),
            "n": len(answers),
            "in_range": int(answers["in_range"].sum()),
            "feasible": int(answers["feasible"].sum()),
            "verdict": {
                "state": {state: int((verdicts == state).sum()) for state in STATES.values()},
                "not_judged": [
                    {"check": check.check, "key": check.key} for check in self.not_judged
                ],
            },
            "impossible": _reasons(answers[~real]),
            "without_time": _reasons(answers[real & answers[TIME].isna()]),
            "filled": self.filled,
            "kept": self.kept,
            "best": self._fastest(answers[real]),
            "best_feasible": self._fastest(answers[answers["feasible"]]),
        }

    def _fastest(self, answers: pd.DataFrame) -> dict[str, Any] | None:
        """Select row, variables and time of the fastest design; None without a time."""
        times = answers[TIME].dropna()
        if times.empty:
            return None
        row = times.idxmin()
        values = answers.loc[row, [*self._variables, TIME]].astype(float)
        return {"row": int(row), **values.to_dict()}

    def plot(self) -> Figure:
        """Draw the predicted times with their 95 % intervals, ms, by the rows of the table."""
        from dogshape.pipeline.reports.result_figures import predictions_figure  # noqa: PLC0415

        answers = self.answers.dropna(subset=[TIME])
        return predictions_figure(
            answers.index.tolist(),
            answers[TIME].tolist(),
            low=answers["low_s"].tolist(),
            high=answers["high_s"].tolist(),
            feasible=answers["feasible"].tolist(),
        )

    def to_frame(self) -> pd.DataFrame:
        """Tabulate designs: variables, predicted time, interval, checks and copied columns.

        ``not_judged`` has the standard checks that a prediction leaves open, landing among them.
        """
        frame = self.answers.drop(columns="real")
        frame[NOT_JUDGED] = " ".join(check.check for check in self.not_judged)
        for position, name in enumerate(self.kept):
            frame.insert(position, name, self.table.column(name))
        return frame


def _reasons(answers: pd.DataFrame) -> list[dict[str, Any]]:
    return [{"row": row, "reason": reason} for row, reason in answers["reason"].items()]


def _row_lines(rows: Sequence[Mapping[str, Any]], singular: str, plural: str) -> list[str]:
    """List rows without an answer with their reasons, and the number of further ones."""
    lines = [f"row {row['row']} {singular}: {row['reason']}" for row in rows[:MAX_LISTED_ROWS]]
    if len(rows) > MAX_LISTED_ROWS:
        lines.append(f"and {len(rows) - MAX_LISTED_ROWS} more rows {plural}")
    return lines


def predict_designs(
    config: Setup,
    designs: str | Path | pd.DataFrame,
    out: str | Path | None,
    place: Place,
    surrogate: str | Path | None,
) -> Predictions:
    """Predict the shift times of designs as ``Study.predict`` does, for a study that is read."""
    mix = study_mix(config, points_of(config, place))
    model = stored_surrogate(config, surrogate)[0].surrogate
    target = None if out is None else Path(out)
    variables = model.data.variables
    table = _read_designs(designs, target, variables)
    require_same_physics(model.data, config.physics)
    _require_columns(table, variables)
    if not table.rows:
        raise InputError(f"{table.path} holds no design below its line of names; add some")
    x = _design_values(table, variables, config.prototype)
    checks = judge_designs(config, variables, x)
    checks.loc[(checks["reason"] == "") & faces_hold(model.data, x), "reason"] = HOLDS
    predicted = np.asarray(checks["reason"] == "", dtype=bool)
    times = _predicted_times(model, x, predicted, mix)
    columns = dict(zip(variables, x.T, strict=True))
    answers = pd.concat([pd.DataFrame(columns), times, checks], axis=1)
    answers.index = pd.Index([number for number, _ in table.rows], name="row")
    filled = {name: config.prototype[name] for name in variables if name not in table.head}
    predictions = Predictions(config, table, filled, answers, target)
    if target is not None:
        write_frame(predictions.to_frame(), target, digits=6)
    return predictions


def _read_designs(
    designs: str | Path | pd.DataFrame, target: Path | None, variables: tuple[str, ...]
) -> TextTable:
    """Read a frame or a file as texts; InputError for a missing file, or the ``target`` itself."""
    if isinstance(designs, pd.DataFrame):  # whose rows count from 1
        rows = enumerate(designs.itertuples(index=False, name=None), start=1)
        cells = tuple((number, tuple(map(str, row))) for number, row in rows)
        return TextTable(Path("designs"), tuple(map(str, designs.columns)), cells)
    if target is not None and target.resolve() == file_of(Path(designs)).resolve():
        fault = f"{argument('out')} is {target}, the table that is read"
        raise InputError(f"{fault}; name another file")
    try:
        return read_table(Path(designs), variables)
    except FileNotFoundError:
        missing = f"there is no table of designs at {designs}; check {argument('designs')}"
        raise InputError(missing) from None


def _predicted_times(model: Surrogate, x: Array, predicted: Array, mix: Mix) -> pd.DataFrame:
    """Predict the ``TIMES`` of designs, (n, 6); NaN and out of range where not ``predicted``."""
    times = np.full((len(x), 5), np.nan)
    in_training_range = np.zeros(len(x), dtype=bool)
    if predicted.any():
        time, error = model.predict(x[predicted], mix)
        distance = model.distance(x[predicted])
        low, high = interval(time, error)
        times[predicted] = np.column_stack([time, low, high, error, distance])
        in_training_range[predicted] = in_range(model, x[predicted], mix, distance)
    return pd.DataFrame(dict(zip(TIMES, (*times.T, in_training_range), strict=True)))


def answer_path(source: Path) -> Path:
    """Name the file of the answers to a table: NAME-times.csv or NAME-times.xlsx beside it."""
    ending = ".csv" if file_of(source) == source and source.suffix != ".xlsx" else ".xlsx"
    return source.with_name(f"{source.stem}-times{ending}")


def judge_designs(study: Setup, names: Sequence[str], x: Array) -> pd.DataFrame:
    """Judge designs (n, d) in edge units by every check that needs no simulation.

    A row for each, with ``CHECKS`` and ``real``, whether the dog is possible; else the margin is
    NaN and the worst check empty. ``reason`` says why a dog is impossible or cannot be made.
    """
    is_possible = np.zeros(len(x), dtype=bool)
    frames = []
    with np.errstate(all="ignore"):  # of impossible shapes
        if has_common_limits(study, names):
            is_possible |= dogs_of(study, names, x).possible
        indices = np.flatnonzero(is_possible)
        for start in range(0, len(indices), CHUNK_SIZE):
            chunk = indices[start : start + CHUNK_SIZE]
            frames.append(_judge_together(study, names, x[chunk]).set_index(chunk))
    # The dog itself explains why a shape is impossible.
    single = [
        _judge_design(study, dict(zip(names, row, strict=True))) for row in x[~is_possible].tolist()
    ]
    frames.append(pd.DataFrame(single, np.flatnonzero(~is_possible), ("real", *CHECKS)))
    return pd.concat([frame for frame in frames if len(frame)]).sort_index()


def has_common_limits(study: Setup, names: Sequence[str]) -> bool:
    """Decide whether all designs have the same limits, none of them on the shape."""
    if set(names) & set(OPERATED):
        return False
    return all(objective.simulated for objective, _ in limits_of(study))


def _judge_design(
    study: Setup, parameters: dict[str, float]
) -> tuple[bool, bool, str, float, str, str]:
    """Judge a design; ``real`` and the ``CHECKS``."""
    try:
        design = design_of(study, parameters)
    except DogshapeError as error:  # values that no dog can have
        design = Design(study, parameters, None, (), str(error))
    faults = [check.name for check in design.checks if check.name in MAKEABLE and not check.passed]
    reason = design.refusal or _manufacturing_reason(faults)
    if not design.checks:
        return False, False, STATES[False], np.nan, "", reason
    weakest = smallest_margin(design.checks)
    verdict = STATES[design.feasible]
    return True, design.feasible, verdict, weakest.margin, weakest.name, reason


def _manufacturing_reason(checks: Iterable[str]) -> str:
    names = ", ".join(checks).replace("_", " ")
    return f"cannot be made: fails {names}" if names else ""


def _judge_together(study: Setup, names: Sequence[str], x: Array) -> pd.DataFrame:
    """Judge possible designs by closed forms; ``real`` and the ``CHECKS``, a row each."""
    checks = strength_checks(dogs_of(study, names, x), study.limits)
    margins = pd.DataFrame({c.name: np.broadcast_to(c.margin, len(x)) for c in checks})
    smallest = margins.min(axis=1)
    passed = smallest >= 0.0
    faults = margins[[name for name in margins if name in MAKEABLE]] < 0.0
    reason = np.full(len(x), "", dtype=object)
    for row in np.flatnonzero(faults.any(axis=1)):
        reason[row] = _manufacturing_reason(faults.columns[faults.iloc[row]])
    return pd.DataFrame(
        {
            "real": True,
            "feasible": passed,
            "verdict": passed.map(STATES),
            "smallest_margin": smallest,
            "worst_check": margins.idxmin(axis=1),
            "reason": reason,
        }
    )


def _require_columns(table: TextTable, variables: tuple[str, ...]) -> None:
    """Raise InputError that lists all columns which are no variable but resemble one."""
    table.require(())
    faults = []
    for name in table.head:
        similar = difflib.get_close_matches(name.lower(), variables, n=1, cutoff=MIN_NAME_LIKENESS)
        if name in variables:
            if table.head.count(name) > 1:
                faults.append(f"the column '{name}' is there twice; keep one")
        elif name in (*TIMES, *CHECKS, NOT_JUDGED):
            faults.append(f"'{name}' is a column of the answers; take it away")
        elif name in DogSection.model_fields:
            setting = key_argument("settings", f"dog.{name}", "VALUE")
            faults.append(
                f"'{name}' is the same for all designs that the surrogate knows; take the column "
                f"away ({setting} needs a surrogate of its own)"
            )
        elif similar:
            faults.append(
                f"'{name}' is no variable; did you mean '{similar[0]}'? (a note needs another name)"
            )
    if not faults and not set(table.head) & set(variables):
        faults.append(f"there is no column of a variable; valid are {', '.join(variables)}")
    if faults:
        raise InputError(join_faults(f"{table.path}, row 1", dict.fromkeys(faults)))


def _design_values(
    table: TextTable, variables: tuple[str, ...], prototype: Mapping[str, float]
) -> Array:
    """Convert designs to numbers in edge units, (n, d); InputError for cells without a number.

    A variable without a column has the value of the ``prototype``.
    """
    x = np.empty((len(table.rows), len(variables)))
    faults: list[tuple[int, str]] = []
    for column, name in enumerate(variables):
        if name not in table.head:
            x[:, column] = prototype[name]
            continue
        texts = table.column(name)
        values = np.array([float(text) if is_plain(text) else np.nan for text in texts])
        x[:, column] = values
        is_faulty = ~np.isfinite(values)
        if name == "count":
            is_faulty |= np.mod(values, 1.0) != 0.0
        for row in np.flatnonzero(is_faulty).tolist():
            number = table.rows[row][0]
            text = texts[row]
            rule = "a whole number" if name == "count" else number_rule(text)
            fault = (
                f"row {number}, column {name} is '{text}', but it must be {rule}; correct the cell"
            )
            faults.append((number, fault))
    if faults:
        messages = [fault for _, fault in sorted(faults)]
        listed_messages = messages[:MAX_LISTED_CELLS]
        if len(messages) > MAX_LISTED_CELLS:
            listed_messages.append(f"and {len(messages) - MAX_LISTED_CELLS} more cells")
        raise InputError(join_faults(str(table.path), listed_messages))
    return x
