r"""Stand of a blind check: content of ``bench.toml``, and the physics that it leaves out.

Nothing here is taken from the simulation or from its effects: a stand is read from the keys of
``bench.toml`` alone, and a *truth* is plain numbers that an engine gives to its own mechanisms.
Neutral values change nothing.
"""

from __future__ import annotations

import csv
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.sim.errors import DataError
from dogshape.sim.units import DEG, MM, RPM

FASTEST = 250.0 * RPM  #: mismatch at which a pump has lost all that it loses
LEAST_FORCE = 1.0  #: N, of any shift


@dataclass(frozen=True)
class Stand:
    """Geometry, masses and contact by the keys of ``bench.toml``, SI units and radians."""

    count: int
    chamfer: float
    traction: float
    braking: float
    height: float
    outer_radius: float
    inner_radius: float
    gap: float
    mass: float
    sliding_inertia: float
    sliding_speed: float
    output_inertia: float
    static_friction: float
    dynamic_friction: float
    stiction_speed: float
    timeout: float
    seated: float  # m before full travel at which a shift counts as done

    @property
    def pitch(self) -> float:
        """Angle from dog to dog, rad."""
        return 2.0 * math.pi / self.count

    @property
    def radius(self) -> float:
        """Mean radius of the dogs, m."""
        return 0.5 * (self.outer_radius + self.inner_radius)


@dataclass(frozen=True)
class Point:
    """One operating point: mismatch in rad/s, force in N, and its rise in s."""

    mismatch: float
    force: float
    rise: float


@dataclass(frozen=True)
class Truth:
    """True properties of the bench that ``bench.toml`` leaves out; SI units.

    Parameters
    ----------
    delay, lag : of the force, s.
    force_factor, force_loss : of the force at the sleeve, the loss in N.
    rise_factor : of the rise time.
    friction, damping, added_mass : of the ring along its shaft, N, N s/m, kg; with a linkage the
        mass is behind it.
    compliance, free_play : between actuator and ring, m/N and m.
    sensor : side of the linkage whose displacement is read, ``actuator`` or ``sleeve``.
    detent, detent_position : peak force in N and where in m.
    spline_friction, drag_torque : coefficient, and N m on the sliding ring.
    inertia_factor : of the sliding side.
    static_friction, dynamic_friction : of the dogs, None as given.
    dissipation, stiffness, stiction : of the contact, s/m and Pa/m, as the published one has them,
        and a factor of the stiction velocity.
    mismatch_offset, gap_offset, chamfer_offset : rad/s, m, rad.
    mismatch_factor : of the nominal mismatch.
    reversed : whether the rings turn past each other the other way round than the table says.
    concentration, centre : of the relative angles; the centre in pitches.
    sticking : mean of an exponential delay of the force, drawn for each shift, s.
    hang, hang_time : share of the shifts whose force starts late, and by how much, s.
    pump : share of the force that is lost at the largest mismatch; it grows with the mismatch.
    ripple, ripple_rate : amplitude of the output speed in rad/s, and 1/s.
    high_dog : height by which one dog stands out, m.
    stage, stage_time : share of the force that comes first, and for how long, s.
    drift : share of the force that is gone at the end of the series.
    """

    delay: float = 0.0
    lag: float = 0.0
    force_factor: float = 1.0
    force_loss: float = 0.0
    rise_factor: float = 1.0
    friction: float = 0.0
    damping: float = 0.0
    added_mass: float = 0.0
    compliance: float = 0.0
    free_play: float = 0.0
    sensor: str = "actuator"
    detent: float = 0.0
    detent_position: float = 0.5e-3
    spline_friction: float = 0.0
    drag_torque: float = 0.0
    inertia_factor: float = 1.0
    static_friction: float | None = None
    dynamic_friction: float | None = None
    dissipation: float = 100.0
    stiffness: float = 5e11
    stiction: float = 1.0
    mismatch_offset: float = 0.0
    mismatch_factor: float = 1.0
    reversed: bool = False
    gap_offset: float = 0.0
    chamfer_offset: float = 0.0
    concentration: float = 0.0
    centre: float = 0.0
    sticking: float = 0.0
    hang: float = 0.0
    hang_time: float = 0.0
    pump: float = 0.0
    ripple: float = 0.0
    ripple_rate: float = 50.0
    high_dog: float = 0.0
    stage: float = 1.0
    stage_time: float = 0.0
    drift: float = 0.0

    @property
    def linkage(self) -> bool:
        """Test that the actuator moves apart from the ring."""
        return self.compliance > 0.0 or self.free_play > 0.0

    @property
    def waiting(self) -> tuple[float, float]:
        """Mean and standard deviation of how long the force waits, s."""
        spread = self.hang_time * math.sqrt(self.hang * (1.0 - self.hang))
        return self.sticking + self.hang * self.hang_time, math.hypot(self.sticking, spread)

    def given(self, point: Point, fade: float = 1.0) -> Point:
        """Compute the mismatch, force and rise that a shift really has at a nominal point.

        ``fade`` is the share of the force that a drift has left.
        """
        sign = math.copysign(1.0, point.mismatch)
        mismatch = self.mismatch_factor * point.mismatch + sign * self.mismatch_offset
        share = fade * (1.0 - self.pump * min(1.0, abs(point.mismatch) / FASTEST))
        force = (self.force_factor * point.force - self.force_loss) * share
        return Point(
            -mismatch if self.reversed else mismatch,
            max(LEAST_FORCE, force),
            self.rise_factor * point.rise,
        )


def read_stand(folder: Path) -> Stand:
    """Read the stand of a data set; a missing key raises DataError."""
    path = folder / "bench.toml"
    try:
        data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
        return _stand(data)
    except KeyError as error:
        raise DataError(f"{path} has no key {error}, which a blind check needs; add it") from error


def _stand(data: dict[str, Any]) -> Stand:
    dog, sliding, contact = data["dog"], data["sliding"], data["contact"]
    travel = dog["height_mm"] + dog["axial_gap_mm"]
    return Stand(
        count=dog["count"],
        chamfer=dog["chamfer_deg"] * DEG,
        traction=dog["traction_deg"] * DEG,
        braking=dog["braking_deg"] * DEG,
        height=dog["height_mm"] * MM,
        outer_radius=0.5 * dog["outer_diameter_mm"] * MM,
        inner_radius=0.5 * dog["inner_diameter_mm"] * MM,
        gap=dog["axial_gap_mm"] * MM,
        mass=sliding["mass_kg"],
        sliding_inertia=sliding["inertia_kgm2"],
        sliding_speed=sliding.get("initial_speed_rpm", 0.0) * RPM,
        output_inertia=data["output"]["inertia_kgm2"],
        static_friction=contact["static_friction"],
        dynamic_friction=contact["dynamic_friction"],
        stiction_speed=contact["stiction_velocity_m_s"],
        timeout=data["timeout_s"],
        seated=(travel - data["shift_travel_mm"]) * MM,
    )


def read_points(folder: Path) -> tuple[Point, ...]:
    """Return the operating points of a data set's table, each once, in its order."""
    with (folder / "shifts.csv").open(encoding="utf-8", newline="") as file:
        rows = [
            Point(
                float(row["mismatch_rpm"]) * RPM, float(row["force_N"]), float(row["force_rise_s"])
            )
            for row in csv.DictReader(file)
        ]
    return tuple(dict.fromkeys(rows))
