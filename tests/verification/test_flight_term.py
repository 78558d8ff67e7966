"""What the flight alone tells: effects of simulated benches, no effect, and what nobody knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.flight_marks import WAYS
from dogshape.diagnosis.bench.reading import gather
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.parameter_intervals import intervals
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.unknown import unknown
from dogshape.diagnosis.likelihood.flight_likelihood import log_flights, log_unknown, to_cells
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem, Scored
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN, Space
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Hypothesis
from tests.flying import EFFECTS, FlightOnly, flying_bench
from tests.toy import Toy

EMULATOR = FlightOnly()
RIVALS = (
    "actuation_delay",
    "actuation_lag",
    "force_scale",
    "linkage_compliance",
    "moving_mass",
    "sleeve_friction",
    "viscous_damping",
)
TRUTHS: dict[str, Mapping[str, float]] = {
    "actuation_delay": {"delay_s": 0.02},
    "actuation_lag": {"lag_s": 0.02},
    "moving_mass": {"added_mass_kg": 0.5},
    "sleeve_friction": {"friction_N": 40.0},
}


@cache
def _named(name: str) -> Bench:
    """Return the bench with one of the effects."""
    return flying_bench(name, TRUTHS[name])


def _problem(bench: Bench) -> Problem:
    return Problem(observe(bench), EMULATOR, USUAL)


def _scored(bench: Bench, names: tuple[str, ...] = RIVALS) -> dict[Hypothesis, Scored]:
    problem, setting = _problem(bench), setting_of(bench)
    spaces = [Space(tuple(EFFECTS[n] for n in h), setting) for h in (NONE, *((n,) for n in names))]
    return {space.hypothesis: evidence(problem, space) for space in spaces}


def _logs(bench: Bench, names: tuple[str, ...] = RIVALS) -> dict[Hypothesis, float]:
    logs = {h: one.log_evidence for h, one in _scored(bench, names).items()}
    return {**logs, UNKNOWN: unknown(_problem(bench), bench).log_evidence}


@pytest.fixture(scope="module")
def plain() -> Bench:
    """A bench without any effect."""
    return flying_bench(None, {})


@pytest.mark.parametrize("name", TRUTHS)
def test_the_flight_tells_the_effect_from_all_rivals(name: str) -> None:
    found = _scored(_named(name))
    logs = {h: one.log_evidence for h, one in found.items()}
    same = {(name,)}
    if name == "moving_mass":  # a stiff linkage with that mass behind it
        same.add(("linkage_compliance",))
    others = [log for hypothesis, log in logs.items() if hypothesis not in same]
    assert logs[(name,)] > max(others) + 5.0
    for parameter, value in TRUTHS[name].items():
        interval = intervals(found[(name,)])[parameter]
        assert interval.low - 0.05 * value < value < interval.high + 0.05 * value
    free = log_unknown(_problem(_named(name)).flights, _problem(_named(name)).flown(NONE, _NOTHING))
    mine = found[(name,)].log_evidence - _without(_named(name))
    assert mine > free + 3.0


_NOTHING = np.zeros((1, 0))


def _without(bench: Bench) -> float:
    """Return what times and shares engaged add to any hypothesis."""
    problem = _problem(bench)
    flown = problem.flown(NONE, _NOTHING)
    whole = evidence(problem, Space((), setting_of(bench))).log_evidence
    return whole - float(log_flights(problem.flights, flown).sum())


def test_no_effect_is_none_and_can_have_made_the_traces(plain: Bench) -> None:
    found = _scored(plain, ("actuation_delay", "moving_mass"))
    logs = {h: one.log_evidence for h, one in found.items()}
    assert max(logs, key=lambda h: logs[h]) == NONE
    problem = _problem(plain)
    free = log_unknown(problem.flights, problem.flown(NONE, _NOTHING))
    none = logs[NONE] - _without(plain)
    assert none - 1.0 < free < none  # its prior gives half to marks that nothing moved
    assert p_value(problem, found[NONE]) > 0.05


def _moved(bench: Bench, offsets: Mapping[float, float]) -> Bench:
    """Return a bench whose displacement comes later by something for each force, s."""
    rows = []
    for reading in bench.readings:
        trace, late = reading.trace, offsets[reading.point.profile.force]
        assert trace is not None
        way = np.interp(trace.time - late, trace.time, trace.displacement)
        rows.append(replace(reading, trace=replace(trace, displacement=way)))
    return replace(bench, cells=gather(rows))


def test_traces_that_no_effect_explains_raise_unknown(plain: Bench) -> None:
    odd = _moved(plain, {235.2: 0.002, 315.5: 0.03, 469.0: 0.003, 641.5: 0.025})
    logs = _logs(odd)
    assert max(logs, key=lambda h: logs[h]) == UNKNOWN
    assert logs[UNKNOWN] > max(v for h, v in logs.items() if h != UNKNOWN) + 5.0
    best = max(_scored(odd).values(), key=lambda one: one.log_evidence)
    assert p_value(_problem(odd), best) < 0.01


def test_a_force_column_with_the_nominal_course_hides_no_delay(plain: Bench) -> None:
    """The displacement is late and the force is not: it may be the one that was asked for."""
    late = _moved(plain, dict.fromkeys((235.2, 315.5, 469.0, 641.5), 0.02))
    logs = _logs(late)
    named = logs.pop(("actuation_delay",))
    assert named > max(logs.values()) + 3.0


def test_parts_of_cells_add_up_to_both_readings_of_the_force(plain: Bench) -> None:
    problem = _problem(plain)
    values = np.array([[0.0], [0.001], [0.05]])
    flown = problem.flown(("actuation_delay",), values)
    table = to_cells(problem.flights, log_flights(problem.flights, flown), problem.seen.cells)
    readings = []
    for name in ("times", "nominal"):
        same = [replace(one, times=getattr(one, name), nominal=getattr(one, name)) for one in flown]
        readings.append(log_flights(problem.flights, same).sum(axis=0))
    whole = np.logaddexp(*readings) - np.log(2.0)
    assert table.sum(axis=1) == pytest.approx(whole)
    assert (table != 0.0).all()  # eight cells, all of which have traces


def test_the_marks_of_the_force_show_what_acts(plain: Bench) -> None:
    late = [one.times[one.places >= len(WAYS)] for one in _problem(plain).flights]
    delayed = _problem(_named("actuation_delay")).flights
    for one, before in zip(delayed, late, strict=True):
        after = one.times[one.places >= len(WAYS)]
        count = min(before.size, after.size)
        assert count >= 1
        assert after[:count] - before[:count] == pytest.approx(0.02, abs=2e-3)


def test_an_emulator_without_flight_leaves_traces_out(plain: Bench) -> None:
    toy = Toy(tuple(cell.point for cell in plain.cells))
    problem = Problem(observe(plain), toy, USUAL)
    assert problem.flights == ()
    assert problem.summary(NONE, _NOTHING).flight is None
    assert unknown(problem, plain).flight == 0.0
