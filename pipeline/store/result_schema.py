"""Results as records by the names of the command line's contract, fit for JSON.

``StudyRecord`` is the schema of ``result.json``: every key with its type, unit and meaning; unknown
keys are refused.

The description of each key is written here once: ``docs/studies.md`` shows the same table
(``key_table``). Keys that earlier versions did not write may be absent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, cast, get_args, get_origin

from pydantic import BaseModel, Field

from dogshape.sim.clutch_tables import Section, validate
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.strength.checks import Check
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    from dogshape.diagnosis.bench.comparison import Comparison, Difference


SHARE = "share"  #: unit of what lies between 0 and 1


def key(meaning: str, unit: str = "", default: Any = ...) -> Any:
    """Declare a key of the record with its meaning and its unit; required without a default."""
    return Field(default, description=meaning, json_schema_extra={"unit": unit})


class ToleranceTime(Section):
    """Change of the expected shift time within the tolerances of the dimensions."""

    worst_case_s: float = key("all tolerances at their worst ends", "s")
    root_sum_square_s: float = key("root of the sum of squares over the dimensions", "s")
    by_dimension_s: dict[str, float] = key("change by dimension", "s")


class DesignRow(Section):
    """A design of the search; its searched keys have the units that their names end in.

    In `trials` values and margins are those of the search, in `best` and `front` those of the new
    angles, once there is a confirmation. Of a design that was not simulated simulated values are
    null, of one that engages too seldom its times.
    """

    trial: int = key("number of the trial")
    prototype: bool = key("whether this is the study's own design")
    chamfer_deg: float | None = key("chamfer angle, where it is searched", "deg", None)
    traction_deg: float | None = key(
        "angle of the traction flank, where it is searched", "deg", None
    )
    braking_deg: float | None = key("angle of the braking flank, where it is searched", "deg", None)
    height_mm: float | None = key("height of the dogs, where it is searched", "mm", None)
    count: int | None = key("number of dogs of a ring, where it is searched", "", None)
    axial_length_mm: float | None = key(
        "axial length, root to root, where it is an objective", "mm", None
    )
    separating_force_N: float | None = key(
        "axial separating force, where it is an objective", "N", None
    )
    utilisation: float | None = key(
        "utilisation of the most loaded check, where it is an objective", "1", None
    )
    smallest_margin: float | None = key("smallest margin of all checks at nominal size", "1")
    weakest_check: str = key("check with the smallest margin; `geometry` if no dog has the shape")
    margins: dict[str, float] = key("margin to the limit, by check", "1")
    expected_shift_time_s: float | None = key(
        "mean shift time over the operating points, retries included", "s"
    )
    shift_time_quantile_s: float | None = key(
        "quantile of the shift time, where it is an objective", "s", None
    )
    peak_impact_force_N: float | None = key(
        "mean of each shift's largest contact force, where it is an objective", "N", None
    )
    worst_shift_time_s: float | None = key(
        "expected shift time at the slowest operating point, where it is an objective", "s", None
    )
    slower_than_reference_s: float | None = key(
        "time lost on the reference at the worst operating point, where it is an objective",
        "s",
        None,
    )
    first_try_share: float | None = key(
        "share of shifts that engage in time at the first try, where it is an objective",
        SHARE,
        None,
    )
    peak_axial_force_N: float | None = key(
        "mean of each shift's largest axial force, where it is an objective", "N", None
    )
    strike_torque_Nm: float | None = key(
        "mean of each shift's largest torque of the contact, where it is an objective", "N m", None
    )
    impact_impulse_Ns: float | None = key(
        "mean of each shift's hardest impulse, where it is an objective", "N s", None
    )
    impact_energy_J: float | None = key(
        "mean energy that the contact took, where it is an objective", "J", None
    )
    smallest_margin_worst: float | None = key(
        "smallest margin at worst-case tolerances, where it is an objective", "1", None
    )
    feasible_probability: float | None = key(
        "share of manufactured clutches that keep all checks, where it is an objective",
        SHARE,
        None,
    )
    mismatch_set_rpm: float | None = key(
        "mean mismatch that the speed control aims at, where it is searched", "1/min", None
    )
    force_factor: float | None = key(
        "shift force over that of the study, where it is searched", "1", None
    )
    rise_factor: float | None = key(
        "rise time of the force over that of the study, where it is searched", "1", None
    )
    standard_errors: dict[str, float | None] = key(
        "standard error of each objective that is an estimate, in its unit"
    )
    standard_error_s: float | None = key("standard error of the expected shift time", "s")
    points: int = key("operating points that were simulated")
    shifts: int = key("shifts that were simulated")
    engaged: float | None = key("least share of the shifts that engaged at a point", SHARE)
    feasible: bool = key("whether the design was simulated and passes every check")
    failed: list[str] = key(
        "checks that fail; `engines` where these disagree, `simulation` where shifts say nothing"
    )
    margin_worst_case: float | None = key("smallest margin with all tolerances at worst", "1")
    weakest_check_worst_case: str | None = key(
        "check with that margin; absent in earlier versions", "", None
    )
    margin_root_sum_square: float | None = key(
        "smallest margin with tolerances added as root of the sum of squares", "1"
    )
    time_within_tolerances: ToleranceTime | None = key(
        "change of the expected shift time within tolerances; null without a surrogate"
    )
    low: float | None = key(
        "lower end of the 95 % interval of the leading objective, in its unit; feasible designs",
        "",
        None,
    )
    high: float | None = key("upper end of that interval; feasible designs", "", None)
    probability_on_front: float | None = key(
        "probability that no other design dominates this one; feasible designs", SHARE, None
    )


class PointRow(Section):
    """An operating point of a confirmed design."""

    mismatch_rpm: float = key("speed of ring against ring before the shift", "1/min")
    force_N: float = key("final shift force", "N")
    mean_s: float | None = key(
        "mean shift time, retries included; null where fewer than half of the shifts engage", "s"
    )
    mean_engaged_s: float | None = key("mean time of the shifts that engaged", "s")
    standard_error_s: float | None = key("standard error of `mean_s`", "s")
    sd_s: float = key("standard deviation of the time of a shift", "s")
    engaged: float = key("share of the shifts that engaged", SHARE)
    n: int = key("number of shifts")
    held_dog_on_dog: int | None = key(
        "shifts that friction held dog on dog; absent in earlier versions", "", None
    )


class Estimate(Section):
    """A simulated objective of a confirmed design."""

    value: float = key("value, in the unit of the objective")
    standard_error: float = key("standard error, in the same unit")


class CheckRow(Section):
    """A check of a confirmed design against its limit."""

    name: str = key("name of the check")
    value: float | None = key("value that is checked, in `unit`; null where it is infinite")
    limit: float = key("limit, in `unit`")
    unit: str = key("unit of value and limit")
    margin: float | None = key("distance to the limit over the limit; at least 0 passes", "1")
    passed: bool = key("whether the check passes")
    group: str = key("kind of check: `make`, `load`, `lock`, `impact` or `tolerance`")
    at_most: bool = key("whether the limit is an upper one")
    meaning: str = key("what is checked")
    formula: str = key("formula of the value")
    source: str = key("source of the limit")
    limit_key: str = key("key of the study file that sets the limit")


class EngineAgreement(Section):
    """Shifts of the compiled engine that Drake simulated again."""

    shifts: int = key("shifts that both engines simulated")
    different_outcomes: int = key("shifts that end differently")
    median_deviation: float = key(
        "median size of the deviation of a shift's time from Drake's", "1"
    )
    mean_deviation: float = key(
        "mean time less Drake's, over Drake's; shifts that engage in both", "1"
    )
    standard_error: float = key("standard error of `mean_deviation`", "1")
    agrees: bool = key("whether the engines agree (`docs/search.md`)")


class ConfirmedDesign(Section):
    """A design re-simulated at every operating point and at angles that the search did not use."""

    trial: int | None = key("number of the trial; in `designs` alone", "", None)
    expected_shift_time_s: float | None = key(
        "mean shift time over the operating points; null where too few shifts engage", "s"
    )
    standard_error_s: float | None = key("its standard error", "s")
    numerical_error_s: float | None = key(
        "its numerical error by a finer integration; null where it was not computed", "s"
    )
    engages: bool = key("whether at least half of the shifts engage at each operating point")
    engaged: float = key("least share of the shifts that engaged at a point", SHARE)
    mean_engaged_s: float | None = key(
        "mean time of the shifts that engaged; absent in earlier versions", "s", None
    )
    shifts: int | None = key("number of shifts; absent in earlier versions", "", None)
    not_engaged: int | None = key(
        "shifts that did not engage; absent in earlier versions", "", None
    )
    held_dog_on_dog: int | None = key(
        "shifts that friction held dog on dog; absent in earlier versions", "", None
    )
    points: list[PointRow] = key("the operating points")
    estimates: dict[str, Estimate] = key("simulated objectives, by name")
    checks: list[CheckRow] = key("all checks, the hardest landing among them")
    drake: EngineAgreement | None = key(
        "agreement of Drake at some of the same angles; null where one engine did all", "", None
    )
    searched: Estimate | None = key(
        "leading objective by the search, in its unit; in `designs` alone", "", None
    )
    errors_apart: float | None = key(
        "new angles less search, over their combined standard error; in `designs` alone", "", None
    )
    agrees: bool | None = key(
        "whether these are at most 3 standard errors apart; in `designs` alone", "", None
    )


class ContactGain(Section):
    """The gain under another contact, by the compiled engine."""

    contact: str = key("what differs from the study's contact")
    gain_s: float | None = key("gain in expected shift time; null where one has none", "s")
    gain_standard_error_s: float | None = key("its standard error", "s")
    gain_share: float | None = key("gain over the time of the prototype", SHARE)


class Confirmation(Section):
    """Re-simulation of the prototype and of designs of the front at new angles."""

    angles: int = key("relative angles at each operating point")
    drake_angles: int | None = key(
        "angles of these that Drake simulated too; null where none", "", None
    )
    prototype: ConfirmedDesign = key("the study's own design")
    chosen: int = key(
        "trial of the chosen design: first of the front by the search; where none passes, of all"
    )
    best: ConfirmedDesign = key("the chosen design")
    designs: list[ConfirmedDesign] = key("all designs, in the order of the search")
    left_out: list[int] = key(
        "trials that no other beats, beyond `search.confirm_designs`: not confirmed, not on the "
        "front"
    )
    gain_s: float | None = key(
        "expected shift time of the prototype less that of the chosen design; null where one has "
        "none, or both are the same design",
        "s",
    )
    gain_standard_error_s: float | None = key("standard error of `gain_s`", "s")
    gain_share: float | None = key("gain over the time of the prototype", SHARE)
    gains: dict[str, Estimate] = key("gain in each simulated objective, in its unit")
    gains_by_contact: list[ContactGain] = key(
        "gain with friction and dissipation at the ends of what they may be; empty where the "
        "prototype is chosen"
    )


class LifeStage(Section):
    """The chosen design at a share of its life."""

    life: float = key("share of the life", SHARE)
    crest_loss_mm: float = key("height that the crest has lost", "mm")
    edge_radius_mm: float = key("radius of its edges; 0 is sharp", "mm", 0.0)
    chamfer_deg: float = key("what is left of the chamfer", "deg")
    expected_shift_time_s: float = key("mean shift time over the operating points", "s")
    standard_error_s: float | None = key("its standard error", "s")
    engaged: float = key("share of the shifts that engaged", SHARE)
    energy_J: float = key("mean energy that the contact takes in a shift", "J")
    smallest_margin: float = key("smallest margin, manufacture left out", "1")
    weakest_check: str = key("check with the smallest margin")
    margins: dict[str, float] = key("margin of each check", "1")


class SurrogateFigures(Section):
    """Validation of the surrogate on designs that the fit did not use."""

    q2: float = key("share of the variance of expected times that it explains", "1")
    coverage_95: float = key("share of expected times within their 95 % interval", SHARE)
    rmse_s: float = key("root-mean-square error of the expected time", "s")
    bias_s: float = key("mean error of the expected time", "s")
    n: int = key("number of designs")
    noise_s: float = key("root-mean-square standard error of the simulated expected times", "s")
    q2_points: float = key("share of the variance explained at single operating points", "1")
    coverage_points: float = key("share within the 95 % interval at single operating points", SHARE)
    rmse_points_s: float = key("root-mean-square error at single operating points", "s")
    spread_error: float = key("error of the logarithm of a single shift's deviation", "1")
    lost: int = key("shifts that did not engage")
    lost_expected: float = key("shifts that the surrogate expected not to engage")
    rank_best: float | None = key("rank correlation among designs of the best tenth", "1")
    n_best: int = key("number of those designs")
    source: str = key("`references`, designs simulated apart, or `held out`")
    shifts: int = key("shifts behind the fit")


class StudyRecord(Section):
    """The whole record, ``result.json``."""

    study: str = key("name of the study")
    engine: str = key("engine that simulated the shifts, `drake` or `planar`", "", "drake")
    objectives: list[str] = key("objectives, in the order of the study file")
    maximised: list[str] = key("objectives of which more is better")
    leading: str = key("objective that decides which design is best")
    quantile: float = key("level of the quantile of the shift time", SHARE)
    best: DesignRow | None = key("the chosen design; null where none passes every check")
    front: list[DesignRow] = key(
        "designs that no other dominates, best first; once there is a confirmation, by its values"
    )
    trials: list[DesignRow] = key("all designs, by trial")
    n_simulated_designs: int = key("different designs that were simulated")
    n_simulated_shifts: int = key(
        "shifts behind the designs of the search and of the confirmation, of both engines"
    )
    failed_shifts: dict[str, int] = key(
        "shifts that failed in the solver, by reason; of a confirmation those that are kept"
    )
    confirmation: Confirmation | None = key("confirmation; null until the search has ended")
    life: list[LifeStage] | None = key(
        "drift of the chosen design over its life; null for a study without `[wear]`", "", None
    )
    audit: EngineAgreement | None = key(
        "agreement of Drake on random shifts of the search; null where one engine did all",
        "",
        None,
    )
    surrogate: SurrogateFigures | None = key("validation of the surrogate; null without one")
    versions: dict[str, str] = key("versions of the programs that the result depends on")
    config_hash: str = key("hash of the study file as it was run")
    physics_hash: str = key("hash of what the simulation of a shift depends on")


def require_result(data: dict[str, Any], source: str) -> None:
    """Check a record against the schema.

    Raises InputError that names ``source``, and each key that is unknown, missing or mistyped.
    """
    validate(StudyRecord, data, source)


def key_table() -> str:
    """Write the keys of ``result.json`` with types, units and meanings, as Markdown."""
    places: dict[type[BaseModel], list[str]] = {}
    _collect(StudyRecord, "", places)
    return "\n".join(_table(model, paths) for model, paths in places.items())


def _collect(model: type[BaseModel], path: str, places: dict[type[BaseModel], list[str]]) -> None:
    """Note where a model stands, then the models that its keys hold."""
    places.setdefault(model, []).append(path)
    if len(places[model]) > 1:
        return  # its keys are known
    for name, field in model.model_fields.items():
        for inner, mark in _models(field.annotation):
            _collect(inner, f"{path}.{name}{mark}".removeprefix("."), places)


def _models(annotation: Any, mark: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """Yield the models that a type holds, with the marks of lists and dictionaries."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, mark
    mark += {list: "[]", dict: ".*"}.get(get_origin(annotation), "")
    for part in get_args(annotation):
        yield from _models(part, mark)


