"""The search: rounds of proposals, simulated in parallel, told in order.

Trials of a round are asked together, simulated side by side and told in the
order of their numbers, so the result does not depend on which finished first.
A round that was cut off is taken up again with the parameters it had; shifts
that it had finished come from the journal. Several runs can share a search: each
asks for rounds of its own, and takes up those of runs that have ended.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field

import optuna
from optuna.exceptions import ExperimentalWarning, UpdateFinishedTrialError
from optuna.samplers import BaseSampler
from optuna.trial import FrozenTrial, TrialState

from pipeline.claims import Alone, Claims
from pipeline.config import Study
from pipeline.design import Design, design_of, objectives_of, values_of
from pipeline.evaluation import Simulated, evaluate
from pipeline.executor import ENGINE, Executor
from pipeline.folder import StudyFolder, comparable
from pipeline.rows import row_record
from pipeline.sampler import search_space
from pipeline.storage import opening
from sim.blocks import even_blocks
from sim.errors import StorageError
from sim.records import content_key, landing_of, landing_record
from sim.versions import versions

WORKER = "worker"  #: attribute of a trial: number of the run that is at it

AfterRound = Callable[[str], None]  #: called with a line about the search so far


@dataclass
class Search:
    """A search in its storage."""

    study: Study
    optuna: optuna.Study
    claims: Claims = field(default_factory=Alone)

    @property
    def trials(self) -> list[FrozenTrial]:
        """Finished trials in the order of their numbers."""
        return [t for t in self.optuna.get_trials(deepcopy=False) if t.state == TrialState.COMPLETE]

    @property
    def simulated(self) -> list[FrozenTrial]:
        """Finished trials of designs that were simulated."""
        return [t for t in self.trials if "standard_error_s" in t.user_attrs]

    @property
    def feasible(self) -> list[FrozenTrial]:
        """Simulated designs that pass every check, the landing's too."""
        return [t for t in self.simulated if self.design(t).feasible]

    def design(self, trial: FrozenTrial) -> Design:
        """Return the design of a trial with all of its checks."""
        given = trial.user_attrs
        landing = landing_of(given) if "standard_error_s" in given else None
        return design_of(self.study, dict(trial.params), landing)

    @property
    def rows(self) -> list[list[float | None]]:
        """Return what all simulated trials hold for the surrogate, in their order."""
        return [row for trial in self.simulated for row in trial.user_attrs["rows"]]

    def shifts(self, known: Iterable[str]) -> int:
        """Return how many shifts there are: those known by their keys, and other runs'."""
        if self.claims.worker is None:
            return len(set(known))
        settings = self.study.file.expectation
        keys = set(known)
        for trial in self.simulated:
            clutch = self.study.clutch.with_dog(self.study.dog_with(dict(trial.params)))
            blocks = even_blocks(clutch, self.study.points, settings.angles, settings.seed)
            keys.update(key for block in blocks for key in block.keys)
        return len(keys)


def open_search(study: Study, folder: StudyFolder, storage: str | None, resume: bool) -> Search:
    """Open or start the search in a storage: the folder's journal file, or an Optuna URL.

    Raises StorageError where the storage cannot be opened, or holds a search
    of that name which is of another configuration or is not to be resumed.
    """
    logging.getLogger("optuna").setLevel(logging.WARNING)
    with warnings.catch_warnings(), opening(folder, storage, study.name) as (backend, claims):
        warnings.simplefilter("ignore", ExperimentalWarning)
        try:
            opened = optuna.create_study(
                study_name=study.name,
                storage=backend,
                directions=["minimize"] * len(objectives_of(study)),
                load_if_exists=True,
            )
        except ValueError as error:
            raise StorageError(
                f"the storage holds a study '{study.name}' with other objectives; "
                "give the study another name or use another storage"
            ) from error
        _require_same(study, opened, resume)
        if claims.worker is not None:
            _require_same_versions(opened)
    return Search(study, opened, claims)


def _require_same(study: Study, opened: optuna.Study, resume: bool) -> None:
    mark = content_key(comparable(study.file))
    known = opened.user_attrs.get("configuration")
    if known is None and not opened.get_trials(deepcopy=False):
        opened.set_user_attr("configuration", mark)
    elif known != mark:
        raise StorageError(
            f"the storage holds a study '{study.name}' of another configuration; "
            "give the study another name or use another storage"
        )
    elif not resume:
        raise StorageError(
            f"the storage holds a study '{study.name}' already; add --resume to go on with it "
            "or give the study another name"
        )


def _require_same_versions(opened: optuna.Study) -> None:
    """Refuse a machine whose shifts would differ from those of the others."""
    here = {name: versions()[name] for name in ENGINE}
    known = opened.user_attrs.get("versions")
    if known is None:
        opened.set_user_attr("versions", here)
    elif known != here:
        apart = ", ".join(f"{n} {known.get(n)} there and {here[n]} here" for n in here)
        raise StorageError(
            f"the storage holds a study that other versions simulate ({apart}); install the same "
            "or give the study another name"
        )


