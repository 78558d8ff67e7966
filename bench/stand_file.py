"""Content of ``bench.toml``: the clutch as the bench knows it, its sensors and its actuator.

A stand with ``[actuation]`` has a kind of actuator (``sim.shift.actuators``); without it the shift
force is that over time of each row.

``[record]`` states conventions that no table of times shows, and each decides what the times may
mean. Of the uncertainties in ``[errors]`` *systematic* ones are the same for the whole series, as
that of a load cell's gain; those of *each point* are drawn again with each setting, as what a valve
or a drive stops at.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from dogshape.bench.texts import read_toml
from dogshape.sim.clutch_tables import (
    ActuatorSection,
    DogSection,
    DriveSection,
    Keys,
    OutputSection,
    Section,
    SlidingSection,
    rings,
    validate,
)
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DataError, Refusal, require_between
from dogshape.sim.interface import verb
from dogshape.sim.shift.clutch import Clutch, ContactSet, contact_set, solver_for
from dogshape.sim.units import DEG, MM, MS, RPM

Place = Literal["sleeve", "actuator", "unknown"]
Sense = Literal["known", "unknown"]  #: of rotation: sign of the mismatch (``docs/scope.md``)
EmptyCells = Literal["not_made", "failed", "unknown"]

#: Uncertainty beyond which a linear law would say nothing.
Percent = Annotated[float, Field(ge=0.0, le=30.0)]


class BenchRecord(Section):
    """Conventions by which a stand recorded its shifts.

    ``time_zero`` is the start of shift times and traces (a dead time follows the command, none the
    first force), ``displacement_at`` the place of the sensor, ``empty_cells`` the meaning of rows
    with neither a time nor ``engaged``, ``sense`` the sign of the mismatch (``docs/scope.md``).
    """

    time_zero: Literal["command", "force", "unknown"] = "unknown"
    displacement_at: Place = "unknown"
    sense: Sense = "known"
    empty_cells: EmptyCells = "unknown"


class TestTerms(Section):
    """Hours of a bench test of the menu at this stand, None for the usual, and possible or not."""

    __test__ = False  # no test of the test runner's

    name: str
    hours: Annotated[float, Field(gt=0.0, le=1e4)] | None = None
    possible: bool = True


class Measured(Section):
    """Result of a direct test in the parameter's unit; None where the effect has just one."""

    effect: str
    parameter: str | None = None
    value: Annotated[float, Field(gt=-np.inf, lt=np.inf)]
    standard_error: Annotated[float, Field(gt=0.0, lt=np.inf)]


class _Contact(
    Keys, of=ContactSet, optional=("stiffness", "dissipation"), leave=("face_friction",)
):
    # Kept for the reader of the file and not used: the solver's fall to dynamic friction lies at
    # ten stiction velocities, as in the published set.
    friction_velocity_m_s: float | None = None


class Sensor(Section):
    """Linkage of the sensors: actuator over sleeve travel, and share of its force that arrives."""

    linkage_ratio: Annotated[float, Field(ge=0.01, le=100.0)] | None = None
    linkage_efficiency: Annotated[float, Field(ge=0.01, le=1.0)] | None = None

    @property
    def force_factor(self) -> float | None:
        """Force at the sleeve over that at the robot arm, None where that is not known."""
        ratio, efficiency = self.linkage_ratio, self.linkage_efficiency
        return None if ratio is None or efficiency is None else ratio * efficiency


class Calibration(Section):
    """A static reading of the actuator; pressure and time are kept for the reader and not used."""

    pressure_mbar: float | None = None
    arm_displacement_mm: float | None = None
    arm_force_N: float | None = None
    sleeve_force_N: float | None = None
    max_force_time_s: float | None = None


class Tolerance(Section):
    """Standard uncertainties of force and mismatch: relative and absolute."""

    force_percent: Percent = 0.0
    force_N: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0
    mismatch_percent: Percent = 0.0
    mismatch_rpm: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0

    def __bool__(self) -> bool:
        return any(value for _, value in self)

    @property
    def sizes(self) -> tuple[float, float, float, float]:
        """Uncertainty of the force as a share and in N, of the mismatch as a share and in rad/s."""
        return (
            0.01 * self.force_percent,
            self.force_N,
            0.01 * self.mismatch_percent,
            RPM * self.mismatch_rpm,
        )


class NominalErrors(Section):
    """Uncertainties of nominal values, none by default, and the step of the clock."""

    systematic: Tolerance = Tolerance()
    each_point: Tolerance = Tolerance()
    # Beyond 100 ms, times are counts of two or three steps.
    clock_step_ms: Annotated[float, Field(ge=0.0, le=100.0)] | None = None

    def __bool__(self) -> bool:
        return bool(self.systematic) or bool(self.each_point)


