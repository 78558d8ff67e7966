"""Reading a study file, and building the values of ``sim`` from it.

A study is named by a TOML file, a folder with ``study.toml``, or the name of one
that the package brings. Every mistake becomes one sentence.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dogshape.bench.texts import place_of, read_toml
from dogshape.pipeline.config.operating import (
    ACTUATION_KEYS,
    FORCE,
    OPERATED,
    RISE,
    Actuation,
    nominal_operation,
    points_of_design,
    replaced_keys,
    with_mechanism,
)
from dogshape.pipeline.config.schema import (
    FORMAT,
    OUTPUT_VARIABLES,
    StudyFile,
    dotted_key,
    variable_key,
)
from dogshape.sim.clutch_tables import dog_fields, rings, validate
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, Refusal, join_faults, require_between
from dogshape.sim.interface import argument
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.actuators import PROFILE
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Solver
from dogshape.sim.shift.conclusion import Engagement, require_stiff_enough
from dogshape.sim.shift.drive import MAX_TORQUE_NM
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.pair import ALIKE, OUTPUT_PREFIX, OutputDog, dog_pair
from dogshape.sim.shift.trace import torque_peak
from dogshape.sim.statistics.expectation import SetPoint
from dogshape.sim.statistics.shift_records import (
    DEFAULTS,
    Record,
    clutch_record,
    content_key,
    uncertain_record,
)
from dogshape.sim.statistics.uncertainty import FACTORS, Uncertainty, Variant
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import Wear
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.materials import Material, material_of
from dogshape.sim.strength.spline import Sleeve
from dogshape.sim.strength.verdict import AssumedValue
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root

#: Share of the entry play that may pass in a fall (judged): at 0.7 flat dogs rebound, at 0.8 skip.
MAX_PASSED_PLAY = 0.5
#: Angles of an operating point from which Drake's mean has an error.
MIN_CONFIRM_ANGLES = 3
#: Searched keys of the dog in the bundled studies, and all that a study may search.
VARIABLES = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
HEIGHT = "height_mm"
OUTPUT_HEIGHT = f"{OUTPUT_PREFIX}{HEIGHT}"
BACKLASH = "backlash_mm"
OUTPUT_BACKLASH = f"{OUTPUT_PREFIX}{BACKLASH}"
SHAPE = (*VARIABLES, "crest", "chamfer_back_deg", "backlash_mm", *OUTPUT_VARIABLES)


@dataclass(frozen=True)
class Setup:
    """Values of ``sim`` built from a study file: clutch, operation, limits and search ranges."""

    file: StudyFile
    clutch: Clutch  #: with its mechanism and the effects of the study
    limits: Limits
    points: tuple[OperatingPoint, ...]
    variables: dict[str, tuple[float, float]]  #: ranges of the searched keys, edge units
    actuation: Actuation  #: course of the shift force
    uncertainty: Uncertainty | None = None  #: None if just the relative angle is uncertain
    #: searched keys of the operation of one design (``with_design``); empty for the study's own
    operation: Mapping[str, float] = field(default_factory=dict)
    path: Path | None = None  #: file that the study, before its settings, was read from

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.file.name

    @property
    def shape_keys(self) -> tuple[str, ...]:
        """Searched keys of the dogs of both rings; the operation has its own."""
        return tuple(key for key in self.variables if key not in OPERATED)

    def with_design(self, params: Mapping[str, float]) -> Setup:
        """Return the study with operating points and output dog of a design, and its limits.

        The sliding dog stays that of the study.
        """
        study = self
        operation = {key: params[key] for key in OPERATED if key in params}
        if operation:
            points = points_of_design(self.points, self.actuation, operation)
            # A set-point moves the mismatch of all points alike.
            mismatch_change = points[0].mismatch - self.points[0].mismatch
            limits = _limits(self.file, self.clutch, points, mismatch_change)
            study = replace(self, points=points, limits=limits, operation=operation)
        output_dog = self.output_dog_with(params)
        if output_dog == self.clutch.output_dog:
            return study
        clutch = replace(study.clutch, output_dog=output_dog)
        return replace(study, clutch=clutch, limits=replace(study.limits, output_dog=output_dog))

    @property
    def search_setup(self) -> Setup:
        """Study in the engine that a search uses: compiled, unless ``solver.engine`` is given."""
        return self if self.file.solver.engine is not None else self.in_engine("planar")

    @property
    def reference_setup(self) -> Setup | None:
        """Study in Drake, the reference of the compiled engine.

        None where Drake does all of the work, or has no scheme or law for it (``SolverSection``).
        """
        if self.engine_gap or self.file.solver.engine == "drake":
            return None
        return self.in_engine("drake")

    @property
    def engine_gap(self) -> str:
        """Reason why Drake cannot repeat the shifts of the compiled engine; empty where it can."""
        contact = self.clutch.contact
        if self.file.solver.engine == "drake":
            return ""
        if contact.face_friction is not None:
            return "Drake's dogs have one friction, and contact.face_friction is given"
        if contact.impact is not None:
            return "Drake has no law IMPACT"
        if self.clutch.has_forces and self.clutch.solver.scheme == "cenic":
            source = "an actuator" if self.clutch.actuator else "mechanism or drive"
            return f"Drake's scheme cenic cannot follow the forces of {source}"
        return ""

    def in_engine(self, engine: str) -> Setup:
        """Return the study in an engine, ``drake`` or ``planar``, at that engine's accuracy."""
        if engine == self.clutch.solver.engine:
            return self
        return replace(self, clutch=self.clutch.with_engine(engine))

    @property
    def retraction(self) -> float:
        """Time from a failed shift to its retry, dead time included, s."""
        return self.file.shift.retraction_s + self.actuation.delay

    @property
    def retry_text(self) -> str:
        """Cost of a failed attempt, with the keys that decide it."""
        cost = self.clutch.timeout + self.retraction
        delay_key = " and mechanism.delay_s" if self.actuation.delay else ""
        return f"each costs shift.timeout_s and shift.retraction_s{delay_key}, {cost:.4g} s"

    @property
    def set_point(self) -> SetPoint:
        """Set-point that frees blocked shifts; the default has no amplitude and frees none."""
        section = self.file.shift.alternating
        if section is None:
            return SetPoint()
        start = section.after_s + self.actuation.delay
        return SetPoint(section.amplitude_rpm * RPM, section.period_s, start)

    @property
    def forces(self) -> list[float]:
        """Distinct shift forces of the operating points at the sleeve, N."""
        return list(dict.fromkeys(point.profile.force for point in self.points))

    @property
    def operating_text(self) -> str:
        """The operating points in words."""
        speeds = _range_text([point.mismatch / RPM for point in self.points])
        forces = _range_text(self.forces)
        return f"{len(self.points)} with {speeds} 1/min, {forces} N at the sleeve"

    @property
    def load_text(self) -> str:
        """Torque, life and torque left at disengagement in words, defaults named as such."""
        load = self.file.load
        life = "life by load.spectrum"
        if not load.spectrum:
            default = _default_text(load.shifts, LoadCase.shifts)
            life = f"{load.shifts:,.0f} shifts over the life{default}"
        words = f"{load.torque_Nm:g} N m, application factor {load.application_factor:g}, {life}"
        if self.limits.load.pull_out_force_limit is None:
            return words
        share = load.pull_out_share
        default = _default_text(share, LoadCase.pull_out_share)
        return f"{words}, pulled out under {100.0 * share:g} % of the torque{default}"

    @property
    def shafts_text(self) -> str:
        """Speed of the shafts and the drive in words, and whether another speed changes times."""
        drive = self.clutch.drive
        words = f"shafts {drive.text}"
        if not drive.turns or drive.has_pack:
            return words
        return f"{words}; another speed changes no time, as only its sense acts on the rings"

    @property
    def actuator_text(self) -> str:
        """The actuator in words; empty for a profile of the force."""
        actuator = self.clutch.actuator
        return "" if actuator is None else f"actuator: {actuator.text}"

    @property
    def mount_text(self) -> str:
        """Teeth of a sleeve in words; empty for dogs on a face."""
        sleeve = self.limits.sleeve
        return "" if sleeve is None else sleeve.text(self.clutch.dog)

    @property
    def mechanism(self) -> Record:
        """Values of the shift mechanism by the keys of ``[mechanism]``; empty without mechanism."""
        record = {
            key.removeprefix("mechanism_"): value
            for key, value in self.clutch.mechanism.record.items()
        }
        ideal = Actuation(self.actuation.nominal)
        for name, key in ACTUATION_KEYS.items():
            value = getattr(self.actuation, name)
            if value != getattr(ideal, name):
                record[key] = value
        return record

    def dog_with(self, params: Mapping[str, float]) -> Dog:
        """Return the study's dog with other values, edge units; keys of the operation are ignored.

        Raises InputError or GeometryError where there is no such dog, or none beside it on the
        output ring.
        """
        left_out = (*OPERATED, *OUTPUT_VARIABLES)
        shape = {key: value for key, value in params.items() if key not in left_out}
        dog = replace(self.clutch.dog, **dog_fields(shape))
        dog_pair(dog, self.output_dog_with(params))
        return dog

    def output_dog_with(self, params: Mapping[str, float]) -> OutputDog:
        """Build the output dog of a design by its differences; InputError beyond a key's range."""
        shape = {
            key.removeprefix(OUTPUT_PREFIX): value
            for key, value in params.items()
            if key in OUTPUT_VARIABLES
        }
        return replace(self.clutch.output_dog, **dog_fields(shape))

    def clutch_with(self, params: Mapping[str, float]) -> Clutch:
        """Return the clutch with both dogs of a design; raises as ``dog_with``."""
        output_dog = self.output_dog_with(params)
        return replace(self.clutch, dog=self.dog_with(params), output_dog=output_dog)

    def torque_peak(self, shift: Engagement) -> float | None:
        """Compute the largest torque of the driveline in a shift, N m; None without stiffness."""
        stiffness = self.file.driveline.stiffness_Nm_rad
        return None if stiffness is None else torque_peak(shift.clutch, shift.trace, stiffness)

    def params_of(self, values: Iterable[float]) -> dict[str, float]:
        """Map the searched keys to values, edge units (d,), the count as a whole number."""
        pairs = zip(self.variables, values, strict=True)
        return {key: round(value) if key == "count" else float(value) for key, value in pairs}

    def rows(self, designs: Iterable[Mapping[str, Any]]) -> Array:
        """Stack designs as rows in edge units, (n, d), the inverse of ``params_of``."""
        rows = [[design[key] for key in self.variables] for design in designs]
        return np.array(rows, dtype=float).reshape(-1, len(self.variables))

    @property
    def prototype(self) -> dict[str, float]:
        """Values of the searched keys of the study's own dog, edge units."""
        values = {**DEFAULTS, **self.file.dog.sizes, **nominal_operation(self.points)}
        section = self.file.output_dog
        output_sizes = {} if section is None else section.model_dump(exclude_none=True)
        for name in OUTPUT_VARIABLES:
            key = name.removeprefix(OUTPUT_PREFIX)
            values[name] = output_sizes.get(key, values[key])
        return {key: values[key] for key in self.variables}

    @property
    def physics(self) -> Record:
        """Everything that a shift depends on except the searched keys and the operating point.

        The rise of the force belongs to it: it follows from the final force by a table.
        """
        rises = self.actuation.table
        record = clutch_record(self.clutch)
        for key, value in self.points[0].profile.record.items():
            if key not in ("force_N", "force_rise_s"):
                record[key] = value
        if self.uncertainty:
            record = {**record, **uncertain_record(self.uncertainty.source)}
        fixed = {key: value for key, value in record.items() if key not in self.shape_keys}
        return {**fixed, "rise_force_N": list(rises.forces), "rise_s": list(rises.rises)}

    @property
    def physics_hash(self) -> str:
        """Content key of ``physics``; results of equal keys are comparable."""
        return content_key(self.physics)

    @property
    def config_hash(self) -> str:
        """Content key of the study file without ``[assumed]``."""
        return content_key(self.file.model_dump(exclude={"assumed"}))

    def assumed_values(self, params: Mapping[str, float]) -> tuple[AssumedValue, ...]:
        """List the values of the file that nobody gave, without the searched keys of a design."""
        design_keys = {dotted_key(name) for name in params}
        return tuple(
            AssumedValue(row.key, row.value, row.source)
            for row in self.file.assumed_rows()
            if row.key not in design_keys
        )