def run(
    search: Search,
    sampler_of: Callable[[int], BaseSampler],
    executor: Executor,
    after_round: AfterRound,
) -> None:
    """Run the search until the study's number of trials is finished, by this run and others."""
    waiting = False
    while True:
        with search.claims.turn():
            ids = _next_round(search, sampler_of)
        if ids:
            waiting = False
            _finish(search, ids, executor)
            after_round(_status(search))
        elif (left := search.study.file.search.trials - len(search.trials)) <= 0:
            return
        else:
            if not waiting:
                after_round(f"waiting for {left} designs that other runs simulate")
            waiting = True
            search.claims.wait()


def _next_round(search: Search, sampler_of: Callable[[int], BaseSampler]) -> list[int]:
    """Return the trials of this run's next round: those cut off, then new ones.

    What other runs have asked for counts as if it were finished, so none is asked too many.
    """
    study, settings = search.study, search.study.file.search
    if not search.optuna.get_trials(deepcopy=False):
        search.optuna.enqueue_trial(study.prototype, user_attrs={"prototype": True})
    left = _cut_off(search)[: settings.batch]
    # A round that was cut off while it was asked is asked to its end first.
    asked = [t for t in search.optuna.get_trials(deepcopy=False) if t.state != TrialState.FAIL]
    begun = [t for t in asked if t.state != TrialState.WAITING]
    size = max(0, min(settings.batch - len(left), settings.trials - len(begun)))
    search.optuna.sampler = sampler_of(len(asked) - len(left))
    space = search_space(study)
    ids = [*left, *(search.optuna.ask(space)._trial_id for _ in range(size))]
    if search.claims.worker is not None:
        for trial_id in ids:
            optuna.Trial(search.optuna, trial_id).set_user_attr(WORKER, search.claims.worker)
    return ids


def _cut_off(search: Search) -> list[int]:
    """Return the trials that a dead run asked and did not tell; fail incomplete ones."""
    left, living = [], search.claims.living()
    names = set(search.study.variables)
    for trial in search.optuna.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        if trial.user_attrs.get(WORKER) in living:
            continue
        if names <= set(trial.params):
            left.append(trial._trial_id)
        else:
            search.optuna.tell(trial.number, state=TrialState.FAIL)
    return left


def _finish(search: Search, ids: list[int], executor: Executor) -> None:
    """Simulate the designs among trials that may pass and tell them all in order."""
    study = search.study
    trials = [optuna.Trial(search.optuna, trial_id) for trial_id in ids]
    designs = [design_of(study, dict(t.params)) for t in trials]
    worth = [d.dog for d in designs if d.dog is not None and d.feasible]
    settings = study.file.expectation
    results = iter(evaluate(study, worth, executor, settings.angles, settings.seed))
    for trial, design in zip(trials, designs, strict=True):
        found = next(results) if design.feasible else None
        landed = design if found is None else design_of(study, design.params, found.landing)
        # A run that seemed dead may have told it meanwhile: it found the same.
        with suppress(UpdateFinishedTrialError):
            _tell(search, trial, landed, found)


def _tell(search: Search, trial: optuna.Trial, design: Design, found: Simulated | None) -> None:
    with warnings.catch_warnings():
        # A run that was cut off while it told the trial has set some, the same.
        warnings.filterwarnings("ignore", message="The constraint value is ignored")
        for name, value in design.constraints.items():
            trial.set_constraint(name, value)
    if found is not None:
        trial.set_user_attr("engaged", found.expectation.engaged)
        trial.set_user_attr("standard_error_s", found.expectation.standard_error)
        for name, value in landing_record(found.landing).items():
            trial.set_user_attr(name, value)
        trial.set_user_attr("rows", row_record(found.rows))
    if design.failed:
        trial.set_user_attr("failed", design.failed)
    expectation = found.expectation if found is not None else None
    values = values_of(search.study, design, expectation)
    search.optuna.tell(trial, values, skip_if_finished=True)


def _status(search: Search) -> str:
    best = best_trial(search)
    done = len(search.trials)
    text = f"{done} of {search.study.file.search.trials} designs"
    if best is not None:
        time = expected_time(search, best)
        text += f", best {time * 1e3:.1f} ms +- {best.user_attrs['standard_error_s'] * 1e3:.1f}"
    return text


def expected_time(search: Search, trial: FrozenTrial) -> float:
    """Return a simulated trial's expected shift time, s."""
    names = search.study.file.search.objectives
    return float(trial.values[names.index("expected_shift_time_s")])


def best_trial(search: Search) -> FrozenTrial | None:
    """Return the feasible design with the least expected shift time."""
    return min(search.feasible, key=lambda t: expected_time(search, t), default=None)


def front(search: Search) -> list[FrozenTrial]:
    """Return the feasible designs that no other dominates, fastest first."""
    trials = search.feasible
    kept = [t for t in trials if not any(_dominates(o, t) for o in trials)]
    return sorted(kept, key=lambda t: expected_time(search, t))


def _dominates(a: FrozenTrial, b: FrozenTrial) -> bool:
    no_worse = all(x <= y for x, y in zip(a.values, b.values, strict=True))
    return no_worse and any(x < y for x, y in zip(a.values, b.values, strict=True))
