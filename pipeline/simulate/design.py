"""One design of a search: its dog, its checks and its objectives.

A constraint is a check's margin with its sign turned, feasible at or below zero. Most are known
before anything is simulated.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, reduce
from operator import and_
from typing import NamedTuple

import numpy as np

from dogshape.pipeline.config.schema import OUTPUT_VARIABLES
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import number_or_none
from dogshape.pipeline.store.check_records import CheckRow
from dogshape.sim.clutch_tables import si_fields
from dogshape.sim.elementwise import Array, Mask, largest, smallest
from dogshape.sim.errors import GeometryError, InputError, Refusal, require_known
from dogshape.sim.shift.geometry import Dog, Dogs
from dogshape.sim.shift.pair import OUTPUT_PREFIX, OutputDogs, Pair
from dogshape.sim.statistics.expectation import MIN_ENGAGED_SHARE
from dogshape.sim.statistics.hangs import HangPosterior
from dogshape.sim.statistics.uncertainty import sobol_shares
from dogshape.sim.strength.checks import RULES, STUDY_SOURCE, LimitCheck, Rule
from dogshape.sim.strength.dog_strength import (
    keeps_limits,
    margin_losses,
    strength_checks,
    within_tolerances,
)
from dogshape.sim.strength.landing import Demand, Landings, demand_checks
from dogshape.sim.strength.locking import retention_force
from dogshape.sim.strength.manufacture import Kind
from dogshape.sim.strength.verdict import (
    NO_DOG,
    HangShare,
    Margin,
    Verdict,
    hinges,
    judge,
    missing_checks,
)
from dogshape.sim.units import MM, suffix_of

SIMULATED = "expected_shift_time_s"  #: estimated from every simulation, an objective or not
WORST = "smallest_margin_worst"
STATISTICAL = "smallest_margin_statistical"
#: Quantities that sum up margins within tolerances, with the way in which effects are added.
WITHIN: dict[str, Kind] = {WORST: "worst_case", STATISTICAL: "root_sum_square"}
#: Words for these ways.
WITHIN_WORDS = {WORST: "at worst-case tolerances", STATISTICAL: "at statistical tolerances"}
#: Quantities that sum up other checks: a limit on one of them is no check of its own.
SUMMARIES = (*WITHIN, "smallest_margin", "utilisation")
KINDS: tuple[Kind, ...] = tuple(WITHIN.values())
FILLING_DESIGNS = 512  #: designs that fill the ranges to explain why none is feasible
MAX_NAMED = 3  #: failed checks that a message names
Bounds = Sequence[tuple["Objective", float]]  #: upper ones where less is better
REFERRED = "slower_than_reference_s"  #: needs the shifts of the study's own dog too
ENGAGEMENT = RULES["engagement"]


@dataclass(frozen=True)
class Design:
    """Design with its dog and its checks."""

    study: Setup  #: operated as the design is
    params: dict[str, float]  #: searched keys, edge units
    dog: Dog | None  #: None where the shape is impossible
    checks: tuple[LimitCheck, ...]
    refusal: str  #: reason why there is no dog, or empty
    landings: Landings | None = None  #: of its simulated shifts
    worst_hang: HangPosterior | None = None  #: largest probability of a hang at a point
    #: computed margins within the tolerances, by the addition of effects
    _margins: dict[Kind, dict[str, float]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    @property
    def feasible(self) -> bool:
        """Whether the shape exists and passes every check that is there (not: every standard one).

        The search compares designs by it; ``judge_design`` also names the missing ones.
        """
        return not self.failed

    @property
    def constraints(self) -> dict[str, float]:
        """Constraint values by name, feasible at or below zero."""
        if self.dog is None:
            return {"geometry": 1.0}
        return {"geometry": -1.0, **{check.name: -check.margin for check in self.checks}}

    @property
    def failed(self) -> list[str]:
        """Names of the checks that fail."""
        return [name for name, value in self.constraints.items() if not value <= 0.0]

    @property
    def faults(self) -> list[LimitCheck]:
        """Checks that fail, without those that sum up others."""
        return [check for check in self.checks if not (check.passed or check.rule.summary)]

    @cached_property
    def exact_values(self) -> dict[str, float]:
        """Objectives that need no simulation by name; none without a dog."""
        if self.dog is None:
            return {}
        return {
            objective.name: objective.exact(self, self.dog)
            for objective in objectives_of(self.study)
            if objective.exact
        }

    def margins_within(self, kind: Kind) -> dict[str, float]:
        """Compute each check's margin within the tolerances by name; the landing has none.

        ``kind`` is the addition of effects (``KINDS``). A design without a dog has no margins.
        """
        if kind not in self._margins:
            self._margins[kind] = _margins_within(self, kind)
        return self._margins[kind]

    def weakest_within(self, kind: Kind) -> tuple[str, float]:
        """Return the name of the check with the smallest margin within tolerances, and it."""
        return min(self.margins_within(kind).items(), key=lambda pair: pair[1])

    @cached_property
    def rows(self) -> list[CheckRow]:
        """Every check with its margins within the tolerances, by the declared keys."""
        worst_case = self.margins_within("worst_case")
        root_sum_square = self.margins_within("root_sum_square")
        rows = []
        for check in self.checks:
            margins = worst_case.get(check.name), root_sum_square.get(check.name)
            rows.append(CheckRow.of(check).within(*map(number_or_none, margins)))
        return rows


@dataclass(frozen=True)
class CheckInputs:
    """Simulated values that the checks of a design judge."""

    demand: Demand
    limited: Mapping[str, float] = field(default_factory=dict)  #: bounded quantities by name
    engaged: float = 1.0  #: least share of shifts that engage at an operating point
    #: landings behind ``demand``; not stored
    landings: Landings | None = field(default=None, compare=False, repr=False)
    #: largest probability of a hang at an operating point; not stored
    worst_hang: HangPosterior | None = field(default=None, compare=False, repr=False)


def design_of(
    study: Setup, params: dict[str, float], check_inputs: CheckInputs | None = None
) -> Design:
    """Build the dog of a design and check it; not feasible where the shape is impossible.

    ``check_inputs`` are its simulated values, None before a simulation.
    """
    study = study.with_design(params)
    try:
        dog = study.dog_with(params)
    except GeometryError as error:
        return Design(study, params, None, (), str(error))
    limited = {} if check_inputs is None else check_inputs.limited
    design = check_dog(study, params, dog, limits=limits_of(study), limited=limited)
    if check_inputs is None:
        return design
    engagement_check = LimitCheck(ENGAGEMENT, check_inputs.engaged, MIN_ENGAGED_SHARE)
    landing_checks = demand_checks(dog, check_inputs.demand, study.limits)
    checks = (*design.checks, *landing_checks, engagement_check)
    return replace(
        design,
        checks=checks,
        landings=check_inputs.landings,
        worst_hang=check_inputs.worst_hang,
    )


def judge_design(design: Design) -> tuple[Design, Verdict]:
    """Add the intervals of the landing checks to a design, and return it with its verdict."""
    if design.dog is None:
        return design, NO_DOG
    dog = design.dog
    study = design.study
    landings = design.landings
    checks = design.checks
    if landings is not None:
        demand = landings.demand(dog, study.limits)
        interval = landings.interval(dog, study.limits)
        landing_checks = {
            check.name: check for check in demand_checks(dog, demand, study.limits, interval)
        }
        checks = tuple(landing_checks.get(check.name, check) for check in checks)
    margins = [Margin.of(check) for check in checks]
    verdict = verdict_of(study, dog, margins, landings, params=design.params)
    verdict = replace(verdict, hangs=_hang_share(design))
    return replace(design, checks=checks), verdict


def _hang_share(design: Design) -> HangShare | None:
    """Set the largest probability of a hang beside its limits; None without simulated shifts."""
    posterior = design.worst_hang
    if posterior is None:
        return None
    low, high = posterior.interval
    return HangShare(
        posterior.mean,
        low,
        high,
        warning_share=design.study.file.shift.hang_warning_share,
        max_share=1.0 - MIN_ENGAGED_SHARE,
    )


def verdict_of(
    study: Setup,
    dog: Dog,
    margins: Sequence[Margin],
    landings: Landings | None = None,
    *,
    params: Mapping[str, float],
) -> Verdict:
    """Judge a dog of a study by its margins, and find the assumptions that they depend on.

    Without ``landings`` the margins of a landing do not depend on any assumption. Searched keys
    ``params`` of the design are no assumed values.
    """
    limits = study.limits
    variable_names = {check.name for check in strength_checks(dog, limits)} | OBJECTIVES.keys()
    if landings is not None:
        variable_names |= {name for name, rule in RULES.items() if rule.group == "impact"}
    fixed_margins = {
        margin.name: margin.value for margin in margins if margin.name not in variable_names
    }
    assumptions = hinges(
        dog,
        limits,
        landings,
        fixed_margins,
        mechanism=study.clutch.mechanism,
        given=keys_given(study),
    )
    missing = missing_checks(dog, limits, (margin.name for margin in margins))
    verdict = judge(margins, missing, assumptions)
    return replace(verdict, assumed=study.assumed_values(params))


def keys_given(study: Setup) -> set[str]:
    """List the dotted keys of ``[mechanism]`` and ``[strike]`` that the file of a study sets."""
    sections = {"mechanism": study.file.mechanism, "strike": study.file.strike}
    keys = set()
    for table, section in sections.items():
        if section is not None:
            values = section.model_dump(exclude_none=True)
            keys |= {f"{table}.{key}" for key, value in values.items() if value != 0.0}
    return keys


def check_dog(
    study: Setup,
    params: dict[str, float],
    dog: Dog,
    limits: Bounds,
    limited: Mapping[str, float],
) -> Design:
    """Check a dog, or ``Dogs``, before landings.

    Parameters
    ----------
    study, params, dog
        Study with the operation of the design, searched keys, and dog.
    limits
        Bounded quantities; those that are neither exact nor in ``limited`` are left out.
    limited
        Simulated values of bounded quantities by name.

    """
    design = Design(study, params, dog, strength_checks(dog, study.limits), "")
    checks = list(design.checks)
    for quantity, limit in limits:
        value = limited.get(quantity.name)
        if value is None and quantity.exact:
            value = quantity.exact(design, dog)
        if value is not None:
            checks.append(LimitCheck(quantity.rule, value, limit))
    return replace(design, checks=tuple(checks))


def worth_simulating(study: Setup, params: dict[str, float]) -> bool:
    """Decide whether a design passes every check that needs no simulation, cheap ones first."""
    try:
        dog = study.dog_with(params)
        passes_cheap_checks = keeps_limits(dog, study.with_design(params).limits)
    except GeometryError:
        return False
    return passes_cheap_checks and design_of(study, params).feasible


class DesignGroup(NamedTuple):
    """Dogs of many designs of one operation, and the study with their output dogs in its limits."""

    study: Setup
    dogs: Dogs

    @classmethod
    def of(cls, study: Setup, names: Sequence[str], x: Array) -> DesignGroup:
        """Build designs ``x`` in edge units, (n, d), other keys from the study's dogs."""
        columns = dict(zip(names, x.T, strict=True))
        output_columns = {
            name.removeprefix(OUTPUT_PREFIX): columns.pop(name)
            for name in names
            if name in OUTPUT_VARIABLES
        }
        dogs = Dogs.of(study.clutch.dog, **si_fields(columns))
        if output_columns:
            dogs = replace(dogs, row=np.arange(len(x)))
            output_dogs = OutputDogs.of(study.limits.output_dog, **si_fields(output_columns))
            study = replace(study, limits=replace(study.limits, output_dog=output_dogs))
        return cls(study, dogs)

    @property
    def possible(self) -> Mask:
        """Whether both dogs and the pair of each design keep all rules of a shape, (n,)."""
        possible = pair_with(self.study, self.dogs).possible
        return np.broadcast_to(possible, self.dogs.size)


