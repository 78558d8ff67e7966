"""Records of designs with their provenance.

Times and margins of a searched design are those of the confirmation where it was confirmed, else
of the search. A design that does not engage has no time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import SHARE, Record, number_or_none
from dogshape.pipeline.reports.designs import confirmation_of, engaged_shifts, margins_of
from dogshape.pipeline.search.study_record import ConfirmedDesign, DesignRow, StudyRecord
from dogshape.pipeline.simulate.design import SUMMARIES, design_of, verdict_of
from dogshape.pipeline.store.check_records import CheckRow, LandingRow, VerdictRow
from dogshape.pipeline.store.result_records import HangKeys, PlaceRow
from dogshape.sim.clutch_tables import key
from dogshape.sim.strength.locking import locking_friction
from dogshape.sim.strength.manufacture import Kind
from dogshape.sim.strength.verdict import Margin
from dogshape.sim.units import MM

Values = Mapping[str, float]


class PointDifference(PlaceRow):
    """Time of a design less the prototype's at an operating point."""

    difference_s: float = key("time of the design less the prototype's", "s")
    standard_error_s: float | None = key("its standard error; null unless both have one", "s")


class PointTime(PlaceRow):
    """Mean time of a design at an operating point."""

    mean_s: float | None = key("mean with retries", "s")
    standard_error_s: float | None = key("its standard error", "s")


class TimeKeys(Record):
    """Expected shift time of a design."""

    expected_shift_time_s: float | None = key("expected shift time", "s")
    standard_error_s: float | None = key("its standard error", "s")


class SimulatedValues(HangKeys, TimeKeys):
    """Simulated values of a design, after its time and the terms of that."""

    source: str = key("source of the time: `search`, `new angles`, an engine or a refusal")
    engaged: float | None = key("least share of the shifts that engaged at a point", SHARE)
    shifts_engaged: list[int] | None = key("shifts that engaged, and all, at new angles", "", None)
    gain_s: float | None = key("time of the prototype less the design's", "s", None)
    gain_standard_error_s: float | None = key("its standard error", "s", None)
    worst_against_prototype: PointDifference | None = key("point of the largest loss", "", None)
    slowest_point: PointTime | None = key("point of the largest mean time", "", None)
    decisive_landing: LandingRow | None = key(
        "landing behind the smallest margin of a landing; null of a searched design", "", None
    )


class DesignSheet(Record):
    """Record of a design with its provenance; null for an unknown value."""

    study: str = key("name of the study")
    design: int = key("number of the design; 0 of the study's own", "", 0)
    prototype: bool = key("whether it is the study's own design", "", True)
    dog: dict[str, Any] = key("keys of the dog, and searched keys of the operation")
    axial_length_mm: float = key("axial length, root to root", "mm")
    travel_mm: float = key("travel of the sliding ring", "mm")
    simulated: SimulatedValues = key("simulated values")
    confirmed: bool = key("whether it was simulated at new angles", "", False)
    passes: bool = key("whether every standard check is judged and clearly passes")
    verdict: VerdictRow = key("verdict on the design")
    smallest_margin: float = key("smallest margin at nominal size", "1")
    weakest_check: str = key("check with that margin")
    margin_worst_case: float | None = key("smallest margin with all tolerances at worst", "1")
    margin_root_sum_square: float | None = key("smallest margin by root sum of squares", "1")
    weakest_check_worst_case: str | None = key("check with that margin")
    weakest_check_root_sum_square: str | None = key("check with that margin")
    locking_friction: float | None = key("friction above which the ring locks", "1")
    locking_surface: str = key("surface that locks first; empty without one")
    engine: str = key("engine that simulated the shifts")
    contact: str = key("name of the contact set")
    material: str = key("name of the material")
    operating_points: int = key("number of operating points")
    physics_hash: str = key("hash of what the simulation of a shift depends on")
    config_hash: str = key("hash of the study file")
    margins: dict[str, float | None] = key("margin by check; null where infinite", "1")

    def to_dict(self) -> dict[str, Any]:
        """Return the record as JSON takes it; keys of dog and simulation stand among the others."""
        values: dict[str, Any] = {}
        for name, value in self.model_dump().items():
            values |= value if name in ("dog", "simulated") else {name: value}
        return values


