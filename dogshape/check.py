"""Checks of one design: strength with its landing, and the quick answer with its shift time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dogshape.pipeline.config.study_file import ALL_POINTS, RequestedPoint, Setup, points_of
from dogshape.pipeline.record import Figure, Frame, Table, frame_of, percent
from dogshape.pipeline.reports.text import (
    ENGINES,
    engaged_text,
    hang_words,
    interval_text,
    quantile_words,
    time_text,
)
from dogshape.pipeline.simulate.design import Design, design_of, judge_design
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.pipeline.simulate.tolerance_time import ToleranceTime, tolerance_time
from dogshape.pipeline.store.check_records import (
    CheckRow,
    LandingRow,
    NotJudged,
    assumed_groups,
    check_table,
    not_judged_row,
)
from dogshape.pipeline.store.result_records import ExpectedTime, HangKeys, QuantileRow, hang_keys
from dogshape.pipeline.train.training_rows import matching_surrogate, study_mix
from dogshape.result import Result
from dogshape.sim.shift.geometry import FLANKS, Flank
from dogshape.sim.statistics.expectation import Estimate, MixExpectation, positive_interval
from dogshape.sim.strength.checks import smallest_margin
from dogshape.sim.strength.dog_strength import bearing_limits, strike_force, strike_torque
from dogshape.sim.strength.landing import LandingLoad, Landings, bedding, landing_load
from dogshape.sim.strength.locking import Retention, blocking_force, retention
from dogshape.sim.strength.manufacture import Kind, manufacturing_checks
from dogshape.sim.strength.verdict import OPTIONAL, Hinge, Verdict, landing_by_stiffness
from dogshape.sim.units import MPA, RPM, from_si
from dogshape.surrogate.dataset import Mix
from dogshape.surrogate.model import NORMAL_95, Expected
from dogshape.surrogate.query import Answer, ask, time_record
from dogshape.surrogate.store import Validation

if TYPE_CHECKING:
    from dogshape.pipeline.simulate.executor import RunOptions


class EdgeBedding(NamedTuple):
    """Bedding of new edges; its fields are keys of the record."""

    depth_um: float
    radius_mm: float  #: of the edge after it
    radius_low_mm: float  #: ends of the 95 % interval
    radius_high_mm: float


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
        name, margin = self.design.weakest_within(kind)
        margin, name = min((margin, name), (weakest.margin, weakest.name))
        if math.isinf(margin):
            return "no dog"
        return f"{percent(margin)}, {name}"

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
        """Axial separating and holding forces of the loaded rings, by flank."""
        dog = self.config.clutch.dog
        load = self.config.limits.load
        return [retention(dog, load, flank) for flank in FLANKS]

    @property
    def load_sharing(self) -> dict[Flank, float]:
        """Load sharing K_s of the dogs at the static torque of each flank."""
        dog = self.config.clutch.dog
        load = bearing_limits(dog, self.config.limits).load
        return {flank: load.sharing(dog, load.static_torque(flank), flank) for flank in FLANKS}

    @property
    def load_sharing_text(self) -> str:
        """Load sharing of both flanks in words, with its origin."""
        load = self.config.limits.load
        is_fixed = load.scatter(self.config.clutch.dog) is None and load.run_out == 0.0
        origin = "load.load_sharing" if is_fixed else "by number and errors of the dogs"
        values = [f"{share:.2f} on the {flank} flank" for flank, share in self.load_sharing.items()]
        words = "load sharing K_s, mean load of the dogs over the largest"
        return f"{words}: {', '.join(values)} ({origin})"

    @property
    def rows(self) -> list[CheckRow]:
        """Every check with its margins, by the declared keys."""
        return self.design.rows

    @property
    def judged_rows(self) -> list[CheckRow]:
        """Every check, then the standard ones that were not judged."""
        missing = [NotJudged(check=check.check, key=check.key) for check in self.verdict.not_judged]
        return [*self.rows, *map(not_judged_row, missing)]

    def to_parts(self) -> list[str | Table]:
        """Tabulate the checks, with verdict, warnings and the force on the blocking mechanism."""
        weakest = smallest_margin(self.design.checks)
        mount = self.config.mount_text
        return [
            check_table(self.judged_rows),
            "",
            "S: safety factor, upper limit of a stress or force over its value, at nominal size, "
            "beyond the factors of [load] that the limit contains",
            "margin: distance to the limit over the limit, at nominal size, by root sum of squares "
            f"of all tolerances ({self.rejects} of the dogs have less), and with every tolerance "
            "at its worst (landing and times: nominal size alone)",
            f"verdict: {self.verdict.line}",
            *(f"{check.name}: {check.fault}; {check.remedy}" for check in self.design.faults),
            f"smallest margin: {percent(weakest.margin)}, {weakest.name}",
            *hinge_lines(self.verdict),
            *hang_lines(self.verdict),
            *assumed_lines(self.verdict),
            f"at statistical tolerances: {self.statistical}",
            f"at worst-case tolerances: {self.worst_case}",
            *(f"{check.name}: worst at {check.ends}" for check in self.design.checks if check.ends),
            *(f"warning: {note}" for note in self.notes),
            *map(_retention_text, self.retention),
            f"the blocking mechanism has to hold {self.blocking_force_N:.0f} N",
            f"load: {self.config.load_text}",
            self.load_sharing_text,
            *([f"mount: {mount}"] if mount else []),
        ]

    @property
    def explained(self) -> list[str | Table]:
        """Meaning, formula, source and key of each check, and the checks that the study lacks."""
        names = {row.name for row in self.rows}
        return [
            check_table(self.judged_rows, "name", "meaning", "formula", "source", "limit_key"),
            f"F of the strength checks is that of the most loaded dog: {self.load_sharing_text}",
            *(
                f"not judged: {check}; give {keys}"
                for check, keys in OPTIONAL.items()
                if check not in names and self.config.limits.sleeve is None
            ),
        ]

    @property
    def rejects(self) -> str:
        """Share of the dogs beyond the margins by root sum of squares."""
        return f"{100.0 * self.config.limits.tolerances.reject_rate:.3g} %"

    def landing_of(self, shifts: int, engine: str) -> list[str]:
        """Describe the shifts behind the landing checks; empty without simulated shifts."""
        landings = self.design.landings
        if landings is None or not shifts:
            return []
        share = self.config.limits.load.landing_share
        severity = "the hardest" if share is None else f"{100 - 100 * share:.4g} % quantile"
        angles = shifts // len(self.config.points)
        lines = [
            f"landing: {severity} of {shifts} shifts by {ENGINES[engine]}, {angles} angles at each "
            "operating point",
            *self._landing_lines(),
            *self._landing_stiffness(landings),
        ]
        if self.config.clutch.dog.edge_radius == 0.0:
            radius = from_si("_mm", self.config.limits.root_radius)
            lines.append(
                f"shifts have sharp edges, limits of a landing and drawing R {radius:g} mm "
                f"(manufacturing.root_radius_mm); dog.edge_radius_mm = {radius:g} simulates these"
            )
        return lines

    def _landing_stiffness(self, landings: Landings) -> list[str]:
        """Describe the landing margin over the stiffness of the dogs, and the edges after it."""
        dog = self.config.clutch.dog
        limits = self.config.limits
        weakest = landing_by_stiffness(dog, limits, landings)
        factors = " to ".join(f"{factor:.2g}" for factor, _ in weakest)
        margins = _margins_text([(check.margin, check.name) for _, check in weakest])
        lines = [f"landing with load.dog_stiffness_factor {factors}: smallest margin {margins}"]
        edges = self.edge_bedding
        if edges is not None and edges.depth_um > 0.0:
            lines.append(
                f"edges bed in by {edges.depth_um:.2g} um, to a radius of {edges.radius_mm:.2g} mm "
                f"(95 %: {edges.radius_low_mm:.2g} to {edges.radius_high_mm:.2g} mm)"
            )
        return lines

    def _landing_lines(self) -> list[str]:
        """Describe force and overlap of the landing that decides; empty without a load."""
        load = self.landing_load
        if load is None:
            return []
        return [
            f"decisive landing, of {load.check}: {LandingRow.of(load).text} "
            f"({load.simulated_force:.0f} N on each dog in the softer layer of the simulation)"
        ]

    @property
    def landing_load(self) -> LandingLoad | None:
        """Landing behind the landing check with the smallest margin; None without a simulation."""
        landings = self.design.landings
        if landings is None:
            return None
        return landing_load(self.config.clutch.dog, self.config.limits, landings)

    @property
    def edge_bedding(self) -> EdgeBedding | None:
        """Bedding of new edges in the hardest landing; None without a simulated landing."""
        landings = self.design.landings
        if landings is None:
            return None
        dog = self.config.clutch.dog
        limits = self.config.limits
        edge = bedding(dog, landings.demand(dog, limits), limits)
        low, high = (bedding(dog, end, limits) for end in landings.interval(dog, limits))
        return EdgeBedding(
            depth_um=from_si("_um", edge.depth),
            radius_mm=from_si("_mm", edge.radius),
            radius_low_mm=from_si("_mm", low.radius),
            radius_high_mm=from_si("_mm", high.radius),
        )

    def to_dict(self) -> dict[str, Any]:
        """Convert verdict, checks and retention to values of JSON."""
        return {
            "feasible": self.feasible,
            "verdict": self.verdict.to_dict(),
            "checks": [row.to_dict() for row in self.rows],
            **self._landing_record(),
            "load_sharing": self.load_sharing,
            "retention": [
                {
                    "flank": retention.flank,
                    "force_without_friction_N": retention.frictionless,
                    "force_with_flank_friction_N": retention.flank_friction,
                    "force_with_all_friction_N": retention.all_friction,
                    "held_N": retention.held,
                    "held_by": retention.answer,
                }
                for retention in self.retention
            ],
        }

    def _landing_record(self) -> dict[str, Any]:
        """Record decisive landing and bedding of the edges; empty without a simulated landing."""
        edges = self.edge_bedding
        load = self.landing_load
        if edges is None:
            return {}
        record: dict[str, Any] = {"edge_bedding": edges._asdict()}
        if load is not None:
            record["decisive_landing"] = LandingRow.of(load).to_dict()
        return record

    def plot(self) -> Figure:
        """Draw the margin of each check, %, at nominal size; failed checks are hatched."""
        from dogshape.pipeline.reports.result_figures import margins_figure  # noqa: PLC0415

        return margins_figure({check.name: check.margin for check in self.design.checks})

    def to_frame(self) -> Frame:
        """Tabulate checks, a row each: value and limit in ``unit``, margins as shares.

        Standard checks that were not judged have a row without values, in which ``passed`` is
        missing; ``attrs["verdict"]`` is the verdict in a sentence.
        """
        frame = frame_of(self.judged_rows).astype({"passed": "boolean"})
        frame.attrs["verdict"] = self.verdict.line
        return frame


def hinge_lines(verdict: Verdict) -> list[str]:
    """List the assumptions that flip a verdict within their ranges, or the strongest one."""
    if verdict.flipping:
        return [f"the verdict hangs on {_hinge_text(hinge)}" for hinge in verdict.flipping]
    if verdict.hangs_on:
        strongest = _hinge_text(verdict.hangs_on[0])
        return [f"no assumption flips the verdict within its range; strongest: {strongest}"]
    return []


def hang_lines(verdict: Verdict) -> list[str]:
    """Describe the share of shifts that hang with its limits, unless the verdict has it."""
    if verdict.hangs is None or verdict.hangs.warns:
        return []
    return [verdict.hangs.limits_text]


def assumed_lines(verdict: Verdict) -> list[str]:
    """List the values that nobody gave, a line for each table and source."""
    return [
        f"not given, {', '.join(filter(None, [group.table, group.source]))}: {group.values}"
        for group in assumed_groups(verdict.assumed)
    ]


def _hinge_text(hinge: Hinge) -> str:
    ends = [(hinge.margin_low, hinge.check_low), (hinge.margin_high, hinge.check_high)]
    margins = f"smallest margin {_margins_text(ends)}"
    return f"{hinge.key} {hinge.range_text} [{hinge.status}: {hinge.source}]: {margins}"


def _margins_text(ends: Sequence[tuple[float, str]]) -> str:
    """Print margins at the ends of a range, each with its check, a common one once."""
    names = {name for _, name in ends}
    if len(names) == 1:
        return f"{' to '.join(percent(margin) for margin, _ in ends)} ({names.pop()})"
    return " to ".join(f"{percent(margin)} ({name})" for margin, name in ends)


def _retention_text(retention: Retention) -> str:
    """Describe how a worn, loaded flank is held, with its axial forces."""
    forces = {
        "without friction": retention.frictionless,
        "with the least of the flank": retention.flank_friction,
        "with the toothing's too": retention.all_friction,
    }
    clauses: list[str] = []
    previous_direction = ""
    for friction, force in forces.items():
        direction = "pushes out with " if force > 0.0 else "pulls in with "
        clause = f"{abs(force):.0f} N {friction}"
        if direction != previous_direction:
            clause = direction + clause
        clauses.append(clause)
        previous_direction = direction
    return f"worn {retention.flank} flank: held by {retention.answer}; {', '.join(clauses)}"


#: Relative standard error of the compiled engine's expected time against Drake's. Medians are
#: 0.01 % with the design set and up to 0.8 % with the published one (docs/evidence/engines.txt).
ENGINE_ERROR = 0.01


@dataclass(frozen=True)
class Guess:
    """Prediction of a surrogate for a design.

    ``answer`` is the expected time with its warnings, ``spread`` its change within the tolerances,
    s, ``validation`` the accuracy on designs outside the fit.
    """

    answer: Answer
    spread: ToleranceTime
    validation: Validation
    path: Path


@dataclass(frozen=True, repr=False)
class Check(Checked):
    """Quick answer about one design: its checks, and its expected shift time.

    The compiled engine simulates the design, landing included, and the interval has its error in
    it. A named surrogate answers in its place, and the landing is not judged. A clutch that does
    not engage has no time: ``refusal`` is the reason. ``shifts`` is the number of simulated shifts,
    ``engaged`` the smallest share of engaged shifts at an operating point.
    """

    mix: Mix
    expected: Expected | None
    shifts: int = 0
    engaged: float = 0.0
    guess: Guess | None = None
    refusal: str = ""
    quantiles: Sequence[QuantileRow] = ()
    hangs: HangKeys | None = None  #: None unless it is simulated

    @property
    def time_s(self) -> float | None:
        """Expected shift time, s; None for a clutch that does not engage."""
        return None if self.expected is None else self.expected.time

    @property
    def missed(self) -> bool:
        """Whether surrogate and simulated time differ by more than their 95 % interval."""
        predicted = None if self.guess is None else self.guess.answer.expected
        if not self.shifts or self.expected is None or predicted is None:
            return False
        error = math.hypot(self.expected.error, predicted.error)
        return abs(self.expected.time - predicted.time) > NORMAL_95 * error

    def to_parts(self) -> list[str | Table]:
        """Describe expected time, the surrogate's prediction and the checks."""
        if self.expected is None:
            lines = [f"no shift time: {self.refusal}"]
        else:
            lines = self._time_lines(self.expected)
        if self.guess is not None:
            lines += self._surrogate_lines(self.guess)
        lines.append(self.config.shafts_text)
        lines += filter(None, [self.config.actuator_text])
        return [*lines, "", *super().to_parts(), *self.landing_of(self.shifts, "planar")]

    def _time_lines(self, expected: Expected) -> list[str]:
        """Describe the expected time, its parts and its quantiles over the life."""
        source = "surrogate"
        if self.shifts:
            source = f"{self.shifts} shifts, compiled engine; error includes 1 % against Drake"
        lines = [
            f"expected shift time {_interval_text(expected)} ({source}); single shifts "
            f"scatter by {time_text(expected.sd)}, {100 * expected.engaged:.1f} % engage at worst",
            *self._part_lines(expected),
        ]
        quantiles = quantile_words(self.quantiles)
        if quantiles:
            lines.append(f"shift time over the life: {quantiles}")
        return lines

    def _surrogate_hangs(self) -> HangKeys:
        """Record both terms of the surrogate's time, s; the probability of hangs is None."""
        if self.expected is None:
            return hang_keys(None)
        engaged_mean, error = self.expected.without_retries
        return HangKeys(
            engaged_mean_s=engaged_mean,
            engaged_standard_error_s=error,
            hang_probability=None,
            hang_probability_low=None,
            hang_probability_high=None,
            retries_s=self.expected.retries,
            retries_error_s=self.expected.retries_error,
        )

    def _part_lines(self, expected: Expected) -> list[str]:
        """Describe mean of engaged shifts and retries; simulated hangs if there are any."""
        if self.hangs is None:
            return _surrogate_part_lines(expected, self.config)
        hangs = f"{hang_words(self.hangs)}; {self.config.retry_text}"
        return [f"mean of engaged shifts {engaged_text(self.hangs)}", hangs]

    def _surrogate_lines(self, guess: Guess) -> list[str]:
        """Describe the surrogate's prediction, its warnings and its spread by tolerances."""
        answer = guess.answer
        expected = answer.expected
        spread = guess.spread
        lines: list[str] = []
        if self.shifts:
            time = answer.refusal if expected is None else _interval_text(expected)
            lines.append(f"surrogate {guess.path}: {time}")
            lines += _surrogate_part_lines(expected, self.config)
        if self.missed:
            lines += ["warning: the surrogate misses the simulated time by more than its interval"]
        lines += [f"warning: {warning}; the surrogate extrapolates" for warning in answer.warnings]
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
        """Convert expected time, the surrogate's prediction and every check to values of JSON."""
        guess = self.guess
        answer = Answer(None, 0.0, ())
        comparison: dict[str, Any] = {}
        if guess is not None:
            answer = guess.answer
            comparison = {
                "missed_by_surrogate": self.missed,
                "time_within_tolerances": guess.spread.to_dict(),
            }
        return {
            **time_record(self.expected, self.refusal),
            **(self.hangs or self._surrogate_hangs()).to_dict(),
            **({"engaged": self.engaged} if self.shifts else {}),
            "quantiles": [quantile.to_dict() for quantile in self.quantiles],
            "operating_points": len(self.mix.points),
            "shafts": self.config.clutch.drive.text,
            "engine": "planar" if self.shifts else self.config.clutch.solver.engine,
            "shifts_planar": self.shifts,
            "in_range": answer.in_range,
            "distance": answer.distance,
            "warnings": [*answer.warnings, *self.notes],
            "q2": None if guess is None else guess.validation.q2,
            "surrogate": None if guess is None else str(guess.path),
            "predicted": None if guess is None else time_record(answer.expected, answer.refusal),
            **comparison,
            **super().to_dict(),
        }


