"""Single shifts of designs, out of a study's journal: distribution of times, pages to watch."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.designs import design_name
from dogshape.pipeline.reports.look import Row
from dogshape.pipeline.reports.text import minus
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.journal import ShiftJournal
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift.actuation import recorded_profile
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.shift_records import Record, clutch_record, content_key
from dogshape.sim.statistics.uncertainty import FACTORS, Variant
from dogshape.sim.units import DEG, RPM

Array = NDArray[np.float64]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Shifts:
    """Finished shifts of a study by design, those repeated with a finer tolerance left out."""

    study: Setup
    rows: tuple[Record, ...]
    groups: dict[str, list[Record]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        both = self.study.working, self.simulated
        keys = {key for study in both for key in clutch_record(study.clutch)}
        groups: dict[str, list[Record]] = {}
        for row in self.rows:
            if row["outcome"] != Outcome.DIVERGED.value:
                design = content_key({key: row[key] for key in keys & row.keys()})
                groups.setdefault(design, []).append(row)
        object.__setattr__(self, "groups", groups)

    @property
    def simulated(self) -> Setup:
        """The study in the engine of the shifts that are kept: Drake's, where it judges."""
        return self.study.judging or self.study.working

    def of(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts of a design, given in edge units."""
        clutch = self.simulated.clutch.with_dog(self.study.dog_with(design))
        return self.groups.get(content_key(clutch_record(clutch)), [])

    def confirmed(self, design: dict[str, float]) -> list[Record]:
        """Select the shifts at the new angles of the confirmation."""
        seed = self.study.file.expectation.seed + NEW_ANGLES
        return [row for row in self.of(design) if row.get("seed") == seed]


def read_shifts(study: Setup, journal: ShiftJournal) -> Shifts:
    """Group the shifts of a journal."""
    return Shifts(study, tuple(journal.rows.values()))


def time_of(row: Record) -> float:
    """Return the time of a shift, s; infinite where it did not engage."""
    time = row["shift_time_s"]
    return math.inf if time is None else float(time)


def extremes(rows: Iterable[Record]) -> tuple[Record, Record] | None:
    """Select the fastest and the slowest of some shifts; None where there are none.

    A shift that does not engage is slower than any that does, and a blocked one the slowest.
    """

    def order(row: Record) -> tuple[float, bool, str]:
        return time_of(row), row["outcome"] == Outcome.BLOCKED.value, row["key"]

    ordered = sorted(rows, key=order)
    return (ordered[0], ordered[-1]) if ordered else None


def weights_of(study: Setup, rows: Sequence[Record]) -> Array:
    """Return the weight of each shift (n,), of sum one: its operating point's, shared evenly."""
    given = {place(p.mismatch / RPM, p.profile.force): p.weight for p in study.points}
    places = [place(row["mismatch_rpm"], row["force_N"]) for row in rows]
    counts = {one: places.count(one) for one in set(places)}
    weights = np.array([given.get(one, 0.0) / counts[one] for one in places])
    total = float(weights.sum())
    return weights / total if total > 0.0 else weights


def place(mismatch_rpm: float, force_N: float) -> tuple[str, str]:
    """Return an operating point as a key that rounding does not reach."""
    return f"{mismatch_rpm:.9g}", f"{force_N:.9g}"


@dataclass(frozen=True)
class Distribution:
    """Times of single shifts in order (n,), s, infinite where one did not engage.

    ``reached`` (n,) is the share of all shifts done by then; operating points have their weight.
    """

    times: Array
    reached: Array

    @property
    def lost(self) -> int:
        """Number of shifts that did not engage."""
        return int(np.isinf(self.times).sum())

    def quantile(self, share: float) -> float:
        """Return the time within which a share of shifts is done, s; infinite where none is.

        numpy's weighted quantile has no slack for rounding where a share is reached exactly.
        """
        at = int(np.searchsorted(self.reached, share * self.reached[-1] * (1.0 - 1e-12)))
        return float(self.times[min(at, len(self.times) - 1)])


def distribution(shifts: Shifts, design: dict[str, float]) -> Distribution | None:
    """Sort a design's shifts at the new angles by their times; None without any."""
    rows = shifts.confirmed(design)
    if not rows:
        return None
    weights = weights_of(shifts.study.operated(design), rows)
    times = np.array([time_of(row) for row in rows])
    order = np.argsort(times, kind="stable")
    return Distribution(times[order], np.cumsum(weights[order]))


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
        ends = extremes(shifts.of({name: row[name] for name in shifts.study.variables}))
        if ends is not None:
            name = design_name(row)
            found.append((Replay(name, "fastest", ends[0]), Replay(name, "slowest", ends[1])))
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
    peaks = study.torque_peaks(result.clutch, result.trace, result.loads)
    peak = None if peaks is None else peaks.whole
    write_animation(result, path, peak, scripts_beside=True)
