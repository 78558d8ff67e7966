"""One design of a search: its dog, its checks and its objectives.

A constraint is a check's margin with its sign turned, feasible at or below zero. Most are known
before anything is simulated.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, reduce
from operator import and_
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Record, key, number_or_none
from dogshape.pipeline.store.result_records import check_record
from dogshape.sim.clutch_tables import si_fields
from dogshape.sim.elementwise import Array, Mask, largest, smallest
from dogshape.sim.errors import GeometryError, InputError, refusal, require_known
from dogshape.sim.shift.geometry import Dog, Dogs
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.sim.statistics.uncertainty import sobol_shares
from dogshape.sim.strength.checks import RULES, Check, Rule
from dogshape.sim.strength.dog_strength import (
    keeps_limits,
    margin_losses,
    strength_checks,
    within_tolerances,
)
from dogshape.sim.strength.landing import Demand, Landings, demand_checks
from dogshape.sim.strength.locking import retention_force
from dogshape.sim.strength.manufacture import Kind, Spread
from dogshape.sim.strength.verdict import NO_DOG, Margin, Verdict, hinges, judge, missing_checks
from dogshape.sim.units import MM, suffix_of, to_si
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Surrogate

SIMULATED = "expected_shift_time_s"  #: what every simulation gives, an objective or not
WORST, STATISTICAL = "smallest_margin_worst", "smallest_margin_statistical"
#: Quantities that sum up margins within tolerances, with the way in which effects are added.
WITHIN: dict[str, Kind] = {WORST: "worst_case", STATISTICAL: "root_sum_square"}
#: Words for these ways.
WITHIN_WORDS = {WORST: "at worst-case tolerances", STATISTICAL: "at statistical tolerances"}
#: Quantities that sum up other checks: a limit on one of them is no check of its own.
SUMMARIES = (*WITHIN, "smallest_margin", "utilisation")
KINDS: tuple[Kind, ...] = ("worst_case", "root_sum_square")
FILLING = 512  #: designs that fill the ranges
MAX_NAMED = 3  #: failed checks that are named
Bounds = Sequence[tuple["Objective", float]]  #: upper ones where less is better
REFERRED = "slower_than_reference_s"  #: needs the shifts of the study's own dog too
ENGAGEMENT = RULES["engagement"]


@dataclass(frozen=True)
class Design:
    """Searched keys in edge units with what follows; ``refusal`` is why there is no ``dog``.

    ``landings`` are those of its simulated shifts, None before that.
    """

    params: dict[str, float]
    dog: Dog | None
    checks: tuple[Check, ...]
    refusal: str
    landings: Landings | None = None

    @property
    def feasible(self) -> bool:
        """Whether the shape exists and passes every check that is there (not: every standard one).

        The search compares designs by it; ``judged_design`` also names the missing ones.
        """
        return not self.failed

    @property
    def constraints(self) -> dict[str, float]:
        """Constraint values by name, feasible at or below zero."""
        if self.dog is None:
            return {"geometry": 1.0}
        return {"geometry": -1.0, **{c.name: -c.margin for c in self.checks}}

    @property
    def failed(self) -> list[str]:
        """Names of the checks that fail."""
        return [name for name, value in self.constraints.items() if not value <= 0.0]

    @property
    def faults(self) -> list[Check]:
        """Checks that fail, but for those that sum up others."""
        return [check for check in self.checks if not (check.passed or check.rule.summary)]


@dataclass(frozen=True)
class Measured:
    """Simulated values that the checks of a design are judged by.

    ``limited`` are those that ``search.limits`` bounds, by name, ``engaged`` the least share of the
    shifts that engage, of any operating point. ``landings``, which the demand is from, are not
    stored.
    """

    demand: Demand
    limited: Mapping[str, float] = field(default_factory=dict)
    engaged: float = 1.0
    landings: Landings | None = field(default=None, compare=False, repr=False)


def design_of(study: Setup, params: dict[str, float], measured: Measured | None = None) -> Design:
    """Work out a design, not feasible where the shape is impossible.

    ``measured`` is what was simulated of it, None before that.
    """
    study = study.with_operation(params)
    try:
        dog = study.dog_with(params)
    except GeometryError as error:
        return Design(params, None, (), str(error))
    known = {} if measured is None else measured.limited
    design = check_dog(study, params, dog, limits_of(study), known)
    if measured is None:
        return design
    engaged = Check(ENGAGEMENT, measured.engaged, LEAST_ENGAGED)
    landed = demand_checks(measured.demand, study.limits)
    checks = (*design.checks, *landed, engaged)
    return replace(design, checks=checks, landings=measured.landings)


def judged_design(study: Setup, design: Design) -> tuple[Design, Verdict]:
    """Judge a design: the intervals of its landing, and its verdict."""
    if (dog := design.dog) is None:
        return design, NO_DOG
    own, landings, checks = study.with_operation(design.params), design.landings, design.checks
    if landings is not None:
        demand, interval = landings.demand(dog, own.limits), landings.interval(dog, own.limits)
        landed = {check.name: check for check in demand_checks(demand, own.limits, interval)}
        checks = tuple(landed.get(check.name, check) for check in checks)
    return replace(design, checks=checks), verdict_of(
        own, dog, list(map(Margin.of, checks)), landings
    )


def verdict_of(
    study: Setup, dog: Dog, margins: Sequence[Margin], landings: Landings | None = None
) -> Verdict:
    """Judge a dog of a study by its margins, and find the assumptions that they depend on.

    Without ``landings`` the margins of a landing do not move with any assumption.
    """
    contact, limits = study.clutch.contact, study.limits
    moved = {check.name for check in strength_checks(dog, limits)} | OBJECTIVES.keys()
    if landings is not None:
        moved |= {name for name, rule in RULES.items() if rule.group == "impact"}
    fixed = {margin.name: margin.value for margin in margins if margin.name not in moved}
    assumptions = hinges(
        dog,
        limits,
        landings,
        fixed,
        contact_stiffness=contact.stiffness if contact.impact is None else None,
        mechanism=study.clutch.mechanism,
        given=keys_given(study),
    )
    missing = missing_checks(dog, limits, (margin.name for margin in margins))
    return judge(margins, missing, assumptions)


def keys_given(study: Setup) -> set[str]:
    """List the keys of toothing and strike that the file of a study gives."""
    sections = {"mechanism": study.file.mechanism, "strike": study.file.strike}
    return {
        f"{name}.{key}"
        for name, section in sections.items()
        if section is not None
        for key, value in section.model_dump(exclude_none=True).items()
        if value != 0.0
    }


def check_dog(
    study: Setup, params: dict[str, float], dog: Dog, limits: Bounds, known: Mapping[str, float]
) -> Design:
    """Check a dog, or ``Dogs``, before landings; limits on values not known are left out."""
    bare = Design(params, dog, strength_checks(dog, study.limits), "")
    checks = list(bare.checks)
    for quantity, limit in limits:
        exact = quantity.exact and quantity.exact(study, bare, dog)
        if (value := known.get(quantity.name, exact)) is not None:
            checks.append(Check(quantity.rule, value, limit))
    return replace(bare, checks=tuple(checks))


def worth_simulating(study: Setup, params: dict[str, float]) -> bool:
    """Decide whether a design passes every check that needs no simulation, cheap ones first."""
    try:
        fit = keeps_limits(study.dog_with(params), study.with_operation(params).limits)
    except GeometryError:
        return False
    return fit and design_of(study, params).feasible


def dogs_of(study: Setup, names: Sequence[str], x: Array) -> Dogs:
    """Give designs (n, d) in edge units as dogs, what is not named from the study's dog."""
    own = {f.name: getattr(study.clutch.dog, f.name) for f in fields(Dog)}
    return Dogs(**(own | si_fields(dict(zip(names, x.T, strict=True)))))


