"""Checks of one design: strength with its landing, and the quick answer with its shift time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dogshape.pipeline.config.study_file import EVERYWHERE, Place, Setup, points_of
from dogshape.pipeline.record import Frame, Result, Table, frame_of, percent
from dogshape.pipeline.reports.text import (
    ENGINES,
    engaged_text,
    hang_words,
    interval_text,
    quantile_words,
    time_text,
)
from dogshape.pipeline.simulate.design import (
    Design,
    ToleranceTime,
    checks_within,
    design_of,
    judged_design,
    tolerance_time,
    weakest_within,
)
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.pipeline.store.result_records import (
    CheckRow,
    ExpectedTime,
    HangKeys,
    NotJudged,
    QuantileRow,
    check_table,
    hang_keys,
    not_judged_row,
)
from dogshape.pipeline.train.training_rows import matching_surrogate, study_mix
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import strike_force, strike_torque
from dogshape.sim.strength.landing import Landings
from dogshape.sim.strength.locking import Retention, blocking_force, retention
from dogshape.sim.strength.manufacture import Kind, manufacturing_checks
from dogshape.sim.strength.verdict import OPTIONAL, SPANS, Hinge, Verdict, landing_by_stiffness
from dogshape.sim.units import MPA, RPM
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import Expected, interval
from dogshape.surrogate.query import Answer, ask, time_record
from dogshape.surrogate.store import Validation

if TYPE_CHECKING:
    from dogshape.pipeline.simulate.executor import RunOptions


@dataclass(frozen=True, repr=False)
class Checked(Result):
    """One design of a study with its checks and the verdict on them."""

    config: Setup
    design: Design
    verdict: Verdict

    @property
    def feasible(self) -> bool:
        """Whether every standard check is judged and clearly passes."""
        return self.verdict.passes

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the checks that fail."""
        return tuple(self.design.failed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings about the design: a root outside its formula's fit, units in doubt."""
        return tuple(notes_of(self.config))

    @property
    def blocking_force_N(self) -> float:
        """Force that the blocking mechanism has to hold, N."""
        return blocking_force(self.config.clutch.dog, self.config.limits.load)

    def within(self, kind: Kind) -> str:
        """Smallest margin within the tolerances, the landing at nominal size, with its check."""
        weakest = smallest_margin(self.design.checks)
        name, margin = weakest_within(self.config, self.design, kind)
        margin, name = min((margin, name), (weakest.margin, weakest.name))
        return "no dog" if math.isinf(margin) else f"{percent(margin)}, {name}"

    @property
    def worst_case(self) -> str:
        """Smallest margin at worst-case tolerances, with its check."""
        return self.within("worst_case")

    @property
    def statistical(self) -> str:
        """Smallest margin by root sum of squares at the reject rate, with its check."""
        return self.within("root_sum_square")

    @property
    def retention(self) -> list[Retention]:
        """Forces that separate the rings under torque on each flank, and what holds them."""
        dog, load = self.config.clutch.dog, self.config.limits.load
        return [retention(dog, load, flank) for flank in FLANKS]

    @property
    def rows(self) -> list[CheckRow]:
        """Every check with its margins, by the declared keys."""
        return [CheckRow(**one) for one in checks_within(self.config, self.design)]

    @property
    def judged_rows(self) -> list[CheckRow]:
        """Every check, then the standard ones that were not judged."""
        missing = [NotJudged(check=one.check, key=one.key) for one in self.verdict.not_judged]
        return [*self.rows, *map(not_judged_row, missing)]

    def to_parts(self) -> list[str | Table]:
        """Give the table of checks, verdict, warnings and the force on the blocking mechanism."""
        weakest = smallest_margin(self.design.checks)
        return [
            check_table(self.judged_rows),
            "",
            "S: safety factor, upper limit of a stress or force over its value, at nominal size, "
            "beyond the factors of [load] that the limit contains",
            "margin: distance to the limit over the limit, at nominal size, by root sum of squares "
            f"of all tolerances ({self.rejects} of the dogs have less), and with every tolerance "
            "at its worst (landing and times: nominal size alone)",
            f"verdict: {self.verdict.line}",
            *(f"{one.name}: {one.fault}; {one.remedy}" for one in self.design.faults),
            f"smallest margin: {percent(weakest.margin)}, {weakest.name}",
            *hinge_lines(self.verdict),
            f"at statistical tolerances: {self.statistical}",
            f"at worst-case tolerances: {self.worst_case}",
            *(f"{check.name}: worst at {check.ends}" for check in self.design.checks if check.ends),
            *(f"warning: {note}" for note in self.notes),
            *map(_retention_words, self.retention),
            f"the blocking mechanism has to hold {self.blocking_force_N:.0f} N",
        ]

    @property
    def rejects(self) -> str:
        """Share of the dogs beyond the margins by root sum of squares."""
        return f"{100.0 * self.config.limits.tolerances.reject_rate:.3g} %"

    def landing_of(self, shifts: int, engine: str) -> list[str]:
        """Explain which shifts the checks of the landing are from; nothing without them."""
        landings = self.design.landings
        if landings is None or not shifts:
            return []
        share = self.config.limits.load.landing_share
        taken = "the hardest" if share is None else f"{100 - 100 * share:.4g} % quantile"
        angles = shifts // len(self.config.points)
        return [
            f"landing: {taken} of {shifts} shifts by {ENGINES[engine]}, {angles} angles at each "
            "operating point",
            *self._landing_stiffness(landings),
        ]

    def _landing_stiffness(self, landings: Landings) -> list[str]:
        """Explain what the landing owes to the stiffness of the contact, which stands for rings."""
        contact, span = self.config.clutch.contact, SPANS.contact_stiffness
        if contact.impact is not None:
            return []
        dog, limits = self.config.clutch.dog, self.config.limits
        margins = landing_by_stiffness(dog, limits, landings, contact.stiffness)
        soft, stiff = map(percent, margins)
        return [
            f"landing with {span.low:g} to {span.high:g} times contact.stiffness_Pa_m: smallest "
            f"margin {soft} to {stiff}"
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give every check as JSON takes it."""
        return {
            "feasible": self.feasible,
            "verdict": self.verdict.to_dict(),
            "checks": checks_within(self.config, self.design),
            "retention": [
                {
                    "flank": one.flank,
                    "force_without_friction_N": one.frictionless,
                    "force_with_flank_friction_N": one.flank_friction,
                    "force_with_all_friction_N": one.all_friction,
                    "held_N": one.held,
                    "held_by": one.answer,
                }
                for one in self.retention
            ],
        }

    def to_frame(self) -> Frame:
        """Give a row for each check: value and limit in ``unit``, margins as shares.

        Standard checks that were not judged have a row without values, in which ``passed`` is
        missing; ``attrs["verdict"]`` is the verdict in a sentence.
        """
        frame = frame_of(self.judged_rows).astype({"passed": "boolean"})
        frame.attrs["verdict"] = self.verdict.line
        return frame


def hinge_lines(verdict: Verdict) -> list[str]:
    """List the assumptions that flip a verdict within their ranges, or the strongest one."""
    if verdict.flipping:
        return [f"the verdict hangs on {_hinge_words(hinge)}" for hinge in verdict.flipping]
    if verdict.hangs_on:
        strongest = _hinge_words(verdict.hangs_on[0])
        return [f"no assumption flips the verdict within its range; strongest: {strongest}"]
    return []


def _hinge_words(hinge: Hinge) -> str:
    ends = percent(hinge.margin_low), percent(hinge.margin_high)
    checks = ", ".join(dict.fromkeys((hinge.check_low, hinge.check_high)))
    margins = f"smallest margin {ends[0]} to {ends[1]} ({checks})"
    return f"{hinge.key} {hinge.range_text} [{hinge.status}: {hinge.source}]: {margins}"


def _retention_words(found: Retention) -> str:
    """Describe how a worn, loaded flank is held, with its axial forces."""

    forces = {
        "without friction": found.frictionless,
        "with the least of the flank": found.flank_friction,
        "with the toothing's too": found.all_friction,
    }
    words, direction = list[str](), ""
    for friction, force in forces.items():
        turned = "pushes out with " if force > 0.0 else "pulls in with "
        words.append(f"{'' if turned == direction else turned}{abs(force):.0f} N {friction}")
        direction = turned
    return f"worn {found.flank} flank: held by {found.answer}; {', '.join(words)}"


#: Standard error of the compiled engine's expected time against Drake's, over the time. Medians are
#: 0.01 % with the design set and up to 0.8 % with the published one (docs/evidence/engines.txt).
ENGINE_ERROR = 0.01
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Guess:
    """Prediction of a surrogate for a design.

    ``answer`` is the expected time with what speaks against trusting it, ``spread`` its change
    within the tolerances, s, ``validation`` the surrogate on designs that it had not seen.
    """

    answer: Answer
    spread: ToleranceTime
    validation: Validation
    path: Path


@dataclass(frozen=True, repr=False)
class Check(Checked):
    """Quick answer about one design: its checks, and its expected shift time.

    The compiled engine simulates the design, landing included, and the interval has its error in
    it. A surrogate that is named answers in its place, and the landing is not judged. A clutch
    that does not engage has no time: ``refusal`` is the reason.
    ``shifts`` is the number of simulated ones, ``engaged`` their least share at a point.
    """

    mix: Mix
    expected: Expected | None
    shifts: int = 0
    engaged: float = 0.0
    guess: Guess | None = None
    refusal: str = ""
    quantiles: Sequence[QuantileRow] = ()
    hangs: Mapping[str, float | None] = field(default_factory=dict)  #: ``HangKeys``, if simulated

    @property
    def time_s(self) -> float | None:
        """Expected shift time, s; None where there is none."""
        return None if self.expected is None else self.expected.time

    @property
    def missed(self) -> bool:
        """Test that the surrogate misses the simulated time by more than both intervals."""
        predicted = None if self.guess is None else self.guess.answer.expected
        if not self.shifts or self.expected is None or predicted is None:
            return False
        both = math.hypot(self.expected.error, predicted.error)
        return abs(self.expected.time - predicted.time) > NORMAL_95 * both

    def to_parts(self) -> list[str | Table]:
        """Give expected time, the surrogate's prediction beside it, and the checks."""
        found = self.expected
        if found is None:
            lines = [f"no shift time: {self.refusal}"]
        else:
            source = f"{self.shifts} shifts, compiled engine; error includes 1 % against Drake"
            lines = [
                f"expected shift time {_interval(found)} "
                f"({source if self.shifts else 'surrogate'}); single shifts "
                f"scatter by {time_text(found.sd)}, {100 * found.engaged:.1f} % engage at worst",
                *self._part_lines(found),
            ]
            times = quantile_words([one.to_dict() for one in self.quantiles])
            lines += [f"shift time over the life: {times}"] if times else []
        lines += [] if self.guess is None else self._surrogate_lines(self.guess)
        lines.append(self.config.shafts_text)
        return [*lines, "", *super().to_parts(), *self.landing_of(self.shifts, "planar")]

    def _surrogate_parts(self) -> dict[str, float | None]:
        """Give the mean of engaged shifts by the keys of ``HangKeys``; it has no interval."""
        parts = dict[str, float | None].fromkeys(HangKeys.model_fields)
        if (found := self.expected) is not None:
            bare, error = found.without_retries
            parts |= {"engaged_mean_s": bare, "engaged_standard_error_s": error}
            parts |= {"retries_s": found.retries, "retries_error_s": found.retries_error}
        return parts

    def _part_lines(self, found: Expected) -> list[str]:
        if not self.hangs:
            return _parts(found, self.config)
        words = f"{hang_words(self.hangs)}; {self.config.retry_text}"
        return [f"mean of engaged shifts {engaged_text(self.hangs)}", words]

    def _surrogate_lines(self, guess: Guess) -> list[str]:
        answer, expected, spread, lines = guess.answer, guess.answer.expected, guess.spread, []
        if self.shifts:
            time = answer.refusal if expected is None else _interval(expected)
            lines = [f"surrogate {guess.path}: {time}", *_parts(expected, self.config)]
        if self.missed:
            lines += ["warning: the surrogate misses the simulated time by more than its interval"]
        lines += [f"warning: {one}; the surrogate extrapolates" for one in answer.warnings]
        lines.append(f"nearest simulated design: {answer.distance:.1f} median spacings away")
        if not guess.validation.useful:
            lines.append(
                "warning: on designs that it has not seen the surrogate has Q2 "
                f"{guess.validation.q2:.2f}; simulate more designs before relying on it"
            )
        if expected is not None:
            lines.append(
                f"within the tolerances: {1e3 * spread.worst_case_s:.2g} ms in the worst "
                f"case, {1e3 * spread.root_sum_square_s:.2g} ms by root sum of squares"
            )
        return lines

    def to_dict(self) -> dict[str, Any]:
        """Give the expected time, the surrogate's prediction, and every check."""
        guess = self.guess
        answer, beside = Answer(None, 0.0, ()), dict[str, Any]()
        if guess is not None:
            answer, spread = guess.answer, guess.spread.to_dict()
            beside = {"missed_by_surrogate": self.missed, "time_within_tolerances": spread}
        return {
            **time_record(self.expected, self.refusal),
            **(self.hangs or self._surrogate_parts()),
            **({"engaged": self.engaged} if self.shifts else {}),
            "quantiles": [one.to_dict() for one in self.quantiles],
            "operating_points": len(self.mix.points),
            "shafts": self.config.clutch.drive.text,
            "engine": "planar" if self.shifts else self.config.clutch.solver.engine,
            "shifts_planar": self.shifts,
            "in_range": answer.in_range,
            "distance": answer.distance,
            "warnings": [*answer.warnings, *self.notes],
            "q2": None if guess is None else guess.validation.q2,
            "surrogate": None if guess is None else str(guess.path),
            "predicted": guess and time_record(answer.expected, answer.refusal),
            **beside,
            **super().to_dict(),
        }  # fmt: skip


def _interval(found: Expected) -> str:
    return interval_text(found.time, found.low, found.high)


def _parts(found: Expected | None, config: Setup) -> list[str]:
    """Split an interval of a surrogate into shifts that engage and retries."""
    if found is None or not (found.retries or found.retries_error):
        return []
    bare, error = found.without_retries
    return [
        f"mean of engaged shifts {time_text(bare, error)}, retries "
        f"{time_text(found.retries, found.retries_error)}; {config.retry_text}"
    ]


def check_design(
    config: Setup, place: Place = EVERYWHERE, surrogate: str | Path | None = None
) -> Check:
    """Check a design as ``Study.check`` does, for a study that is read."""
    points = points_of(config, place)
    mix = study_mix(config, points)
    guess = _guess(config, mix, surrogate)
    expected, found = None if guess is None else guess.answer.expected, None
    if guess is not None and surrogate is not None:
        refusal = guess.answer.refusal
    else:
        # Half a second that an answer of the surrogate does not need.
        from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415
        from dogshape.pipeline.simulate.executor import scratch_executor  # noqa: PLC0415

        # The angles of the search, so that a design passes here if it does there.
        own, sample = replace(config, points=points), config.file.expectation
        executor = scratch_executor(1)
        (found,) = evaluate(own.in_engine("planar"), [{}], executor, sample.angles, sample.seed)
        expected, refusal = _expected(found.expectation, mix)
    measured = None if found is None else found.measured
    judged = judged_design(config, design_of(config, {}, measured))
    answer = Check(config, *judged, mix, expected, guess=guess, refusal=refusal)
    if found is None:
        return answer
    mean, quantiles = found.expectation, ExpectedTime.of(found.expectation).quantiles or ()
    return replace(
        answer, shifts=mean.shifts, engaged=mean.engaged, quantiles=quantiles,
        hangs=hang_keys(mean),
    )  # fmt: skip


def _guess(config: Setup, mix: Mix, named: str | Path | None) -> Guess | None:
    """Ask the surrogate of the study's physics about its own design."""
    if (found := matching_surrogate(config, named)) is None:
        return None
    stored, path = found
    model, own = stored.surrogate, config.prototype
    answer = ask(model, own, mix, config.physics)
    made = manufacturing_checks(config.clutch.dog, config.limits.manufacturing)
    if faults := [check for check in made if not check.passed]:  # it was fitted without such dogs
        warnings = (*answer.warnings, "the dog cannot be made")
        reason = f"{faults[0].fault} to be made, and the surrogate has no other dogs"
        answer = Answer(None, answer.distance, warnings, f"{reason}; {faults[0].remedy}")
    return Guess(answer, tolerance_time(config, model, own, mix), stored.validation, path)


def _expected(found: Expectation, mix: Mix) -> tuple[Expected | None, str]:
    """Give a simulated time with its interval, the engine's error in it, or why there is none."""
    if not found.engages:
        few = f"{percent(found.engaged)} at the worst point"
        count = f"engages in {found.shifts - found.lost} of {found.shifts} shifts, in {few}"
        return None, f"{count}; {found.losses}"
    error = math.hypot(found.standard_error, ENGINE_ERROR * found.engaged_mean)
    (low,), (high,) = interval(np.array([found.mean]), np.array([error]))
    spread = math.sqrt(mix.weights @ np.array([p.sd for p in found.points]) ** 2)
    times = found.mean, float(low), float(high), error
    retries = found.retries, found.retries_error
    return Expected(*times, spread, found.engaged, *retries), ""


@dataclass(frozen=True, repr=False)
class Strength(Checked):
    """Every check of one design under its load, and its landing in ``shifts``, 0 without."""

    shifts: int = 0

    @property
    def load_sharing(self) -> float | None:
        """Load sharing under the design torque by number and accuracy; None where it is fixed."""
        load, dog = self.config.limits.load, self.config.clutch.dog
        return None if load.scatter(dog) is None else load.sharing(dog, load.design_torque)

    @property
    def strikes(self) -> list[dict[str, Any]]:
        """Flank strikes: speed, torque, and force on the dog that bears most, by flank."""
        dog, limits = self.config.clutch.dog, self.config.limits
        return [
            {
                "flank": flank,
                "ends": strike.ends,
                "mismatch_rpm": strike.speed(flank) / RPM,
                "torque_Nm": strike_torque(dog, limits, strike, flank),
                "force_per_dog_N": strike_force(dog, limits, strike, flank),
            }
            for strike in limits.strikes for flank in strike.flanks
        ]  # fmt: skip

    def to_parts(self) -> list[str | Table]:
        """Give the checks, and in words landing, load sharing and flank strikes of the study."""
        sharing = self.load_sharing
        return [
            *super().to_parts(),
            *self.landing_of(self.shifts, self.config.clutch.solver.engine),
            *([] if sharing is None else [f"load sharing by number and accuracy: {sharing:.2f}"]),
            *(
                "{flank} flanks that strike at {mismatch_rpm:.4g} 1/min make {torque_Nm:.0f} N m, "
                "{force_per_dog_N:.0f} N on one dog{at}".format(**one, at=at)
                for one in self.strikes
                for at in [f" at {one['ends']}" * bool(one["ends"])]
            ),
        ]

    @property
    def explained(self) -> list[str | Table]:
        """Meaning, formula, source and key of each check, and the checks that the study lacks."""
        names = {row.name for row in self.rows}
        return [
            check_table(self.judged_rows, "name", "meaning", "formula", "source", "limit_key"),
            *(f"not judged: {n}; give {keys}" for n, keys in OPTIONAL.items() if n not in names),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give every check, the load and the material's limits, in the edge's units."""
        limits, load = self.config.limits, self.config.file.load.model_dump()
        load |= {} if self.load_sharing is None else {"load_sharing": self.load_sharing}
        force = limits.load.force_per_dog(self.config.clutch.dog)
        return {
            "engine": self.config.clutch.solver.engine,
            **super().to_dict(),
            "warnings": list(self.notes),
            "load": {**load, "force_per_dog_N": force, "blocking_force_N": self.blocking_force_N},
            "material": {
                "set": limits.material.name,
                "source": limits.material.source,
                "allowable_stress_MPa": limits.allowable_stress / MPA,
                "fatigue_stress_MPa": limits.endurance(limits.load.shifts) / MPA,
            },
            **({"strikes": self.strikes} if self.strikes else {}),
        }


def check_strength(config: Setup, where: RunOptions, *, simulate: bool = True) -> Strength:
    """Check the strength of a study's design as ``Study.strength`` does."""
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415

    config = config.search_setup
    settings = config.file.expectation
    shifts = len(config.points) * settings.angles if simulate else 0
    measured = None
    if simulate:
        with where.executor("strength", (config.config_hash,), shifts) as (executor, _):
            (found,) = evaluate(config, [{}], executor, settings.angles, settings.seed)
        measured = found.measured
    return Strength(config, *judged_design(config, design_of(config, {}, measured)), shifts)
