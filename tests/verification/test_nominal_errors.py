"""Errors of nominal force and mismatch: derivatives, variances, and what they do to a verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.input_errors import NominalInputs, inputs_of
from dogshape.diagnosis.bench.nominal_errors import NominalErrors, Tolerance
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import NONE
from dogshape.diagnosis.prediction.prediction import Prediction
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.pipeline.diagnose.bank_diagnosis import Means, emulator_of, with_bank_engine
from dogshape.sim.effects import load
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM
from tests.benches import good_set
from tests.toy import CLUTCH, EFFECTS, Toy, bench_of, points_of

POINTS = points_of()
BOTH = Tolerance(force_share=0.02, force=3.0, mismatch_share=0.01, mismatch=0.5 * RPM)


def _law(point: OperatingPoint) -> float:
    """Return a mean time in s, linear in the free flight and in ln mismatch."""
    flight = point.profile.free_flight_time(CLUTCH.shift_travel, CLUTCH.rings.mass)
    return 1.7 * flight + 0.3 - 0.05 * float(np.log(abs(point.mismatch) + RPM))


@dataclass(frozen=True)
class _Law:
    """An emulator of that law, whatever the hypothesis."""

    points: tuple[OperatingPoint, ...]

    def at(self, hypothesis: Hypothesis, values: Array, cell: int) -> Prediction:
        """Return the law with a spread of a tenth."""
        mean = _law(self.points[cell])
        times = np.tile(mean * (1.0 + np.linspace(-0.1, 0.1, 16)), (len(values), 1))
        one = np.ones(len(values))
        return Prediction.plain(times, one, 1e-3 * one, 0.02 * one)


def _inputs(points: tuple[OperatingPoint, ...], errors: NominalErrors) -> NominalInputs:
    bench = replace(bench_of({}, np.random.default_rng(1), points=points), errors=errors)
    found = inputs_of(bench)
    assert found is not None
    return found


def test_slopes_are_the_derivatives_of_a_law_that_is_linear_in_their_places() -> None:
    turned = tuple(OperatingPoint(-p.mismatch, p.profile) for p in POINTS[4:12])
    points = (*POINTS, *turned)
    inputs = _inputs(points, NominalErrors(systematic=BOTH))
    found = inputs.sensitivity(np.array([_law(p) for p in points]))
    for place, point in enumerate(points):
        force, rise = point.profile.force, point.profile.rise
        ends = [_law(OperatingPoint(point.mismatch, ForceProfile(force * by, rise)))
                for by in (np.exp(-1e-4), np.exp(1e-4))]  # fmt: skip
        assert found.force[place] == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=1e-3)
        ends = [_law(OperatingPoint(point.mismatch + by, point.profile)) for by in (-1e-4, 1e-4)]
        assert found.mismatch[place] == pytest.approx((ends[1] - ends[0]) / 2e-4, rel=1e-3)
    assert not found.lacking


@pytest.mark.parametrize("apart", [0.001, 0.005])
def test_slopes_of_measured_set_values_are_no_steeper_than_those_of_nominal_ones(
    apart: float,
) -> None:
    """Means err by half a millisecond, and force and mismatch jitter from row to row."""
    generator = np.random.default_rng(1)
    off = 1.0 + apart * generator.uniform(-1.0, 1.0, (2, len(POINTS), 2))
    points = tuple(
        OperatingPoint(p.mismatch * n, ForceProfile(p.profile.force * f, p.profile.rise))
        for half in off
        for p, (n, f) in zip(POINTS, half, strict=True)
    )
    true, errors = _inputs(POINTS, NominalErrors(systematic=BOTH)), NominalErrors(systematic=BOTH)
    plain = true.sensitivity(np.array([_law(p) for p in POINTS]))
    noise = generator.normal(0.0, 0.5e-3, len(points))
    found = _inputs(points, errors).sensitivity(np.array([_law(p) for p in points]) + noise)
    assert not found.lacking
    twice = np.tile(plain.force, 2), np.tile(plain.mismatch, 2)
    assert np.abs(found.force / twice[0] - 1.0).max() < 0.2
    assert np.abs(found.mismatch / twice[1] - 1.0).max() < 0.2


def test_errors_add_up_as_asme_says() -> None:
    """u_input^2 is the sum of (dT/dX u_X)^2: in the variance, or in a common covariance."""
    errors = NominalErrors(systematic=BOTH, each_point=BOTH)
    bench = bench_of({}, np.random.default_rng(1), points=POINTS)
    plain, stated = (
        Problem(observe(replace(bench, errors=one)), _Law(POINTS), USUAL)
        for one in (NominalErrors(), errors)
    )
    slope = _inputs(POINTS, errors).sensitivity(plain.baseline)
    force = np.array([p.profile.force for p in POINTS])
    mismatch = np.array([p.mismatch for p in POINTS])
    columns = [
        slope.force * 0.02,
        slope.force / force * 3.0,
        slope.mismatch * mismatch * 0.01,
        slope.mismatch * 0.5 * RPM,
    ]
    nothing = np.zeros((1, 0))
    more = stated.predictions(NONE, nothing).error[:, 0] ** 2
    less = plain.predictions(NONE, nothing).error[:, 0] ** 2
    assert more - less == pytest.approx(sum(c**2 for c in columns), rel=1e-9)
    covariance = stated.discrepancy.covariance - plain.discrepancy.covariance
    assert covariance == pytest.approx(sum(np.outer(c, c) for c in columns), rel=1e-9, abs=1e-15)
    inputs = stated.seen.inputs
    assert inputs is not None
    told = inputs.propagated(plain.baseline)
    whole = np.sqrt(np.mean(sum(c**2 for c in columns)))
    assert (told.systematic, told.each_point) == (pytest.approx(whole), pytest.approx(whole))
    assert told.whole == pytest.approx(2.0**0.5 * whole)


def test_slopes_are_near_those_that_the_bank_has_of_the_effects() -> None:
    """A second way: forces and mismatches that are simulated a little larger and smaller.

    The bundled bank has the effects at levels of their own; neighbours on the grid know neither.
    """
    effects, means = load(), Means()
    bench = with_bank_engine(load_bench("mq200_stand"), effects, means)
    emulator, _ = emulator_of(bench, effects, means)

    def mean(hypothesis: Hypothesis, *values: float) -> Array:
        rows = np.array([values]).reshape(1, -1)
        cells = range(len(bench.cells))
        return np.array([emulator.at(hypothesis, rows, k).times.mean() for k in cells])

    inputs = inputs_of(replace(bench, errors=NominalErrors(systematic=BOTH)))
    assert inputs is not None
    found = inputs.sensitivity(mean(NONE))
    force = (mean(("force_scale",), 1.05) - mean(("force_scale",), 0.95)) / np.log(1.05 / 0.95)
    speed = ("mismatch_speed",)
    mismatch = (mean(speed, 1.0, 1.0) - mean(speed, -1.0, 1.0)) / (2.0 * RPM)
    pairs = (found.force, force, 0.25), (found.mismatch, mismatch, 0.4)
    for mine, direct, share in pairs:
        size = np.sqrt((direct**2).mean())
        assert np.sqrt(((mine - direct) ** 2).mean()) < share * size
        assert np.corrcoef(mine, direct)[0, 1] > 0.85


def test_what_one_force_or_mismatch_cannot_show_is_said() -> None:
    alone = _inputs(points_of((469.0,)), NominalErrors(each_point=Tolerance(force_share=0.02)))
    means = np.array([_law(p) for p in points_of((469.0,))])
    found = alone.sensitivity(means)
    assert found.force == pytest.approx(alone.flight_slope)
    assert "one force only" in alone.propagated(means).sentence
    single = tuple(p for p in POINTS if p.mismatch == POINTS[0].mismatch)
    errors = NominalErrors(each_point=Tolerance(mismatch=RPM))
    said = _inputs(single, errors).propagated(np.array([_law(p) for p in single]))
    assert said.each_point == 0.0
    assert "one mismatch only, an error of the mismatch is not propagated" in said.sentence
    assert "one force" not in said.sentence


def _diagnosed(share: float) -> Diagnosis:
    """Diagnose the toy with 0.65 of the force, where its error is a share of it."""
    bench = bench_of({"force_factor": 0.65}, np.random.default_rng(2), shifts=2000)
    errors = NominalErrors(systematic=Tolerance(force_share=share))
    effects = {n: EFFECTS[n] for n in ("actuation_delay", "axial_gap", "force_scale")}
    return diagnose(replace(bench, errors=errors), Toy(POINTS, 256), effects, pairs=[])


def test_a_force_within_its_tolerance_is_no_effect_and_one_beyond_it_is() -> None:
    exact, tight, loose = (_diagnosed(share) for share in (0.0, 0.02, 0.25))
    cause = ("force_scale",)
    assert exact.posterior[cause] > 0.7
    assert tight.posterior[cause] == pytest.approx(exact.posterior[cause], abs=0.02)
    assert loose.posterior[cause] < 0.2
    assert (exact.verdict.kind, loose.verdict.kind) == ("ambiguous", "none")
    widths = [
        one.intervals[cause]["force_factor"].high - one.intervals[cause]["force_factor"].low
        for one in (exact, tight, loose)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.05)
    assert widths[2] > 2.0 * widths[0]
    assert "nominal_errors" not in exact.as_dict()
    record = tight.as_dict()
    assert record["nominal_errors"]["sentence"] in record["summary"]
    assert record["nominal_errors"]["each_point_rms_s"] == 0.0


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[errors.systematic]\nforce_percent = -1\n", "errors.systematic.force_percent is -1"),
        ("[errors.each_point]\nmismatch_rpm = 1e5\n", "errors.each_point.mismatch_rpm is 100000"),
        ("[errors.each_point]\nforce = 1\n", "errors.each_point.force"),
    ],
)
def test_the_table_of_errors_is_read_or_refused(tmp_path: Path, table: str, words: str) -> None:
    folder = good_set(tmp_path)
    file = folder / "bench.toml"
    text = file.read_text()
    assert not load_bench(folder).errors
    stated = "[errors.systematic]\nforce_percent = 2\nmismatch_rpm = 0.5\n"
    file.write_text(f"{text}\n{stated}[errors.each_point]\nforce_N = 3\n")
    errors = load_bench(folder).errors
    assert errors.systematic == Tolerance(force_share=0.02, mismatch=0.5 * RPM)
    assert errors.each_point == Tolerance(force=3.0)
    file.write_text(f"{text}\n{table}")
    with pytest.raises(DogshapeError) as refused:
        load_bench(folder)
    assert words in str(refused.value)


def test_some_of_the_cells_keep_the_errors_that_they_had_among_all() -> None:
    errors = NominalErrors(systematic=BOTH, each_point=BOTH)
    bench = replace(bench_of({}, np.random.default_rng(1), points=POINTS), errors=errors)
    whole = Problem(observe(bench), _Law(POINTS), USUAL)
    cells = np.arange(len(POINTS)) % 3 > 0
    part, nothing = whole.of(cells), np.zeros((1, 0))
    assert part.predictions(NONE, nothing).error == pytest.approx(
        whole.predictions(NONE, nothing).error[cells]
    )
    covariance = whole.discrepancy.covariance[np.ix_(cells, cells)]
    assert part.discrepancy.covariance == pytest.approx(covariance)