def _default_text(value: float, default: float) -> str:
    """Mark a value that is its default; empty for another."""
    return " (default)" if value == default else ""


def _range_text(values: Sequence[float]) -> str:
    """Name the smallest and the largest of some values, once if they are equal."""
    ends = dict.fromkeys((f"{min(values):g}", f"{max(values):g}"))
    return " to ".join(ends)


#: ``KEY=VALUE``, or values by dotted keys, of a study file.
Settings = Iterable[str] | Mapping[str, Any] | None


def load_study(where: str | Path, overrides: Settings = None) -> Setup:
    """Read and validate a study: a TOML file, a folder with ``study.toml`` or a bundled name.

    ``overrides`` are ``KEY=VALUE`` with dotted keys, later ones win, ``KEY=`` takes the key out; or
    values by dotted keys, None likewise. Raises InputError with file, key, value and rule.
    """
    path = find_study(where)
    try:
        data = read_toml(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path") from error
    settings = settings_of(overrides)
    source = f"{path} with {argument('settings')}" if settings else str(path)
    return replace(_build_with_settings(data, settings, source), path=path)


def replace_keys(study: Setup, settings: Mapping[str, Any]) -> Setup:
    """Build a study with other values by dotted keys, None to take a key out.

    Raises InputError as ``load_study``.
    """
    data = study.file.model_dump(exclude_none=True)
    changed_study = _build_with_settings(data, settings, f"the study {study.name}")
    return replace(changed_study, path=study.path)


#: Largest share of the sliding side's inertia that a ring has where the side shrinks (judged).
MAX_RING_SHARE = 0.5
#: Keys of the ring that is a part of the sliding side.
RING_KEYS = ("mechanism.ring_inertia_kgm2", "strike.ring_inertia_kgm2")


def ring_settings(data: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings of the ring's inertia that follow from a smaller ``sliding.inertia_kgm2``.

    The ring is at most half of its side, or the share that it has in the file; nominal value and
    range shrink by one factor. Keys of ``settings`` are left out.
    """
    key = "sliding.inertia_kgm2"
    old_inertia = data.get("sliding", {}).get("inertia_kgm2")
    new_inertia = settings.get(key)
    numbers = (int, float)
    if not isinstance(old_inertia, numbers) or not isinstance(new_inertia, numbers):
        return {}
    if not 0 < new_inertia < old_inertia:
        return {}
    rings = _ring_values(data, settings)
    ends = []
    for ring in rings.values():
        ends += ring if isinstance(ring, list) else [ring]
    if not ends or not all(isinstance(end, numbers) and end > 0.0 for end in ends):
        return {}
    largest = max(ends)
    factor = max(MAX_RING_SHARE, largest / old_inertia) * new_inertia / largest
    if factor >= 1.0:
        return {}
    settings_of_ring = {}
    for key, ring in rings.items():
        is_range = isinstance(ring, list)
        settings_of_ring[key] = [factor * end for end in ring] if is_range else factor * ring
    return settings_of_ring


def _ring_values(data: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of ``RING_KEYS`` in a file that ``settings`` do not replace."""
    rings = {}
    for key in RING_KEYS:
        table, _, name = key.partition(".")
        value = (data.get(table) or {}).get(name)
        if value is not None and key not in settings and table not in settings:
            rings[key] = value
    return rings


def _build_with_settings(data: dict[str, Any], settings: Mapping[str, Any], source: str) -> Setup:
    """Change the tables of a study file by settings, and build the study."""
    settings = {**ring_settings(data, settings), **settings}
    for key, value in settings.items():
        override(data, key, value)
    for key in replaced_keys(settings, data):
        override(data, key, None)
    return build_study(validate(StudyFile, data, source))


def find_study(where: str | Path) -> Path:
    """Return the path of a study file from its path, its folder or a bundled name."""
    path = Path(where)
    if path.is_dir():
        path = path / "study.toml"
    if path.is_file():
        return path
    bundled = bundled_root() / str(where) / "study.toml"
    if path.name == str(where) and bundled.is_file():
        return bundled
    raise InputError(
        f"there is no study at {where}: give a TOML file, a folder with study.toml, "
        f"or one of the bundled studies ({', '.join(bundled_studies())})"
    )


def bundled_studies() -> list[str]:
    """Return the names of the studies that the package brings."""
    return sorted(file.parent.name for file in bundled_root().glob("*/study.toml"))


def settings_of(settings: Settings) -> dict[str, Any]:
    """Convert settings to values by dotted keys."""
    if isinstance(settings, Mapping):
        return dict(settings)
    return dict(pair_of(text) for text in settings or ())


def pair_of(text: str) -> tuple[str, Any]:
    """Read key and value of ``KEY=VALUE``, the value as TOML or else as text; None for no value."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        rule = "is not KEY=VALUE; write for instance dog.chamfer_deg=14"
        raise InputError(f"{argument('settings')} {text} {rule}")
    try:
        table = tomllib.loads(f"v = {value}")
    except tomllib.TOMLDecodeError:
        table = {"v": value.strip() or None}
    if set(table) != {"v"}:
        option = argument("settings")
        rule = f"holds more than one value; give one {option} a key"
        raise InputError(f"{option} {key.strip()} {rule}")
    return key.strip(), table["v"]


def override(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a study file's tables in place; None takes it out."""
    table, name = place_of(data, key)
    if value is not None:
        table[name] = value
    elif name in table:
        del table[name]
    else:
        raise InputError(f"the study has no key {key} to take out; check the key, or leave it out")


def build_study(file: StudyFile) -> Setup:
    """Build the values of ``sim`` from a validated study file."""
    if file.format != FORMAT:
        fault = f"format is {file.format}, but this version reads format {FORMAT}"
        raise InputError(f"{fault}; convert the file or use the version that wrote it")
    _require_parts(file)
    contact = file.contact.value
    shift = file.shift
    clutch = Clutch(
        dog=file.dog.value,
        rings=rings(file.sliding, file.output),
        contact=contact,
        timeout=shift.timeout_s,
        seated_tolerance=shift.seated_tolerance_mm * MM,
        rebound=shift.rebound_mm * MM,
        solver=Solver(),
        drive=file.drive.value,
        actuator=file.actuation.actuator,
        output_dog=output_dog_of(file),
    )
    _require_confirmation(file)
    _require_limit_torques(file)
    clutch, actuation = with_mechanism(
        clutch,
        file.actuation.actuation,
        file.mechanism,
        effects=file.effects,
        contact=file.contact.si(),
    )
    solver = file.solver.solver(contact, clutch.mechanism, clutch.drive, clutch.actuator)
    clutch = replace(clutch, solver=solver)
    points = file.operating.operating_points(actuation.profile, actuation.full_force)
    _require_actuator(file, clutch, actuation, points=points)
    require_stiff_enough(clutch, max(point.profile.force for point in points))
    _require_fall(file, clutch, min(point.profile.force for point in points))
    uncertainty = _uncertainty(file, clutch, points, table=actuation.table)
    limits = _limits(file, clutch, points)
    variables = file.variables.ranges
    for point, factor in itertools.product(points, variables.get(FORCE, ())):
        actuation.table.profile(factor * point.profile.force, f", or narrow variables.{FORCE}")
    return Setup(file, clutch, limits, points, variables, actuation, uncertainty)


def _require_actuator(
    file: StudyFile, clutch: Clutch, actuation: Actuation, points: Sequence[OperatingPoint]
) -> None:
    """Raise InputError for an actuator that cannot make the travel, or searched beyond it."""
    actuator = clutch.actuator
    if actuator is None:
        return
    min_force = min(point.profile.force for point in points)
    actuator.require_reach(min_force, clutch.shift_travel)
    variables = file.variables.ranges
    searched_heights = [name for name in (HEIGHT, OUTPUT_HEIGHT) if name in variables]
    if searched_heights:
        max_heights = {name: variables[name][1] * MM for name in searched_heights}
        max_height = max_heights.get(HEIGHT, clutch.dog.height)
        output_height = clutch.output_dog.height or max_height
        max_depth = min(max_height, max_heights.get(OUTPUT_HEIGHT, output_height))
        max_travel = clutch.shift_travel + (max_depth - clutch.pair.depth)
        key = variable_key(min(max_heights, key=max_heights.__getitem__))
        actuator.require_reach(min_force, max_travel, key)
    if RISE in variables:
        low, high = variables[RISE]
        raise InputError(
            f"variables.{RISE} is [{low:.6g}, {high:.6g}], but the {actuator.kind} actuator has no "
            "rise time; leave it out"
        )
    force = max(point.profile.force for point in points) / actuation.factor
    for factor in variables.get(FORCE, ()):
        remedy = f"narrow variables.{FORCE}"
        actuator.require_force(factor * force, f"largest force of variables.{FORCE}", remedy)


def _require_confirmation(file: StudyFile) -> None:
    """Raise InputError where means of Drake alone would have fewer angles than an error needs."""
    angles = file.search.confirm_angles
    if file.solver.engine == "drake" and angles < MIN_CONFIRM_ANGLES:
        rule = f"with solver.engine = 'drake' it must be at least {MIN_CONFIRM_ANGLES}, as these "
        rule += "angles alone make the means of a confirmation"
        remedy = "give more angles, or leave solver.engine out"
        raise InputError(Refusal("search.confirm_angles", angles, "", rule, remedy))


def _require_limit_torques(file: StudyFile) -> None:
    """Raise InputError for a torque of the limit that is zero, given twice or beyond the range."""
    key, torques = "expectation.limit_torques_Nm", file.expectation.limit_torques_Nm or []
    for torque in torques:
        require_between(key, torque, -MAX_TORQUE_NM, MAX_TORQUE_NM, "check the value and its unit")
        if torque == 0.0 or torques.count(torque) > 1:
            rule = "each torque is another one, and shifts without one are simulated anyway"
            raise InputError(Refusal(key, torque, "N m", rule, "leave it out or change it"))


def _require_parts(file: StudyFile) -> None:
    """Raise the faults of all sections at once, as far as these build by themselves."""
    sections = (
        file.dog,
        file.drive,
        file.material,
        file.manufacturing,
        file.tolerance,
        file.contact,
    )
    builders: tuple[Callable[[], Any], ...] = (
        partial(rings, file.sliding, file.output),
        file.require_ranges,
        file.assumed_rows,
        partial(getattr, file.actuation, "actuation"),
        partial(_operating_rows, file),
        file.load.case,
        *(partial(getattr, section, "value") for section in sections),
        partial(output_dog_of, file),
        partial(wear_of, file),
        partial(sleeve_of, file),
        partial(getattr, file.variables, "ranges"),
    )
    faults = dict[str, DogshapeError]()  # by message: wear builds the dog a second time
    for build in builders:
        try:
            build()
        except DogshapeError as error:
            faults[str(error)] = error
    if len(faults) > 1:
        raise InputError(join_faults(f"the study {file.name}", faults))
    for fault in faults.values():
        raise fault


def _operating_rows(file: StudyFile) -> Sequence[tuple[float, float, float]]:
    """Return the rows of the operating points; InputError for mistakes."""
    full_force = None
    if file.actuation.kind != PROFILE:
        with suppress(DogshapeError):  # a fault of the actuator is named by itself
            full_force = file.actuation.actuation.full_force
    return file.operating.rows(full_force)


def _uncertainty(
    file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint], table: RiseTable
) -> Uncertainty | None:
    """Build the uncertain quantities, or None; shifts must exist at both ends of each."""
    quantities = tuple(
        (name, distribution.checked(f"uncertain.{name}"))
        for name, distribution in file.uncertain or ()
        if distribution
    )
    if not quantities:
        return None
    uncertainty = Uncertainty(quantities, table)
    for end in (0, 1):
        friction, _, inertia, dissipation = (uncertainty.bounds(name)[end] for name in FACTORS)
        Variant(friction, 1.0, inertia, 0.1, (), dissipation).clutch(clutch)
    low, high = uncertainty.bounds("force_factor")
    forces = [point.profile.force for point in points]
    for force in (low * min(forces), high * max(forces)):
        table.profile(force, ", or narrow uncertain.force_factor")
    return uncertainty


def _limits(
    file: StudyFile,
    clutch: Clutch,
    points: Sequence[OperatingPoint],
    mismatch_change: float = 0.0,
) -> Limits:
    """Build the limits of the checks; open values of load and strike follow from the points.

    Flanks strike at the bounds of a drawn mismatch too, which ``mismatch_change`` moves, rad/s.
    """
    mismatches = [point.mismatch for point in points]
    mismatches += [bound * RPM + mismatch_change for bound in file.operating.mismatch_bounds]
    load = file.load.case(**_clutch_loads(file, clutch, points))
    load.require_spline()
    return Limits(
        load=load,
        material=file.material.value,
        manufacturing=file.manufacturing.value,
        tolerances=file.tolerance.value,
        seated_tolerance=file.shift.seated_tolerance_mm * MM,
        strikes=tuple(file.strike.at_ends(clutch, mismatches)) if file.strike else (),
        sleeve=sleeve_of(file),
        output_dog=clutch.output_dog,
        output_material=_output_material(file),
    )


def _clutch_loads(
    file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint]
) -> dict[str, Any]:
    """Return the fields of the load case that follow from clutch and operating points."""
    mechanism = clutch.mechanism
    has_spline_friction = mechanism.spline_friction > 0.0
    vibrating_mass = file.sliding.mass_kg + mechanism.added_mass
    fields: dict[str, Any] = {
        "vibration_force": file.load.axial_vibration_m_s2 * vibrating_mass,
        "contact": clutch.contact,
        "mount": file.dog.mount,
    }
    if clutch.pair.slots_per_dog > 1:
        fields["slots_per_dog"] = clutch.pair.slots_per_dog
    if clutch.contact.face_friction is not None:
        fields["face_friction"] = clutch.contact.face_friction
    if has_spline_friction:
        fields |= {
            "spline_friction": mechanism.spline_friction,
            "spline_radius": mechanism.spline_radius,
        }
    if has_spline_friction or not file.load.release_by_itself:
        release_force = None
        if clutch.actuator is not None:
            release_force = clutch.actuator.release_force(clutch.pair.travel)
        if release_force is None:
            release_force = min(point.profile.force for point in points)
        fields["pull_out_force_limit"] = release_force
    if mechanism.detent > 0.0 and mechanism.detent_seat > 0.0:
        fields["separating_force_limit"] = mechanism.detent
    return fields