def _interval_text(expected: Expected) -> str:
    return interval_text(expected.time, expected.low, expected.high)


def _surrogate_part_lines(expected: Expected | None, config: Setup) -> list[str]:
    """Describe mean of engaged shifts and retries of a prediction; empty without retries."""
    if expected is None or not (expected.retries or expected.retries_error):
        return []
    engaged_mean, error = expected.without_retries
    return [
        f"mean of engaged shifts {time_text(engaged_mean, error)}, retries "
        f"{time_text(expected.retries, expected.retries_error)}; {config.retry_text}"
    ]


def check_design(
    config: Setup, requested: RequestedPoint = ALL_POINTS, surrogate: str | Path | None = None
) -> Check:
    """Check a design as ``Study.check`` does, for a study that is read."""
    points = points_of(config, requested)
    mix = study_mix(config, points)
    guess = _guess(config, mix, surrogate)
    if guess is not None and surrogate is not None:
        expected = guess.answer.expected
        judged = judge_design(design_of(config, {}, None))
        return Check(config, *judged, mix, expected, guess=guess, refusal=guess.answer.refusal)
    # Half a second that an answer of the surrogate does not need.
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415
    from dogshape.pipeline.simulate.executor import scratch_executor  # noqa: PLC0415

    # The angles of the search, so that a design passes here if it does there.
    setup = replace(config, points=points).in_engine("planar")
    sample = config.file.expectation
    (simulated,) = evaluate(setup, [{}], scratch_executor(1), sample.angles, sample.seed)
    mean = simulated.expectation
    expected, refusal = _simulated_time(mean, mix)
    judged = judge_design(design_of(config, {}, simulated.check_inputs))
    return Check(
        config,
        *judged,
        mix,
        expected,
        shifts=mean.shifts,
        engaged=mean.engaged,
        guess=guess,
        refusal=refusal,
        quantiles=ExpectedTime.of(mean).quantiles or (),
        hangs=hang_keys(mean),
    )


