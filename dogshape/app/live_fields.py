"""Fields of the live page: keys of the study file and of a shift, by group.

A field with ends has a slider, and begins with the study's value as its text. Another one is empty
at the start, which stands for the study's value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, get_args

from dogshape.bench.texts import text_of
from dogshape.pipeline.config.operating import KIND, PROFILE_KEYS, value_at
from dogshape.pipeline.config.schema import StudyFile, dotted_key, flat_name
from dogshape.pipeline.config.study_file import Setup, find_study
from dogshape.pipeline.config.toml_text import meanings_of
from dogshape.pipeline.diagnose.study_keys import Data, rounded
from dogshape.pipeline.drafts.draft_keys import (
    ACTUATION,
    ACTUATOR_NUMBERS,
    CHOICES,
    MATERIAL,
    OPERATION,
    TORQUE,
    WORDS,
)
from dogshape.pipeline.drafts.draft_source import COMMENTED
from dogshape.pipeline.drafts.study_folder import operating_lists
from dogshape.pipeline.reports.text import PLACE, label
from dogshape.sim.clutch_tables import section_in
from dogshape.sim.quantity import quantities_of, record_quantities
from dogshape.sim.shift.actuators import EXAMPLES, KINDS, SECTION, keys_of, optional_values
from dogshape.sim.strength.load_case import LoadCase
from dogshape.sim.strength.manufacture import ManufacturingLimits, Tolerances
from dogshape.sim.strength.materials import material_of
from dogshape.sim.units import RPM, unit_of

ANGLE_KEY = "angle_deg"
DEFAULT_REACH = 0.2  #: of a slider on either side, over the value, where the study has no range
TORQUE_REACH = 0.5  #: of the slider of the torque on either side, over the torque
#: Keys that belong to one kind of actuator or another.
ACTUATOR_KEYS = (*ACTUATOR_NUMBERS, *(f"{SECTION}.{key}" for key in PROFILE_KEYS))
#: Groups of the fields with their titles, in the order of the page.
GROUPS = {
    "dog": "Dogs",
    "point": "Operating points",
    "load": "Load",
    "material": "Material",
    "limit": "Limits of the checks",
    "tolerance": "Tolerances",
    "actuator": "Actuator",
    "friction": "Friction",
    "shift": "Single shift",
}
#: Label and upper end of the slider of each coefficient of friction.
FRICTION_FIELDS = {
    "contact.static_friction": ("in the shift, static", 0.6),
    "contact.dynamic_friction": ("in the shift, sliding", 0.6),
    "load.friction_release": ("release, highest", 0.6),
    "load.friction_hold": ("holding, lowest", 0.3),
}
#: Keys of the load case that limit a check.
LOAD_LIMITS = (
    "load.safety",
    "load.safety_fatigue",
    "load.separating_force_limit_N",
    "load.pull_out_force_limit_N",
    "load.landing_share",
)
#: Labels of keys whose name says too little beside others.
FIELD_WORDS = {
    "mismatch_rpm": "mismatch",
    "operating.mismatch_rpm": "mismatches of the study",
    "operating.force_N": "forces of the study",
    "material.set": "material",
    KIND: "kind",
    "actuation.force_N": "final forces",
    "actuation.rise_s": "rise times of these",
    "load.shifts": "shifts over the life",
}


@dataclass(frozen=True)
class PageField:
    """A field of the page: a key of the study file or, without a dot, of a shift.

    ``default`` is the study's value; None for a key that the study lacks. ``ends`` are those of the
    slider, None without one. ``words`` is the label, ``choices`` are the texts to choose from.
    """

    key: str
    group: str
    default: Any
    ends: tuple[float, float] | None = None
    words: str = ""
    choices: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Key without its table, but for the output ring's dog."""
        return flat_name(self.key)

    @property
    def text(self) -> str:
        """Text of the field at the start."""
        return "" if self.ends is None else f"{self.default:.6g}"

    @property
    def label(self) -> str:
        """Words before the field."""
        return self.words or FIELD_WORDS.get(self.key) or label(self.name)

    @property
    def unit(self) -> str:
        """Unit of a number without another one."""
        return "" if self.choices else unit_of(self.name)


def empty_value(key: str) -> Any:
    """Return an empty value of the type of a key: a list, a whole number or a number."""
    table, _, name = key.partition(".")
    section = section_in(StudyFile.model_fields[table].annotation)
    annotation = section.model_fields[name].annotation if section else None
    kinds = {annotation, *get_args(annotation)}
    if key in (*OPERATION, *(f"{SECTION}.{name}" for name in PROFILE_KEYS)):
        return []
    return 0 if int in kinds else 0.0


def fields_of(config: Setup, tables: Data) -> list[PageField]:
    """List the fields of a study by group; ``tables`` are those of its file."""
    return [
        *_dog_fields(config),
        *_point_fields(config, tables),
        *_load_fields(config),
        *_material_fields(config),
        *_actuator_fields(config),
        *_friction_fields(config),
        _angle_field(config),
    ]


def _dog_fields(config: Setup) -> list[PageField]:
    """List the dimensions of the dog, variables of the search first, with their ranges."""
    values = config.file.dog.sizes | {key: config.prototype[key] for key in config.shape_keys}
    dog = {key: value for key, value in values.items() if value is not None}
    return [
        PageField(dotted_key(key), "dog", dog[key], config.variables.get(key) or _reach(dog[key]))
        for key in sorted(dog, key=[*config.variables, *dog].index)
    ]


