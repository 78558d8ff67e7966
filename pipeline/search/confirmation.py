"""Confirmation: designs of the front, simulated again at every operating point and at new angles.

A search picks designs that were also lucky, and more angles find harder landings. So values and
checks of prototype and front are those of ``ANGLE_FACTOR`` times as many new angles. Drake
simulates some of them too; a design on which both engines do not agree leaves the front, as does
one that fails a check or is beaten. Those that come onto it are confirmed next, up to
``search.confirm_designs``, and the study's own dog is confirmed as they are.

The prior of hangs is fitted to all designs of search and confirmation. Where the posterior of hangs
decides between the best design and others, these get more angles (``HangAngles``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.search.engine_audit import agreement_of, pair_shifts
from dogshape.pipeline.search.state import PointTimes, SearchState, Trial
from dogshape.pipeline.search.study_record import (
    Confirmation,
    ConfirmedDesign,
    ObjectiveEstimate,
    OtherShape,
)
from dogshape.pipeline.simulate.design import (
    OBJECTIVES,
    SIMULATED,
    design_of,
    judge_design,
    leading_objective,
    objectives_of,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import (
    NEW_ANGLES,
    Evaluation,
    OperatedDesign,
    Params,
    drop_design_shifts,
    evaluate,
    expectation_of,
    with_torques,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.check_records import CheckRow, VerdictRow
from dogshape.pipeline.store.result_records import ExpectedTime, HangPriorRow
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.shift.pair import OUTPUT_PREFIX
from dogshape.sim.statistics.blocks import Block, numerical_error, repeat_count
from dogshape.sim.statistics.expectation import MixExpectation
from dogshape.sim.statistics.hangs import pool
from dogshape.sim.units import DEG, MM

ANGLE_FACTOR = 2  #: new angles of the compiled engine over those of the search
MAX_DEVIATION_SIGMAS = 3.0  #: standard errors within which search and new angles agree
Estimates = dict[str, ObjectiveEstimate]  #: of simulated objectives, by name
Evaluations = Mapping[int, Evaluation]  #: designs at new angles, by trial


@dataclass(frozen=True)
class Executors:
    """Executors of compiled shifts that no result needs later, and of stored shifts."""

    search: Executor
    kept: Executor


CLEAR_SIGMAS = 2.0  #: standard errors of a difference of designs from which it is clear


@dataclass(frozen=True)
class HangAngles:
    """Added angles for designs between which the posterior of hangs decides; status: judged.

    Each round doubles the angles of the best design and its nearest rivals, at the operating points
    that make most of the variance of their retries.
    """

    doublings: int = 3
    rivals: int = 4
    variance_share: float = 0.9  #: of the retries' variance that the chosen points make

    def rounds(self, angles: int) -> list[int]:
        """List the number of angles of each round; ``angles`` is that of the confirmation."""
        return [angles * 2**k for k in range(1, self.doublings + 1)]


HANG_ANGLES = HangAngles()
NEAREST = 5  #: designs that are simulated where none passes, beside the study's own dog
ADDED_BACKLASH_MM = 0.1  #: backlash that a confirmation adds to the chosen design


def new_angles(study: Setup) -> int:
    """Count the new angles of each operating point: a multiple of ``search.confirm_angles``."""
    drake_angles = study.file.search.confirm_angles
    if study.clutch.solver.engine == "drake":
        return drake_angles
    wanted_angles = ANGLE_FACTOR * study.file.expectation.angles
    return drake_angles * math.ceil(wanted_angles / drake_angles)


def hang_rounds(study: Setup) -> list[int]:
    """List the angles of each round for hangs; none in Drake, where a shift takes a second."""
    if study.clutch.solver.engine == "drake":
        return []
    return HANG_ANGLES.rounds(new_angles(study))


def shifts_to_confirm(study: Setup) -> int:
    """Count the shifts of a confirmation, at most, with the numerical errors."""
    drake_angles = study.file.search.confirm_angles
    angles = new_angles(study)
    point_count = len(study.points)
    angles_of_engines = angles if angles == drake_angles else angles + drake_angles
    design_count = 2 + study.file.search.confirm_designs
    design_shifts = design_count * point_count * angles_of_engines
    hang_shifts = (1 + HANG_ANGLES.rivals) * point_count * sum(hang_rounds(study))
    torque_count = len(study.file.expectation.limit_torques_Nm or ())
    torque_shifts = 2 * torque_count * point_count * angles
    error_shifts = 2 * repeat_count(point_count * drake_angles)
    return design_shifts + hang_shifts + torque_shifts + error_shifts


def confirm(
    searched: SearchState, executors: Executors, say: Say
) -> tuple[Confirmation | None, SearchState]:
    """Simulate prototype and front of an ended search at angles that it did not use.

    Returns the confirmation, None where no design passes every check, and the state at the new
    angles.
    """
    study = searched.study
    prototype_trial = _prototype_trial(searched)
    if not searched.front:
        return None, searched
    say("confirming the prototype at new angles")
    (prototype,) = _simulate_anew(study, {"the prototype": study.prototype}, executors)
    evaluations = {} if prototype_trial is None else {prototype_trial.number: prototype}
    state, evaluations = _confirm_front(searched, evaluations, executors, say)
    for angles in hang_rounds(study):
        contested = contested_designs(state, evaluations)
        if not contested:
            break
        places = deciding_points([evaluations[number].expectation for number in contested])
        say(
            f"hangs decide between {len(contested)} designs: {angles} angles at "
            f"{len(places)} of {len(study.points)} operating points"
        )
        trials = [trial for trial in state.trials if trial.number in contested]
        evaluations |= _add_angles(
            study, trials, evaluations, places, angles=angles, executors=executors
        )
        state, evaluations = _confirm_front(searched, evaluations, executors, say)
    if prototype_trial is None:
        prototype = prototype.replace_priors(state.priors)
    else:
        prototype = evaluations[prototype_trial.number]
    losses = {trial.number: searched.leading_loss(trial) for trial in searched.simulated}
    numbers = sorted(evaluations, key=lambda number: (losses[number], number))
    ordered_evaluations = {number: evaluations[number] for number in numbers}
    confirmation = _confirmation(searched, state, prototype, ordered_evaluations, executors)
    return confirmation, state


def confirm_nearest(searched: SearchState, executors: Executors, say: Say) -> list[ConfirmedDesign]:
    """Simulate the study's own dog and the designs that fail by least, at new angles.

    For a search in which none passes; designs that failed before a simulation are among them.
    Designs whose shifts all failed are left out.
    """
    study = searched.study
    angles = new_angles(study)
    candidates = [
        trial
        for trial in searched.trials
        if searched.designs[trial.number].checks and (trial.simulated or not trial.failed)
    ]
    candidates.sort(key=lambda trial: (shortfall(searched, trial), trial.number))
    prototypes = [trial for trial in candidates if trial.prototype]
    designs = [trial for trial in candidates if not trial.prototype][:NEAREST]
    trials = [*prototypes, *designs]
    if not trials:
        return []
    say(f"no design passes: simulating your own dog and the nearest {len(designs)}")
    params = [trial.params for trial in trials]
    evaluations = evaluate(study, params, _executor(study, executors), angles, _seed(study))
    drop_design_shifts(study, executors.search, angles, _seed(study))
    complete = [
        (trial, evaluation)
        for trial, evaluation in zip(trials, evaluations, strict=True)
        if evaluation.is_complete
    ]
    counts = [trial.counts for trial in searched.simulated if trial.times]
    counts += [evaluation.expectation.hang_counts for _, evaluation in complete]
    priors = pool(counts) if counts else ()
    return [
        _confirmed_design(
            study, trial.params, evaluation.replace_priors(priors), trial=trial.number
        )
        for trial, evaluation in complete
    ]


def shortfall(searched: SearchState, trial: Trial) -> float:
    """Compute the shortfall of the worst check of a trial with a dog, negative if all pass."""
    return -min(check.margin for check in searched.designs[trial.number].checks)


def _confirm_front(
    searched: SearchState, evaluations: dict[int, Evaluation], executors: Executors, say: Say
) -> tuple[SearchState, dict[int, Evaluation]]:
    """Confirm the front, and designs that come onto it, up to ``search.confirm_designs`` in all.

    ``evaluations`` are the designs at new angles so far. Returns the state at these angles and
    all evaluations.
    """
    study = searched.study
    max_designs = study.file.search.confirm_designs
    if _prototype_trial(searched) is not None:
        max_designs += 1
    state, evaluations = _renew_state(searched, evaluations)
    while True:
        unconfirmed = [trial for trial in state.front if not trial.confirmed]
        trials = unconfirmed[: max(0, max_designs - len(evaluations))]
        if not trials:
            return state, evaluations
        say(f"confirming {len(trials)} designs of the front at new angles")
        params_by_name = {f"design {trial.number}": trial.params for trial in trials}
        new_evaluations = _simulate_anew(study, params_by_name, executors)
        numbers = [trial.number for trial in trials]
        evaluations = evaluations | dict(zip(numbers, new_evaluations, strict=True))
        state, evaluations = _renew_state(searched, evaluations)


def _prototype_trial(state: SearchState) -> Trial | None:
    """Select the trial of the study's own dog; None if the search did not simulate it."""
    return next((trial for trial in state.simulated if trial.prototype), None)


