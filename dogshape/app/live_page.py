"""Live page of a study as values: its numbers, and what the verbs of ``Study`` say of them.

A number of the page is a key of the study file with its text. Texts that differ from those at the
start become settings, as ``--set`` takes them; ``Study.check`` answers by a named surrogate at once
and by the compiled engine in seconds. Nothing is computed here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from dogshape.app.live_content import Number
from dogshape.app.page import Json, Texts
from dogshape.bench.texts import is_plain
from dogshape.check import Checked
from dogshape.pipeline.config.study_file import Setup, settings_of
from dogshape.pipeline.export.cad import write_step
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.text import PLACE
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord, read_study_record
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.train.training_rows import matching_surrogate
from dogshape.sim.errors import InputError
from dogshape.sim.interface import verb
from dogshape.sim.strength.spline import require_face
from dogshape.sim.units import MM, RPM
from dogshape.sim.versions import bundled_root
from dogshape.study import Study
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import Stored

BODY_THICKNESS = 3.0 * MM  #: m, of a ring below the slots in a STEP file, as in ``export``
ANGLE_KEY = "angle_deg"
#: Label and upper end of the slider of each coefficient of friction.
FRICTION_FIELDS = {
    "contact.static_friction": ("in the shift, static", 0.6),
    "contact.dynamic_friction": ("in the shift, sliding", 0.6),
    "load.friction_release": ("release, highest", 0.6),
    "load.friction_hold": ("holding, lowest", 0.3),
}
#: Type of each file with the words of its link; that of the single shift is the last.
FILES = {
    "sheet.html": ("text/html", "data sheet"),
    "dog.svg": ("image/svg+xml", "dimensioned drawing (SVG)"),
    "rings.step": ("application/step", "both rings (STEP)"),
    "shift.html": ("text/html", "animate this shift"),
}


@dataclass(frozen=True, eq=False)
class LivePage:
    """A study with its surrogate and search for the live page.

    ``command`` has study and ``--set`` of the command line, ``stored`` is the surrogate and
    ``surrogate`` its file, ``result`` the content of ``result.json``; None without one of the same
    physics. ``remarks`` are sentences on the study, of one that was begun on the page.
    ``where`` of a method is ``one`` operating point, or ``all``.
    """

    study: Study
    command: str
    stored: Stored | None = None
    surrogate: Path | None = None
    result: StudyRecord | None = None
    remarks: Sequence[str] = ()

    @cached_property
    def numbers(self) -> list[Number]:
        """Numbers of the page with their values at the start."""
        turn = round(360.0 / self.study.config.clutch.dog.count, 2)
        angle = Number(ANGLE_KEY, "shift", 0.4 * turn, (0.0, turn), "relative angle")
        return [*self._dog_numbers(), *self._point_numbers(), *self._friction_numbers(), angle]

    def _dog_numbers(self) -> list[Number]:
        """List the dimensions of the dog, variables of the search first, with their ranges."""
        config = self.study.config
        values = config.file.dog.sizes | {k: config.prototype[k] for k in config.shape_keys}
        dog = {key: value for key, value in values.items() if value is not None}
        numbers = []
        for key in sorted(dog, key=[*config.variables, *dog].index):
            ends = config.variables.get(key, (dog[key], dog[key]))
            numbers.append(Number(f"dog.{key}", "dog", dog[key], ends))
        return numbers

    def _point_numbers(self) -> list[Number]:
        """List mismatch and force of the middle operating point, with the ends over all points."""
        points = [(point.mismatch / RPM, point.profile.force) for point in self.study.config.points]
        middle = sorted(points)[len(points) // 2]
        columns = zip(*points, strict=True)
        return [
            Number(key, "point", value, (min(column), max(column)))
            for key, value, column in zip(PLACE, middle, columns, strict=True)
        ]

    def _friction_numbers(self) -> list[Number]:
        """List the coefficients of friction of contact and load."""
        file = self.study.config.file
        friction = {f"contact.{key}": value for key, value in vars(file.contact.value).items()}
        friction |= {f"load.{key}": value for key, value in file.load}
        return [
            Number(key, "friction", friction[key], (0.0, end), text)
            for key, (text, end) in FRICTION_FIELDS.items()
        ]

    @cached_property
    def searched_designs(self) -> dict[str, DesignRow]:
        """Designs that the search simulated, by number."""
        rows = [] if self.result is None else self.result.trials
        return {str(row.trial): row for row in rows if row.expected_shift_time_s is not None}

    def shape(self, trial: str = "") -> dict[str, str]:
        """Format the dog's dimensions of a searched design, by key; by default the prototype's."""
        prototype = {number.key: number.text for number in self.numbers if number.group == "dog"}
        design = self.searched_designs.get(trial)
        if design is None:
            return prototype
        params = design.params(self.study.config.variables)
        return prototype | {f"dog.{key}": f"{value:.6g}" for key, value in params.items()}

    def changes(self, texts: Texts) -> list[str]:
        """List ``KEY=VALUE`` of the fields that differ from the study."""
        initial = {number.key: number.text for number in self.numbers if "." in number.key}
        return [
            f"{key}={texts[key] or repr('')}" for key, text in initial.items() if texts[key] != text
        ]

    def modify_study(self, texts: Texts) -> Study:
        """Replace keys of the study by the numbers of the page."""
        return self.study.replace_keys(settings_of(self.changes(texts)))

    def prediction_refusal(self, study: Study) -> str:
        """Describe why the surrogate does not apply to a study; empty if it applies."""
        if self.stored is None:
            return f"there is no surrogate of the study; {verb('fit')} makes one"
        differences = compare_physics(self.stored.surrogate.data, study.config.physics)
        return f"the surrogate is of other physics: {differences}" if differences else ""

    def predict(self, texts: Texts, where: str) -> Checked:
        """Check a design at once: by the surrogate, or by closed forms alone without one."""
        study = self.modify_study(texts)
        if self.prediction_refusal(study):
            return study.strength(simulate=False)
        return study.check(**point_of(texts, where), surrogate=self.surrogate)

    def write(self, name: str, texts: Texts, why: str, path: Path) -> None:
        """Write a file of ``FILES``: single shift, data sheet, drawing or solids."""
        study = self.modify_study(texts)
        dog = study.config.clutch.dog
        limits = study.config.limits
        if name == "shift.html":
            angle = _number(ANGLE_KEY, texts)
            study.shift(**point_of(texts, "one"), angle_deg=angle).report(path)
        elif name == "sheet.html":
            study.data_sheet(path, why)
        elif name == "dog.svg":
            path.write_text(dimensioned_svg(dog, limits, study.name), encoding="utf-8")
        else:
            require_face(limits.sleeve)
            pair = study.config.clutch.pair
            tolerances = limits.tolerances.dimensions
            write_step(pair, limits.root_radius, BODY_THICKNESS, path, tolerances)


def _number(key: str, texts: Texts) -> float:
    """Read a number that is no key of the study file."""
    text = texts[key]
    if not is_plain(text):
        raise InputError(f"{key} is '{text}', but it must be a number; write the number alone")
    return float(text)


class Question(NamedTuple):
    """Design and operating points that the page asks for; its fields are keys of its store."""

    texts: Texts
    where: str  #: ``one`` or ``all`` operating points


def point_of(texts: Texts, where: str) -> Json:
    """Read the operating point as arguments of a verb; empty for all points of the study."""
    if where != "one":
        return {}
    return {key: _number(key, texts) for key in PLACE}


def open_live_page(
    study: Study,
    surrogate: str | Path | None = None,
    folder: str | Path | None = None,
    command: str = "",
) -> LivePage:
    """Load surrogate and search of a study for its live page.

    ``surrogate`` is a file that predicts, ``folder`` has results of the search; None for those of
    ``results/NAME``, or the package's. A search of other physics counts as none, and so does one of
    the operation. ``command`` is study and ``--set`` for the command that the page shows.
    """
    config = study.config
    if folder:
        folders = [StudyFolder(Path(folder))]
    else:
        folders = [StudyFolder(bundled_root() / study.name), StudyFolder(default_out(config))]
    if surrogate is None and folder is not None and folders[0].surrogate.is_file():
        surrogate = folders[0].surrogate
    stored, path = matching_surrogate(config, surrogate) or (None, None)
    result = _matching_result(config, folders)
    return LivePage(study, command or study.name, stored, path, result)


def _matching_result(config: Setup, folders: Sequence[StudyFolder]) -> StudyRecord | None:
    """Read the last ``result.json`` of the study's physics; None without one."""
    if set(config.shape_keys) != set(config.variables):
        return None
    matching = None
    for folder in folders:
        if folder.result.is_file():
            result = read_study_record(folder)
            physics = config.in_engine(result.engine).physics_hash
            if result.physics_hash == physics:
                matching = result
    return matching