class _BenchFile(Section):
    name: str
    source: str
    timeout_s: float
    shift_travel_mm: float
    relative_angles_deg: Annotated[list[float], Field(min_length=2)] | None = None
    corrections: list[str] = Field(default_factory=list)
    margin_percent: Annotated[float, Field(ge=0.0, le=100.0)] = 5.0
    margin_ms: Annotated[float, Field(ge=0.0, le=1e3)] = 2.0
    dog: DogSection
    sliding: SlidingSection
    output: OutputSection
    drive: DriveSection = DriveSection()
    contact: _Contact
    actuation: ActuatorSection | None = None
    record: BenchRecord = BenchRecord()
    sensor: Sensor = Sensor()
    actuator_calibration: list[Calibration] = Field(default_factory=list)
    tests: list[TestTerms] = Field(default_factory=list)
    measured: list[Measured] = Field(default_factory=list)
    errors: NominalErrors = NominalErrors()


@dataclass(frozen=True)
class RelativeMargin:
    """Gap of a mean shift time below which nothing needs doing: a share of it, and least s."""

    share: float = 0.05
    least: float = 2e-3

    def of(self, simulated: Array) -> Array:
        """Compute the gaps below which nothing needs doing, s, from mean times in s, (points,)."""
        return np.asarray(np.maximum(self.share * simulated, self.least))


@dataclass(frozen=True, kw_only=True)
class Stand:
    """Stand of a data set: clutch, sensors, record and stated errors, without shifts.

    ``relative_angles`` are in rad, ``corrections`` such as ``time=ms``. ``clock_step`` is the step
    in s of which all times are multiples, 0 where there is none, None where nothing is stated.
    """

    name: str
    source: str
    clutch: Clutch
    relative_angles: tuple[float, ...] | None = None
    sensor: Sensor = field(default_factory=Sensor)
    calibration: tuple[Calibration, ...] = ()
    corrections: tuple[str, ...] = ()
    record: BenchRecord = field(default_factory=BenchRecord)
    tests: tuple[TestTerms, ...] = ()
    margin: RelativeMargin = RelativeMargin()
    errors: NominalErrors = field(default_factory=NominalErrors)
    measured: tuple[Measured, ...] = ()
    clock_step: float | None = 0.0


def load_stand(path: Path) -> Stand:
    """Read ``bench.toml``; every mistake raises DataError or InputError with file and key."""
    try:
        data = read_toml(path)
    except FileNotFoundError as error:
        fault = f"there is no {path}; a data set needs bench.toml"
        if (path.parent / "study.toml").is_file():
            call = verb("init bench", "TABLE", origin=str(path.parent))
            fault += f"; {path.parent} is a study, from which {call} makes a data set of measured "
            fault += "times"
        raise DataError(fault) from error
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror}; check path and rights") from None
    if "mismatch_sense" in data:  # where earlier versions had record.sense
        data["record"] = {"sense": data.pop("mismatch_sense"), **data.get("record", {})}
    file = validate(_BenchFile, data, str(path))
    angles, step = file.relative_angles_deg, file.errors.clock_step_ms
    fields: Any = {n: getattr(file, n) for n in Stand.__dataclass_fields__ if hasattr(file, n)}
    fields |= {n: tuple(value) for n, value in fields.items() if isinstance(value, list)}
    return Stand(
        **fields,
        clutch=_clutch(file),
        relative_angles=tuple(a * DEG for a in angles) if angles else None,
        calibration=tuple(file.actuator_calibration),
        margin=RelativeMargin(0.01 * file.margin_percent, 1e-3 * file.margin_ms),
        clock_step=None if step is None else MS * step,
    )


def _clutch(file: _BenchFile) -> Clutch:
    dog = file.dog.value
    friction_velocity = file.contact.si("friction_velocity_m_s")
    contact = replace(contact_set("adams2019"), name="bench", **friction_velocity)
    shift_travel = dog.travel - file.shift_travel_mm * MM
    if not 0.0 < shift_travel < dog.height:
        rule = f"it must lie below the full travel of {dog.travel / MM:.6g} mm and past entry"
        remedy = "give the travel at which a shift counts as finished"
        raise DataError(Refusal("shift_travel_mm", file.shift_travel_mm, "mm", rule, remedy))
    require_between("timeout_s", file.timeout_s, 1e-3, 60.0, "give it in seconds")
    ring_inertias, drive = rings(file.sliding, file.output), file.drive.value
    actuator = None if file.actuation is None else file.actuation.actuator
    clutch = Clutch(
        dog,
        ring_inertias,
        contact,
        solver_for(contact, drive=drive, actuator=actuator),
        file.timeout_s,
        shift_travel,
        drive=drive,
        actuator=actuator,
    )
    if actuator is not None and clutch.solver.scheme == "cenic":
        return clutch.with_engine("planar")  # Drake's scheme takes a thousand times as long
    return clutch
