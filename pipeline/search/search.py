"""The search in its storage: what it holds, and which designs are best.

Trials of a round are asked together, simulated side by side and told in the
order of their numbers (``pipeline.search.trials``), so the result does not depend on which finished
first. A round that was cut off is taken up again with the parameters it had
(``pipeline.search.rounds``); shifts that it had finished come from the journal. Several runs can
share a search: each asks for rounds of its own, and takes up those of runs that have ended.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.study_file import Study
from dogshape.pipeline.search.dog_guide import DogGuide, distinct, simulated
from dogshape.pipeline.search.sampler import PLAN
from dogshape.pipeline.simulate.design import (
    SIMULATED,
    Design,
    design_of,
    leading,
    losses_of,
    objectives_of,
)
from dogshape.pipeline.simulate.point_plans import Plan, blocks_of, is_whole, whole_plan
from dogshape.pipeline.store.claims import Alone, Claims
from dogshape.pipeline.store.folder import StudyFolder, comparable
from dogshape.pipeline.store.trial_storage import opening
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.statistics.shift_records import content_key, landing_of
from dogshape.sim.versions import engine
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.hypervolume import not_dominated


@dataclass
class Search:
    """A search in its storage.

    ``better`` are trials as replication knows them, by number; the storage keeps what they were
    told. ``unfit`` are those that failed a check at fresh angles: they are no longer feasible.
    ``left_open`` are trials, by number, of which the clock ended a shift: what this run knows of
    them. In the storage they go on running, so that another run takes them up.
    """

    study: Study
    optuna: optuna.Study
    claims: Claims = field(default_factory=Alone)
    guide: DogGuide | None = None
    better: dict[int, FrozenTrial] = field(default_factory=dict)
    unfit: set[int] = field(default_factory=set)
    left_open: dict[int, FrozenTrial] = field(default_factory=dict)
    _foretold: tuple[int, dict[int, tuple[float, float]]] = (0, {})

    def plan(self, trial: FrozenTrial) -> Plan:
        """Return what was, or is to be, simulated of a trial's design."""
        plan: Plan = trial.system_attrs.get(PLAN) or whole_plan(self.study)
        return plan

    @property
    def foretold(self) -> dict[int, tuple[float, float]]:
        """Expected times and standard errors by trial, s, of a search that foretells some points.

        What all shifts so far say of each design. Empty where every point was simulated.
        """
        trials = self.simulated
        if self.guide is None or not any(not is_whole(self.plan(trial)) for trial in trials):
            return {}
        if self._foretold[0] != len(trials):
            try:
                times, errors = (values.tolist() for values in self.guide.times(trials))
            except InputError:  # too few so far: each has what it was told
                return {}
            numbers = [trial.number for trial in trials]
            found = dict(zip(numbers, zip(times, errors, strict=True), strict=True))
            self._foretold = len(trials), found
        return self._foretold[1]

    @property
    def trials(self) -> list[FrozenTrial]:
        """Finished trials in the order of their numbers, as all of their shifts say."""
        told = [
            self.left_open.get(trial.number, trial) if trial.state == TrialState.RUNNING else trial
            for trial in self.optuna.get_trials(deepcopy=False)
        ]
        return [self.better.get(t.number, t) for t in told if t.state == TrialState.COMPLETE]

    def renew(self, trials: Iterable[FrozenTrial]) -> None:
        """Take up what more shifts say of finished trials."""
        self.better.update((trial.number, trial) for trial in trials)
        self._foretold = 0, {}

    def leave_open(self, trial: FrozenTrial) -> None:
        """Take up what this run found of a trial, and leave it to the next run."""
        self.left_open[trial.number] = trial

    @property
    def simulated(self) -> list[FrozenTrial]:
        """Finished trials of designs that were simulated."""
        return [t for t in self.trials if simulated(t)]

    @property
    def feasible(self) -> list[FrozenTrial]:
        """Simulated designs, each once, that pass every check, the landing's too."""
        fit = [t for t in distinct(self.simulated) if t.number not in self.unfit]
        return [t for t in fit if self.design(t).feasible]

    def design(self, trial: FrozenTrial) -> Design:
        """Return the design of a trial with all of its checks."""
        landing = landing_of(trial.user_attrs) if simulated(trial) else None
        return design_of(self.study, dict(trial.params), landing)

    @property
    def rows(self) -> list[list[float | None]]:
        """Return what all simulated trials hold for the surrogate, in their order."""
        return [row for trial in self.simulated for row in trial.user_attrs["rows"]]

    @property
    def spent(self) -> int:
        """Number of shifts of all designs, each design counted once."""
        return sum(sum(self.plan(trial)) for trial in distinct(self.simulated))

    def shifts(self, known: Iterable[str]) -> int:
        """Return how many shifts there are: those known by their keys, and other runs'."""
        if self.claims.worker is None:
            return len(set(known))
        keys, settings = set(known), self.study.file.expectation
        for trial in self.simulated:
            clutch = self.study.clutch.with_dog(self.study.dog_with(dict(trial.params)))
            plan, seed, base = self.plan(trial), settings.seed, settings.angles
            blocks = blocks_of(self.study, clutch, plan, seed, base)
            keys.update(key for block in blocks for key in block.keys)
        return len(keys)


