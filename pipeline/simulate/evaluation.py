"""Evaluation of designs by simulation: blocks of shifts, expectation, objectives and checks.

``docs/studies.md`` defines the simulated objectives (``ESTIMATORS``) and their errors. A force acts
on the whole ring and is a mean over one integration step; rings are rigid, dogs have a stiffness.
The loads of a shift that does not engage count; a shift whose integration failed is left out.
Where the integration of all shifts failed an objective is NaN, and the design counts as not
simulated. The smallest margin includes that of the landing, an extreme value without a standard
error; its own is set to zero.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.record import SHARE, Record
from dogshape.pipeline.simulate.design import (
    REFERRED,
    SIMULATED,
    CheckInputs,
    objectives_of,
    simulated_limits,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.result_records import EngineAgreement
from dogshape.sim.clutch_tables import key
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import MESSAGES, Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import (
    Estimate,
    MixExpectation,
    PointExpectation,
    expect,
    expect_point,
    mean_over,
    share_over,
    time_quantile,
)
from dogshape.sim.statistics.hangs import HangPrior
from dogshape.sim.statistics.shift_records import Record as ShiftRecord
from dogshape.sim.statistics.shift_records import (
    ShiftLoads,
    diverged,
    entries_by_angle,
    first_windows,
    landing_of,
    loads_of,
    result_of,
)
from dogshape.sim.statistics.shiftability import direct_share
from dogshape.sim.strength.checks import LimitCheck, smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import (
    Landings,
    Wear,
    demand_checks,
    wear_crests,
)
from dogshape.sim.units import DEG, MM, RPM
from dogshape.surrogate.dataset import rows_of

Points = Sequence[OperatingPoint]
ShiftsByPoint = Sequence[Sequence[ShiftRecord]]  #: records of shifts by operating point


@dataclass(frozen=True)
class DesignShifts:
    """All shifts of a design by operating point."""

    study: Setup
    dog: Dog
    checks: tuple[LimitCheck, ...]
    expectation: MixExpectation
    records: ShiftsByPoint

    def mean_load(self, value: Callable[[ShiftLoads], float]) -> Estimate:
        """Compute the mean of a load over the mix of points, without failed integrations."""
        values = []
        for shifts in self.records:
            values.append([value(loads_of(shift)) for shift in shifts if not diverged(shift)])
        return mean_over([point.point.weight for point in self.expectation.points], values)

    @property
    def impact_energy(self) -> Estimate:
        """Mean energy that a shift dissipates in the contact, J."""
        return self.mean_load(lambda loads: loads.energy_dissipated_J)


LOSS_SIGMAS = 2.0  #: standard errors subtracted from a loss of time, in the design's favour


def _largest_loss(expectation: MixExpectation, reference: MixExpectation | None) -> Estimate:
    """Estimate the largest loss of time against the reference at an operating point, s.

    Each loss is reduced by its error: otherwise the largest of many differences would be the
    largest of their errors.
    """
    assert reference is not None  # ``evaluate`` simulates it for this
    losses = []
    for point, reference_point in zip(expectation.points, reference.points, strict=True):
        errors = (point.standard_error, reference_point.standard_error)
        is_defined = all(map(math.isfinite, errors))  # NaN from too few shifts
        error = math.hypot(*errors) if is_defined else 0.0
        loss = point.mean - reference_point.mean - LOSS_SIGMAS * error
        losses.append(Estimate(loss, error))
    return max(losses, key=lambda loss: loss.value)


def _first_try_share(design: DesignShifts) -> Estimate:
    """Estimate the share of shifts that engage within the limit at the first try.

    The posterior of ``share_over`` takes the counts of the shifts that do not.
    """
    limit = design.study.file.search.within_s or design.study.clutch.timeout
    counts = []
    for shifts in design.records:
        sound_shifts = [shift for shift in shifts if not diverged(shift)]
        times = [result_of(shift).shift_time or math.inf for shift in sound_shifts]
        late_count = sum(time > limit for time in times)
        counts.append((late_count, len(sound_shifts)))
    weights = [point.point.weight for point in design.expectation.points]
    return share_over(weights, counts)


def _slowest_time(expectation: MixExpectation, _: MixExpectation | None) -> Estimate:
    """Estimate the time at the slowest operating point, s."""
    slowest = max(expectation.points, key=lambda point: point.mean)
    return Estimate(slowest.mean, slowest.standard_error)


#: Estimators of the objectives that depend on the prior of the probability of a hang.
TIME_ESTIMATORS: dict[str, Callable[[MixExpectation, MixExpectation | None], Estimate]] = {
    SIMULATED: lambda expectation, _: Estimate(expectation.mean, expectation.standard_error),
    "worst_shift_time_s": _slowest_time,
    REFERRED: _largest_loss,
}

#: Estimators of the other simulated objectives.
ESTIMATORS: dict[str, Callable[[DesignShifts], Estimate]] = {
    "shift_time_quantile_s": lambda shifts: shifts.expectation.quantiles[
        shifts.study.file.search.quantile
    ],
    "first_try_share": _first_try_share,
    "peak_axial_force_N": lambda shifts: shifts.mean_load(lambda loads: loads.peak_axial_force_N),
    "strike_torque_Nm": lambda shifts: shifts.mean_load(
        lambda loads: shifts.dog.mean_radius * loads.peak_tangential_force_N
    ),
    "impact_impulse_Ns": lambda shifts: shifts.mean_load(lambda loads: loads.impact_impulse_Ns),
    "impact_energy_J": lambda shifts: shifts.impact_energy,
    "peak_impact_force_N": lambda shifts: shifts.mean_load(
        lambda loads: math.hypot(loads.peak_axial_force_N, loads.peak_tangential_force_N)
    ),
    "smallest_margin": lambda shifts: Estimate(smallest_margin(shifts.checks).margin, 0.0),
}


def estimated_quantities(study: Setup) -> list[str]:
    """List the quantities to estimate from a design's shifts."""
    objectives = [objective.name for objective in objectives_of(study) if objective.simulated]
    return list(dict.fromkeys([SIMULATED, *objectives, *simulated_limits(study)]))


