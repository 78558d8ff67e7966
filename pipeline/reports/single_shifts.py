"""Pages of the fastest and slowest single shifts of designs, out of a study's journal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.reports.designs import Row, design_name
from dogshape.pipeline.reports.text import place_name, time_text
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import recorded_profile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.shift_records import DEFAULTS, Record, clutch_record
from dogshape.sim.statistics.uncertainty import FACTORS, Variant
from dogshape.sim.units import DEG, RPM


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
        time = self.shift["shift_time_s"]
        result = self.shift["outcome"].replace("_", " ") if time is None else time_text(time)
        return f"{result} at {place_name(self.shift)}"


def replays_of(folder: StudyFolder, study: Setup, rows: Sequence[Row]) -> list[Replay]:
    """Select the fastest and the slowest stored shift of each design that has any.

    What does not engage is slower than any, a blocked shift the slowest. Shifts of finer steps are
    left out.
    """
    stored = ShiftJournal(folder.shifts).rows.values()
    # Those that are kept are of Drake, where it judges.
    clutch, found = (study.reference_setup or study.search_setup).clutch, list[Replay]()

    def lateness(shift: Record) -> tuple[float, bool, str]:
        time = math.inf if shift["shift_time_s"] is None else shift["shift_time_s"]
        return time, shift["outcome"] == Outcome.BLOCKED.value, shift["key"]

    for row in rows:
        dog = study.dog_with({name: row[name] for name in study.variables})
        own = (DEFAULTS | clutch_record(replace(clutch, dog=dog))).items()
        every = [
            shift for shift in stored
            if shift["outcome"] != Outcome.DIVERGED.value
            and all(shift.get(key, DEFAULTS.get(key)) == value for key, value in own)
        ]  # fmt: skip
        if every:
            found.append(Replay(design_name(row), "fastest", min(every, key=lateness)))
            found.append(Replay(design_name(row), "slowest", max(every, key=lateness)))
    return found


def write_replays(folder: StudyFolder, study: Setup, wanted: Sequence[Replay], say: Say) -> None:
    """Simulate shifts again and write their pages, those that are missing.

    What cannot be simulated or written is said and left out.
    """
    missing = [one for one in wanted if not (folder.root / one.path).is_file()]
    for number, one in enumerate(missing, start=1):
        say(f"animation {number} of {len(missing)}: {one.design}, {one.kind} shift, {one.words}")
        try:
            _write(study.reference_setup or study.search_setup, one.shift, folder.root / one.path)
        except (DogshapeError, RuntimeError, ValueError, OSError) as error:
            say(f"no page of this shift: {error}")


def drawn_variant(row: Record) -> Variant:
    """Read the factors that a shift was simulated with; all are one where nothing is uncertain."""
    friction, force, inertia, dissipation = (row.get(name, 1.0) for name in FACTORS)
    rise = row.get("drawn_force_rise_s", recorded_profile(row).rise)
    return Variant(friction, force, inertia, rise, (), dissipation)


def _write(study: Setup, row: Record, path: Path) -> None:
    # Only a folder that lacks pages waits for the simulation to be loaded.
    from dogshape.pipeline.reports.shift_page import write_animation  # noqa: PLC0415
    from dogshape.sim.statistics.blocks import engage  # noqa: PLC0415

    variant, shape = drawn_variant(row), DEFAULTS | row
    dog = study.dog_with({key: shape[key] for key in study.shape_keys})
    point = variant.point(OperatingPoint(row["mismatch_rpm"] * RPM, recorded_profile(row)))
    clutch, angle = variant.clutch(replace(study.clutch, dog=dog)), row["relative_angle_deg"] * DEG
    result = engage(clutch, point, angle)
    path.parent.mkdir(parents=True, exist_ok=True)
    torque_peak = study.torque_peak(result)
    write_animation(result, path, torque_peak, shared=True, limits=study.limits)