def open_search(
    study: Study, folder: StudyFolder, storage: str | None, resume: bool, known: str | None = None
) -> Search:
    """Open or start the search in a storage: the folder's journal file, or an Optuna URL.

    ``known`` is the hash of the rows that join (``pipeline.train.found_surrogates``); None to leave
    it open. Raises StorageError where the storage cannot be opened, or holds a search of that name
    which is of another configuration, is not to be resumed, or began with other rows.
    """
    logging.getLogger("optuna").setLevel(logging.WARNING)
    with warnings.catch_warnings(), opening(folder, storage, study.name) as (backend, claims):
        warnings.simplefilter("ignore", ExperimentalWarning)
        try:
            opened = optuna.create_study(
                study_name=study.name,
                storage=backend,
                directions=["maximize" if o.maximise else "minimize" for o in objectives_of(study)],
                load_if_exists=True,
            )
        except ValueError as error:
            raise StorageError(
                f"the storage holds a study '{study.name}' with other objectives; "
                "give the study another name or use another storage"
            ) from error
        _require_same(study, opened, resume)
        if known is not None:
            _require_same_known(study, opened, known)
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


def _require_same_known(study: Study, opened: optuna.Study, known: str) -> None:
    """Refuse to go on with other rows of the package than the search began with."""
    before = opened.user_attrs.get("known")
    if before is None:
        opened.set_user_attr("known", known)
    elif before != known:
        began = "with other rows than the package brings now"
        if not known:
            began = "with rows that the package does not bring now"
        elif not before:
            began = "without the rows that the package brings now"
        raise StorageError(
            f"the search of study '{study.name}' began {began}; go on with the version of "
            "dogshape that it began with, or start it again with another name and --out"
        )


def _require_same_versions(opened: optuna.Study) -> None:
    """Refuse a machine whose shifts would differ from those of the others."""
    here = engine()
    known = opened.user_attrs.get("versions")
    if known is None:
        opened.set_user_attr("versions", here)
    elif known != here:
        apart = ", ".join(f"{n} {known.get(n)} there and {here[n]} here" for n in here)
        raise StorageError(
            f"the storage holds a study that other versions simulate ({apart}); install the same "
            "or give the study another name"
        )


def value_of(search: Search, trial: FrozenTrial, name: str) -> tuple[float, float]:
    """Return what a simulated trial has of the expected time or an objective, and its error."""
    if name == SIMULATED and trial.number in (times := search.foretold):
        return times[trial.number]
    names, attributes = search.study.file.search.objectives, trial.user_attrs
    errors = attributes.get("standard_errors", {SIMULATED: attributes.get("standard_error_s")})
    simulated = attributes.get("simulated", {})
    value = simulated[name] if name in simulated else trial.values[names.index(name)]
    return float(value), float(errors.get(name) or 0.0)


def losses(search: Search, trial: FrozenTrial) -> Array:
    """Return a trial's objectives, all to be minimised, (k,)."""
    found, _ = losses_of(search.study, trial.values, trial.user_attrs)
    if trial.number in (times := search.foretold):
        for place, objective in enumerate(objectives_of(search.study)):
            found[place] = times[trial.number][0] if objective.name == SIMULATED else found[place]
    return found


def leading_loss(search: Search, trial: FrozenTrial) -> float:
    """Return the first simulated objective of a trial, to be minimised."""
    place = objectives_of(search.study).index(leading(search.study))
    return float(losses(search, trial)[place])


def best_trial(search: Search) -> FrozenTrial | None:
    """Return the feasible design that is best in the first simulated objective."""
    return min(search.feasible, key=lambda t: leading_loss(search, t), default=None)


def front(search: Search) -> list[FrozenTrial]:
    """Return the feasible designs that no other dominates, best of the first simulated first."""
    trials = search.feasible
    if not trials:
        return []
    kept = not_dominated(np.array([losses(search, t) for t in trials]))
    front = [trial for trial, keep in zip(trials, kept, strict=True) if keep]
    return sorted(front, key=lambda t: leading_loss(search, t))
