"""A study folder to begin with: the commented study file with values of one's own.

A study begins as a copy of another one. Values that hold for the other clutch alone are left out,
but for the height of the dogs, which keeps their shape (mean diameter over count), the force that
the blocking mechanism holds (torque over mean radius), and forces with which it shifts, which are
those of the actuator.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, load_study, override
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.diagnose.study_keys import rounded
from dogshape.pipeline.drafts.sources import Values, draft_folder, source_of
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import InputError
from dogshape.sim.texts import text_of
from dogshape.sim.versions import bundled_root

COMMENTED = "mq200"  #: the bundled study whose file explains its keys
HEAD = """\
# A study of one's own, begun from {origin}. Each key is explained; docs/studies.md has all of them.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""
DIAMETERS = ("dog.outer_diameter_mm", "dog.inner_diameter_mm")
INERTIAS = ("sliding.inertia_kgm2", "output.inertia_kgm2")
HEIGHT = "dog.height_mm"
HELD = "load.separating_force_limit_N"
MASS, ADDED, TORQUE = "sliding.mass_kg", "mechanism.added_mass_kg", "load.torque_Nm"
ACTUATOR, OPERATING = "actuation.force_N", "operating.force_N"
#: Words for the keys of a clutch that are worth a question.
CLUTCH = {
    "dog.count": "number of dogs",
    "dog.chamfer_deg": "chamfer of the face, deg",
    "dog.traction_deg": "side angle of the traction flank, deg",
    "dog.braking_deg": "side angle of the braking flank, deg",
    HEIGHT: "height of the dogs, mm",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    MASS: "moving mass with all that moves along, kg",
    "sliding.inertia_kgm2": "inertia of the shifted ring and what turns with it, kg m2",
    "output.inertia_kgm2": "inertia of the other side, referred to the dogs, kg m2",
}
#: Words for the keys of what a study's clutch has to do, and of what it is made of.
USE = {
    TORQUE: "rated torque at the dogs, N m",
    ACTUATOR: "forces that the actuator can have, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "operating.mismatch_rpm": "mismatches at which it shifts, 1/min",
    OPERATING: "forces with which it shifts, N",
    "mechanism.spline_friction": "friction in the toothing that the ring slides on",
    "mechanism.spline_radius_mm": "radius of that toothing, mm",
    "mechanism.drag_torque_Nm": "drag torque on the shifted ring, N m",
    "material.set": "material",
    "manufacturing.tip_width_mm": "narrowest tip that may be made, mm",
    "manufacturing.slot_width_mm": "narrowest slot that may be made, mm",
}
#: Keys and tables that hold for one clutch, each with the keys of the clutch that void it.
BOUND = {
    "mechanism.spline_radius_mm": DIAMETERS,
    ADDED: (MASS,),
    "mechanism.drag_torque_Nm": (*DIAMETERS, *INERTIAS),
    "mechanism.ring_inertia_kgm2": INERTIAS,
    "mechanism.input_stiffness_Nm_rad": INERTIAS,
    "mechanism.spline_backlash_deg": INERTIAS,
    "mechanism.wheel_inertia_kgm2": INERTIAS,
    "mechanism.output_stiffness_Nm_rad": INERTIAS,
    "driveline.stiffness_Nm_rad": (*DIAMETERS, *INERTIAS),
    "strike": (*DIAMETERS, *INERTIAS, TORQUE),
    "load.pull_out_force_limit_N": (ACTUATOR,),
    "load.abuse_torque_Nm": (TORQUE,),
    "search.within_s": (*DIAMETERS, *INERTIAS, MASS, ACTUATOR),
}
#: Limits of a search in units of their own are void with any of these.
ANY = (*DIAMETERS, *INERTIAS, MASS, TORQUE, ACTUATOR)
UNITS = ("_s", "_N", "_mm", "_Nm", "_Ns", "_J")


def write_study(
    out: Path, origin: str = COMMENTED, values: Mapping[str, Any] | None = None,
    *, force: bool = False,
) -> Values:  # fmt: skip
    """Write a folder with a commented ``study.toml``; tell what was taken over and assumed.

    Parameters
    ----------
    origin : study whose file is copied, or bench whose clutch and operating points are taken.
    values : values by dotted key; None takes a key out.

    Raises
    ------
    InputError
        For an origin or values that make no study, all mistakes at once.
    StorageError
        For a folder that holds files, without ``force``.
    """
    name = out.resolve().name
    if not name or not all(letter.isalnum() or letter in "_.-" for letter in name):
        raise InputError(
            f"--out ends in '{name}', but a study's name has letters, digits, '_', '.' and '-' "
            "alone; name the folder so"
        )
    text, taken, whence = _begun(origin)
    given = {**taken, **(values or {})}
    follows, said = _following(text, given)
    lines = text.splitlines()  # comments above the first key are about the study that is copied
    first = next((k for k, line in enumerate(lines) if line and not line.startswith("#")), 0)
    body = "\n".join(lines[first:]) + "\n"
    done = with_values(body, {"name": name, **follows, **given})
    source = f"{out / 'study.toml'}"
    study = build_study(validate(StudyFile, tomllib.loads(done), source))
    with draft_folder(out, force) as folder:
        (folder / "study.toml").write_text(HEAD.format(origin=whence) + done, encoding="utf-8")
    return {
        "folder": str(out),
        "file": source,
        "name": name,
        "from": whence,
        "set": given,
        "assumed": [
            "what was not given is as in the file that was copied: check [load], [material], "
            "[manufacturing] and [tolerance] above all",
            *said,
        ],
        "warnings": _doubts(study),
        "operating_points": len(study.points),
        "dogs": study.clutch.dog.count,
    }


