"""Map of a clutch for lumped driveline models: engagement and shift time over what decides them.

Shifts of the clutch as it is, without uncertain quantities, at every mismatch with every force of
the study and at even relative angles, the middles of equal parts of a pitch. A driveline model that
follows the angle reads the cells, another one the means over the angle.

Tables for Modelica are matrices of ``CombiTable2Ds`` (text format ``#1`` of
``ModelicaStandardTables``): mismatch in rad/s down, force in N across. Parameters for the Dog
Clutch block of Simscape Driveline have the names of its reference page (MathWorks, *Dog Clutch*),
those for the Dog Clutch component of MapleSim's Driveline Component Library the identifiers of its
help page (Maplesoft, *Dog Clutch*), whose relative angle repeats after ``gap`` and meets teeth
within ``epsilon`` of its multiples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Record, frame_of
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.pipeline.store.folder import require_targets
from dogshape.sim.clutch_tables import key
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.files import write_frame, write_whole
from dogshape.sim.interface import key_argument
from dogshape.sim.shift.conclusion import Outcome
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.statistics.shift_records import result_of
from dogshape.sim.units import DEG, MM, RPM


class EngagementCell(Record):
    """One shift of a map."""

    mismatch_rpm: float = key("mismatch speed", "1/min")
    force_N: float = key("final shift force", "N")
    angle_deg: float = key("relative angle at the start of the force", "deg")
    engaged: bool = key("whether the shift engages")
    outcome: str = key("engaged, blocked, timed_out or diverged")
    shift_time_s: float | None = key("shift time of an engaged shift, with dead time", "s")


class MapPoint(Record):
    """Shifts at one mismatch and force, over the relative angle."""

    mismatch_rpm: float = key("mismatch speed", "1/min")
    force_N: float = key("final shift force", "N")
    engagement_probability: float = key("share of engaged shifts")
    engagement_probability_standard_error: float | None = key(
        "its standard error, of a share of independent shifts with the prior of Jeffreys"
    )
    mean_time_s: float | None = key("mean shift time of engaged shifts", "s")
    mean_time_standard_error_s: float | None = key(
        "its standard error over the relative angle; null of fewer than three shifts", "s"
    )
    shifts: int = key("number of shifts, without diverged ones")


class BlockParameter(Record):
    """A parameter of the dog clutch of a library."""

    parameter: str = key("name on the block")
    value: float = key("value of the clutch")
    unit: str = key("unit of the value")
    source: str = key("origin of the value")


@dataclass(frozen=True)
class EngagementMap:
    """Simulated map of a study."""

    study: Setup
    cells: tuple[EngagementCell, ...]  #: by mismatch, force and angle, each growing

    @cached_property
    def points(self) -> tuple[MapPoint, ...]:
        """Probability and mean time of each mismatch and force."""
        points = []
        for _, group in groupby(self.cells, lambda cell: (cell.mismatch_rpm, cell.force_N)):
            points.append(_mean_of(tuple(group)))
        return tuple(points)

    @cached_property
    def simscape_parameters(self) -> tuple[BlockParameter, ...]:
        """Parameters of Simscape's block with which it engages as the map does."""
        clutch = self.study.clutch
        dog = clutch.dog
        pair = clutch.pair
        share = self.study.file.expectation.first_window_share
        rows = (
            ("Number of teeth", float(dog.count), "1", "dog.count"),
            ("Backlash", pair.backlash_angle / DEG, "deg", "play of the seated pair"),
            ("Tooth height", pair.depth / MM, "mm", "dog.height_mm"),
            ("Ring-hub clearance when disengaged", dog.axial_gap / MM, "mm", "dog.axial_gap_mm"),
            (
                "Tooth overlap to engage",
                (pair.depth - clutch.seated_tolerance) / MM,
                "mm",
                "height less shift.seated_tolerance_mm, where a shift of the map ends",
            ),
            (
                "Engagement speed threshold",
                self.speed_threshold / RPM,
                "rpm",
                f"largest mismatch of the map up to which {share:.0%} of the angles engage at "
                "every force",
            ),
            (
                "Tooth-tooth friction coefficient",
                clutch.contact.dynamic_friction,
                "1",
                "contact.dynamic_friction",
            ),
            (
                "Viscous friction coefficient",
                clutch.mechanism.damping,
                "N/(m/s)",
                "mechanism.damping_Ns_m, of the shift linkage",
            ),
        )
        return tuple(_block_parameter(*row) for row in rows)

    @property
    def maplesim_parameters(self) -> tuple[BlockParameter, ...]:
        """Parameters of MapleSim's component: its teeth meet where those of the clutch do."""
        dog = self.study.clutch.dog
        window = dog.entry_play / dog.mean_radius
        if dog.lean < 0.0:
            window = dog.passing_play / dog.inner_radius
        source = "half of the pitch less the window through which a tip enters the slot"
        return (
            _block_parameter("gap", dog.pitch_angle, "rad", "pitch, by dog.count"),
            _block_parameter("epsilon", 0.5 * (dog.pitch_angle - window), "rad", source),
        )

    @property
    def speed_threshold(self) -> float:
        """Largest tested mismatch, rad/s, up to which the wanted share engages; 0 for none."""
        share = self.study.file.expectation.first_window_share
        threshold = 0.0
        points = sorted(self.points, key=lambda point: abs(point.mismatch_rpm))
        for speed, group in groupby(points, lambda point: abs(point.mismatch_rpm)):
            if min(point.engagement_probability for point in group) < share:
                break
            threshold = speed * RPM
        return threshold

    def write(self, path: Path) -> tuple[Path, ...]:
        """Write cells to ``path``, and means, Modelica tables and parameters beside it."""
        means, modelica, simscape, maplesim = paths_beside(path)
        write_frame(frame_of(self.cells), path)
        write_frame(frame_of(self.points), means)
        write_whole(modelica, self.modelica_text())
        write_frame(frame_of(self.simscape_parameters), simscape)
        write_frame(frame_of(self.maplesim_parameters), maplesim)
        return path, means, modelica, simscape, maplesim

    def modelica_text(self) -> str:
        """Write probability and mean time, s, as matrices; a mean without a shift: time-out."""
        timeout = self.study.clutch.timeout
        probabilities = [point.engagement_probability for point in self.points]
        times = [timeout if p.mean_time_s is None else p.mean_time_s for p in self.points]
        tables = {"engagement_probability": probabilities, "shift_time": times}
        parts = [self._matrix(name, values) for name, values in tables.items()]
        return "#1\n" + "\n".join(parts)

    def _matrix(self, name: str, values: Sequence[float]) -> str:
        """Write a matrix of the points with mismatch in rad/s down and force in N across."""
        forces = sorted({point.force_N for point in self.points})
        mismatches = sorted({point.mismatch_rpm for point in self.points})
        body = np.reshape(values, (len(mismatches), len(forces)))
        columns: Array = np.array(mismatches)[:, None] * RPM
        matrix = np.block([[np.zeros((1, 1)), np.array([forces])], [columns, body]])
        rows, width = matrix.shape
        lines = [" ".join(f"{value:.9g}" for value in row) for row in matrix]
        return f"double {name}({rows},{width})\n" + "\n".join(lines) + "\n"


