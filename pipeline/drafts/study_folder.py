"""Draft of a study folder: the commented file of a source study with the values of the user.

A study begins as a copy of another one. Values that hold for the other clutch alone are left out;
the height of the dogs scales with their pitch, and forces of the operating points beyond the
actuator become the actuator's. A new value has the comment of its key in the study that explains
the keys, as the copied comment would be a wrong source.
"""

from __future__ import annotations

import itertools
import re
import shutil
import tempfile
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from dogshape.bench.texts import text_of
from dogshape.pipeline.config.operating import KIND, OperatingSection, dotted_keys, value_at
from dogshape.pipeline.config.schema import StudyFile, variable_key
from dogshape.pipeline.config.study_file import Setup, build_study, find_study
from dogshape.pipeline.config.toml_text import (
    comment_lines,
    meanings_of,
    sources_of,
    toml_value,
    with_values,
)
from dogshape.pipeline.diagnose.study_keys import Data, rounded
from dogshape.pipeline.drafts.answers import choice_of, read_numbers, read_sum
from dogshape.pipeline.drafts.derived_values import (
    LookUp,
    derive_values,
    draft_actuator,
    is_under,
)
from dogshape.pipeline.drafts.draft_keys import (
    ACTUATION,
    ACTUATOR_NUMBERS,
    ADDED_MASS,
    BACKLASH,
    BACKLASH_DEG,
    CHAMFER_BACK,
    CHAMFERS,
    CHOICES,
    COAST,
    COUNT,
    CREST,
    DIAMETERS,
    DRAG,
    HOLDING_FORCE,
    INERTIAS,
    LIST_KEYS,
    MASS,
    MATERIAL,
    MISMATCH,
    MOUNT,
    NOMINAL,
    OPERATING,
    OPERATION,
    PLAY_DEVIATION,
    POINT_SET,
    POINTS,
    PULL_OUT_SHARE,
    RADIUS,
    RELEASE,
    RIM,
    ROOF_CREST,
    SIDE,
    SPEED,
    STRIKE,
    STRIKE_RING,
    STRIKE_SHAFT,
    TORQUE,
    WORDS,
)
from dogshape.pipeline.drafts.draft_source import COMMENTED, Source, source_of
from dogshape.pipeline.drafts.rexs_coupling import RexsReading
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.sim.clutch_tables import DogSection, mm_per_deg, validate
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.interface import argument
from dogshape.sim.shift.actuators import KINDS, PROFILE, optional_values
from dogshape.sim.shift.mechanism import SPLINE
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import Tolerances
from dogshape.sim.units import from_si, unit_of

HEAD = """\
# A study of one's own, begun from {origin}. The study mq200 and docs/studies.md explain the keys.
# Beside the dog look at [load], [material] and [manufacturing]: they decide what may be built.
"""
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
        "effects",
        "uncertain",
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
        "output_dog",
        "load",
        "strike",
        "sleeve",
        "manufacturing",
        "tolerance",
        "wear",
    ),
}
#: These keys and tables, without answers.
DECIDING_STEMS = tuple(itertools.chain.from_iterable(DECIDING.values()))
#: Comment of the rows of values that nobody gave.
ASSUMED_COMMENT = (
    "# not given: each counts as assumed while the study has this value; delete its row to confirm"
)


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
    origin: str,
    values: Mapping[str, Any],
    *,
    force: bool = False,
    reading: RexsReading | None = None,
) -> WrittenStudy:
    """Write a folder with a commented ``study.toml``.

    ``origin`` is the study whose file is copied, or the bench whose clutch and operating points are
    used; ``values`` by dotted key, None removes a key. Values of ``reading``, of a gearbox, are
    before those of the origin. Raises one InputError for all mistakes of the study, StorageError
    for a folder that holds files, without ``force``.
    """
    name = out.resolve().name
    values = values_with(reading, values)
    notes = [] if reading is None else reading.sentences(values)
    draft = _draft_of(source_of(origin), origin, {"name": name, **values})
    text = re.sub(r"\A(#.*\n|\s*\n)*", "", draft.text)  # the head comments are on the copied study
    study = build_study(validate(StudyFile, tomllib.loads(text), str(out / "study.toml")))
    with draft_folder(out, force) as folder:
        head = HEAD.format(origin=draft.origin)
        sources = "".join(f"{line}\n" for line in comment_lines(notes))
        (folder / "study.toml").write_text(head + sources + text, encoding="utf-8")
    return WrittenStudy(
        folder=out,
        name=name,
        origin=draft.origin,
        values={key: value for key, value in draft.values.items() if key != "name"},
        assumed=[*notes, *draft.notes],
        warnings=_warnings_of(study),
        points=len(study.points),
        dogs=study.clutch.dog.count,
    )


