"""MuJoCo's own mechanisms against closed forms of the free flight, and the data written of them."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import dog_solid
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.cases import Case
from dogshape.validation.blind.data import write_case
from dogshape.validation.blind.mujoco_model import dog_corners
from dogshape.validation.blind.mujoco_shift import Draw, Engine, Shift, engine_available, signal
from dogshape.validation.blind.stand import Point, Stand, Truth, read_points, read_stand
from dogshape.validation.blind.true_effects import OUTSIDE, RANGES, truth_of, values_of
from tests.conftest import require_program

BASE = bundled_root() / "bench" / "mq200_adams"
FAR = 0.2  #: m of gap: nothing is touched before
POINT = Point(10.0 * RPM, 469.0, 0.1766)


@pytest.fixture(scope="module", autouse=True)
def _mujoco() -> None:
    require_program(engine_available(), "mujoco")


@pytest.fixture(scope="module")
def stand() -> Stand:
    return read_stand(BASE)


def _flight(stand: Stand, point: Point = POINT, **truth: float) -> np.ndarray:
    """Return the motion (n, 6) of the ring over a gap so wide that it flies all the time."""
    free = replace(stand, gap=FAR, timeout=0.061)
    return Engine(free, Truth(**truth)).shift(point, Draw(0.1), keep=True).motion  # type: ignore


def _way(motion: np.ndarray, time: float, column: int = 2) -> float:
    return float(np.interp(time, motion[:, 0], motion[:, column]))


def _free(point: Point, mass: float, time: float) -> float:
    """A cubic step has moved a free mass by F T^2/m (s^4/4 - s^5/10)."""
    s = time / point.rise
    return point.force * point.rise**2 / mass * (s**4 / 4.0 - s**5 / 10.0)


AT = 0.04  #: s


def test_force_mass_and_delay_in_free_flight(stand: Stand) -> None:
    """Within 0.5 %: half a step of 0.1 ms over 40 ms enters by its fourth power."""
    assert _way(_flight(stand), AT) == pytest.approx(_free(POINT, 0.3, AT), rel=5e-3)
    heavy = _free(POINT, 1.3, AT)
    assert _way(_flight(stand, added_mass=1.0), AT) == pytest.approx(heavy, rel=5e-3)
    strong = 1.25 * _free(POINT, 0.3, AT)
    assert _way(_flight(stand, force_factor=1.25), AT) == pytest.approx(strong, rel=5e-3)
    weak = _free(replace(POINT, force=POINT.force - 60.0), 0.3, AT)
    assert _way(_flight(stand, force_loss=60.0), AT) == pytest.approx(weak, rel=5e-3)
    slow = _free(replace(POINT, rise=1.5 * POINT.rise), 0.3, AT)
    assert _way(_flight(stand, rise_factor=1.5), AT) == pytest.approx(slow, rel=5e-3)
    late = _flight(stand, delay=0.02)
    assert _way(late, AT + 0.02) == pytest.approx(_free(POINT, 0.3, AT), rel=5e-3)
    assert _way(late, 0.02) == 0.0


def test_lag_of_first_order(stand: Stand) -> None:
    """The way through a lag is that of y' = (u - y)/tau, integrated finely."""
    lag, step = 0.02, 1e-5
    times = np.arange(0.0, AT, step)
    forces = np.array([signal(Truth(), POINT, t) for t in times])
    y = np.zeros_like(forces)
    for k in range(1, len(times)):
        y[k] = y[k - 1] + (forces[k - 1] - y[k - 1]) * (1.0 - math.exp(-step / lag))
    way = np.cumsum(np.cumsum(y)) * step**2 / 0.3
    assert _way(_flight(stand, lag=lag), AT) == pytest.approx(way[-1], rel=1e-2)


