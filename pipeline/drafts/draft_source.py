"""Studies and benches from which a draft begins."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dogshape.bench.bench_data import Bench, bundled_benches, load_bench
from dogshape.pipeline.config.study_file import bundled_studies, find_study, load_study
from dogshape.pipeline.diagnose.study_keys import (
    Data,
    actuation_table,
    clutch_tables,
    operating_table,
    rounded,
)
from dogshape.pipeline.drafts.draft_keys import MASS, SPEED
from dogshape.sim.errors import InputError
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.actuators import COMMAND_RISES
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.units import RPM

COMMENTED = "mq200"  #: bundled study whose file explains the keys


@dataclass(frozen=True)
class Source:
    """A study or a bench from which a draft begins."""

    name: str
    clutch: Clutch
    table: RiseTable  #: rise time of the shift force
    points: tuple[OperatingPoint, ...]
    file: Path  #: study file whose text the draft copies
    bench_values: Data  #: values of a bench by dotted key; empty for a study

    @property
    def is_bench(self) -> bool:
        """Whether the source is a bench."""
        return bool(self.bench_values)

    @property
    def mismatches(self) -> list[float]:
        """Distinct mismatches, 1/min."""
        return sorted({rounded(point.mismatch / RPM) for point in self.points})

    @property
    def forces(self) -> list[float]:
        """Distinct shift forces, N."""
        return sorted({rounded(point.profile.force) for point in self.points})

    @property
    def dog_values(self) -> Data:
        """Values of ``[dog]``, ``[sliding]`` (with the total moving mass) and ``[output]``."""
        moving_mass = self.clutch.rings.mass + self.clutch.mechanism.added_mass
        values: Data = {}
        for name, table in clutch_tables(self.clutch).items():
            values |= {f"{name}.{key}": value for key, value in table.items()}
        return values | {MASS: rounded(moving_mass)}


def source_of(origin: str) -> Source:
    """Load a study or a bench data set: file, folder or bundled name.

    Raises InputError if it is neither, or for a mistake of its files.
    """
    path = Path(origin)
    folder = path.parent if path.name == "bench.toml" else path
    is_bench_folder = (folder / "bench.toml").is_file()
    if is_bench_folder or origin in bundled_benches():
        return _bench_source(load_bench(folder if is_bench_folder else origin))
    if not path.exists() and origin not in bundled_studies():
        raise InputError(
            f"'{origin}' is no kind of clutch, no study and no bench data set; give a TOML file, a "
            f"folder with study.toml or bench.toml, mq200_stand or a kind: {bundled_kinds()}"
        )
    study = load_study(origin)
    return Source(
        study.name,
        study.clutch,
        study.actuation.table,
        points=study.points,
        file=find_study(origin),
        bench_values={},
    )


def _bench_source(bench: Bench) -> Source:
    """Return the source of a draft with the clutch and the operating points of a bench."""
    actuation = actuation_table(bench)
    contact = bench.clutch.contact
    values = {
        **{f"actuation.{key}": column for key, column in actuation.items()},
        "operating": operating_table(bench),
        SPEED: 0.0,
        **{f"drive.{key}": value for key, value in bench.clutch.drive.table.items()},
        "contact.static_friction": contact.static_friction,
        "contact.dynamic_friction": contact.dynamic_friction,
    }
    return Source(
        bench.name,
        bench.clutch,
        COMMAND_RISES if bench.clutch.actuator else RiseTable(*map(tuple, actuation.values())),
        points=tuple(cell.point for cell in bench.cells),
        file=find_study(COMMENTED),
        bench_values=values,
    )


def rings_by_kind() -> dict[str, str]:
    """Describe the bundled kinds of clutch by name: dogs, diameters and rated torque."""
    words = "{count} dogs, {outer_diameter_mm:g}/{inner_diameter_mm:g} mm, {load:g} N m"
    rings = {}
    for name in bundled_studies():
        file = load_study(name).file
        rings[name] = words.format(load=file.load.torque_Nm, **dict(file.dog))
    return rings


def bundled_kinds() -> str:
    """List the bundled kinds of clutch, those with the same ring together."""
    names_by_ring: dict[str, list[str]] = {}
    for name, ring in rings_by_kind().items():
        names_by_ring.setdefault(ring, []).append(name)
    return "; ".join(f"{', '.join(names)} ({ring})" for ring, names in names_by_ring.items())