def _guess(config: Setup, mix: Mix, surrogate: str | Path | None) -> Guess | None:
    """Predict the prototype's shift time by a surrogate; None without one of the same physics."""
    match = matching_surrogate(config, surrogate)
    if match is None:
        return None
    stored, path = match
    model = stored.surrogate
    prototype = config.prototype
    answer = ask(model, prototype, mix, config.physics)
    checks = manufacturing_checks(config.clutch.dog, config.limits.manufacturing)
    faults = [check for check in checks if not check.passed]
    if faults:  # the surrogate was fitted without such dogs
        warnings = (*answer.warnings, "the dog cannot be made")
        reason = f"{faults[0].fault} to be made, and the surrogate has no other dogs"
        answer = Answer(None, answer.distance, warnings, f"{reason}; {faults[0].remedy}")
    return Guess(answer, tolerance_time(config, model, prototype, mix), stored.validation, path)


def _simulated_time(mean: MixExpectation, mix: Mix) -> tuple[Expected | None, str]:
    """Compute the interval of a simulated time, engine's error included, or a refusal.

    Returns the time and an empty sentence, or None and the reason.
    """
    if not mean.engages:
        worst = f"{percent(mean.engaged)} at the worst point"
        count = f"engages in {mean.shifts - mean.lost} of {mean.shifts} shifts, in {worst}"
        return None, f"{count}; {mean.losses}"
    error = math.hypot(mean.standard_error, ENGINE_ERROR * mean.engaged_mean)
    engaged_error = math.hypot(mean.engaged_error, ENGINE_ERROR * mean.engaged_mean)
    low, high = positive_interval(
        Estimate(mean.engaged_mean, engaged_error), Estimate(mean.retries, mean.retries_error)
    )
    deviations = np.array([point.sd for point in mean.points])
    expected = Expected(
        time=mean.mean,
        low=low,
        high=high,
        error=error,
        sd=math.sqrt(mix.weights @ deviations**2),
        engaged=mean.engaged,
        retries=mean.retries,
        retries_error=mean.retries_error,
    )
    return expected, ""


