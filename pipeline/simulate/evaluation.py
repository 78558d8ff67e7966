"""From a design to what is simulated of it: blocks out, expectation and measured checks back.

``docs/studies.md`` defines the simulated objectives (``ESTIMATORS``) and their errors. Forces are
those of the whole ring, means over one step of the integration, of rigid rings on the stiffness of
the dogs. A shift that does not engage counts with what it struck; one whose integration failed is
left out. Where all failed an objective is NaN: the design counts as not simulated. The smallest
margin has the landing's, an extreme, so its standard error is zero.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from dogshape.pipeline.config.operating import OPERATED
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.record import SHARE, Record, key
from dogshape.pipeline.simulate.design import (
    REFERRED,
    SIMULATED,
    Measured,
    objectives_of,
    simulated_limits,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.result_records import EngineAgreement
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import MESSAGES, Outcome
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.blocks import Block, even_blocks
from dogshape.sim.statistics.expectation import (
    Estimate,
    Expectation,
    expect,
    expect_point,
    mean_over,
    time_quantile,
)
from dogshape.sim.statistics.hangs import HangPrior
from dogshape.sim.statistics.shift_records import Record as Shift
from dogshape.sim.statistics.shift_records import (
    entries_by_angle,
    first_windows,
    landing_of,
    result_of,
)
from dogshape.sim.statistics.shiftability import direct_share
from dogshape.sim.strength.checks import Check, smallest_margin
from dogshape.sim.strength.dog_strength import strength_checks
from dogshape.sim.strength.landing import (
    Landings,
    Wear,
    demand_checks,
    worn,
)
from dogshape.sim.units import DEG, MM, RPM
from dogshape.surrogate.dataset import rows_of

Points = Sequence[OperatingPoint]
Rows = Sequence[Sequence[Shift]]  #: shifts by operating point


@dataclass(frozen=True)
class Shifts:
    """All shifts of a design by operating point."""

    study: Setup
    dog: Dog
    checks: tuple[Check, ...]
    expectation: Expectation
    rows: Rows

    def mean(self, value: Callable[[Shift], float]) -> Estimate:
        """Compute the mean over the mix of what each shift that did not fail has."""
        failed = Outcome.DIVERGED.value
        values = [[value(row) for row in mine if row["outcome"] != failed] for mine in self.rows]
        return mean_over([one.point.weight for one in self.expectation.points], values)


SURELY = 2.0  #: standard errors of a difference that count for a design


def _slower(expectation: Expectation, reference: Expectation | None) -> Estimate:
    """Compute the largest loss of an operating point that the shifts show for sure.

    The largest of many differences as they are would be that of their errors.
    """
    assert reference is not None  # ``evaluate`` simulates it for this
    losses = []
    for one, other in zip(expectation.points, reference.points, strict=True):
        errors = one.standard_error, other.standard_error  # not known of a few shifts
        error = math.hypot(*errors) if all(map(math.isfinite, errors)) else 0.0
        losses.append(Estimate(one.mean - other.mean - SURELY * error, error))
    return max(losses, key=lambda loss: loss.value)


def _first_try(shifts: Shifts) -> Estimate:
    within = shifts.study.file.search.within_s or shifts.study.clutch.timeout
    return shifts.mean(lambda row: float((row["shift_time_s"] or math.inf) <= within))


def _slowest(expectation: Expectation, _: Expectation | None) -> Estimate:
    slowest = max(expectation.points, key=lambda point: point.mean)
    return Estimate(slowest.mean, slowest.standard_error)


#: What each objective is worked out by that the prior of the probability of a hang changes.
TIME_ESTIMATORS: dict[str, Callable[[Expectation, Expectation | None], Estimate]] = {
    SIMULATED: lambda expectation, _: Estimate(expectation.mean, expectation.standard_error),
    "worst_shift_time_s": _slowest,
    REFERRED: _slower,
}

#: What each other simulated objective is worked out by.
ESTIMATORS: dict[str, Callable[[Shifts], Estimate]] = {
    "shift_time_quantile_s": lambda s: s.expectation.quantiles[s.study.file.search.quantile],
    "first_try_share": _first_try,
    "peak_axial_force_N": lambda shifts: shifts.mean(lambda row: row["peak_axial_force_N"]),
    "strike_torque_Nm": lambda shifts: shifts.mean(
        lambda row: shifts.dog.mean_radius * row["peak_tangential_force_N"]
    ),
    "impact_impulse_Ns": lambda shifts: shifts.mean(lambda row: row["impact_impulse_Ns"]),
    "impact_energy_J": lambda shifts: shifts.mean(lambda row: row["energy_dissipated_J"]),
    "peak_impact_force_N": lambda shifts: shifts.mean(
        lambda row: math.hypot(row["peak_axial_force_N"], row["peak_tangential_force_N"])
    ),
    "smallest_margin": lambda shifts: Estimate(smallest_margin(shifts.checks).margin, 0.0),
}


def estimated(study: Setup) -> list[str]:
    """Return the names of what the shifts of a design are to say, each once."""
    named = [objective.name for objective in objectives_of(study) if objective.simulated]
    return list(dict.fromkeys([SIMULATED, *named, *simulated_limits(study)]))


NEW_ANGLES = 7919  #: added to the seed of the search for relative angles that it did not use

Params = dict[str, float]  #: searched keys of a design, edge units


@dataclass(frozen=True)
class Simulated:
    """Expectation and loads from the shifts of a design.

    ``failed`` shifts are by reason, ``agreement`` is with Drake where it simulated some too.
    """

    expectation: Expectation
    measured: Measured
    rows: Array
    estimates: dict[str, Estimate]
    shifts: int
    failed: Mapping[str, int] = field(default_factory=dict)
    agreement: EngineAgreement | None = None
    reference: Expectation | None = None  #: of the study's own dog, where an objective asks for it

    def under(self, priors: Sequence[HangPrior]) -> Simulated:
        """Return the same by other priors of the probability of a hang, one for each point."""
        expectation = self.expectation.under(priors)
        reference = self.reference and self.reference.under(priors)
        times = time_estimates(self.estimates, expectation, reference)
        return replace(
            self,
            expectation=expectation,
            reference=reference,
            estimates=self.estimates | times,
            measured=limited_by(self.measured, times),
        )

    @property
    def known(self) -> bool:
        """Whether the shifts say every simulated objective: not where all of them failed."""
        return all(math.isfinite(estimate.value) for estimate in self.estimates.values())


def time_estimates(
    names: Iterable[str], expectation: Expectation, reference: Expectation | None
) -> dict[str, Estimate]:
    """Estimate those of the named objectives that depend on the probability of a hang."""
    pairs = ((name, TIME_ESTIMATORS.get(name)) for name in names)
    return {name: estimator(expectation, reference) for name, estimator in pairs if estimator}


def limited_by(measured: Measured, estimates: Mapping[str, Estimate]) -> Measured:
    """Replace the values that limits judge by those of estimates."""
    limited = {
        name: estimates[name].value if name in estimates else value
        for name, value in measured.limited.items()
    }
    return replace(measured, limited=limited)


def design_blocks(
    study: Setup, params: Params, angles: int, seed: int, base: int | None = None
) -> list[Block]:
    """Return the shifts of a design at even angles, a block for each of its operating points.

    ``base`` as for ``even_phases``.
    """
    own, clutch = study.with_operation(params), replace(study.clutch, dog=study.dog_with(params))
    return even_blocks(clutch, own.points, angles, seed, base, uncertainty=study.uncertainty)


def reference_blocks(study: Setup, angles: int, seed: int) -> list[Block]:
    """Return the shifts of the study's own dog; none where no objective or limit refers to it."""
    if REFERRED not in estimated(study):
        return []
    return _reference(study.clutch, study.points, angles, seed, uncertainty=study.uncertainty)


