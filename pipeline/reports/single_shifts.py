"""Pages of the fastest and slowest single shifts of designs, out of a study's journal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.charts import Row
from dogshape.pipeline.reports.designs import design_name
from dogshape.pipeline.reports.text import minus
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import recorded_profile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.shift_records import Record, clutch_record
from dogshape.sim.statistics.uncertainty import FACTORS, Variant
from dogshape.sim.units import DEG, RPM

Say = Callable[[str], None]


@dataclass(frozen=True)
class Shifts:
    """Finished shifts of a study."""

    study: Setup
    rows: tuple[Record, ...]

    @property
    def simulated(self) -> Setup:
        """The study in the engine of the shifts that are kept: Drake's, where it judges."""
        return self.study.judging or self.study.working

    def of(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts of a design, given in edge units, without those of finer steps."""
        own = clutch_record(self.simulated.clutch.with_dog(self.study.dog_with(design)))
        return [
            row for row in self.rows
            if row["outcome"] != Outcome.DIVERGED.value
            and all(row.get(key) == value for key, value in own.items())
        ]  # fmt: skip


def read_shifts(folder: StudyFolder, study: Setup) -> Shifts:
    """Read the shifts of a folder."""
    return Shifts(study, tuple(ShiftJournal(folder.shifts, only_read=True).rows.values()))


def _lateness(row: Record) -> tuple[float, bool, str]:
    """Order shifts by time; one that does not engage is later than any, a blocked one the last."""
    time = math.inf if row["shift_time_s"] is None else row["shift_time_s"]
    return time, row["outcome"] == Outcome.BLOCKED.value, row["key"]


@dataclass(frozen=True)
class Replay:
    """A shift of the journal with its page; ``path`` is relative to the study's folder."""

    design: str
    kind: str
    shift: Record

    @property
    def path(self) -> str:
        """File of the page; it has the key of the shift, so that it never shows another one."""
        return f"shifts/{self.design.replace(' ', '-')}-{self.kind}-{self.shift['key'][:8]}.html"

    @property
    def words(self) -> str:
        """Time, or outcome, and the operating point of the shift."""
        time, row = self.shift["shift_time_s"], self.shift
        result = row["outcome"].replace("_", " ") if time is None else f"{time * 1e3:.1f} ms"
        return minus(f"{result} at {row['mismatch_rpm']:.4g} 1/min, {row['force_N']:.1f} N")


def replays_of(shifts: Shifts, rows: Sequence[Row]) -> list[tuple[Replay, Replay]]:
    """Select the fastest and the slowest simulated shift of each design that has any."""
    found = []
    for row in rows:
        name = design_name(row)
        if every := shifts.of({key: row[key] for key in shifts.study.variables}):
            fast, slow = min(every, key=_lateness), max(every, key=_lateness)
            found.append((Replay(name, "fastest", fast), Replay(name, "slowest", slow)))
    return found


def write_replays(folder: StudyFolder, shifts: Shifts, wanted: Sequence[Replay], say: Say) -> None:
    """Simulate shifts again and write their pages, those that are missing.

    What cannot be simulated or written is said and left out.
    """
    missing = [one for one in wanted if not (folder.root / one.path).is_file()]
    for number, one in enumerate(missing, start=1):
        say(f"animation {number} of {len(missing)}: {one.design}, {one.kind} shift, {one.words}")
        try:
            _write(shifts, one.shift, folder.root / one.path)
        except (DogshapeError, RuntimeError, ValueError, OSError) as error:
            say(f"no page of this shift: {error}")


def drawn_variant(row: Record) -> Variant | None:
    """Read the factors that an uncertain shift was simulated with; None where all is certain."""
    if "friction_factor" not in row:
        return None
    friction, force, inertia, dissipation = (row.get(name, 1.0) for name in FACTORS)
    return Variant(friction, force, inertia, row["drawn_force_rise_s"], (), dissipation)


def _write(shifts: Shifts, row: Record, path: Path) -> None:
    # Only a folder that lacks pages waits for the simulation to be loaded.
    from dogshape.pipeline.reports.shift_page import write_animation  # noqa: PLC0415
    from dogshape.sim.engines import engage  # noqa: PLC0415

    study = shifts.simulated
    clutch = study.clutch.with_dog(study.dog_with({name: row[name] for name in study.shape_keys}))
    point = OperatingPoint(row["mismatch_rpm"] * RPM, recorded_profile(row))
    variant = drawn_variant(row)
    if variant is not None:
        clutch, point = variant.clutch(clutch), variant.point(point)
    result = engage(clutch, point, row["relative_angle_deg"] * DEG)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_animation(result, path, study.torque_peak(result), scripts_beside=True)
