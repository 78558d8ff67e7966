"""Effect of a cause on the choice of a design.

Designs of a study are simulated without and with the cause at the same relative angles, which the
search did not use. The cost of ignoring the cause is the time of the chosen design less that of the
best design, both with it. Only designs of the search without the cause are compared, so the cost
may be larger. Designs whose dogs do not withstand the landings with the cause are not best.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dogshape.diagnosis.diagnosis import Diagnosis
from dogshape.diagnosis.terms import REVERSED, UNKNOWN
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.diagnose.bank_diagnosis import Means
from dogshape.pipeline.progress import WorkCounter
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, demand_over
from dogshape.pipeline.simulate.executor import kept_shifts, work_folder
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.effect import Effect, Values
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import Runner, even_block
from dogshape.sim.statistics.expectation import Expectation, expect, expect_point
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.landing import demand_checks
from dogshape.sim.versions import bundled_root

ANGLES = 6  #: of each design at each operating point
DESIGNS = 6  #: of the search, the fastest
SURE = 2.0  #: standard errors from which a cost is significant
LEAST = 0.01  #: probability from which a cause is simulated with a study's designs
#: Effects of the stand: its sense of rotation, and how often it meets each relative angle.
OF_STAND = {REVERSED, "relative_angle"}

Params = Mapping[str, float]
Cause = Mapping[str, Values]  #: values of the parameters of each effect


@dataclass(frozen=True)
class Candidate:
    """A design with its expected shift time, at the sleeve, without and with the cause.

    ``landing`` and ``landing_with`` are the checks of its landings that have the least margin.
    """

    name: str
    params: Params
    without: Expectation
    with_effect: Expectation
    landing: Check
    landing_with: Check


@dataclass(frozen=True)
class Consequence:
    """Consequence of a cause for the choice of a design.

    Of the candidates the first is the prototype, the second the choice of the study.
    """

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
        lasting = [one for one in self.candidates if one.landing_with.passed]
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
        if chosen is best:
            said = f"The chosen design stays the best ({chosen.name})."
        elif not chosen.landing_with.passed:
            said = f"With the cause the chosen design ({chosen.name}) fails; {best.name} is best."
        elif self.regret < SURE * self.standard_error:
            said = f"The chosen design ({chosen.name}) stays as good as {best.name} ({cost})."
        else:
            said = f"With the cause {best.name} is best; the chosen {chosen.name} costs {cost}."
        fail = [one.name for one in self.candidates if not one.landing_with.passed]
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
                    "without_landing_margin": one.landing.margin,
                    "with_landing_margin": one.landing_with.margin,
                    "with_landing_check": one.landing_with.name,
                }
                for one in self.candidates
            ],
            "best_without": self.chosen.name,
            "best_with": self.best.name,
            "regret_s": self.regret,
            "regret_standard_error_s": self.standard_error,
            "sentence": self.sentence,
        }


def studied(where: str | Path, count: int = DESIGNS) -> tuple[Setup, dict[str, Params]]:
    """Read a study, and prototype and fastest feasible designs of its result by name.

    ``where`` is a folder of results or a study. The chosen design comes first after the prototype;
    designs that failed at new angles are left out. Raises DataError where no result is kept,
    StorageError where it is damaged.
    """
    folder = StudyFolder(Path(where))
    if folder.manifest.is_file():
        study = folder.stored_study()
        if not folder.result.is_file():
            raise DataError(
                f"the study in {where} has no result; run 'dogshape study' with --resume and "
                f"--out {where}"
            )
        return study, _designs(study, folder.stored_result(), count)
    study = load_study(where)
    own = StudyFolder(default_out(study))
    for path in (own.result, bundled_root() / study.name / "result.json"):
        if path.is_file():
            return study, _designs(study, json.loads(path.read_text(encoding="utf-8")), count)
    raise DataError(
        f"there is no result of the study {study.name} in {own.root}; run 'dogshape study {where}' "
        "first, or name the folder of its results"
    )


def _designs(study: Setup, result: Mapping[str, Any], count: int) -> dict[str, Params]:
    confirmation = result["confirmation"] or {"chosen": None, "designs": []}
    failed = {
        one["trial"]
        for one in confirmation["designs"]
        if not all(check["passed"] for check in one["checks"])
    }
    rows = [
        row
        for row in result["trials"]
        if row["feasible"] and not row["prototype"] and row["trial"] not in failed
    ]
    chosen = confirmation["chosen"]
    rows.sort(key=lambda row: (row["trial"] != chosen, row["expected_shift_time_s"]))
    return {"prototype": study.prototype} | {
        f"design {row['trial']}": {key: row[key] for key in study.variables} for row in rows[:count]
    }


def consequence(
    study: Setup,
    designs: Mapping[str, Params],
    cause: Cause,
    effects: Mapping[str, Effect],
    run: Runner,
) -> Consequence:
    """Simulate designs without and with a cause.

    ``run`` simulates blocks. Values of which there is no such bench raise InputError.
    """
    every, seed = [], study.file.expectation.seed + 3 * NEW_ANGLES
    for acting in ({}, cause):
        for params in designs.values():
            clutch = study.clutch.with_dog(study.dog_with(dict(params)))
            for point in study.points:
                setting = Setting(clutch, point)
                for name, values in acting.items():
                    setting = effects[name].apply(setting, values)
                every.append(setting)
    places = len(study.points)
    rows = run(
        [even_block(s.clutch, s.point, ANGLES, (seed, k % places)) for k, s in enumerate(every)]
    )
    found = [
        _timed(study, every[k : k + places], rows[k : k + places])
        for k in range(0, len(every), places)
    ]
    pairs = zip(designs.items(), found[: len(designs)], found[len(designs) :], strict=True)
    return Consequence(study.name, cause, tuple(
        Candidate(name, params, before, after, landing, landing_with)
        for (name, params), (before, landing), (after, landing_with) in pairs
    ))  # fmt: skip


def _timed(
    study: Setup, settings: Sequence[Setting], rows: Sequence[Sequence[Record]]
) -> tuple[Expectation, Check]:
    """Compute a design's expected time, and the check of its landings that has the least margin."""
    points = []
    for setting, mine in zip(settings, rows, strict=True):
        shifts = [replace(result_of(row), shift_time=setting.time_of(row)) for row in mine]
        point = expect_point(setting.point, shifts, setting.clutch.timeout, study.retraction)
        points.append(point)
    found, clutch, load = expect(points), settings[0].clutch, study.limits.load
    if load.edge_bed is not None:  # The energy of a blow is that on the bed that was simulated.
        load = replace(load, edge_bed=clutch.contact.stiffness)
        study = replace(study, limits=replace(study.limits, load=load))
    checks = demand_checks(demand_over(study, clutch.dog, found, rows), study.limits)
    return found, min(checks, key=lambda one: one.margin)


def price_of(found: Diagnosis, study: str, means: Means, folder: Path) -> Consequence:
    """Compute the consequence of the cause for the best designs of a study.

    The cause is the most probable set of effects but those ``OF_STAND``, at the means of its
    parameters. Finished simulations stay in a folder below ``folder`` until all are. Raises
    InputError where no effect is probable.
    """
    known = (h for h in found.posterior if h != UNKNOWN and set(h) - OF_STAND)
    cause = next(known, None)
    if cause is None or found.posterior[cause] < LEAST:
        raise InputError(
            f"--study is '{study}', but the diagnosis of {found.bench.name} has no effect above "
            f"{LEAST:.0%}; leave --study out"
        )
    given, designs = studied(study)
    values = {
        name: {p.name: found.fits[cause].interval(p.name).mean for p in effect.parameters}
        for name, effect in found.effects.items()
        if name in cause and name not in OF_STAND
    }
    count = 2 * ANGLES * len(given.points) * len(designs)
    with (
        WorkCounter(means.progress, count) as progress,
        kept_shifts(
            work_folder(folder, "so-what", given.config_hash), progress, means.jobs
        ) as executor,
    ):
        return consequence(given, designs, values, found.effects, executor.run)
