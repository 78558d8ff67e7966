"""Draft of a study folder: the commented file of a source study with the values of the user.

A study begins as a copy of another one. Values that hold for the other clutch alone are left out;
the height of the dogs scales with their pitch, and forces of the operating points beyond the
actuator become the actuator's. A new value has the comment of its key in the study that explains
the keys, as the copied comment would be a wrong source.
"""

from __future__ import annotations

import math
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

from dogshape.bench.bench_data import Bench, bundled_benches, load_bench
from dogshape.bench.texts import text_of
from dogshape.pipeline.config.operating import KIND, OperatingSection, replaced_keys
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import (
    Setup,
    build_study,
    bundled_studies,
    find_study,
    load_study,
)
from dogshape.pipeline.config.toml_text import meanings_of, sources_of, toml_value, with_values
from dogshape.pipeline.diagnose.study_keys import Data, clutch_tables, rounded, study_of
from dogshape.pipeline.drafts.answers import read_numbers
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.clutch_tables import DogSection, mm_per_deg, validate
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.interface import argument
from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.actuators import (
    EXAMPLES,
    KINDS,
    PROFILE,
    Actuator,
    actuator_of,
    keys_of,
    optional_values,
    required_keys,
)
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.drive import ENGINE_SIDES
from dogshape.sim.shift.geometry import Mount
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import Tolerances
from dogshape.sim.strength.materials import MATERIALS
from dogshape.sim.units import RPM, from_si, to_si, unit_of