def _block_parameter(parameter: str, value: float, unit: str, source: str) -> BlockParameter:
    return BlockParameter(parameter=parameter, value=value, unit=unit, source=source)


def require_map_targets(path: Path) -> None:
    """Raise StorageError unless a map can be written to ``path`` and beside it.

    A map replaces an earlier one as a whole; a table beside a path without a map is no part of
    one, and stays.
    """
    require_targets({"the map": path})
    for table in paths_beside(path):
        if table.exists() and not path.exists():
            fault = f"is {table}, which is there already without {path}"
            raise StorageError(f"a table beside the map {fault}; name another file")
        require_targets({"a table beside the map": table})


def paths_beside(path: Path) -> tuple[Path, Path, Path, Path]:
    """Name the files of means, Modelica tables and parameters beside that of the cells."""
    stem = path.stem
    return (
        path.with_name(f"{stem}-mean.csv"),
        path.with_name(f"{stem}-modelica.txt"),
        path.with_name(f"{stem}-simscape.csv"),
        path.with_name(f"{stem}-maplesim.csv"),
    )


def _mean_of(cells: Sequence[EngagementCell]) -> MapPoint:
    """Average cells of one mismatch and force over the relative angle."""
    finished = [cell for cell in cells if cell.outcome != Outcome.DIVERGED.value]
    times = [cell.shift_time_s for cell in finished if cell.shift_time_s is not None]
    time_error = None
    if len(times) > 2:
        is_even = len(times) == len(finished)
        time_error = math.sqrt(variance_of_mean(np.array(times), even=is_even))
    return MapPoint(
        mismatch_rpm=cells[0].mismatch_rpm,
        force_N=cells[0].force_N,
        engagement_probability=len(times) / len(finished) if finished else 0.0,
        engagement_probability_standard_error=_share_error(len(times), len(finished)),
        mean_time_s=math.fsum(times) / len(times) if times else None,
        mean_time_standard_error_s=time_error,
        shifts=len(finished),
    )


def _share_error(count: int, total: int) -> float | None:
    """Compute the standard deviation of a share with Jeffreys' prior; None without a shift."""
    if total == 0:
        return None
    beta = (count + 0.5) * (total - count + 0.5)
    return math.sqrt(beta / (total + 2.0)) / (total + 1.0)


def _require_grid(study: Setup) -> None:
    """Raise InputError unless the study has every mismatch with every force, once each."""
    points = [(point.mismatch, point.profile.force) for point in study.points]
    mismatches, forces = (set(values) for values in zip(*points, strict=True))
    if len(points) == len(set(points)) == len(mismatches) * len(forces):
        return
    remedy = " and ".join(
        key_argument("settings", f"operating.{name}", example)
        for name, example in (("mismatch_rpm", [20, 100]), ("force_N", [300, 600]))
    )
    raise InputError(
        f"a map needs every mismatch with every force, but the study has {len(points)} operating "
        f"points of {len(mismatches)} mismatches and {len(forces)} forces; give {remedy}"
    )


def simulate_map(study: Setup, options: RunOptions) -> EngagementMap:
    """Simulate the map of a study at its operating points and number of angles.

    InputError for operating points that are no grid.
    """
    study = study.search_setup
    _require_grid(study)
    clutch = study.clutch
    count = study.file.expectation.angles
    angles = ((np.arange(count) + 0.5) * clutch.dog.pitch_angle / count).tolist()
    points = sorted(study.points, key=lambda point: (point.mismatch, point.profile.force))
    blocks = even_blocks(clutch, points, angles, study.file.expectation.seed)
    question = [study.config_hash, "map"]
    with options.executor("map", question, len(points) * count) as (executor, _):
        rows = executor.run(blocks)
    cells = []
    for point, point_rows in zip(points, rows, strict=True):
        for angle, row in zip(angles, point_rows, strict=True):
            shift = result_of(row)
            cell = EngagementCell(
                mismatch_rpm=point.mismatch / RPM,
                force_N=point.profile.force,
                angle_deg=angle / DEG,
                engaged=shift.outcome is Outcome.ENGAGED,
                outcome=shift.outcome.value,
                shift_time_s=shift.shift_time,
            )
            cells.append(cell)
    return EngagementMap(study, tuple(cells))
