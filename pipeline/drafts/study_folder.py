"""A study folder to begin with: the commented study file with values of one's own."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, load_study, override
from dogshape.pipeline.config.toml_text import with_values
from dogshape.pipeline.drafts.own_clutch import Row, following, value_at
from dogshape.pipeline.drafts.sources import Source, source_of
from dogshape.pipeline.drafts.targets import drafted
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import InputError
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.texts import text_of
from dogshape.sim.versions import bundled_root

COMMENTED = "mq200"  #: the bundled study whose file explains its keys
HEAD = """\
# A study of one's own, begun from {origin}. Each key is explained; docs/studies.md has all of them.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""


#: Words for the keys of a clutch that are worth a question.
CLUTCH = {
    "dog.count": "number of dogs",
    "dog.chamfer_deg": "chamfer of the face, deg",
    "dog.traction_deg": "side angle of the traction flank, deg",
    "dog.braking_deg": "side angle of the braking flank, deg",
    "dog.height_mm": "height of the dogs, mm",
    "dog.outer_diameter_mm": "outer diameter of the dogs, mm",
    "dog.inner_diameter_mm": "inner diameter of the dogs, mm",
    "dog.axial_gap_mm": "axial gap between the crests before the shift, mm",
    "sliding.mass_kg": "moving mass with all that moves along, kg",
    "sliding.inertia_kgm2": "inertia of the shifted ring and what turns with it, kg m2",
    "output.inertia_kgm2": "inertia of the other side, referred to the dogs, kg m2",
}
#: Words for the keys of what a study's clutch has to do, and of what it is made of.
USE = {
    "load.torque_Nm": "rated torque at the dogs, N m",
    "actuation.force_N": "forces that the actuator can have, N, with blanks between",
    "actuation.rise_s": "rise time of each of these forces, s",
    "operating.mismatch_rpm": "mismatches at which it shifts, 1/min",
    "operating.force_N": "forces with which it shifts, N",
    "mechanism.spline_friction": "friction in the toothing that the ring slides on",
    "mechanism.spline_radius_mm": "radius of that toothing, mm",
    "mechanism.drag_torque_Nm": "drag torque on the shifted ring, N m",
    "material.set": "material",
    "manufacturing.tip_width_mm": "narrowest tip that may be made, mm",
    "manufacturing.slot_width_mm": "narrowest slot that may be made, mm",
}


def write_study(
    out: Path, origin: str = COMMENTED, values: Mapping[str, Any] | None = None,
    *, force: bool = False,
) -> Row:  # fmt: skip
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
    name = _name_of(out)
    text, taken, whence, base = _begun(origin)
    given = {**taken, **(values or {})}
    follows, said = _following(text, given)
    done = with_values(_without_head(text), {"name": name, **follows, **given})
    source = f"{out / 'study.toml'}"
    study = build_study(validate(StudyFile, tomllib.loads(done), source))
    with drafted(out, force) as folder:
        (folder / "study.toml").write_text(HEAD.format(origin=whence) + done, encoding="utf-8")
    return {
        "folder": str(out),
        "file": source,
        "name": name,
        "from": whence,
        "set": given,
        "assumed": [*_kept_of(text, {**follows, **given}, base), *said],
        "warnings": _doubts(study),
        "operating_points": len(study.points),
        "dogs": study.clutch.dog.count,
    }


def use_of(origin: str, values: Mapping[str, Any]) -> Row:
    """List the askable values that a draft with ``values`` would have at the keys of ``USE``."""
    text, taken, _, _ = _begun(origin)
    given = {**taken, **values}
    tables = tomllib.loads(text)
    for key, value in {**_following(text, given)[0], **given}.items():
        override(tables, key, value)
    spline = value_at(tables, "dog.inner_diameter_mm")
    absent = {
        "mechanism.spline_friction": 0.0,
        "mechanism.spline_radius_mm": round(0.5 * SPLINE * spline, 3),
        "mechanism.drag_torque_Nm": 0.0,
    }
    found = {key: value_at(tables, key) for key in USE}
    found = {key: absent.get(key) if value is None else value for key, value in found.items()}
    return {key: value for key, value in found.items() if askable(value)}


