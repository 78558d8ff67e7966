"""Marks of the contact in traces: what the compiled engine's shifts show beside closed forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_t

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.bench.contact_marks import SeenContacts, contacts_of
from dogshape.diagnosis.prediction.contacts import Contacts, _log_density, friction_coefficient
from dogshape.diagnosis.prediction.simulations import settings_of
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import NONE, Array, Hypothesis
from dogshape.sim.setting import Setting
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.units import RPM
from tests.trace_benches import EFFECTS, sample_trace

POINTS = ((25.0, 315.5), (50.0, 315.5), (149.0, 641.5))  #: mismatch, 1/min, and force, N
SPEED_NOISE = 0.3 * RPM  #: scatter of the speeds, rad/s
SHIFTS = 4
TRUTHS: dict[str, Mapping[str, float]] = {
    "contact_friction": {"static_friction": 0.15, "dynamic_friction": 0.1},
    "chamfer_angle": {"chamfer_offset_deg": 3.0},
    "sliding_inertia": {"inertia_factor": 2.0},
    "drag_torque": {"drag_Nm": 0.6},
    "mismatch_speed": {"offset_rpm": 0.0, "mismatch_factor": 1.2},
}


def _settings(bench: Bench) -> tuple[Setting, ...]:
    chosen = []
    for setting in settings_of(bench, "sleeve"):
        point = setting.point.mismatch / RPM, setting.point.profile.force
        if any(np.allclose(point, other, rtol=1e-3) for other in POINTS):
            clutch = setting.clutch.with_engine("planar")
            chosen.append(replace(setting, clutch=clutch))
    return tuple(chosen)


@cache
def _bench(name: str | None) -> Bench:
    """Simulate a bench with an effect, each shift with a trace at 2 kHz."""
    bench = load_bench("mq200_adams")
    rng = np.random.default_rng(1)
    readings = []
    for nominal in _settings(bench):
        setting = EFFECTS[name].apply(nominal, TRUTHS[name]) if name else nominal
        plant = PlanarClutch(setting.clutch)
        for turn in np.arange(SHIFTS) / SHIFTS + 0.1:
            shift = engage(plant, setting.point, turn * setting.clutch.dog.pitch_angle)
            trace = sample_trace(shift.trace, setting, 5e-4, 0.5, rng)
            sliding, output = (
                speed + SPEED_NOISE * rng.standard_normal(speed.size)
                for speed in (trace.sliding_speed, trace.output_speed)
            )
            trace = replace(trace, sliding_speed=sliding, output_speed=output)
            row = len(readings) + 2
            reading = Reading(row, nominal.point, 1, shift.shift_time, True, trace)
            readings.append(reading)
    return replace(bench, name="touching", cells=gather(readings), relative_angles=None)


def _seen(name: str | None) -> SeenContacts:
    seen = contacts_of(_bench(name))
    assert seen is not None
    return seen


@cache
def _contacts(name: str | None) -> Contacts:
    bench = _bench(name)
    settings = tuple(
        Setting(bench.clutch.with_engine("planar"), cell.point) for cell in bench.cells
    )
    return Contacts(bench, _seen(name), EFFECTS, settings, USUAL)


def _log(name: str | None, h: Hypothesis, values: Array) -> Array:
    return np.asarray(np.logaddexp(*_contacts(name).log_density(h, values)))


def test_the_slope_on_a_face_is_that_of_the_chamfer() -> None:
    faces = _seen("chamfer_angle").faces
    assert faces.slope.size >= 4
    assert faces.slope == pytest.approx(np.tan(np.radians(11.0)), rel=0.12)


def test_the_balance_of_both_sides_gives_the_inertia() -> None:
    balances = _seen("sliding_inertia").balances
    ratio = balances.fall.sum() / balances.rise.sum()
    assert ratio == pytest.approx(2.0 * 0.01 / 0.6048, rel=0.04)


def test_speeds_before_the_touch_differ_by_the_mismatch() -> None:
    speeds = _seen("mismatch_speed").speeds
    nominal = np.array([_bench("mismatch_speed").cells[k].point.mismatch for k in speeds.cell])
    assert speeds.value == pytest.approx(1.2 * nominal, abs=4.0 * SPEED_NOISE)


@pytest.mark.parametrize("name", TRUTHS)
def test_the_marks_prefer_the_effect_that_acts(name: str) -> None:
    truth = np.array([list(TRUTHS[name].values())])
    (best,) = _log(name, (name,), truth)
    (none,) = _log(name, NONE, np.zeros((1, 0)))
    assert best > none + 4.0
    for rival in sorted({*TRUTHS} - {name}):
        shares = np.random.default_rng(2).random((200, len(EFFECTS[rival].parameters)))
        columns = zip(EFFECTS[rival].parameters, shares.T, strict=True)
        values = np.array([parameter.at(column) for parameter, column in columns]).T
        assert best > _log(name, (rival,), values).max() + 2.0


def test_no_effect_needs_none_and_nothing_unknown() -> None:
    contacts = _contacts(None)
    (none,) = _log(None, NONE, np.zeros((1, 0)))
    assert contacts.log_unknown() < none


def test_quantities_of_a_table_are_those_of_the_setting() -> None:
    contacts = _contacts(None)
    h = ("contact_friction", "detent_force", "mismatch_speed", "sleeve_friction")
    values = np.array([[0.2, 0.13, 70.0, 1.3, 2.0, 1.1, 33.0]])
    setting = contacts.settings[0]
    settings = []
    for baseline in contacts.settings:
        setting = baseline
        place = 0
        for name in h:
            parameters = EFFECTS[name].parameters
            row = dict(zip([p.name for p in parameters], values[0, place:].tolist(), strict=False))
            setting = EFFECTS[name].apply(setting, row)
            place += len(parameters)
        settings.append(setting)
    expected = contacts._split(contacts._row(settings)[None])
    for quantity, exact in zip(contacts._quantities(h, values), expected, strict=True):
        assert quantity == pytest.approx(exact, rel=1e-9, abs=1e-12)


def test_a_standing_recorder_of_speeds_has_no_marks() -> None:
    bench = _bench(None)
    cells = []
    for cell in bench.cells:
        readings = []
        for reading in cell.readings:
            trace = reading.trace
            assert trace is not None
            still = replace(trace, sliding_speed=0.0 * trace.time, output_speed=0.0 * trace.time)
            readings.append(replace(reading, trace=still))
        cells.append(replace(cell, readings=tuple(readings)))
    assert contacts_of(replace(bench, cells=tuple(cells))) is None


def test_means_have_no_marks() -> None:
    assert contacts_of(load_bench("mq200_adams")) is None


def test_students_density_has_the_error_in_common() -> None:
    rng = np.random.default_rng(3)
    residual, common = rng.standard_normal((2, 5, 4))
    variance = rng.random((5, 4)) + 0.1
    for row in range(5):
        covariance = np.diag(variance[row]) + np.outer(common[row], common[row])
        exact = multivariate_t.logpdf(residual[row], shape=covariance, df=5.0)
        log = _log_density(residual, variance, common, 5.0)
        assert log[row] == pytest.approx(exact)


def test_friction_falls_from_the_static_to_the_dynamic_coefficient() -> None:
    slip = np.array([0.01, 0.1, 0.5, 10.0])
    law = {"static": np.array(0.3), "dynamic": np.array(0.16), "stiction_velocity": np.array(0.1)}
    friction = friction_coefficient(slip, **law)
    assert friction[0] == pytest.approx(0.3 * 0.1 / np.hypot(1.0, 0.1), rel=0.01)
    assert friction[2] == pytest.approx(0.3, rel=0.04)
    assert friction[3] == pytest.approx(0.16, rel=0.01)
