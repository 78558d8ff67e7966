"""A study folder to begin with: the commented file of a source with values of one's own.

A study begins as a copy of another one. Values that hold for the other clutch alone are left out,
but for the height of the dogs, which keeps their shape (mean diameter over count), and forces with
which it shifts, which are those of the actuator. A value of one's own has the comment of its key in
the study that explains the keys: one of the other clutch's value would be a wrong source.
"""

from __future__ import annotations

import math
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from dogshape.diagnosis.bench.bench_data import bundled_benches, load_bench
from dogshape.pipeline.config.operating import OperatingSection, replaced_keys
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
from dogshape.sim.clutch_tables import mm_per_deg, validate
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.actuation import RiseTable
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.drive import ENGINE_SIDES
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import Tolerances
from dogshape.sim.strength.materials import MATERIALS
from dogshape.sim.texts import text_of
from dogshape.sim.units import RPM, from_si, unit_of

PUBLISHED = "mq200_stand"  #: the published clutch as its stand knows it
COMMENTED = "mq200"  #: the bundled study whose file explains its keys
HEAD = """\
# A study of one's own, begun from {origin}. The study mq200 and docs/studies.md explain the keys.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""
DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT, COUNT, BACKLASH = "dog.height_mm", "dog.count", "dog.backlash_mm"
CHAMFER, CHAMFER_BACK, CREST = "dog.chamfer_deg", "dog.chamfer_back_deg", "dog.crest"
BACKLASH_DEG = "dog.backlash_deg"
CHAMFERS = (CHAMFER, CHAMFER_BACK)
PLAY_DEVIATION, COAST = "tolerance.backlash_mm", "load.coast_share"
RELEASE = "load.faces_release"
HELD, SHARE, POINTS = "load.separating_force_limit_N", "load.pull_out_share", "operating.points"
MASS, ADDED, TORQUE = "sliding.mass_kg", "mechanism.added_mass_kg", "load.torque_Nm"
ACTUATOR, OPERATING, MISMATCH = "actuation.force_N", "operating.force_N", "operating.mismatch_rpm"
STRIKE_MISMATCH = "strike.mismatch_rpm"
#: Words for the keys of the actuator, and of the operating points, which it has to cover.
ACTUATION = {
    ACTUATOR: "final forces of the actuator, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "shift.timeout_s": "time after which the control gives up an attempt, s",
    "shift.retraction_s": "time to pull back before the next attempt, s",
}
OPERATION = {
    MISMATCH: "mismatches of the shifts, 1/min, with blanks between, or LOW to HIGH",
    OPERATING: "forces of the shifts, N, likewise",
}
#: Words for the keys of a clutch that are worth a question.
CLUTCH = {
    COUNT: "number of dogs",
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
RADIUS, DRAG, MATERIAL = "mechanism.spline_radius_mm", "mechanism.drag_torque_Nm", "material.set"
STRIKE_RING, STRIKE_SHAFT = "strike.ring_inertia_kgm2", "strike.input_stiffness_Nm_rad"
STRIKE = (STRIKE_RING, STRIKE_SHAFT)  #: keys without which no flank strike is judged
#: Keys of the same ring and shaft in the shifts.
NOMINAL = {key: key.replace("strike.", "mechanism.") for key in STRIKE}
SPEED, SIDE = "drive.shaft_speed_rpm", "drive.engine_side"
#: Words for keys whose default follows from the clutch, and of what it does and is made of.
USE = {
    HEIGHT: "height of the dogs, mm",
    ADDED: "mass of fork, rod and piston that moves along, kg",
    TORQUE: "rated torque at the dogs, N m",
    COAST: "largest torque on the braking flank (coast, recuperation, reverse) over the rated one; "
    "or in N m",
    RADIUS: "radius of the toothing that the ring slides on, of a sleeve its own teeth's, mm",
    SPEED: "speed of both shafts, on the wheels' side, 1/min, of a range its middle; "
    "0: the sliding ring stands",
    SIDE: "ring that turns with the engine",
    DRAG: "drag torque on the sliding ring, N m",
    HELD: "force of latch or detent on the engaged ring, N; 0: unknown",
    SHARE: "share of the torque at which the ring is pulled out",
    "load.shifts": "shifts over the life",
    STRIKE_RING: "inertia of the ring that strikes, kg m², one or two ends of a range; 0: unknown",
    STRIKE_SHAFT: "stiffness of the shaft behind it, N m/rad, one or two ends; 0: unknown",
    MATERIAL: "material",
}
WORDS = ACTUATION | OPERATION | CLUTCH | USE
CHOICES = {MATERIAL: tuple(MATERIALS), SIDE: ENGINE_SIDES}
RING = (*DIAMETERS, *INERTIAS)
ANY = (*RING, MASS, TORQUE, ACTUATOR)
#: Keys and tables that hold for one clutch, after the keys of the clutch that void them.
BOUND: dict[tuple[str, ...], tuple[str, ...]] = {
    RING: (
        RADIUS,
        DRAG,
        "mechanism.ring_inertia_kgm2",
        "mechanism.input_stiffness_Nm_rad",
        "mechanism.spline_backlash_deg",
        "mechanism.wheel_inertia_kgm2",
        "mechanism.output_stiffness_Nm_rad",
        "driveline.stiffness_Nm_rad",
    ),
    (MASS,): (ADDED,),
    ANY: (HELD, "strike", "load.pull_out_force_limit_N", "load.abuse_torque_Nm", "search.within_s"),
}
#: Keys and tables that decide an answer, the most influential first.
DECIDING: dict[str, tuple[str, ...]] = {
    "the shift time": (
        "shift.timeout_s",
        "shift.retraction_s",
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
        SHARE,
        HELD,
        "load.release_by_itself",
        RELEASE,
        "load.shifts",
        "load.accuracy",
        MATERIAL,
        "manufacturing.root_radius_mm",
        "dog",
    ),
}
ROOF_CREST = 0.5  #: place of the ridge of a roof tip: alike for either sign of the mismatch
#: Limits of a search in units of their own are void with any of these.
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")


@dataclass(frozen=True)
class Source:
    """A study or a bench that a draft begins from: clutch, rise of the force, operating points.

    A draft of a study is the text of ``file`` with the values of ``taken`` by dotted key.
    """

    name: str
    clutch: Clutch
    table: RiseTable
    points: tuple[OperatingPoint, ...]
    file: Path
    taken: Data

    @property
    def mismatches(self) -> list[float]:
        """Mismatches in 1/min, each once."""
        return sorted({rounded(point.mismatch / RPM) for point in self.points})

    @property
    def forces(self) -> list[float]:
        """Shift forces in N, each once."""
        return sorted({rounded(point.profile.force) for point in self.points})

    @property
    def dog_values(self) -> Data:
        """Values of ``[dog]``, ``[sliding]`` (with all that moves along) and ``[output]``."""
        tables, rings = clutch_tables(self.clutch), self.clutch.rings
        tables["sliding"]["mass_kg"] = rounded(rings.mass + self.clutch.mechanism.added_mass)
        return {f"{name}.{key}": v for name, table in tables.items() for key, v in table.items()}


def source_of(where: str) -> Source:
    """Read a study or a bench data set: file, folder or bundled name.

    Raises InputError where it is neither, or a mistake of its files.
    """
    path = Path(where)
    folder = path.parent if path.name == "bench.toml" else path
    here = (folder / "bench.toml").is_file()
    if here or where in bundled_benches():
        bench = load_bench(folder if here else where)
        tables, contact = study_of(bench, bench.name), bench.clutch.contact
        points = tuple(cell.point for cell in bench.cells)
        rises = RiseTable(*map(tuple, tables["actuation"].values()))
        taken = {
            **{f"actuation.{key}": values for key, values in tables["actuation"].items()},
            "operating": tables["operating"],
            SPEED: 0.0,
            **{f"drive.{key}": value for key, value in bench.clutch.drive.table.items()},
            "contact.static_friction": contact.static_friction,
            "contact.dynamic_friction": contact.dynamic_friction,
        }
        return Source(bench.name, bench.clutch, rises, points, find_study(COMMENTED), taken)
    if not path.exists() and where not in bundled_studies():
        raise InputError(
            f"'{where}' is no kind of clutch, no study and no bench data set; give a TOML file, a "
            f"folder with study.toml or bench.toml, mq200_stand or a kind: {bundled_kinds()}"
        )
    own = load_study(where)
    return Source(own.name, own.clutch, own.actuation.table, own.points, find_study(where), {})


def bundled_kinds() -> str:
    """List the bundled kinds of clutch with dogs, diameters and rated torque."""
    words = "{count} dogs, {outer_diameter_mm:g}/{inner_diameter_mm:g} mm, {load:g} N m"
    alike: dict[str, list[str]] = {}
    for name in bundled_studies():
        file = load_study(name).file
        ring = words.format(load=file.load.torque_Nm, **dict(file.dog))
        alike.setdefault(ring, []).append(name)
    return "; ".join(f"{', '.join(names)} ({ring})" for ring, names in alike.items())


def require_free(folder: Path, force: bool) -> None:
    """Raise StorageError where a folder holds files and nobody said to write over them."""
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"--out is {folder}, which is a file; name a folder")
    if folder.is_dir() and not force and any(folder.iterdir()):
        raise StorageError(
            f"{folder} holds files already; name another folder with --out, or write over files "
            "of the same name with --force"
        )


@contextmanager
def draft_folder(folder: Path, force: bool) -> Iterator[Path]:
    """Give a folder to fill, whose files go into ``folder`` once all of them are there."""
    require_free(folder, force)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        draft = tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent)
    except OSError as error:
        fault = f"{folder} cannot be written ({error.strerror})"
        raise StorageError(f"{fault}; name another folder with --out") from error
    with draft as part:
        # A temporary folder is its owner's alone, and modes are copied along.
        place = Path(part) / "draft"
        place.mkdir()
        yield place
        shutil.copytree(place, folder, dirs_exist_ok=True)


def write_study(
    out: Path,
    origin: str = COMMENTED,
    values: Mapping[str, Any] | None = None,
    *,
    force: bool = False,
) -> Data:
    """Write a folder with a commented ``study.toml``; return inherited and assumed values.

    ``origin`` is the study whose file is copied, or the bench whose clutch and operating points are
    taken; ``values`` by dotted key, None takes a key out. Raises InputError for what makes no
    study, all mistakes at once, and StorageError for a folder that holds files, without ``force``.
    """
    name, source = out.resolve().name, str(out / "study.toml")
    all_values = {"name": name, **(values or {})}
    text, given, whence, said = _drafted(source_of(origin), origin, all_values)
    done = re.sub(r"\A(#.*\n|\s*\n)*", "", text)  # comments on top are about the study copied
    study = build_study(validate(StudyFile, tomllib.loads(done), source))
    with draft_folder(out, force) as folder:
        (folder / "study.toml").write_text(HEAD.format(origin=whence) + done, encoding="utf-8")
    return {
        "folder": str(out),
        "file": source,
        "name": name,
        "from": whence,
        "set": {key: value for key, value in given.items() if key != "name"},
        "assumed": said,
        "warnings": _doubts(study),
        "operating_points": len(study.points),
        "dogs": study.clutch.dog.count,
    }


def check_draft(origin: str, values: Mapping[str, Any]) -> None:
    """Raise the DogshapeError of a draft that makes no study."""
    text, *_ = _drafted(source_of(origin), origin, values)
    build_study(validate(StudyFile, tomllib.loads(text), "the draft"))


def questions_of(
    origin: str, values: Mapping[str, Any], part: Mapping[str, str]
) -> tuple[Data, dict[str, str]]:
    """List defaults and questions, with sources, of a draft with ``values``.

    ``part`` is one of the tables of words. Points that are no lists are asked for as lists.
    """
    source = source_of(origin)
    text, *_ = _drafted(source, origin, values)
    tables = partial(value_at, tomllib.loads(text))
    sources, own = sources_of(text), {key: tables(key) for key in WORDS}
    points = validate(OperatingSection, tables("operating"), "[operating]").rows()
    stated = zip(OPERATION, zip(*points, strict=True), strict=False)
    own |= {key: sorted(set(v)) for key, v in stated if not isinstance(own[key], list)}
    ring = rounded(tables(MASS) * (0.25e-3 * sum(map(tables, DIAMETERS))) ** 2)
    simulated = [
        (key, value, f"as {there}") for key, there in NOMINAL.items() if (value := tables(there))
    ]
    for key, value, whence in (
        *_defaults(tables),
        *simulated,
        (CHAMFER_BACK, 0.0, ""),
        (CREST, ROOF_CREST, "an assumption"),
        (PLAY_DEVIATION, from_si(PLAY_DEVIATION, Tolerances.backlash), "an assumption"),
        (ADDED, 0.0, "none, an assumption"),
        (COAST, LoadCase.coast_share, "all of it"),
        (SPEED, 0.0, "the sliding ring stands"),
        (SIDE, "sliding", "an assumption"),
        (HELD, 0.0, "not judged"),
        (STRIKE_RING, [0.0], f"not judged; {tables(MASS):g} kg at the mean radius have {ring:g}"),
        (STRIKE_SHAFT, [0.0], "not judged"),
    ):
        if own[key] is None:
            own[key], sources[key] = value, whence
        if key in STRIKE and not isinstance(own[key], list):
            own[key] = [own[key]]
    parts = {key: value if isinstance(value, list) else [value] for key, value in own.items()}
    asked = {k: own[k] for k in own if all(isinstance(p, (int, float, str)) for p in parts[k])}
    found = source.dog_values | asked
    found = {key: found[key] for key in part if key in found}
    words = {key: f"{WORDS[key]} ({s})" if (s := sources.get(key)) else WORDS[key] for key in found}
    return found, words


def _defaults(tables: Callable[[str], Any]) -> list[tuple[str, Any, str]]:
    """List the values of keys that decide an answer and are absent, with their reasons."""
    radius = rounded(0.5 * SPLINE * tables(DIAMETERS[1]))
    found = [
        (RADIUS, radius, f"{SPLINE:g} of the inner radius"),
        (DRAG, 0.0, "none, an assumption"),
        (SHARE, 1.0, "all of it"),
    ]
    if tables(BACKLASH_DEG) is None:
        found.append((BACKLASH, 0.0, "none"))
    return [(key, value, reason) for key, value, reason in found if tables(key) is None]


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """Look up a dotted key; None where it is missing."""
    found: Any = tables
    for name in key.split("."):
        found = found.get(name) if isinstance(found, Mapping) else None
    return found


def _drafted(
    source: Source, origin: str, values: Mapping[str, Any]
) -> tuple[str, Data, str, list[str]]:
    """Compose the text of a draft; also return its values, origin and assumptions."""
    taken, whence = Data(), f"the study '{origin}'"
    if source.taken:
        taken, whence = source.dog_values | source.taken, f"the bench data of '{source.name}'"
    given, text = {**taken, **values}, text_of(source.file)
    for key in (*ACTUATION, *OPERATION):  # one value is a list of it
        if key in given and key.split(".")[0] != "shift" and type(given[key]) in (int, float):
            given[key] = [given[key]]
    _complete_strike(given, tomllib.loads(text))
    follows, said = _following(text, given)
    meanings = meanings_of(text_of(find_study(COMMENTED)))
    text = with_values(text, {**given, **follows}, meanings)
    inherited = _inherited(text, COMMENTED if source.taken else origin, {**given, **follows})
    return text, given, whence, [*inherited, *said]


def _complete_strike(given: Data, tables: Data) -> None:
    """Replace lists of one number by the number, and drop a strike of unknown ring or shaft."""
    for key in STRIKE:
        if isinstance(given.get(key), list) and len(given[key]) == 1:
            given[key] = given[key][0]
    if any(given.get(key) == 0 for key in STRIKE):
        for key in [key for key in given if key.startswith("strike.")]:
            del given[key]
        if "strike" in tables:
            given["strike"] = None


def _inherited(text: str, origin: str, own: Iterable[str]) -> list[str]:
    """List the values kept from the copied study: deciding ones first, then the others."""
    kept = {
        f"{section}.{key}": value
        for section, table in tomllib.loads(text).items()
        if isinstance(table, dict) and section not in own
        for key, value in table.items()
        if f"{section}.{key}" not in own
    }
    lines = []
    for answer, keys in DECIDING.items():
        found = dict.fromkeys(k for one in keys for k in kept if f"{k}.".startswith(f"{one}."))
        texts = (f"{key} = {toml_value(kept.pop(key))}" for key in found)
        if found:
            lines.append(f"as in '{origin}', decides {answer}: {', '.join(texts)}")
    if kept:
        others = ", ".join(f"{key} = {toml_value(value)}" for key, value in kept.items())
        lines.append(f"as in '{origin}', keys of less influence: {others}")
    if absent := _defaults(partial(value_at, tomllib.loads(text))):
        words = ", ".join(f"{key} = {value:g} ({reason})" for key, value, reason in absent)
        lines.append(f"not given, by default: {words}")
    return lines


def _doubts(study: Setup) -> list[str]:
    faults = [
        f"your own dog fails {one.name}: {one.fault}; {one.remedy}"
        for one in design_of(study, {}).faults
    ]
    outside = [
        f"variables.{key} is [{low:g}, {high:g}], which does not hold your own {own:g}: no search "
        "can propose it; widen the range"
        for key, (low, high) in study.variables.items()
        if key in study.shape_keys and not low <= (own := study.prototype[key]) <= high
    ]
    return [*faults, *outside, *notes_of(study)]


def _following(text: str, given: Mapping[str, Any]) -> tuple[Data, list[str]]:
    """Compute what follows from given values: values, None to leave out; and sentences.

    Given values stay. Nothing follows from values that are none; the study refuses them.
    """
    texts = (text, with_values(text, given))
    old, new = (partial(value_at, tomllib.loads(one)) for one in texts)
    points = (old(POINTS) or []) * (old(POINTS) == new(POINTS))
    has, wants = new(ACTUATOR), [p["force_N"] for p in points] or new(OPERATING)
    lists = [one for one in (has, wants) if isinstance(one, list)]
    numbers = [*map(new, (COUNT, HEIGHT, *DIAMETERS)), new(TORQUE) or 1.0, *chain(*lists)]
    if not all(isinstance(one, (int, float)) and one > 0 for one in numbers):
        return {}, []
    changed = {key for key in ANY if old(key) != new(key)}
    changed |= {MASS} & set(given)  # also where all that moves is what the ring alone was
    found: Data = {}
    if changed & set(DIAMETERS):
        ring = sum(map(new, DIAMETERS)) / sum(map(old, DIAMETERS))
        found[HEIGHT] = rounded(new(HEIGHT) * ring * old(COUNT) / new(COUNT), 3)
    limits = tuple(f"search.limits.{name}" for name in old("search.limits") or ())
    void = [*BOUND.items(), (ANY, tuple(name for name in limits if name.endswith(UNITS)))]
    for by, keys in void:
        if changed & set(by):
            found |= {key: None for key in keys if old(key) is not None}
    found |= _simulated_strike(given, lambda key: None if key in found else new(key))
    if len(lists) == 2 and not min(has) <= min(wants) <= max(wants) <= max(has):
        found[OPERATING] = has
        if points:  # a list of points becomes a grid
            found[MISMATCH] = sorted({point["mismatch_rpm"] for point in points})
    if "strike" in found and any(key.startswith("strike.") for key in given):
        del found["strike"]
        found |= {f"strike.{key}": None for key in old("strike")}
    spread, strikes = new(MISMATCH), new("strike") and "strike" not in found
    if strikes and isinstance(spread, dict) and {"low", "high"} <= spread.keys():
        found[STRIKE_MISMATCH] = [spread["low"], spread["high"]]  # no draw has its ends
    found |= _tip(new, changed=any(old(key) != new(key) for key in CHAMFERS))
    found |= _widened_ranges(lambda key: new(key) if key in given else found.get(key, new(key)))
    found = {
        key: value
        for key, value in found.items()
        if not any(key == one or key.startswith(f"{one}.") for one in given)
    }
    follows = ", ".join(f"{key} {value}" for key, value in found.items() if value is not None)
    lacks = ", ".join(key for key, value in found.items() if value is None)
    said = [f"follows from your clutch: {follows}"] if follows else []
    said += [f"left out, absent or unchecked until given: {lacks}"] if lacks else []
    replaced = replaced_keys({**given, **found}, tomllib.loads(texts[1]))
    said += [f"replaced by values of yours: {', '.join(replaced)}"] if replaced else []
    return found | dict.fromkeys(replaced), said


def _simulated_strike(given: Mapping[str, Any], tables: Callable[[str], Any]) -> Data:
    """Compute ring and shaft of the shifts from a given strike: the middle of its range.

    A nominal value that the strike holds stays.
    """
    found: Data = {}
    for key, there in NOMINAL.items():
        ends = given.get(key)
        ends = ends if isinstance(ends, list) else [ends]
        if not all(isinstance(end, (int, float)) and end > 0 for end in ends):
            continue
        nominal = tables(there)
        if nominal is None or not min(ends) <= nominal <= max(ends):
            found[there] = rounded(math.sqrt(min(ends) * max(ends)), 3)
    alone = len(found) == 1 and any(
        tables(there) is None for there in NOMINAL.values() if there not in found
    )
    return {} if alone else found


def _tip(tables: Callable[[str], Any], *, changed: bool) -> Data:
    """Compute what a tip decides: ridge, and whether its faces release where it ``changed``.

    A tip without a back chamfer has no ridge, a new roof has it in the middle. Flat faces wait for
    the next window, others slide.
    """
    found, crest = Data(), tables(CREST)
    chamfers = [tables(key) or 0.0 for key in CHAMFERS]
    if not all(isinstance(angle, (int, float)) for angle in chamfers):
        return found
    if chamfers[1] == 0.0 and tables(CHAMFER_BACK) is not None and crest is not None:
        found[CREST] = None
    if chamfers[1] > 0.0 and crest is None:
        found[CREST] = ROOF_CREST
    flat, releases = not any(chamfers), tables(RELEASE) is not False
    if changed and flat == releases:
        found[RELEASE] = False if flat else None
    return found


def _widened_ranges(tables: Callable[[str], Any]) -> Data:
    """Compute the ranges of a search that do not hold the own shape, widened to it."""
    found: Data = {}
    for key, (low, high) in (tables("variables") or {}).items():
        own = tables(f"dog.{key}")
        if f"dog.{key}" == BACKLASH and tables(BACKLASH_DEG) is not None:
            own = tables(BACKLASH_DEG) * mm_per_deg(*map(tables, DIAMETERS))
        if not isinstance(own, (int, float)) or low <= own <= high:
            continue
        number = type(low)
        found[f"variables.{key}"] = [
            min(low, number(math.floor(own))),
            max(high, number(math.ceil(own))),
        ]
    return found


def is_void(key: str, answers: Mapping[str, Any]) -> bool:
    """Check whether an earlier answer leaves a question without a subject."""
    part = {CREST: CHAMFER_BACK, PLAY_DEVIATION: BACKLASH}.get(key)
    return part is not None and answers.get(part) == 0


def value_of(key: str, text: str, *, default: Any, answers: Mapping[str, Any]) -> Any:
    """Read the answer to the question of a key, whose ``default`` has the kind of the value.

    A backlash may be in degrees and the torque of the braking flank in N m. A range of operating
    points is a uniform distribution, one of a list its ends. Raises InputError.
    """
    others: dict[str, float] = {}
    if key == BACKLASH and answers.keys() >= set(DIAMETERS):
        others["deg"] = mm_per_deg(*map(answers.__getitem__, DIAMETERS))
    if key == COAST and answers.get(TORQUE, 0.0) > 0.0:
        others["Nm"] = 1.0 / answers[TORQUE]
    answer = read_numbers(text, unit_of(key), others)
    numbers = [rounded(number) for number in answer.numbers]
    many = isinstance(default, (list, tuple, Mapping))
    if answer.ranged and not many:
        middle, half = 0.5 * sum(numbers), 0.5 * (numbers[1] - numbers[0])
        also = f"; its deviation of {half:g} is asked next" if key == BACKLASH else ""
        raise InputError(f"the study has one value, so give its middle {middle:g}{also}")
    if answer.ranged and key in (MISMATCH, OPERATING):
        return {"distribution": "uniform", "low": numbers[0], "high": numbers[1]}
    if many:
        return numbers
    if len(numbers) > 1:
        raise InputError("give a number")
    if isinstance(default, int) and numbers[0] != round(numbers[0]):
        raise InputError("give a whole number")
    return type(default)(numbers[0])
