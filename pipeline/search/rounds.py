"""Rounds of a search: which trials are asked together, and how one that was cut off goes on.

Every trial says which round it is of: how many were begun before the round, and its size. A round
that was cut off while it was asked is asked to its end; one that was cut off while it was told ends
with the trials it has. So the rounds after it are those of a search that was never cut off.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import optuna
from optuna.distributions import BaseDistribution
from optuna.samplers import BaseSampler
from optuna.trial import FrozenTrial, TrialState

from dogshape.pipeline.search.dog_guide import search_space
from dogshape.pipeline.search.sampler import SurrogateSampler
from dogshape.pipeline.search.samplers import startup_designs
from dogshape.pipeline.search.search import Search
from dogshape.pipeline.search.state import NOTHING, Findings, SearchState
from dogshape.pipeline.search.trials import finish
from dogshape.pipeline.simulate.design import leading
from dogshape.pipeline.simulate.executor import Executor

WORKER = "worker"  #: attribute of a trial: number of the run that is at it
ROUND = "round"  #: attribute of a trial: how many were begun before its round, and its size
OVER = (TrialState.FAIL, TrialState.WAITING)  #: states of trials that are of no round

SamplerOf = Callable[[int], BaseSampler]  #: gives the sampler of a proposal by its number
#: called with a line about the search so far, and its state
AfterRound = Callable[[str, SearchState], None]


def run(
    search: Search,
    sampler_of: SamplerOf,
    executor: Executor,
    after_round: AfterRound,
    findings: Findings = NOTHING,
) -> SearchState:
    """Run the search until the study's number of trials is finished, by this run and others.

    It ends sooner where the space has fewer designs than that. Give the state at its end.
    """
    waiting = False
    while True:
        with search.claims.turn():
            ids = next_round(search, sampler_of, findings)
            ended = not ids and exhausted(search, sampler_of, findings)
        if ids:
            waiting = False
            findings = finish(search, ids, executor, findings)
            state = search.read(findings)
            after_round(_status(state), state)
            continue
        state = search.read(findings)
        if (left := search.study.file.search.trials - len(state.trials)) <= 0:
            return state
        if ended:
            line = f"every design that passes the checks was tried: {left} fewer than wanted"
            after_round(line, state)
            return state
        if not waiting:
            after_round(f"waiting for {left} designs that other runs simulate", state)
        waiting = True
        search.claims.wait()


def _status(state: SearchState) -> str:
    best = state.best
    text = f"{len(state.trials)} of {state.study.file.search.trials} designs"
    if best is not None:
        one = leading(state.study)
        value, error = state.value(best, one.name)
        scale, unit = (1e3, "ms") if one.unit == "s" else (1.0, one.unit)
        text += f", best {value * scale:.4g} {unit} +- {error * scale:.2g}"
    return text


def next_round(search: Search, sampler_of: SamplerOf, findings: Findings = NOTHING) -> list[int]:
    """Ask for the trials of this run's next round: one that was cut off, or else a new one.

    What other runs have asked for counts as if it were finished, so none is asked too many.
    """
    told = [t for t in search.optuna.get_trials(deepcopy=False) if t.state != TrialState.FAIL]
    if not any(trial.user_attrs.get("prototype") for trial in told):
        search.optuna.enqueue_trial(search.study.prototype, user_attrs={"prototype": True})
    cut = _cut_off(search, findings)
    mine, mark = _of_one_round(search, cut, findings)
    ids = [trial._trial_id for trial in mine]
    for trial_id in ids:
        _claim(search, trial_id, mark)
    space, begun = search_space(search.study), len(_begun(search))
    end = min(begun + _open(search, mark), search.study.file.search.trials)
    for number in range(begun, end):
        # Seeded by its number alone, a proposal does not depend on where a round was cut off.
        search.optuna.sampler = sampler_of(number)
        if _none_left(search):
            break
        ids.append(_ask(search, space))
        _claim(search, ids[-1], mark)
    return ids


def _ask(search: Search, space: dict[str, BaseDistribution]) -> int:
    """Ask for a trial; one that was put back draws again what it has, so that the rest follows."""
    trial, sampler = search.optuna.ask(), search.optuna.sampler
    cut = search.optuna._storage.get_trial(trial._trial_id)
    fixed = cut.system_attrs.get("fixed_params", {})
    for name, distribution in space.items():
        drawn = name in cut.params and name not in fixed and not distribution.single()
        if drawn and name not in trial.relative_params:
            sampler.sample_independent(search.optuna, cut, name, distribution)
        with warnings.catch_warnings():
            # The study's own dog may lie outside the ranges, which the run has said.
            warnings.filterwarnings("ignore", "Fixed parameter", UserWarning)
            trial._suggest(name, distribution)
    return trial._trial_id


def exhausted(search: Search, sampler_of: SamplerOf, findings: Findings = NOTHING) -> bool:
    """Check whether every design that may be proposed was told: its space has no others."""
    search.optuna.sampler = sampler_of(len(_begun(search)))
    return not _running(search, findings) and _none_left(search)


def _none_left(search: Search) -> bool:
    """Check whether the study's own sampler could only propose designs again."""
    sampler = search.optuna.sampler
    if search.optuna.get_trials(deepcopy=False, states=(TrialState.WAITING,)):
        return False
    return isinstance(sampler, SurrogateSampler) and sampler.exhausted(search.optuna)