NEW_ANGLES = 7919  #: added to the seed of the search for relative angles that it did not use

Params = dict[str, float]  #: searched keys of a design, edge units


@dataclass(frozen=True)
class Evaluation:
    """Expectation and loads from the shifts of a design."""

    expectation: MixExpectation
    check_inputs: CheckInputs
    rows: Array  #: data for the surrogate, a row for each operating point
    estimates: dict[str, Estimate]  #: by the names of ``estimated_quantities``
    shifts: int  #: number of shifts
    failed: Mapping[str, int] = field(default_factory=dict)  #: failed integrations by reason
    agreement: EngineAgreement | None = None  #: with Drake, where it repeated some shifts
    reference: MixExpectation | None = None  #: of the study's own dog, where an objective needs it

    def replace_priors(self, priors: Sequence[HangPrior]) -> Evaluation:
        """Replace the priors of the probability of a hang, one for each operating point."""
        expectation = self.expectation.replace_priors(priors)
        reference = self.reference and self.reference.replace_priors(priors)
        times = time_estimates(self.estimates, expectation, reference)
        return replace(
            self,
            expectation=expectation,
            reference=reference,
            estimates=self.estimates | times,
            check_inputs=replace(
                replace_limited(self.check_inputs, times), worst_hang=expectation.worst_hang
            ),
        )

    @property
    def is_complete(self) -> bool:
        """Whether every estimate is finite; none is where all shifts failed."""
        return all(math.isfinite(estimate.value) for estimate in self.estimates.values())


def time_estimates(
    names: Iterable[str], expectation: MixExpectation, reference: MixExpectation | None
) -> dict[str, Estimate]:
    """Estimate the named objectives of ``TIME_ESTIMATORS``; others are ignored."""
    return {
        name: TIME_ESTIMATORS[name](expectation, reference)
        for name in names
        if name in TIME_ESTIMATORS
    }


def replace_limited(check_inputs: CheckInputs, estimates: Mapping[str, Estimate]) -> CheckInputs:
    """Replace the values of quantities with a limit by new estimates."""
    limited = {
        name: estimates[name].value if name in estimates else value
        for name, value in check_inputs.limited.items()
    }
    return replace(check_inputs, limited=limited)


class OperatedDesign(NamedTuple):
    """Dog of a design, and the study with the operating points of that design."""

    study: Setup  #: with the design's values of searched keys of the operation
    dog: Dog

    @classmethod
    def of(cls, study: Setup, params: Params) -> OperatedDesign:
        """Build the operation and the dog of a design; GeometryError for an impossible shape."""
        return cls(study.with_design(params), study.dog_with(params))

    def blocks(self, angles: int, seed: int, base: int | None = None) -> list[Block]:
        """Build the shifts at even angles, a block for each operating point.

        The angles include those of the same draw of ``base`` angles.
        """
        study = self.study
        clutch = replace(study.clutch, dog=self.dog)
        return even_blocks(clutch, study.points, angles, seed, base, uncertainty=study.uncertainty)


