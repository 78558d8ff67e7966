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
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.diagnose.study_keys import OWN_CONTACT, clutch_tables, rounded
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.mechanism import NOTHING
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root

Values = dict[str, Any]  #: values by dotted key
PUBLISHED = "mq200_stand"  #: the published clutch as its stand knows it


@dataclass(frozen=True)
class Source:
    """A clutch with its contact and operating points, and the rise of its force, from ``name``.

    ``rises`` are pairs of force in N and rise time in s.
    """

    name: str
    clutch: Clutch
    rises: tuple[tuple[float, float], ...]
    points: tuple[OperatingPoint, ...]

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
        forces, times = zip(*sorted(dict(self.rises).items()), strict=True)
        return float(np.interp(force, forces, times))

    @property
    def dog_values(self) -> Values:
        """Values of ``[dog]``, ``[sliding]`` and ``[output]`` by dotted key.

        The mass of the ring has what moves along with it.
        """
        tables = clutch_tables(self.clutch)
        mass = self.clutch.rings.mass + self.clutch.mechanism.added_mass
        tables["sliding"]["mass_kg"] = rounded(mass)
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
        mechanism, of = self.clutch.mechanism, f"of the [mechanism] of '{self.name}'"
        mass = mechanism.added_mass
        notes = [f"{mass:g} kg {of} move with the ring"] if mass else []
        if replace(mechanism, added_mass=0.0) != NOTHING:
            notes.append(f"{of} friction, drag and linkage are left for the diagnosis to find, and "
                         "shafts that give way are left out")  # fmt: skip
        return notes


def source_of(where: str) -> Source:
    """Read a study (file, folder, bundled name) or a bench data set (folder, bundled name).

    Raises InputError where it is neither, or a mistake of its files.
    """
    path = Path(where)
    folder = path.parent if path.name == "bench.toml" else path
    here = (folder / "bench.toml").is_file()
    if here or (path.name == where and (bundled_root() / "bench" / where).is_dir()):
        bench = load_bench(folder if here else where)
        points = tuple(cell.point for cell in bench.cells)
        rises = tuple((p.profile.force, p.profile.rise) for p in points)
        return Source(bench.name, bench.clutch, rises, points)
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
    return Source(study.name, study.clutch, rises, study.points)


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