def use_of(origin: str, values: Mapping[str, Any]) -> Values:
    """List the askable values that a draft with ``values`` would have at the keys of ``USE``."""
    text, taken, _ = _begun(origin)
    given = {**taken, **values}
    tables = _with({**_following(text, given)[0], **given}, text)
    found = {key: value_at(tables, key) for key in USE}
    return {key: value for key, value in found.items() if askable(value)}


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


def _with(values: Mapping[str, Any], text: str) -> Values:
    tables = tomllib.loads(text)
    for key, value in values.items():
        override(tables, key, value)
    return tables


def _begun(origin: str) -> tuple[str, Values, str]:
    """Return the text to begin with, values to put into it, and where they are from."""
    path = Path(origin)
    file = path / "study.toml" if path.is_dir() else path
    if file.name == "bench.toml" or not file.is_file():
        file = bundled_root() / origin / "study.toml"
    if file.is_file():
        load_study(file)  # refuses what is no study, with its mistakes
        return text_of(file), {}, f"the study '{origin}'"
    source = source_of(origin)
    contact, rises = source.clutch.contact, sorted(dict(source.rises).items())
    if len(rises) == 1:  # a table needs two forces to lie between
        rises.append((rises[0][0] * 1.01, rises[0][1]))
    values = {
        **source.dog_values,
        "contact.static_friction": contact.static_friction,
        "contact.dynamic_friction": contact.dynamic_friction,
        ACTUATOR: [rounded(force) for force, _ in rises],
        "actuation.rise_s": [rounded(rise) for _, rise in rises],
        "operating.mismatch_rpm": source.mismatches,
        OPERATING: source.forces,
    }
    text = text_of(bundled_root() / COMMENTED / "study.toml")
    return text, values, f"the bench data of '{source.name}'"


def _doubts(study: Setup) -> list[str]:
    failed = [check for check in design_of(study, {}).checks if not check.passed]
    outside = [
        f"variables.{key} is [{low:g}, {high:g}], which does not hold your own {own:g}: no search "
        "can propose it; widen the range"
        for key, (low, high) in study.variables.items()
        if key in study.shape_keys and not low <= (own := study.prototype[key]) <= high
    ]
    faults = [f"your own dog fails {one.name}: {one.fault} ({one.rule.key})" for one in failed]
    if faults:
        faults.append("a search compares with a reference that breaks these limits")
    return [*faults, *outside, *notes_of(study)]


def _following(text: str, given: Mapping[str, Any]) -> tuple[Values, list[str]]:
    """Compute what follows from given values in a study file: values, None to leave out; and
    sentences. Given values stay.
    """
    origin, own = tomllib.loads(text), _with(given, text)
    count, height, outer, inner = (value_at(own, key) for key in ("dog.count", HEIGHT, *DIAMETERS))
    has, wants = (value_at(own, key) for key in (ACTUATOR, OPERATING))
    torque, before = (value_at(tables, TORQUE) for tables in (own, origin))
    numbers = [count, height, outer, inner, *([] if torque is None else [torque])]
    for one in (has, wants):
        numbers += one if isinstance(one, list) else []
    if not all(isinstance(one, (int, float)) and one > 0 for one in numbers):
        return {}, []  # what is wrong is said by the study
    limits = value_at(origin, "search.limits") or {}
    bound = BOUND | {f"search.limits.{name}": ANY for name in limits if name.endswith(UNITS)}
    changed = {key for by in bound.values() for key in by
               if value_at(origin, key) != value_at(own, key)}  # fmt: skip
    changed |= {MASS} & set(given)  # also where all that moves is what the ring alone was
    found: Values = {}
    ring = (outer + inner) / sum(value_at(origin, key) for key in DIAMETERS)
    if changed & set(DIAMETERS):
        found[HEIGHT] = rounded(height * ring * value_at(origin, "dog.count") / count, 3)
    if (held := value_at(origin, HELD)) and torque and before and torque / before != ring:
        found[HELD] = rounded(held * torque / before / ring, 3)
    found |= {key: None for key, by in bound.items()
              if changed & set(by) and value_at(origin, key) is not None}  # fmt: skip
    lists = has and wants and isinstance(has, list) and isinstance(wants, list)
    if lists and not min(has) <= min(wants) <= max(wants) <= max(has):
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