def reference_blocks(study: Setup, angles: int, seed: int) -> list[Block]:
    """Build the shifts of the study's own dog, the reference; [] if no objective needs it."""
    if REFERRED not in estimated_quantities(study):
        return []
    return _cached_even_blocks(
        study.clutch, study.points, angles, seed, uncertainty=study.uncertainty
    )


_cached_even_blocks = lru_cache(maxsize=2)(even_blocks)  # all rounds have the same reference


def drop_design_shifts(study: Setup, executor: Executor, angles: int, seed: int) -> None:
    """Drop the shifts of all designs from the journal; shifts of the reference stay."""
    reference_keys = set()
    for block in reference_blocks(study, angles, seed):
        reference_keys.update(block.keys)
    executor.drop_shifts(kept_keys=reference_keys)


def evaluate(
    study: Setup, designs: Sequence[Params], executor: Executor, angles: int, seed: int
) -> list[Evaluation]:
    """Simulate designs at ``angles`` even angles of every operating point, and evaluate them."""
    operated = [OperatedDesign.of(study, params) for params in designs]
    design_groups = [design.blocks(angles, seed) for design in operated]
    reference_group = reference_blocks(study, angles, seed)
    blocks = list(chain(*design_groups, reference_group))
    block_records = iter(executor.run(blocks))
    design_records = [list(islice(block_records, len(group))) for group in design_groups]
    reference_records = list(block_records)
    reference = None
    if reference_records:
        reference = expectation_of(study, study.points, reference_records)
    return [
        _evaluation(study, design, records, reference)
        for design, records in zip(operated, design_records, strict=True)
    ]


def _evaluation(
    nominal: Setup,
    design: OperatedDesign,
    records: ShiftsByPoint,
    reference: MixExpectation | None,
) -> Evaluation:
    """Evaluate the shifts of a design; ``nominal`` is the study with its own operating points."""
    study, dog = design
    expectation = expectation_of(study, study.points, records, dog=dog)
    landings = landings_over(expectation, records)
    demand = landings.demand(dog, study.limits)
    checks = strength_checks(dog, study.limits) + demand_checks(dog, demand, study.limits)
    design_shifts = DesignShifts(study, dog, checks, expectation, records)
    names = estimated_quantities(study)
    estimates = {name: ESTIMATORS[name](design_shifts) for name in names if name in ESTIMATORS}
    estimates |= time_estimates(names, expectation, reference)
    estimates = {name: estimates[name] for name in names}
    # A point where all integrations failed (``n`` = 0) has no share of engagement.
    engaged_share = min(
        (point.first_try_share for point in expectation.points if point.n), default=1.0
    )
    limited = {name: estimates[name].value for name in simulated_limits(study)}
    shifts = list(chain(*records))
    searched_shifts = _searched_records(nominal, study.operation, records)
    return Evaluation(
        expectation=expectation,
        check_inputs=CheckInputs(
            demand,
            limited,
            engaged_share,
            landings=landings,
            worst_hang=expectation.worst_hang,
        ),
        rows=rows_of(tuple(study.variables), searched_shifts),
        estimates=estimates,
        shifts=len(shifts),
        failed=failures(shifts),
        reference=reference,
    )


def failures(shifts: Iterable[ShiftRecord]) -> dict[str, int]:
    """Count the shifts whose integration failed, by reason without the time of the failure."""
    failed_shifts = [shift for shift in shifts if diverged(shift)]
    sentences = (str(shift.get("reason", MESSAGES[Outcome.DIVERGED])) for shift in failed_shifts)
    return dict(Counter(sentence.partition(", at ")[0] for sentence in sentences))


def _searched_records(
    study: Setup, operation: Mapping[str, float], records: ShiftsByPoint
) -> list[ShiftRecord]:
    """Describe shifts by the study's operating points and the searched keys of the operation.

    The surrogate has these keys as variables and takes the same points for all designs.
    """
    values = {**study.prototype, **operation}
    operation_keys = {key: values[key] for key in study.variables if key in OPERATED}
    searched_records = []
    for point, shifts in zip(study.points, records, strict=True):
        point_keys = {"mismatch_rpm": point.mismatch / RPM, **point.profile.record}
        searched_records += [{**shift, **point_keys, **operation_keys} for shift in shifts]
    return searched_records


