"""Content of ``bench.toml``: the clutch as the bench knows it, its sensors and its actuator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from dogshape.diagnosis.bench.nominal_errors import (
    EXACT,
    ErrorTables,
    NominalErrors,
    nominal_errors,
    stated_step,
)
from dogshape.diagnosis.bench.record import (
    UNSAID,
    BenchRecord,
    RecordSection,
    with_record,
)
from dogshape.diagnosis.terms import Array
from dogshape.sim.clutch_tables import (
    DogSection,
    OutputSection,
    Section,
    SlidingSection,
    rings,
    si_fields,
    validate,
)
from dogshape.sim.errors import DataError, refusal, require_between
from dogshape.sim.shift.clutch import Clutch, solver_for
from dogshape.sim.shift.contact import contact_set
from dogshape.sim.texts import read_toml
from dogshape.sim.units import DEG, MM


class _Contact(Section):
    # The solver's fall to dynamic friction lies at ten stiction velocities, as in the
    # published set; the friction velocity is read and not used.
    static_friction: float
    dynamic_friction: float
    stiction_velocity_m_s: float
    friction_velocity_m_s: float
    stiffness_Pa_m: float | None = None
    dissipation_s_m: float | None = None


class _Sensor(Section):
    linkage_ratio: float | None = None
    linkage_efficiency: float | None = None


class _Calibration(Section):
    pressure_mbar: float | None = None
    arm_displacement_mm: float | None = None
    arm_force_N: float | None = None
    sleeve_force_N: float | None = None
    max_force_time_s: float | None = None


class _Test(Section):
    name: str
    hours: float | None = None
    possible: bool = True


class _Measured(Section):
    effect: str
    parameter: str | None = None
    value: float
    standard_error: float


class _BenchFile(Section):
    name: str
    source: str
    timeout_s: float
    shift_travel_mm: float
    relative_angles_deg: Annotated[list[float], Field(min_length=2)] | None = None
    corrections: list[str] = Field(default_factory=list)
    margin_percent: float | None = None
    margin_ms: float | None = None
    dog: DogSection
    sliding: SlidingSection
    output: OutputSection
    contact: _Contact
    record: RecordSection = RecordSection()
    sensor: _Sensor = _Sensor()
    actuator_calibration: list[_Calibration] = Field(default_factory=list)
    tests: list[_Test] = Field(default_factory=list)
    measured: list[_Measured] = Field(default_factory=list)
    errors: ErrorTables | None = None


@dataclass(frozen=True)
class Sensor:
    """Sensors of the stand: place that is simulated, and linkage to the sleeve.

    ``linkage_ratio`` is actuator travel over sleeve travel, ``linkage_efficiency`` the share
    of its force that arrives; None where the data set does not say.
    """

    displacement_at: str = "sleeve"
    linkage_ratio: float | None = None
    linkage_efficiency: float | None = None

    @property
    def force_factor(self) -> float | None:
        """Force at the sleeve over force at the robot arm, None where that is not known."""
        if self.linkage_ratio is None or self.linkage_efficiency is None:
            return None
        return self.linkage_ratio * self.linkage_efficiency


@dataclass(frozen=True)
class Calibration:
    """A static reading of the actuator: mbar, m, N, N and s; None where it has none."""

    pressure_mbar: float | None
    arm_displacement: float | None
    arm_force: float | None
    sleeve_force: float | None
    max_force_time: float | None


@dataclass(frozen=True)
class TestTerms:
    """Terms of a bench test at this stand: hours of work, None for the usual, and possible or not.

    ``name`` is that of the test on the menu.
    """

    __test__ = False  # no test of the test runner's

    name: str
    hours: float | None = None
    possible: bool = True


@dataclass(frozen=True)
class Measured:
    """Result of a direct test: a parameter of an effect with its standard error, in its unit.

    ``parameter`` is None where the effect has just one.
    """

    effect: str
    parameter: str | None
    value: float
    standard_error: float


@dataclass(frozen=True)
class Margin:
    """Gap of a mean shift time below which nothing needs doing.

    Parameters
    ----------
    share : of the simulated mean time.
    least : s, where that share is less.
    """

    share: float = 0.05
    least: float = 2e-3

    def of(self, simulated: Array) -> Array:
        """Compute the gaps below which nothing needs doing, s, from mean times in s, (points,)."""
        limit: Array = np.maximum(self.share * simulated, self.least)
        return limit


USUAL_MARGIN = Margin()


@dataclass(frozen=True)
class Stand:
    """A data set without its shifts; ``relative_angles`` in rad, where it says them.

    ``corrections`` are those that the data set itself asks for, such as ``time=ms``.
    ``clock_step`` is the stated step of the clock in s, None where nothing is stated.
    """

    name: str
    source: str
    clutch: Clutch
    relative_angles: tuple[float, ...] | None
    sensor: Sensor = Sensor()
    calibration: tuple[Calibration, ...] = ()
    corrections: tuple[str, ...] = ()
    record: BenchRecord = UNSAID
    tests: tuple[TestTerms, ...] = ()
    margin: Margin = USUAL_MARGIN
    errors: NominalErrors = EXACT
    measured: tuple[Measured, ...] = ()
    clock_step: float | None = None


def load_stand(path: Path) -> Stand:
    """Read ``bench.toml``; every mistake raises DataError or InputError with file and key."""
    file = _settings(path)
    angles = file.relative_angles_deg
    return Stand(
        name=file.name,
        source=file.source,
        clutch=_clutch(file),
        relative_angles=tuple(a * DEG for a in angles) if angles else None,
        sensor=_sensor(path, file),
        calibration=tuple(_calibration(one) for one in file.actuator_calibration),
        corrections=tuple(file.corrections),
        record=file.record.record(),
        tests=tuple(_terms(path, one) for one in file.tests),
        margin=_margin(path, file),
        errors=nominal_errors(path, file.errors),
        measured=tuple(_measured(path, one) for one in file.measured),
        clock_step=stated_step(path, file.errors),
    )


def _settings(path: Path) -> _BenchFile:
    try:
        data = read_toml(path)
    except FileNotFoundError as error:
        hint = ""
        if (path.parent / "study.toml").is_file():
            hint = (
                f"; {path.parent} is a study, from which 'dogshape init bench TABLE --from "
                f"{path.parent}' makes a data set of measured times"
            )
        raise DataError(f"there is no {path}; a data set needs bench.toml{hint}") from error
    except OSError as error:
        raise DataError(
            f"{path} cannot be read: {error.strerror}; check path and rights"
        ) from error
    data = with_record(path, data)
    return validate(_BenchFile, data, str(path))


def _clutch(file: _BenchFile) -> Clutch:
    dog = file.dog.dog()
    published, given = contact_set("adams2019"), file.contact
    stiffness, dissipation = given.stiffness_Pa_m, given.dissipation_s_m
    contact = replace(
        published,
        name="bench",
        static_friction=given.static_friction,
        dynamic_friction=given.dynamic_friction,
        stiction_velocity=given.stiction_velocity_m_s,
        stiffness=published.stiffness if stiffness is None else stiffness,
        dissipation=published.dissipation if dissipation is None else dissipation,
    )
    left = dog.travel - file.shift_travel_mm * MM
    if not 0.0 < left < dog.height:
        rule = f"it must lie below the full travel of {dog.travel / MM:.6g} mm and past entry"
        remedy = "give the travel at which a shift counts as finished"
        raise DataError(refusal("shift_travel_mm", file.shift_travel_mm, "mm", rule, remedy))
    require_between("timeout_s", file.timeout_s, 1e-3, 60.0, "give it in seconds")
    both = rings(file.sliding, file.output)
    return Clutch(dog, both, contact, solver_for(contact), file.timeout_s, left)


def _sensor(path: Path, file: _BenchFile) -> Sensor:
    given = file.sensor
    limits = {"linkage_ratio": (0.01, 100.0), "linkage_efficiency": (0.01, 1.0)}
    for name, (low, high) in limits.items():
        value = getattr(given, name)
        if value is not None and not low <= value <= high:
            rule = f"it must lie between {low:g} and {high:g}"
            remedy = "correct it; the ratio is actuator travel over sleeve travel"
            raise DataError(f"{path}: " + refusal(f"sensor.{name}", value, "", rule, remedy))
    place = "actuator" if file.record.displacement_at == "actuator" else "sleeve"
    return Sensor(place, given.linkage_ratio, given.linkage_efficiency)


def _margin(path: Path, file: _BenchFile) -> Margin:
    usual = USUAL_MARGIN
    share = usual.share if file.margin_percent is None else 0.01 * file.margin_percent
    least = usual.least if file.margin_ms is None else 1e-3 * file.margin_ms
    for name, value, high, unit in (
        ("margin_percent", 100.0 * share, 100.0, "%"),
        ("margin_ms", 1e3 * least, 1e3, "ms"),
    ):
        if not 0.0 <= value <= high:
            rule = f"it must lie between 0 and {high:g} {unit}"
            remedy = "give the gap of a mean shift time below which nothing needs doing"
            raise DataError(f"{path}: " + refusal(name, value, unit, rule, remedy))
    return Margin(share, least)


def _terms(path: Path, given: _Test) -> TestTerms:
    hours = given.hours
    if hours is not None and not 0.0 < hours <= 1e4:
        rule, remedy = "it must be positive and at most 10000 h", "give the work in hours"
        where = f"{path}: hours of the test '{given.name}'"
        raise DataError(refusal(where, hours, "h", rule, remedy))
    return TestTerms(given.name, hours, given.possible)


def _measured(path: Path, given: _Measured) -> Measured:
    error = given.standard_error
    if not 0.0 < error < np.inf or not np.isfinite(given.value):
        raise DataError(
            f"{path}: the measured {given.effect} is {given.value:g} with a standard error of "
            f"{error:g}, but must be finite, and the error positive; give what the test can tell"
        )
    return Measured(given.effect, given.parameter, given.value, error)


def _calibration(given: _Calibration) -> Calibration:
    known = {key: value for key, value in given.model_dump().items() if value is not None}
    pressure = known.pop("pressure_mbar", None)
    names = ("arm_displacement", "arm_force", "sleeve_force", "max_force_time")
    values = si_fields(known)
    return Calibration(pressure, *(values.get(name) for name in names))