def values_with(reading: RexsReading | None, values: Mapping[str, Any]) -> Data:
    """Return the values of a user, and those of a gearbox for other keys."""
    return {**({} if reading is None else reading.values), **values}


def draft_study(origin: str, values: Mapping[str, Any]) -> Setup:
    """Build the study of a draft; DogshapeError if it makes none."""
    draft = _draft_of(source_of(origin), origin, values)
    return build_study(validate(StudyFile, tomllib.loads(draft.text), "the draft"))


class Questions(NamedTuple):
    """Questions of a part of a draft by key, with their defaults."""

    defaults: Data
    words: dict[str, str]  #: with the source of the default
    #: keys with a default that the study uses; others show a default for a key that it lacks
    used_keys: frozenset[str]


def questions_of(origin: str, values: Mapping[str, Any], part: Mapping[str, str]) -> Questions:
    """Return the questions of a draft with ``values``.

    ``part`` is one of the tables of words. Points that are no lists are asked for as lists.
    """
    source = source_of(origin)
    text = _draft_of(source, origin, values).text
    look_up = partial(value_at, tomllib.loads(text))
    sources = sources_of(text)
    defaults = {key: look_up(key) for key in WORDS}
    defaults |= operating_lists(look_up)
    used_keys = {key for key in WORDS if look_up(key) is not None}
    used_keys -= {key for key in OPERATION if not isinstance(look_up(key), list)}
    absent_defaults = _defaults(look_up)
    used_keys |= {key for key, *_ in absent_defaults}
    for key, value, reason in (*absent_defaults, *_default_answers(look_up)):
        if defaults[key] is None:
            defaults[key] = value
            sources[key] = reason
        if key in STRIKE and not isinstance(defaults[key], list):
            defaults[key] = [defaults[key]]
    answers = source.dog_values
    answers |= {key: value for key, value in defaults.items() if _is_answer(value)}
    if look_up(MOUNT) != "sleeve":
        del answers[RIM]
    answers = {key: answers[key] for key in part if key in answers}
    questions = {}
    for key in answers:
        words = WORDS[key]
        questions[key] = f"{words} ({sources[key]})" if sources.get(key) else words
    return Questions(answers, questions, frozenset(used_keys & answers.keys()))


def operating_lists(look_up: LookUp) -> Data:
    """Return mismatches and forces of the operating points by key: lists, also of other points."""
    actuator = draft_actuator(look_up, {})
    full_force = None if actuator is None else actuator.full_force
    points = validate(OperatingSection, look_up("operating"), "[operating]").rows(full_force)
    lists: Data = {}
    for key, column in zip(OPERATION, zip(*points, strict=True), strict=False):
        value = look_up(key)
        lists[key] = value if isinstance(value, list) else sorted(set(column))
    return lists


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
    derived, notes = derive_values(text, values)
    all_values = {**values, **derived}
    draft_text = with_values(text, all_values, meanings_of(text_of(find_study(COMMENTED))))
    copied_study = COMMENTED if source.is_bench else origin
    inherited = _notes_on_inherited(draft_text, copied_study, all_values)
    assumed_rows = _assumed_rows(draft_text, copied_study, values, derived)
    if assumed_rows or "assumed" in tomllib.loads(draft_text):
        assumed: Data = {"assumed.values": assumed_rows}
        draft_text = with_values(draft_text, assumed, {"assumed": ASSUMED_COMMENT})
    return _Draft(draft_text, values, origin=origin_words, notes=[*inherited, *notes])


