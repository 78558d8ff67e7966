"""The search: propose designs, simulate them, tell the storage, until the budget is spent.

Designs of a round are proposed together, simulated side by side and told in the order of their
numbers. A round that was cut off is filled up, so the same seed gives the same designs,
interrupted or not. Several runs can share a search: each proposes rounds of its own, and the
designs of a dead run once more.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field

import optuna
from optuna.exceptions import ExperimentalWarning, UpdateFinishedTrialError
from optuna.storages import RDBStorage, fail_stale_trials
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.sampler import Guide, Space, SurrogateSampler
from dogshape.pipeline.search.state import (
    FAILED,
    PROTOTYPE,
    SIMULATION,
    SearchState,
    pooled,
    simulation_record,
    trial_of,
)
from dogshape.pipeline.simulate.design import (
    Design,
    design_of,
    leading_objective,
    objectives_of,
    simulated_limits,
    values_of,
)
from dogshape.pipeline.simulate.evaluation import (
    TIME_ESTIMATORS,
    Evaluation,
    evaluate,
    forget_designs,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder, comparable
from dogshape.pipeline.store.trial_storage import Sharing, open_storage
from dogshape.sim.errors import StorageError
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine
from dogshape.surrogate.model import MIN_DESIGNS

WAIT = 0.5  #: s between looks at what other machines do
OTHER = "give the study another name or use another storage"  #: remedy

AfterRound = Callable[[str, SearchState], None]  #: called with a line for people, and the state


@dataclass(frozen=True)
class Search:
    """Handles of a search in its storage, with heartbeats and turns where machines share it."""

    study: Setup
    optuna: optuna.Study
    sampler: SurrogateSampler
    sharing: Sharing | None = None
    _designs: dict[int, Design] = field(default_factory=dict, repr=False)  #: of finished trials

    def read(self) -> SearchState:
        """Read the finished trials of the storage, with times by the prior of all of them."""
        finished = list(map(trial_of, self.trials(TrialState.COMPLETE)))
        trials, priors = pooled(self.study, finished)
        # A limit on a time is judged again with each prior.
        again = TIME_ESTIMATORS.keys() & set(simulated_limits(self.study))
        return SearchState(self.study, trials, {} if again else self._designs, priors)

    def trials(self, *states: TrialState) -> list[FrozenTrial]:
        """List the trials in some states."""
        return self.optuna.get_trials(deepcopy=False, states=states)


def run(search: Search, executor: Executor, after_round: AfterRound) -> SearchState:
    """Run the search until the study's number of trials, or its space, is finished by all runs."""
    waiting, goal = False, search.study.file.search.trials
    with search.sharing or nullcontext():
        while True:
            with search.sharing.turn() if search.sharing else nullcontext():
                trials = next_round(search)
            if trials:
                waiting = False
                finish_round(search, trials, executor)
                state = search.read()
                after_round(_status(state), state)
                continue
            elsewhere = search.trials(TrialState.RUNNING, TrialState.WAITING)
            state = search.read()
            if (left := goal - len(state.trials)) <= 0:
                return state
            if not elsewhere:
                line = f"every design that passes the checks was tried: {left} fewer than wanted"
                after_round(line, state)
                return state
            if not waiting:
                after_round(f"waiting for {left} designs that other runs simulate", state)
            waiting = True
            time.sleep(WAIT)


def next_round(search: Search) -> list[FrozenTrial]:
    """Propose this run's next round: what a dead run left, filled up, or else new designs."""
    settings, ids = search.study.file.search, list[int]()
    if search.sharing is None:  # what runs is of a dead run
        ids = [trial._trial_id for trial in search.trials(TrialState.RUNNING)]
    else:
        with warnings.catch_warnings(action="ignore", category=ExperimentalWarning):
            fail_stale_trials(search.optuna)
    begun = len(search.trials(TrialState.RUNNING, TrialState.COMPLETE))
    size = -begun % settings.batch if ids else settings.batch
    for _ in range(begun, min(begun + size, settings.trials)):
        if (trial_id := _propose(search)) is None:
            break
        ids.append(trial_id)
    return [search.optuna._storage.get_trial(trial_id) for trial_id in ids]


def _propose(search: Search) -> int | None:
    """Begin a trial: of a dead machine, the prototype's, or a new one; None where none is left."""
    study, known = search.optuna, search.optuna.get_trials(deepcopy=False)
    trial_id: int | None = study._pop_waiting_trial_id()
    if trial_id is None:
        own = {t.state for t in known if t.user_attrs.get(PROTOTYPE)} <= {TrialState.FAIL}
        params = search.study.prototype if own else search.sampler.propose(known)
        if params is None:
            return None
        trial = Space(search.study.variables).trial(params, **({PROTOTYPE: True} if own else {}))
        trial_id = study._storage.create_new_trial(study._study_id, trial)
    if search.sharing is not None:
        search.sharing.add(trial_id)
    return trial_id