def which_pass(study: Setup, designs: Sequence[dict[str, float]]) -> Mask:
    """Mark the designs that are ``worth_simulating``, (n,): together where limits are alike.

    Within tolerances the checks of one design take as long as those of a hundred.
    """
    names = tuple(study.variables)
    if study.shape_keys != names:
        return np.array([worth_simulating(study, params) for params in designs])
    x = study.rows(designs)
    with np.errstate(all="ignore"):  # of shapes that cannot be
        passed = np.ones(len(x), dtype=bool) & dogs_of(study, names, x).possible
        for limits in ([], limits_of(study)):  # margins within tolerances take longest
            if passed.any():
                one = check_dog(study, {}, dogs_of(study, names, x[passed]), limits, {})
                passed[passed] = reduce(and_, (check.passed for check in one.checks))
    return passed


@dataclass(frozen=True)
class Objective:
    """Something to minimise, or to maximise: label and unit for reports.

    ``exact`` gives its value from shape and checks; None where it is simulated
    (``pipeline.simulate.evaluation``). No value lies beyond ``least`` and ``most``.
    """

    name: str
    label: str
    unit: str
    exact: Callable[[Setup, Design, Dog], float] | None = None
    maximise: bool = False
    least: float = 0.0
    most: float = math.inf

    @property
    def simulated(self) -> bool:
        """Whether the value is known only after a simulation."""
        return self.exact is None

    @property
    def sign(self) -> float:
        """Factor that turns the value into a loss: every comparison of designs minimises losses."""
        return -1.0 if self.maximise else 1.0

    @property
    def rule(self) -> Rule:
        """Question of the check that a limit on this quantity is."""
        key = f"search.limits.{self.name}"
        how = "estimate from the design's shifts" if self.simulated else "from shape and checks"
        said = "the study's own limit"
        unit, at_most, summary = self.unit, not self.maximise, self.name in SUMMARIES
        return Rule(self.name, "goal", self.label, how, said, unit, key, at_most, summary)