def pair_with(study: Setup, dog: Dog) -> Pair:
    """Build the pair of a dog, or of ``Dogs``, with that of the study's output ring."""
    return study.limits.output_dog.pair_with(dog)


def mark_worthy(study: Setup, designs: Sequence[dict[str, float]]) -> Mask:
    """Mark the designs that are ``worth_simulating``, (n,).

    Designs of one operation are checked together: within tolerances the checks of one design
    take as long as those of a hundred.
    """
    names = tuple(study.variables)
    if study.shape_keys != names:
        return np.array([worth_simulating(study, params) for params in designs])
    x = study.rows(designs)
    with np.errstate(all="ignore"):  # of shapes that cannot be
        passed = DesignGroup.of(study, names, x).possible.copy()
        for limits in ([], limits_of(study)):  # margins within tolerances take longest
            if passed.any():
                group = DesignGroup.of(study, names, x[passed])
                design = check_dog(group.study, {}, group.dogs, limits=limits, limited={})
                passed[passed] = reduce(and_, (check.passed for check in design.checks))
    return passed


@dataclass(frozen=True)
class Objective:
    """Quantity to minimise or maximise, with label and unit for reports."""

    name: str
    label: str
    unit: str
    #: value from shape and checks; None where it is simulated (``pipeline.simulate.evaluation``)
    exact: Callable[[Design, Dog], float] | None = None
    maximise: bool = False
    low: float = 0.0  #: smallest possible value
    high: float = math.inf  #: largest possible value

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
        """Rule of the check that a limit on this quantity is."""
        formula = "from shape and checks"
        if self.simulated:
            formula = "estimate from the design's shifts"
        return Rule(
            name=self.name,
            group="goal",
            meaning=self.label,
            formula=formula,
            source=STUDY_SOURCE,
            unit=self.unit,
            key=f"search.limits.{self.name}",
            at_most=not self.maximise,
            summary=self.name in SUMMARIES,
        )