COMMENTED = "mq200"  #: bundled study whose file explains the keys
LookUp = Callable[[str], Any]  #: returns the value of a dotted key, None for a missing one
HEAD = """\
# A study of one's own, begun from {origin}. The study mq200 and docs/studies.md explain the keys.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""
DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT = "dog.height_mm"
HEIGHT_RANGE = "variables.height_mm"
COUNT = "dog.count"
MOUNT = "dog.mount"
RIM = "manufacturing.rim_mm"
BACKLASH = "dog.backlash_mm"
BACKLASH_DEG = "dog.backlash_deg"
CHAMFER = "dog.chamfer_deg"
CHAMFER_BACK = "dog.chamfer_back_deg"
CHAMFERS = (CHAMFER, CHAMFER_BACK)
CREST = "dog.crest"
PLAY_DEVIATION = "tolerance.backlash_mm"
TORQUE = "load.torque_Nm"
COAST = "load.coast_share"
RELEASE = "load.faces_release"
HOLDING_FORCE = "load.separating_force_limit_N"
PULL_OUT_SHARE = "load.pull_out_share"
MASS = "sliding.mass_kg"
ADDED_MASS = "mechanism.added_mass_kg"
ACTUATOR = "actuation.force_N"
OPERATING = "operating.force_N"
MISMATCH = "operating.mismatch_rpm"
POINTS = "operating.points"
POINT_SET = "operating.set"
STRIKE_MISMATCH = "strike.mismatch_rpm"
#: Words for the kind of the actuator, which decides its other keys.
ACTUATOR_KIND = {KIND: "kind of the actuator; profile: a force over time"}
#: Words for the numbers of the kinds.
ACTUATOR_NUMBERS = {
    "actuation.preload_N": "preload of the spring at the start of the travel, N",
    "actuation.rate_N_mm": "rate of the spring, N/mm",
    "actuation.start_force_N": "force of the magnet at the start of its stroke, N",
    "actuation.end_force_N": "force of the magnet at the end of its stroke, N",
    "actuation.stroke_mm": "stroke of groove or magnet, mm",
    "actuation.voltage_V": "voltage on the coil, V",
    "actuation.resistance_ohm": "resistance of the warm coil, ohm",
    "actuation.inductance_mH": "inductance of the coil at the start of the stroke, mH",
    "actuation.rated_current_A": "current of both forces, A; 0: voltage over resistance",
    "actuation.ramp_deg": "angle of the drum over which the groove rises, deg",
    "actuation.dwell_deg": "angle of the drum before the groove rises, deg",
    "actuation.drum_speed_rpm": "speed of the drum, 1/min",
    "actuation.stall_torque_Nm": "stall torque of the motor, N m",
    "actuation.no_load_speed_rpm": "no-load speed of the motor, 1/min",
    "actuation.torque_limit_Nm": "torque limit of the motor's control, N m",
    "actuation.rotor_inertia_kgm2": "inertia of rotor and gear at the motor, kg m²",
    "actuation.gear_ratio": "gear ratio, motor over spindle or pinion",
    "actuation.lead_mm": "travel of the fork per revolution of spindle or pinion, mm",
    "actuation.efficiency": "efficiency of gear and spindle",
    "actuation.stiffness_N_mm": "stiffness between drum or spindle and fork, N/mm",
    "actuation.force_limit_N": "largest force that the drive of the drum gives the fork, N",
    "actuation.supply_bar": "supply pressure above the ambient one, bar",
    "actuation.area_cm2": "area of the piston, cm²",
    "actuation.dead_volume_cm3": "volume behind the piston at the start, with pipes, cm³",
    "actuation.conductance_dm3_s_bar": "sonic conductance of the valve (ISO 6358), dm³/(s bar)",
    "actuation.critical_ratio": "critical pressure ratio of the valve (ISO 6358)",
    "actuation.flow_l_min": "rated flow of the valve, l/min",
    "actuation.drop_bar": "pressure drop of the rated flow, bar",
    "actuation.bulk_modulus_MPa": "bulk modulus of the oil with its air, MPa",
    "actuation.back_pressure_bar": "pressure on the back of the piston, bar; 0: none",
    "actuation.back_area_cm2": "area of the back of the piston, cm²; 0: no pressure there",
    "actuation.return_preload_N": "preload of the return spring, N; 0: none",
    "actuation.return_rate_N_mm": "rate of the return spring, N/mm",
}
#: Words for the keys of the actuator.
ACTUATION = {
    **ACTUATOR_NUMBERS,
    ACTUATOR: "final forces of the actuator, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "shift.timeout_s": "time after which the control gives up an attempt, s",
    "shift.retraction_s": "time to pull back before the next attempt, s",
}
#: Words for the keys of the operating points, whose forces the actuator must reach.
OPERATION = {
    MISMATCH: "mismatches of the shifts, 1/min, with blanks between, or LOW to HIGH",
    OPERATING: "forces of the shifts, N, likewise",
}
#: Words for the keys of a clutch that a dialogue asks for.
CLUTCH = {
    COUNT: "number of dogs",
    MOUNT: "root of the dogs: face of a ring, or sleeve for teeth rooted radially",
    RIM: "thickness of the sleeve outside its teeth, mm; 0: unknown",
    CHAMFER: "chamfer of the face, deg; 0: flat",
    CHAMFER_BACK: "chamfer behind the ridge of a roof tip, deg; 0: no roof",
    CREST: "place of the ridge on the tip, 0 braking edge to 1 traction edge",
    "dog.traction_deg": "side angle of the traction flank, deg; below 0: undercut",
    "dog.braking_deg": "side angle of the braking flank, deg; below 0: undercut",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    BACKLASH: "backlash of the seated pair at the mean radius, mm; or in deg",
    PLAY_DEVIATION: "largest deviation of the backlash either way, mm",
    "dog.edge_radius_mm": "radius of the tip edges, mm",
    MASS: "mass of the sliding ring, kg",
    "sliding.inertia_kgm2": "inertia of the sliding ring and all that turns with it, kg m²",
    "output.inertia_kgm2": "inertia of the output side, referred to the dogs, kg m²",
}
RADIUS = "mechanism.spline_radius_mm"
DRAG = "mechanism.drag_torque_Nm"
MATERIAL = "material.set"
STRIKE_RING = "strike.ring_inertia_kgm2"
STRIKE_SHAFT = "strike.input_stiffness_Nm_rad"
STRIKE = (STRIKE_RING, STRIKE_SHAFT)  #: keys without which no flank strike is judged
#: Keys of the same ring and shaft in the shifts.
NOMINAL = {key: key.replace("strike.", "mechanism.") for key in STRIKE}
SPEED = "drive.shaft_speed_rpm"
SIDE = "drive.engine_side"
#: Words for the use of the clutch, and for keys whose default follows from it.
USE = {
    HEIGHT: "height of the dogs, mm",
    ADDED_MASS: "mass of fork, rod and piston that moves along, kg",
    TORQUE: "rated torque at the dogs, N m",
    COAST: "largest torque on the braking flank (coast, recuperation, reverse) over the rated one; "
    "or in N m",
    RADIUS: "radius of the toothing that the ring slides on, of a sleeve its own teeth's, mm",
    SPEED: "speed of both shafts, on the wheels' side, 1/min, of a range its middle; "
    "0: the sliding ring stands",
    SIDE: "ring that turns with the engine",
    DRAG: "drag torque on the sliding ring, N m",
    HOLDING_FORCE: "force of latch or detent on the engaged ring, N; 0: unknown",
    PULL_OUT_SHARE: "share of the torque at which the ring is pulled out",
    "load.shifts": "shifts over the life",
    STRIKE_RING: "inertia of the ring that strikes, kg m², one or two ends of a range; 0: unknown",
    STRIKE_SHAFT: "stiffness of the shaft behind it, N m/rad, one or two ends; 0: unknown",
    MATERIAL: "material",
}
WORDS = ACTUATOR_KIND | ACTUATION | OPERATION | CLUTCH | USE
CHOICES = {
    KIND: (PROFILE, *KINDS),
    MATERIAL: tuple(MATERIALS),
    SIDE: ENGINE_SIDES,
    MOUNT: get_args(Mount),
}
#: Keys of which one value may stand for a list.
LIST_KEYS = (ACTUATOR, "actuation.rise_s", *OPERATION)
RING = (*DIAMETERS, *INERTIAS)
CLUTCH_KEYS = (*RING, MASS, TORQUE, KIND, ACTUATOR)
#: Keys and tables that hold for one clutch, by the keys of the clutch that void them.
BOUND_KEYS: dict[tuple[str, ...], tuple[str, ...]] = {
    RING: (
        RADIUS,
        DRAG,
        "sleeve.tooth_height_mm",
        "mechanism.ring_inertia_kgm2",
        "mechanism.input_stiffness_Nm_rad",
        "mechanism.spline_backlash_deg",
        "mechanism.wheel_inertia_kgm2",
        "mechanism.output_stiffness_Nm_rad",
        "driveline.stiffness_Nm_rad",
    ),
    (MASS,): (ADDED_MASS,),
    CLUTCH_KEYS: (
        HOLDING_FORCE,
        "strike",
        "load.pull_out_force_limit_N",
        "load.abuse_torque_Nm",
        "search.within_s",
    ),
}
#: Keys and tables that decide an answer, the most influential first.
DECIDING: dict[str, tuple[str, ...]] = {
    "the shift time": (
        "shift.timeout_s",
        "shift.retraction_s",
        KIND,
        *ACTUATION,
        *OPERATION,
        "operating",
        COUNT,
        BACKLASH,
        BACKLASH_DEG,
        "dog.axial_gap_mm",
        MASS,
        "drive",
        "mechanism",
        *CHAMFERS,
        *INERTIAS,
        "contact",
    ),
    "the checks": (
        TORQUE,
        "load.application_factor",
        COAST,
        PULL_OUT_SHARE,
        HOLDING_FORCE,
        "load.release_by_itself",
        RELEASE,
        "load.shifts",
        "load.accuracy",
        MATERIAL,
        "manufacturing.root_radius_mm",
        "dog",
    ),
}
ROOF_CREST = 0.5  #: ridge of a roof tip in the middle, for either sign of the mismatch
#: Units of the absolute limits of a search, which are void for another clutch.
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")


@dataclass(frozen=True)
class Source:
    """A study or a bench from which a draft begins."""

    name: str
    clutch: Clutch
    table: RiseTable  #: rise time of the shift force
    points: tuple[OperatingPoint, ...]
    file: Path  #: study file whose text the draft copies
    bench_values: Data  #: values of a bench by dotted key; empty for a study

    @property
    def is_bench(self) -> bool:
        """Whether the source is a bench."""
        return bool(self.bench_values)

    @property
    def mismatches(self) -> list[float]:
        """Distinct mismatches, 1/min."""
        return sorted({rounded(point.mismatch / RPM) for point in self.points})

    @property
    def forces(self) -> list[float]:
        """Distinct shift forces, N."""
        return sorted({rounded(point.profile.force) for point in self.points})

    @property
    def dog_values(self) -> Data:
        """Values of ``[dog]``, ``[sliding]`` (with the total moving mass) and ``[output]``."""
        tables = clutch_tables(self.clutch)
        moving_mass = self.clutch.rings.mass + self.clutch.mechanism.added_mass
        tables["sliding"]["mass_kg"] = rounded(moving_mass)
        values: Data = {}
        for name, table in tables.items():
            values |= {f"{name}.{key}": value for key, value in table.items()}
        return values


def source_of(origin: str) -> Source:
    """Load a study or a bench data set: file, folder or bundled name.

    Raises InputError if it is neither, or for a mistake of its files.
    """
    path = Path(origin)
    folder = path.parent if path.name == "bench.toml" else path
    is_bench_folder = (folder / "bench.toml").is_file()
    if is_bench_folder or origin in bundled_benches():
        return _bench_source(load_bench(folder if is_bench_folder else origin))
    if not path.exists() and origin not in bundled_studies():
        raise InputError(
            f"'{origin}' is no kind of clutch, no study and no bench data set; give a TOML file, a "
            f"folder with study.toml or bench.toml, mq200_stand or a kind: {bundled_kinds()}"
        )
    study = load_study(origin)
    return Source(
        study.name,
        study.clutch,
        study.actuation.table,
        points=study.points,
        file=find_study(origin),
        bench_values={},
    )


def _bench_source(bench: Bench) -> Source:
    """Return the source of a draft with the clutch and the operating points of a bench."""
    tables = study_of(bench, bench.name)
    contact = bench.clutch.contact
    values = {
        **{f"actuation.{key}": column for key, column in tables["actuation"].items()},
        "operating": tables["operating"],
        SPEED: 0.0,
        **{f"drive.{key}": value for key, value in bench.clutch.drive.table.items()},
        "contact.static_friction": contact.static_friction,
        "contact.dynamic_friction": contact.dynamic_friction,
    }
    return Source(
        bench.name,
        bench.clutch,
        RiseTable(*map(tuple, tables["actuation"].values())),
        points=tuple(cell.point for cell in bench.cells),
        file=find_study(COMMENTED),
        bench_values=values,
    )


def bundled_kinds() -> str:
    """List the bundled kinds of clutch with dogs, diameters and rated torque."""
    words = "{count} dogs, {outer_diameter_mm:g}/{inner_diameter_mm:g} mm, {load:g} N m"
    names_by_ring: dict[str, list[str]] = {}
    for name in bundled_studies():
        file = load_study(name).file
        ring = words.format(load=file.load.torque_Nm, **dict(file.dog))
        names_by_ring.setdefault(ring, []).append(name)
    return "; ".join(f"{', '.join(names)} ({ring})" for ring, names in names_by_ring.items())


def require_free(folder: Path, force: bool) -> None:
    """Raise StorageError if a folder holds files, unless ``force`` allows to write over them."""
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"{argument('out')} is {folder}, which is a file; name a folder")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise StorageError(
            f"{folder} holds files already; name another folder with {argument('out')}, or write "
            f"over files of the same name with {argument('force')}"
        )


@contextmanager
def draft_folder(folder: Path, force: bool) -> Iterator[Path]:
    """Yield an empty folder; on success its files are copied to ``folder``."""
    require_free(folder, force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft = tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent)
    except OSError as error:
        fault = f"{folder} cannot be written ({error.strerror})"
        raise StorageError(f"{fault}; name another folder with {argument('out')}") from error
    with draft as part:
        # A temporary folder is private, and modes are copied along.
        place = Path(part) / "draft"
        place.mkdir()
        yield place
        shutil.copytree(place, folder, dirs_exist_ok=True)


@dataclass(frozen=True)
class WrittenStudy:
    """Written folder of a study, with inherited and assumed values."""

    folder: Path
    name: str
    origin: str  #: study or bench that it begins from, in words
    values: Data  #: set values by dotted key; None for a removed key
    assumed: list[str]  #: sentences on inherited and derived values
    warnings: list[str]
    points: int  #: number of operating points
    dogs: int  #: number of dogs of a ring

    @property
    def file(self) -> Path:
        """The study file."""
        return self.folder / "study.toml"

    def to_dict(self) -> Data:
        """Convert to values of JSON."""
        return {
            "folder": str(self.folder),
            "file": str(self.file),
            "name": self.name,
            "from": self.origin,
            "set": self.values,
            "assumed": self.assumed,
            "warnings": self.warnings,
            "operating_points": self.points,
            "dogs": self.dogs,
        }


def write_study(
    out: Path,
    origin: str = COMMENTED,
    values: Mapping[str, Any] | None = None,
    *,
    force: bool = False,
) -> WrittenStudy:
    """Write a folder with a commented ``study.toml``.

    ``origin`` is the study whose file is copied, or the bench whose clutch and operating points are
    used; ``values`` by dotted key, None removes a key. Raises one InputError for all mistakes of
    the study, StorageError for a folder that holds files, without ``force``.
    """
    name = out.resolve().name
    draft = _draft_of(source_of(origin), origin, {"name": name, **(values or {})})
    text = re.sub(r"\A(#.*\n|\s*\n)*", "", draft.text)  # the head comments are on the copied study
    study = build_study(validate(StudyFile, tomllib.loads(text), str(out / "study.toml")))
    with draft_folder(out, force) as folder:
        head = HEAD.format(origin=draft.origin)
        (folder / "study.toml").write_text(head + text, encoding="utf-8")
    return WrittenStudy(
        folder=out,
        name=name,
        origin=draft.origin,
        values={key: value for key, value in draft.values.items() if key != "name"},
        assumed=draft.notes,
        warnings=_warnings_of(study),
        points=len(study.points),
        dogs=study.clutch.dog.count,
    )


def check_draft(origin: str, values: Mapping[str, Any]) -> None:
    """Raise the DogshapeError of a draft that makes no study."""
    draft = _draft_of(source_of(origin), origin, values)
    build_study(validate(StudyFile, tomllib.loads(draft.text), "the draft"))


def questions_of(
    origin: str, values: Mapping[str, Any], part: Mapping[str, str]
) -> tuple[Data, dict[str, str]]:
    """Return defaults and questions, both by key, of a draft with ``values``.

    ``part`` is one of the tables of words. A question contains the source of its default. Points
    that are no lists are asked for as lists.
    """
    source = source_of(origin)
    text = _draft_of(source, origin, values).text
    look_up = partial(value_at, tomllib.loads(text))
    sources = sources_of(text)
    defaults = {key: look_up(key) for key in WORDS}
    actuator = _draft_actuator(look_up, {})
    full_force = None if actuator is None else actuator.full_force
    points = validate(OperatingSection, look_up("operating"), "[operating]").rows(full_force)
    for key, column in zip(OPERATION, zip(*points, strict=True), strict=False):
        if not isinstance(defaults[key], list):
            defaults[key] = sorted(set(column))
    for key, value, reason in (*_defaults(look_up), *_default_answers(look_up)):
        if defaults[key] is None:
            defaults[key] = value
            sources[key] = reason
        if key in STRIKE and not isinstance(defaults[key], list):
            defaults[key] = [defaults[key]]
    answers = source.dog_values
    answers |= {key: value for key, value in defaults.items() if _is_answer(value)}
    answers = {key: answers[key] for key in part if key in answers}
    questions = {}
    for key in answers:
        words = WORDS[key]
        questions[key] = f"{words} ({sources[key]})" if sources.get(key) else words
    return answers, questions


def _is_answer(value: Any) -> bool:
    """Test whether a value can be typed: a number, a text, or a list of these."""
    parts = value if isinstance(value, list) else [value]
    return all(isinstance(part, (int, float, str)) for part in parts)


def _default_answers(look_up: LookUp) -> list[tuple[str, Any, str]]:
    """List keys with the default that a question shows if the file has none, and its reason."""
    answers = []
    for key, nominal_key in NOMINAL.items():
        nominal = look_up(nominal_key)
        if nominal:
            answers.append((key, nominal, f"as {nominal_key}"))
    mass = look_up(MASS)
    mean_radius = 0.25e-3 * sum(map(look_up, DIAMETERS))
    ring_inertia = rounded(mass * mean_radius**2)
    ring_note = f"not judged; {mass:g} kg at the mean radius have {ring_inertia:g}"
    return [
        *answers,
        (KIND, PROFILE, ""),
        *_actuator_defaults(look_up(KIND)),
        (MOUNT, DogSection.model_fields["mount"].default, ""),
        (RIM, 0.0, "not judged"),
        (CHAMFER_BACK, 0.0, ""),
        (CREST, ROOF_CREST, "an assumption"),
        (PLAY_DEVIATION, from_si(PLAY_DEVIATION, Tolerances.backlash), "an assumption"),
        (ADDED_MASS, 0.0, "none, an assumption"),
        (COAST, LoadCase.coast_share, "all of it"),
        (SPEED, 0.0, "the sliding ring stands"),
        (SIDE, "sliding", "an assumption"),
        (HOLDING_FORCE, 0.0, "not judged"),
        (STRIKE_RING, [0.0], ring_note),
        (STRIKE_SHAFT, [0.0], "not judged"),
    ]


def _actuator_defaults(kind: str | None) -> list[tuple[str, Any, str]]:
    """List the optional keys of a kind of actuator with their defaults."""
    if kind not in KINDS:
        return []
    return [(f"actuation.{key}", value, "") for key, value in optional_values(kind).items()]


def _draft_actuator(look_up: LookUp, derived: Mapping[str, Any]) -> Actuator | None:
    """Build the actuator of a draft; None for a profile or a fault."""
    kind = look_up(KIND)
    if kind not in KINDS:
        return None
    numbers = {}
    for key in keys_of(kind):
        value = derived.get(f"actuation.{key}", look_up(f"actuation.{key}"))
        if isinstance(value, (int, float)):
            numbers[key] = to_si(key, value)
    with suppress(InputError):
        return actuator_of(kind, numbers)
    return None


def _defaults(look_up: LookUp) -> list[tuple[str, Any, str]]:
    """List the absent keys that decide an answer, with their defaults and the reasons."""
    radius = rounded(0.5 * SPLINE * look_up(DIAMETERS[1]))
    defaults = [
        (RADIUS, radius, f"{SPLINE:g} of the inner radius"),
        (DRAG, 0.0, "none, an assumption"),
        (PULL_OUT_SHARE, 1.0, "all of it"),
    ]
    if look_up(BACKLASH_DEG) is None:
        defaults.append((BACKLASH, 0.0, "none"))
    return [(key, value, reason) for key, value, reason in defaults if look_up(key) is None]


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """Look up a dotted key; None if it is missing."""
    value: Any = tables
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


@dataclass(frozen=True)
class _Draft:
    """Text of a study file with its values by dotted key, its origin and notes for the user."""

    text: str
    values: Data
    origin: str  #: in words
    notes: list[str]  #: on inherited and derived values


def _draft_of(source: Source, origin: str, user_values: Mapping[str, Any]) -> _Draft:
    """Compose the draft of a study from its source and the values of the user."""
    origin_words = f"the study '{origin}'"
    values = dict(user_values)
    if source.is_bench:
        origin_words = f"the bench data of '{source.name}'"
        values = {**source.dog_values, **source.bench_values, **user_values}
    text = text_of(source.file)
    for key in LIST_KEYS:
        if type(values.get(key)) in (int, float):
            values[key] = [values[key]]
    _complete_strike(values, tomllib.loads(text))
    derived, notes = _derive_values(text, values)
    all_values = {**values, **derived}
    draft_text = with_values(text, all_values, meanings_of(text_of(find_study(COMMENTED))))
    copied_study = COMMENTED if source.is_bench else origin
    inherited = _notes_on_inherited(draft_text, copied_study, all_values)
    return _Draft(draft_text, values, origin=origin_words, notes=[*inherited, *notes])


def _complete_strike(values: Data, tables: Data) -> None:
    """Replace lists of one number by the number; drop a strike of unknown ring or shaft."""
    for key in STRIKE:
        if isinstance(values.get(key), list) and len(values[key]) == 1:
            values[key] = values[key][0]
    if any(values.get(key) == 0 for key in STRIKE):
        for key in [key for key in values if key.startswith("strike.")]:
            del values[key]
        if "strike" in tables:
            values["strike"] = None


def _notes_on_inherited(text: str, origin: str, new_keys: Iterable[str]) -> list[str]:
    """List the values inherited from the copied study: those that decide answers first."""
    tables = tomllib.loads(text)
    inherited = {}
    for section, table in tables.items():
        if not isinstance(table, dict) or section in new_keys:
            continue
        for name, value in table.items():
            if f"{section}.{name}" not in new_keys:
                inherited[f"{section}.{name}"] = value
    notes = []
    for answer, deciding in DECIDING.items():
        keys = [key for stem in deciding for key in inherited if _is_under(key, stem)]
        texts = [f"{key} = {toml_value(inherited.pop(key))}" for key in dict.fromkeys(keys)]
        if texts:
            notes.append(f"as in '{origin}', decides {answer}: {', '.join(texts)}")
    if inherited:
        texts = [f"{key} = {toml_value(value)}" for key, value in inherited.items()]
        notes.append(f"as in '{origin}', keys of less influence: {', '.join(texts)}")
    defaults = _defaults(partial(value_at, tables))
    if defaults:
        texts = [f"{key} = {value:g} ({reason})" for key, value, reason in defaults]
        notes.append(f"not given, by default: {', '.join(texts)}")
    return notes


def _is_under(key: str, stem: str) -> bool:
    """Test whether a dotted key is ``stem`` or lies in the table ``stem``."""
    return f"{key}.".startswith(f"{stem}.")


def _warnings_of(study: Setup) -> list[str]:
    """Describe failed checks, search ranges without the draft's dog, and implausible values."""
    warnings = [
        f"your own dog fails {check.name}: {check.fault}; {check.remedy}"
        for check in design_of(study, {}).faults
    ]
    for key, (low, high) in study.variables.items():
        value = study.prototype[key]
        if key in study.shape_keys and not low <= value <= high:
            warnings.append(
                f"variables.{key} is [{low:g}, {high:g}], which does not hold your own {value:g}: "
                "no search can propose it; widen the range"
            )
    return [*warnings, *notes_of(study)]


