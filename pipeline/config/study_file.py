"""Reading a study file, and building the values of ``sim`` from it.

A study is named by a TOML file, a folder with ``study.toml``, or the name of one
that the package brings. Every mistake becomes one sentence.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dogshape.pipeline.config.mechanism import mechanism_record, with_mechanism
from dogshape.pipeline.config.operating import (
    OPERATED,
    Actuation,
    operated_points,
    own_set_point,
    require_ranges,
)
from dogshape.pipeline.config.schema import FORMAT, StudyFile
from dogshape.sim.clutch_tables import dog_fields, rings, validate
from dogshape.sim.errors import InputError, refusal, require_between
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Solver
from dogshape.sim.shift.conclusion import Engagement, require_stiff_enough
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.loads import torque_peak
from dogshape.sim.statistics.shift_records import (
    Record,
    clutch_record,
    content_key,
    uncertain_record,
)
from dogshape.sim.statistics.uncertainty import FACTORS, Uncertainty, Variant
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.wear import Wear
from dogshape.sim.texts import read_toml
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root

VARIABLES = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")


@dataclass(frozen=True)
class Setup:
    """Values that a study file stands for: what is built, how it is operated and what is searched.

    ``variables`` maps each searched key of the dog to its range, in edge units; ``clutch`` has
    the mechanism and what effects make of the contact, ``actuation`` the way of the shift force;
    ``uncertainty`` is None where nothing but the relative angle is uncertain. ``operation`` has the
    searched keys of the operation, of the study as one design is operated; empty otherwise.
    """

    file: StudyFile
    clutch: Clutch
    limits: Limits
    points: tuple[OperatingPoint, ...]
    variables: dict[str, tuple[float, float]]
    actuation: Actuation
    uncertainty: Uncertainty | None = None
    operation: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.file.name

    @property
    def shape_keys(self) -> tuple[str, ...]:
        """The searched keys of the dog; the others say how it is operated."""
        return tuple(key for key in self.variables if key not in OPERATED)

    @property
    def searches_operation(self) -> bool:
        """Whether set-point, force or rise time are searched too."""
        return len(self.shape_keys) < len(self.variables)

    def operated(self, params: Mapping[str, float]) -> Setup:
        """Return the study as a design is operated: its own points, and limits that follow."""
        given = {key: params[key] for key in OPERATED if key in params}
        if not given:
            return self
        points = operated_points(self.points, self.actuation, given)
        limits = _limits(self.file, self.clutch, points)
        return replace(self, points=points, limits=limits, operation=given)

    @property
    def working(self) -> Setup:
        """The study in the engine of its means, search and fit.

        That is the compiled engine, unless ``solver.engine`` names another.
        """
        return self if self.file.solver.engine is not None else self.in_engine("planar")

    @property
    def judging(self) -> Setup | None:
        """The study in Drake, which judges the compiled engine.

        None where Drake does all of the work, and for forces of a mechanism that Drake's scheme
        cannot follow (``pipeline.config.schema.SolverSection``).
        """
        solver = self.clutch.solver
        hard = self.clutch.mechanism.has_forces and solver.scheme == "cenic"
        return None if hard or self.file.solver.engine == "drake" else self.in_engine("drake")

    def in_engine(self, engine: str) -> Setup:
        """Return the study in an engine, ``drake`` or ``planar``, at that engine's accuracy."""
        if engine == self.clutch.solver.engine:
            return self
        return replace(self, clutch=self.clutch.with_engine(engine))

    @property
    def retraction(self) -> float:
        """Time to pull back before a retry, s, and the dead time of that."""
        return self.file.shift.retraction_s + self.actuation.delay

    @property
    def mismatches(self) -> list[float]:
        """Mismatches of the operating points, each once, 1/min."""
        return self._axes[0]

    @property
    def forces(self) -> list[float]:
        """Shift forces of the operating points at the sleeve, each once, N."""
        return [self.actuation.factor * force for force in self._axes[1]]

    @property
    def operating_text(self) -> str:
        """The operating points in words, with the nominal forces."""
        return self.file.operating.text(self._axes, len(self.points))

    @property
    def _axes(self) -> list[list[float]]:
        return self.file.operating.axes(self.points, self.actuation.factor)

    @property
    def mechanism(self) -> Record:
        """Values of the shift mechanism, keys as in ``[mechanism]``; empty where there is none."""
        return mechanism_record(self.clutch, self.actuation)

    def dog_with(self, params: dict[str, float]) -> Dog:
        """Return the study's dog with some keys replaced, given in edge units.

        Keys that say how it is operated are left out.
        Raises InputError or GeometryError where there is no such dog.
        """
        shape = {key: value for key, value in params.items() if key not in OPERATED}
        return replace(self.clutch.dog, **dog_fields(shape))

    def torque_peak(self, shift: Engagement) -> float | None:
        """Compute the largest torque of the driveline in a shift, N m; None without stiffness."""
        stiffness = self.file.driveline.stiffness_Nm_rad
        return None if stiffness is None else torque_peak(shift.clutch, shift.trace, stiffness)

    def named(self, values: Iterable[float]) -> dict[str, float]:
        """Return values of the searched keys by name, the count as a whole number."""
        pairs = zip(self.variables, values, strict=True)
        return {key: round(v) if key == "count" else float(v) for key, v in pairs}

    def rows(self, designs: Iterable[Mapping[str, Any]]) -> NDArray[np.float64]:
        """Return designs by name as rows in edge units, (m, d); ``named`` goes the other way."""
        rows = [[design[key] for key in self.variables] for design in designs]
        return np.array(rows, dtype=float).reshape(-1, len(self.variables))

    @property
    def prototype(self) -> dict[str, float]:
        """The searched keys at the study's own dog, edge units."""
        section = {**self.file.dog.model_dump(), **own_set_point(self.points)}
        return {key: section[key] for key in self.variables}

    @property
    def physics(self) -> Record:
        """Everything that a shift depends on except the searched keys and the operating point.

        The rise of the force belongs to it: it follows from the final force by a table.
        """
        unsure = uncertain_record(self.uncertainty.source) if self.uncertainty else {}
        record = {**clutch_record(self.clutch), **self.actuation.record, **unsure}
        return physics_of(record, list(self.shape_keys), self.actuation.table)

    @property
    def physics_hash(self) -> str:
        """Content key of ``physics``: results may be compared only where it is equal."""
        return content_key(self.physics)

    @property
    def config_hash(self) -> str:
        """Content key of the whole study file."""
        return content_key(self.file.model_dump())