class FlankStrike(NamedTuple):
    """Strike of a flank with the free ring; its fields are keys of the record."""

    flank: str
    ends: str  #: ends of ranges in the study file; empty for single values
    mismatch_rpm: float  #: speed of the flanks against each other
    torque_Nm: float
    force_per_dog_N: float  #: largest force on a dog

    @property
    def text(self) -> str:
        """Sentence on the strike."""
        text = (
            f"{self.flank} flanks that strike at {self.mismatch_rpm:.4g} 1/min make "
            f"{self.torque_Nm:.0f} N m, {self.force_per_dog_N:.0f} N on one dog"
        )
        return f"{text} at {self.ends}" if self.ends else text


@dataclass(frozen=True, repr=False)
class Strength(Checked):
    """Checks of one design under its load; ``shifts`` is the number of simulated landings."""

    shifts: int = 0

    @property
    def strikes(self) -> list[FlankStrike]:
        """Flank strikes at the ends of the assumed ranges."""
        dog = self.config.clutch.dog
        limits = self.config.limits
        return [
            FlankStrike(
                flank=flank,
                ends=strike.ends,
                mismatch_rpm=strike.speed(flank) / RPM,
                torque_Nm=strike_torque(dog, limits, strike, flank),
                force_per_dog_N=strike_force(dog, limits, strike, flank),
            )
            for strike in limits.strikes
            for flank in strike.flanks
        ]

    def to_parts(self) -> list[str | Table]:
        """Tabulate the checks, with lines on landing and flank strikes."""
        landing = self.landing_of(self.shifts, self.config.clutch.solver.engine)
        return [*super().to_parts(), *landing, *(strike.text for strike in self.strikes)]

    def to_dict(self) -> dict[str, Any]:
        """Convert every check, the load and the material's limits to values of JSON."""
        limits = self.config.limits
        load = self.config.file.load.model_dump()
        load["load_sharing"] = self.load_sharing["traction"]
        dog = self.config.clutch.dog
        force = bearing_limits(dog, limits).load.force_per_dog(dog)
        return {
            "engine": self.config.clutch.solver.engine,
            **super().to_dict(),
            "warnings": list(self.notes),
            "load": {**load, "force_per_dog_N": force, "blocking_force_N": self.blocking_force_N},
            "material": {
                "set": limits.material.name,
                "source": limits.material.description,
                "allowable_stress_MPa": limits.allowable_stress / MPA,
                "fatigue_stress_MPa": limits.endurance(limits.load.shifts) / MPA,
            },
            **({"strikes": [strike._asdict() for strike in self.strikes]} if self.strikes else {}),
        }


def check_strength(config: Setup, options: RunOptions, *, simulate: bool = True) -> Strength:
    """Check the strength of a study's design as ``Study.strength`` does."""
    from dogshape.pipeline.simulate.evaluation import evaluate  # noqa: PLC0415

    config = config.search_setup
    settings = config.file.expectation
    shifts = len(config.points) * settings.angles if simulate else 0
    check_inputs = None
    if simulate:
        with options.executor("strength", (config.config_hash,), shifts) as (executor, _):
            (found,) = evaluate(config, [{}], executor, settings.angles, settings.seed)
        check_inputs = found.check_inputs
    return Strength(config, *judge_design(design_of(config, {}, check_inputs)), shifts)
