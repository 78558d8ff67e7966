"""Live page of a study as values: its fields, and what the verbs of ``Study`` say of them.

A field is a key of the study file with its text, read as the answers to the questions of a new
study are. Values that differ from those of the study become settings, as ``--set`` takes them;
``Study.check`` answers by a named surrogate at once and by the compiled engine in seconds. Nothing
is computed here.
"""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from dogshape.app.live_fields import (
    ACTUATOR_KEYS,
    ANGLE_KEY,
    PageField,
    actuator_defaults,
    empty_value,
    fields_of,
    material_defaults,
)
from dogshape.app.page import Json, Texts
from dogshape.app.time_curve import TimeCurve, predict_curve, slider_values
from dogshape.check import Check, Checked
from dogshape.pipeline.config.operating import KIND, replaced_keys
from dogshape.pipeline.config.schema import dotted_key
from dogshape.pipeline.config.study_file import RequestedPoint, Setup, points_of, replace_keys
from dogshape.pipeline.config.toml_text import comment_lines, toml_value
from dogshape.pipeline.diagnose.study_keys import Data
from dogshape.pipeline.drafts.derived_values import ACTUATOR_RULES, derive_values
from dogshape.pipeline.drafts.draft_keys import MATERIAL, OPERATION
from dogshape.pipeline.drafts.questionnaire import Answers, check_answers, read_answer
from dogshape.pipeline.drafts.study_folder import changed_values
from dogshape.pipeline.drafts.study_text import study_text
from dogshape.pipeline.export.cad import write_step
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.text import PLACE
from dogshape.pipeline.search.study_record import DesignRow, StudyRecord, read_study_record
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.pipeline.train.training_rows import matching_surrogate
from dogshape.sim.errors import DogshapeError, InputError
from dogshape.sim.interface import verb
from dogshape.sim.shift.actuators import PROFILE, SECTION
from dogshape.sim.strength.spline import require_face
from dogshape.sim.units import MM
from dogshape.sim.versions import bundled_root
from dogshape.study import Study
from dogshape.surrogate.query import compare_physics
from dogshape.surrogate.store import Stored

BODY_THICKNESS = 3.0 * MM  #: m, of a ring below the slots in a STEP file, as in ``export``
MAX_SIMULATED = 64  #: designs whose simulation a page remembers
#: Type of each file with the words of its link; that of the single shift is the last.
FILES = {
    "study.toml": ("application/toml", "study file with these values"),
    "sheet.html": ("text/html", "data sheet"),
    "dog.svg": ("image/svg+xml", "dimensioned drawing (SVG)"),
    "rings.step": ("application/step", "both rings (STEP)"),
    "shift.html": ("text/html", "animate this shift"),
}


class Question(NamedTuple):
    """Design and operating points that the page asks for; its fields are keys of its store."""

    texts: Texts
    where: str  #: ``one`` or ``all`` operating points


@dataclass(frozen=True)
class LiveDesign:
    """A design that the page asks for: study, operating point and values of the fields.

    ``place`` are arguments of a verb, empty for all points of the study; ``values`` are by key.
    """

    study: Study
    place: Json
    values: Data

    @property
    def key(self) -> tuple[object, ...]:
        """Configuration and operating point, on which a simulation depends."""
        return (self.study.config.config_hash, *self.place.values())