def physics_of(record: Record, variables: Sequence[str], table: RiseTable) -> Record:
    """Collect the fields of ``record`` beside the variables, and the rise table.

    ``record`` is that of a clutch, with dead time and lag of the force and with the distributions
    of what is uncertain.
    """
    fixed = {key: value for key, value in record.items() if key not in variables}
    return {**fixed, "rise_force_N": list(table.forces), "rise_s": list(table.rises)}


def load_study(
    where: str | Path, overrides: Iterable[str] | Mapping[str, Any] | None = None
) -> Setup:
    """Read and validate a study.

    Parameters
    ----------
    where : TOML file, folder with ``study.toml`` or name of a bundled study.
    overrides : ``KEY=VALUE`` with dotted keys, later ones win, ``KEY=`` takes the key out; or
        values by dotted keys, None likewise.

    Raises
    ------
    InputError
        With the file, the key, the value and the rule.
    """
    path = find_study(where)
    try:
        data = read_toml(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path") from error
    pairs = overrides.items() if isinstance(overrides, Mapping) else map(pair_of, overrides or ())
    source = str(path)
    for key, value in pairs:
        override(data, key, value)
        source = f"{path} with --set"
    return build_study(validate(StudyFile, data, source))


def replace_keys(study: Setup, settings: Mapping[str, Any]) -> Setup:
    """Build a study again with values by dotted keys, None to take a key out; InputError."""
    data = study.file.model_dump(exclude_none=True)
    for key, value in settings.items():
        override(data, key, value)
    return build_study(validate(StudyFile, data, f"the study {study.name}"))


def find_study(where: str | Path) -> Path:
    """Return the study file that ``where`` names."""
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


def pair_of(text: str) -> tuple[str, Any]:
    """Read ``KEY=VALUE``, the value as TOML or else as text; None for no value."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text} is not KEY=VALUE; write for instance dog.chamfer_deg=14")
    try:
        read = tomllib.loads(f"v = {value}")
    except tomllib.TOMLDecodeError:
        read = {"v": value.strip() or None}
    if set(read) != {"v"}:
        raise InputError(f"--set {key.strip()} holds more than one value; give one --set a key")
    return key.strip(), read["v"]


def override(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a study file's tables; None takes it out."""
    *tables, last = key.split(".")
    table = data
    for name in tables:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            wrong = f"--set {key}={value}: {name} is a value and not a table"
            raise InputError(f"{wrong}; check the key")
    if value is not None:
        table[last] = value
    elif last in table:
        del table[last]
    else:
        raise InputError(f"the study has no key {key} to take out; check the key, or leave it out")


def build_study(file: StudyFile) -> Setup:
    """Build the values of ``sim`` from a validated study file."""
    if file.format != FORMAT:
        raise InputError(
            f"format is {file.format}, but this version reads format {FORMAT}; "
            "convert the file or use the version that wrote it"
        )
    contact, shift = file.contact.contact, file.shift
    shift.require()
    file.driveline.require()
    wear_of(file)
    clutch = Clutch(
        dog=file.dog.dog(),
        rings=rings(file.sliding, file.output),
        contact=contact,
        timeout=shift.timeout_s,
        seated_tolerance=shift.seated_tolerance_mm * MM,
        rebound=shift.rebound_mm * MM,
        solver=Solver(),
    )
    actuation, parts = Actuation(file.actuation.table), (file.mechanism, file.effects)
    clutch, actuation = with_mechanism(clutch, actuation, *parts, file.contact.own)
    clutch = replace(clutch, solver=file.solver.solver(contact, clutch.mechanism))
    points = file.operating.operating_points(actuation.profile)
    require_stiff_enough(clutch, max(point.profile.force for point in points))
    unsure = _uncertainty(file, clutch, points, actuation.table)
    limits = _limits(file, clutch, points)
    variables = file.variables.ranges
    require_ranges(points, actuation, variables)
    return Setup(file, clutch, limits, points, variables, actuation, unsure)


def _uncertainty(
    file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint], table: RiseTable
) -> Uncertainty | None:
    """Read the uncertain quantities, None without any; their ends must be shifts that exist."""
    given = [] if file.uncertain is None else [*file.uncertain]
    found = tuple(section.named(f"uncertain.{name}") for name, section in given if section)
    if not found:
        return None
    unsure = Uncertainty(found, table)
    for end in (0, 1):
        friction, _, inertia, dissipation = (unsure.bounds(name)[end] for name in FACTORS)
        Variant(friction, 1.0, inertia, 0.1, (), dissipation).clutch(clutch)
    low, high = unsure.bounds("force_factor")
    forces = [point.profile.force for point in points]
    for force in (low * min(forces), high * max(forces)):
        if not unsure.rise.covers(force):
            remedy = "extend actuation.force_N and rise_s, or narrow uncertain.force_factor"
            name = "shift force by its factor"
            raise InputError(refusal(name, force, "N", table.range_rule, remedy))
    return unsure


