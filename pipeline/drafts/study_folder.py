"""A study folder to begin with: the commented study file with values of one's own.

A study begins as a copy of another one. Values that hold for the other clutch alone are left out,
but for the height of the dogs, which keeps their shape (mean diameter over count), the force that
the blocking mechanism holds (torque over mean radius), and forces with which it shifts, which are
those of the actuator.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.pipeline.config.toml_text import sources_of, with_values
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.pipeline.drafts.sources import COMMENTED, Values, draft_folder, source_of
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.strength.materials import MATERIALS
from dogshape.sim.texts import text_of

HEAD = """\
# A study of one's own, begun from {origin}. Each key is explained; docs/studies.md has all of them.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""
DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT, COUNT = "dog.height_mm", "dog.count"
HELD = "load.separating_force_limit_N"
MASS, ADDED, TORQUE = "sliding.mass_kg", "mechanism.added_mass_kg", "load.torque_Nm"
ACTUATOR, OPERATING = "actuation.force_N", "operating.force_N"
#: Words for the keys of a clutch that are worth a question.
CLUTCH = {
    COUNT: "number of dogs",
    "dog.chamfer_deg": "chamfer of the face, deg",
    "dog.traction_deg": "side angle of the traction flank, deg",
    "dog.braking_deg": "side angle of the braking flank, deg",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    MASS: "moving mass with all that moves along, kg",
    "sliding.inertia_kgm2": "inertia of the shifted ring and what turns with it, kg m2",
    "output.inertia_kgm2": "inertia of the other side, referred to the dogs, kg m2",
}
RADIUS, DRAG, MATERIAL = "mechanism.spline_radius_mm", "mechanism.drag_torque_Nm", "material.set"
#: Words for keys whose default follows from the clutch, and of what it does and is made of.
USE = {
    HEIGHT: "height of the dogs, mm",
    TORQUE: "rated torque at the dogs, N m",
    ACTUATOR: "forces that the actuator can have, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "operating.mismatch_rpm": "mismatches at which it shifts, 1/min",
    OPERATING: "forces with which it shifts, N",
    RADIUS: "radius of the toothing that the ring slides on, mm",
    DRAG: "drag torque on the shifted ring, N m",
    MATERIAL: "material",
}
CHOICES = {MATERIAL: tuple(MATERIALS)}
RING = (*DIAMETERS, *INERTIAS)
ANY = (*RING, MASS, TORQUE, ACTUATOR)
#: Keys and tables that hold for one clutch, after the keys of the clutch that void them.
BOUND: dict[tuple[str, ...], tuple[str, ...]] = {
    RING: (
        RADIUS, DRAG, "mechanism.ring_inertia_kgm2",
        "mechanism.input_stiffness_Nm_rad", "mechanism.spline_backlash_deg",
        "mechanism.wheel_inertia_kgm2", "mechanism.output_stiffness_Nm_rad",
        "driveline.stiffness_Nm_rad",
    ),
    (MASS,): (ADDED,),
    ANY: ("strike", "load.pull_out_force_limit_N", "load.abuse_torque_Nm", "search.within_s"),
}  # fmt: skip
#: Limits of a search in units of their own are void with any of these.
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")


def write_study(
    out: Path, origin: str = COMMENTED, values: Mapping[str, Any] | None = None,
    *, force: bool = False,
) -> Values:  # fmt: skip
    """Write a folder with a commented ``study.toml``; tell what was taken over and assumed.

    ``origin`` is the study whose file is copied, or the bench whose clutch and operating points are
    taken; ``values`` by dotted key, None takes a key out. Raises InputError for what makes no
    study, all mistakes at once, and StorageError for a folder that holds files, without ``force``.
    """
    name, source = out.resolve().name, str(out / "study.toml")
    text, given, whence, said = _drafted(origin, {"name": name, **(values or {})})
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
        "assumed": [
            "what was not given is as in the file that was copied: check [load], [material], "
            "[manufacturing] and [tolerance] above all",
            *said,
        ],
        "warnings": _doubts(study),
        "operating_points": len(study.points),
        "dogs": study.clutch.dog.count,
    }


