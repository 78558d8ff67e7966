"""Confirmation: designs of the front, simulated again at every operating point and at new angles.

A search picks designs that were also lucky, and more angles find harder landings. So values and
checks of prototype and front are those of ``DENSER`` times as many new angles. Drake simulates some
of them too; a design on which both engines do not agree leaves the front, as does one that fails a
check or is beaten. Those that come onto it are confirmed next, up to ``search.confirm_designs``,
and the study's own dog is confirmed as they are.

The prior of hangs is fitted to all designs of search and confirmation. Where the posterior of hangs
decides between the best design and others, these get more angles (``HangAngles``).

An *audit* simulates random shifts of the search again in Drake.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
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
    Params,
    design_blocks,
    evaluate,
    expectation_of,
    forget_designs,
    with_torques,
)
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.store.result_records import (
    CheckRow,
    EngineAgreement,
    ExpectedTime,
    HangPriorRow,
    VerdictRow,
)
from dogshape.pipeline.train.training_rows import row_record
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.statistics.blocks import Block, numerical_error, repeated
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.hangs import pool
from dogshape.sim.statistics.shift_records import Record as Shift
from dogshape.sim.statistics.shift_records import result_of
from dogshape.sim.units import DEG, MM

DENSER = 2  #: times the angles of the search that the compiled engine has at the new ones
APART = 3.0  #: standard errors from which search and confirmation of a design do not agree
#: Share of shifts that may end differently in both engines: at the angles between two slots a
#: rounding decides, in up to 0.8 % of the shifts of a clutch (``docs/evidence/engines.txt``).
FLIPS = 0.01
MEAN = 0.01  #: difference of the engines' means over Drake's; measured are 0.06 %, at most 0.8 %
SURE = 3.0  #: standard errors from which a difference of the engines counts
Estimates = dict[str, ObjectiveEstimate]  #: of simulated objectives, by name
Found = Mapping[int, Evaluation]  #: designs at new angles, by trial


@dataclass(frozen=True)
class Executors:
    """Executors of the compiled shifts that no result needs later, and of those that are kept."""

    search: Executor
    kept: Executor


CLEAR = 2.0  #: standard errors of a difference of designs from which it is clear


@dataclass(frozen=True)
class HangAngles:
    """More angles for designs that the posterior of hangs decides between; status: judged.

    Each round doubles the angles of the best design and its nearest rivals, at the operating points
    that make most of the variance of their retries.
    """

    doublings: int = 3
    rivals: int = 4
    variance_share: float = 0.9  #: of the retries' variance that the chosen points make

    def rounds(self, angles: int) -> list[int]:
        """List the angles of each round, from those of the confirmation."""
        return [angles * 2**k for k in range(1, self.doublings + 1)]


HANG_ANGLES = HangAngles()
NEAREST = 5  #: designs that are simulated where none passes, beside the study's own dog
PLAY_MM = 0.1  #: of backlash that a confirmation adds to the chosen design


def new_angles(study: Setup) -> int:
    """Count the new angles of each operating point: a multiple of ``search.confirm_angles``."""
    few = study.file.search.confirm_angles
    if study.clutch.solver.engine == "drake":
        return few
    return few * math.ceil(DENSER * study.file.expectation.angles / few)


def hang_rounds(study: Setup) -> list[int]:
    """List the angles of each round for hangs; none in Drake, where a shift takes a second."""
    if study.clutch.solver.engine == "drake":
        return []
    return HANG_ANGLES.rounds(new_angles(study))


def shifts_to_confirm(study: Setup) -> int:
    """Count the shifts of a confirmation, at most, with the numerical errors."""
    few, many = study.file.search.confirm_angles, new_angles(study)
    both = len(study.points) * (many if many == few else many + few)
    hangs = (1 + HANG_ANGLES.rivals) * len(study.points) * sum(hang_rounds(study))
    designs = (2 + study.file.search.confirm_designs) * both
    torques = 2 * len(study.file.expectation.limit_torques_Nm or ()) * len(study.points) * many
    return designs + hangs + torques + 2 * repeated(len(study.points) * few)


def confirm(
    searched: SearchState, executors: Executors, say: Say
) -> tuple[Confirmation | None, SearchState]:
    """Simulate prototype and front of an ended search at angles that it did not use.

    Returns the confirmation, None where no design passes every check, and the state at the new
    angles.
    """
    study, own = searched.study, _own_trial(searched)
    if not searched.front:
        return None, searched
    say("confirming the prototype at new angles")
    (prototype,) = _resimulated(study, {"the prototype": study.prototype}, executors)
    found = {} if own is None else {own.number: prototype}
    state, found = _confirmed_front(searched, found, executors, say)
    for angles in hang_rounds(study):
        contested = contested_designs(state, found)
        if not contested:
            break
        places = deciding_points([found[number].expectation for number in contested])
        say(
            f"hangs decide between {len(contested)} designs: {angles} angles at "
            f"{len(places)} of {len(study.points)} operating points"
        )
        trials = [trial for trial in state.trials if trial.number in contested]
        found |= _denser(study, trials, found, places, angles=angles, executors=executors)
        state, found = _confirmed_front(searched, found, executors, say)
    prototype = prototype.under(state.priors) if own is None else found[own.number]
    loss = {trial.number: searched.leading_loss(trial) for trial in searched.simulated}
    ordered = dict(sorted(found.items(), key=lambda item: (loss[item[0]], item[0])))
    return _confirmation(searched, state, prototype, ordered, executors), state


def confirm_nearest(searched: SearchState, executors: Executors, say: Say) -> list[ConfirmedDesign]:
    """Simulate the study's own dog and the designs that fail by least, at new angles.

    For a search in which none passes; designs that failed before a simulation are among them.
    Designs whose shifts all failed are left out. Give their records.
    """
    study, angles = searched.study, new_angles(searched.study)
    known = [
        trial
        for trial in searched.trials
        if searched.designs[trial.number].checks and (trial.simulated or not trial.failed)
    ]
    nearest = sorted(known, key=lambda trial: (shortfall(searched, trial), trial.number))
    own = [trial for trial in nearest if trial.prototype]
    trials = [*own, *[trial for trial in nearest if not trial.prototype][:NEAREST]]
    if not trials:
        return []
    say(f"no design passes: simulating your own dog and the nearest {len(trials) - len(own)}")
    params = [trial.params for trial in trials]
    found = evaluate(study, params, _executor(study, executors), angles, _seed(study))
    forget_designs(study, executors.search, angles, _seed(study))
    sound = [(trial, one) for trial, one in zip(trials, found, strict=True) if one.is_complete]
    counts = [trial.counts for trial in searched.simulated if trial.times]
    counts += [one.expectation.hang_counts for _, one in sound]
    priors = pool(counts) if counts else ()
    return [
        _confirmed(study, trial.params, one.under(priors), trial=trial.number)
        for trial, one in sound
    ]


def shortfall(searched: SearchState, trial: Trial) -> float:
    """Compute how much the worst check of a trial with a dog is short, negative where it passes."""
    return -min(check.margin for check in searched.designs[trial.number].checks)


def _confirmed_front(
    searched: SearchState, found: dict[int, Evaluation], executors: Executors, say: Say
) -> tuple[SearchState, dict[int, Evaluation]]:
    """Confirm the front, and what comes onto it, up to ``search.confirm_designs`` in all.

    ``found`` are the designs at new angles so far. Give the state at these, and all of them.
    """
    study, own = searched.study, _own_trial(searched)
    most = study.file.search.confirm_designs + (own is not None)
    state, found = _renewed_state(searched, found)
    while trials := [t for t in state.front if not t.confirmed][: max(0, most - len(found))]:
        say(f"confirming {len(trials)} designs of the front at new angles")
        named = {f"design {trial.number}": trial.params for trial in trials}
        new = _resimulated(study, named, executors)
        found = found | {t.number: one for t, one in zip(trials, new, strict=True)}
        state, found = _renewed_state(searched, found)
    return state, found


def _own_trial(state: SearchState) -> Trial | None:
    """Select the trial of the study's own dog; None where it was not worth simulating."""
    return next((trial for trial in state.simulated if trial.prototype), None)