def _limits(file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint]) -> Limits:
    """Return the limits; what the study leaves open of actuator and strike follows from points."""
    load, mechanism = file.load.case, clutch.mechanism
    shaken = file.load.axial_vibration_m_s2
    remedy = "leave it out where nothing shakes the ring"
    require_between("load.axial_vibration_m_s2", shaken, 0.0, 1e4, remedy)
    load = replace(load, vibration_force=shaken * (file.sliding.mass_kg + mechanism.added_mass))
    if mechanism.spline_friction > 0.0:
        spline = {n: getattr(mechanism, n) for n in ("spline_friction", "spline_radius")}
        load = replace(load, **spline)
    if load.spline_friction > 0.0 or not load.release_by_itself:
        force = load.pull_out_force_limit or max(point.profile.force for point in points)
        load = replace(load, pull_out_force_limit=force)
    strike = None
    if file.strike is not None:
        strike = file.strike.strike(file.sliding, file.output, points)
    return Limits(
        load=load,
        material=file.material.material,
        manufacturing=file.manufacturing.limits,
        tolerances=file.tolerance.tolerances,
        seated_tolerance=file.shift.seated_tolerance_mm * MM,
        strike=strike,
    )


def wear_of(file: StudyFile) -> Wear | None:
    """Build what wears the dogs; None for a study that does not say."""
    return None if file.wear is None else file.wear.wear(file.dog.dog())


def require_variables(study: Setup) -> None:
    """Raise InputError where the study has nothing to search."""
    if not study.variables:
        names = ", ".join((*VARIABLES, *OPERATED))
        raise InputError(
            f"[variables] is empty, so there is nothing to search; give one of {names}"
        )


def point_of(
    study: Setup, mismatch: float, force: float, rise: float | None, other_way: str = ""
) -> OperatingPoint:
    """Return an operating point from 1/min, nominal N and a rise time in s, None for the study's.

    ``other_way`` is what the verb offers for a force that the study's table lacks.
    """
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force, rise, other_way))
    require_stiff_enough(study.clutch, point.profile.force)
    return point


def points_of(
    study: Setup,
    mismatch: float | None,
    force: float | None,
    rise: float | None = None,
    other_way: str = "",
) -> tuple[OperatingPoint, ...]:
    """Return the one operating point that is asked for, or all of the study's."""
    if (mismatch is None) != (force is None):
        raise InputError("one operating point needs --mismatch-rpm and --force-N; give both")
    if mismatch is None or force is None:
        return study.points
    return (point_of(study, mismatch, force, rise, other_way),)
