"""The search in its storage: how it is opened, and what is read of it.

Trials of a round are asked together, simulated side by side and told in the
order of their numbers (``pipeline.search.trials``), so the result does not depend on which finished
first. A round that was cut off is taken up again with the parameters it had
(``pipeline.search.rounds``); shifts that it had finished come from the journal. Several runs can
share a search: each asks for rounds of its own, and takes up those of runs that have ended.
"""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass, field

import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.search.dog_guide import DogGuide
from dogshape.pipeline.search.state import NOTHING, Findings, SearchState, state_of
from dogshape.pipeline.simulate.design import objectives_of
from dogshape.pipeline.store.claims import Claims
from dogshape.pipeline.store.folder import StudyFolder, comparable
from dogshape.pipeline.store.trial_storage import opening
from dogshape.sim.errors import StorageError
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine


@dataclass(frozen=True)
class Search:
    """Handles of a search in its storage.

    Parameters
    ----------
    study : the study that is searched.
    optuna : its trials, in their storage.
    claims : which runs share the search.
    guide : gives the surrogate of its trials; None for a search without one.
    """

    study: Setup
    optuna: optuna.Study
    claims: Claims = field(default_factory=Claims)
    guide: DogGuide | None = None

    def trials(self, findings: Findings = NOTHING) -> list[FrozenTrial]:
        """List the finished trials in the order of their numbers, with this run's findings."""
        told = [
            findings.left_open.get(t.number, t) if t.state == TrialState.RUNNING else t
            for t in self.optuna.get_trials(deepcopy=False)
        ]
        finished = [trial for trial in told if trial.state == TrialState.COMPLETE]
        return [findings.renewed.get(trial.number, trial) for trial in finished]

    def read(self, findings: Findings = NOTHING) -> SearchState:
        """List the storage once and work out where the search stands."""
        shared = self.claims.worker is not None
        return state_of(self.study, self.guide, shared, findings, self.trials(findings))


def open_search(
    study: Setup,
    folder: StudyFolder,
    storage: str | None,
    resume: bool,
    *,
    guide: DogGuide | None = None,
) -> Search:
    """Open or start the search in a storage: the folder's journal file, or an Optuna URL.

    ``guide`` gives the surrogate of the trials. Raises StorageError where the storage cannot be
    opened, or holds a search of that name which is of another configuration, is not to be resumed,
    or began with rows that an earlier version brought.
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
        if opened.metric_names is None:
            opened.set_metric_names([objective.name for objective in objectives_of(study)])
        _require_same(study, opened, resume)
        _require_own_rows(study, opened)
        if claims.worker is not None:
            _require_same_versions(opened)
    return Search(study, opened, claims, guide)


def _require_same(study: Setup, opened: optuna.Study, resume: bool) -> None:
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


def _require_own_rows(study: Setup, opened: optuna.Study) -> None:
    """Refuse to go on with a search that began with rows which an earlier version brought."""
    if opened.user_attrs.get("known"):
        raise StorageError(
            f"the search of study '{study.name}' began with rows that the package does not bring "
            "now; go on with the version of dogshape that it began with, or start it again with "
            "another name and --out"
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