def finish_round(search: Search, trials: list[FrozenTrial], executor: Executor) -> None:
    """Simulate the designs of trials that may pass, and tell all trials in order."""
    study, settings = search.study, search.study.file.expectation
    designs = [design_of(study, dict(trial.params)) for trial in trials]
    params = [design.params for design in designs if design.feasible]
    found = iter(evaluate(study, params, executor, settings.angles, settings.seed))
    for trial, design in zip(trials, designs, strict=True):
        _tell(search, trial, design, next(found) if design.feasible else None)
    forget_designs(study, executor, settings.angles, settings.seed)


def _tell(search: Search, given: FrozenTrial, design: Design, one: Evaluation | None) -> None:
    """Write a design into the storage and end its trial there."""
    study, trial = search.study, optuna.Trial(search.optuna, given._trial_id)
    found = one if one is not None and one.is_complete else None
    landed = design_of(study, design.params, found.measured) if found else design
    estimates = {} if found is None else {n: e.value for n, e in found.estimates.items()}
    if search.sharing is not None:
        search.sharing.trials.discard(given._trial_id)
    # Where this run seemed dead, another one is at the design by now.
    with suppress(UpdateFinishedTrialError):
        for name, value in landed.constraints.items():
            if name not in given.constraints:
                trial.set_constraint(name, value)
        if one is not None and one.failed:
            trial.set_user_attr(FAILED, one.failed)
        if found is not None:
            trial.set_user_attr(SIMULATION, simulation_record(found))
        search.optuna.tell(trial, values_of(design, estimates), skip_if_finished=True)


def _status(state: SearchState) -> str:
    best, one = state.best, leading_objective(state.study)
    text = f"{len(state.trials)} of {state.study.file.search.trials} designs"
    if best is not None and best.estimates is not None:
        known = best.estimates[one.name]
        scale, unit = (1e3, "ms") if one.unit == "s" else (1.0, one.unit)
        text += f", best {known.value * scale:.4g} ± {known.standard_error * scale:.2g} {unit}"
    return text


def sampler_of(study: Setup) -> SurrogateSampler:
    """Make the sampler of a study."""
    search = study.file.search
    filling = search.sampler == "space_filling"
    startup = search.trials if filling else max(search.startup, MIN_DESIGNS)
    return SurrogateSampler(Guide(study), search.seed, startup)


def open_search(study: Setup, folder: StudyFolder, storage: str | None, resume: bool) -> Search:
    """Open or start the search in a storage: the folder's journal file, or an Optuna URL.

    StorageError where it cannot be opened, or holds a search of that name which is another or is
    not to be resumed.
    """
    sampler, objectives = sampler_of(study), objectives_of(study)
    ways = [(StudyDirection.MINIMIZE, StudyDirection.MAXIMIZE)[o.maximise] for o in objectives]
    logging.getLogger("optuna").setLevel(logging.WARNING)
    with warnings.catch_warnings(action="ignore", category=ExperimentalWarning):
        backend = open_storage(folder, storage)
        try:
            opened = optuna.create_study(
                study_name=study.name, storage=backend, directions=ways, load_if_exists=True
            )
        except ValueError as error:
            fault = f"the storage holds a study '{study.name}' with other objectives"
            raise StorageError(f"{fault}; {OTHER}") from error
        if opened.metric_names is None:
            opened.set_metric_names([one.name for one in objectives])
    _require_same(study, opened, resume)
    if not isinstance(backend, RDBStorage):
        return Search(study, opened, sampler)
    # A machine of other versions has other shifts than the others.
    here, known = engine(), opened.user_attrs.get("versions")
    if known is None:
        opened.set_user_attr("versions", here)
    elif known != here:
        apart = ", ".join(f"{n} {known.get(n)} there and {here[n]} here" for n in here)
        fault = f"the storage holds a study that other versions simulate ({apart})"
        raise StorageError(f"{fault}; install the same or give the study another name")
    return Search(study, opened, sampler, Sharing(backend, study.name))


def _require_same(study: Setup, opened: optuna.Study, resume: bool) -> None:
    mark = content_key(comparable(study.file))
    known = opened.user_attrs.get("configuration")
    if known is None and not opened.get_trials(deepcopy=False):
        opened.set_user_attr("configuration", mark)
    elif known != mark:
        fault = f"the storage holds a study '{study.name}' of another configuration"
        raise StorageError(f"{fault}; {OTHER}")
    elif not resume:
        remedy = "add --resume to go on with it or give the study another name"
        raise StorageError(f"the storage holds a study '{study.name}' already; {remedy}")
