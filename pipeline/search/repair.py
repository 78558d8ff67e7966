"""Shifts that finished designs rest on and the folder has lost: they are simulated again.

A journal that was cut short or removed leaves a search whose trials say more than its shifts.
Shifts that the clock ended, which earlier versions kept as failed, are simulated again too, and
their designs are judged anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy

from optuna.trial import FrozenTrial

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import distinct, simulated
from dogshape.pipeline.search.level_front import levels_of
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import NOTHING, Findings, checked_design, plan_of
from dogshape.pipeline.search.trials import attributes_of
from dogshape.pipeline.simulate.design import MEASURED, SIMULATED, values_of
from dogshape.pipeline.simulate.evaluation import Simulated, evaluate, in_two_levels, screen
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import Plan, blocks_of, is_whole, whole_plan

Say = Callable[[str], None]  #: prints a line for people


def repair(search: Search, executor: Executor, say: Say) -> Findings:
    """Simulate again the shifts of finished designs that the journal lacks; give what they say.

    Of a search that several machines share each folder has its own shifts: nothing is lost there.
    """
    if search.claims.worker is not None:
        return NOTHING
    finished = [trial for trial in search.trials() if simulated(trial)]
    trials, lost = _lacking(search.study, finished, executor)
    if not trials:
        return NOTHING
    say(
        f"{executor.journal.path} lacks {lost} shifts of {len(trials)} finished designs; they are "
        "simulated again"
    )
    study = search.study
    plans = [plan_of(study, trial) for trial in trials]
    if study.two_levels:
        found = [_in_two_levels(study, trial, executor) for trial in trials]
        return NOTHING.with_renewed(_mended(study, trials, plans, found, finished))
    dogs = [study.dog_with(dict(trial.params)) for trial in trials]
    own = [study.operated(dict(trial.params)) for trial in trials]
    found = evaluate(study, dogs, executor, plans, study.file.expectation.seed, operated=own)
    return NOTHING.with_renewed(_mended(study, trials, plans, found, finished))


def _in_two_levels(study: Setup, trial: FrozenTrial, executor: Executor) -> Simulated:
    """Simulate a finished design again; its compiled shifts are repeated."""
    levels = levels_of(study, trial)
    return simulated_levels(study, trial.params, executor, levels.few, levels.many)


def simulated_levels(
    study: Setup, params: Mapping[str, float], executor: Executor, few: int, many: int
) -> Simulated:
    """Simulate a design at so many angles of Drake and of the compiled engine."""
    dog, own = study.dog_with(dict(params)), study.operated(dict(params))
    seed, base, plan = study.file.expectation.seed, study.own_angles, whole_plan(study, few)
    (quick,) = screen(study, [dog], executor, seed, [own], angles=many, base=base)
    (one,) = evaluate(study, [dog], executor, [plan], seed, base=base, operated=[own])
    assert quick is not None
    (both,) = in_two_levels(study, [quick], [one], seed, base)
    return both


def _mended(
    study: Setup,
    trials: Sequence[FrozenTrial],
    plans: Sequence[Plan],
    found: Sequence[Simulated],
    finished: Sequence[FrozenTrial],
) -> list[FrozenTrial]:
    """Copy each finished trial of the designs with what was found of them."""
    return [
        _renewed(study, each, plan, one)
        for trial, plan, one in zip(trials, plans, found, strict=True)
        for each in finished
        if one.known and each.params == trial.params
    ]


def _renewed(study: Setup, trial: FrozenTrial, plan: Plan, found: Simulated) -> FrozenTrial:
    """Copy a trial with what all shifts of its design say; predicted times stay as told."""
    known = {**trial.user_attrs, **attributes_of(found)}
    # Few shifts do not overrule a screen of many; in two levels both are of the screen.
    if study.file.search.screen_angles is not None and found.levels is None:
        known[MEASURED] = trial.user_attrs[MEASURED]
    if not is_whole(plan):
        known["standard_error_s"] = trial.user_attrs["standard_error_s"]
        for name in ("simulated", "standard_errors"):
            known[name] = {**known[name], SIMULATED: trial.user_attrs[name][SIMULATED]}
    copied = copy(trial)
    copied.user_attrs = known
    copied.values = values_of(study, checked_design(study, copied), known["simulated"])
    return copied


def _lacking(
    study: Setup, finished: Sequence[FrozenTrial], executor: Executor
) -> tuple[list[FrozenTrial], int]:
    """Select the finished designs of which shifts are missing, and count those shifts."""
    journal = executor.journal
    trials, lost = [], 0
    for trial in distinct(finished):
        clutch = study.clutch.with_dog(study.dog_with(dict(trial.params)))
        own, seed = study.operated(dict(trial.params)), study.file.expectation.seed
        blocks = blocks_of(own, clutch, plan_of(study, trial), seed)
        keys = {key for block in blocks for key in block.keys}
        missing = keys - journal.rows.keys()
        lost += len(missing)
        if missing or keys & journal.outdated:
            trials.append(trial)
    return trials, lost
