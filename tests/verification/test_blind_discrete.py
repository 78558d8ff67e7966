"""Drake with a discrete solver as an engine of truths, against the continuous engines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import Solver
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.plant import ClutchPlant, DiscreteSteps
from dogshape.validation.blind import planar_shift
from dogshape.validation.blind.drake_discrete_shift import AS_PUBLISHED, DiscreteEngine
from dogshape.validation.blind.mujoco_shift import Draw
from dogshape.validation.blind.planar_shift import PlanarEngine, asked_of, clutch_of
from dogshape.validation.blind.stand import Truth, read_points, read_stand
from dogshape.validation.blind.true_effects import truth_of
from tests.verification.test_blind_planar import EFFECTS

FOLDER = bundled_root() / "blind" / "half"
STAND, POINTS = read_stand(FOLDER), read_points(FOLDER)
SOME = (4, 7, 9)  #: 25, 50 and 100 1/min
ANGLES = (np.arange(4) + 0.5) / 4 * STAND.pitch


def _mean(engine: DiscreteEngine | PlanarEngine, place: int) -> float:
    times = [engine.shift(POINTS[place], Draw(float(angle))).time for angle in ANGLES]
    return float(np.mean([time for time in times if time is not None]))


def test_without_effects_it_is_the_continuous_engine_within_five_percent() -> None:
    """At the same single coefficient of friction; the law differs near no slip."""
    clutch = clutch_of(STAND, Truth(), AS_PUBLISHED)
    contact = replace(clutch.contact, static_friction=0.298, dynamic_friction=0.298)
    clutch = replace(clutch, contact=contact, solver=Solver())
    plain, steps = ClutchPlant(clutch), ClutchPlant(clutch, DiscreteSteps(1e-4))
    for place in SOME:
        asked = asked_of(Truth(), POINTS[place], Draw(0.0))
        times = [
            [engage(plant, asked, float(angle)).shift_time for angle in ANGLES]
            for plant in (plain, steps)
        ]
        first, second = (np.mean([t for t in mine if t is not None]) for mine in times)
        assert second == pytest.approx(first, rel=0.05)


@pytest.mark.parametrize(
    "name", ["sleeve_friction", "linkage_compliance", "free_play", "detent_force", "drag_torque"]
)
def test_stiff_mechanisms_bear_its_steps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within 6 % of the compiled engine with the published contact, as without any effect."""
    monkeypatch.setattr(planar_shift, "LAW", AS_PUBLISHED)
    truth = truth_of({name: EFFECTS[name]}, {})
    for place in SOME:
        compiled = _mean(PlanarEngine(STAND, truth), place)
        assert _mean(DiscreteEngine(STAND, truth), place) == pytest.approx(compiled, rel=0.06)


def test_the_dynamic_coefficient_alone_would_be_another_clutch() -> None:
    """A tenth faster at 10 1/min and three times as slow at 249 1/min: why the slip decides."""
    clutch = clutch_of(STAND, Truth(), AS_PUBLISHED)
    dynamic = clutch.contact.dynamic_friction
    contact = replace(clutch.contact, static_friction=dynamic)
    plant = ClutchPlant(replace(clutch, contact=contact), DiscreteSteps(1e-4))
    for place, low, high in ((2, 0.85, 0.95), (13, 2.0, 4.0)):
        asked = asked_of(Truth(), POINTS[place], Draw(0.0))
        times = [engage(plant, asked, float(angle)).shift_time for angle in ANGLES]
        slow = float(np.mean([time for time in times if time is not None]))
        assert low < slow / _mean(DiscreteEngine(STAND), place) < high


def test_friction_of_the_dogs_goes_by_the_slip() -> None:
    engine = DiscreteEngine(STAND)
    slow, fast = engine._plant(1.0), engine._plant(60.0)
    assert slow.clutch.contact.dynamic_friction == pytest.approx(0.30, abs=2e-3)
    assert fast.clutch.contact.dynamic_friction < 0.20
    assert engine._plant(1.0) is slow


def test_what_it_cannot_make_is_refused() -> None:
    with pytest.raises(InputError, match="no ripple, no high dog"):
        DiscreteEngine(STAND, truth_of({}, {"two_stages": 0.5}))


def test_its_motion_is_its_flight_until_the_ring_touches() -> None:
    """The same mass under the same force as in the compiled engine, within a step of 0.1 ms."""
    point, draw = POINTS[0], Draw(0.1)
    found = [one(STAND).shift(point, draw, keep=True) for one in (DiscreteEngine, PlanarEngine)]
    passed = []
    for shift in found:
        assert shift.motion is not None
        times, _, ring, *_ = shift.motion.T
        flying = ring < STAND.gap
        passed.append(float(np.interp(0.5 * STAND.gap, ring[flying], times[flying])))
    assert passed[0] == pytest.approx(passed[1], abs=3e-4)