def _begun(search: Search) -> list[FrozenTrial]:
    """List the trials that were asked: running or told."""
    return [t for t in search.optuna.get_trials(deepcopy=False) if t.state not in OVER]


def _running(search: Search, findings: Findings) -> list[FrozenTrial]:
    """List the trials that were asked and not told, but for those this run leaves open."""
    running = search.optuna.get_trials(deepcopy=False, states=(TrialState.RUNNING,))
    return [trial for trial in running if trial.number not in findings.left_open]


def _cut_off(search: Search, findings: Findings) -> list[FrozenTrial]:
    """List the trials that a dead run asked and did not tell.

    One that was cut off while it was asked is asked again under its number. Where others were
    asked after it, it would propose one of their designs: then it has failed.
    """
    left, living = [], search.claims.living()
    names = set(search.study.variables)
    for trial in _running(search, findings):
        if trial.user_attrs.get(WORKER) in living:
            continue
        if names <= set(trial.params):
            left.append(trial)
        elif trial.number == search.optuna.get_trials(deepcopy=False)[-1].number:
            search.optuna._storage.set_trial_state_values(trial._trial_id, TrialState.WAITING)
        else:
            search.optuna.tell(trial.number, state=TrialState.FAIL)
    return left


def _of_one_round(
    search: Search, cut: Sequence[FrozenTrial], findings: Findings
) -> tuple[list[FrozenTrial], list[int]]:
    """Select the trials of the first round that was cut off, and its mark; a new one if none was.

    A run may be killed between asking for a trial and marking it: that trial was the last one
    asked of its round.
    """
    bare = [trial for trial in cut if ROUND not in trial.user_attrs]
    mark = next((trial.user_attrs[ROUND] for trial in cut if ROUND in trial.user_attrs), None)
    if mark is None:
        begun, settings = len(_begun(search)) - len(bare), search.study.file.search
        size, guide = settings.batch, search.guide
        if guide is not None and guide.partial and not search.trials(findings):
            # Only with all of the first designs can any of them be told what it lacks.
            size = max(size, startup_designs(search.study))
        return bare, [begun, min(size, settings.trials - begun)]
    mine = [trial for trial in cut if trial.user_attrs.get(ROUND) == mark]
    return mine + bare[: _open(search, mark)], mark


def _open(search: Search, mark: list[int]) -> int:
    """Count the trials of a round that were never asked."""
    asked = [trial for trial in _begun(search) if trial.user_attrs.get(ROUND) == mark]
    return mark[1] - len(asked)


def _claim(search: Search, trial_id: int, mark: list[int]) -> None:
    trial = optuna.Trial(search.optuna, trial_id)
    trial.set_user_attr(ROUND, mark)
    if search.claims.worker is not None:
        trial.set_user_attr(WORKER, search.claims.worker)