class WeakestCheck(NamedTuple):
    """Check with the smallest margin within the tolerances."""

    name: str | None  #: None without a dog
    margin: float | None


def design_sheet(
    study: Setup,
    params: Values,
    margins: Values,
    *,
    worst_case: WeakestCheck,
    root_sum_square: WeakestCheck,
    verdict: VerdictRow,
    simulated: SimulatedValues,
    engine: str | None = None,
) -> DesignSheet:
    """Record a design of a study as the study's own.

    Parameters
    ----------
    study, params
        Study, and searched keys of the design in edge units.
    margins
        Margins of all checks by name.
    worst_case, root_sum_square
        Weakest checks by the addition of the effects of all dimensions.
    verdict, simulated
        Verdict and simulated values of the design.
    engine
        Engine that simulated the shifts; None for that of the study.

    """
    single = {name: margin for name, margin in margins.items() if name not in SUMMARIES}
    weakest = min(single, key=lambda name: single[name])
    pair = study.clutch_with(params).pair
    dog = pair.sliding
    friction, surface = locking_friction(dog, study.limits.load)
    return DesignSheet(
        study=study.name,
        dog={**study.file.dog.sizes, **study.clutch.output_dog.record, **params},
        axial_length_mm=pair.axial_length / MM,
        travel_mm=pair.travel / MM,
        simulated=simulated,
        passes=verdict.passes,
        verdict=verdict,
        smallest_margin=single[weakest],
        weakest_check=weakest,
        margin_worst_case=number_or_none(worst_case.margin),
        margin_root_sum_square=number_or_none(root_sum_square.margin),
        weakest_check_worst_case=worst_case.name,
        weakest_check_root_sum_square=root_sum_square.name,
        locking_friction=number_or_none(friction),
        locking_surface=surface,
        engine=engine or study.clutch.solver.engine,
        contact=study.clutch.contact.name,
        material=study.limits.material.name,
        operating_points=len(study.points),
        physics_hash=study.physics_hash,
        config_hash=study.config_hash,
        margins={name: number_or_none(margin) for name, margin in margins.items()},
    )


def searched_sheet(study: Setup, result: StudyRecord, row: DesignRow) -> DesignSheet:
    """Record a design of a result; ``study`` is the one that was searched."""
    confirmed = confirmation_of(result, row)

    def weakest_check(kind: Kind) -> WeakestCheck:
        margin = row.margin_within(kind)
        name = None if margin is None else row.weakest_within(kind) or ""
        return WeakestCheck(name, margin)

    params = row.params(study.variables)
    sheet = design_sheet(
        study,
        params,
        margins_of(row.margins, confirmed),
        worst_case=weakest_check("worst_case"),
        root_sum_square=weakest_check("root_sum_square"),
        verdict=searched_verdict(study, params, row.margins, confirmed),
        simulated=_simulated_values(result, row, confirmed),
    )
    changes = {
        "design": row.trial,
        "prototype": row.prototype,
        "confirmed": confirmed is not None,
    }
    return sheet.model_copy(update=changes)


def _simulated_values(
    result: StudyRecord, row: DesignRow, confirmed: ConfirmedDesign | None
) -> SimulatedValues:
    """Collect the values of a design at new angles, by default those of the search."""
    simulated = row if confirmed is None else confirmed
    is_timed = simulated.expected_shift_time_s is not None
    values = SimulatedValues(
        expected_shift_time_s=simulated.expected_shift_time_s,
        standard_error_s=simulated.standard_error_s if is_timed else None,
        **{name: getattr(simulated, name) for name in HangKeys.model_fields},
        source="search" if confirmed is None else "new angles",
        engaged=simulated.engaged,
    )
    if confirmed is None:
        return values
    changes: dict[str, Any] = {"shifts_engaged": list(engaged_shifts(confirmed))}
    if is_timed:
        changes |= {"slowest_point": _slowest_point(confirmed)}
    prototype = None if result.confirmation is None else result.confirmation.prototype
    if prototype is not None and not row.prototype:
        loss = time_difference(prototype, confirmed)
        if loss is not None:
            differences = point_differences(prototype, confirmed)
            changes |= {
                "gain_s": -loss[0],
                "gain_standard_error_s": loss[1],
                "worst_against_prototype": largest_loss(differences),
            }
    return values.model_copy(update=changes)


