"""The search: propose designs, simulate them, store their values, until the budget is spent.

Designs of a round are proposed together, simulated in parallel and stored in the order of their
numbers. A resumed search completes the interrupted round, so the same seed gives the same designs,
interrupted or not. Several runs can share a search: each proposes its own rounds, and proposes
again the designs of a run that ended before it stored them.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field

import numpy as np
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
    pool_trials,
    simulation_record,
    trial_of,
)
from dogshape.pipeline.search.study_record import RemainingGain
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
    Params,
    drop_design_shifts,
    evaluate,
)
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import StudyFolder, comparable
from dogshape.pipeline.store.trial_storage import Sharing, open_storage
from dogshape.sim.errors import StorageError
from dogshape.sim.interface import argument
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import program_versions
from dogshape.surrogate.model import MIN_DESIGNS

POLL_TIME_S = 0.5  #: between two readings of the trials of other machines
UPPER_SHARE = 0.95  #: of the draws of a remaining gain, below its upper bound
STORAGE_REMEDY = "give the study another name or use another storage"

AfterRound = Callable[[str, SearchState], None]  #: called with a line to print, and the state


@dataclass(frozen=True)
class Search:
    """Handles of a search in its storage; ``sharing`` where machines share it."""

    study: Setup
    optuna_study: optuna.Study
    sampler: SurrogateSampler
    sharing: Sharing | None = None  #: heartbeats and turns of the runs
    #: proposed by this run and not finished, by the id of the trial
    designs: dict[int, Design] = field(default_factory=dict)
    _designs: dict[int, Design] = field(default_factory=dict, repr=False)  #: of finished trials

    def read(self) -> SearchState:
        """Read the finished trials; the prior of their times is pooled from all of them."""
        finished = list(map(trial_of, self.trials(TrialState.COMPLETE)))
        trials, priors = pool_trials(self.study, finished)
        # Each new prior moves times: designs with a limit on a time are checked again.
        time_limits = TIME_ESTIMATORS.keys() & set(simulated_limits(self.study))
        designs = {} if time_limits else self._designs
        return SearchState(self.study, trials, designs, priors)

    def predict_remaining_gain(self, chosen: int) -> RemainingGain | None:
        """Predict the gain of further designs over a chosen trial; None without a prediction."""
        trials = self.trials(TrialState.COMPLETE)
        params = next(trial.params for trial in trials if trial.number == chosen)
        gains = self.sampler.draw_remaining_gain(trials, params)
        if not len(gains):
            return None
        upper = float(np.quantile(gains, UPPER_SHARE))
        return RemainingGain(expected=float(gains.mean()), upper=upper)

    def trials(self, *states: TrialState) -> list[FrozenTrial]:
        """List the trials that are in one of the states."""
        return self.optuna_study.get_trials(deepcopy=False, states=states)


def run(search: Search, executor: Executor, after_round: AfterRound) -> SearchState:
    """Run the search until all runs together finish the study's trials, or exhaust its space."""
    max_trials = search.study.file.search.trials
    waiting = False
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
            unfinished = search.trials(TrialState.RUNNING, TrialState.WAITING)
            state = search.read()
            remaining = max_trials - len(state.trials)
            if remaining <= 0:
                return state
            if not unfinished:
                line = (
                    f"every design that passes the checks was tried: {remaining} fewer than wanted"
                )
                after_round(line, state)
                return state
            if not waiting:
                after_round(f"waiting for {remaining} designs that other runs simulate", state)
            waiting = True
            time.sleep(POLL_TIME_S)


def next_round(search: Search) -> list[FrozenTrial]:
    """Propose this run's next round of trials.

    An interrupted round is completed: its unfinished trials, and new ones up to its size.
    """
    settings = search.study.file.search
    trial_ids = list[int]()
    if search.sharing is None:  # no other run is alive: running trials are of an interrupted one
        trial_ids = [trial._trial_id for trial in search.trials(TrialState.RUNNING)]
    else:
        with warnings.catch_warnings(action="ignore", category=ExperimentalWarning):
            fail_stale_trials(search.optuna_study)
    begun_count = len(search.trials(TrialState.RUNNING, TrialState.COMPLETE))
    new_count = settings.batch
    if trial_ids:
        new_count = -begun_count % settings.batch  # up to a whole number of rounds
    for _ in range(begun_count, min(begun_count + new_count, settings.trials)):
        trial_id = _propose(search)
        if trial_id is None:
            break
        trial_ids.append(trial_id)
    return [search.optuna_study._storage.get_trial(trial_id) for trial_id in trial_ids]


def _propose(search: Search) -> int | None:
    """Begin a trial and return its id; None where no design remains.

    The trial is one that a dead machine left waiting, the prototype's, or a new one.
    """
    study = search.optuna_study
    trials = study.get_trials(deepcopy=False)
    trial_id: int | None = study._pop_waiting_trial_id()
    if trial_id is None:
        prototype_states = [t.state for t in trials if t.user_attrs.get(PROTOTYPE)]
        attributes = {}
        if all(state == TrialState.FAIL for state in prototype_states):  # or none was begun
            params: Params | None = search.study.prototype
            attributes[PROTOTYPE] = True
        else:
            params = search.sampler.propose(trials)
        if params is None:
            return None
        trial = Space(search.study.variables).trial(params, **attributes)
        design = design_of(search.study, dict(trial.params))
        # Known constraints are stored with the trial: each one later is a write of its own to disk.
        for name, value in design.constraints.items():
            trial.set_constraint(name, value)
        trial_id = study._storage.create_new_trial(study._study_id, trial)
        search.designs[trial_id] = design
    if search.sharing is not None:
        search.sharing.add(trial_id)
    return trial_id


