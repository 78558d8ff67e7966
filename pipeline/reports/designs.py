"""Designs and objectives of a study's result, as frames, tables and figures name them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dogshape.pipeline.record import Frame, frame_of, percent
from dogshape.pipeline.reports.text import check_name, minus, with_error
from dogshape.pipeline.search.study_record import (
    ConfirmedDesign,
    DesignRow,
    ObjectiveEstimate,
    StudyRecord,
)
from dogshape.pipeline.simulate.design import OBJECTIVES, SUMMARIES, Objective
from dogshape.pipeline.store.check_records import CheckRow, VerdictRow
from dogshape.sim.statistics.expectation import Estimate, positive_interval
from dogshape.sim.statistics.hangs import interval
from dogshape.sim.strength.verdict import WORDS, Margin, judge
from dogshape.surrogate.model import NORMAL_95

MARGIN = "smallest_margin"
QUANTILE_TIME = "shift_time_quantile_s"
FIRST_TRY = "first_try_share"
#: Printed units that differ from the stored ones, by objective.
PRINTED_UNITS = {
    "peak_impact_force_N": "kN",
    "peak_axial_force_N": "kN",
    MARGIN: "%",
    FIRST_TRY: "%",
    "smallest_margin_worst": "%",
    "smallest_margin_statistical": "%",
}
UNIT_FACTORS = {"ms": 1e3, "%": 100.0, "kN": 1e-3}  #: printed value over the stored one
#: Kinds of designs; the own dog is the ``prototype`` of files.
OWN_DOG = "own dog"
FAILS = "fails when simulated"
UNCLEAR = WORDS["not_clear"]


@dataclass(frozen=True)
class Goal(Objective):
    """An objective of a study with its printed ``label`` and ``unit``."""

    @property
    def factor(self) -> float:
        """Printed value over the stored one."""
        return UNIT_FACTORS.get(self.unit, 1.0)

    @property
    def title(self) -> str:
        """Label and unit for a column or an axis; of a maximised objective with its sense."""
        title = f"{self.label}, {self.unit}" if self.unit else self.label
        return f"{title} (more is better)" if self.maximise else title

    def printed_value(self, design: DesignRow) -> float:
        """Return the value of a design that has one, in the printed unit."""
        value = design.value(self.name)
        assert value is not None
        return self.factor * value

    def error(self, design: DesignRow) -> float:
        """Return the standard error of a design, printed unit; zero for an exact objective."""
        return self.factor * (design.standard_errors.get(self.name) or 0.0)

    def estimate(self, estimates: Mapping[str, ObjectiveEstimate]) -> tuple[float, float]:
        """Return value and standard error of an estimate or a gain, in the printed unit."""
        estimate = estimates[self.name]
        return self.factor * estimate.value, self.factor * estimate.standard_error

    def ends(self, value: float, error: float) -> tuple[float, float]:
        """Compute the 95 % interval of a value in the printed unit; of a share by posterior.

        That of a quantity without negative values is positive.
        """
        if self.name != FIRST_TRY or not error:
            if self.low == 0.0:
                return positive_interval(Estimate(value, error))
            return value - NORMAL_95 * error, value + NORMAL_95 * error
        low, high = interval(value / self.factor, (error / self.factor) ** 2)
        return self.factor * low, self.factor * high

    def pair(self, value: float, error: float = 0.0) -> str:
        """Print a value with its standard error, without the unit; both in the printed unit.

        A share has its 95 % interval instead, as its error is not symmetric.
        """
        if self.name == FIRST_TRY and error:
            low, high = self.ends(value, error)
            return f"{value:.4g} (95 %: {low:.4g} to {high:.4g})"
        return self.difference(value, error)

    def difference(self, value: float, error: float = 0.0) -> str:
        """Print a difference of two values with its standard error, without the unit."""
        if self.unit in UNIT_FACTORS:
            return with_error(value, error) if error else minus(f"{value:.1f}")
        suffix = f" ± {error:.2g}" if error else ""
        return minus(f"{value:.4g}{suffix}")

    def words(self, value: float, error: float = 0.0) -> str:
        """Print a value with standard error and unit."""
        return f"{self.pair(value, error)} {self.unit}".strip()


def goals_of(result: StudyRecord, *extra_names: str) -> list[Goal]:
    """List the objectives of a result, the leading one first, then further ones by name."""
    names = sorted(result.objectives, key=lambda name: name != result.leading)
    level = 100 * result.quantile
    goals = []
    for name in dict.fromkeys((*names, *extra_names)):
        objective = OBJECTIVES[name]
        unit = "ms" if objective.unit == "s" else PRINTED_UNITS.get(name, objective.unit)
        label = objective.label
        if name == QUANTILE_TIME:
            label = f"{level:.4g} % {label}"
        goals.append(Goal(**{**vars(objective), "label": label, "unit": unit}))
    return goals


def design_name(design: DesignRow) -> str:
    """Name a design by its number, or as the own dog."""
    return OWN_DOG if design.prototype else f"design {design.trial}"


def design_head(design: DesignRow) -> str:
    """Return the head of a design's column: its number, or the own dog."""
    return OWN_DOG if design.prototype else str(design.trial)


