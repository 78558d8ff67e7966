"""The page that answers "what if" at once: one HTML file that opens without a network.

Its checks are modules of the package as they are, run in the browser by Brython: those that
``whatif_checks`` imports, with a ``numpy`` that can be imported and no more. Its times are those of
``surrogate.model.Surrogate.expected``, with all rows. The inverse root of the rows' covariance has
half of its size and is kept with seven digits, which moves no bound by more than a few millionths.
"""

from __future__ import annotations

import ast
import base64
import gzip
import json
import re
import unicodedata
from base64 import b64encode
from collections.abc import Sequence
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.charts import Row
from dogshape.pipeline.reports.report import as_script_json, write_page
from dogshape.pipeline.reports.text import label
from dogshape.pipeline.reports.whatif_checks import known_of
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.statistics.expectation import LEAST_ENGAGED
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.units import MM, RPM, unit_of
from dogshape.sim.versions import versions
from dogshape.surrogate.covariance import Part
from dogshape.surrogate.mix_times import SHAPE, MixTimes
from dogshape.surrogate.model import Share, Surrogate
from dogshape.surrogate.process import ANGLES, WIDTH, timed
from dogshape.surrogate.query import CHAMFER, FAR, HOLDS
from dogshape.surrogate.store import Stored

FRICTION = {
    "friction_release": ("static friction", 0.6),
    "friction_hold": ("low friction", 0.3),
}  #: of the load case: name on the page and upper end
OWN = "the study's own design"


def require_fixed_points(study: Setup) -> None:
    """Raise InputError for a study whose operating points move with the design."""
    if study.searches_operation:
        moved = [name for name in study.variables if name not in study.shape_keys]
        raise InputError(
            f"{study.name} searches {', '.join(moved)}, which moves its operating points; the page "
            "has fixed ones. Use 'dogshape check' for this study"
        )


