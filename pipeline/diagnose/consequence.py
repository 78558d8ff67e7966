"""So what: whether the best design stays the best once a named effect is in.

Prototype and the leading designs of a study's kept result are simulated without and with the
effect, at the same relative angles, which the search did not use. The study chose a design without
the effect. The cost of ignoring the effect is the time of that design less the time of the best
design, both with the effect. Designs that only a search with the effect would have found are not
among them, so the cost may be more; that the best is the best of several estimates makes it seem
more. Landings count beside the times: an effect that makes blows harder than the dogs take leaves
nothing of a quick design.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.prediction.levels import Level
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, demand_over
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.bundled import bundled_root
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DataError
from dogshape.sim.setting import Setting
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.statistics.expectation import Expectation, expect, expect_point
from dogshape.sim.statistics.numerical_error import Runner
from dogshape.sim.statistics.shift_records import Record, result_of
from dogshape.sim.strength.checks import Check
from dogshape.sim.strength.landing import demand_checks

ANGLES = 6  #: of each design at each operating point
DESIGNS = 6  #: of the search, the fastest
SURE = 2.0  #: standard errors from which a cost is one
GRID = 720  #: places in a pitch at which a distribution of angles is summed

Params = Mapping[str, float]


@dataclass(frozen=True)
class Candidate:
    """A design with its expected shift time, at the sleeve, without and with the effect.

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
    """Consequence of an effect for the choice of a design.

    Of the candidates the first is the prototype, the second what the study chose.
    """

    study: str
    level: Level
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """Choice of the study, without the effect."""
        return self.candidates[1]

    @property
    def best(self) -> Candidate:
        """Best candidate with the effect, of those whose dogs take its landings, if any do."""
        lasting = [one for one in self.candidates if one.landing_with.passed]
        return min(lasting or self.candidates, key=lambda one: one.with_effect.mean)

    @property
    def regret(self) -> float:
        """Cost of choosing without the effect, with the effect acting, s."""
        return self.chosen.with_effect.mean - self.best.with_effect.mean

    @property
    def standard_error(self) -> float:
        """Standard error of the regret, s; angles that both share are not counted on."""
        if self.chosen is self.best:
            return 0.0
        both = self.chosen.with_effect, self.best.with_effect
        return math.hypot(*(one.standard_error for one in both))

    @property
    def sentence(self) -> str:
        """Consequence in words."""
        return f"{self._times} {self._landings}".strip()

    @property
    def _landings(self) -> str:
        """Write which designs land harder with the effect than they take; empty where none does."""
        fail = [one for one in self.candidates if not one.landing_with.passed]
        if not fail:
            return ""
        who = ", ".join(one.name for one in fail)
        if len(fail) == len(self.candidates):
            who = "all designs that were compared"
        worst = min(fail, key=lambda one: one.landing_with.margin)
        check, over = worst.landing_with.name.replace("_", " "), -worst.landing_with.margin
        before = ", ".join(one.name for one in fail if not one.landing.passed)
        return (
            f"With it landings are harder than the dogs take, of {who}: "
            f"{worst.name} by {over:.0%} ({check}). Without it "
            f"{f'those of {before} are so too' if before else 'all of these hold'}."
        )

    @property
    def _times(self) -> str:
        """Write what the effect means for the order of the designs' times."""
        prototype, chosen, best = self.candidates[0], self.chosen, self.best
        gain = prototype.with_effect.mean - best.with_effect.mean
        gained = (
            f"with it {best.name} gains {gain * 1e3:.1f} ms over the prototype, "
            f"{gain / prototype.with_effect.mean:.0%}"
        )
        if chosen is best:
            return f"The chosen design stays the best ({chosen.name}); {gained}."
        if self.regret < 0.0:  # The best is one that lasts, and the chosen design does not.
            return (
                f"Without the effect the study chose {chosen.name}, whose dogs do not take its "
                f"landings with it; of those that do {best.name} is best; {gained}."
            )
        cost = f"{self.regret * 1e3:.1f} ± {self.standard_error * 1e3:.1f} ms"
        if self.regret < SURE * self.standard_error:
            return (
                f"The chosen design ({chosen.name}) stays as good as any within the error: "
                f"{best.name} is {cost} faster; {gained}."
            )
        return (
            f"Without the effect the study chose {chosen.name}, with it {best.name} is best; "
            f"ignoring it costs {cost}; {gained}."
        )

    @property
    def record(self) -> dict[str, Any]:
        """Record as JSON takes it."""
        return {
            "study": self.study,
            "effects": list(self.level.hypothesis),
            "values": list(self.level.values),
            "candidates": [_record(one) for one in self.candidates],
            "best_without": self.chosen.name,
            "best_with": self.best.name,
            "regret_s": self.regret,
            "regret_standard_error_s": self.standard_error,
            "sentence": self.sentence,
        }