_reference = lru_cache(maxsize=2)(even_blocks)  # all rounds have it, with its keys


def forget_designs(study: Setup, executor: Executor, angles: int, seed: int) -> None:
    """Drop the shifts of designs, but those of the reference, which others are compared with."""
    executor.forget({key for block in reference_blocks(study, angles, seed) for key in block.keys})


def evaluate(
    study: Setup, designs: Sequence[Params], executor: Executor, angles: int, seed: int
) -> list[Simulated]:
    """Simulate designs side by side, ``angles`` at every operating point, and evaluate them."""
    groups = [design_blocks(study, params, angles, seed) for params in designs]
    referred = reference_blocks(study, angles, seed)
    rows = iter(executor.run([block for group in (*groups, referred) for block in group]))
    found = [list(islice(rows, len(group))) for group in groups]
    beside = expectation_of(study, study.points, list(rows)) if referred else None
    pairs = zip(designs, found, strict=True)
    return [_simulated(study, params, mine, beside) for params, mine in pairs]


def _simulated(nominal: Setup, params: Params, rows: Rows, beside: Expectation | None) -> Simulated:
    study, dog = nominal.with_operation(params), nominal.dog_with(params)
    expectation = expectation_of(study, study.points, rows, dog=dog)
    landings = landings_over(expectation, rows)
    demand = landings.demand(dog, study.limits)
    checks = strength_checks(dog, study.limits) + demand_checks(demand, study.limits)
    simulated = Shifts(study, dog, checks, expectation, rows)
    names = estimated(study)
    estimates = {name: ESTIMATORS[name](simulated) for name in names if name in ESTIMATORS}
    estimates |= time_estimates(names, expectation, beside)
    estimates = {name: estimates[name] for name in names}
    # Shifts whose integration failed say nothing of engagement.
    share = min((p.timed for p in expectation.points if p.n), default=1.0)
    shifts = [shift for mine in rows for shift in mine]
    limited = {k: estimates[k].value for k in simulated_limits(study)}
    measured = Measured(demand, limited, share, landings)
    x = rows_of(tuple(study.variables), _as_searched(nominal, study.operation, rows))
    failed = failures(shifts)
    return Simulated(expectation, measured, x, estimates, len(shifts), failed, reference=beside)