def finish_round(search: Search, trials: list[FrozenTrial], executor: Executor) -> None:
    """Simulate the designs of a round that may pass, and store all trials in order."""
    study = search.study
    settings = study.file.expectation
    designs = []
    for trial in trials:
        design = search.designs.pop(trial._trial_id, None)
        if design is None:  # the trial was begun by a run that ended
            design = design_of(study, dict(trial.params))
        designs.append(design)
    params = [design.params for design in designs if design.feasible]
    evaluations = iter(evaluate(study, params, executor, settings.angles, settings.seed))
    for trial, design in zip(trials, designs, strict=True):
        evaluation = next(evaluations) if design.feasible else None
        _store(search, trial, design, evaluation)
    drop_design_shifts(study, executor, settings.angles, settings.seed)


def _store(
    search: Search, frozen: FrozenTrial, design: Design, evaluation: Evaluation | None
) -> None:
    """Store a design and end its trial.

    Without a complete evaluation the design counts as not simulated.
    """
    trial = optuna.Trial(search.optuna_study, frozen._trial_id)
    failed_shifts = evaluation.failed if evaluation is not None else {}
    constraints = design.constraints
    values = {}
    simulation = None
    if evaluation is not None and evaluation.is_complete:
        constraints = design_of(search.study, design.params, evaluation.check_inputs).constraints
        values = {name: estimate.value for name, estimate in evaluation.estimates.items()}
        simulation = simulation_record(evaluation)._asdict()
    if search.sharing is not None:
        search.sharing.trials.discard(frozen._trial_id)
    # If this run had no heartbeat for long, another one has ended the trial and begun it again.
    with suppress(UpdateFinishedTrialError):
        for name, value in constraints.items():
            if name not in frozen.constraints:  # a constraint can be set once
                trial.set_constraint(name, value)
        if failed_shifts:
            trial.set_user_attr(FAILED, failed_shifts)
        if simulation is not None:
            trial.set_user_attr(SIMULATION, simulation)
        search.optuna_study.tell(trial, values_of(design, values), skip_if_finished=True)


def _status(state: SearchState) -> str:
    """Describe the progress of a search and its best design."""
    text = f"{len(state.trials)} of {state.study.file.search.trials} designs"
    best = state.best
    if best is None or best.estimates is None:
        return text
    objective = leading_objective(state.study)
    estimate = best.estimates[objective.name]
    scale, unit = (1e3, "ms") if objective.unit == "s" else (1.0, objective.unit)
    error = estimate.standard_error * scale
    return f"{text}, best {estimate.value * scale:.4g} ± {error:.2g} {unit}"


def sampler_of(study: Setup) -> SurrogateSampler:
    """Make the sampler of a study."""
    search = study.file.search
    startup = max(search.startup, MIN_DESIGNS)
    if search.sampler == "space_filling":
        startup = search.trials
    polish_start = search.trials - round(search.polish * search.trials)
    return SurrogateSampler(Guide(study), search.seed, startup, polish_start)


def open_search(study: Setup, folder: StudyFolder, storage: str | None, resume: bool) -> Search:
    """Open or start the search in a storage: the folder's journal file, or an Optuna URL.

    Raises StorageError for a storage that cannot be opened, or that has a search of that name with
    another configuration, or this one without ``resume``.
    """
    sampler = sampler_of(study)
    objectives = objectives_of(study)
    directions = [
        StudyDirection.MAXIMIZE if objective.maximise else StudyDirection.MINIMIZE
        for objective in objectives
    ]
    logging.getLogger("optuna").setLevel(logging.WARNING)
    with warnings.catch_warnings(action="ignore", category=ExperimentalWarning):
        backend = open_storage(folder, storage)
        try:
            stored_search = optuna.create_study(
                study_name=study.name,
                storage=backend,
                directions=directions,
                load_if_exists=True,
            )
        except ValueError as error:
            fault = f"the storage holds a study '{study.name}' with other objectives"
            raise StorageError(f"{fault}; {STORAGE_REMEDY}") from error
        if stored_search.metric_names is None:
            stored_search.set_metric_names([objective.name for objective in objectives])
    _require_same(study, stored_search, resume)
    if not isinstance(backend, RDBStorage):
        return Search(study, stored_search, sampler)
    # Shifts of different versions differ: all machines of a search need the same.
    own_versions = program_versions()
    stored_versions = stored_search.user_attrs.get("versions")
    if stored_versions is None:
        stored_search.set_user_attr("versions", own_versions)
    elif stored_versions != own_versions:
        differences = ", ".join(
            f"{name} {stored_versions.get(name)} there and {own_versions[name]} here"
            for name in own_versions
        )
        fault = f"the storage holds a study that other versions simulate ({differences})"
        raise StorageError(f"{fault}; install the same or give the study another name")
    return Search(study, stored_search, sampler, Sharing(backend, study.name))


def _require_same(study: Setup, stored_search: optuna.Study, resume: bool) -> None:
    """Raise StorageError unless the stored search is new, or this study's and to be resumed."""
    configuration = content_key(comparable(study.file))
    stored_configuration = stored_search.user_attrs.get("configuration")
    if stored_configuration is None and not stored_search.get_trials(deepcopy=False):
        stored_search.set_user_attr("configuration", configuration)
    elif stored_configuration != configuration:
        fault = f"the storage holds a study '{study.name}' of another configuration"
        raise StorageError(f"{fault}; {STORAGE_REMEDY}")
    elif not resume:
        resume_argument = argument("resume", value=True)
        remedy = f"add {resume_argument} to go on with it or give the study another name"
        raise StorageError(f"the storage holds a study '{study.name}' already; {remedy}")
