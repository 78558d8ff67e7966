"""Pages of single shifts that the report links: the fastest and the slowest of each design."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import minus
from dogshape.pipeline.reports.study.designs import design_name
from dogshape.pipeline.reports.study.single_shifts import Shifts, extremes
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import recorded_profile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.statistics.uncertainty import FACTORS, Variant
from dogshape.sim.units import DEG, RPM

Say = Callable[[str], None]


@dataclass(frozen=True)
class Replay:
    """A shift of the journal with its page; ``path`` is relative to the study's folder."""

    design: str
    kind: str
    shift: Record
    path: str

    @property
    def words(self) -> str:
        """Time, or outcome, and the operating point of the shift."""
        time, row = self.shift["shift_time_s"], self.shift
        result = row["outcome"].replace("_", " ") if time is None else f"{time * 1e3:.1f} ms"
        mismatch = minus(f"{row['mismatch_rpm']:.4g}")
        return f"{result} at {mismatch} 1/min, {row['force_N']:.1f} N"


def replays_of(shifts: Shifts, rows: Sequence[Row]) -> list[tuple[Replay, Replay]]:
    """Select the fastest and the slowest simulated shift of each design that has any."""
    found = []
    for row in rows:
        ends = extremes(shifts.of({name: row[name] for name in shifts.study.variables}))
        if ends is not None:
            name = design_name(row)
            # The key of the shift: a page never shows another one than its link says.
            fast, slow = (
                Replay(name, kind, shift,
                       f"shifts/{name.replace(' ', '-')}-{kind}-{shift['key'][:8]}.html")
                for kind, shift in zip(("fastest", "slowest"), ends, strict=True)
            )  # fmt: skip
            found.append((fast, slow))
    return found


def write_replays(folder: StudyFolder, shifts: Shifts, wanted: Sequence[Replay], say: Say) -> None:
    """Simulate shifts again and write their pages, those that are missing.

    What cannot be simulated or written is said and left out.
    """
    missing = [one for one in wanted if not (folder.root / one.path).is_file()]
    for number, one in enumerate(missing, start=1):
        say(f"animation {number} of {len(missing)}: {one.design}, {one.kind} shift, {one.words}")
        try:
            _write(shifts, one, folder.root / one.path)
        except (DogshapeError, RuntimeError, ValueError, OSError) as error:
            say(f"no page of this shift: {error}")


def drawn_variant(row: Record) -> Variant | None:
    """Read the factors that an uncertain shift was simulated with; None where all is certain."""
    if "friction_factor" not in row:
        return None
    friction, force, inertia, dissipation = (row.get(name, 1.0) for name in FACTORS)
    return Variant(friction, force, inertia, row["drawn_force_rise_s"], (), dissipation)


def _write(shifts: Shifts, one: Replay, path: Path) -> None:
    # Only a folder that lacks pages waits for the simulation to be loaded.
    from dogshape.pipeline.reports.shift.animation import write_animation  # noqa: PLC0415
    from dogshape.sim.engines import engage  # noqa: PLC0415

    study, row = shifts.simulated, one.shift
    design = {name: row[name] for name in study.shape_keys}
    clutch = study.clutch.with_dog(study.dog_with(design))
    point = OperatingPoint(row["mismatch_rpm"] * RPM, recorded_profile(row))
    variant = drawn_variant(row)
    if variant is not None:
        clutch, point = variant.clutch(clutch), variant.point(point)
    result = engage(clutch, point, row["relative_angle_deg"] * DEG)
    path.parent.mkdir(parents=True, exist_ok=True)
    peaks = study.torque_peaks(result.clutch, result.trace, result.loads)
    peak = None if peaks is None else peaks.whole
    write_animation(result, path, peak, scripts_beside=True)