def _table(model: type[BaseModel], paths: list[str]) -> str:
    title = ", ".join(f"`{path}`" for path in paths if path) or "`result.json`"
    words = " ".join((model.__doc__ or "").split()).replace("``", "`")
    rows = [
        f"| `{name}` | {cast(Any, field.json_schema_extra)['unit']} | {field.description} |"
        for name, field in model.model_fields.items()
    ]
    return "\n".join(
        [f"{title}: {words}", "", "| key | unit | meaning |", "|---|---|---|", *rows, ""]
    )


def expectation_record(expectation: Expectation) -> dict[str, Any]:
    """Record an expectation by the names of the command line's contract.

    Where too few shifts engage there is no time, and no error of one.
    """
    none = not expectation.engages
    return {
        "expected_shift_time_s": expectation.time,
        "standard_error_s": None if none else number_or_none(expectation.standard_error),
        "numerical_error_s": None if none else number_or_none(expectation.numerical_error),
        "engages": expectation.engages,
        "engaged": expectation.engaged,
        "mean_engaged_s": expectation.mean_engaged,
        "shifts": expectation.shifts,
        "not_engaged": expectation.lost,
        "held_dog_on_dog": expectation.blocked,
        "points": [
            {
                "mismatch_rpm": p.point.mismatch / RPM,
                "force_N": p.point.profile.force,
                "mean_s": p.time,
                "mean_engaged_s": p.mean_engaged,
                "standard_error_s": number_or_none(p.standard_error if p.engages else None),
                "sd_s": p.sd,
                "engaged": p.engaged,
                "n": p.n,
                "held_dog_on_dog": p.blocked,
            }
            for p in expectation.points
        ],
    }