@dataclass(frozen=True)
class _Change:
    """Values of a study before and after the change of some keys."""

    values: Mapping[str, Any]  #: given values by dotted key
    before: LookUp
    after: LookUp
    keys: frozenset[str]  #: keys of ``CLUTCH_KEYS`` that changed

    def differs(self, key: str) -> bool:
        """Test whether the value of a key changed."""
        return bool(self.before(key) != self.after(key))

    def gives_strike(self) -> bool:
        """Test whether a key of the strike has a given value."""
        return any(key.startswith("strike.") for key in self.values)


def _derive_values(text: str, values: Mapping[str, Any]) -> tuple[Data, list[str]]:
    """Derive the values that follow from the given ones; None removes a key. Return notes too.

    Given values stay. Nothing follows from invalid values, which the study refuses.
    """
    tables = tomllib.loads(with_values(text, values))
    before = partial(value_at, tomllib.loads(text))
    after = partial(value_at, tables)
    changed_keys = {key for key in CLUTCH_KEYS if before(key) != after(key)}
    changed_keys |= {MASS} & set(values)  # even if all moving mass equals that of the ring before
    change = _Change(values, before, after, keys=frozenset(changed_keys))
    if not _has_valid_numbers(change):
        return {}, []
    derived: Data = {}
    for rule in RULES:
        rule(change, derived)
    derived = {
        key: value
        for key, value in derived.items()
        if not any(_is_under(key, given_key) for given_key in values)
    }
    replaced = replaced_keys({**values, **derived}, tables)
    notes = _notes_on_derived(derived, replaced)
    return derived | dict.fromkeys(replaced), notes