def confirmed_designs(result: StudyRecord) -> dict[int, ConfirmedDesign]:
    """Select the confirmed designs of the front, by trial; empty before the confirmation."""
    return _by_trial(result.confirmation.designs if result.confirmation else ())


def nearest_records(result: StudyRecord) -> dict[int, ConfirmedDesign]:
    """Select the records at new angles of a search in which no design passes, by trial."""
    return _by_trial(result.nearest or ())


def _by_trial(designs: Sequence[ConfirmedDesign]) -> dict[int, ConfirmedDesign]:
    """Index designs by the number of their trial."""
    return {design.trial: design for design in designs if design.trial is not None}


def confirmation_of(result: StudyRecord, design: DesignRow) -> ConfirmedDesign | None:
    """Select the record of a design at new angles; None if it was not simulated there."""
    confirmation = result.confirmation
    if confirmation is not None and design.prototype:
        return confirmation.prototype
    if confirmation is not None and design.trial == confirmation.chosen:
        return confirmation.best
    return (nearest_records(result) | confirmed_designs(result)).get(design.trial)


def engaged_shifts(confirmed: ConfirmedDesign) -> tuple[int, int]:
    """Count the shifts of a confirmed design that engaged, and all of them."""
    points = confirmed.points
    engaged = sum(round(point.engaged * point.n) for point in points)
    return engaged, sum(point.n for point in points)


def margins_of(margins: Mapping[str, float], confirmed: ConfirmedDesign | None) -> dict[str, float]:
    """Replace margins of a search, by check, by those at new angles."""
    if confirmed is None:
        return dict(margins)
    new_margins = {c.name: c.margin for c in confirmed.checks if c.margin is not None}
    return {**margins, **new_margins}


def margin_intervals(confirmed: ConfirmedDesign | None) -> dict[str, list[float]]:
    """Collect the 95 % intervals of a confirmed design's landing margins, by check."""
    checks = confirmed.checks if confirmed else ()
    return {c.name: c.margin_interval for c in checks if c.margin_interval}


def confirmed_verdict(confirmed: ConfirmedDesign) -> VerdictRow:
    """Return the verdict on a confirmed design; judge the checks of a record without one."""
    if confirmed.verdict:
        return confirmed.verdict
    margins = []
    for check in confirmed.checks:
        if check.margin is not None:
            low, high = check.margin_interval or (check.margin, check.margin)
            clear = low >= 0.0 or high < 0.0
            margins.append(Margin(check.name, check.margin, clear, check.ring or ""))
    return VerdictRow.of(judge(margins, ()))


def objection(confirmed: ConfirmedDesign) -> str:
    """Compose the objection to a confirmed design, checks with margins; empty if it passes.

    Limits that sum up other checks are named if no single check fails.
    """
    verdict = confirmed_verdict(confirmed)
    if verdict.passes:
        return ""
    state_words = WORDS[verdict.state]
    if verdict.state == "not_judged":
        names = [check_name(missing.check) for missing in verdict.not_judged]
        return f"{state_words}: {', '.join(names)}"
    names = verdict.not_clear
    if verdict.state == "fails":
        failed = [name for name in verdict.failed if name not in verdict.not_clear]
        names = [name for name in failed if name not in SUMMARIES] or failed
    checks = {check.name: check for check in confirmed.checks}
    words = ", ".join(_margin_words(checks[name]) for name in names)
    return f"{state_words} {words}" if verdict.state == "fails" else f"{state_words}: {words}"


