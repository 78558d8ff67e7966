"""Many designs without simulation: a table in, the surrogate's answers and closed forms beside it.

A design that cannot be has no time, and a reason.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Place, Setup, points_of
from dogshape.pipeline.record import Result, Table
from dogshape.pipeline.reports.text import time_text
from dogshape.pipeline.simulate.design import Design, design_of, dogs_of, limits_of
from dogshape.pipeline.train.training_rows import stored_surrogate, study_mix
from dogshape.sim.clutch_tables import DogSection
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, number_rule
from dogshape.sim.files import write_frame
from dogshape.sim.raw_sheet import file_of
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.strength.verdict import Missing, missing_checks
from dogshape.sim.texts import TextTable, is_plain, listed, read_table
from dogshape.surrogate.model import interval
from dogshape.surrogate.query import HOLDS, faces_hold, in_range, require_same_physics

CHUNK = 5000  #: designs that are worked out at a time
TIMES = (
    "expected_shift_time_s", "low_s", "high_s", "standard_error_s", "distance", "in_range",
)  # fmt: skip
CHECKS = ("feasible", "verdict", "smallest_margin", "worst_check", "reason")
NOT_JUDGED = "not_judged"  #: column of the answers: standard checks that no prediction judges
STATES = {True: "not_judged", False: "fails"}  #: a prediction judges no landing
NEAR = 0.7  #: likeness of a column's name to a variable's from which it is taken for a misspelling
MAX_LISTED = 10  #: faulty cells that a refusal lists
NAMED = 5  #: rows of a table without an answer that are listed one by one


@dataclass(frozen=True, repr=False)
class Predictions(Result):
    """Predicted shift times of many designs, with their closed-form checks.

    ``feasible`` is a design that fails none of these; its verdict is ``not_judged``, since no
    prediction has a landing.

    ``answers`` has variables, ``TIMES`` and ``verdicts`` by the rows of the ``table``; ``filled``
    are variables without a column, at the study's value. ``written`` is the table with the answers;
    None where none was written.
    """

    config: Setup
    table: TextTable
    filled: dict[str, float]
    answers: pd.DataFrame
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
        best, time, simulated = record["best_feasible"], "-", list[str]()
        if best is not None:
            time = f"{time_text(best['expected_shift_time_s'])}, row {best['row']}"
            if command := self.command(best):
                simulated = [f"landing and engagement of row {best['row']}: {command}"]
        return [
            *lines,
            f"wrote {record['file']}: designs {record['n']}, in the trained range "
            f"{record['in_range']}, without a failed check {record['feasible']}, impossible "
            f"{len(record['impossible'])}, least time of one without a failed check {time}",
            f"not judged: {', '.join(one.text for one in self.not_judged)}",
            *simulated,
        ]

    def command(self, design: Mapping[str, float]) -> str:
        """Compose the command that simulates a design, with its landing.

        Empty where a variable is of the operation and no key of the dog.
        """
        names = list(self.answers)[: list(self.answers).index(TIMES[0])]
        if set(names) & set(OPERATED):
            return ""
        given = [name for name in names if name not in self.filled]
        keys = " ".join(f"--set dog.{name}={design[name]:.10g}" for name in given)
        return f"dogshape check {self.config.name} {keys}"

    @property
    def not_judged(self) -> tuple[Missing, ...]:
        """Standard checks that a prediction leaves open, for the study's own dog."""
        dog, limits = self.config.clutch.dog, self.config.limits
        return missing_checks(dog, limits, (check.name for check in strength_checks(dog, limits)))

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
            "verdict": {
                "state": {
                    state: int((answers["verdict"] == state).sum()) for state in STATES.values()
                },
                "not_judged": [{"check": one.check, "key": one.key} for one in self.not_judged],
            },
            "impossible": reasons(~answers["real"]),
            "without_time": reasons(answers["real"] & time.isna()),
            "filled": self.filled,
            "kept": self.kept,
            "best": best(answers["real"]),
            "best_feasible": best(answers["feasible"]),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each design: its keys, predicted time, interval, checks; kept columns.

        ``not_judged`` has the standard checks that a prediction leaves open, landing among them.
        """
        found = self.answers.drop(columns="real")
        found[NOT_JUDGED] = " ".join(one.check for one in self.not_judged)
        for place, name in enumerate(self.kept):
            found.insert(place, name, self.table.column(name))
        return found


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
    if isinstance(designs, pd.DataFrame):  # whose rows count from 1
        rows = enumerate(designs.itertuples(index=False, name=None), start=1)
        cells = tuple((number, tuple(map(str, row))) for number, row in rows)
        table = TextTable(Path("designs"), tuple(map(str, designs.columns)), cells)
    else:
        if target is not None and target.resolve() == file_of(Path(designs)).resolve():
            raise InputError(f"--out is {target}, the table that is read; name another file")
        try:
            table = read_table(Path(designs), variables)
        except FileNotFoundError:
            missing = f"there is no table of designs at {designs}; check --designs"
            raise InputError(missing) from None
    require_same_physics(model.data, config.physics)
    _require_columns(table, variables)
    if not table.rows:
        raise InputError(f"{table.path} holds no design below its line of names; add some")
    x = _designs(table, variables, config.prototype)
    found = verdicts(config, variables, x)
    found.loc[(found["reason"] == "") & faces_hold(model.data, x), "reason"] = HOLDS
    times, known = np.full((len(x), 5), np.nan), np.zeros(len(x), dtype=bool)
    real = np.asarray(found["reason"] == "", dtype=bool)
    if real.any():
        time, error = model.predict(x[real], mix)
        distance = model.distance(x[real])
        times[real] = np.column_stack([time, *interval(time, error), error, distance])
        known[real] = in_range(model, x[real], mix, distance)
    columns = dict(zip((*variables, *TIMES), (*x.T, *times.T, known), strict=True))
    answers = pd.concat([pd.DataFrame(columns), found], axis=1)
    answers.index = pd.Index([number for number, _ in table.rows], name="row")
    filled = {name: config.prototype[name] for name in variables if name not in table.head}
    made = Predictions(config, table, filled, answers, target)
    if target is not None:
        write_frame(made.to_frame(), target, digits=6)
    return made


def beside(source: Path) -> Path:
    """Give the file of the answers to a table: NAME-times.csv or NAME-times.xlsx beside it."""
    ending = ".csv" if file_of(source) == source and source.suffix != ".xlsx" else ".xlsx"
    return source.with_name(f"{source.stem}-times{ending}")


def verdicts(study: Setup, names: Sequence[str], x: Array) -> pd.DataFrame:
    """Judge designs (n, d) in edge units by every check that needs no simulation.

    A row for each, with ``CHECKS`` and whether there is such a dog, ``real``: NaN and no worst
    check where not. The reason is why there is none, or why it cannot be made.
    """
    alike = np.zeros(len(x), dtype=bool)
    with np.errstate(all="ignore"):  # of shapes that cannot be
        if judged_together(study, names):
            alike |= dogs_of(study, names, x).possible
        places = np.flatnonzero(alike)
        chunks = (places[k : k + CHUNK] for k in range(0, len(places), CHUNK))
        found = [_judge_together(study, names, x[some]).set_index(some) for some in chunks]
    # Why a shape cannot be is said in words by the dog itself.
    single = [_judged(study, dict(zip(names, row, strict=True))) for row in x[~alike].tolist()]
    found.append(pd.DataFrame(single, np.flatnonzero(~alike), ("real", *CHECKS)))
    return pd.concat([one for one in found if len(one)]).sort_index()


def judged_together(study: Setup, names: Sequence[str]) -> bool:
    """Decide whether a study has the same limits for all designs, none on the shape of its own."""
    return not set(names) & set(OPERATED) and all(one.simulated for one, _ in limits_of(study))


def _judged(study: Setup, params: dict[str, float]) -> tuple[bool, bool, str, float, str, str]:
    try:
        design = design_of(study, params)
    except DogshapeError as error:  # values that no dog can have
        design = Design(params, None, (), str(error))
    broken = [check.name for check in design.checks if check.name in MAKEABLE and not check.passed]
    reason = design.refusal or _unmade(broken)
    if not design.checks:
        return False, False, STATES[False], np.nan, "", reason
    weakest = smallest_margin(design.checks)
    verdict = STATES[design.feasible]
    return True, design.feasible, verdict, weakest.margin, weakest.name, reason


def _unmade(broken: Iterable[str]) -> str:
    names = ", ".join(broken).replace("_", " ")
    return f"cannot be made: fails {names}" if names else ""


def _judge_together(study: Setup, names: Sequence[str], x: Array) -> pd.DataFrame:
    checks = strength_checks(dogs_of(study, names, x), study.limits)
    margins = pd.DataFrame({c.name: np.broadcast_to(c.margin, len(x)) for c in checks})
    smallest, broken = margins.min(axis=1), margins[[n for n in margins if n in MAKEABLE]] < 0.0
    reason = np.full(len(x), "", dtype=object)
    for row in np.flatnonzero(broken.any(axis=1)):
        reason[row] = _unmade(broken.columns[broken.iloc[row]])
    passed = smallest >= 0.0
    columns = {"feasible": passed, "verdict": passed.map(STATES), "smallest_margin": smallest}
    worst = margins.idxmin(axis=1)
    return pd.DataFrame({"real": True, **columns, "worst_check": worst, "reason": reason})


def _require_columns(table: TextTable, variables: tuple[str, ...]) -> None:
    """Raise with all columns at once that look like a variable and are none."""
    table.require(())
    faults = []
    for name in table.head:
        near = difflib.get_close_matches(name.lower(), variables, n=1, cutoff=NEAR)
        if name in variables:
            if table.head.count(name) > 1:
                faults.append(f"the column '{name}' is there twice; keep one")
        elif name in (*TIMES, *CHECKS, NOT_JUDGED):
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


def _designs(table: TextTable, variables: tuple[str, ...], own: Mapping[str, float]) -> Array:
    """Return the designs in edge units, (n, d); cells that are no numbers raise."""
    x, faults = np.empty((len(table.rows), len(variables))), list[tuple[int, str]]()
    for place, name in enumerate(variables):
        if name not in table.head:
            x[:, place] = own[name]
            continue
        texts = table.column(name)
        x[:, place] = found = [float(text) if is_plain(text) else np.nan for text in texts]
        wrong = ~np.isfinite(found)
        if name == "count":
            wrong |= np.mod(found, 1.0) != 0.0
        for row in np.flatnonzero(wrong).tolist():
            number, text = table.rows[row][0], texts[row]
            rule = "a whole number" if name == "count" else number_rule(text)
            faults.append((number, f"row {number}, column {name} is '{text}', but it must be "
                           f"{rule}; correct the cell"))  # fmt: skip
    if faults:
        wrong_cells = [fault for _, fault in sorted(faults)]
        left = len(wrong_cells) - MAX_LISTED
        more = [f"and {left} more cells"] if left > 0 else []
        raise InputError(listed(str(table.path), [*wrong_cells[:MAX_LISTED], *more]))
    return x