def _notes_on_derived(derived: Data, replaced: Sequence[str]) -> list[str]:
    """Describe derived, removed and replaced keys."""
    examples = {
        key: value
        for key, value in derived.items()
        if key in ACTUATOR_NUMBERS and value is not None
    }
    texts = [
        f"{key} {value}"
        for key, value in derived.items()
        if value is not None and key not in examples
    ]
    removed = [key for key, value in derived.items() if value is None]
    notes = []
    if texts:
        notes.append(f"follows from your clutch: {', '.join(texts)}")
    if examples:
        example_texts = [f"{key} {value:g}" for key, value in examples.items()]
        notes.append(f"an example, give your actuator's: {', '.join(example_texts)}")
    if removed:
        notes.append(f"left out, absent or unchecked until given: {', '.join(removed)}")
    if replaced:
        notes.append(f"replaced by values of yours: {', '.join(replaced)}")
    return notes


def _listed_points(change: _Change) -> list[Data]:
    """Return the operating points that a study lists, unless the change replaces them."""
    return [] if change.differs(POINTS) else change.before(POINTS) or []


def _required_forces(change: _Change) -> Any:
    """Return the forces of the operating points: a list, or another form of the file."""
    points = _listed_points(change)
    return [point["force_N"] for point in points] or change.after(OPERATING)