#: Losses of margins of a design, which each round of a search needs again; not of candidates.
_cached_losses = lru_cache(maxsize=2**12)(margin_losses)


def _margins_within(design: Design, kind: Kind) -> dict[str, float]:
    """Compute each check's margin within the tolerances by name."""
    dog = design.dog
    if dog is None:
        return {}
    limits = design.study.limits
    losses_of = margin_losses if isinstance(dog, Dogs) else _cached_losses
    losses = losses_of(dog, limits)
    margins = {
        check.name: check.margin - getattr(losses[check.name], kind)
        for check in design.checks
        if check.name in losses
    }
    tolerance_checks = within_tolerances(dog, limits, kind)
    return margins | {check.name: check.margin for check in tolerance_checks}


def _smallest_within(kind: Kind) -> Callable[[Design, Dog], float]:
    """Return a function that computes the smallest margin within tolerances of a design."""
    return lambda design, _dog: smallest(*design.margins_within(kind).values())


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
            low=-math.inf,
        ),
        Objective(
            "first_try_share", "share engaged in time at the first try", "", maximise=True, high=1.0
        ),
        Objective("peak_impact_force_N", "mean peak impact force", "N"),
        Objective("peak_axial_force_N", "mean peak axial force", "N"),
        Objective("strike_torque_Nm", "mean peak torque of a strike", "N m"),
        Objective("impact_impulse_Ns", "mean hardest impulse", "N s"),
        Objective("impact_energy_J", "mean energy taken by the contact", "J"),
        Objective("smallest_margin", "smallest margin", "", maximise=True, low=-math.inf, high=1.0),
        *(
            Objective(
                name,
                f"smallest margin {WITHIN_WORDS[name]}",
                "",
                _smallest_within(kind),
                maximise=True,
                low=-math.inf,
                high=1.0,
            )
            for name, kind in WITHIN.items()
        ),
        Objective(
            "axial_length_mm",
            "axial length, root to root",
            "mm",
            lambda design, dog: pair_with(design.study, dog).axial_length / MM,
        ),
        Objective(
            "backlash_mm",
            "backlash at the mean radius",
            "mm",
            lambda design, dog: pair_with(design.study, dog).backlash / MM,
            low=-math.inf,
        ),
        Objective(
            "retention_force_N",
            "axial force that pulls in without friction",
            "N",
            lambda design, dog: retention_force(dog, design.study.limits.load),
            maximise=True,
            low=-math.inf,
        ),
        Objective(
            "utilisation",
            "utilisation of the most loaded check",
            "",
            lambda design, _dog: largest(*(c.utilisation for c in design.checks)),
        ),
    ]
}