#: Losses of a design, which each round of a search asks for again; not of candidates.
_losses = lru_cache(maxsize=2**12)(margin_losses)


def margins_within(study: Setup, design: Design, kind: Kind = "worst_case") -> dict[str, float]:
    """Compute each check's margin within the tolerances; the landing has none."""
    if design.dog is None:
        return {}
    found = margin_losses if isinstance(design.dog, Dogs) else _losses
    spreads = found(design.dog, study.limits)
    margins = {
        check.name: check.margin - getattr(spreads[check.name], kind)
        for check in design.checks
        if check.name in spreads
    }
    judged = within_tolerances(design.dog, study.limits, kind)
    return margins | {check.name: check.margin for check in judged}


def weakest_within(study: Setup, design: Design, kind: Kind = "worst_case") -> tuple[str, float]:
    """Return the check with the smallest margin within the tolerances, and that margin."""
    return min(margins_within(study, design, kind).items(), key=lambda pair: pair[1])


def _smallest(kind: Kind) -> Callable[[Setup, Design, Dog], float]:
    """Return the smallest margin within the tolerances as a function of a design."""
    return lambda study, design, _dog: smallest(*margins_within(study, design, kind).values())


#: What a study can minimise or maximise, and bound by ``search.limits``.
OBJECTIVES = {
    objective.name: objective
    for objective in [
        Objective(SIMULATED, "expected shift time", "s"),
        Objective("shift_time_quantile_s", "quantile of the shift time", "s"),
        Objective("worst_shift_time_s", "expected shift time at the slowest operating point", "s"),
        Objective(
            REFERRED,
            "time lost on the reference at the worst operating point",
            "s",
            least=-math.inf,
        ),
        Objective(
            "first_try_share", "share engaged in time at the first try", "", maximise=True, most=1.0
        ),
        Objective("peak_impact_force_N", "mean peak impact force", "N"),
        Objective("peak_axial_force_N", "mean peak axial force", "N"),
        Objective("strike_torque_Nm", "mean peak torque of a strike", "N m"),
        Objective("impact_impulse_Ns", "mean hardest impulse", "N s"),
        Objective("impact_energy_J", "mean energy taken by the contact", "J"),
        Objective(
            "smallest_margin", "smallest margin", "", maximise=True, least=-math.inf, most=1.0
        ),
        *(
            Objective(
                name,
                f"smallest margin {WITHIN_WORDS[name]}",
                "",
                _smallest(kind),
                maximise=True,
                least=-math.inf,
                most=1.0,
            )
            for name, kind in WITHIN.items()
        ),
        Objective(
            "axial_length_mm",
            "axial length, root to root",
            "mm",
            lambda _study, _design, dog: dog.axial_length / MM,
        ),
        Objective(
            "backlash_mm",
            "backlash at the mean radius",
            "mm",
            lambda _study, _design, dog: dog.backlash / MM,
            least=-math.inf,
        ),
        Objective(
            "retention_force_N",
            "axial force that pulls in without friction",
            "N",
            lambda study, _design, dog: retention_force(dog, study.limits.load),
            maximise=True,
            least=-math.inf,
        ),
        Objective(
            "utilisation",
            "utilisation of the most loaded check",
            "",
            lambda _study, design, _dog: largest(*(c.utilisation for c in design.checks)),
        ),
    ]
}