def _has_valid_numbers(change: _Change) -> bool:
    """Test whether the numbers that the rules use are positive numbers."""
    numbers = [change.after(key) for key in (COUNT, HEIGHT, *DIAMETERS)]
    numbers.append(change.after(TORQUE) or 1.0)
    for forces in (change.after(ACTUATOR), _required_forces(change)):
        if isinstance(forces, list):
            numbers += forces
    return all(isinstance(number, (int, float)) and number > 0 for number in numbers)


def _scale_height(change: _Change, derived: Data) -> None:
    """Scale the height with the pitch, so that dogs of another diameter keep their shape."""
    if change.keys & set(DIAMETERS):
        diameter_ratio = sum(map(change.after, DIAMETERS)) / sum(map(change.before, DIAMETERS))
        count_before, count = change.before(COUNT), change.after(COUNT)
        height = change.after(HEIGHT) * diameter_ratio * count_before / count
        derived[HEIGHT] = rounded(height, 3)


def _remove_bound_values(change: _Change, derived: Data) -> None:
    """Remove values of the copied clutch, and absolute limits of the search."""
    names = change.before("search.limits") or ()
    limits = tuple(f"search.limits.{name}" for name in names if name.endswith(UNITS))
    for changing_keys, bound_keys in (*BOUND_KEYS.items(), (CLUTCH_KEYS, limits)):
        if change.keys & set(changing_keys):
            derived |= {key: None for key in bound_keys if change.before(key) is not None}


