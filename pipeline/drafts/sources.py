"""Sources that a draft takes over, and folders that it is written into, whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.pipeline.config.study_file import bundled_studies, find_study, load_study
from dogshape.pipeline.diagnose.study_keys import OWN_CONTACT, clutch_tables, rounded, study_of
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root

Values = dict[str, Any]  #: values by dotted key
PUBLISHED = "mq200_stand"  #: the published clutch as its stand knows it
COMMENTED = "mq200"  #: the bundled study whose file explains its keys


@dataclass(frozen=True)
class Source:
    """A study or a bench that a draft begins from: clutch, rise of the force, operating points.

    A draft of a study is the text of ``file`` with the values of ``taken`` by dotted key.
    """

    name: str
    clutch: Clutch
    table: RiseTable
    points: tuple[OperatingPoint, ...]
    file: Path
    taken: Values

    @property
    def mismatches(self) -> list[float]:
        """Mismatches in 1/min, each once."""
        return sorted({rounded(point.mismatch / RPM) for point in self.points})

    @property
    def forces(self) -> list[float]:
        """Shift forces in N, each once."""
        return sorted({rounded(point.profile.force) for point in self.points})

    def rise(self, force: float) -> float:
        """Give the rise time in s of a force in N, linear in between and constant beyond."""
        pairs = sorted(zip(self.table.forces, self.table.rises, strict=True))
        forces, rises = zip(*pairs, strict=True)
        return float(np.interp(force, forces, rises))

    @property
    def dog_values(self) -> Values:
        """Values of ``[dog]``, ``[sliding]`` (with all that moves along) and ``[output]``."""
        tables, rings = clutch_tables(self.clutch), self.clutch.rings
        tables["sliding"]["mass_kg"] = rounded(rings.mass + self.clutch.mechanism.added_mass)
        return {f"{name}.{key}": v for name, table in tables.items() for key, v in table.items()}

    @property
    def bench_values(self) -> Values:
        """Values of ``bench.toml`` by dotted key."""
        contact = self.clutch.contact
        return {
            "timeout_s": self.clutch.timeout,
            "shift_travel_mm": rounded(self.clutch.shift_travel / MM),
            **self.dog_values,
            "sliding.initial_speed_rpm": rounded(self.clutch.rings.initial_speed / RPM),
            **{f"contact.{key}": getattr(contact, name) for name, key in OWN_CONTACT.items()},
        }

    @property
    def mechanism_notes(self) -> list[str]:
        """Describe what a bench takes of the mechanism, and what it has no key for."""
        mass, of = self.clutch.mechanism.added_mass, f"of the [mechanism] of '{self.name}'"
        notes = [f"{mass:g} kg {of} move with the ring"] if mass else []
        if replace(self.clutch.mechanism, added_mass=0.0) != NOTHING:
            notes.append(f"{of} friction, drag and linkage are left for the diagnosis")
        return notes


def source_of(where: str) -> Source:
    """Read a study or a bench data set: file, folder or bundled name.

    Raises InputError where it is neither, or a mistake of its files.
    """
    path = Path(where)
    folder = path.parent if path.name == "bench.toml" else path
    here = (folder / "bench.toml").is_file()
    if here or (path.name == where and (bundled_root() / "bench" / where).is_dir()):
        bench = load_bench(folder if here else where)
        tables, contact = study_of(bench, bench.name), bench.clutch.contact
        points = tuple(cell.point for cell in bench.cells)
        rises = RiseTable(*map(tuple, tables["actuation"].values()))
        taken = {
            **{f"actuation.{key}": values for key, values in tables["actuation"].items()},
            "operating": tables["operating"],
            "contact.static_friction": contact.static_friction,
            "contact.dynamic_friction": contact.dynamic_friction,
        }
        return Source(bench.name, bench.clutch, rises, points, find_study(COMMENTED), taken)
    if not path.exists() and where not in bundled_studies():
        raise InputError(
            f"'{where}' is no kind of clutch, no study and no bench data set; give a TOML file, a "
            f"folder with study.toml or bench.toml, mq200_stand or a kind: {bundled_kinds()}"
        )
    own = load_study(where)
    return Source(own.name, own.clutch, own.actuation.table, own.points, find_study(where), {})


def bundled_kinds() -> str:
    """List the bundled kinds of clutch with dogs, diameters and rated torque."""
    words = "{} ({count} dogs, {outer_diameter_mm:g}/{inner_diameter_mm:g} mm, {load:g} N m)"
    files = {name: load_study(name).file for name in bundled_studies()}
    return ", ".join(
        words.format(name, load=file.load.torque_Nm, **dict(file.dog))
        for name, file in files.items()
    )


def require_free(folder: Path, force: bool) -> None:
    """Raise StorageError where a folder holds files and nobody said to write over them."""
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"--out is {folder}, which is a file; name a folder")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise StorageError(
            f"{folder} holds files already; name another folder with --out, or write over files "
            "of the same name with --force"
        )


@contextmanager
def draft_folder(folder: Path, force: bool) -> Iterator[Path]:
    """Give a folder to fill, whose files go into ``folder`` once all of them are there."""
    require_free(folder, force)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as part:
        # A temporary folder is its owner's alone, and modes are copied along.
        place = Path(part) / "draft"
        place.mkdir()
        yield place
        shutil.copytree(place, folder, dirs_exist_ok=True)