def objectives_of(study: Setup) -> list[Objective]:
    """Return the study's objectives; an unknown name raises InputError."""
    names = study.file.search.objectives
    for name in names:
        require_known("search.objectives", name, "an objective", OBJECTIVES)
    if len(set(names)) != len(names):
        raise InputError("search.objectives names an objective twice; remove one of the two")
    found = [OBJECTIVES[name] for name in names]
    if not any(objective.simulated for objective in found):
        fault = "search.objectives has none that needs a simulation, which a search is for"
        remedy = f"add one of {', '.join(o.name for o in OBJECTIVES.values() if o.simulated)}"
        raise InputError(f"{fault}; {remedy}")
    return found


def limits_of(study: Setup) -> list[tuple[Objective, float]]:
    """Return the quantities that the study bounds with their bounds, upper ones if less is better.

    InputError for an unknown name, and for a bound that no design can keep.
    """
    found = []
    for name, limit in (study.file.search.limits or {}).items():
        require_known("search.limits", name, "a quantity of a study", OBJECTIVES)
        one, rule = OBJECTIVES[name], ""
        if not math.isfinite(limit):
            rule = "it must be finite"
        elif one.maximise and limit > one.most:
            rule = f"no {one.label} is above {one.most:g}"
        elif not one.maximise and limit <= one.least:
            rule = f"every {one.label} is above {one.least:g}"
        if rule:
            remedy = "give another or take it out"
            raise InputError(refusal(f"search.limits.{name}", limit, one.unit, rule, remedy))
        found.append((one, limit))
    return found


def simulated_limits(study: Setup) -> list[str]:
    """Return the names of the bounded quantities that a simulation has to say."""
    return [quantity.name for quantity, _ in limits_of(study) if quantity.simulated]


def leading(study: Setup) -> Objective:
    """Return the objective that decides which design is best: the first simulated one."""
    return next(objective for objective in objectives_of(study) if objective.simulated)


def exact_values(study: Setup, design: Design) -> dict[str, float]:
    """Return the objectives that need no simulation, by name."""
    if (dog := design.dog) is None:
        return {}
    own = study.with_operation(design.params)
    return {o.name: o.exact(own, design, dog) for o in objectives_of(study) if o.exact}


def values_of(study: Setup, design: Design, found: dict[str, float] | None = None) -> list[float]:
    """Return all objective values in the study's order, unknown ones infinitely bad."""
    known = {**exact_values(study, design), **(found or {})}
    return [known.get(o.name, o.sign * math.inf) for o in objectives_of(study)]


def failing_words(margins: Sequence[Mapping[str, float]]) -> str:
    """Count the designs that fail each check, with the nearest of them; empty where none fails."""
    failing = Counter(name for row in margins for name, margin in row.items() if margin < 0.0)
    said = []
    for name, count in failing.most_common(MAX_NAMED):
        short = -max(row[name] for row in margins if row.get(name, 0.0) < 0.0)
        said.append(
            f"{count} of {len(margins)} fail {_words(name)}, the nearest of them by "
            f"{100.0 * short:.3g} %"
        )
    return "; ".join(said)