def _set_simulated_strike(change: _Change, derived: Data) -> None:
    """Set ring and shaft of the shifts to the middle of a given strike's range.

    A nominal value within the range stays, and both stay if only one would be known.
    """

    def nominal_value(key: str) -> Any:
        return None if key in derived else change.after(key)

    middles: Data = {}
    for key, nominal_key in NOMINAL.items():
        value = change.values.get(key)
        ends = value if isinstance(value, list) else [value]
        if not all(isinstance(end, (int, float)) and end > 0 for end in ends):
            continue
        nominal = nominal_value(nominal_key)
        if nominal is None or not min(ends) <= nominal <= max(ends):
            middles[nominal_key] = rounded(math.sqrt(min(ends) * max(ends)), 3)
    other_keys = [key for key in NOMINAL.values() if key not in middles]
    is_alone = len(middles) == 1 and any(nominal_value(key) is None for key in other_keys)
    if not is_alone:
        derived |= middles


def _complete_actuator(change: _Change, derived: Data) -> None:
    """Add the numbers that a kind of actuator lacks, those of an example."""
    kind = change.after(KIND)
    if kind not in KINDS:
        return
    example = record_quantities(EXAMPLES[kind])
    for key in required_keys(kind):
        if change.after(f"actuation.{key}") is None:
            derived[f"actuation.{key}"] = rounded(example[key])