def test_friction_holds_then_takes_a_constant_force(stand: Stand) -> None:
    """From the time at which the force beats it, m x'' = F(t) - R."""
    friction, step = 60.0, 1e-5
    times = np.arange(0.0, 0.06, step)
    net = np.array([signal(Truth(), POINT, t) for t in times]) - friction
    begin = int(np.argmax(net > 0.0))
    way = np.cumsum(np.cumsum(net[begin:])) * step**2 / 0.3
    motion = _flight(stand, friction=friction)
    assert _way(motion, 0.06) == pytest.approx(way[-1], rel=1e-2)
    # Held friction creeps at the rate of the constraint, micrometres before it is beaten.
    assert abs(_way(motion, times[begin])) < 0.01 * MM


def test_viscous_damping(stand: Stand) -> None:
    """m v' = F - c v under the rising force, integrated finely."""
    c, step, v, x = 80.0, 1e-5, 0.0, 0.0
    for k in range(round(AT / step)):
        v += step * (signal(Truth(), POINT, k * step) - c * v) / 0.3
        x += step * v
    assert _way(_flight(stand, damping=c), AT) == pytest.approx(x, rel=1e-2)


def test_sensor_of_a_soft_linkage_leads_by_the_force_over_its_stiffness(stand: Stand) -> None:
    """Both masses keep what they were; the spring carries what the ring's share needs."""
    compliance = 3e-6
    motion = _flight(stand, compliance=compliance)
    lead = _way(motion, AT, 1) - _way(motion, AT)
    ring = 0.85 * signal(Truth(), POINT, AT)
    assert lead == pytest.approx(compliance * ring, rel=0.05)
    centre = 0.85 * _way(motion, AT) + 0.15 * _way(motion, AT, 1)
    assert centre == pytest.approx(_free(POINT, 0.3, AT), rel=5e-3)


def test_mass_behind_a_linkage_swings_against_the_ring(stand: Stand) -> None:
    """Two masses on a spring under a force on one of them: the way of their centre is free."""
    mass, compliance = 2.0, 2e-6
    motion = _flight(stand, compliance=compliance, added_mass=mass)
    near, far = 0.85 * 0.3, 0.15 * 0.3 + mass
    centre = (near * _way(motion, AT) + far * _way(motion, AT, 1)) / (near + far)
    assert centre == pytest.approx(_free(POINT, near + far, AT), rel=5e-3)
    # The spring carries the force on the light side, near / (near + far) of the whole.
    lead = compliance * near / (near + far) * signal(Truth(), POINT, AT)
    assert _way(motion, AT, 1) - _way(motion, AT) == pytest.approx(lead, rel=0.1)
    at_sleeve = _flight(stand, compliance=compliance, added_mass=mass, sensor="sleeve")
    assert _way(at_sleeve, AT, 1) == _way(motion, AT)


def test_drag_slows_a_heavier_sliding_side_less(stand: Stand) -> None:
    """A free ring that turns loses T t / (f J) of its speed."""
    turning = replace(stand, gap=FAR, timeout=0.061, sliding_speed=20.0)
    for factor in (1.0, 4.0):
        truth = Truth(drag_torque=1.0, inertia_factor=factor)
        motion = Engine(turning, truth).shift(POINT, Draw(0.1), keep=True).motion
        assert motion is not None
        lost = 20.0 - np.interp(AT, motion[:, 0], motion[:, 3])
        assert lost == pytest.approx(AT / (factor * stand.sliding_inertia), rel=0.02)


def test_play_is_closed_before_the_ring_moves(stand: Stand) -> None:
    """The actuator's side flies alone by the play; afterwards it is ahead by that play."""
    play = 0.5 * MM
    motion = _flight(stand, free_play=play)
    begin = (4.0 * play * 0.3 * 0.15 * POINT.rise**2 / POINT.force) ** 0.25
    assert abs(_way(motion, 0.9 * begin)) < 1e-7
    assert _way(motion, 1.3 * begin) > 0.01 * MM
    assert _way(motion, AT, 1) - _way(motion, AT) == pytest.approx(play, rel=0.05)