def write_whatif(
    study: Setup,
    stored: Stored,
    names: tuple[Path, str],
    shown: tuple[list[Row], Sequence[str]],
    path: Path,
) -> None:
    """Write the page of a study and its surrogate.

    ``names`` are the surrogate's file and the study as a command has it, ``shown`` the designs to
    begin with and warnings.
    """
    (source, command), (designs, warnings) = names, shown
    data = stored.surrogate.data
    model = packed(study, stored.surrogate)
    groups: dict[str, str] = {str(group): title for group, title in GROUPS.items()}
    groups["simulated"] = "simulated, landing included"
    content = {
        "command": command,
        "variables": [_variable(study, name) for name in data.variables],
        "operating": _operating(study),
        "friction": _friction(study),
        "designs": designs,
        "groups": groups,
        "makeable": MAKEABLE,
        "gap": study.clutch.dog.axial_gap / MM,
        "model": model,
        "python": _python(study),
    }
    page = {
        "study": study.name,
        "model": model,
        "validation": stored.validation.as_dict(),
        "surrogate": source.name,
        "shifts": data.shifts,
        "hash": data.digest[:10],
        "missing": _missing(study),
        "warnings": list(warnings),
        "versions": versions(),
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_page(
        path,
        "whatif.html.j2",
        plotly="",
        page=page,
        useful=stored.validation.useful,
        content=as_script_json(content),
    )


def designs_of(study: Setup, result: Row | None, own_row: Row) -> list[Row]:
    """List the study's own design and all of the front, with what simulation said of them.

    ``own_row`` says it of the study's own, with the keys of a row of the front. ``result`` is the
    search's, None where there is none; one of other physics counts as none.
    """
    same = result is not None and result.get("physics_hash") == study.physics_hash
    front = [
        (f"design {row['trial']}", {name: row[name] for name in study.variables}, row)
        for row in (result["front"] if result is not None and same else [])
    ]
    others = [one for one in front if one[1] != study.prototype]
    return [
        {
            "name": name,
            "values": [float(design[key]) for key in study.variables],
            "simulated_s": row.get("expected_shift_time_s"),
            "error_s": row.get("standard_error_s"),
            "margins": row.get("margins"),
        }
        for name, design, row in [(OWN, study.prototype, own_row), *others]
    ]


def _variable(study: Setup, name: str) -> Row:
    low, high = study.variables[name]
    whole = name == "count"
    return {
        "key": name, "label": label(name), "unit": unit_of(name), "low": low, "high": high,
        "step": 1 if whole else 0.05, "whole": whole, "value": float(study.prototype[name]),
    }  # fmt: skip


def _operating(study: Setup) -> list[Row]:
    """Return the fields of one operating point, over the range of the study's."""
    mismatches = [point.mismatch / RPM for point in study.points]
    forces = [point.profile.force for point in study.points]
    found = []
    for key, values in (("mismatch_rpm", mismatches), ("force_N", forces)):
        low, high = min(values), max(values)
        found.append(
            {
                "key": key, "label": label(key), "unit": unit_of(key), "low": low, "high": high,
                "step": 0.1, "whole": False, "value": sorted(values)[len(values) // 2],
                "log": low > 0.0 and high > 5.0 * low,
            }
        )  # fmt: skip
    return found


def _friction(study: Setup) -> list[Row]:
    return [
        {
            "key": key, "label": name, "unit": "", "low": 0.0, "high": high, "step": 0.005,
            "whole": False, "value": getattr(study.limits.load, key),
        }
        for key, (name, high) in FRICTION.items()
    ]  # fmt: skip


def _python(study: Setup) -> Row:
    """Return the checks as a program for the page, with what it looks up."""
    low, high = study.variables.get("count", (study.clutch.dog.count,) * 2)
    known = known_of(study.clutch.dog, study.limits, range(int(low), int(high) + 1))
    return {
        "scripts": [_squeezed(code) for code in interpreter()],
        "modules": _squeezed(json.dumps(modules())),
        "program": program(study.clutch.dog, study.limits),
        "known": known,
    }


def _squeezed(text: str) -> str:
    return b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode()


def _missing(study: Setup) -> str:
    """Name the checks of the study that need a simulation or a draw."""
    landing = ", ".join(rule.name.replace("_", " ") for rule in LANDING_RULES)
    limits = study.file.search.limits
    more = f"; the study's own limits ({', '.join(limits)})" if limits else ""
    return (
        f"of designs that were not simulated, landings ({landing}){more}; "
        "'dogshape check' judges them"
    )


START = "dogshape.pipeline.reports.whatif_checks"
STAND_INS = {
    "numpy": "float64 = float\n\nclass ndarray:\n    pass\n",
    "numpy.typing": "class NDArray:\n    def __class_getitem__(cls, _):\n        return cls\n",
}
MAIN = """
import json
from browser import window
from dogshape.pipeline.reports.whatif_checks import Desk, with_known
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.strength.dog_strength import Limits
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits
from dogshape.sim.strength.materials import Material
from dogshape.sim.strength.strike import Strike
from dogshape.sim.strength.tolerance import Tolerances
desk = Desk({dog!r}, with_known({limits!r}, json.loads(window.python_known)))
window.python_checks = lambda asked: desk.answer(asked)
"""

Module = list[Any]  #: of Brython's files: suffix, source, imported modules, 1 for a package


def program(dog: Dog, limits: Limits) -> str:
    """Write the program that the page runs after its modules; it reads ``window.python_known``."""
    return MAIN.format(dog=dog, limits=limits)


def modules() -> dict[str, Module]:
    """Return all modules of the package that the program needs, in the form of Brython's files."""
    found: dict[str, Module] = {}
    left = [START]
    for name, source in STAND_INS.items():
        found[name] = [".py", source, [], int(name == "numpy")]
    while left:
        name = left.pop()
        if name in found:
            continue
        source = _source(name)
        wanted = [one for one in _imported(source) if one.split(".")[0] == "dogshape"]
        found[name] = [".py", readable(source), wanted]
        left += wanted
    packages = {
        part for name in list(found) if name.startswith("dogshape") for part in _above(name)
    }
    found |= {name: [".py", "", [], 1] for name in packages}
    return found


def readable(source: str) -> str:
    """Write characters that a source names as numbers: Brython has no list of names offline."""
    return re.sub(
        r"\\N\{([^}]+)\}", lambda named: f"\\u{ord(unicodedata.lookup(named[1])):04x}", source
    )


def interpreter() -> tuple[str, str]:
    """Return Brython and its standard library, as scripts."""
    data = resources.files("brython") / "data"
    files = (data / "brython.js", data / "brython_stdlib.js")
    return files[0].read_text("utf-8"), files[1].read_text("utf-8")


def _source(name: str) -> str:
    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text("utf-8")


def _imported(source: str) -> list[str]:
    tree = ast.parse(source)
    found = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return sorted({name for name in found if name})


def _above(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]


def packed(study: Setup, surrogate: Surrogate) -> Row:
    """Return all that the page needs to predict; arrays as text (``array_text``)."""
    data, process = surrogate.data, surrogate.times
    rows = process.covariance.split(process.inputs)[1]
    low, high = data.x.min(axis=0), data.x.max(axis=0)
    mix = study_mix(study)
    angles = [i for i, name in enumerate(data.variables) if name in ANGLES]
    return {
        "variables": list(data.variables),
        "low": data.low.tolist(),
        "high": data.high.tolist(),
        "simulated": [low.tolist(), high.tolist()],
        "points": [data.points.min(axis=0).tolist(), data.points.max(axis=0).tolist()],
        "holds": {
            "place": list(data.variables).index(CHAMFER) if CHAMFER in data.variables else None,
            "friction": data.physics["static_friction"],
            "reason": HOLDS,
            "engaged": LEAST_ENGAGED,
        },
        "ridge": {"angles": angles, "friction": data.physics["dynamic_friction"], "width": WIDTH},
        "designs": data.designs.tolist(),
        "spacing": surrogate.spacing,
        "far": FAR,
        "known": array_text(surrogate.known, "f8"),
        "place": array_text(data.design_of_row[timed(data)], "i4"),
        "rows": array_text(rows, "f8"),
        "weights": array_text(process.weights, "f8"),
        "root": array_text(process.whitening[np.tril_indices(len(rows))], "f4"),
        "centre": process.centre,
        "parts": [_part(part) for part in process.covariance.parts],
        "share": _share(surrogate.share, data.design_of_row),
        "mix": {"points": mix.points.tolist(), "weights": mix.weights.tolist()},
        "retry": mix.retry,
        "own": _own(surrogate.own),
    }


def _own(own: MixTimes | None) -> Row | None:
    """Return the processes over designs alone; the page works out their roots."""
    if own is None:
        return None
    names, physics = list(own.about.variables), own.about.physics
    low, span = (None, None) if own.spans is None else (end.tolist() for end in own.spans)
    shape = [
        {"place": names.index(name) if name in names else None, "value": physics.get(name)}
        for name in SHAPE
    ]
    return {
        "points": own.mix.points.tolist(),
        "weights": own.mix.weights.tolist(),
        "known": array_text(own.inputs, "f8"),
        "processes": [
            {
                "weights": array_text(process.weights, "f8"),
                "centre": process.centre,
                "noise": array_text(process.noise, "f8"),
                "parts": [_part(part) for part in process.covariance.parts],
            }
            for process in own.processes
        ],
        "angles": [i for i, name in enumerate(names) if name in ANGLES],
        "shape": None if own.spans is None else shape,
        "low": low,
        "span": span,
    }


def array_text(values: Any, kind: str) -> str:
    """Write an array as text: little-endian numbers of a kind (``f8``), in base 64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()).decode()


def _part(part: Part) -> Row:
    return {
        "rough": part.rough,
        "variance": part.variance,
        "growth": list(part.growth),
        "design": None if part.design is None else part.design.tolist(),
        "point": None if part.point is None else part.point.tolist(),
    }


def _share(share: Share, place: Any) -> Row:
    """Return the counts of shifts that engage, by row; without a length all rows count alike."""
    cut = share.designs
    return {
        "length": None if np.isinf(share.length) else share.length,
        "strength": share.strength,
        "overall": share.overall,
        "place": array_text(place, "i4"),
        "rows": array_text(share.inputs[:, cut:], "f8"),
        "engaged": array_text(share.engaged, "f8"),
        "lost": array_text(share.shifts - share.engaged, "f8"),
    }
