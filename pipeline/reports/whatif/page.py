"""The page that answers "what if" at once: one HTML file that opens without a network."""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.kit import html
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import label
from dogshape.pipeline.reports.whatif.page_checks import known_of
from dogshape.pipeline.reports.whatif.page_program import interpreter, modules, program
from dogshape.pipeline.reports.whatif.page_surrogate import packed
from dogshape.sim.errors import InputError
from dogshape.sim.strength.checks import GROUPS
from dogshape.sim.strength.landing import LANDING_RULES
from dogshape.sim.strength.manufacture import MAKEABLE
from dogshape.sim.units import MM, RPM, unit_of
from dogshape.sim.versions import versions
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
    html.write_page(
        path,
        "whatif.html.j2",
        plotly="",
        page=page,
        useful=stored.validation.useful,
        content=html.as_script_json(content),
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