def _limit_forces(change: _Change, derived: Data) -> None:
    """Limit the forces of the operating points to the range of the actuator's."""
    actuator = _draft_actuator(change.after, derived)
    if actuator is not None:
        _limit_to_actuator(change, derived, actuator.full_force)
        return
    available = change.after(ACTUATOR)
    required = _required_forces(change)
    if not isinstance(available, list) or not isinstance(required, list):
        return
    if min(available) <= min(required) <= max(required) <= max(available):
        return
    derived[OPERATING] = available
    points = _listed_points(change)
    if points:  # a list of points becomes a grid
        derived[MISMATCH] = sorted({point["mismatch_rpm"] for point in points})


def _limit_to_actuator(change: _Change, derived: Data, full_force: float) -> None:
    """Set the forces of the operating points to the full one, N, for a new kind or beyond it."""
    required = _required_forces(change)
    is_within = isinstance(required, list) and max(required) <= full_force
    if is_within and not change.differs(KIND):
        return
    if isinstance(required, Mapping) and not change.differs(KIND):
        return
    if change.values.keys() & {POINTS, POINT_SET}:
        return
    derived[OPERATING] = [math.floor(100.0 * full_force) / 100.0]
    if change.after(MISMATCH) is None:  # a list or a set of points becomes a grid
        operating = validate(OperatingSection, change.after("operating"), "[operating]")
        derived[MISMATCH] = sorted({mismatch for mismatch, *_ in operating.rows(full_force)})


def _keep_given_strike(change: _Change, derived: Data) -> None:
    """Remove the values of the old strike one by one if the new one has values."""
    if "strike" in derived and change.gives_strike():
        del derived["strike"]
        derived |= {f"strike.{key}": None for key in change.before("strike")}


def _set_strike_mismatch(change: _Change, derived: Data) -> None:
    """Set the mismatch of a strike to the ends of a distribution, which no draw reaches."""
    mismatch = change.after(MISMATCH)
    has_strike = change.after("strike") and "strike" not in derived
    if has_strike and isinstance(mismatch, dict) and {"low", "high"} <= mismatch.keys():
        derived[STRIKE_MISMATCH] = [mismatch["low"], mismatch["high"]]


def _remove_sleeve(change: _Change, derived: Data) -> None:
    """Remove the sleeve of a copied study from dogs on a face, unless its keys are given."""
    gives_sleeve = any(key.startswith("sleeve") for key in change.values)
    if change.after(MOUNT) != "sleeve" and change.before("sleeve") and not gives_sleeve:
        derived["sleeve"] = None