def failures(shifts: Iterable[Shift]) -> dict[str, int]:
    """Count the shifts whose integration failed, by the reason; they have no time."""
    failed = [row for row in shifts if row["outcome"] == Outcome.DIVERGED.value]
    reasons = (str(row.get("reason", MESSAGES[Outcome.DIVERGED])) for row in failed)
    return dict(Counter(reason.partition(", at ")[0] for reason in reasons))


def _as_searched(study: Setup, operation: Mapping[str, float], rows: Rows) -> list[Shift]:
    """Rewrite shifts as the search sees them: operation is a variable, points are the study's."""
    known = {**study.prototype, **operation}
    own = {key: known[key] for key in study.variables if key in OPERATED}
    return [
        {**shift, "mismatch_rpm": point.mismatch / RPM, **point.profile.record, **own}
        for point, mine in zip(study.points, rows, strict=True)
        for shift in mine
    ]


def landings_over(expectation: Expectation, rows: Rows) -> Landings:
    """Collect the landings of shifts by operating point, with their weights."""
    loads = [landing_of(row) for mine in rows for row in mine]
    pairs = zip(expectation.points, rows, strict=True)
    weights = [found.point.weight / len(mine) for found, mine in pairs for _ in mine]
    return Landings(np.array(loads), np.array(weights))


def expectation_of(
    study: Setup, points: Points, rows: Rows, even: bool = True, dog: Dog | None = None
) -> Expectation:
    """Return the expectation over points from the records of each, with its quantiles.

    ``dog`` is that of the shifts, by default the study's own.
    """
    clutch = replace(study.clutch, dog=dog or study.clutch.dog)
    lost, found, shifts = (study.clutch.timeout, study.retraction), [], []
    for point, mine in zip(points, rows, strict=True):
        shifts.append(study.set_point.freed([result_of(row) for row in mine]))
        one = expect_point(point, shifts[-1], *lost, even=even)
        found.append(
            replace(
                one,
                by_angle=entries_by_angle(mine),
                first_window=first_windows(mine),
                direct_share=direct_share(clutch, point),
            )
        )
    weights, levels = [point.weight for point in points], (study.file.search.quantile, RARE)
    quantiles = {share: time_quantile(weights, shifts, share, *lost) for share in levels}
    first_window = study.file.expectation.first_window_share
    return replace(expect(found), quantiles=quantiles, first_window_share=first_window)