def _reach(value: float, share: float = DEFAULT_REACH) -> tuple[float, float]:
    """Return the ends of a slider about a value; ``share`` of it on either side."""
    reach = share * abs(value) or 1.0
    return value - reach, value + reach


def _point_fields(config: Setup, tables: Data) -> list[PageField]:
    """List mismatch and force of the middle point, and those of all points."""
    points = [(point.mismatch / RPM, point.profile.force) for point in config.points]
    middle = sorted(points)[len(points) // 2]
    fields = []
    for key, value, column in zip(PLACE, middle, zip(*points, strict=True), strict=True):
        low, high = min(column), max(column)
        ends = (low, high) if low < high else _reach(value)
        fields.append(PageField(key, "point", value, ends))
    for key, values in operating_lists(partial(value_at, tables)).items():
        fields.append(PageField(key, "point", values))
    return fields


def _load_fields(config: Setup) -> list[PageField]:
    """List the numbers of load case, workshop and tolerances."""
    file = config.file
    numbers = _numbers("load", LoadCase, file.load)
    limits = {key: numbers.pop(key) for key in LOAD_LIMITS}
    limits |= _numbers("manufacturing", ManufacturingLimits, file.manufacturing)
    groups = {
        "load": {key: value for key, value in numbers.items() if key not in FRICTION_FIELDS},
        "limit": limits,
        "tolerance": _numbers("tolerance", Tolerances, file.tolerance),
    }
    fields = [
        PageField(key, group, value)
        for group, values in groups.items()
        for key, value in values.items()
        if key != TORQUE
    ]
    torque = numbers[TORQUE]
    return [PageField(TORQUE, "load", torque, _reach(torque, TORQUE_REACH)), *fields]


def _numbers(table: str, kind: Any, section: Any) -> Data:
    """Return the values of a section of the study file by dotted key; None for an absent one."""
    keys = [declared.key for declared in quantities_of(kind).values()]
    return {f"{table}.{key}": getattr(section, key) for key in keys}


def _material_fields(config: Setup) -> list[PageField]:
    """List name and numbers of the material."""
    material_set = config.file.material.set
    values = material_defaults(config, material_set)
    return [
        PageField(MATERIAL, "material", material_set, choices=CHOICES[MATERIAL]),
        *(PageField(key, "material", value) for key, value in values.items()),
    ]


def material_defaults(config: Setup, material_set: str) -> Data:
    """Return the numbers of a material by dotted key: those of the study, then of the set."""
    section = config.file.material
    numbers = record_quantities(material_of(material_set))
    own_numbers = {key: getattr(section, key) for key in numbers}
    values = {key: own_numbers[key] or rounded(number) for key, number in numbers.items()}
    return {f"material.{key}": value for key, value in values.items()}


def _actuator_fields(config: Setup) -> list[PageField]:
    """List the numbers of every kind of actuator, and the times of the control."""
    file = config.file
    defaults = actuator_defaults(config, file.actuation.kind)
    defaults |= {
        "shift.timeout_s": file.shift.timeout_s,
        "shift.retraction_s": file.shift.retraction_s,
    }
    return [
        PageField(KIND, "actuator", file.actuation.kind, choices=CHOICES[KIND]),
        *(PageField(key, "actuator", defaults.get(key)) for key in ACTUATION),
    ]


def actuator_defaults(config: Setup, kind: str) -> Data:
    """Return the numbers of a kind of actuator by dotted key: of the study, or an example's.

    A key without either is None.
    """
    section = config.file.actuation
    keys = keys_of(kind) if kind in KINDS else PROFILE_KEYS
    if kind == section.kind:
        numbers = {key: getattr(section, key) for key in keys}
    elif kind in KINDS:
        example = record_quantities(EXAMPLES[kind])
        numbers = {key: rounded(example[key]) for key in keys}
    else:
        numbers = dict.fromkeys(keys)
    if kind in KINDS:
        optional = optional_values(kind)
        for key in optional:
            if kind != section.kind or numbers[key] is None:
                numbers[key] = optional[key]
    return {f"{SECTION}.{key}": value for key, value in numbers.items()}


def _friction_fields(config: Setup) -> list[PageField]:
    """List the coefficients of friction of contact and load."""
    file = config.file
    friction = {f"contact.{key}": value for key, value in vars(file.contact.value).items()}
    friction |= {f"load.{key}": value for key, value in file.load}
    return [
        PageField(key, "friction", friction[key], (0.0, end), text)
        for key, (text, end) in FRICTION_FIELDS.items()
    ]


def _angle_field(config: Setup) -> PageField:
    """Return the relative angle of a single shift, within a pitch."""
    turn = round(360.0 / config.clutch.dog.count, 2)
    return PageField(ANGLE_KEY, "shift", 0.4 * turn, (0.0, turn), "relative angle")


def field_hints(fields: Sequence[PageField]) -> dict[str, str]:
    """Explain the keys of fields: words of the questions, or those of the explained study."""
    comments = meanings_of(text_of(find_study(COMMENTED)))
    hints = {}
    for field in fields:
        comment = comments.get(field.key, "").lstrip("# ")
        question = WORDS.get(field.key, "")
        is_explained = field.group in ("load", "limit", "tolerance", "material")
        words = (comment or question) if is_explained else (question or comment)
        hints[field.key] = f"{words}\n{field.key}" if words else field.key
    return hints