def landings_over(expectation: MixExpectation, records: ShiftsByPoint) -> Landings:
    """Collect the landings of shifts by operating point, with their weights."""
    loads = [landing_of(shift) for shift in chain(*records)]
    weights = list[float]()
    for point, shifts in zip(expectation.points, records, strict=True):
        weights += [point.point.weight / len(shifts)] * len(shifts)
    return Landings(np.array(loads), np.array(weights))


RARE_SHARE = 0.999  #: of the shifts over a life, the quantile besides ``search.quantile``


def expectation_of(
    study: Setup, points: Points, records: ShiftsByPoint, even: bool = True, dog: Dog | None = None
) -> MixExpectation:
    """Compute the expectation over points, with quantiles, from the records of each.

    ``even`` is whether the angles are even; ``dog`` is that of the shifts, by default the study's.
    """
    clutch = replace(study.clutch, dog=dog or study.clutch.dog)
    timeout = study.clutch.timeout
    retraction = study.retraction
    point_shifts = []
    point_expectations = []
    for point, point_records in zip(points, records, strict=True):
        results = [result_of(record) for record in point_records]
        shifts = study.set_point.free_blocked(results)
        point_shifts.append(shifts)
        point_expectations.append(
            replace(
                expect_point(point, shifts, timeout, retraction, even=even),
                by_angle=entries_by_angle(point_records),
                first_window=first_windows(point_records),
                direct_share=direct_share(clutch, point),
            )
        )
    weights = [point.weight for point in points]
    quantiles = {
        share: time_quantile(weights, point_shifts, share, timeout, retraction)
        for share in (study.file.search.quantile, RARE_SHARE)
    }
    return replace(
        expect(point_expectations),
        quantiles=quantiles,
        first_window_share=study.file.expectation.first_window_share,
    )


def with_torques(
    study: Setup,
    expectation: MixExpectation,
    blocks: Sequence[Block],
    run: Callable[[Sequence[Block]], ShiftsByPoint],
) -> MixExpectation:
    """Add expectations under each torque of the study's ``expectation.limit_torques_Nm``.

    ``blocks`` are the shifts of ``expectation``, which ``run`` simulates again under each torque.
    """
    settings = study.file.expectation
    dog = blocks[0].clutch.dog
    operating_points = [point.point for point in expectation.points]
    by_torque: dict[float, tuple[PointExpectation, ...]] = {}
    for torque in settings.limit_torques_Nm or ():
        loaded_blocks = [
            replace(block, clutch=block.clutch.loaded(settings.limit_torque_side, torque))
            for block in blocks
        ]
        records = run(loaded_blocks)
        by_torque[torque] = expectation_of(study, operating_points, records, dog=dog).points
    return replace(expectation, by_torque=by_torque)


FIRST_ANGLES = 6  #: angles of the first round
MIN_SHIFTS = 24  #: shifts from which a standard error counts
MAX_ANGLES = 96  #: angles of the last round


def expect_to_precision(
    study: Setup, points: Points, precision: float, executor: Executor, progress: WorkCounter
) -> tuple[MixExpectation, list[Block], list[list[ShiftRecord]]]:
    """Double the even angles until the relative standard error is at most ``precision``.

    Returns the expectation over points, blocks and records of the last round. A round with
    ``MAX_ANGLES`` is the last one, precise or not.
    """
    angles = FIRST_ANGLES
    seed = study.file.expectation.seed
    while True:
        blocks = even_blocks(
            study.clutch, points, angles, seed, FIRST_ANGLES, uncertainty=study.uncertainty
        )
        records = executor.run(blocks)
        expectation = expectation_of(study, points, records)
        error = expectation.relative_error
        shift_count = len(points) * angles
        is_precise = error <= precision
        never_engages = any(point.unaided_mean is None for point in expectation.points)
        is_last = not is_precise and angles >= MAX_ANGLES
        if never_engages:
            progress.say("nothing engages at some operating point: no precision can be reached")
        if never_engages or is_last or (is_precise and shift_count >= MIN_SHIFTS):
            return expectation, blocks, records
        doubt = ", from too few to trust" if is_precise else ""
        progress.say(
            f"error {100 * error:.2g} % from {shift_count} shifts{doubt}; twice the angles"
        )
        angles *= 2
        progress.expect_more(shift_count)


STAGES = (0.0, 0.5, 1.0)  #: shares of the life