def _record(one: Candidate) -> dict[str, Any]:
    return {
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


def studied(where: str | Path, count: int = DESIGNS) -> tuple[Setup, dict[str, Params]]:
    """Read a study and the designs of its result, by a folder of results or a study.

    Raises DataError where nothing is kept, StorageError where it is damaged.
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
    return study, _designs(study, json.loads(_kept(study, where).read_text("utf-8")), count)


def designs_of(study: Setup, count: int = DESIGNS) -> dict[str, Params]:
    """List the prototype and the fastest feasible designs of a study's kept result, by name.

    The chosen one comes first; designs that failed when re-simulated at new angles are left out.

    Raises DataError where nothing is kept.
    """
    kept = _kept(study, study.name).read_text(encoding="utf-8")
    return _designs(study, json.loads(kept), count)


def _designs(study: Setup, result: Mapping[str, Any], count: int) -> dict[str, Params]:
    confirmation = result["confirmation"] or {"chosen": None, "designs": []}
    failed = {
        one["trial"]
        for one in confirmation["designs"]
        if not all(check["passed"] for check in one["checks"])
    }
    rows = [row for row in result["trials"] if row["feasible"] and not row["prototype"]]
    rows = [row for row in rows if row["trial"] not in failed]
    rows.sort(key=lambda row: row["expected_shift_time_s"])
    chosen = confirmation["chosen"]
    rows.sort(key=lambda row: row["trial"] != chosen)
    named = {f"design {row['trial']}": row for row in rows[:count]}
    found: dict[str, Params] = {"prototype": study.prototype}
    for name, row in named.items():
        found[name] = {key: row[key] for key in study.variables}
    return found


def _kept(study: Setup, where: str | Path) -> Path:
    own = StudyFolder(default_out(study))
    for path in (own.result, bundled_root() / study.name / "result.json"):
        if path.is_file():
            return path
    raise DataError(
        f"there is no result of the study {study.name} in {own.root}; run 'dogshape study {where}' "
        "first, or name the folder of its results"
    )


def shifts_of(study: Setup, designs: Mapping[str, Params]) -> int:
    """Count the shifts of ``consequence``."""
    return 2 * ANGLES * len(study.points) * len(designs)


def consequence(
    study: Setup,
    designs: Mapping[str, Params],
    level: Level,
    effects: Mapping[str, Effect],
    run: Runner,
) -> Consequence:
    """Simulate designs without and with an effect.

    ``run`` simulates blocks. An effect of which there is no such bench raises InputError.
    """
    settings = [_settings(study, params) for params in designs.values()]
    changed = [[level.setting(effects, one) for one in mine] for mine in settings]
    every = [one for group in (settings, changed) for mine in group for one in mine]
    seed = study.file.expectation.seed + 3 * NEW_ANGLES
    places = len(study.points)
    blocks = [
        replace(
            even_block(one.clutch, one.point, ANGLES, (seed, k % places)),
            angles=angles_of(one, (seed, k % places)),
        )
        for k, one in enumerate(every)
    ]
    rows = run(blocks)
    found = [
        _expectation(study, every[k : k + places], rows[k : k + places])
        for k in range(0, len(every), places)
    ]
    landings = [
        _landing(study, every[k], one, rows[k : k + places])
        for k, one in zip(range(0, len(every), places), found, strict=True)
    ]
    half = len(designs)
    return Consequence(
        study.name,
        level,
        tuple(
            Candidate(name, params, found[k], found[half + k], landings[k], landings[half + k])
            for k, (name, params) in enumerate(designs.items())
        ),
    )


def _settings(study: Setup, params: Params) -> list[Setting]:
    clutch = study.clutch.with_dog(study.dog_with(dict(params)))
    return [Setting(clutch, point) for point in study.points]


def angles_of(setting: Setting, draw: tuple[int, int]) -> tuple[float, ...]:
    """Return even relative angles, or those at even shares of their distribution, rad."""
    even = even_block(setting.clutch, setting.point, ANGLES, draw).angles
    if setting.concentration == 0.0:
        return even
    pitch = setting.clutch.dog.pitch_angle
    grid = (np.arange(GRID) + 0.5) / GRID * pitch
    below = np.cumsum(setting.weights(grid.tolist())) / GRID
    return tuple(np.interp(np.array(even) / pitch, below, grid).tolist())


def _landing(
    study: Setup, setting: Setting, found: Expectation, rows: Sequence[Sequence[Record]]
) -> Check:
    """Return the check of a design's landings that has the least margin."""
    load = study.limits.load
    if load.edge_bed is not None:  # The energy of a blow is that on the bed that was simulated.
        load = replace(load, edge_bed=setting.clutch.contact.stiffness)
        study = replace(study, limits=replace(study.limits, load=load))
    demand = demand_over(study, setting.clutch.dog, found, rows)
    return min(demand_checks(demand, study.limits), key=lambda one: one.margin)


def _expectation(
    study: Setup, settings: Sequence[Setting], rows: Sequence[Sequence[Record]]
) -> Expectation:
    return expect(
        [
            expect_point(
                setting.point,
                [replace(result_of(row), shift_time=setting.time_of(row)) for row in mine],
                setting.clutch.timeout,
                study.retraction,
            )
            for setting, mine in zip(settings, rows, strict=True)
        ]
    )