def none_passes(study: Setup, drawn: int) -> str:
    """Explain which checks designs that fill the ranges fail where none of those drawn passes."""
    whose = f"none of {drawn} designs drawn from the search ranges"
    low, high = np.array(list(study.variables.values()), dtype=float).T
    made = list[tuple[Design, dict[str, float]]]()
    for row in sobol_shares(FILLING, len(low), study.file.search.seed):
        one = design_of(study, study.params_of(low + row * (high - low)))
        margins = {check.name: check.margin for check in one.checks}
        for name in WITHIN.keys() & margins.keys():
            del margins[name]
            margins |= margins_within(study.with_operation(one.params), one, WITHIN[name])
        made += [(one, margins)] if margins else []
    if not made:
        return f"{whose} passes every check: no dog has such a shape; widen [variables]"
    bounded = [name for name in WITHIN if name in (study.file.search.limits or {})]
    worst = f" {WITHIN_WORDS[bounded[0]]}" if bounded else ""
    nearest, margins = max(made, key=lambda one: min(one[1].values()))
    name = min(margins, key=lambda one: margins[one])
    at = ", ".join(f"{key} {value:.4g}" for key, value in nearest.params.items())
    remedy = next(check.remedy for check in nearest.checks if check.name == name)
    return (
        f"{whose} passes every check{worst}. Of those that fill the ranges "
        f"{failing_words([margins for _, margins in made])}. Nearest is {at}: {_words(name)} fails "
        f"by {100.0 * -margins[name]:.3g} %. Widen [variables], or {remedy}"
    )


def _words(name: str) -> str:
    return name.removesuffix(suffix_of(name)).replace("_", " ")


class ToleranceTime(Record):
    """Change of the expected shift time within the tolerances of the dimensions."""

    worst_case_s: float = key("all tolerances at their worst ends", "s")
    root_sum_square_s: float = key("root of the sum of squares over the dimensions", "s")
    by_dimension_s: dict[str, float] = key("change by dimension", "s")


def checks_within(study: Setup, design: Design) -> list[dict[str, Any]]:
    """Return every check as a record, with its margins within the tolerances."""
    within = {f"margin_{kind}": margins_within(study, design, kind) for kind in KINDS}
    return [
        check_record(c) | {key: number_or_none(left.get(c.name)) for key, left in within.items()}
        for c in design.checks
    ]


def smallest_within(study: Setup, design: Design) -> dict[str, Any]:
    """Return the smallest margin and its check in the worst case, and by root sum of squares."""
    own, known = study.with_operation(design.params), design.dog is not None
    found = {kind: weakest_within(own, design, kind) if known else (None, None) for kind in KINDS}
    margins = {f"margin_{kind}": number_or_none(margin) for kind, (_, margin) in found.items()}
    return {**margins, **{f"weakest_check_{kind}": name for kind, (name, _) in found.items()}}


def tolerance_time(
    study: Setup, surrogate: Surrogate, params: dict[str, float], mix: Mix
) -> ToleranceTime:
    """Compute the change of the expected shift time over a mix within the tolerances.

    Slopes are those of the surrogate; the axial gap adds free flight, in closed form. Diameters
    scale speed and width alike, and the root radius is not simulated: neither counts.
    """
    tolerances = study.limits.tolerances.dimensions
    moves = {}
    for variable in surrogate.data.variables:
        name = variable.removesuffix(suffix_of(variable))
        if name in tolerances:
            step = tolerances[name] / to_si(variable, 1.0)
            designs = [{**params, variable: params[variable] + move} for move in (-step, step)]
            below, above = surrogate.medians(study.rows(designs), mix)
            moves[name] = 0.5 * float(above - below)
    if gap := tolerances.get("axial_gap"):
        own, mass = study.clutch.dog.axial_gap, study.clutch.rings.mass
        mass, ends = mass + study.clutch.mechanism.added_mass, (own + gap, max(0.0, own - gap))
        profiles = map(study.actuation.at_sleeve, mix.points[:, 1].tolist())
        times = np.array([[one.free_flight_time(end, mass) for end in ends] for one in profiles])
        moves["axial_gap"] = 0.5 * float(mix.weights @ (times[:, 0] - times[:, 1]))
    share = study.limits.tolerances.statistical_share
    spread = Spread(moves, sum(abs(move) for move in moves.values()), share)
    within = {f"{kind}_s": getattr(spread, kind) for kind in KINDS}
    return ToleranceTime(**within, by_dimension_s=moves)
