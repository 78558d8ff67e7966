"""Shifts that finished designs rest on and the folder has lost: they are simulated again.

A journal that was cut short or removed leaves a search whose trials say more than its shifts.
Shifts that the clock ended, which earlier versions kept as failed, are simulated again too, and
their designs are judged anew.
"""

from __future__ import annotations

from collections.abc import Callable

from optuna.trial import FrozenTrial

from dogshape.pipeline.search.dog_guide import distinct
from dogshape.pipeline.search.replication import renewed
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.simulate.point_plans import blocks_of

Say = Callable[[str], None]  #: prints a line for people


def repair(search: Search, executor: Executor, say: Say) -> None:
    """Simulate again what the journal lacks of finished designs, and take up what it gives.

    Of a search that several machines share each folder has its own shifts: nothing is lost there.
    """
    if search.claims.worker is not None:
        return
    trials, lost = _lacking(search, executor)
    if not trials:
        return
    say(
        f"{executor.journal.path} lacks {lost} shifts of {len(trials)} finished designs; they are "
        "simulated again"
    )
    study = search.study
    plans = [search.plan(trial) for trial in trials]
    dogs = [study.dog_with(dict(trial.params)) for trial in trials]
    found = evaluate(study, dogs, executor, plans, study.file.expectation.seed)
    for trial, plan, one in zip(trials, plans, found, strict=True):
        if one.known:
            same = [each for each in search.simulated if each.params == trial.params]
            search.renew([renewed(search, each, plan, one) for each in same])


def _lacking(search: Search, executor: Executor) -> tuple[list[FrozenTrial], int]:
    """Return the finished designs of which shifts are missing, and how many those are."""
    study, journal = search.study, executor.journal
    trials, lost = [], 0
    for trial in distinct(search.simulated):
        clutch = study.clutch.with_dog(study.dog_with(dict(trial.params)))
        blocks = blocks_of(study, clutch, search.plan(trial), study.file.expectation.seed)
        keys = {key for block in blocks for key in block.keys}
        missing = keys - journal.rows.keys()
        lost += len(missing)
        if missing or keys & journal.outdated:
            trials.append(trial)
    return trials, lost