def _renewed_state(
    searched: SearchState, found: Mapping[int, Evaluation]
) -> tuple[SearchState, dict[int, Evaluation]]:
    """Fit the prior of hangs to search and new angles; give the state and designs under it."""
    counts, none = [], [(0, 0)] * len(searched.study.points)
    for trial in searched.simulated:
        one = found.get(trial.number)
        new = one.expectation.hang_counts if one else none
        pairs = zip(trial.counts or none, new, strict=True)
        counts.append([(k + more, n + shifts) for (k, n), (more, shifts) in pairs])
    priors = pool(counts)
    found = {number: one.under(priors) for number, one in found.items()}
    study, trials = searched.study, {trial.number: trial for trial in searched.trials}
    state = searched.renew(_renewed(study, trials[n], one) for n, one in found.items())
    return replace(state, priors=priors), found


def contested_designs(state: SearchState, found: Found) -> list[int]:
    """List the best design and those that hangs keep from being told apart.

    Engaged means differ clearly, expected times do not. Empty where there are none, or where
    another objective leads.
    """
    front = [trial for trial in state.feasible if trial.number in found]
    if leading_objective(state.study).name != SIMULATED or len(front) < 2:
        return []
    best, *others = sorted(front, key=state.leading_loss)
    first, contested = found[best.number].expectation, list[int]()
    for trial in others:
        rival = found[trial.number].expectation
        error = math.hypot(first.standard_error, rival.standard_error)
        engaged_error = math.hypot(first.engaged_error, rival.engaged_error)
        engaged_clear = abs(rival.engaged_mean - first.engaged_mean) >= CLEAR * engaged_error
        if engaged_clear and rival.mean - first.mean < CLEAR * error:
            contested.append(trial.number)
    return [best.number, *contested[: HANG_ANGLES.rivals]] if contested else []


