"""Sources that a draft takes over: clutch, contact and rise of a study or of a bench."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.pipeline.config.study_file import load_study
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.units import DEG, MM, RPM
from dogshape.sim.versions import bundled_root

#: Parts of a mechanism that no effect looks for.
SHAFTS = ("ring_inertia", "input_stiffness", "backlash", "wheel_inertia", "output_stiffness")
PUBLISHED = "mq200_stand"  #: the published clutch as its stand knows it


@dataclass(frozen=True)
class Source:
    """A clutch with its contact and the rise of its force, taken from ``name``.

    ``rises`` are pairs of force in N and rise time in s; ``operating`` mismatches in 1/min and
    forces in N; ``calibration`` lines of ``bench.toml`` that only a bench has.
    """

    name: str
    clutch: Clutch
    rises: tuple[tuple[float, float], ...]
    mismatches: tuple[float, ...]
    forces: tuple[float, ...]
    bench: Bench | None = None

    def rise(self, force: float) -> tuple[float, bool]:
        """Give the rise time in s of a force in N, linear in between; and whether it lies within.

        Beyond the ends it is that of the nearest force.
        """
        table = sorted(dict(self.rises).items())
        forces, times = zip(*table, strict=True)
        within = forces[0] * (1.0 - 1e-3) <= force <= forces[-1] * (1.0 + 1e-3)
        return float(np.interp(force, forces, times)), within

    @property
    def dog_values(self) -> dict[str, Any]:
        """Values of ``[dog]``, ``[sliding]`` and ``[output]`` by dotted key.

        The mass of the ring has what moves along with it.
        """
        dog, rings = self.clutch.dog, self.clutch.rings
        lengths = ("height", "outer_diameter", "inner_diameter", "axial_gap")
        angles = ("chamfer", "traction", "braking")
        return {
            "dog.count": dog.count,
            **{f"dog.{name}_deg": _round(getattr(dog, name) / DEG) for name in angles},
            **{f"dog.{name}_mm": _round(getattr(dog, name) / MM) for name in lengths},
            **({"dog.edge_radius_mm": _round(dog.edge_radius / MM)} if dog.edge_radius else {}),
            "sliding.mass_kg": _round(rings.mass + self.clutch.mechanism.added_mass),
            "sliding.inertia_kgm2": rings.sliding_inertia,
            "output.inertia_kgm2": rings.output_inertia,
        }

    @property
    def bench_values(self) -> dict[str, Any]:
        """Values of ``bench.toml`` by dotted key."""
        contact = self.clutch.contact
        return {
            "timeout_s": self.clutch.timeout,
            "shift_travel_mm": _round(self.clutch.shift_travel / MM),
            **self.dog_values,
            "sliding.initial_speed_rpm": _round(self.clutch.rings.initial_speed / RPM),
            "contact.static_friction": contact.static_friction,
            "contact.dynamic_friction": contact.dynamic_friction,
            "contact.stiction_velocity_m_s": contact.stiction_velocity,
            "contact.stiffness_Pa_m": contact.stiffness,
            "contact.dissipation_s_m": contact.dissipation,
        }

    @property
    def left_out(self) -> str:
        """Describe the parts of a mechanism that a bench has no key for; empty where all is there.

        Parts of a mechanism are what a diagnosis looks for, from none of them on; shafts are none.
        """
        mechanism = self.clutch.mechanism
        shafts = any(getattr(mechanism, name) for name in SHAFTS)
        plain = replace(mechanism, added_mass=0.0, **dict.fromkeys(SHAFTS, 0.0))
        parts = ["friction, drag and linkage are left for the diagnosis to find"]
        parts = parts if plain != NOTHING else []
        if shafts:
            parts.append("shafts that give way are left out")
        return f"of the [mechanism] of '{self.name}' {' and '.join(parts)}" if parts else ""

    @property
    def moved_along(self) -> str:
        """Describe what the mass of the ring has of the mechanism; empty where that is nothing."""
        mass = self.clutch.mechanism.added_mass
        return f"{mass:g} kg of the [mechanism] of '{self.name}' move with the ring" if mass else ""


def _round(value: float) -> float:
    return float(f"{value:.9g}")


def source_of(where: str) -> Source:
    """Read a study (file, folder, bundled name) or a bench data set (folder, bundled name).

    Raises InputError where it is neither, or a mistake of its files.
    """
    path = Path(where)
    folder = path.parent if path.name == "bench.toml" else path
    bundled = path.name == where and (bundled_root() / "bench" / where).is_dir()
    is_bench = (folder / "bench.toml").is_file() or bundled
    if is_bench:
        bench = load_bench(folder if (folder / "bench.toml").is_file() else where)
        points = [cell.point for cell in bench.cells]
        rises = tuple((p.profile.force, p.profile.rise) for p in points)
        return Source(bench.name, bench.clutch, rises, *_axes(points), bench)
    try:
        study = load_study(where)
    except InputError as error:
        if "there is no study" not in str(error):
            raise
        raise InputError(
            f"--from is '{where}', but there is no study and no bench data set of that name; give "
            "a TOML file, a folder with study.toml or bench.toml, mq200 or mq200_stand"
        ) from error
    table = study.actuation.table
    rises = tuple(zip(table.forces, table.rises, strict=True))
    return Source(study.name, study.clutch, rises, *_axes(study.points))


def _axes(points: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
    mismatches = sorted({_round(p.mismatch / RPM) for p in points})
    return tuple(mismatches), tuple(sorted({_round(p.profile.force) for p in points}))