RARE = 0.999  #: of the shifts over a life, the quantile beside that of ``search.quantile``
FIRST = 6  #: angles of the first round
ENOUGH = 24  #: shifts from which a standard error is believed
MOST = 96  #: angles of the last round


def expect_to(
    study: Setup, points: Points, precision: float, executor: Executor, progress: WorkCounter
) -> tuple[Expectation, list[Block], list[list[Shift]]]:
    """Double the even angles until the expectation over points has a relative standard error.

    The last round is returned, with its shifts; at the most angles it may be less precise.
    """
    count, seed, unsure = FIRST, study.file.expectation.seed, study.uncertainty
    while True:
        blocks = even_blocks(study.clutch, points, count, seed, FIRST, uncertainty=unsure)
        rows = executor.run(blocks)
        found = expectation_of(study, points, rows)
        share, shifts = found.relative_error, len(points) * count
        silent = any(p.mean_engaged is None for p in found.points)
        late = share > precision and count >= MOST
        if silent:
            progress.say("nothing engages at some operating point: no precision can be reached")
        if silent or late or (share <= precision and shifts >= ENOUGH):
            return found, blocks, rows
        few = ", from too few to trust" if share <= precision else ""
        progress.say(f"error {100 * share:.2g} % from {shifts} shifts{few}; twice the angles")
        count *= 2
        progress.rest(shifts)


STAGES = (0.0, 0.5, 1.0)  #: shares of the life


class LifeStage(Record):
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


def life_of(
    study: Setup,
    params: Params,
    wear: Wear,
    executor: Executor,
    priors: Sequence[HangPrior] | None = None,
) -> list[LifeStage]:
    """Simulate a design over its life, at each of ``STAGES`` and at new angles.

    ``priors`` are those of hangs by operating point.
    Wear by a rate follows the energy of the stage before. GeometryError where no worn dog can be.
    """
    own, new = study.with_operation(params), study.dog_with(dict(params))
    settings, unsure = study.file.expectation, study.uncertainty
    loss, found = 0.0, list[LifeStage]()
    for stage in STAGES:
        if found:
            friction = study.clutch.contact.dynamic_friction
            shifts = (stage - found[-1].life) * study.limits.load.shifts
            loss += wear.loss(worn(new, loss), found[-1].energy_J, friction, shifts)
        if wear.crest_loss is not None:
            loss = stage * wear.crest_loss
        dog = replace(worn(new, loss) if loss else new, edge_radius=wear.edges(new, stage))
        clutch, seed = replace(own.clutch, dog=dog), settings.seed + NEW_ANGLES
        blocks = even_blocks(clutch, own.points, settings.angles, seed, uncertainty=unsure)
        rows = executor.run(blocks)
        expectation = expectation_of(own, own.points, rows, dog=dog)
        if priors:
            expectation = expectation.under(priors)
        demand = landings_over(expectation, rows).demand(dog, own.limits)
        checks = (*life_checks(own, new, dog), *demand_checks(demand, own.limits))
        weakest = smallest_margin(checks)
        energy = ESTIMATORS["impact_energy_J"](Shifts(own, dog, checks, expectation, rows))
        found.append(
            LifeStage(
                life=stage,
                crest_loss_mm=loss / MM,
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
    return found


def life_checks(study: Setup, new: Dog, dog: Dog) -> tuple[Check, ...]:
    """Return the closed-form checks of a worn ``dog`` that was ``new``, without manufacture.

    A load counts as the worse of worn and new, and contact is a share of the new height.
    """
    fresh = {check.name: check for check in strength_checks(new, study.limits)}
    found = []
    for check in strength_checks(dog, study.limits):
        if check.rule.group == "load":
            found.append(min(check, fresh[check.name], key=lambda one: one.margin))
        elif check.name == "contact_ratio":
            found.append(replace(check, value=check.value * dog.height / new.height))
        elif check.rule.group != "make":
            found.append(check)
    return tuple(found)
