"""Pages of the fastest and slowest single shifts of designs in a study's journal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.progress import Say
from dogshape.pipeline.reports.designs import design_name
from dogshape.pipeline.reports.text import place_name, time_text
from dogshape.pipeline.search.study_record import DesignRow
from dogshape.pipeline.store.folder import ShiftJournal, StudyFolder
from dogshape.pipeline.store.result_records import PlaceRow
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import recorded_profile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.shift_records import (
    DEFAULTS,
    Record,
    angle_of,
    clutch_record,
    diverged,
    key_of,
    quantity_of,
    result_of,
)
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
        """File of the page, with the key of the shift: another shift gets another page."""
        return f"shifts/{self.design.replace(' ', '-')}-{self.kind}-{key_of(self.shift)[:8]}.html"

    @property
    def words(self) -> str:
        """Time, or outcome without one, and the operating point of the shift."""
        result = result_of(self.shift)
        words = result.outcome.value.replace("_", " ")
        if result.shift_time is not None:
            words = time_text(result.shift_time)
        point = PlaceRow(mismatch_rpm=self.shift["mismatch_rpm"], force_N=self.shift["force_N"])
        return f"{words} at {place_name(point)}"


def replays_of(folder: StudyFolder, study: Setup, designs: Sequence[DesignRow]) -> list[Replay]:
    """Select the fastest and the slowest stored shift of each of some designs.

    A shift that does not engage is slower than any that does, a blocked shift the slowest. Shifts
    of the numerical error (finer steps) are left out.
    """
    stored = [shift for shift in ShiftJournal(folder.shifts).rows.values() if not diverged(shift)]
    # The journal has the shifts of Drake where Drake judges.
    setup = study.reference_setup or study.search_setup
    replays = []
    for design in designs:
        clutch = setup.clutch_with(design.params(study.variables))
        inputs = DEFAULTS | clutch_record(clutch)
        shifts = [shift for shift in stored if _has_inputs(shift, inputs)]
        if shifts:
            name = design_name(design)
            replays.append(Replay(name, "fastest", min(shifts, key=_slowness)))
            replays.append(Replay(name, "slowest", max(shifts, key=_slowness)))
    return replays


def _has_inputs(shift: Record, inputs: Record) -> bool:
    """Check whether a shift was simulated with inputs; absent keys have their defaults."""
    return all(shift.get(key, DEFAULTS.get(key)) == value for key, value in inputs.items())


def _slowness(shift: Record) -> tuple[float, bool, str]:
    """Return the key that sorts shifts from the fastest to a blocked one."""
    result = result_of(shift)
    time = math.inf if result.shift_time is None else result.shift_time
    return time, result.outcome is Outcome.BLOCKED, key_of(shift)


def write_replays(folder: StudyFolder, study: Setup, replays: Sequence[Replay], say: Say) -> None:
    """Simulate shifts again and write those of their pages that are missing.

    A page that fails is reported through ``say`` and left out.
    """
    missing = [replay for replay in replays if not (folder.root / replay.path).is_file()]
    setup = study.reference_setup or study.search_setup
    for number, replay in enumerate(missing, start=1):
        title = f"{replay.design}, {replay.kind} shift, {replay.words}"
        say(f"animation {number} of {len(missing)}: {title}")
        try:
            _write_page(setup, replay.shift, folder.root / replay.path)
        except (DogshapeError, RuntimeError, ValueError, OSError) as error:
            say(f"no page of this shift: {error}")


def drawn_variant(row: Record) -> Variant:
    """Read the factors of uncertain inputs that a shift was simulated with; 1 without any."""
    friction, force, inertia, dissipation = (row.get(name, 1.0) for name in FACTORS)
    rise = row.get("drawn_force_rise_s", recorded_profile(row).rise)
    return Variant(friction, force, inertia, rise, (), dissipation)


def _write_page(study: Setup, row: Record, path: Path) -> None:
    """Simulate a stored shift of a study again and write its page."""
    # Only a folder that lacks pages waits for the simulation to be loaded.
    from dogshape.pipeline.reports.shift_page import write_animation  # noqa: PLC0415
    from dogshape.sim.statistics.blocks import engage  # noqa: PLC0415

    variant = drawn_variant(row)
    params = {key: quantity_of(row, key) for key in study.shape_keys}
    point = variant.point(OperatingPoint(row["mismatch_rpm"] * RPM, recorded_profile(row)))
    clutch = variant.clutch(study.clutch_with(params))
    result = engage(clutch, point, angle_of(row).relative_angle_deg * DEG)
    path.parent.mkdir(parents=True, exist_ok=True)
    torque_peak = study.torque_peak(result)
    write_animation(result, path, torque_peak, shared=True, limits=study.with_design(params).limits)