def _complete_tip(change: _Change, derived: Data) -> None:
    """Add or remove the ridge of a roof, and decide whether changed faces must release.

    A tip without a back chamfer has no ridge, a new roof has it in the middle. Flat faces wait for
    the next window, others slide.
    """
    chamfers = [change.after(key) or 0.0 for key in CHAMFERS]
    if not all(isinstance(angle, (int, float)) for angle in chamfers):
        return
    crest = change.after(CREST)
    has_back = chamfers[1] > 0.0
    if chamfers[1] == 0.0 and change.after(CHAMFER_BACK) is not None and crest is not None:
        derived[CREST] = None
    if has_back and crest is None:
        derived[CREST] = ROOF_CREST
    is_flat = not any(chamfers)
    must_release = change.after(RELEASE) is not False
    if any(map(change.differs, CHAMFERS)) and is_flat == must_release:
        derived[RELEASE] = False if is_flat else None


def _widen_ranges(change: _Change, derived: Data) -> None:
    """Widen the ranges of a search that exclude the dog of the study."""

    def look_up(key: str) -> Any:
        return change.after(key) if key in change.values else derived.get(key, change.after(key))

    ranges: Data = {}
    for key, (low, high) in (look_up("variables") or {}).items():
        value = look_up(f"dog.{key}")
        if f"dog.{key}" == BACKLASH and look_up(BACKLASH_DEG) is not None:
            value = look_up(BACKLASH_DEG) * mm_per_deg(*map(look_up, DIAMETERS))
        if not isinstance(value, (int, float)) or low <= value <= high:
            continue
        kind = type(low)
        new_low = min(low, kind(math.floor(value)))
        new_high = max(high, kind(math.ceil(value)))
        ranges[f"variables.{key}"] = [new_low, new_high]
    derived |= ranges


def _limit_height(change: _Change, derived: Data) -> None:
    """Limit the range of the height to the travel of an actuator that the dog is within."""
    actuator = _draft_actuator(change.after, derived)
    height_range = derived.get(HEIGHT_RANGE, change.after(HEIGHT_RANGE))
    forces = derived.get(OPERATING, change.after(OPERATING))
    if actuator is None or not isinstance(height_range, list):
        return
    force = min(forces) if isinstance(forces, list) else actuator.full_force
    max_height = 1e3 * actuator.reach(force) - change.after("dog.axial_gap_mm")
    max_height = math.floor(100.0 * max_height) / 100.0 if math.isfinite(max_height) else math.inf
    height: float = derived.get(HEIGHT) or change.after(HEIGHT)
    if height <= max_height < height_range[1]:
        derived[HEIGHT_RANGE] = [min(height_range[0], max_height), max_height]


#: Rules that derive values from a change, in this order; each updates the derived values.
RULES: tuple[Callable[[_Change, Data], None], ...] = (
    _scale_height,
    _remove_bound_values,
    _set_simulated_strike,
    _complete_actuator,
    _limit_forces,
    _keep_given_strike,
    _set_strike_mismatch,
    _remove_sleeve,
    _complete_tip,
    _widen_ranges,
    _limit_height,
)


def is_void(key: str, answers: Mapping[str, Any]) -> bool:
    """Test whether an earlier answer leaves a question without a subject."""
    if key == RIM:
        return answers.get(MOUNT) != "sleeve"
    part = {CREST: CHAMFER_BACK, PLAY_DEVIATION: BACKLASH}.get(key)
    return part is not None and answers.get(part) == 0


def value_of(key: str, text: str, *, default: Any, answers: Mapping[str, Any]) -> Any:
    """Read the answer to the question of a key, as a value of the kind of its ``default``.

    A backlash may be in degrees and the torque of the braking flank in N m. A range of operating
    points is a uniform distribution, one of a list its ends. Raises InputError.
    """
    factors: dict[str, float] = {}
    if key == BACKLASH and answers.keys() >= set(DIAMETERS):
        factors["deg"] = mm_per_deg(*map(answers.__getitem__, DIAMETERS))
    if key == COAST and answers.get(TORQUE, 0.0) > 0.0:
        factors["Nm"] = 1.0 / answers[TORQUE]
    answer = read_numbers(text, unit_of(key), factors)
    numbers = [rounded(number) for number in answer.numbers]
    takes_list = isinstance(default, (list, tuple, Mapping))
    if answer.ranged and not takes_list:
        middle = 0.5 * sum(numbers)
        half_width = 0.5 * (numbers[1] - numbers[0])
        sentence = f"the study has one value, so give its middle {middle:g}"
        if key == BACKLASH:
            sentence += f"; its deviation of {half_width:g} is asked next"
        raise InputError(sentence)
    if answer.ranged and key in (MISMATCH, OPERATING):
        return {"distribution": "uniform", "low": numbers[0], "high": numbers[1]}
    if takes_list:
        return numbers
    if len(numbers) > 1:
        raise InputError("give a number")
    if isinstance(default, int) and numbers[0] != round(numbers[0]):
        raise InputError("give a whole number")
    return type(default)(numbers[0])
