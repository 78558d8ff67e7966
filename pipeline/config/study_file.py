"""Reading a study file, and building the values of ``sim`` from it.

A study is named by a TOML file, a folder with ``study.toml``, or the name of one
that the package brings. Every mistake becomes one sentence.
"""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.pipeline.config.operating import (
    ACTUATION,
    FORCE,
    OPERATED,
    Actuation,
    operated_points,
    own_set_point,
    replaced_keys,
    with_mechanism,
)
from dogshape.pipeline.config.schema import FORMAT, ContactSection, StudyFile
from dogshape.sim.clutch_tables import dog_fields, rings, validate
from dogshape.sim.elementwise import Array
from dogshape.sim.errors import DogshapeError, InputError, refusal
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint, Solver
from dogshape.sim.shift.conclusion import Engagement, require_stiff_enough
from dogshape.sim.shift.geometry import Dog
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
from dogshape.sim.texts import listed, place_of, read_toml
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root

#: Share of the entry play that may pass in a fall (judged): at 0.7 flat dogs rebound, at 0.8 skip.
SURE = 0.5
#: Searched keys of the dog in the bundled studies, and all that a study may search.
VARIABLES = ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
SHAPE = (*VARIABLES, "crest", "chamfer_back_deg", "backlash_mm")


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
        """The study in the engine of its means: compiled, unless ``solver.engine`` is given."""
        return self if self.file.solver.engine is not None else self.in_engine("planar")

    @property
    def judging(self) -> Setup | None:
        """The study in Drake, which judges the compiled engine.

        None where Drake does all of the work, or has no scheme or law for it (``SolverSection``).
        """
        clutch = self.clutch
        forced = clutch.has_forces and clutch.solver.scheme == "cenic"
        hard = clutch.contact.impact or forced
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
    def retry_text(self) -> str:
        """Cost of a failed attempt, with the keys that decide it."""
        cost = self.clutch.timeout + self.retraction
        late = " and mechanism.delay_s" if self.actuation.delay else ""
        return f"each costs shift.timeout_s and shift.retraction_s{late}, {cost:.4g} s"

    @property
    def set_point(self) -> SetPoint:
        """Set-point that frees blocked shifts; one without amplitude frees none."""
        own, late = self.file.shift.alternating, self.actuation.delay
        known = own and SetPoint(own.amplitude_rpm * RPM, own.period_s, own.after_s + late)
        return known or SetPoint()

    @property
    def forces(self) -> list[float]:
        """Shift forces of the operating points at the sleeve, each once, N."""
        return list(dict.fromkeys(point.profile.force for point in self.points))

    @property
    def operating_text(self) -> str:
        """The operating points in words."""
        every = ([point.mismatch / RPM for point in self.points], self.forces)
        ends = (dict.fromkeys((f"{min(one):g}", f"{max(one):g}")) for one in every)
        speed, force = map(" to ".join, ends)
        return f"{len(self.points)} with {speed} 1/min, {force} N at the sleeve"

    @property
    def shafts_text(self) -> str:
        """Speed of the shafts and the drive in words."""
        return f"shafts {self.clutch.drive.text}"

    @property
    def mechanism(self) -> Record:
        """Values of the shift mechanism, keys as in ``[mechanism]``; empty where there is none."""
        own = self.clutch.mechanism.record.items()
        found = {key.removeprefix("mechanism_"): value for key, value in own}
        here, none = (vars(one) for one in (self.actuation, Actuation(self.actuation.nominal)))
        return found | {k: here[name] for name, k in ACTUATION.items() if here[name] != none[name]}

    def dog_with(self, params: dict[str, float]) -> Dog:
        """Return the study's dog with other values of its keys, edge units; others count nothing.

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

    def rows(self, designs: Iterable[Mapping[str, Any]]) -> Array:
        """Return designs by name as rows in edge units, (m, d); ``named`` goes the other way."""
        rows = [[design[key] for key in self.variables] for design in designs]
        return np.array(rows, dtype=float).reshape(-1, len(self.variables))

    @property
    def prototype(self) -> dict[str, float]:
        """The searched keys at the study's own dog, edge units."""
        section = {**DEFAULTS, **self.file.dog.model_dump(), **own_set_point(self.points)}
        return {key: section[key] for key in self.variables}

    @property
    def physics(self) -> Record:
        """Everything that a shift depends on except the searched keys and the operating point.

        The rise of the force belongs to it: it follows from the final force by a table.
        """
        force, table = self.points[0].profile.record, self.actuation.table
        late = {k: v for k, v in force.items() if k not in ("force_N", "force_rise_s")}
        unsure = uncertain_record(self.uncertainty.source) if self.uncertainty else {}
        record = {**clutch_record(self.clutch), **late, **unsure}
        fixed = {key: value for key, value in record.items() if key not in self.shape_keys}
        return {**fixed, "rise_force_N": list(table.forces), "rise_s": list(table.rises)}

    @property
    def physics_hash(self) -> str:
        """Content key of ``physics``: results may be compared only where it is equal."""
        return content_key(self.physics)

    @property
    def config_hash(self) -> str:
        """Content key of the whole study file."""
        return content_key(self.file.model_dump())


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
    return _overridden(data, settings, f"{path}{' with --set' if settings else ''}")