def _renew_state(
    searched: SearchState, evaluations: Evaluations
) -> tuple[SearchState, dict[int, Evaluation]]:
    """Fit the prior of hangs to search and new angles; return state and designs under it."""
    no_hangs = [(0, 0)] * len(searched.study.points)
    counts = []
    for trial in searched.simulated:
        evaluation = evaluations.get(trial.number)
        new_counts = evaluation.expectation.hang_counts if evaluation else no_hangs
        pairs = zip(trial.counts or no_hangs, new_counts, strict=True)
        counts.append([(hangs + new[0], shifts + new[1]) for (hangs, shifts), new in pairs])
    priors = pool(counts)
    renewed = {
        number: evaluation.replace_priors(priors) for number, evaluation in evaluations.items()
    }
    trials = {trial.number: trial for trial in searched.trials}
    state = searched.renew(
        _renew_trial(searched.study, trials[number], evaluation)
        for number, evaluation in renewed.items()
    )
    return replace(state, priors=priors), renewed


def contested_designs(state: SearchState, evaluations: Evaluations) -> list[int]:
    """List the best design and its rivals, where hangs decide between them.

    Engaged means differ clearly, expected times do not. Empty where there are none, or where
    another objective leads.
    """
    candidates = [trial for trial in state.feasible if trial.number in evaluations]
    if leading_objective(state.study).name != SIMULATED or len(candidates) < 2:
        return []
    best_trial, *trials = sorted(candidates, key=state.leading_loss)
    best = evaluations[best_trial.number].expectation
    rivals = []
    for trial in trials:
        rival = evaluations[trial.number].expectation
        error = math.hypot(best.standard_error, rival.standard_error)
        engaged_error = math.hypot(best.engaged_error, rival.engaged_error)
        engaged_difference = abs(rival.engaged_mean - best.engaged_mean)
        is_engaged_clear = engaged_difference >= CLEAR_SIGMAS * engaged_error
        if is_engaged_clear and rival.mean - best.mean < CLEAR_SIGMAS * error:
            rivals.append(trial.number)
    return [best_trial.number, *rivals[: HANG_ANGLES.rivals]] if rivals else []


