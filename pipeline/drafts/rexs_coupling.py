r"""Values of a study from a switchable coupling of a REXS model, and what the model leaves open.

*State*: a coupling is engaged in a load case if its ``is_engaged`` is true for the gear
``gear_shift_index``, counted from 1 (spec.rexs.info/1.5, "Shifting states"), or without these if it
transmits a torque. *Torque*: the largest one of the engaged load cases is the rated torque, the
largest of the other sign over it the share of the braking flank. *Inertia* of a side: its shaft's
additional masses and sections,
:math:`J = \pi \varrho L/10 \sum_{k=0}^{4} (R_1^{4-k} R_2^k - r_1^{4-k} r_2^k)`, if nothing else
turns with it, as REXS gives no inertia of gears.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dogshape.pipeline.diagnose.study_keys import Data, rounded
from dogshape.pipeline.drafts.draft_keys import COAST, INERTIAS, MASS, MISMATCH, SPEED, TORQUE
from dogshape.pipeline.drafts.rexs_model import RexsComponent, RexsLoadCase, RexsModel
from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.interface import argument, key_argument
from dogshape.sim.units import MM

COUPLING = "switchable_coupling"
SIDES = ("inner", "outer")  #: sides of a coupling, by their role in its relation
#: Parts of a shaft that have no inertia, or whose inertia is that of their section.
STILL_PARTS = (
    *("external_load", "notch_effect_generic", "rectangular_groove", "round_groove", "v_notch"),
    *("shaft_shoulder", "shaft_shoulder_with_undercut", "transverse_bore"),
)
DENSITY = 1e3  #: kg/m3 of a kg/dm3
#: Difference of two speeds or torques that are the same, over the larger.
TOLERANCE = 0.01


class RexsNote(NamedTuple):
    """Sentence on the value of a key, or on attributes that are not taken (without a key)."""

    text: str
    key: str = ""


@dataclass(frozen=True)
class RexsReading:
    """Values of a study that a coupling gives, by dotted key, and what it leaves open."""

    source: str  #: file, version and coupling
    values: Data
    notes: list[RexsNote]
    questions: dict[str, str]  #: sentence by the key or argument that answers it

    def sentences(self, values: Data) -> list[str]:
        """List the notes on a study with ``values``, which may be others than those read."""
        texts = [
            note.text
            for note in self.notes
            if not note.key or values.get(note.key) == self.values[note.key]
        ]
        return [f"gearbox: {text}" for text in (self.source, *texts)]

    def require_answers(self, keys: Sequence[str]) -> None:
        """Raise InputError unless ``keys`` are given that the model leaves open."""
        questions = [text for key, text in self.questions.items() if key not in keys]
        if questions:
            raise InputError("\n- ".join([f"{self.source} leaves open", *questions]))


class _Operation(NamedTuple):
    """State of a coupling in a load case."""

    load_case: RexsLoadCase
    engaged: bool
    torque: float | None  #: on the inner side, N m
    inner_speed: float | None  #: 1/min
    outer_speed: float | None  #: 1/min

    @property
    def text(self) -> str:
        """Name of the load case."""
        number = self.load_case.number
        return f"load case {number}" if number else "the model"


def couplings_of(model: RexsModel) -> list[RexsComponent]:
    """List the switchable couplings of a model; InputError if it has none."""
    couplings = model.of_kind(COUPLING)
    if not couplings:
        raise InputError(
            f"{model.file} has no {COUPLING}; export the gearbox with the coupling as that type"
        )
    return couplings


def coupling_of(model: RexsModel, number: int | None) -> RexsComponent:
    """Choose a coupling by its id, or the only one; InputError for none or several."""
    couplings = couplings_of(model)
    names = ", ".join(coupling.text for coupling in couplings)
    if number is None and len(couplings) == 1:
        return couplings[0]
    if number is None:
        option = argument("coupling", couplings[0].number)
        raise InputError(f"{model.file} has {names}; choose one, as {option}")
    for coupling in couplings:
        if coupling.number == number:
            return coupling
    hint = did_you_mean(str(number), [str(coupling.number) for coupling in couplings])
    raise InputError(f"{argument('coupling', number)} is no coupling of {model.file}; {hint}")


def sides_of(model: RexsModel, coupling: RexsComponent) -> dict[str, RexsComponent]:
    """Find the components on the inner and the outer side; InputError without them."""
    for members in model.related("side", "assembly", coupling.number):
        parts = {side: model.components.get(members.get(f"{side}_part", -1)) for side in SIDES}
        sides = {side: part for side, part in parts.items() if part is not None}
        if len(sides) == len(SIDES):
            return sides
    raise InputError(
        f"{model.file}: {coupling.text} has no relation 'side' with inner_part and outer_part; "
        "export the model with both sides of the coupling"
    )


def read_coupling(
    model: RexsModel, coupling: RexsComponent, sliding_side: str | None = None
) -> RexsReading:
    """Read the values of a study from a coupling of a model.

    ``sliding_side``, inner or outer, is the side that slides. Raises InputError for contradictions
    of the model.
    """
    sides = sides_of(model, coupling)
    operations = [_operation(model, coupling, sides, case) for case in model.load_cases]
    engaged = [operation for operation in operations if operation.engaged]
    reading = RexsReading(
        source=f"{coupling.text} of {model.file.name}, REXS {model.version}",
        values={},
        notes=[],
        questions={},
    )
    _read_torque(reading, model, engaged)
    _read_speed(reading, engaged)
    _note_open_cases(reading, operations)
    _read_inertias(reading, model, coupling, sides, sliding_side)
    _note_size(reading, model, coupling)
    return reading


def _operation(
    model: RexsModel,
    coupling: RexsComponent,
    sides: dict[str, RexsComponent],
    load_case: RexsLoadCase,
) -> _Operation:
    """Read the state of a coupling in a load case; InputError for a contradiction."""
    torques = [
        model.number(coupling, f"torque_acting_on_{side}_component_u", load_case) for side in SIDES
    ]
    inner_torque, outer_torque = torques
    torque = inner_torque if outer_torque is None else -outer_torque
    speeds = [model.number(sides[side], "rotational_speed", load_case) for side in SIDES]
    flags = model.flags(coupling, "is_engaged", load_case)
    gears = [
        gear
        for unit in model.of_kind("gear_unit")
        if (gear := model.number(unit, "gear_shift_index", load_case)) is not None
    ]
    engaged = bool(torque)
    if flags is not None and (len(flags) == 1 or len(gears) == 1):
        gear = int(gears[0]) if len(flags) > 1 else 1
        if not 1 <= gear <= len(flags):
            raise InputError(
                f"{model.file}: gear_shift_index is {gear}, but is_engaged of {coupling.text} has "
                f"{len(flags)} gears; correct the file"
            )
        engaged = flags[gear - 1]
    operation = _Operation(load_case, engaged, torque, *speeds)
    place = f"{model.file}: {coupling.text}, {operation.text}"
    if inner_torque is not None and outer_torque is not None:
        _require_equal(place, "torques on the inner and, negative, on the outer side",
                       (inner_torque, -outer_torque), "N m")  # fmt: skip
    if engaged:
        _require_equal(place, "speeds of both engaged sides", speeds, "1/min")
    return operation


def _require_equal(place: str, name: str, pair: Sequence[float | None], unit: str) -> None:
    """Raise InputError for two values that differ; None is no value."""
    first, second = pair
    if first is None or second is None:
        return
    if abs(first - second) > TOLERANCE * max(abs(first), abs(second)):
        raise InputError(
            f"{place}: {name} are {first:g} and {second:g} {unit}, but they must be equal; correct "
            "the file"
        )


def _read_torque(reading: RexsReading, model: RexsModel, engaged: Sequence[_Operation]) -> None:
    """Read rated torque and share of the braking flank from the engaged load cases.

    The classes of the load spectrum are described, as REXS does not give their cycles.
    """
    loads = [(operation, operation.torque) for operation in engaged if operation.torque]
    if not loads:
        reading.notes.append(RexsNote("no torque of the engaged coupling is given"))
        return
    largest, torque = max(loads, key=lambda load: abs(load[1]))
    reading.values[TORQUE] = rounded(abs(torque))
    text = (
        f"{TORQUE} = {abs(torque):g} is the largest torque about the axis on its sides, of "
        f"{largest.text}; load.application_factor multiplies it"
    )
    reading.notes.append(RexsNote(text, TORQUE))
    shares = [load / torque for _, load in loads]
    coast_share = -min(shares)
    if coast_share > 0.0:
        reading.values[COAST] = rounded(coast_share)
        text = f"{COAST} = {coast_share:.4g} has the largest torque of the other sign"
        reading.notes.append(RexsNote(text, COAST))
    if len(loads) > 1:
        classes = [
            f"{share:.3g}{_duration_text(model, operation.load_case)}"
            for share, (operation, _) in zip(shares, loads, strict=True)
        ]
        text = (
            f"load spectrum, torque over {TORQUE}: {', '.join(classes)}; REXS counts hours, and "
            "load.spectrum the load cycles of a dog, so give it with your cycles"
        )
        reading.notes.append(RexsNote(text, TORQUE))


def _read_speed(reading: RexsReading, engaged: Sequence[_Operation]) -> None:
    """Read the speed of both shafts if all engaged load cases have the same one."""
    speeds = [
        abs(speed)
        for operation in engaged
        for speed in [
            operation.inner_speed if operation.outer_speed is None else operation.outer_speed
        ]
        if speed is not None
    ]
    if not speeds:
        reading.notes.append(RexsNote("no rotational_speed of the engaged sides is given"))
    elif max(speeds) - min(speeds) <= TOLERANCE * max(speeds):
        reading.values[SPEED] = rounded(max(speeds))
        text = f"{SPEED} = {max(speeds):g} is rotational_speed of the engaged sides"
        reading.notes.append(RexsNote(text, SPEED))
    else:
        option = key_argument("settings", SPEED, rounded(max(speeds)))
        reading.questions[SPEED] = (
            f"the engaged coupling turns at {min(speeds):g} to {max(speeds):g} 1/min, but a study "
            f"has one speed of both shafts; give it, as {option}"
        )


def _duration_text(model: RexsModel, load_case: RexsLoadCase) -> str:
    """Write the share of the operating time of a load case, with its hours if they are known."""
    for unit in model.of_kind("gear_unit"):
        percentage = model.number(unit, "operating_time_fraction", load_case)
        hours = model.number(unit, "operating_time", load_case)
        if percentage is not None:
            total = "" if hours is None else f" of {hours:g} h"
            return f" over {percentage:g} %{total}"
    return ""


def _note_open_cases(reading: RexsReading, operations: Sequence[_Operation]) -> None:
    """Describe the speeds past each other of the open coupling, which are no mismatch."""
    texts = []
    for operation in operations:
        speeds = operation.inner_speed, operation.outer_speed
        if not operation.engaged and None not in speeds:
            inner_speed, outer_speed = (speed or 0.0 for speed in speeds)
            texts.append(f"{abs(inner_speed - outer_speed):g} 1/min in {operation.text}")
    if texts:
        text = (
            f"sides of the open coupling turn past each other by {', '.join(texts)}; {MISMATCH} is "
            "the rest after synchronization, which REXS does not give"
        )
        reading.notes.append(RexsNote(text))


def _read_inertias(
    reading: RexsReading,
    model: RexsModel,
    coupling: RexsComponent,
    sides: dict[str, RexsComponent],
    sliding_side: str | None,
) -> None:
    """Read the inertia of each side if the model has all of it."""
    inertias = {}
    for side, component in sides.items():
        inertia, missing_parts = _side_inertia(model, coupling, component)
        if missing_parts:
            part_text = f", the given parts alone {inertia:.4g} kg m2" if inertia else ""
            text = (
                f"inertia of the {side} side is incomplete{part_text}: the file has none of "
                f"{', '.join(missing_parts)}"
            )
            reading.notes.append(RexsNote(text))
        else:
            inertias[side] = inertia
    if not inertias:
        return
    if sliding_side is None:
        names = " or ".join(f"{side}, {part.text}" for side, part in sides.items())
        option = argument("sliding_side", SIDES[0])
        reading.questions["sliding_side"] = (
            f"REXS does not say which side of the coupling slides: {names}; say it, as {option}"
        )
        return
    for side, inertia in inertias.items():
        key = INERTIAS[side != sliding_side]
        reading.values[key] = rounded(inertia)
        text = f"{key} = {inertia:.4g} is that of additional masses and sections of "
        reading.notes.append(RexsNote(text + sides[side].text, key))


def _side_inertia(
    model: RexsModel, coupling: RexsComponent, side: RexsComponent
) -> tuple[float, list[str]]:
    """Add up the inertia of the parts of a side, kg m2, and list the parts that have none."""
    if side.kind != "shaft":
        return 0.0, [side.label]
    inertia = 0.0
    missing_parts = []
    part_numbers = [
        members["part"] for members in model.related("assembly", "assembly", side.number)
    ]
    for number in part_numbers:
        part = model.components[number]
        part_inertia: float | None = None
        if part.kind in STILL_PARTS:
            continue
        if part.kind == "additional_mass":
            part_inertia = model.number(part, "moment_of_inertia_u_axis")
        elif part.kind == "shaft_section":
            part_inertia = _section_inertia(model, side, part)
        if part_inertia is None:
            missing_parts.append(part.label)
        else:
            inertia += part_inertia
    missing_parts += _connected_parts(model, coupling, side)
    return inertia, missing_parts or ([] if inertia else [side.label])


def _connected_parts(model: RexsModel, coupling: RexsComponent, side: RexsComponent) -> list[str]:
    """List the connections of a side to other parts, beside bearings and its coupling."""
    labels = []
    for role in ("inner_part", "outer_part"):
        for members in model.related("side", role, side.number):
            connection = model.components[members["assembly"]]
            if connection != coupling and "bearing" not in connection.kind:
                labels.append(f"the parts behind {connection.label}")
    return labels


def _section_inertia(
    model: RexsModel, shaft: RexsComponent, section: RexsComponent
) -> float | None:
    """Compute the inertia of a conical section of a shaft, kg m2; None for a missing size."""
    materials = [
        model.components[members["referenced"]]
        for members in model.related("reference", "origin", shaft.number)
    ]
    densities = [
        density
        for material in materials
        if material.kind == "material"
        and (density := model.number(material, "density")) is not None
    ]
    outer_sizes = [model.number(section, f"outer_diameter_{end}") for end in ("begin", "end")]
    inner_sizes = [model.number(section, f"inner_diameter_{end}") for end in ("begin", "end")]
    length = model.number(section, "length")
    if not densities or length is None or None in outer_sizes:
        return None
    powers = []
    for sizes in (outer_sizes, inner_sizes):
        begin, end = (0.5 * MM * (size or 0.0) for size in sizes)
        powers.append(sum(begin ** (4 - k) * end**k for k in range(5)))
    outer_power, inner_power = powers
    return math.pi * DENSITY * densities[0] * MM * length / 10.0 * (outer_power - inner_power)


def _note_size(reading: RexsReading, model: RexsModel, coupling: RexsComponent) -> None:
    """Describe size and mass of the coupling, which are not those of its dogs and ring."""
    names = {"outer_diameter": "mm", "inner_diameter": "mm", "length": "mm",
             "mass_of_component": "kg"}  # fmt: skip
    texts = [
        f"{name} {value:g} {unit}"
        for name, unit in names.items()
        if (value := model.number(coupling, name)) is not None
    ]
    if texts:
        text = (
            f"not taken: {', '.join(texts)} of the coupling as a whole; give the dogs ([dog]) and "
            f"the ring that slides ({MASS})"
        )
        reading.notes.append(RexsNote(text))
