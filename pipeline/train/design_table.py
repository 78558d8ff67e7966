"""A table of designs: times by the surrogate, and verdicts of the closed-form checks."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.simulate.design import Design, design_of, limits_of
from dogshape.sim.clutch_tables import DogSection, si_fields
from dogshape.sim.errors import DogshapeError, InputError, number_rule
from dogshape.sim.shift.geometry import Dog, Dogs
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.texts import TextTable, listed, read_table
from dogshape.surrogate.covariance import Array, Mask
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Surrogate, interval
from dogshape.surrogate.query import HOLDS, faces_hold, in_range, require_same_physics

if TYPE_CHECKING:
    import pandas as pd


CHUNK = 5000  #: designs that are worked out at a time


@dataclass(frozen=True)
class Verdicts:
    """Verdicts of the checks on designs, (n,) each.

    Parameters
    ----------
    real : whether there is such a dog.
    feasible : whether it keeps every check before landing.
    margin : the smallest one, NaN where there is no dog.
    worst : the check that has it, empty without one.
    refusal : why there is no dog, or why it cannot be made; empty where it can.
    """

    real: Mask
    feasible: Mask
    margin: Array
    worst: list[str]
    refusal: list[str]


def verdicts(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    """Judge designs (n, d) in edge units by every check that needs no simulation."""
    if not judged_together(study, names):
        return _one_by_one(study, names, x)
    with np.errstate(all="ignore"):  # of shapes that cannot be
        found = [_together(study, names, x[k : k + CHUNK]) for k in range(0, len(x), CHUNK)]
    return Verdicts(
        np.concatenate([one.real for one in found]),
        np.concatenate([one.feasible for one in found]),
        np.concatenate([one.margin for one in found]),
        [name for one in found for name in one.worst],
        [words for one in found for words in one.refusal],
    )


def judged_together(study: Setup, names: Sequence[str]) -> bool:
    """Decide whether a study has the same limits for all designs, none on the shape of its own."""
    return not set(names) & set(OPERATED) and all(one.simulated for one, _ in limits_of(study))


def _one_by_one(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    designs = [_checked(study, dict(zip(names, row, strict=True))) for row in x.tolist()]
    weakest = [smallest_margin(one.checks) if one.checks else None for one in designs]
    return Verdicts(
        np.array([one.dog is not None for one in designs], dtype=bool),
        np.array([one.feasible for one in designs], dtype=bool),
        np.array([np.nan if check is None else check.margin for check in weakest]),
        ["" if check is None else check.name for check in weakest],
        [one.refusal or _unmade(_broken(one)) for one in designs],
    )


def _broken(design: Design) -> list[str]:
    """List the checks that keep a design from being made."""
    return [check.name for check in design.checks if check.name in MAKEABLE and not check.passed]


def _unmade(broken: Sequence[str]) -> str:
    return f"cannot be made: fails {', '.join(broken).replace('_', ' ')}" if broken else ""


def _checked(study: Setup, params: dict[str, float]) -> Design:
    """Return a design with its checks; values that no dog can have are no design either."""
    try:
        return design_of(study, params)
    except DogshapeError as error:
        return Design(params, None, (), str(error))


def _together(study: Setup, names: Sequence[str], x: Array) -> Verdicts:
    real = np.broadcast_to(_dogs(study, names, x).possible, len(x))
    # Why a shape cannot be is said in words by the dog itself.
    other = _one_by_one(study, names, x[~real])
    checks = strength_checks(_dogs(study, names, x[real]), study.limits)
    every = [check.name for check in checks]
    columns = np.column_stack([np.broadcast_to(check.margin, real.sum()) for check in checks])
    least = columns.argmin(axis=1)
    margin = np.full(len(x), np.nan)
    margin[real], margin[~real] = columns[np.arange(len(least)), least], other.margin
    worst, refusal = np.full(len(x), "", dtype=object), np.full(len(x), "", dtype=object)
    worst[real], worst[~real] = [every[place] for place in least], other.worst
    refusal[~real] = other.refusal
    made = [name for name in every if name in MAKEABLE]
    broken = columns[:, [every.index(name) for name in made]] < 0.0
    places = np.flatnonzero(real)
    for row in np.flatnonzero(broken.any(axis=1)).tolist():
        refusal[places[row]] = _unmade([made[k] for k in np.flatnonzero(broken[row])])
    dog = real.copy()
    dog[~real] = other.real
    return Verdicts(dog, dog & (margin >= 0.0), margin, worst.tolist(), refusal.tolist())


def _dogs(study: Setup, names: Sequence[str], x: Array) -> Dogs:
    """Give designs in edge units as dogs, what is not named from the study's dog."""
    shapes = si_fields(dict(zip(names, x.T, strict=True)))
    own = {f.name: getattr(study.clutch.dog, f.name) for f in fields(Dog)}
    return Dogs(**(own | shapes))


TIMES = (
    "expected_shift_time_s", "low_s", "high_s", "standard_error_s", "distance", "in_range",
)  # fmt: skip
CHECKS = ("feasible", "smallest_margin", "worst_check", "reason")
NEAR = 0.7  #: likeness of a column's name to a variable's from which it is taken for a misspelling
MAX_LISTED = 10  #: faulty cells that a refusal lists


