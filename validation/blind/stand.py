r"""Stand of a blind check: content of ``bench.toml``, and the physics missing there.

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
from dogshape.sim.units import MM, RPM, to_si

MIN_FORCE_N = 1.0  #: of any shift


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
    rebound: float = 1e-3  # m behind its start at which the sliding ring meets a stop

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
    """True properties of the bench beyond ``bench.toml``; SI units."""

    delay: float = 0.0  #: of the force, s
    lag: float = 0.0  #: of first order of the force, s
    force_factor: float = 1.0  #: of the force at the sleeve
    force_loss: float = 0.0  #: N, after the factor
    rise_factor: float = 1.0  #: of the rise time
    friction: float = 0.0  #: of the ring along its shaft, N
    damping: float = 0.0  #: of the ring along its shaft, N s/m
    added_mass: float = 0.0  #: kg, on the ring or behind its linkage
    compliance: float = 0.0  #: between actuator and ring, m/N
    free_play: float = 0.0  #: between actuator and ring, m
    sensor: str = "actuator"  #: side of the linkage that is read, or ``sleeve``
    detent: float = 0.0  #: peak force, N
    detent_position: float = 0.5e-3  #: m
    spline_friction: float = 0.0  #: coefficient
    drag_torque: float = 0.0  #: on the sliding ring, N m
    inertia_factor: float = 1.0  #: of the sliding side
    static_friction: float | None = None  #: of the dogs, None as given
    dynamic_friction: float | None = None
    dissipation: float = 100.0  #: of the contact, s/m
    stiffness: float = 5e11  #: of the contact, Pa/m
    stiction: float = 1.0  #: factor of the stiction velocity
    mismatch_offset: float = 0.0  #: rad/s
    mismatch_factor: float = 1.0  #: of the nominal mismatch
    reversed: bool = False  #: rings pass each other the other way round than the table says
    gap_offset: float = 0.0  #: m
    chamfer_offset: float = 0.0  #: rad
    concentration: float = 0.0  #: of the relative angles
    centre: float = 0.0  #: of the relative angles, pitches
    sticking: float = 0.0  #: mean of an exponential delay of each shift, s
    hang: float = 0.0  #: share of the shifts whose force starts late
    hang_time: float = 0.0  #: delay of these shifts, s
    ripple: float = 0.0  #: amplitude of the output speed, rad/s
    ripple_rate: float = 50.0  #: 1/s
    high_dog: float = 0.0  #: height by which one dog stands out, m
    stage: float = 1.0  #: share of the force that comes first
    stage_time: float = 0.0  #: duration of the first share, s
    drift: float = 0.0  #: share of the force that is gone at the end of the series
    clock_drift: float = 0.0  #: by which the clock is slow at the end of the series, s
    galling: float = 0.0  #: rise of the dogs' friction at the end of the series, as a share
    static_excess: float = (
        0.0  #: friction of the ring along its shaft at rest beyond that in motion, N
    )

    @property
    def linkage(self) -> bool:
        """Whether the actuator moves relative to the ring."""
        return self.compliance > 0.0 or self.free_play > 0.0

    @property
    def delay_moments(self) -> tuple[float, float]:
        """Mean and standard deviation of the random delay of the force, s."""
        hang_sd = self.hang_time * math.sqrt(self.hang * (1.0 - self.hang))
        return self.sticking + self.hang * self.hang_time, math.hypot(self.sticking, hang_sd)

    def moves_ring(self, point: Point) -> bool:
        """Check that the force at an operating point exceeds its loss and friction at rest."""
        net_force = self.force_factor * point.force - self.force_loss
        return net_force > MIN_FORCE_N + self.friction + self.static_excess

    def apply(self, point: Point, progress: float = 0.0) -> Point:
        """Compute the actual operating point of a shift at a nominal point.

        ``progress`` is the share of the series that is past.
        """
        sign = math.copysign(1.0, point.mismatch)
        mismatch = self.mismatch_factor * point.mismatch + sign * self.mismatch_offset
        fade = 1.0 - self.drift * progress
        force = (self.force_factor * point.force - self.force_loss) * fade
        return Point(
            mismatch=-mismatch if self.reversed else mismatch,
            force=max(MIN_FORCE_N, force),
            rise=self.rise_factor * point.rise,
        )


#: Sections and keys of ``bench.toml`` by field of a stand.
_KEYS = {
    "chamfer": "dog.chamfer_deg",
    "traction": "dog.traction_deg",
    "braking": "dog.braking_deg",
    "height": "dog.height_mm",
    "gap": "dog.axial_gap_mm",
    "outer_radius": "dog.outer_diameter_mm",
    "inner_radius": "dog.inner_diameter_mm",
    "mass": "sliding.mass_kg",
    "sliding_inertia": "sliding.inertia_kgm2",
    "output_inertia": "output.inertia_kgm2",
    "static_friction": "contact.static_friction",
    "dynamic_friction": "contact.dynamic_friction",
    "stiction_speed": "contact.stiction_velocity_m_s",
}


def read_stand(folder: Path) -> Stand:
    """Read the stand of a data set; a missing key raises DataError."""
    path = folder / "bench.toml"
    data: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    drive = data.get("drive", {})
    try:
        values = {}
        for name, key in _KEYS.items():
            section, _, short_key = key.partition(".")
            factor = 0.5 if "radius" in name else 1.0
            values[name] = to_si(key, data[section][short_key]) * factor
        if drive.get("shaft_speed_rpm", 0.0) != 0.0 or len(drive) > 1:
            raise DataError(f"{path} has a [drive], but a blind check knows a ring that stands")
        travel = data["dog"]["height_mm"] + data["dog"]["axial_gap_mm"]
        return Stand(
            count=data["dog"]["count"],
            **values,
            timeout=data["timeout_s"],
            seated=(travel - data["shift_travel_mm"]) * MM,
            sliding_speed=0.0,
        )
    except KeyError as error:
        raise DataError(f"{path} has no key {error}, which a blind check needs; add it") from error


def read_points(folder: Path) -> tuple[Point, ...]:
    """Read the distinct operating points of a data set's table, in its order."""
    points = []
    with (folder / "shifts.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            point = Point(
                mismatch=float(row["mismatch_rpm"]) * RPM,
                force=float(row["force_N"]),
                rise=float(row["force_rise_s"]),
            )
            points.append(point)
    return tuple(dict.fromkeys(points))