def test_detent_takes_the_work_of_its_hump(stand: Stand) -> None:
    """The energy over the way is the force's work less D w/2 (mean of the cosine's square)."""
    peak, width = 20.0, 1.0 * MM
    motion = _flight(stand, detent=peak, detent_position=1.0 * MM)
    inside = motion[motion[:, 2] < 4.0 * MM]
    way, speed = inside[:, 2], np.gradient(inside[:, 2], inside[:, 0])
    force = np.array([signal(Truth(), POINT, t) for t in inside[:, 0]])
    work = float(np.sum(0.5 * (force[1:-1] + force[:-2]) * np.diff(way[:-1])))
    assert work - 0.5 * 0.3 * speed[-2] ** 2 == pytest.approx(0.5 * peak * width, rel=0.05)


def test_dog_is_that_of_the_project(stand: Stand) -> None:
    """Two derivations of the eight corners agree to a nanometre."""
    dog = Dog(15, stand.chamfer, stand.traction, stand.braking, 3.7e-3, 52e-3, 44e-3, 1e-3)
    mine, theirs = dog_corners(stand, stand.chamfer), dog_solid(dog).vertices
    apart = np.linalg.norm(mine[:, None] - theirs[None], axis=2).min(axis=1)
    assert apart.max() < 1e-9


def test_every_truth_makes_a_shift(stand: Stand) -> None:
    """Each truth ends as a time or not engaged, never as a number that is none."""
    fast = Point(249.0 * RPM, 641.5, 0.12614)  # the one that costs least
    generator = np.random.default_rng(2)
    truths = [truth_of({name: values_of(name, 0.9, generator)}, {}) for name in RANGES]
    for truth in [*truths, *(truth_of({}, {name: 0.9}) for name in OUTSIDE)]:
        time = Engine(stand, truth).shift(fast, Draw(0.2)).time
        assert time is None or 0.015 < time <= 1.0, truth


def test_what_changes_over_a_series_is_absent_at_its_start(stand: Stand) -> None:
    point = Point(50.0 * RPM, 641.5, 0.12614)
    base = Engine(stand, Truth()).shift(point, Draw(0.2)).time
    assert base is not None
    clock = Engine(stand, truth_of({}, {"clock_drift": 1.0}))
    galling = Engine(stand, truth_of({}, {"galling": 1.0}))
    assert clock.shift(point, Draw(0.2)).time == galling.shift(point, Draw(0.2)).time == base
    assert clock.shift(point, Draw(0.2, progress=0.5)).time == pytest.approx(base + 0.06)
    threefold = replace(stand, static_friction=0.9, dynamic_friction=0.48)
    time = Engine(threefold, Truth()).shift(point, Draw(0.2)).time
    assert galling.shift(point, Draw(0.2, progress=1.0)).time == pytest.approx(time) != base


@pytest.mark.parametrize(
    ("name", "places"),
    [("swapped_forces", [4, 3, 2, 1, 8, 7, 6, 5]), ("swapped_speeds", [5, 6, 7, 8, 1, 2, 3, 4])],
)
def test_swapped_columns_have_the_times_of_other_points(
    name: str, places: list[int], tmp_path: Path
) -> None:
    points = read_points(BASE)[:8]
    case = Case(
        "outside", "means", "mujoco", "prototype", 1, force_error=0.02, speed_error=0.01,
        places=tuple(range(8)), numbers=(1,) * 8, outside={name: 1.0},
    )  # fmt: skip
    write_case(tmp_path / "c", BASE, case, points, [[Shift(0.1 * (k + 1))] for k in range(8)])
    with (tmp_path / "c" / "shifts.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["force_rise_s"]) for row in rows] == [point.rise for point in points]
    assert [round(10.0 * float(row["shift_time_s"])) for row in rows] == places