def replace_keys(study: Setup, settings: Mapping[str, Any]) -> Setup:
    """Build a study again with values by dotted keys, None to take a key out; InputError."""
    data = study.file.model_dump(exclude_none=True)
    return _overridden(data, settings, f"the study {study.name}")


#: Keys of the ring that is a part of the sliding side.
HALF = 0.5  #: largest share of its side that a ring has where the side is made smaller (judged)
RING_KEYS = ("mechanism.ring_inertia_kgm2", "strike.ring_inertia_kgm2")


def ring_settings(data: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the inertias of the ring that shrink with a smaller ``sliding.inertia_kgm2``.

    The ring is at most half of its side, or the share that it has in the file; nominal value and
    range shrink alike. What ``settings`` give stays.
    """
    key = "sliding.inertia_kgm2"
    before, after = data.get("sliding", {}).get("inertia_kgm2"), settings.get(key)
    numbers = (int, float)
    if not isinstance(before, numbers) or not isinstance(after, numbers) or not 0 < after < before:
        return {}
    rings = dict[str, Any]()
    for ring in RING_KEYS:
        table, _, name = ring.partition(".")
        given = (data.get(table) or {}).get(name)
        if given is not None and ring not in settings and table not in settings:
            rings[ring] = given
    ends = [end for ring in rings.values() for end in (ring if isinstance(ring, list) else [ring])]
    if not ends or not all(isinstance(end, numbers) and end > 0.0 for end in ends):
        return {}
    largest = max(ends)
    share = max(HALF, largest / before) * after / largest
    if share >= 1.0:
        return {}
    return {
        key: [share * end for end in ring] if isinstance(ring, list) else share * ring
        for key, ring in rings.items()
    }


def _overridden(data: dict[str, Any], settings: Mapping[str, Any], source: str) -> Setup:
    settings = {**ring_settings(data, settings), **settings}
    for key, value in settings.items():
        override(data, key, value)
    for key in replaced_keys(settings, data):
        override(data, key, None)
    return build_study(validate(StudyFile, data, source))


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


def settings_of(given: Settings) -> dict[str, Any]:
    """Return settings as values by dotted keys."""
    return dict(given.items() if isinstance(given, Mapping) else map(pair_of, given or ()))


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
    table, last = place_of(data, key)
    if value is not None:
        table[last] = value
    elif last in table:
        del table[last]
    else:
        raise InputError(f"the study has no key {key} to take out; check the key, or leave it out")


def build_study(file: StudyFile) -> Setup:
    """Build the values of ``sim`` from a validated study file."""
    if file.format != FORMAT:
        fault = f"format is {file.format}, but this version reads format {FORMAT}"
        raise InputError(f"{fault}; convert the file or use the version that wrote it")
    _require_parts(file)
    contact, shift = file.contact.value, file.shift
    clutch = Clutch(
        dog=file.dog.value,
        rings=rings(file.sliding, file.output),
        contact=contact,
        timeout=shift.timeout_s,
        seated_tolerance=shift.seated_tolerance_mm * MM,
        rebound=shift.rebound_mm * MM,
        solver=Solver(),
        drive=file.drive.value,
    )
    rises = RiseTable(tuple(file.actuation.force_N), tuple(file.actuation.rise_s))
    parts = file.mechanism, file.effects, file.contact.si()
    clutch, actuation = with_mechanism(clutch, Actuation(rises), *parts)
    clutch = replace(clutch, solver=file.solver.solver(contact, clutch.mechanism, clutch.drive))
    points = file.operating.operating_points(actuation.profile)
    require_stiff_enough(clutch, max(point.profile.force for point in points))
    _require_slow(file, clutch, min(point.profile.force for point in points))
    unsure = _uncertainty(file, clutch, points, actuation.table)
    limits = _limits(file, clutch, points)
    variables = file.variables.ranges
    for point, factor in itertools.product(points, variables.get(FORCE, ())):
        actuation.table.profile(factor * point.profile.force, f", or narrow variables.{FORCE}")
    return Setup(file, clutch, limits, points, variables, actuation, unsure)


def _require_parts(file: StudyFile) -> None:
    """Raise the faults of all sections at once, as far as these build by themselves."""
    faults = dict[str, DogshapeError]()  # each once: what wears has a dog too
    sections = (
        *(file.dog, file.drive, file.material, file.manufacturing, file.tolerance, file.contact),
    )
    parts: tuple[Callable[[], Any], ...] = (
        partial(rings, file.sliding, file.output),
        file.require_ranges,
        partial(RiseTable, tuple(file.actuation.force_N), tuple(file.actuation.rise_s)),
        file.operating.rows,
        file.load.case,
        *(partial(getattr, one, "value") for one in sections),
        partial(wear_of, file),
        partial(getattr, file.variables, "ranges"),
    )
    for part in parts:
        try:
            part()
        except DogshapeError as error:
            faults[str(error)] = error
    if len(faults) > 1:
        raise InputError(listed(f"the study {file.name}", faults))
    for fault in faults.values():
        raise fault


def _uncertainty(
    file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint], table: RiseTable
) -> Uncertainty | None:
    """Read the uncertain quantities, None without any; their ends must be shifts that exist."""
    given = file.uncertain or ()
    found = tuple((name, one.checked(f"uncertain.{name}")) for name, one in given if one)
    if not found:
        return None
    unsure = Uncertainty(found, table)
    for end in (0, 1):
        friction, _, inertia, dissipation = (unsure.bounds(name)[end] for name in FACTORS)
        Variant(friction, 1.0, inertia, 0.1, (), dissipation).clutch(clutch)
    low, high = unsure.bounds("force_factor")
    forces = [point.profile.force for point in points]
    for force in (low * min(forces), high * max(forces)):
        table.profile(force, ", or narrow uncertain.force_factor")
    return unsure


def _limits(file: StudyFile, clutch: Clutch, points: Sequence[OperatingPoint]) -> Limits:
    """Return the limits; what the study leaves open of actuator and strike follows from points."""
    mechanism, shaken = clutch.mechanism, file.load.axial_vibration_m_s2
    more: dict[str, Any] = {
        "vibration_force": shaken * (file.sliding.mass_kg + mechanism.added_mass)
    }
    if file.contact.set == ContactSection().set:  # published sets are softer than steel
        more["contact_stiffness"] = clutch.contact.stiffness
    if mechanism.spline_friction > 0.0:
        more |= {n: getattr(mechanism, n) for n in ("spline_friction", "spline_radius")}
    if mechanism.spline_friction > 0.0 or not file.load.release_by_itself:
        more["pull_out_force_limit"] = min(point.profile.force for point in points)
    if mechanism.detent > 0.0 and mechanism.detent_seat > 0.0:
        more["separating_force_limit"] = mechanism.detent
    load = file.load.case(**more)
    load.require_spline()
    return Limits(
        load=load,
        material=file.material.value,
        manufacturing=file.manufacturing.value,
        tolerances=file.tolerance.value,
        seated_tolerance=file.shift.seated_tolerance_mm * MM,
        strikes=tuple(file.strike.at_ends(clutch, points)) if file.strike else (),
    )


def _require_slow(file: StudyFile, clutch: Clutch, force: float) -> None:
    """Raise InputError where a ring that ``force`` in N pushes is not sure to fall into a slot."""
    own, dog = file.shift.alternating, clutch.dog
    mass = clutch.rings.mass + clutch.mechanism.added_mass
    fall = math.sqrt(2.0 * mass * dog.height / force)
    most = SURE * dog.entry_play / dog.mean_radius / fall / RPM
    if own is not None and own.amplitude_rpm > most:
        rule = (
            f"{force:.6g} N push the ring {dog.height / MM:.4g} mm into a slot in "
            f"{1e3 * fall:.3g} ms, and more than {most:.4g} 1/min may throw it out again"
        )
        key = "shift.alternating.amplitude_rpm"
        raise InputError(refusal(key, own.amplitude_rpm, "1/min", rule, "lower it"))


def wear_of(file: StudyFile) -> Wear | None:
    """Build what wears the dogs; None for a study that does not say. InputError for mistakes."""
    wear: Wear | None = None if file.wear is None else file.wear.value
    if wear is not None:
        wear.edges(file.dog.value, 1.0)
    return wear


def require_variables(study: Setup) -> None:
    """Raise InputError where the study has nothing to search."""
    if not study.variables:
        keys = ", ".join((*SHAPE, *OPERATED))
        raise InputError(f"[variables] is empty, so there is nothing to search; give one of {keys}")


#: Mismatch in 1/min, nominal force in N and, None for the study's own, rise time in s of one
#: operating point; None for all of a study's.
Place = tuple[float | None, float | None, float | None]
EVERYWHERE: Place = (None, None, None)
OWN_RISE = ", or give --force-rise-s"  #: remedy for a force that the study's table lacks


def points_of(study: Setup, place: Place, other_way: str = "") -> tuple[OperatingPoint, ...]:
    """Return the one operating point that is asked for, or all of the study's.

    ``other_way`` is the verb's remedy for a force without rise time.
    """
    mismatch, force, rise = place
    if (mismatch is None) != (force is None):
        raise InputError("one operating point needs --mismatch-rpm and --force-N; give both")
    if mismatch is None or force is None:
        return study.points
    point = OperatingPoint(mismatch * RPM, study.actuation.profile(force, rise, other_way))
    require_stiff_enough(study.clutch, point.profile.force)
    return (point,)