def deciding_points(expectations: Sequence[MixExpectation]) -> list[int]:
    """List the operating points that make ``HANG_ANGLES.variance_share`` of retries' variance."""
    variances = sum(
        (expectation.weights * np.array([point.retries_error for point in expectation.points])) ** 2
        for expectation in expectations
    )
    order = np.argsort(-np.asarray(variances))
    cumulative_share = np.cumsum(np.asarray(variances)[order]) / np.sum(variances)
    count = int(np.searchsorted(cumulative_share, HANG_ANGLES.variance_share)) + 1
    return sorted(order[:count].tolist())


def _add_angles(
    study: Setup,
    trials: Sequence[Trial],
    evaluations: Evaluations,
    places: Sequence[int],
    *,
    angles: int,
    executors: Executors,
) -> dict[int, Evaluation]:
    """Simulate designs at more angles of some operating points, without new landings."""
    base = new_angles(study)
    executor = _executor(study, executors)
    renewed = {}
    for trial in trials:
        design = OperatedDesign.of(study, trial.params)
        design_blocks = design.blocks(angles, _seed(study), base)
        blocks = [design_blocks[place] for place in places]
        rows = executor.run(blocks)
        operating_points = [design.study.points[place] for place in places]
        new_points = expectation_of(design.study, operating_points, rows).points
        evaluation = evaluations[trial.number]
        points = list(evaluation.expectation.points)
        for place, point in zip(places, new_points, strict=True):
            points[place] = point
        expectation = replace(evaluation.expectation, points=tuple(points))
        added_shifts = sum(len(block.angles) for block in blocks) - len(places) * base
        renewed[trial.number] = replace(
            evaluation, expectation=expectation, shifts=evaluation.shifts + added_shifts
        )
        drop_design_shifts(study, executors.search, base, _seed(study))
    return renewed