def _margin_words(check: CheckRow) -> str:
    """Print a check with its margin and the 95 % interval of the margin."""
    assert check.margin is not None  # a check without one is not judged
    words = f"{check_name(check.name)} ({percent(check.margin)}"
    if check.margin_interval:
        words += f", 95 %: {' to '.join(map(percent, check.margin_interval))}"
    return f"{words})"


def out_at_new_angles(result: StudyRecord) -> dict[int, str]:
    """Collect the objections to designs with a negative margin at new angles, by trial."""
    return {
        trial: objection(confirmed)
        for trial, confirmed in confirmed_designs(result).items()
        if confirmed_verdict(confirmed).failed
    }


def of_kinds(result: StudyRecord) -> dict[str, list[DesignRow]]:
    """Group the simulated designs of a search by kind; a design has one kind, kinds may be empty.

    Confirmed designs have the values of their confirmation.
    """
    front = {design.trial: design for design in result.front}
    objections = out_at_new_angles(result)
    for trial, confirmed in nearest_records(result).items():
        objections[trial] = objections.get(trial) or objection(confirmed)
    kinds = ("dominated", FAILS, UNCLEAR, "front", "chosen", OWN_DOG)
    designs: dict[str, list[DesignRow]] = {name: [] for name in kinds}
    for searched in result.trials:
        design = _estimated_design(result, front.get(searched.trial, searched))
        if design.expected_shift_time_s is not None:
            kind = _kind_of(result, design, objections.get(design.trial, ""))
            designs[kind].append(design)
    return designs


def _estimated_design(result: StudyRecord, design: DesignRow) -> DesignRow:
    """Replace values of prototype or nearest design by those at new angles, if it has any."""
    if design.prototype:
        confirmed = confirmation_of(result, design)
    else:
        confirmed = nearest_records(result).get(design.trial)
    if confirmed is None:
        return design
    estimates = confirmed.estimates.items()
    values = {
        **{name: estimate.value for name, estimate in estimates},
        "standard_errors": {name: estimate.standard_error for name, estimate in estimates},
        "expected_shift_time_s": confirmed.expected_shift_time_s,
    }
    return design.model_copy(update=values)


def _kind_of(result: StudyRecord, design: DesignRow, words: str) -> str:
    """Name the kind of a simulated design; ``words`` are the objection to it at new angles."""
    if result.best and design.trial == result.best.trial:
        return "chosen"
    if design.prototype:
        return OWN_DOG
    if words.startswith(UNCLEAR):
        return UNCLEAR
    if words or not design.feasible:
        return FAILS
    on_front = any(design.trial == front_design.trial for front_design in result.front)
    return "front" if on_front else "dominated"


def designs_shown(result: StudyRecord) -> list[DesignRow]:
    """List the prototype, the front, best first, and designs with objections at new angles.

    Each design is listed once, with the values of the search.
    """
    designs = {design.trial: design for design in result.trials}
    prototypes = [design for design in result.trials if design.prototype]
    trials = [design.trial for design in (*prototypes, *result.front)]
    return [designs[trial] for trial in dict.fromkeys([*trials, *out_at_new_angles(result)])]


def designs_frame(
    result: StudyRecord, names: Sequence[str], designs: Sequence[DesignRow] | None = None
) -> Frame:
    """Tabulate designs, all of a search by default, with kinds, errors and margins.

    The columns of the searched variables ``names`` stand before those of values.
    """
    front = {design.trial for design in result.front}
    objections = out_at_new_angles(result)
    best_trial = result.best.trial if result.best else None
    first_keys = (*names, "trial", "prototype", "failed")
    table = []
    for design in result.trials if designs is None else designs:
        values = {
            key: value
            for key, value in design.to_dict().items()
            if key not in first_keys and not isinstance(value, dict | list)
        }
        changes = design.time_within_tolerances
        numbers = changes.model_dump(exclude={"by_dimension_s"}) if changes else {}
        table.append(
            {
                "trial": design.trial,
                "prototype": design.prototype,
                "on_front": design.trial in front,
                "failed_at_fresh_angles": design.trial in objections,
                "chosen": design.trial == best_trial,
                **design.params(names),
                **values,
                **{f"standard_error_of_{n}": v for n, v in design.standard_errors.items()},
                "failed": " ".join(design.failed),
                **{f"within_tolerances_{key}": number for key, number in numbers.items()},
                **{f"margin_of_{name}": margin for name, margin in design.margins.items()},
            }
        )
    return frame_of(table)