def deciding_points(expectations: Sequence[Expectation]) -> list[int]:
    """List the operating points that make most of the variance of retries, in their order."""
    variances = sum(
        (one.weights * np.array([point.retries_error for point in one.points])) ** 2
        for one in expectations
    )
    order = np.argsort(-np.asarray(variances))
    reached = np.cumsum(np.asarray(variances)[order]) / np.sum(variances)
    number = int(np.searchsorted(reached, HANG_ANGLES.variance_share)) + 1
    return sorted(order[:number].tolist())


def _denser(
    study: Setup,
    trials: Sequence[Trial],
    found: Found,
    places: Sequence[int],
    *,
    angles: int,
    executors: Executors,
) -> dict[int, Evaluation]:
    """Simulate designs at more angles of some operating points; landings stay as they were."""
    base, executor, denser = new_angles(study), _executor(study, executors), dict[int, Evaluation]()
    for trial in trials:
        own = study.with_operation(trial.params)
        every = design_blocks(study, trial.params, angles, _seed(study), base)
        blocks = [every[place] for place in places]
        rows = executor.run(blocks)
        new = expectation_of(own, [own.points[place] for place in places], rows).points
        known = found[trial.number]
        points = list(known.expectation.points)
        for place, point in zip(places, new, strict=True):
            points[place] = point
        expectation = replace(known.expectation, points=tuple(points))
        more = sum(len(block.angles) for block in blocks) - len(places) * base
        denser[trial.number] = replace(known, expectation=expectation, shifts=known.shifts + more)
        forget_designs(study, executors.search, base, _seed(study))
    return denser


def _renewed(study: Setup, trial: Trial, one: Evaluation) -> Trial:
    """Replace the values of a trial by those of new angles, and add its rows there."""
    values = {name: estimate.value for name, estimate in one.estimates.items()}
    return replace(
        trial,
        values=tuple(values_of(design_of(study, trial.params, one.measured), values)),
        estimates=one.estimates,
        measured=one.measured,
        rows=[*trial.rows, *row_record(one.rows)],
        times=[PointTimes.of(point) for point in one.expectation.points],
        confirmed=True,
        judged=one.agreement is None or one.agreement.agrees,
    )


def _resimulated(study: Setup, named: dict[str, Params], executors: Executors) -> list[Evaluation]:
    """Simulate designs at new angles, and again in Drake at some of them.

    InputError where the shifts of a design say nothing of some objective.
    """
    many, executor, designs = new_angles(study), _executor(study, executors), [*named.values()]
    found = evaluate(study, designs, executor, many, _seed(study))
    if unknown := [name for name, one in zip(named, found, strict=True) if not one.is_complete]:
        raise InputError(
            f"every shift of {' and '.join(unknown)} at new angles failed, so what they strike "
            "is unknown; start the study with a larger solver.max_steps or solver.time_limit_s, "
            "or without the objective peak_impact_force_N"
        )
    blocks = [b for params in designs for b in _thinned(study, _new_blocks(study, params))]
    if study.reference_setup is None:
        executors.kept.run(blocks)  # for the single shifts of the report
    else:
        pairs = _pairs(blocks, study.reference_setup.clutch, executor, executors.kept)
        size = len(pairs) // len(found)  # as many of each design
        found = [
            replace(one, agreement=agreement_of(pairs[k * size : (k + 1) * size]))
            for k, one in enumerate(found)
        ]
    forget_designs(study, executors.search, many, _seed(study))
    return found