def _require_fall(file: StudyFile, clutch: Clutch, force: float) -> None:
    """Raise InputError where the set-point may carry the dogs past a slot during the fall.

    ``force`` is the least shift force, N.
    """
    alternating = file.shift.alternating
    pair = clutch.pair
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    fall_time = math.sqrt(2.0 * mass * pair.depth / force)
    max_speed = MAX_PASSED_PLAY * pair.entry_play / clutch.dog.mean_radius / fall_time / RPM
    if alternating is not None and alternating.amplitude_rpm > max_speed:
        rule = (
            f"{force:.6g} N push the ring {pair.depth / MM:.4g} mm into a slot in "
            f"{1e3 * fall_time:.3g} ms, and more than {max_speed:.4g} 1/min may throw it out again"
        )
        key = "shift.alternating.amplitude_rpm"
        raise InputError(
            Refusal(key, alternating.amplitude_rpm, "1/min", rule=rule, remedy="lower it")
        )


def output_dog_of(file: StudyFile) -> OutputDog:
    """Build what differs in the output ring's dog; InputError or GeometryError for mistakes."""
    section = file.output_dog
    if section is None:
        return ALIKE
    dog = file.dog.value
    section.require_mate(dog)
    output_dog = section.value
    dog_pair(dog, output_dog)
    return output_dog