def _assumed_rows(
    text: str, origin: str, values: Collection[str], derived: Mapping[str, Any]
) -> list[Data]:
    """List the deciding values of a draft that nobody gave, as rows of ``[assumed]``.

    Examples stand first, then derived values and defaults, then copied ones. ``values`` are the
    given keys, ``derived`` the values that follow from them; others are copied from the study
    ``origin``. A row of that study keeps its source while its value is the same.
    """
    tables = tomllib.loads(text)
    earlier_sources = {
        row["key"]: row["source"]
        for row in value_at(tables, "assumed.values") or []
        if row.get("value") == value_at(tables, row["key"])
    }
    kind = value_at(tables, KIND)
    examples: list[Data] = []
    rows: list[Data] = []
    copied_rows: list[Data] = []
    for key in dotted_keys(tables):
        is_given = any(is_under(key, given_key) for given_key in values)
        if is_given or not any(is_under(key, stem) for stem in DECIDING_STEMS):
            continue
        source = earlier_sources.get(key, f"as in '{origin}'")
        group = copied_rows
        if key in derived and key in ACTUATOR_NUMBERS:
            source = f"example of actuation.kind = '{kind}'"
            group = examples
        elif key in derived:
            source = f"derived from given values and '{origin}'"
            group = rows
        group.append({"key": key, "value": value_at(tables, key), "source": source})
    for key, _, reason in _defaults(partial(value_at, tables)):
        rows.append({"key": key, "source": f"default, {reason}"})
    return [*examples, *rows, *copied_rows]


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
    inherited = {
        key: value_at(tables, key)
        for key in dotted_keys(tables)
        if key not in new_keys and key.partition(".")[0] not in new_keys
    }
    notes = []
    for answer, deciding in DECIDING.items():
        keys = [key for stem in deciding for key in inherited if is_under(key, stem)]
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
                f"{variable_key(key)} is [{low:g}, {high:g}], which does not hold your own "
                f"{value:g}: no search can propose it; widen the range"
            )
    return [*warnings, *notes_of(study)]


def changed_values(values: Mapping[str, Any], defaults: Mapping[str, Any]) -> Data:
    """Select the values that differ from their defaults."""
    return {key: value for key, value in values.items() if value != defaults[key]}


def user_values(
    values: Mapping[str, Any], answers: Data, defaults: Data, typed_keys: Collection[str] = ()
) -> Data:
    """Return given ``values``, then answers other than the default; operating points together.

    Answers to ``typed_keys`` are the user's own where they equal the default too.
    """
    changes = changed_values(answers, defaults)
    points = OPERATION if changes.keys() & OPERATION else ()
    user_keys = [key for key in answers if key in changes or key in typed_keys or key in points]
    return {**values, **{key: answers[key] for key in user_keys}}


def settled_keys(values: Mapping[str, Any]) -> set[str]:
    """List the keys of questions that given ``values`` answer, or state as another quantity."""
    given_keys = {key for key, value in values.items() if value is not None}
    keys = {key for key in WORDS if any(is_under(key, stem) for stem in given_keys)}
    if BACKLASH_DEG in given_keys:
        keys.add(BACKLASH)
    if given_keys & {POINTS, POINT_SET}:
        keys.update(OPERATION)
    return keys


def is_void(key: str, answers: Mapping[str, Any]) -> bool:
    """Test whether an earlier answer leaves a question without a subject."""
    part = {CREST: CHAMFER_BACK, PLAY_DEVIATION: BACKLASH}.get(key)
    return part is not None and answers.get(part) == 0


#: Keys whose answer may be a sum of the areas of several pistons.
AREAS = ("actuation.area_cm2", "actuation.back_area_cm2")


def _further_units(key: str, answers: Mapping[str, Any]) -> dict[str, float]:
    """Return the factors of further units of a question, by unit."""
    if key == BACKLASH and answers.keys() >= set(DIAMETERS):
        return {"deg": mm_per_deg(*map(answers.__getitem__, DIAMETERS))}
    if key == COAST and answers.get(TORQUE, 0.0) > 0.0:
        return {"Nm": 1.0 / answers[TORQUE]}
    return {}


def value_of(key: str, text: str, *, default: Any, answers: Mapping[str, Any]) -> Any:
    """Read the answer to the question of a key, as a value of the kind of its ``default``.

    A backlash may be in degrees and the torque of the braking flank in N m. A range of operating
    points is a uniform distribution, one of a list its ends, one of the speed of the shafts its
    middle. Raises InputError.
    """
    if isinstance(default, str):
        return choice_of(text, CHOICES.get(key, ()))
    if "+" in text and key in AREAS:
        answer = read_sum(text, unit_of(key))
    else:
        answer = read_numbers(text, unit_of(key), _further_units(key, answers))
    numbers = [rounded(number) for number in answer.numbers]
    takes_list = isinstance(default, (list, tuple, Mapping))
    if answer.ranged and not takes_list:
        middle = 0.5 * sum(numbers)
        if key == SPEED:
            return middle
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