def searched_keys(origin: str) -> list[str]:
    """List the keys that the search of a draft may change."""
    return list(tomllib.loads(_begun(origin)[0]).get("variables", {}))


def askable(value: Any) -> bool:
    """Test that a value is a number, a list of numbers or a word."""
    parts = value if isinstance(value, list) else [value]
    return all(isinstance(part, (int, float, str)) for part in parts)


def _following(text: str, given: Mapping[str, Any]) -> tuple[Row, list[str]]:
    """Compute what follows from given values in a study file; None for a key takes it out."""
    own = tomllib.loads(text)
    for key, value in given.items():
        override(own, key, value)
    return following(tomllib.loads(text), own, given)


def _kept_of(text: str, done: Mapping[str, Any], base: str) -> list[str]:
    """List the values of clutch and use that stay those of the origin."""
    tables = tomllib.loads(text)
    kept = {
        key: value_at(tables, key)
        for key in (*CLUTCH, *USE)
        if not any(key == one or key.startswith(f"{one}.") for one in done)
    }
    listed = ", ".join(
        f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in kept.items()
        if value is not None
    )
    return [
        *([f"not given, so as in {base}: {listed}"] if listed else []),
        f"[load], [material], [manufacturing] and [tolerance] are those of {base} but for what "
        "was given: check safety factors, workshop and tolerances",
    ]


def _doubts(study: Setup) -> list[str]:
    """List what the study's own dog does not pass, and its values whose unit is in doubt."""
    failed = [check for check in design_of(study, {}).checks if not check.passed]
    outside = [
        f"variables.{key} is [{low:g}, {high:g}], which does not hold your own {own:g}: no search "
        "can propose it"
        for key, (low, high) in study.variables.items()
        if key in study.shape_keys and not low <= (own := study.prototype[key]) <= high
    ]
    faults = [f"your own dog fails {one.name}: {one.fault} ({one.rule.key})" for one in failed]
    if faults:
        faults.append("a search compares with a reference that breaks these limits")
    return [*faults, *outside, *notes_of(study)]


def _name_of(out: Path) -> str:
    name = out.resolve().name
    if not name or not all(letter.isalnum() or letter in "_.-" for letter in name):
        raise InputError(
            f"--out ends in '{name}', but a study's name has letters, digits, '_', '.' and '-' "
            "alone; name the folder so"
        )
    return name


def _begun(origin: str) -> tuple[str, Row, str, str]:
    """Return the text to begin with, values to put into it, where they and the text are from."""
    path = Path(origin)
    file = path / "study.toml" if path.is_dir() else path
    if file.name == "bench.toml" or not file.is_file():
        file = bundled_root() / origin / "study.toml"
    if file.is_file():
        load_study(file)  # refuses what is no study, with its mistakes
        return text_of(file), {}, f"the study '{origin}'", f"the study '{origin}'"
    source = source_of(origin)
    text = text_of(bundled_root() / COMMENTED / "study.toml")
    return text, _of_bench(source), f"the bench data of '{source.name}'", f"the study '{COMMENTED}'"


def _of_bench(source: Source) -> Row:
    contact = source.clutch.contact
    rises = sorted(dict(source.rises).items())
    if len(rises) == 1:  # a table needs two forces to lie between
        rises.append((rises[0][0] * 1.01, rises[0][1]))
    return {
        **source.dog_values,
        "contact.static_friction": contact.static_friction,
        "contact.dynamic_friction": contact.dynamic_friction,
        "actuation.force_N": [float(f"{force:.9g}") for force, _ in rises],
        "actuation.rise_s": [float(f"{rise:.9g}") for _, rise in rises],
        "operating.mismatch_rpm": list(source.mismatches),
        "operating.force_N": list(source.forces),
    }


def _without_head(text: str) -> str:
    """Leave out comments above the first key: they are about the study that was copied."""
    lines = text.splitlines()
    first = next((k for k, line in enumerate(lines) if line and not line.startswith("#")), 0)
    return "\n".join(lines[first:]) + "\n"
