"""Effect of a cause on the choice of a design.

Designs of a study are simulated without and with the cause at the same relative angles, which the
search did not use. The cost of ignoring the cause is the time of the chosen design less that of the
best design, both with the cause. Only designs of the search without the cause are compared, so the
cost may be larger. Designs whose dogs do not withstand the landings with the cause are not best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dogshape.diagnosis.diagnosis import Inference
from dogshape.diagnosis.terms import REVERSED, UNKNOWN
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.diagnose.bank_diagnosis import BankOptions
from dogshape.pipeline.search.study_record import StudyRecord, read_study_record
from dogshape.pipeline.simulate.evaluation import (
    NEW_ANGLES,
    Params,
    expectation_of,
    landings_over,
)
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.effect import Effect, Values
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.interface import argument, verb
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Runner, even_block
from dogshape.sim.statistics.expectation import MixExpectation
from dogshape.sim.statistics.hangs import pool
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.checks import LimitCheck
from dogshape.sim.strength.landing import demand_checks
from dogshape.sim.versions import bundled_root, clone_remedy

ANGLES = 6  #: of each design at each operating point
DESIGNS = 6  #: of the search, the fastest
MIN_PROBABILITY = 0.01  #: of a cause that is simulated with a study's designs
#: Effects of the stand: its sense of rotation, and how often it meets each relative angle.
OF_STAND = {REVERSED, "relative_angle"}

Cause = Mapping[str, Values]  #: values of the parameters of each effect


@dataclass(frozen=True)
class Candidate:
    """Design with its times without and with the cause, and its worst landing with the cause."""

    name: str
    params: Params
    without: MixExpectation
    with_effect: MixExpectation
    landing: LimitCheck

    @property
    def record(self) -> dict[str, Any]:
        """Record as JSON takes it; times in s."""
        return {
            "name": self.name,
            **self.params,
            "without_s": self.without.mean,
            "without_standard_error_s": self.without.standard_error,
            "with_s": self.with_effect.mean,
            "with_standard_error_s": self.with_effect.standard_error,
            "with_landing_margin": self.landing.margin,
            "with_landing_check": self.landing.name,
        }


@dataclass(frozen=True)
class Consequence:
    """Consequence of a cause for the choice of a design."""

    study: str  #: its name
    cause: Cause
    candidates: tuple[Candidate, ...]  #: the prototype, the study's choice, and others

    @property
    def chosen(self) -> Candidate:
        """Choice of the study, without the cause."""
        return self.candidates[1]

    @property
    def best(self) -> Candidate:
        """Fastest candidate with the cause, of those that withstand its landings, if any do."""
        lasting = [candidate for candidate in self.candidates if candidate.landing.passed]
        return min(lasting or self.candidates, key=lambda candidate: candidate.with_effect.mean)

    @property
    def regret(self) -> float:
        """Cost of choosing without the cause, with the cause acting, s."""
        return self.chosen.with_effect.mean - self.best.with_effect.mean

    @property
    def standard_error(self) -> float:
        """Standard error of the regret, s, as if both designs had different angles."""
        chosen, best = self.chosen.with_effect, self.best.with_effect
        if chosen is best:
            return 0.0
        return math.hypot(chosen.standard_error, best.standard_error)

    @property
    def sentence(self) -> str:
        """Consequence in words: the choice, its cost, and designs that fail at landings."""
        chosen = self.chosen
        best = self.best
        if chosen is best:
            text = f"The chosen design stays the best ({best.name})."
        elif chosen.landing.passed:
            cost = f"{self.regret * 1e3:.1f} ± {self.standard_error * 1e3:.1f} ms"
            text = f"With the cause {best.name} is best; the chosen {chosen.name} costs {cost}."
        else:
            text = f"With the cause {best.name} is best."
        failing = [candidate.name for candidate in self.candidates if not candidate.landing.passed]
        if failing:
            text += f" Landings with the cause overload {', '.join(failing)}."
        return text

    @property
    def record(self) -> dict[str, Any]:
        """Record as JSON takes it."""
        values = [value for parameters in self.cause.values() for value in parameters.values()]
        return {
            "study": self.study,
            "effects": list(self.cause),
            "values": values,
            "candidates": [candidate.record for candidate in self.candidates],
            "best_without": self.chosen.name,
            "best_with": self.best.name,
            "regret_s": self.regret,
            "regret_standard_error_s": self.standard_error,
            "sentence": self.sentence,
        }


def load_candidates(place: str | Path) -> tuple[Setup, dict[str, Params]]:
    """Read a study or a folder of results, and its prototype and fastest feasible designs.

    The chosen design comes first after the prototype; designs that failed at new angles are left
    out. Raises DataError where no result is kept, StorageError where it is damaged.
    """
    result_folder = StudyFolder(Path(place))
    if result_folder.manifest.is_file():
        study = result_folder.stored_study()
        folders = [result_folder]
        remedy = f"run {verb('search', resume=True, out=str(place))}"
    else:
        study = load_study(place)
        folders = [StudyFolder(default_out(study)), StudyFolder(bundled_root() / study.name)]
        remedy = f"run {verb('search', str(place))} first, or name the folder of its results"
        remedy += clone_remedy(study.name)
    for folder in folders:
        if folder.result.is_file():
            return study, _designs(study, read_study_record(folder))
    raise DataError(f"there is no result of the study {study.name} in {folders[0].root}; {remedy}")


def _designs(study: Setup, result: StudyRecord) -> dict[str, Params]:
    """Select the prototype and the fastest designs of a result by name, the choice first."""
    chosen = None
    failed_trials = set()
    if result.confirmation is not None:
        chosen = result.confirmation.chosen
        for confirmed in result.confirmation.designs:
            if not all(check.passed for check in confirmed.checks):
                failed_trials.add(confirmed.trial)
    candidates = [
        design
        for design in result.trials
        if design.feasible and not design.prototype and design.trial not in failed_trials
    ]
    candidates.sort(
        key=lambda design: (design.trial != chosen, design.expected_shift_time_s or 0.0)
    )
    designs = {"prototype": study.prototype}
    for design in candidates[:DESIGNS]:
        designs[f"design {design.trial}"] = design.params(study.variables)
    return designs


def simulate_consequence(
    study: Setup,
    designs: Mapping[str, Params],
    cause: Cause,
    effects: Mapping[str, Effect],
    run: Runner,
) -> Consequence:
    """Simulate designs without and with a cause; InputError for values that no bench has.

    Parameters
    ----------
    study
        Study of the designs.
    designs
        Searched keys by name; the first is the prototype, the second the study's choice.
    cause
        Parameters of each effect of the cause.
    effects
        Effects by name.
    run
        Simulates blocks of shifts.

    """
    settings_without = [_settings(study, params, {}, effects) for params in designs.values()]
    settings_with = [_settings(study, params, cause, effects) for params in designs.values()]
    all_settings = [*settings_without, *settings_with]
    seed = study.file.expectation.seed + 3 * NEW_ANGLES
    blocks = []
    for settings in all_settings:
        for index, setting in enumerate(settings):
            blocks.append(even_block(setting.clutch, setting.point, ANGLES, (seed, index)))
    rows = iter(run(blocks))
    design_studies = [study.with_design(params) for params in designs.values()]
    timed = [
        _time_design(design_study, settings, [next(rows) for _ in settings])
        for design_study, settings in zip(2 * design_studies, all_settings, strict=True)
    ]
    timed_without = _pool_hangs(timed[: len(designs)])
    timed_with = _pool_hangs(timed[len(designs) :])
    candidates = []
    for (name, params), (without, _), (with_effect, landing) in zip(
        designs.items(), timed_without, timed_with, strict=True
    ):
        candidates.append(Candidate(name, params, without, with_effect, landing))
    return Consequence(study.name, cause, tuple(candidates))


def _settings(
    study: Setup, params: Params, cause: Cause, effects: Mapping[str, Effect]
) -> list[Setting]:
    """Build the setting of a design with a cause at each operating point of a study."""
    clutch = study.clutch_with(params)
    settings = [Setting(clutch, point) for point in study.points]
    for name, values in cause.items():
        settings = [effects[name].apply(setting, values) for setting in settings]
    return settings


def _pool_hangs(
    timed: Sequence[tuple[MixExpectation, LimitCheck]],
) -> list[tuple[MixExpectation, LimitCheck]]:
    """Estimate times by a prior of hangs that is fitted to all designs."""
    priors = pool([expectation.hang_counts for expectation, _ in timed])
    return [(expectation.replace_priors(priors), check) for expectation, check in timed]


def _time_design(
    study: Setup, settings: Sequence[Setting], rows: Sequence[Sequence[Record]]
) -> tuple[MixExpectation, LimitCheck]:
    """Compute the expected time of a design and its landing check of the smallest margin.

    ``settings`` and ``rows``, its shifts, are by operating point.
    """
    timed_rows = []
    for setting, shifts in zip(settings, rows, strict=True):
        timed_rows.append([shift | {"shift_time_s": setting.time_of(shift)} for shift in shifts])
    design_study = replace(study, clutch=settings[0].clutch)
    points = [setting.point for setting in settings]
    expectation = expectation_of(design_study, points, timed_rows)
    dog = design_study.clutch.dog
    demand = landings_over(expectation, rows).demand(dog, study.limits)
    landing = min(demand_checks(dog, demand, study.limits), key=lambda check: check.margin)
    return expectation, landing


def compute_consequence(
    diagnosis: Inference, study: str, options: BankOptions, folder: Path
) -> Consequence:
    """Compute the consequence of the most probable cause for the best designs of a study.

    Effects have the means of their parameters; those ``OF_STAND`` do not count. Unfinished
    simulations stay in ``folder``. Raises InputError where no effect is probable.
    """
    posterior = diagnosis.posterior
    cause = next((h for h in posterior if h != UNKNOWN and set(h) - OF_STAND), None)
    if cause is None or posterior[cause] < MIN_PROBABILITY:
        raise InputError(
            f"{argument('study')} is '{study}', but the diagnosis of {diagnosis.bench.name} has no "
            f"effect above {100 * MIN_PROBABILITY:.0f} %; leave {argument('study')} out"
        )
    setup, designs = load_candidates(study)
    intervals = diagnosis.fits[cause].intervals
    values = {}
    for name, effect in diagnosis.effects.items():
        if name in cause and name not in OF_STAND:
            values[name] = {
                parameter.name: intervals[parameter.name].mean for parameter in effect.parameters
            }
    run_options = RunOptions(options.jobs, None, folder, options.progress)
    shift_count = 2 * ANGLES * len(setup.points) * len(designs)
    with run_options.executor("so-what", (setup.config_hash,), shift_count) as (executor, _):
        return simulate_consequence(
            setup, designs, values, effects=diagnosis.effects, run=executor.run
        )