def _output_material(file: StudyFile) -> Material | None:
    """Look up the material of the output ring, None for that of the sliding ring."""
    name = None if file.output_dog is None else file.output_dog.material
    return None if name is None else material_of(name)


def wear_of(file: StudyFile) -> Wear | None:
    """Build the wear model, None without ``[wear]``; InputError for mistakes."""
    if file.wear is None:
        return None
    tables = {"output_dog": file.output_dog, "variables.output_dog": file.variables.output_dog}
    for table, section in tables.items():
        if section is not None:
            raise InputError(
                f"[wear] wears the dogs of both rings alike, and [{table}] makes them unlike; "
                "leave one of them out, or give the worn ring as [output_dog]"
            )
    wear: Wear = file.wear.value
    wear.edge_radius_at(file.dog.value, 1.0)  # refuses edges sharper than those of the dog
    return wear


def sleeve_of(file: StudyFile) -> Sleeve | None:
    """Build the teeth of a sleeve, None for dogs on a face; InputError for mistakes."""
    if file.dog.mount == "face":
        if file.sleeve is not None:
            raise InputError(
                "[sleeve] belongs to dog.mount = 'sleeve', and the dogs are mounted on a face; "
                "give dog.mount too, or leave [sleeve] out"
            )
        return None
    sleeve: Sleeve = Sleeve() if file.sleeve is None else file.sleeve.value
    sleeve.require_height(file.dog.value)
    return sleeve