def _renew_trial(study: Setup, trial: Trial, evaluation: Evaluation) -> Trial:
    """Replace the values of a trial by those at new angles, and add its rows there."""
    estimates = {name: estimate.value for name, estimate in evaluation.estimates.items()}
    design = design_of(study, trial.params, evaluation.check_inputs)
    agreement = evaluation.agreement
    return replace(
        trial,
        values=tuple(values_of(design, estimates)),
        estimates=evaluation.estimates,
        check_inputs=evaluation.check_inputs,
        rows=[*trial.rows, *row_record(evaluation.rows)],
        times=[PointTimes.of(point) for point in evaluation.expectation.points],
        confirmed=True,
        engines_agree=agreement is None or agreement.agrees,
    )


def _simulate_anew(
    study: Setup, params_by_name: Mapping[str, Params], executors: Executors
) -> list[Evaluation]:
    """Simulate designs at new angles, and again in Drake at some of them.

    InputError where the shifts of a design say nothing of some objective.
    """
    angles = new_angles(study)
    executor = _executor(study, executors)
    designs = list(params_by_name.values())
    evaluations = evaluate(study, designs, executor, angles, _seed(study))
    failed_names = [
        name
        for name, evaluation in zip(params_by_name, evaluations, strict=True)
        if not evaluation.is_complete
    ]
    if failed_names:
        raise InputError(
            f"every shift of {' and '.join(failed_names)} at new angles failed, so what they "
            "strike is unknown; start the study with a larger solver.max_steps or "
            "solver.time_limit_s, or without the objective peak_impact_force_N"
        )
    blocks: list[Block] = []
    for params in designs:
        blocks += _drake_sample(study, _new_blocks(study, params))
    if study.reference_setup is None:
        executors.kept.run(blocks)  # for the single shifts of the report
    else:
        pairs = pair_shifts(blocks, study.reference_setup.clutch, executor, executors.kept)
        size = len(pairs) // len(evaluations)  # as many of each design
        evaluations = [
            replace(evaluation, agreement=agreement_of(pairs[k * size : (k + 1) * size]))
            for k, evaluation in enumerate(evaluations)
        ]
    drop_design_shifts(study, executors.search, angles, _seed(study))
    return evaluations


def _seed(study: Setup) -> int:
    """Return the seed of the new angles."""
    return study.file.expectation.seed + NEW_ANGLES


