"""Predictions for a table of designs by surrogate and closed forms, without simulation.

An impossible design has no time, and a reason.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from dogshape.bench.raw_sheet import file_of
from dogshape.bench.texts import TextTable, is_plain, read_table
from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.schema import OUTPUT_VARIABLES, dotted_key
from dogshape.pipeline.config.study_file import RequestedPoint, Setup, points_of
from dogshape.pipeline.record import Figure, Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.simulate.design import (
    Design,
    DesignGroup,
    design_of,
    limits_of,
)
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.result import Result
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, join_faults, number_rule
from dogshape.sim.files import write_frame
from dogshape.sim.interface import argument, key_argument
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.shift_records import quantity_of
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


class Judgements(NamedTuple):
    """Closed-form checks of designs, an array (n,) for each."""

    real: NDArray[np.bool_]  #: whether the dog is possible
    feasible: NDArray[np.bool_]  #: whether no check fails
    verdict: NDArray[np.object_]  #: texts of ``STATES``
    smallest_margin: Array  #: margin of the worst check; NaN for an impossible dog
    worst_check: NDArray[np.object_]  #: its name; empty for an impossible dog
    reason: NDArray[np.object_]  #: why the design has no time or cannot be made; else empty


class PredictedTimes(NamedTuple):
    """Predicted expected shift times of designs, an array (n,) for each; NaN without a time."""

    time: Array  #: s
    low: Array  #: of the 95 % interval, s
    high: Array  #: of the 95 % interval, s
    error: Array  #: standard error, s
    distance: Array  #: to the nearest simulated design, spacings of these
    in_range: NDArray[np.bool_]  #: whether the design lies within the trained range


class PredictedDesign(NamedTuple):
    """A design of the table with its predicted time."""

    row: int  #: in the table
    variables: dict[str, float]  #: in the units of the study
    time: float  #: s

    def to_dict(self) -> dict[str, Any]:
        """Convert the design to values of JSON."""
        return {"row": self.row, **self.variables, TIME: self.time}


class RowReason(NamedTuple):
    """A row of the table without an answer."""

    row: int
    reason: str


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    ``feasible`` is a design that fails none of these; its verdict is ``not_judged``, since no
    prediction has a landing.

    ``designs`` are the values (n, d) of the ``variables`` in the rows of the ``table``; ``filled``
    are variables without a column, at the study's value. ``written`` is the file of the answers;
    None without one.
    """

    config: Setup
    table: TextTable
    variables: tuple[str, ...]
    designs: Array
    filled: dict[str, float]
    times: PredictedTimes
    checks: Judgements
    written: Path | None = None

    @property
    def rows(self) -> Array:
        """Numbers of the designs in the table, (n,)."""
        return np.array([number for number, _ in self.table.rows])

    @property
    def kept(self) -> list[str]:
        """Columns of the table that are no variable and are copied."""
        return [name for name in self.table.head if name not in self.variables]

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
        best = self._fastest(self.checks.feasible)
        impossible = self.impossible
        written = f"wrote {self.written}: " if self.written else ""
        time = "-"
        commands = []
        if best is not None:
            time = f"{time_text(best.time)}, row {best.row}"
            command = self.command(best.variables)
            if command:
                commands = [f"landing and engagement of row {best.row}: {command}"]
        return [
            *_row_lines(impossible, "is no design", "are no designs"),
            *_row_lines(self.without_time, "has no time", "have no time"),
            f"{written}designs {len(self.rows)}, in the trained range "
            f"{self.times.in_range.sum()}, without a failed check {self.checks.feasible.sum()}, "
            f"impossible {len(impossible)}, least time of one without a failed check {time}",
            f"not judged: {', '.join(check.text for check in self.not_judged)}",
            *commands,
        ]

    def command(self, design: Mapping[str, float]) -> str:
        """Compose the command that simulates a design, with its landing.

        Empty where a variable is of the operation and no key of the dog.
        """
        if set(self.variables) & set(OPERATED):
            return ""
        keys = " ".join(
            f"--set {dotted_key(name)}={design[name]:.10g}"
            for name in self.variables
            if name not in self.filled
        )
        return f"dogshape check {self.config.name} {keys}"

    @property
    def impossible(self) -> list[RowReason]:
        """Rows of designs that no dog can have."""
        return self._reasons(~self.checks.real)

    @property
    def without_time(self) -> list[RowReason]:
        """Rows of possible designs for which the surrogate has no time."""
        return self._reasons(self.checks.real & np.isnan(self.times.time))

    def _reasons(self, selected: NDArray[np.bool_]) -> list[RowReason]:
        rows = self.rows[selected].tolist()
        return [*map(RowReason, rows, self.checks.reason[selected])]

    @property
    def not_judged(self) -> tuple[Missing, ...]:
        """Standard checks that a prediction leaves open, for the study's own dog."""
        dog = self.config.clutch.dog
        limits = self.config.limits
        judged = (check.name for check in strength_checks(dog, limits))
        return missing_checks(dog, limits, judged)

    def to_dict(self) -> dict[str, Any]:
        """Convert counts, rows without an answer, and the best designs to values of JSON."""
        checks = self.checks
        best = self._fastest(checks.real)
        best_feasible = self._fastest(checks.feasible)
        return {
            "file": None if self.written is None else str(self.written),
            "n": len(self.rows),
            "in_range": int(self.times.in_range.sum()),
            "feasible": int(checks.feasible.sum()),
            "verdict": {
                "state": {state: int((checks.verdict == state).sum()) for state in STATES.values()},
                "not_judged": [
                    {"check": check.check, "key": check.key} for check in self.not_judged
                ],
            },
            "impossible": [row._asdict() for row in self.impossible],
            "without_time": [row._asdict() for row in self.without_time],
            "filled": self.filled,
            "kept": self.kept,
            "best": best.to_dict() if best else None,
            "best_feasible": best_feasible.to_dict() if best_feasible else None,
        }

    def _fastest(self, selected: NDArray[np.bool_]) -> PredictedDesign | None:
        """Select the fastest of designs; None if none of them has a time."""
        times = np.where(selected, self.times.time, np.nan)
        if np.isnan(times).all():
            return None
        index = int(np.nanargmin(times))
        variables = dict(zip(self.variables, self.designs[index].tolist(), strict=True))
        return PredictedDesign(int(self.rows[index]), variables, float(times[index]))

    def plot(self) -> Figure:
        """Draw the predicted times with their 95 % intervals, ms, by the rows of the table."""
        from dogshape.pipeline.reports.result_figures import predictions_figure  # noqa: PLC0415

        times = self.times
        timed = ~np.isnan(times.time)
        return predictions_figure(
            self.rows[timed].tolist(),
            times.time[timed].tolist(),
            low=times.low[timed].tolist(),
            high=times.high[timed].tolist(),
            feasible=self.checks.feasible[timed].tolist(),
        )

    def to_frame(self) -> pd.DataFrame:
        """Tabulate designs: variables, predicted time, interval, checks and copied columns.

        ``not_judged`` has the standard checks that a prediction leaves open, landing among them.
        """
        checks = self.checks
        columns = {
            **dict(zip(self.variables, self.designs.T, strict=True)),
            **dict(zip(TIMES, self.times, strict=True)),
            **{name: getattr(checks, name) for name in CHECKS},
            NOT_JUDGED: " ".join(check.check for check in self.not_judged),
        }
        frame = pd.DataFrame(columns, index=pd.Index(self.rows, name="row"))
        for position, name in enumerate(self.kept):
            frame.insert(position, name, self.table.column(name))
        return frame