@dataclass(frozen=True)
class Predicted:
    """Designs of a table with what is known of each.

    Parameters
    ----------
    table : the text that asks.
    variables : names of the design variables.
    designs : a row of numbers in edge units for each, (n, d).
    filled : variables without a column, at the study's value.
    checked : verdicts of the checks.
    times : expected time, its interval, standard error and distance, (n, 5); NaN for ``reason``.
    known : whether a design lies in the trained range, (n,).
    """

    table: TextTable
    variables: tuple[str, ...]
    designs: Array
    filled: Mapping[str, float]
    checked: Verdicts
    times: Array
    known: Mask
    reason: list[str]

    @property
    def kept(self) -> list[str]:
        """Columns of the table that are none of a variable."""
        return [name for name in self.table.head if name not in self.variables]

    @property
    def numbers(self) -> list[int]:
        """Numbers of the rows in the table."""
        return [number for number, _ in self.table.rows]

    def frame(self) -> pd.DataFrame:
        """Give a row for each design: kept columns, variables, predicted times, checks."""
        import pandas as pd  # noqa: PLC0415  # half a second that a quick answer does not need

        checked = self.checked
        columns: dict[str, Any] = {name: self.table.column(name) for name in self.kept}
        columns |= dict(zip(self.variables, self.designs.T, strict=True))
        columns |= dict(zip(TIMES, (*self.times.T, self.known), strict=True))
        checks = checked.feasible, checked.margin, checked.worst, self.reason
        columns |= dict(zip(CHECKS, checks, strict=True))
        return pd.DataFrame(columns, index=pd.Index(self.numbers, name="row"))

    def write(self, target: Path) -> None:
        """Write the table again with the answers beside it, as CSV."""
        answers = self.frame()[[*TIMES, *CHECKS]]
        for place, name in enumerate(self.table.head):
            answers.insert(place, name, [cells[place] for _, cells in self.table.rows], True)
        answers.to_csv(target, index=False, float_format="%.6g")

    def record(self, target: Path | None) -> dict[str, Any]:
        """Give what was asked and answered, as JSON takes it; it was written to ``target``."""
        real, timed = self.checked.real, np.isfinite(self.times[:, 0])

        def reasons(marked: Mask) -> list[dict[str, Any]]:
            places = np.flatnonzero(marked).tolist()
            return [{"row": self.numbers[k], "reason": self.reason[k]} for k in places]

        def best(among: Mask) -> dict[str, Any] | None:
            if not (among & timed).any():
                return None
            row = int(np.where(among & timed, self.times[:, 0], np.inf).argmin())
            return {
                "row": self.numbers[row],
                **dict(zip(self.variables, self.designs[row].tolist(), strict=True)),
                "expected_shift_time_s": float(self.times[row, 0]),
            }

        return {
            "file": None if target is None else str(target),
            "n": len(real),
            "in_range": int(self.known.sum()),
            "feasible": int(self.checked.feasible.sum()),
            "impossible": reasons(~real),
            "without_time": reasons(real & ~timed),
            "filled": dict(self.filled),
            "kept": self.kept,
            "best": best(real),
            "best_feasible": best(self.checked.feasible),
        }


def predict(study: Setup, surrogate: Surrogate, mix: Mix, table: TextTable) -> Predicted:
    """Predict the designs of a table.

    Variables that the table lacks take the study's value. Other columns are kept. A design that
    cannot be has no time, and a reason.
    """
    require_same_physics(surrogate.data, study.physics)
    variables = surrogate.data.variables
    _require_columns(table, variables)
    if not table.rows:
        raise InputError(f"{table.path} holds no design below its line of names; add some")
    filled = {name: study.prototype[name] for name in variables if name not in table.head}
    x = _designs(table, variables, filled)
    checked, held = verdicts(study, variables, x), faces_hold(surrogate.data, x)
    reason = [why or HOLDS * bool(still) for why, still in zip(checked.refusal, held, strict=True)]
    times, known = np.full((len(x), 5), np.nan), np.zeros(len(x), dtype=bool)
    real = np.array([not why for why in reason], dtype=bool)
    if real.any():
        time, error = surrogate.predict(x[real], mix)
        distance = surrogate.distance(x[real])
        times[real] = np.column_stack([time, *interval(time, error), error, distance])
        known[real] = in_range(surrogate, x[real], mix, distance)
    return Predicted(table, variables, x, filled, checked, times, known, reason)


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
    faults: list[tuple[int, str]] = []
    for place, name in enumerate(variables):
        if name in filled:
            x[:, place] = filled[name]
        else:
            x[:, place] = _numbers(table, name, faults)
    if faults:
        texts = [fault for _, fault in sorted(faults)]
        more = [f"and {len(texts) - MAX_LISTED} more cells"] if len(texts) > MAX_LISTED else []
        raise InputError(listed(str(table.path), [*texts[:MAX_LISTED], *more]))
    return x


def _numbers(table: TextTable, name: str, faults: list[tuple[int, str]]) -> Array:
    """Return the numbers of a column, (n,), and add what is none to the faults, with its row."""
    texts = table.column(name)
    try:
        found = np.array([float(text) for text in texts])
    except ValueError:
        found = np.array([_number(text) for text in texts])
    wrong = ~np.isfinite(found)
    if name == "count":
        wrong |= found % 1.0 != 0.0
    for row in np.flatnonzero(wrong).tolist():
        number, text = table.rows[row][0], texts[row]
        rule = "a whole number" if name == "count" else number_rule(text)
        faults.append((number, f"row {number}, column {name} is '{text}', but it must be "
                       f"{rule}; correct the cell"))  # fmt: skip
    return found


def _number(text: str) -> float:
    """Read a number; NaN where a text is none."""
    try:
        return float(text)
    except ValueError:
        return np.nan