def number_or_none(value: float | None) -> float | None:
    """Return a number that JSON can hold: None where there is none."""
    return value if value is not None and math.isfinite(value) else None


def check_record(check: Check) -> dict[str, Any]:
    """Record a check by the names of the command line's contract."""
    rule = check.rule
    return {
        "name": check.name,
        "value": number_or_none(check.value),
        "limit": check.limit,
        "unit": check.unit,
        "margin": number_or_none(check.margin),
        "passed": check.passed,
        "group": rule.group,
        "at_most": rule.at_most,
        "meaning": rule.meaning,
        "formula": rule.formula,
        "source": rule.source,
        "limit_key": rule.key,
    }


def difference_record(d: Difference) -> dict[str, Any]:
    """Record one operating point of a comparison by the contract's names."""
    return {
        "mismatch_rpm": d.cell.point.mismatch / RPM,
        "force_N": d.cell.point.profile.force,
        "bench_s": d.cell.time,
        "simulated_s": d.simulated.mean_engaged,
        "standard_error_s": d.standard_error,
        "z": d.z,
        "engaged": d.simulated.engaged,
        "n": d.simulated.n,
    }


def engaged_record(result: Comparison) -> dict[str, Any]:
    """Record the share of tried shifts that engaged, on the bench and in the simulation."""
    engaged, tried, simulated = result.engaged
    return {"engaged": engaged, "tried": tried, "simulated_share": simulated if tried else None}