class LifeStage(Record):
    """The chosen design at a share of its life."""

    life: float = key("share of the life", SHARE)
    crest_loss_mm: float = key("height that the crest has lost", "mm")
    edge_radius_mm: float = key("radius of its edges; 0 is sharp", "mm", 0.0)
    chamfer_deg: float = key("remaining chamfer", "deg")
    expected_shift_time_s: float = key("mean shift time over the operating points", "s")
    standard_error_s: float | None = key("its standard error", "s")
    engaged: float = key("share of the shifts that engaged", SHARE)
    energy_J: float = key("mean energy that the contact takes in a shift", "J")
    smallest_margin: float = key("smallest margin, manufacture left out", "1")
    weakest_check: str = key("check with the smallest margin")
    margins: dict[str, float] = key("margin of each check", "1")


def life_of(
    study: Setup,
    params: Params,
    wear: Wear,
    executor: Executor,
    priors: Sequence[HangPrior] | None = None,
) -> list[LifeStage]:
    """Simulate a design over its life, at each of ``STAGES`` and at new angles.

    With a wear rate, the loss of crest up to a stage follows from the energy of the stage before.

    Parameters
    ----------
    study, params, wear
        Study, searched keys of the design, and wear model.
    executor
        Executor of the shifts.
    priors
        Priors of the probability of a hang, one for each operating point.

    Raises
    ------
    GeometryError
        For a worn dog that is impossible.

    """
    design_study = study.with_design(params)
    new_dog = study.dog_with(dict(params))
    stages = list[LifeStage]()
    crest_loss = 0.0
    for life in STAGES:
        if wear.crest_loss is not None:
            crest_loss = life * wear.crest_loss
        elif stages:
            crest_loss += _loss_since(
                stages[-1], life, wear, dog=wear_crests(new_dog, crest_loss), study=study
            )
        dog = wear_crests(new_dog, crest_loss) if crest_loss else new_dog
        dog = replace(dog, edge_radius=wear.edge_radius_at(new_dog, life))
        expectation, records = _expect_worn(design_study, dog, executor, priors)
        demand = landings_over(expectation, records).demand(dog, design_study.limits)
        checks = (
            *life_checks(design_study, new_dog, dog),
            *demand_checks(dog, demand, design_study.limits),
        )
        weakest = smallest_margin(checks)
        design_shifts = DesignShifts(design_study, dog, checks, expectation, records)
        energy = design_shifts.impact_energy
        stages.append(
            LifeStage(
                life=life,
                crest_loss_mm=crest_loss / MM,
                edge_radius_mm=dog.edge_radius / MM,
                chamfer_deg=dog.chamfer / DEG,
                expected_shift_time_s=expectation.mean,
                standard_error_s=expectation.standard_error,
                engaged=expectation.engaged,
                energy_J=energy.value,
                smallest_margin=weakest.margin,
                weakest_check=weakest.name,
                margins={check.name: check.margin for check in checks},
            )
        )
    return stages


def _loss_since(stage: LifeStage, life: float, wear: Wear, *, dog: Dog, study: Setup) -> float:
    """Compute the height that the crest of a worn dog loses from a stage to ``life``, m."""
    friction = study.clutch.contact.face_dynamic_friction
    shift_count = (life - stage.life) * study.limits.load.shifts
    return wear.loss(dog, stage.energy_J, friction, shift_count)


def _expect_worn(
    study: Setup, dog: Dog, executor: Executor, priors: Sequence[HangPrior] | None
) -> tuple[MixExpectation, list[list[ShiftRecord]]]:
    """Simulate a worn dog at new angles; return its expectation and records."""
    settings = study.file.expectation
    clutch = replace(study.clutch, dog=dog)
    blocks = even_blocks(
        clutch,
        study.points,
        settings.angles,
        settings.seed + NEW_ANGLES,
        uncertainty=study.uncertainty,
    )
    records = executor.run(blocks)
    expectation = expectation_of(study, study.points, records, dog=dog)
    if priors:
        expectation = expectation.replace_priors(priors)
    return expectation, records


def life_checks(study: Setup, new_dog: Dog, dog: Dog) -> tuple[LimitCheck, ...]:
    """Compute the closed-form checks of a worn dog, without checks of manufacture.

    A check of load takes the smaller margin of the worn and the new dog; the contact ratio refers
    to the height of the new dog.
    """
    new_checks = {check.name: check for check in strength_checks(new_dog, study.limits)}
    checks = []
    for check in strength_checks(dog, study.limits):
        if check.rule.group == "load":
            checks.append(min(check, new_checks[check.name], key=lambda check: check.margin))
        elif check.name == "contact_ratio":
            checks.append(replace(check, value=check.value * dog.height / new_dog.height))
        elif check.rule.group != "make":
            checks.append(check)
    return tuple(checks)