def require_variables(study: Setup) -> None:
    """Raise InputError where the study has nothing to search, or one name for two quantities."""
    if not study.variables:
        keys = ", ".join(variable_key(key) for key in (*SHAPE, *OPERATED))
        raise InputError(f"[variables] is empty, so there is nothing to search; give one of {keys}")
    has_own_backlash = study.clutch.output_dog.backlash is not None
    is_unlike = has_own_backlash or OUTPUT_BACKLASH in study.variables
    if is_unlike and BACKLASH in study.variables and BACKLASH in study.file.search.objectives:
        raise InputError(
            f"search.objectives has {BACKLASH}, the mean of both rings, but variables.{BACKLASH} "
            "is that of the sliding ring beside another one of the output ring; bound the mean by "
            f"search.limits.{BACKLASH}, or leave the one of the output ring out"
        )


class RequestedPoint(NamedTuple):
    """Operating point that a user requests; without mismatch and force all points of the study."""

    mismatch_rpm: float | None = None
    force_N: float | None = None  #: nominal; None beside a mismatch: full force of an actuator
    force_rise_s: float | None = None  #: None: rise time of the study


ALL_POINTS = RequestedPoint()


def points_of(
    study: Setup, requested: RequestedPoint, other_way: str = ""
) -> tuple[OperatingPoint, ...]:
    """Build the operating point ``requested``, or return all of the study's.

    ``other_way`` is the verb's remedy for a force without rise time.
    """
    mismatch, force, rise = requested
    if mismatch is not None and force is None:
        force = study.actuation.full_force
    if (mismatch is None) != (force is None):
        needed = f"{argument('mismatch_rpm')} and {argument('force_N')}"
        raise InputError(f"one operating point needs {needed}; give both")
    if mismatch is None or force is None:
        return study.points
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force, rise, other_way))
    require_stiff_enough(study.clutch, point.profile.force)
    return (point,)
