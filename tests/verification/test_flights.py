"""Free flight of the ring: closed forms, Drake, interpolation, and evidence of its marks."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import chi2, multivariate_t
from scipy.stats.qmc import Sobol

from dogshape.bench.bench_data import Bench, gather
from dogshape.bench.flight_marks import FORCES, WAYS, SeenFlight, flights_of
from dogshape.diagnosis.prediction import flights as module
from dogshape.diagnosis.prediction.flights import Flights, fly, log_flights, log_unknown
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array, Hypothesis
from dogshape.sim import kernel
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from tests.trace_benches import EFFECTS, settings, trace_bench

GAP = 1e-3
LEVELS = np.array(WAYS) * GAP


@pytest.fixture(scope="module")
def plain() -> Setting:
    """The baseline at 315.5 N."""
    return next(s for s in settings() if s.point.profile.force == 315.5)


def _fly(setting: Setting, force: float = 315.5) -> np.ndarray:
    return fly([setting], GAP, force, USUAL.flight_creep)[0][0]


@pytest.mark.parametrize("mass", [0.0, 0.2, 5.0])
@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_a_mass_under_a_step_flies_in_closed_form(plain: Setting, mass: float, lag: float) -> None:
    setting = plain.with_mechanism(added_mass=mass)
    if lag:
        setting = setting.with_point(profile=ForceProfile(315.5, 0.2026, lag=lag))
    profile = setting.point.profile
    exact = [profile.free_flight_time(level, 0.3 + mass) for level in LEVELS]
    assert _fly(setting)[: len(WAYS)] == pytest.approx(exact, abs=5e-6)


def test_the_force_passes_its_shares_when_the_profile_says(plain: Setting) -> None:
    found = _fly(plain)[len(WAYS) :]
    assert plain.point.profile.at(found) == pytest.approx(315.5 * np.array(FORCES), rel=1e-5)


def test_friction_above_the_force_holds_the_ring(plain: Setting) -> None:
    (times,), creep, (ring,) = fly(
        [plain.with_mechanism(friction=400.0)], GAP, 315.5, USUAL.flight_creep
    )
    assert creep == pytest.approx(0.0)  # no error of the release explains that nothing moves
    assert times[: len(WAYS)] == pytest.approx(plain.clutch.timeout)
    assert ring == pytest.approx(0.0)


def test_creep_is_of_the_order_of_what_a_smooth_law_makes_earlier(plain: Setting) -> None:
    """A law that is smooth from the start lets the ring creep while it is held here."""
    held = plain.with_mechanism(friction=60.0)
    detent = held.with_mechanism(friction=60.0, detent=1e-9, detent_position=0.0)
    (later, earlier), creep, _ = fly([held, detent], GAP, 315.5, USUAL.flight_creep)
    ways = slice(1, len(WAYS))
    assert (later > earlier)[ways].all()
    assert creep[0, ways] == pytest.approx(2.0 * (later - earlier)[ways], rel=0.3)


def test_strong_damping_gives_the_speed_of_force_over_damper(plain: Setting) -> None:
    """x = (F/c)(t - (m/c)(1 - exp(-c t/m))) under a constant force."""
    damping = 800.0
    setting = plain.with_point(profile=ForceProfile(100.0, 1e-4)).with_mechanism(damping=damping)
    time = _fly(setting, 100.0)[: len(WAYS)] - 0.5e-4
    rate = damping / 0.3
    way = 100.0 / damping * (time - (1.0 - np.exp(-rate * time)) / rate)
    assert way == pytest.approx(LEVELS, rel=5e-3)


DRAKE: dict[str, Mapping[str, Mapping[str, float]]] = {
    "lag": {"actuation_lag": {"lag_s": 0.03}},
    "detent": {"detent_force": {"detent_N": 60.0, "position_mm": 0.6}},
    "force": {"force_scale": {"force_factor": 0.8}},
    "play": {"free_play": {"free_play_mm": 0.4}},
    "linkage": {"linkage_compliance": {"compliance_mm_kN": 8.0}},
    "mass": {"moving_mass": {"added_mass_kg": 1.5}},
    "friction": {"sleeve_friction": {"friction_N": 65.0}},
    "damping": {"viscous_damping": {"damping_Ns_m": 150.0}},
    "held linkage": {
        "linkage_compliance": {"compliance_mm_kN": 8.0},
        "moving_mass": {"added_mass_kg": 1.5},
        "sleeve_friction": {"friction_N": 65.0},
    },
    "held play": {"free_play": {"free_play_mm": 0.4}, "sleeve_friction": {"friction_N": 65.0}},
}


@pytest.mark.parametrize("sensor", ["sleeve", "actuator"])
@pytest.mark.parametrize("name", DRAKE)
def test_the_flight_is_that_of_a_shift_in_drake(plain: Setting, name: str, sensor: str) -> None:
    setting = Setting(plain.clutch, plain.point, sensor=sensor)  # type: ignore[arg-type]
    for effect, values in DRAKE[name].items():
        neutral = EFFECTS[effect].neutral(setting)
        setting = EFFECTS[effect].apply(setting, {**neutral, **values})
    trace = engage(ClutchPlant(setting.clutch), setting.point, 0.1).trace
    way, speed = trace.displacement, trace.axial_speed
    if sensor == "actuator":
        way, speed = trace.actuator_displacement, trace.actuator_speed
    drake = [kernel.crossing(trace.time, way, speed, level) for level in LEVELS]
    assert _fly(setting)[: len(WAYS)] == pytest.approx(drake, abs=5e-5)


MOVING = (
    *("actuation_lag", "detent_force", "force_scale", "free_play", "linkage_compliance"),
    *("moving_mass", "sleeve_friction", "viscous_damping"),
)


def _at(names: tuple[str, ...], shares: np.ndarray) -> tuple[np.ndarray, list[Mapping[str, float]]]:
    """Return values of effects (m, p) at shares of their priors (m, p), and the same by name."""
    parameters = [p for name in names for p in EFFECTS[name].parameters]
    rows = [[p.at(s) for p, s in zip(parameters, row, strict=True)] for row in shares.tolist()]
    keys = [p.name for p in parameters]
    return np.array(rows).reshape(len(shares), -1), [dict(zip(keys, r, strict=True)) for r in rows]


def _changed(names: tuple[str, ...], values: Mapping[str, float], setting: Setting) -> Setting:
    for name in names:
        mine = {p.name: values[p.name] for p in EFFECTS[name].parameters}
        setting = EFFECTS[name].apply(setting, mine)
    return setting


@pytest.mark.parametrize("count", [1, 2, 3])
def test_interpolated_marks_err_no_more_than_they_say(plain: Setting, count: int) -> None:
    """Against flights at random values of any one, two or three effects that move the flight.

    Both have the same law of each effect, so its error does not count.
    """
    lawful = replace(USUAL, flight_law=0.0)
    flights, rng = Flights(EFFECTS, (plain,), lawful), np.random.default_rng(1)
    scores, apart = [], []
    for names in list(itertools.combinations(MOVING, count))[:: 1 if count < 3 else 4]:
        shares = rng.random((12, sum(len(EFFECTS[name].parameters) for name in names)))
        values, rows = _at(names, shares)
        said = flights.marks(names, values, plain.point.profile)
        exact = fly([_changed(names, row, plain) for row in rows], GAP, 315.5, USUAL.flight_creep)[
            0
        ]
        there = exact < 0.99 * plain.clutch.timeout
        flown = flights.marks(names, values, plain.point.profile, exact=True).times
        assert flown[there] == pytest.approx(exact[there], rel=1e-6)
        apart.append(abs(said.times - exact)[there])
        scores.append(apart[-1] / np.hypot(said.error, 1e-4)[there])
    score = np.concatenate(scores)
    assert np.sqrt((score**2).mean()) < 1.3
    assert np.quantile(score, 0.95) < 1.96
    assert np.median(np.concatenate(apart)) < (1e-6, 2e-5, 2e-4)[count - 1]


def test_a_delay_adds_to_all_marks_exactly(plain: Setting) -> None:
    flights = Flights(EFFECTS, (plain,), USUAL)
    still = flights.marks((), np.zeros((1, 0)), plain.point.profile)
    late = flights.marks(("actuation_delay",), np.array([[0.0123], [0.31]]), plain.point.profile)
    assert late.times - still.times == pytest.approx(np.array([[0.0123], [0.31]]) * np.ones(9))
    assert late.error == pytest.approx(0.0)
    both = ("actuation_delay", "moving_mass")
    alone = flights.marks(both[1:], np.array([[1.2]]), plain.point.profile)
    pair = flights.marks(both, np.array([[0.02, 1.2]]), plain.point.profile)
    assert pair.times - alone.times == pytest.approx(0.02)
    assert pair.error == pytest.approx(alone.error)


def test_marks_behind_the_first_touch_are_uncertain(plain: Setting) -> None:
    """With a smaller gap dogs meet before the nominal shares of it are passed."""
    flights = Flights(EFFECTS, (plain,), USUAL)
    less, more = flights.marks(("axial_gap",), np.array([[-0.5], [0.3]]), plain.point.profile).error
    assert less[: len(WAYS)] == pytest.approx([0.0, 0.0, 0.0, 0.02, 0.02], abs=1e-9)
    assert more == pytest.approx(0.0, abs=1e-9)


FLIGHTS = Flights(EFFECTS, settings(), USUAL)
NOTHING = np.zeros((1, 0))
RIVALS = ("actuation_delay", *(n for n in MOVING if n not in ("detent_force", "free_play")))
TRUTHS: dict[str, Mapping[str, float]] = {
    "actuation_delay": {"delay_s": 0.02},
    "actuation_lag": {"lag_s": 0.02},
    "moving_mass": {"added_mass_kg": 0.5},
    "sleeve_friction": {"friction_N": 40.0},
}


@cache
def _seen(name: str | None) -> tuple[SeenFlight, ...]:
    """Return the marks of a bench with one of the effects, or without any."""
    return flights_of(trace_bench(name, TRUTHS[name] if name else {}))


def _values(name: str) -> Array:
    """Fill the prior of an effect evenly, (1024, p)."""
    return _at((name,), Sobol(len(EFFECTS[name].parameters), seed=1).random(1024))[0]


def _evidence(seen: tuple[SeenFlight, ...]) -> dict[Hypothesis, float]:
    """Compute log evidence by the mean of the density over the prior."""
    found: dict[Hypothesis, float] = {(): float(log_flights(seen, FLIGHTS, (), NOTHING)[0])}
    for name in RIVALS:
        values = _values(name)
        logs = log_flights(seen, FLIGHTS, (name,), values)
        found[(name,)] = float(logsumexp(logs) - np.log(len(values)))
    return found


@pytest.mark.parametrize("name", TRUTHS)
def test_the_flight_tells_the_effect_from_all_rivals(name: str) -> None:
    seen = _seen(name)
    logs = _evidence(seen)
    mine = logs.pop((name,))
    if name == "moving_mass":  # a stiff linkage with that mass is the same
        logs = {h: log for h, log in logs.items() if "linkage_compliance" not in h}
    assert mine > max(logs.values()) + 5.0
    assert mine > log_unknown(seen, FLIGHTS) + 3.0
    (truth,) = TRUTHS[name].values()
    values = _values(name)
    logs_of = log_flights(seen, FLIGHTS, (name,), values)
    weights = np.exp(logs_of - logs_of.max())
    mean = weights @ values[:, 0] / weights.sum()
    sd = np.sqrt(weights @ (values[:, 0] - mean) ** 2 / weights.sum())
    assert abs(mean - truth) < 2.0 * sd + 0.05 * truth
    best = values[[np.argmax(logs_of)]]
    assert _p_value(seen, (name,), best) > 0.05


def _p_value(seen: tuple[SeenFlight, ...], h: Hypothesis, values: Array) -> float:
    scores = module.flight_scores(seen, FLIGHTS, h, values)
    return float(chi2.sf((scores**2).sum(axis=1), len(seen))[0])


def _moved(bench: Bench, offsets: Mapping[float, float]) -> Bench:
    """Return a bench whose displacement comes later by something for each force, s."""
    rows = []
    for reading in bench.readings:
        trace, late = reading.trace, offsets[reading.point.profile.force]
        assert trace is not None
        way = np.interp(trace.time - late, trace.time, trace.displacement)
        rows.append(replace(reading, trace=replace(trace, displacement=way)))
    return replace(bench, cells=gather(rows))


def test_traces_that_no_effect_explains_raise_unknown() -> None:
    offsets = {235.2: 0.002, 315.5: 0.03, 469.0: 0.003, 641.5: 0.025}
    seen = flights_of(_moved(trace_bench(None, {}), offsets))
    logs = _evidence(seen)
    assert log_unknown(seen, FLIGHTS) > max(logs.values()) + 5.0
    best = max(logs, key=lambda h: logs[h])
    values = _values(best[0])
    values = values[[np.argmax(log_flights(seen, FLIGHTS, best, values))]]
    assert _p_value(seen, best, values) < 0.01


def test_the_density_is_students_in_both_readings_of_the_force() -> None:
    seen = _seen(None)[:1]
    (one,) = seen
    values = np.array([[0.0], [0.001], [0.05]])
    marks = FLIGHTS.marks(("actuation_delay",), values, one.profile)
    still = FLIGHTS.marks((), NOTHING, one.profile).times[0]
    logs = []
    for times, error in zip(marks.times, marks.error, strict=True):
        shape = one.covariance + np.diag(error[one.places] ** 2)
        nominal = np.where(np.arange(times.size) < len(WAYS), times, still)
        both = [
            multivariate_t(mean[one.places], shape, df=5.0).logpdf(one.times)
            for mean in (times, nominal)
        ]
        logs.append(np.logaddexp(*both) - np.log(2.0))
    assert log_flights(seen, FLIGHTS, ("actuation_delay",), values) == pytest.approx(logs)