def objectives_of(study: Setup) -> list[Objective]:
    """List the study's objectives; InputError for an unknown name, or none to simulate."""
    names = study.file.search.objectives
    for name in names:
        require_known("search.objectives", name, "an objective", OBJECTIVES)
    if len(set(names)) != len(names):
        raise InputError("search.objectives names an objective twice; remove one of the two")
    objectives = [OBJECTIVES[name] for name in names]
    if not any(objective.simulated for objective in objectives):
        fault = "search.objectives has none that needs a simulation, which a search is for"
        simulated = [name for name, objective in OBJECTIVES.items() if objective.simulated]
        raise InputError(f"{fault}; add one of {', '.join(simulated)}")
    return objectives


def limits_of(study: Setup) -> list[tuple[Objective, float]]:
    """List the quantities that the study bounds with their bounds.

    A bound is an upper one, unless the quantity is maximised. InputError for an unknown name, and
    for a bound that no design can keep.
    """
    limits = []
    for name, limit in (study.file.search.limits or {}).items():
        require_known("search.limits", name, "a quantity of a study", OBJECTIVES)
        objective = OBJECTIVES[name]
        rule = _broken_bound(objective, limit)
        if rule:
            remedy = "give another or take it out"
            raise InputError(
                Refusal(f"search.limits.{name}", limit, objective.unit, rule=rule, remedy=remedy)
            )
        limits.append((objective, limit))
    return limits