def _slowest_point(confirmed: ConfirmedDesign) -> PointTime:
    """Return the operating point with the largest mean time of a design that engages."""
    slowest = max(confirmed.points, key=lambda point: point.mean_s or 0.0)
    return PointTime(
        mismatch_rpm=slowest.mismatch_rpm,
        force_N=slowest.force_N,
        mean_s=slowest.mean_s,
        standard_error_s=slowest.standard_error_s,
    )


def searched_verdict(
    study: Setup, params: Values, margins: Values, confirmed: ConfirmedDesign | None
) -> VerdictRow:
    """Return the verdict of a confirmation, else judge a design by the margins of its search."""
    if confirmed is not None and confirmed.verdict:
        return confirmed.verdict
    checks = [Margin(name, margin) for name, margin in margins_of(margins, confirmed).items()]
    operated = study.with_design(params)
    return VerdictRow.of(verdict_of(operated, operated.dog_with(params), checks, params=params))


def point_differences(prototype: ConfirmedDesign, chosen: ConfirmedDesign) -> list[PointDifference]:
    """Compute the time of the chosen design less the prototype's, s, at each operating point.

    The n-th point of both designs is the same point of the study, which a design may move by
    set-point and force; its keys are those of the prototype. A point where a design has no mean
    time is left out; the standard error is None unless both designs have one.
    """
    differences = []
    for prototype_point, point in zip(prototype.points, chosen.points, strict=True):
        if prototype_point.mean_s is None or point.mean_s is None:
            continue
        error = None
        if prototype_point.standard_error_s is not None and point.standard_error_s is not None:
            error = math.hypot(prototype_point.standard_error_s, point.standard_error_s)
        differences.append(
            PointDifference(
                mismatch_rpm=prototype_point.mismatch_rpm,
                force_N=prototype_point.force_N,
                difference_s=point.mean_s - prototype_point.mean_s,
                standard_error_s=error,
            )
        )
    return differences


def largest_loss(differences: Sequence[PointDifference]) -> PointDifference:
    """Select the operating point at which a design loses most time on the prototype."""
    return max(differences, key=lambda difference: difference.difference_s)


class TimedRecord(Protocol):
    """Record with an expected time."""

    @property
    def expected_shift_time_s(self) -> float | None:
        """Expected shift time, s; None where too few shifts engage."""

    @property
    def standard_error_s(self) -> float | None:
        """Its standard error, s."""


def time_difference(reference: TimedRecord, record: TimedRecord) -> tuple[float, float] | None:
    """Compute a record's expected time less the reference's, s, and the standard error.

    The means count as independent. None unless both records have a time.
    """
    if reference.expected_shift_time_s is None or record.expected_shift_time_s is None:
        return None
    error = math.hypot(reference.standard_error_s or 0.0, record.standard_error_s or 0.0)
    return record.expected_shift_time_s - reference.expected_shift_time_s, error


def searched_checks(study: Setup, result: StudyRecord, row: DesignRow) -> list[CheckRow]:
    """List the checks of a design: closed forms with simulated values, then simulated checks.

    ``study`` has the design as its prototype. Simulated values are those of the confirmation, for
    checks that it lacks those of the search.
    """
    design = design_of(study, {})
    confirmed = confirmation_of(result, row)
    checks = {check.name: check for check in design.rows}
    for check in confirmed.checks if confirmed else ():
        closed_form = checks.get(check.name)
        values = closed_form.to_dict() if closed_form else {}
        checks[check.name] = CheckRow(**(values | check.to_dict()))
    for name, margin in row.margins.items():
        if name not in checks:
            checks[name] = _searched_check(name, margin)
    return list(checks.values())


def _searched_check(name: str, margin: float) -> CheckRow:
    """Record a simulated check of which a search stores its margin alone."""
    values = {"name": name, "margin": margin, "group": "impact"}
    empty = dict.fromkeys(CheckRow.model_fields)
    return CheckRow.model_construct(_fields_set=set(values), **{**empty, **values})