def questions_of(origin: str, values: Mapping[str, Any]) -> tuple[Values, dict[str, str]]:
    """List defaults, and words with their sources, of what a draft with ``values`` asks for."""
    source, (text, *_) = source_of(origin), _drafted(origin, values)
    tables, copied = (partial(value_at, tomllib.loads(one)) for one in (text, text_of(source.file)))
    sources, own = sources_of(text), {key: tables(key) for key in CLUTCH | USE}
    for key, value, whence in (
        (RADIUS, rounded(0.5 * SPLINE * tables(DIAMETERS[1])), f"{SPLINE:g} of the inner radius"),
        (DRAG, 0.0, "none, an assumption"),
    ):
        if own[key] is None and copied(key) is not None:
            own[key], sources[key] = value, whence
    if MASS not in values:
        del own[MASS], sources[MASS]
    found = source.dog_values | {key: value for key, value in own.items() if askable(value)}
    words = {key: (CLUTCH | USE).get(key, key) for key in found}
    said = {key: f"{words[key]} ({sources[key]})" for key in words if sources.get(key)}
    return found, words | said


def askable(value: Any) -> bool:
    """Test that a value is a number, a list of numbers or a word."""
    parts = value if isinstance(value, list) else [value]
    return all(isinstance(part, (int, float, str)) for part in parts)


def value_at(tables: Mapping[str, Any], key: str) -> Any:
    """Look up a dotted key; None where it is missing."""
    found: Any = tables
    for name in key.split("."):
        found = found.get(name) if isinstance(found, Mapping) else None
    return found


def _drafted(origin: str, values: Mapping[str, Any]) -> tuple[str, Values, str, list[str]]:
    """Return the text of a draft, the values put into it, its origin, and what was assumed."""
    source = source_of(origin)
    taken = source.dog_values | source.taken if source.taken else {}
    given, text = {**taken, **values}, text_of(source.file)
    follows, said = _following(text, given)
    whence = f"the bench data of '{source.name}'" if source.taken else f"the study '{origin}'"
    return with_values(text, {**follows, **given}), given, whence, said


def _doubts(study: Setup) -> list[str]:
    failed = [check for check in design_of(study, {}).checks if not check.passed]
    outside = [
        f"variables.{key} is [{low:g}, {high:g}], which does not hold your own {own:g}: no search "
        "can propose it; widen the range"
        for key, (low, high) in study.variables.items()
        if key in study.shape_keys and not low <= (own := study.prototype[key]) <= high
    ]
    faults = [f"your own dog fails {one.name}: {one.fault} ({one.rule.key})" for one in failed]
    return [*faults, *outside, *notes_of(study)]


def _following(text: str, given: Mapping[str, Any]) -> tuple[Values, list[str]]:
    """Compute what follows from given values: values, None to leave out; and sentences.

    Given values stay. Nothing follows from values that are none; the study refuses them.
    """
    texts = (text, with_values(text, given))
    old, new = (partial(value_at, tomllib.loads(one)) for one in texts)
    has, wants = new(ACTUATOR), new(OPERATING)
    lists = [one for one in (has, wants) if isinstance(one, list)]
    numbers = [*map(new, (COUNT, HEIGHT, *DIAMETERS)), new(TORQUE) or 1.0, *chain(*lists)]
    if not all(isinstance(one, (int, float)) and one > 0 for one in numbers):
        return {}, []
    changed = {key for key in ANY if old(key) != new(key)}
    changed |= {MASS} & set(given)  # also where all that moves is what the ring alone was
    found: Values = {}
    ring = sum(map(new, DIAMETERS)) / sum(map(old, DIAMETERS))
    if changed & set(DIAMETERS):
        found[HEIGHT] = rounded(new(HEIGHT) * ring * old(COUNT) / new(COUNT), 3)
    held = (new(TORQUE) or 1.0) / (old(TORQUE) or 1.0) / ring
    if old(HELD) and held != 1.0:
        found[HELD] = rounded(old(HELD) * held, 3)
    limits = tuple(f"search.limits.{name}" for name in old("search.limits") or ())
    void = [*BOUND.items(), (ANY, tuple(name for name in limits if name.endswith(UNITS)))]
    for by, keys in void:
        if changed & set(by):
            found |= {key: None for key in keys if old(key) is not None}
    if len(lists) == 2 and not min(has) <= min(wants) <= max(wants) <= max(has):
        found[OPERATING] = has
    found = {key: value for key, value in found.items()
             if not any(key == one or key.startswith(f"{one}.") for one in given)}  # fmt: skip
    said = {
        "follows from your clutch": [f"{k} {v}" for k, v in found.items() if v is not None],
        "left out with its default instead, limits not judged; give your own": [
            k for k, v in found.items() if v is None
        ],
    }
    return found, [f"{what}: {', '.join(those)}" for what, those in said.items() if those]