def _seed(study: Setup) -> int:
    return study.file.expectation.seed + NEW_ANGLES


def _executor(study: Setup, executors: Executors) -> Executor:
    return executors.kept if study.clutch.solver.engine == "drake" else executors.search


def _new_blocks(study: Setup, params: Params) -> list[Block]:
    """Build the shifts of a design at its new angles."""
    return design_blocks(study, params, new_angles(study), _seed(study))


def _thinned(study: Setup, blocks: Sequence[Block]) -> list[Block]:
    """Select the shifts at ``search.confirm_angles`` of the new angles."""
    many = new_angles(study)
    places = range(0, many, many // study.file.search.confirm_angles)
    return [block.only(places) for block in blocks]


def _confirmation(
    searched: SearchState, state: SearchState, own: Evaluation, found: Found, executors: Executors
) -> Confirmation:
    """Record the confirmation of designs, by trial in the search's order.

    Chosen is the design of the front that is best in the leading objective, hangs by their
    posterior; where none passes, the first of all.
    """
    study = searched.study
    trials = {trial.number: trial for trial in searched.simulated if trial.number in found}
    front = [trial.number for trial in state.front if trial.number in found]
    searched_ones = [number for number in found if not trials[number].prototype]
    chosen = next(iter([*front, *searched_ones, *found]))
    params, same = trials[chosen].params, trials[chosen].prototype
    executor, both = _executor(study, executors), list[Evaluation]()
    for design, one in ((study.prototype, own), (params, found[chosen])):
        blocks = _new_blocks(study, design)
        sample = _thinned(study, blocks)  # repeated for the numerical error
        error = numerical_error(sample, executor.run(sample), executor.run)
        expectation = replace(one.expectation, numerical_error=error)
        expectation = with_torques(study.with_operation(design), expectation, blocks, executor.run)
        both.append(replace(one, expectation=expectation))
    old, new = both
    designs = [
        _confirmed(
            study,
            trials[number].params,
            evaluation,
            trial=number,
            **_search_comparison(searched, trials[number], evaluation),
        )
        for number, evaluation in found.items()
    ]
    prototype = _confirmed(study, study.prototype, old)
    best = _confirmed(study, params, new)
    gains = _gains(study, {} if same else prototype.estimates, best.estimates)
    time_gain = gains.get(SIMULATED)
    gain_share = None
    if time_gain is not None:
        gain_share = time_gain.value / prototype.estimates[SIMULATED].value
    return Confirmation(
        angles=new_angles(study),
        prototype=prototype,
        chosen=chosen,
        best=best,
        designs=designs,
        shapes=_other_shapes(state, params, executors),
        hang_prior=[HangPriorRow(**vars(prior)) for prior in state.priors],
        left_out=[trial.number for trial in state.front if not trial.confirmed],
        gain_s=time_gain and time_gain.value,
        gain_standard_error_s=time_gain and time_gain.standard_error,
        gain_share=gain_share,
        gains=gains,
    )


def _other_shapes(state: SearchState, params: Params, executors: Executors) -> list[OtherShape]:
    """Simulate a design with more backlash, and with a roof in the place of its one face."""
    study = state.study
    dog = study.dog_with(params)
    changes = {f"{PLAY_MM:g} mm of backlash more": {"backlash_mm": dog.backlash / MM + PLAY_MM}}
    if not dog.has_back:
        fall = (dog.chamfer or dog.chamfer_back) / DEG
        changes["a roof with the ridge in the middle and its chamfer on both sides"] = {
            "crest": 0.5, "chamfer_deg": fall, "chamfer_back_deg": fall,
        }  # fmt: skip
    executor, found = _executor(study, executors), list[OtherShape]()
    for words, keys in changes.items():
        design = {**params, **keys}
        try:
            study.dog_with(design)
        except DogshapeError:  # a flat tip has no roof
            continue
        (one,) = evaluate(study, [design], executor, new_angles(study), _seed(study))
        one = one.under(state.priors)
        time = one.expectation
        judged, verdict = judge_design(design_of(study, design, one.measured))
        found.append(OtherShape(
            shape=words, expected_shift_time_s=time.time,
            standard_error_s=time.standard_error if time.engages else None,
            feasible=judged.feasible,
            verdict=VerdictRow.of(replace(verdict, hangs_on=())),
        ))  # fmt: skip
    return found


def _search_comparison(
    searched: SearchState, trial: Trial, evaluation: Evaluation
) -> dict[str, Any]:
    """Compare the leading objective at new angles with that of the search, by declared keys."""
    name = leading_objective(searched.study).name
    searched_value = (trial.estimates or {})[name]
    new_value = evaluation.estimates[name]
    error = math.hypot(searched_value.standard_error, new_value.standard_error)
    deviation = (new_value.value - searched_value.value) / error if error else 0.0
    return {
        "searched": ObjectiveEstimate(**vars(searched_value)),
        "errors_apart": deviation,
        "agrees": abs(deviation) <= APART,
    }


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


def _confirmed(
    study: Setup, params: Params, evaluation: Evaluation, **search_keys: Any
) -> ConfirmedDesign:
    """Record a design at new angles; ``search_keys`` are its trial and ``_search_comparison``."""
    design, verdict = judge_design(design_of(study, params, evaluation.measured))
    trial = {name: search_keys.pop(name) for name in ("trial",) if name in search_keys}
    return ConfirmedDesign(
        **trial,
        **ExpectedTime.of(evaluation.expectation).to_dict(),
        estimates=_estimates(evaluation),
        checks=[CheckRow.of(check) for check in design.checks],
        verdict=VerdictRow.of(verdict),
        drake=evaluation.agreement,
        **search_keys,
    )


def agreement_of(pairs: Sequence[tuple[Shift, Shift]]) -> EngineAgreement:
    """Compare shifts of the compiled engine with the same ones of Drake.

    They agree where no more than ``max(1, n r + 3 sqrt(n r))`` of *n* shifts end differently, with
    *r* the share ``FLIPS``, and the means of those that engage in both differ by no more than
    ``MEAN`` or three standard errors. Deviations are 0 where none does.
    """
    both = [(result_of(mine), result_of(drake)) for mine, drake in pairs]
    same = sum(mine.outcome is drake.outcome for mine, drake in both)
    every = [(mine.shift_time, drake.shift_time) for mine, drake in both]
    times = np.array([pair for pair in every if None not in pair] or [(1.0, 1.0)], dtype=float)
    apart, mean = times[:, 0] - times[:, 1], float(times[:, 1].mean())
    sizes, deviation = np.abs(apart) / times[:, 1], float(apart.mean()) / mean
    error = float(apart.std(ddof=1)) / len(apart) ** 0.5 / mean if len(apart) > 1 else 0.0
    expected = FLIPS * len(pairs)
    alike = len(pairs) - same <= max(1.0, expected + SURE * math.sqrt(expected))
    return EngineAgreement(
        shifts=len(pairs),
        outcome_same=same,
        median_deviation=float(np.median(sizes)),
        worst_deviation=float(sizes.max()),
        mean_deviation=deviation,
        standard_error=error,
        agrees=alike and abs(deviation) <= max(MEAN, SURE * error),
    )


def _pairs(
    blocks: Sequence[Block], judge: Clutch, quick: Executor, executor: Executor
) -> list[tuple[Shift, Shift]]:
    """Simulate blocks in the compiled engine, and again in Drake; pair the shifts of both."""
    drake = [replace(block, clutch=replace(block.clutch, solver=judge.solver)) for block in blocks]
    return list(zip(chain(*quick.run(blocks)), chain(*executor.run(drake)), strict=True))


def audit(
    study: Setup, designs: Sequence[Params], executor: Executor, shifts: int, say: Say
) -> EngineAgreement | None:
    """Simulate random shifts of designs of the compiled engine again in both engines.

    None where Drake does not judge.
    """
    settings, judge = study.file.expectation, study.reference_setup
    if study.engine_gap:
        say(f"no confirmation by Drake and no audit: {study.engine_gap}")
    if judge is None or not shifts or not designs:
        return None
    say(f"auditing {shifts} shifts of the search in Drake")
    places = len(designs), len(study.points), settings.angles
    rng, size = np.random.default_rng([study.file.search.seed, shifts]), math.prod(places)
    drawn = np.sort(rng.choice(size, min(shifts, size), replace=False))
    own = cache(lambda place: design_blocks(study, designs[place], places[2], settings.seed))
    drawn_at = zip(*np.unravel_index(drawn, places), strict=True)
    blocks = [own(design)[point].only([int(angle)]) for design, point, angle in drawn_at]
    # Compiled shifts are quick to repeat: a journal of their own keeps them out of the study's.
    quick = scratch_executor(executor.jobs, executor.progress, executor.cluster)
    found = agreement_of(_pairs(blocks, judge.clutch, quick, executor))
    say(found.text)
    return found