def _row_lines(rows: Sequence[RowReason], singular: str, plural: str) -> list[str]:
    """List rows without an answer with their reasons, and the number of further ones."""
    lines = [f"row {row} {singular}: {reason}" for row, reason in rows[:MAX_LISTED_ROWS]]
    if len(rows) > MAX_LISTED_ROWS:
        lines.append(f"and {len(rows) - MAX_LISTED_ROWS} more rows {plural}")
    return lines


def predict_designs(
    config: Setup,
    designs: str | Path | pd.DataFrame,
    out: str | Path | None,
    requested: RequestedPoint,
    surrogate: str | Path | None,
) -> Predictions:
    """Predict the shift times of designs as ``Study.predict`` does, for a study that is read."""
    mix = study_mix(config, points_of(config, requested))
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
    holds = (checks.reason == "") & faces_hold(model.data, x)
    checks = checks._replace(reason=np.where(holds, HOLDS, checks.reason))
    predictions = Predictions(
        config,
        table,
        variables=variables,
        designs=x,
        filled={
            name: value
            for name, value in config.prototype.items()
            if name in variables and name not in table.head
        },
        times=_predict_times(model, x, checks.reason == "", mix),
        checks=checks,
        written=target,
    )
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


def _predict_times(
    model: Surrogate, x: Array, predicted: NDArray[np.bool_], mix: Mix
) -> PredictedTimes:
    """Predict times of designs (n, d); NaN and out of range where not ``predicted``, (n,)."""
    times = np.full((len(x), 5), np.nan)
    in_training_range = np.zeros(len(x), dtype=bool)
    if predicted.any():
        time, error = model.predict(x[predicted], mix)
        distance = model.distance(x[predicted])
        low, high = interval(time, error)
        times[predicted] = np.column_stack([time, low, high, error, distance])
        in_training_range[predicted] = in_range(model, x[predicted], mix, distance)
    return PredictedTimes._make((*times.T, in_training_range))