def _broken_bound(objective: Objective, limit: float) -> str:
    """Name the rule that a bound on a quantity breaks, or an empty text."""
    if not math.isfinite(limit):
        return "it must be finite"
    if objective.maximise and limit > objective.high:
        return f"no {objective.label} is above {objective.high:g}"
    if not objective.maximise and limit <= objective.low:
        return f"every {objective.label} is above {objective.low:g}"
    return ""


def simulated_limits(study: Setup) -> list[str]:
    """List the names of the bounded quantities that need a simulation."""
    return [quantity.name for quantity, _ in limits_of(study) if quantity.simulated]


def leading_objective(study: Setup) -> Objective:
    """Return the objective that decides which design is best: the first simulated one."""
    return next(objective for objective in objectives_of(study) if objective.simulated)


def values_of(design: Design, simulated: dict[str, float] | None = None) -> list[float]:
    """List all objective values in the study's order, missing ones infinitely bad.

    ``simulated`` are values of simulated objectives by name.
    """
    values = {**design.exact_values, **(simulated or {})}
    return [
        values.get(objective.name, objective.sign * math.inf)
        for objective in objectives_of(design.study)
    ]


def failing_words(margins: Sequence[Mapping[str, float]]) -> str:
    """Count the designs that fail each check, with the least failure; empty where none fails.

    ``margins`` are those of each design by check.
    """
    failures = Counter[str]()
    for row in margins:
        failures.update(name for name, margin in row.items() if margin < 0.0)
    clauses = []
    for name, count in failures.most_common(MAX_NAMED):
        shortfall = -max(row[name] for row in margins if row.get(name, 0.0) < 0.0)
        clauses.append(
            f"{count} of {len(margins)} fail {_words(name)}, the nearest of them by "
            f"{100.0 * shortfall:.3g} %"
        )
    return "; ".join(clauses)


def explain_infeasible(
    study: Setup, drawn: int, designs: Sequence[tuple[Design, dict[str, float]]]
) -> str:
    """Explain which checks fail in a study of which none of ``drawn`` designs is feasible.

    ``designs`` fill the search ranges, as ``nearest_filling`` lists them.
    """
    fault = f"none of {drawn} designs drawn from the search ranges"
    if not designs:
        return f"{fault} passes every check: no dog has such a shape; widen [variables]"
    bounds = [name for name in WITHIN if name in (study.file.search.limits or {})]
    tolerances = f" {WITHIN_WORDS[bounds[0]]}" if bounds else ""
    nearest, margins = designs[0]
    name = min(margins, key=lambda check: margins[check])
    place = ", ".join(f"{key} {value:.4g}" for key, value in nearest.params.items())
    remedy = next(check.remedy for check in nearest.checks if check.name == name)
    all_margins = [margins for _, margins in designs]
    return (
        f"{fault} passes every check{tolerances}. Of those that fill the ranges "
        f"{failing_words(all_margins)}. Nearest is {place}: {_words(name)} fails "
        f"by {100.0 * -margins[name]:.3g} %. Widen [variables], or {remedy}"
    )


def nearest_filling(study: Setup) -> list[tuple[Design, dict[str, float]]]:
    """List designs that fill the search ranges with their margins, the least shortfall first.

    Margins are those before a simulation; shapes that no dog can have are left out.
    """
    low, high = np.array(list(study.variables.values()), dtype=float).T
    designs = []
    for shares in sobol_shares(FILLING_DESIGNS, len(low), study.file.search.seed):
        design = design_of(study, study.params_of(low + shares * (high - low)))
        margins = {check.name: check.margin for check in design.checks}
        for name in WITHIN.keys() & margins.keys():  # the margins that it sums up say more
            del margins[name]
            margins |= design.margins_within(WITHIN[name])
        if margins:
            designs.append((design, margins))
    return sorted(designs, key=lambda pair: -min(pair[1].values()))


def _words(name: str) -> str:
    """Write the name of a check with blanks and without its unit."""
    return name.removesuffix(suffix_of(name)).replace("_", " ")
