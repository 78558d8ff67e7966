"""Effect of a cause on the choice of a design.

Designs of a study are simulated without and with the cause at the same relative angles, which the
search did not use. The cost of ignoring the cause is the time of the chosen design less that of the
best design, both with it. Only designs of the search without the cause are compared, so the cost
may be larger. Designs whose dogs do not withstand the landings with the cause are not best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.terms import REVERSED, UNKNOWN
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.diagnose.bank_diagnosis import Means
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
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Runner, even_block
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.statistics.hangs import pool
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.landing import demand_checks
from dogshape.sim.versions import bundled_root

ANGLES = 6  #: of each design at each operating point
DESIGNS = 6  #: of the search, the fastest
LEAST = 0.01  #: probability from which a cause is simulated with a study's designs
#: Effects of the stand: its sense of rotation, and how often it meets each relative angle.
OF_STAND = {REVERSED, "relative_angle"}

Cause = Mapping[str, Values]  #: values of the parameters of each effect


@dataclass(frozen=True)
class Candidate:
    """A design with its times without and with the cause, and its worst landing with it."""

    name: str
    params: Params
    without: Expectation
    with_effect: Expectation
    landing: Check


@dataclass(frozen=True)
class Consequence:
    """Consequence of a cause; of the candidates the second is the choice of the study."""

    study: str
    cause: Cause
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """Choice of the study, without the cause."""
        return self.candidates[1]

    @property
    def best(self) -> Candidate:
        """Fastest candidate with the cause, of those that withstand its landings, if any do."""
        lasting = [one for one in self.candidates if one.landing.passed]
        return min(lasting or self.candidates, key=lambda one: one.with_effect.mean)

    @property
    def regret(self) -> float:
        """Cost of choosing without the cause, with the cause acting, s."""
        return self.chosen.with_effect.mean - self.best.with_effect.mean

    @property
    def standard_error(self) -> float:
        """Standard error of the regret, s; angles that both share are not counted on."""
        both = self.chosen.with_effect, self.best.with_effect
        return math.hypot(*(one.standard_error for one in both)) if both[0] is not both[1] else 0.0

    @property
    def sentence(self) -> str:
        """Consequence in words: the choice, its cost, and designs that fail at landings."""
        chosen, best = self.chosen, self.best
        cost = f"{self.regret * 1e3:.1f} ± {self.standard_error * 1e3:.1f} ms"
        more = f"; the chosen {chosen.name} costs {cost}" if chosen.landing.passed else ""
        moved = f"With the cause {best.name} is best{more}."
        said = f"The chosen design stays the best ({best.name})." if chosen is best else moved
        fail = [one.name for one in self.candidates if not one.landing.passed]
        return f"{said} Landings with the cause overload {', '.join(fail)}." if fail else said

    @property
    def record(self) -> dict[str, Any]:
        """Record as JSON takes it."""
        return {
            "study": self.study,
            "effects": list(self.cause),
            "values": [value for values in self.cause.values() for value in values.values()],
            "candidates": [
                {
                    "name": one.name,
                    **one.params,
                    "without_s": one.without.mean,
                    "without_standard_error_s": one.without.standard_error,
                    "with_s": one.with_effect.mean,
                    "with_standard_error_s": one.with_effect.standard_error,
                    "with_landing_margin": one.landing.margin,
                    "with_landing_check": one.landing.name,
                }
                for one in self.candidates
            ],
            "best_without": self.chosen.name,
            "best_with": self.best.name,
            "regret_s": self.regret,
            "regret_standard_error_s": self.standard_error,
            "sentence": self.sentence,
        }


def studied(where: str | Path) -> tuple[Setup, dict[str, Params]]:
    """Read a study or a folder of results, and its prototype and fastest feasible designs.

    The chosen design comes first after the prototype; designs that failed at new angles are left
    out. Raises DataError where no result is kept, StorageError where it is damaged.
    """
    folder = StudyFolder(Path(where))
    if folder.manifest.is_file():
        study, folders = folder.stored_study(), [folder]
        remedy = f"run 'dogshape study' with --resume and --out {where}"
    else:
        study = load_study(where)
        folders = [StudyFolder(default_out(study)), StudyFolder(bundled_root() / study.name)]
        remedy = f"run 'dogshape study {where}' first, or name the folder of its results"
    for one in folders:
        if one.result.is_file():
            return study, _designs(study, one.stored_result())
    raise DataError(f"there is no result of the study {study.name} in {folders[0].root}; {remedy}")


def _designs(study: Setup, result: Mapping[str, Any]) -> dict[str, Params]:
    confirmation = result["confirmation"] or {"chosen": None, "designs": []}
    designs, chosen = confirmation["designs"], confirmation["chosen"]
    failed = {one["trial"] for one in designs if not all(c["passed"] for c in one["checks"])}
    rows = [row for row in result["trials"] if row["feasible"] and not row["prototype"]]
    rows = [row for row in rows if row["trial"] not in failed]
    rows.sort(key=lambda row: (row["trial"] != chosen, row["expected_shift_time_s"]))
    return {"prototype": study.prototype} | {
        f"design {row['trial']}": {key: row[key] for key in study.variables}
        for row in rows[:DESIGNS]
    }


def consequence(
    study: Setup,
    designs: Mapping[str, Params],
    cause: Cause,
    effects: Mapping[str, Effect],
    run: Runner,
) -> Consequence:
    """Simulate designs without and with a cause; InputError for values of no bench."""
    seed, every = study.file.expectation.seed + 3 * NEW_ANGLES, list[list[Setting]]()
    for acting, params in product(({}, cause), designs.values()):
        clutch = replace(study.clutch, dog=study.dog_with(params))
        settings = [Setting(clutch, point) for point in study.points]
        for name, values in acting.items():
            settings = [effects[name].apply(setting, values) for setting in settings]
        every.append(settings)
    rows = iter(
        run(
            [
                even_block(setting.clutch, setting.point, ANGLES, (seed, k))
                for settings in every
                for k, setting in enumerate(settings)
            ]
        )
    )
    found = [_timed(study, settings, [next(rows) for _ in settings]) for settings in every]
    before, after = (_pooled(group) for group in (found[: len(designs)], found[len(designs) :]))
    pairs = zip(designs.items(), before, after, strict=True)
    return Consequence(
        study.name,
        cause,
        tuple(
            Candidate(name, params, without, with_effect, landing)
            for (name, params), (without, _), (with_effect, landing) in pairs
        ),
    )


def _pooled(timed: Sequence[tuple[Expectation, Check]]) -> list[tuple[Expectation, Check]]:
    """Estimate times by a prior of hangs that is fitted to all designs."""
    priors = pool([[(p.hangs, p.n) for p in expectation.points] for expectation, _ in timed])
    return [(expectation.under(priors), check) for expectation, check in timed]


def _timed(
    study: Setup, settings: Sequence[Setting], rows: Sequence[Sequence[Record]]
) -> tuple[Expectation, Check]:
    """Compute a design's expected time, and the check of its landings that has the least margin."""
    timed = [
        [row | {"shift_time_s": setting.time_of(row)} for row in mine]
        for setting, mine in zip(settings, rows, strict=True)
    ]
    own = replace(study, clutch=settings[0].clutch)
    found = expectation_of(own, [setting.point for setting in settings], timed)
    demand = landings_over(found, rows).demand(own.clutch.dog, study.limits)
    return found, min(demand_checks(demand, study.limits), key=lambda one: one.margin)


def price_of(found: Diagnosis, study: str, means: Means, folder: Path) -> Consequence:
    """Compute the consequence of the most probable cause for the best designs of a study.

    Effects have the means of their parameters; those ``OF_STAND`` do not count. Unfinished
    simulations stay in ``folder``. Raises InputError where no effect is probable.
    """
    cause = next((h for h in found.posterior if h != UNKNOWN and set(h) - OF_STAND), None)
    if cause is None or found.posterior[cause] < LEAST:
        raise InputError(
            f"--study is '{study}', but the diagnosis of {found.bench.name} has no effect above "
            f"{100 * LEAST:.0f} %; leave --study out"
        )
    given, designs = studied(study)
    values = {
        name: {p.name: found.fits[cause].intervals[p.name].mean for p in effect.parameters}
        for name, effect in found.effects.items()
        if name in cause and name not in OF_STAND
    }
    where, shifts = (
        RunOptions(means.jobs, None, folder, means.progress),
        2 * ANGLES * len(given.points),
    )
    with where.executor("so-what", (given.config_hash,), shifts * len(designs)) as (executor, _):
        return consequence(given, designs, values, found.effects, executor.run)