@dataclass(frozen=True, eq=False)
class LivePage:
    """A study with its surrogate and search for the live page.

    ``command`` has study and ``--set`` of the command line, ``stored`` is the surrogate and
    ``surrogate`` its file, ``result`` the content of ``result.json``; None without one of the same
    physics. ``remarks`` are sentences on the study, of one that was begun on the page.
    """

    study: Study
    command: str
    stored: Stored | None = None
    surrogate: Path | None = None
    result: StudyRecord | None = None
    remarks: Sequence[str] = ()
    _simulated: dict[tuple[object, ...], Check] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def text(self) -> str:
        """Text of the study file."""
        return study_text(self.study.config)

    @cached_property
    def tables(self) -> Data:
        """Tables of the study file."""
        return tomllib.loads(self.text)

    @cached_property
    def fields(self) -> list[PageField]:
        """Fields of the page with their values at the start."""
        return fields_of(self.study.config, self.tables)

    @cached_property
    def searched_designs(self) -> dict[str, DesignRow]:
        """Designs that the search simulated, by number."""
        rows = [] if self.result is None else self.result.trials
        return {str(row.trial): row for row in rows if row.expected_shift_time_s is not None}

    def start_texts(self) -> dict[str, str]:
        """Return the texts of the fields at the start, by key."""
        return {field.key: field.text for field in self.fields}

    def shape(self, trial: str = "") -> dict[str, str]:
        """Format the dog's dimensions of a searched design, by key; by default the own dog's."""
        own_dog = {field.key: field.text for field in self.fields if field.group == "dog"}
        design = self.searched_designs.get(trial)
        if design is None:
            return own_dog
        params = design.params(self.study.config.variables)
        return own_dog | {dotted_key(key): f"{value:.6g}" for key, value in params.items()}

    def read(self, question: Question) -> Answers:
        """Read all fields; actuator and material decide the defaults of their numbers."""
        config = self.study.config
        texts = self._typed_texts(question.texts)
        own_values = {field.key: field.default for field in self.fields}
        answers: Data = {}
        faults: dict[str, str] = {}
        _read_fields((KIND, MATERIAL), texts, own_values, answers=answers, faults=faults)
        numbers = actuator_defaults(config, answers[KIND])
        numbers |= material_defaults(config, answers[MATERIAL])
        defaults = {
            key: numbers.get(key, value)
            for key, value in own_values.items()
            if key in numbers or key not in ACTUATOR_KEYS
        }
        keys = [key for key in defaults if key not in (KIND, MATERIAL, *OPERATION)]
        _read_fields(keys, texts, defaults, answers=answers, faults=faults)
        settings = self._settings(changed_values(answers, defaults))
        defaults |= {key: settings.get(key, defaults[key]) for key in OPERATION}
        _read_fields(OPERATION, texts, defaults, answers=answers, faults=faults)
        study, faults, refusal = check_answers(self._build, answers, defaults, faults)
        if study is not None and question.where == "one":
            try:
                points_of(study, RequestedPoint(*(answers[key] for key in PLACE)))
            except DogshapeError as error:
                faults |= {PLACE[1]: str(error)}
                study = None
        return Answers(defaults, answers, faults, refusal, study)

    def _typed_texts(self, texts: Texts) -> dict[str, str]:
        """Return the texts that differ from those at the start, which may be rounded."""
        return {
            field.key: texts[field.key]
            for field in self.fields
            if texts.get(field.key, field.text) != field.text
        }

    def number_of(self, key: str, text: str) -> float | None:
        """Read the number of a field with a slider, its own for no text; None for a wrong one."""
        answers: Data = {field.key: field.default for field in self.fields}
        faults: dict[str, str] = {}
        read_answer(key, text, answers[key], answers=answers, faults=faults)
        return None if faults else answers[key]

    def _build(self, values: Data) -> Setup:
        """Build the study with values of the page."""
        return replace_keys(self.study.config, self._settings(values))

    def _settings(self, values: Data) -> Data:
        """Return the settings of values of the page, with those that follow from an actuator."""
        settings = {key: value for key, value in values.items() if "." in key}
        kind = settings.get(KIND, self.study.config.file.actuation.kind)
        has_other_actuation = any(key.startswith(f"{SECTION}.") for key in settings)
        if kind == PROFILE and not has_other_actuation:
            return settings
        derived, _ = derive_values(self.text, settings, ACTUATOR_RULES)
        given = {key: value for key, value in derived.items() if value is not None}
        replaced = replaced_keys(settings | given, self.tables)  # which settings take out anyway
        return settings | {key: value for key, value in derived.items() if key not in replaced}

    def design(self, answers: Answers, where: str) -> LiveDesign | None:
        """Build the design of the fields; None for wrong answers."""
        if answers.study is None:
            return None
        values = answers.answers
        place = {key: values[key] for key in PLACE} if where == "one" else {}
        return LiveDesign(Study.from_config(answers.study), place, values)

    def own_question(self, question: Question) -> Question:
        """Ask for the study's dog under load and operation of the page."""
        return question._replace(texts={**question.texts, **self.shape()})

    def prediction_refusal(self, study: Study) -> str:
        """Describe why the surrogate does not apply to a study; empty if it applies."""
        if self.stored is None:
            return f"there is no surrogate of the study; {verb('fit')} makes one"
        data = self.stored.surrogate.data
        differences = compare_physics(data, study.config.physics)
        if not differences:
            return ""
        kind = study.config.file.actuation.kind
        fitted_kind = data.physics.get("actuator", PROFILE)
        if kind != fitted_kind:
            return (
                f"the surrogate was fitted to the actuation '{fitted_kind}', and this is '{kind}'"
            )
        return f"the surrogate is of other physics: {differences}"

    def is_beyond_surrogate(self, study: Study) -> bool:
        """Whether changes on the page left the physics of the surrogate: times are simulated."""
        return self.stored is not None and bool(self.prediction_refusal(study))

    def predict(self, design: LiveDesign) -> Checked:
        """Check a design at once: by the surrogate, or by closed forms alone without one."""
        if self.prediction_refusal(design.study):
            return design.study.strength(simulate=False)
        return design.study.check(**design.place, surrogate=self.surrogate)

    def simulate(self, design: LiveDesign) -> Check:
        """Simulate a design at its operating points, once."""
        if design.key not in self._simulated:
            check = design.study.check(**design.place)
            while len(self._simulated) >= MAX_SIMULATED:
                self._simulated.pop(next(iter(self._simulated)), None)
            self._simulated[design.key] = check
        return self._simulated[design.key]

    def simulated(self, design: LiveDesign) -> Check | None:
        """Look up the simulation of a design; None before it."""
        return self._simulated.get(design.key)

    def time_curve(self, design: LiveDesign, key: str) -> TimeCurve | str:
        """Predict the shift time over the slider of a field; a sentence if it cannot be."""
        refusal = self.prediction_refusal(design.study)
        slider = next(field for field in self.fields if field.key == key)
        if self.stored is None or refusal or slider.ends is None:
            return refusal
        values = slider_values(slider.ends, is_whole=isinstance(slider.default, int))
        return predict_curve(
            design.study,
            key,
            values,
            place=design.place,
            stored=self.stored,
            surrogate=self.surrogate,
        )

    def check_words(self, question: Question) -> list[str]:
        """List the options of ``dogshape check`` for the fields, quoted for a shell."""
        answers = self.read(question)
        settings = self._settings(answers.values)
        words = []
        for key, value in settings.items():
            text = "" if value is None else toml_value(value)
            words.append(f"--set {shlex.quote(f'{key}={text}')}")
        return [*words, *_point_words(answers, question.where)]

    def export(self, question: Question) -> str:
        """Write the study file of the fields, with the command that checks it at its head.

        Raises InputError for wrong fields.
        """
        answers = self.read(question)
        design = self._valid_design(answers, question.where)
        settings = self._settings(answers.values)
        changes = [
            f"{key} left out" if value is None else f"{key} = {toml_value(value)}"
            for key, value in settings.items()
        ]
        command = ["dogshape check FILE", *_point_words(answers, question.where)]
        sentences = [
            f"Set on the live page of {self.command}: {', '.join(changes) or 'nothing'}.",
            f"The answers of that page: {' '.join(command)}",
        ]
        return "\n".join([*comment_lines(sentences), study_text(design.study.config)])

    def _valid_design(self, answers: Answers, where: str) -> LiveDesign:
        """Build the design of the fields; InputError with all faults for wrong ones."""
        design = self.design(answers, where)
        if design is None:
            faults = [f"{key}: {fault}" for key, fault in answers.faults.items()]
            raise InputError("\n".join(filter(None, [*faults, answers.refusal])))
        return design

    def write(self, name: str, texts: Texts, why: str, path: Path) -> None:
        """Write a file of ``FILES``: study, single shift, data sheet, drawing or solids."""
        if name == "study.toml":
            path.write_text(self.export(Question(texts, texts.get("where", "all"))), "utf-8")
            return
        where = "one" if name == "shift.html" else "all"
        design = self._valid_design(self.read(Question(texts, where)), where)
        config = design.study.config
        if name == "shift.html":
            design.study.shift(**design.place, angle_deg=design.values[ANGLE_KEY]).report(path)
        elif name == "sheet.html":
            design.study.data_sheet(path, why)
        elif name == "dog.svg":
            svg = dimensioned_svg(config.clutch.dog, config.limits, design.study.name)
            path.write_text(svg, encoding="utf-8")
        else:
            require_face(config.limits.sleeve)
            tolerances = config.limits.tolerances.dimensions
            radius = config.limits.root_radius
            write_step(config.clutch.pair, radius, BODY_THICKNESS, path, tolerances)


def _point_words(answers: Answers, where: str) -> list[str]:
    """List the options of ``dogshape check`` for one operating point; empty for all points."""
    if where != "one":
        return []
    return [f"--{key.replace('_', '-')} {answers.answers[key]:.12g}" for key in PLACE]


def _read_fields(
    keys: Iterable[str], texts: Texts, defaults: Data, *, answers: Data, faults: dict[str, str]
) -> None:
    """Read fields into ``answers`` and ``faults``; one without a text takes its default."""
    for key in keys:
        default = defaults[key]
        text = texts.get(key, "")
        example = empty_value(key) if text and default is None else None
        read_answer(key, text, default, answers=answers, faults=faults, example=example)


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