def answer_path(source: Path) -> Path:
    """Name the file of the answers to a table: NAME-times.csv or NAME-times.xlsx beside it."""
    ending = ".csv" if file_of(source) == source and source.suffix != ".xlsx" else ".xlsx"
    return source.with_name(f"{source.stem}-times{ending}")


def judge_designs(study: Setup, names: Sequence[str], x: Array) -> Judgements:
    """Judge designs (n, d) in edge units by every check that needs no simulation."""
    is_possible = np.zeros(len(x), dtype=bool)
    places = []
    parts = []
    with np.errstate(all="ignore"):  # of impossible shapes
        if has_common_limits(study, names):
            is_possible |= DesignGroup.of(study, names, x).possible
        indices = np.flatnonzero(is_possible)
        for start in range(0, len(indices), CHUNK_SIZE):
            chunk = indices[start : start + CHUNK_SIZE]
            places.append(chunk)
            parts.append(_judge_together(study, names, x[chunk]))
    # The dog itself explains why a shape is impossible.
    for place in np.flatnonzero(~is_possible):
        places.append(np.array([place]))
        parts.append(_judge_design(study, dict(zip(names, x[place].tolist(), strict=True))))
    order = np.argsort(np.concatenate(places))
    return Judgements(*(np.concatenate(arrays)[order] for arrays in zip(*parts, strict=True)))


def has_common_limits(study: Setup, names: Sequence[str]) -> bool:
    """Decide whether all designs have the same limits, none of them on the shape."""
    if set(names) & set(OPERATED):
        return False
    return all(objective.simulated for objective, _ in limits_of(study))


def _judge_design(study: Setup, parameters: dict[str, float]) -> Judgements:
    """Judge a design; arrays (1,)."""
    try:
        design = design_of(study, parameters)
    except DogshapeError as error:  # values that no dog can have
        design = Design(study, parameters, None, (), str(error))
    faults = [check.name for check in design.checks if check.name in MAKEABLE and not check.passed]
    margin = math.nan
    worst_check = ""
    if design.checks:
        weakest = smallest_margin(design.checks)
        margin = weakest.margin
        worst_check = weakest.name
    feasible = bool(design.checks) and design.feasible
    return Judgements(
        real=np.array([bool(design.checks)]),
        feasible=np.array([feasible]),
        verdict=np.array([STATES[feasible]], dtype=object),
        smallest_margin=np.array([margin]),
        worst_check=np.array([worst_check], dtype=object),
        reason=np.array([design.refusal or _manufacturing_reason(faults)], dtype=object),
    )


def _manufacturing_reason(checks: Iterable[str]) -> str:
    names = ", ".join(checks).replace("_", " ")
    return f"cannot be made: fails {names}" if names else ""


def _judge_together(study: Setup, names: Sequence[str], x: Array) -> Judgements:
    """Judge possible designs (n, d) by closed forms."""
    group = DesignGroup.of(study, names, x)
    checks = strength_checks(group.dogs, group.study.limits)
    margins = pd.DataFrame({c.name: np.broadcast_to(c.margin, len(x)) for c in checks})
    smallest = margins.min(axis=1)
    passed = smallest >= 0.0
    faults = margins[[name for name in margins if name in MAKEABLE]] < 0.0
    reason = np.full(len(x), "", dtype=object)
    for row in np.flatnonzero(faults.any(axis=1)):
        reason[row] = _manufacturing_reason(faults.columns[faults.iloc[row]])
    return Judgements(
        real=np.ones(len(x), dtype=bool),
        feasible=passed.to_numpy(),
        verdict=passed.map(STATES).to_numpy(dtype=object),
        smallest_margin=smallest.to_numpy(),
        worst_check=margins.idxmin(axis=1).to_numpy(dtype=object),
        reason=reason,
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
        elif name in DogSection.model_fields or name in OUTPUT_VARIABLES:
            setting = key_argument("settings", dotted_key(name), "VALUE")
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

    A variable without a column has the value of the ``prototype``; a dimension of the output dog
    that the study does not search is that of the sliding dog.
    """
    x = np.empty((len(table.rows), len(variables)))
    faults: list[tuple[int, str]] = []
    for column, name in enumerate(variables):
        if name not in table.head:
            x[:, column] = quantity_of(prototype, name)
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
    for column, name in enumerate(variables):
        if name in OUTPUT_VARIABLES and name not in (*table.head, *prototype):
            sliding_name = name.removeprefix(OUTPUT_PREFIX)
            if sliding_name in variables:
                x[:, column] = x[:, variables.index(sliding_name)]
    return x