def _executor(study: Setup, executors: Executors) -> Executor:
    """Select the executor of shifts at new angles: Drake's shifts are kept."""
    return executors.kept if study.clutch.solver.engine == "drake" else executors.search


def _new_blocks(study: Setup, params: Params) -> list[Block]:
    """Build the shifts of a design at its new angles."""
    return OperatedDesign.of(study, params).blocks(new_angles(study), _seed(study))


def _drake_sample(study: Setup, blocks: Sequence[Block]) -> list[Block]:
    """Select the shifts at ``search.confirm_angles`` of the new angles."""
    angles = new_angles(study)
    places = range(0, angles, angles // study.file.search.confirm_angles)
    return [block.only(places) for block in blocks]


def _confirmation(
    searched: SearchState,
    state: SearchState,
    prototype: Evaluation,
    evaluations: Evaluations,
    executors: Executors,
) -> Confirmation:
    """Record the confirmation of designs, by trial in the search's order.

    Chosen is the design of the front that is best in the leading objective, hangs by their
    posterior; where none passes, the first of all.
    """
    study = searched.study
    trials = {trial.number: trial for trial in searched.simulated if trial.number in evaluations}
    front = [trial.number for trial in state.front if trial.number in evaluations]
    proposed = [number for number in evaluations if not trials[number].prototype]
    chosen = next(iter([*front, *proposed, *evaluations]))
    params = trials[chosen].params
    prototype_record = _confirm_closely(study, study.prototype, prototype, executors)
    best_record = _confirm_closely(study, params, evaluations[chosen], executors)
    designs = [
        _confirmed_design(
            study,
            trials[number].params,
            evaluation,
            trial=number,
            comparison=_search_comparison(searched, trials[number], evaluation),
        )
        for number, evaluation in evaluations.items()
    ]
    before = {} if trials[chosen].prototype else prototype_record.estimates
    gains = _gains(study, before, best_record.estimates)
    gain: float | None = None
    gain_error: float | None = None
    gain_share: float | None = None
    if SIMULATED in gains:
        gain = gains[SIMULATED].value
        gain_error = gains[SIMULATED].standard_error
        gain_share = gain / prototype_record.estimates[SIMULATED].value
    return Confirmation(
        angles=new_angles(study),
        prototype=prototype_record,
        chosen=chosen,
        best=best_record,
        designs=designs,
        shapes=_other_shapes(state, params, executors),
        hang_prior=[HangPriorRow(**vars(prior)) for prior in state.priors],
        left_out=[trial.number for trial in state.front if not trial.confirmed],
        gain_s=gain,
        gain_standard_error_s=gain_error,
        gain_share=gain_share,
        gains=gains,
    )


def _confirm_closely(
    study: Setup, params: Params, evaluation: Evaluation, executors: Executors
) -> ConfirmedDesign:
    """Record a design with its numerical error and the limits of torque."""
    executor = _executor(study, executors)
    blocks = _new_blocks(study, params)
    sample = _drake_sample(study, blocks)  # repeated for the numerical error
    error = numerical_error(sample, executor.run(sample), executor.run)
    expectation = replace(evaluation.expectation, numerical_error=error)
    operated = study.with_design(params)
    expectation = with_torques(operated, expectation, blocks, executor.run)
    return _confirmed_design(study, params, replace(evaluation, expectation=expectation))


def _other_shapes(state: SearchState, params: Params, executors: Executors) -> list[OtherShape]:
    """Simulate a design with more backlash, and with a roof in the place of its one face."""
    study = state.study
    clutch = study.clutch_with(params)
    dogs = {"": clutch.dog}
    if clutch.output_dog.given:
        dogs[OUTPUT_PREFIX] = clutch.pair.output
    added_backlash: dict[str, float] = {}
    roof: dict[str, float] = {}
    for prefix, dog in dogs.items():
        chamfer = (dog.chamfer or dog.chamfer_back) / DEG
        added_backlash[f"{prefix}backlash_mm"] = dog.backlash / MM + ADDED_BACKLASH_MM
        roof[f"{prefix}crest"] = 0.5
        roof[f"{prefix}chamfer_deg"] = chamfer
        roof[f"{prefix}chamfer_back_deg"] = chamfer
    changes = {f"{ADDED_BACKLASH_MM:g} mm of backlash more": added_backlash}
    if not any(dog.has_back for dog in dogs.values()):
        changes["a roof with the ridge in the middle and its chamfer on both sides"] = roof
    executor = _executor(study, executors)
    shapes = []
    for words, keys in changes.items():
        shape_params = {**params, **keys}
        try:
            study.dog_with(shape_params)
        except DogshapeError:  # a flat tip has no roof
            continue
        (evaluation,) = evaluate(study, [shape_params], executor, new_angles(study), _seed(study))
        evaluation = evaluation.replace_priors(state.priors)
        expectation = evaluation.expectation
        design, verdict = judge_design(design_of(study, shape_params, evaluation.check_inputs))
        shapes.append(
            OtherShape(
                shape=words,
                expected_shift_time_s=expectation.time,
                standard_error_s=expectation.standard_error if expectation.engages else None,
                feasible=design.feasible,
                verdict=VerdictRow.of(replace(verdict, hangs_on=())),
            )
        )
    return shapes


class SearchComparison(TypedDict):
    """Keys of ``ConfirmedDesign`` that compare new angles with the search."""

    searched: ObjectiveEstimate
    errors_apart: float
    agrees: bool


def _search_comparison(
    searched: SearchState, trial: Trial, evaluation: Evaluation
) -> SearchComparison:
    """Compare the leading objective at new angles with that of the search."""
    name = leading_objective(searched.study).name
    searched_value = (trial.estimates or {})[name]
    new_value = evaluation.estimates[name]
    error = math.hypot(searched_value.standard_error, new_value.standard_error)
    deviation = (new_value.value - searched_value.value) / error if error else 0.0
    return SearchComparison(
        searched=ObjectiveEstimate(**vars(searched_value)),
        errors_apart=deviation,
        agrees=abs(deviation) <= MAX_DEVIATION_SIGMAS,
    )


def _gains(study: Setup, before: Estimates, after: Estimates) -> Estimates:
    """Compute the gain in each simulated objective that both designs have."""
    signs = {objective.name: objective.sign for objective in objectives_of(study)}
    gains = {}
    for name, estimate in after.items():
        if name in before:
            difference = before[name].value - estimate.value
            gains[name] = ObjectiveEstimate(
                value=signs.get(name, 1.0) * difference,
                standard_error=math.hypot(before[name].standard_error, estimate.standard_error),
            )
    return gains


def _estimates(evaluation: Evaluation) -> Estimates:
    """Record the simulated objectives that a design has: no time where too few shifts engage."""
    return {
        name: ObjectiveEstimate(**vars(estimate))
        for name, estimate in evaluation.estimates.items()
        if evaluation.expectation.engages or OBJECTIVES[name].unit != "s"
    }


def _confirmed_design(
    study: Setup,
    params: Params,
    evaluation: Evaluation,
    *,
    trial: int | None = None,
    comparison: SearchComparison | None = None,
) -> ConfirmedDesign:
    """Record a design at new angles, with its trial and the comparison with its search if any."""
    design, verdict = judge_design(design_of(study, params, evaluation.check_inputs))
    number: dict[str, Any] = {} if trial is None else {"trial": trial}
    search_keys: dict[str, Any] = {} if comparison is None else {**comparison}
    return ConfirmedDesign(
        **number,
        **ExpectedTime.of(evaluation.expectation).to_dict(),
        estimates=_estimates(evaluation),
        checks=[CheckRow.of(check) for check in design.checks],
        verdict=VerdictRow.of(verdict),
        drake=evaluation.agreement,
        **search_keys,
    )
