"""Body of the co-simulation FMU: one engagement as a block of a driveline model.

Variables, state and steps of the block are the same in all versions of FMI; ``fmi2_slave`` and
``fmi3_slave`` declare them to pythonfmu and pythonfmu3. The physics is that of
``sim.shift.stepped_shift``. All values are in SI units. Speeds, angles and torques count positive
in the sense in which the engine turns.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from uuid import NAMESPACE_URL, uuid5

from dogshape.pipeline.config.operating import Actuation
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import DogshapeError, require_between
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.commanded_actuator import CommandCourse
from dogshape.sim.shift.stepped_shift import (
    SavedShift,
    ShiftStart,
    StepLoads,
    SteppedShift,
    StepPhase,
    start_of,
)
from dogshape.sim.units import suffix_of
from dogshape.sim.versions import program_versions

MODEL = "DogClutch"  #: name of the model and of its library within the FMU
RESOURCE = "study.json"  #: study file within the FMU
STEP_S = 1e-3  #: communication step that the FMU proposes
MIN_STEP_S = 1e-9  #: least communication step, and distance of a step from the end of the last one
MAX_STEP_S = 3600.0
MAX_LOAD = 1e9  #: N and N m
NOT_ENGAGED_S = -1.0  #: time of an engagement that has not happened
DESCRIPTION = (
    "One engagement of a dog clutch by the compiled engine of dogshape. Needs Python with the "
    "package dogshape."
)
#: Exponents of base units by the name of an SI unit.
UNITS: dict[str, dict[str, int]] = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"s": -1, "rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N.s/m": {"kg": 1, "s": -1},
    "m/N": {"kg": -1, "s": 2},
    "s/m": {"m": -1, "s": 1},
    "Pa/m": {"kg": 1, "m": -2, "s": -2},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
}
#: Further ones of an actuator.
ACTUATOR_UNITS: dict[str, dict[str, int]] = {
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "m3/s": {"m": 3, "s": -1},
    "m3/(s.Pa)": {"kg": -1, "m": 4, "s": 1},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}
#: SI unit by the suffix of a key of a study file.
SI_UNITS = {
    "_mm": "m",
    "_mm_kN": "m/N",
    "_deg": "rad",
    "_rpm": "rad/s",
    "_m_s": "m/s",
    "_s": "s",
    "_N": "N",
    "_Ns_m": "N.s/m",
    "_s_m": "s/m",
    "_Nm": "N.m",
    "_Nm_rad": "N.m/rad",
    "_Nms_rad": "N.m.s/rad",
    "_Pa_m": "Pa/m",
    "_kg": "kg",
    "_kgm2": "kg.m2",
    "_bar": "Pa",
    "_MPa": "Pa",
    "_N_mm": "N/m",
    "_cm2": "m2",
    "_cm3": "m3",
    "_l_min": "m3/s",
    "_dm3_s_bar": "m3/(s.Pa)",
    "_A": "A",
    "_V": "V",
    "_ohm": "Ohm",
    "_mH": "H",
}
#: Parts of a clutch whose quantities are parameters; of a drive those that follow the speeds.
PARTS = ("dog", "rings", "contact", "mechanism", "drive", "actuator")
DRIVE_PARAMETERS = ("pack_torque", "pack_viscous", "pack_speed", "synchroniser")
#: Quantities between the command of an actuator and its static force.
ACTUATION_PARAMETERS = ("delay", "lag", "loss", "factor")
#: Meaning of each parameter.
MEANINGS = {
    "dog.count": "dogs of a ring",
    "dog.chamfer": "fall of the face from ridge to braking flank",
    "dog.traction": "side angle of the traction flank, negative if undercut",
    "dog.braking": "side angle of the braking flank, negative if undercut",
    "dog.height": "crest above root",
    "dog.outer_diameter": "outer diameter of the dogs",
    "dog.inner_diameter": "inner diameter of the dogs",
    "dog.axial_gap": "gap between the crests of both rings before the shift",
    "dog.edge_radius": "radius of crest and tip edges; 0 is sharp",
    "dog.crest": "place of the ridge, 0 at the braking and 1 at the traction edge",
    "dog.chamfer_back": "fall of the back from ridge to traction flank",
    "dog.backlash": "play of the seated pair at the mean radius",
    "rings.mass": "mass of the sliding ring",
    "rings.sliding_inertia": "inertia of the side of the sliding ring, ring included",
    "rings.output_inertia": "inertia of the side of the output ring, wheel included",
    "contact.static_friction": "static friction of the dogs",
    "contact.dynamic_friction": "dynamic friction of the dogs",
    "contact.stiction_velocity": "slip below which friction is smooth",
    "contact.stiffness": "pressure over penetration of the compliant layer",
    "contact.dissipation": "dissipation of Hunt and Crossley",
    "contact.face_friction": "friction of faces on faces",
    "mechanism.added_mass": "mass that moves with the ring, as felt at it",
    "mechanism.friction": "friction of the ring along its shaft",
    "mechanism.damping": "viscous damping of the ring along its shaft",
    "mechanism.detent": "peak force of the detent",
    "mechanism.detent_position": "travel at the peak of the detent",
    "mechanism.detent_width": "way of the detent",
    "mechanism.detent_seat": "travel at the peak of the pull into the seat; 0 without a seat",
    "mechanism.spline_friction": "friction of the ring's toothing",
    "mechanism.spline_radius": "radius of the ring's toothing",
    "mechanism.drag_torque": "drag of the sliding side to the housing",
    "mechanism.compliance": "compliance of the linkage between actuator and ring",
    "mechanism.free_play": "play between linkage and ring",
    "mechanism.ring_inertia": "inertia of the ring, a part of rings.sliding_inertia; 0: all",
    "mechanism.input_stiffness": "stiffness of the shaft behind the ring",
    "mechanism.backlash": "play of the ring's toothing",
    "mechanism.wheel_inertia": "inertia at the flanks of the output side, a part of "
    "rings.output_inertia; 0: all",
    "mechanism.output_stiffness": "stiffness of the shaft behind the wheel",
    "drive.pack_torque": "Coulomb drag of a wet pack on the engine's side",
    "drive.pack_viscous": "viscous drag of a wet pack on the engine's side",
    "drive.pack_speed": "speed of the other side of the pack",
    "drive.synchroniser": "torque of a synchroniser between both sides",
}
#: Meaning of each parameter of a block with an actuator; some kinds share a name.
ACTUATOR_MEANINGS = {
    "actuator.preload": "force of the spring at the start",
    "actuator.rate": "rate of the spring",
    "actuator.stroke": "stroke of the actuator",
    "actuator.ramp": "angle of the drum over which the groove rises",
    "actuator.drum_speed": "speed of the drum",
    "actuator.stiffness": "stiffness between drum or spindle and fork",
    "actuator.force_limit": "force limit of the drum's drive",
    "actuator.dwell": "angle of the drum before the groove rises",
    "actuator.stall_torque": "stall torque of the motor",
    "actuator.no_load_speed": "no-load speed of the motor",
    "actuator.torque_limit": "torque limit of the motor's control",
    "actuator.inertia": "inertia of rotor and gear",
    "actuator.gear_ratio": "speed of the motor over that of spindle or pinion",
    "actuator.lead": "travel of the fork per revolution behind the gear",
    "actuator.efficiency": "efficiency of gear and spindle",
    "actuator.supply": "supply pressure above the ambient one",
    "actuator.area": "area of the piston",
    "actuator.dead_volume": "volume of cylinder and pipes at the start",
    "actuator.back_pressure": "pressure on the back side above the ambient one",
    "actuator.back_area": "area of the back side",
    "actuator.return_preload": "force of the return spring at the start",
    "actuator.return_rate": "rate of the return spring",
    "actuator.conductance": "conductance of valve and pipe, ISO 6358-1",
    "actuator.critical_ratio": "critical ratio of pressures, ISO 6358-1",
    "actuator.flow": "flow of the valve at its rated drop",
    "actuator.drop": "rated drop of pressure over the valve",
    "actuator.bulk_modulus": "bulk modulus of the oil with air and walls",
    "actuator.start_force": "force of the open armature at the current of both forces",
    "actuator.end_force": "force at the end of the stroke at the current of both forces",
    "actuator.voltage": "voltage of the full command",
    "actuator.resistance": "resistance of the warm coil",
    "actuator.inductance": "inductance at the open armature",
    "actuator.rated_current": "current of both forces; 0: voltage over resistance",
    "actuation.delay": "dead time from a command to its force",
    "actuation.lag": "lag of first order behind the force of a spring",
    "actuation.loss": "constant part of the force that never reaches the ring",
    "actuation.factor": "factor on the static force",
}
INPUTS = {
    "shift_force": ("N", "force on actuator or sliding ring into engagement"),
    "sliding_torque": ("N.m", "torque on the side of the sliding ring"),
    "output_torque": ("N.m", "torque on the side of the output ring"),
}
COMMAND = "command"  #: input of a block with an actuator
COMMAND_MEANING = (
    "static force of the actuator over its full one, 0 is off; in place of shift_force"
)
STARTS = {
    "start.sliding_speed": ("rad/s", "speed of the sliding ring"),
    "start.output_speed": ("rad/s", "speed of the output ring"),
    "start.relative_angle": ("rad", "lead of the output ring over dogs facing dogs"),
}
OUTPUTS = {
    "travel": ("m", "displacement of the sliding ring into engagement"),
    "axial_speed": ("m/s", "speed of the sliding ring into engagement"),
    "sliding_angle": ("rad", "angle of the sliding ring"),
    "output_angle": ("rad", "angle of the output ring"),
    "sliding_speed": ("rad/s", "speed of the sliding ring"),
    "output_speed": ("rad/s", "speed of the output ring"),
    "sliding_side_angle": ("rad", "angle behind the shaft of the sliding ring"),
    "output_side_angle": ("rad", "angle behind the shaft of the output ring"),
    "sliding_side_speed": ("rad/s", "speed behind the shaft of the sliding ring"),
    "output_side_speed": ("rad/s", "speed behind the shaft of the output ring"),
    "relative_angle": ("rad", "lead of the output ring over dogs facing dogs"),
    "contact_force": ("N", "mean over the last step, against the shift"),
    "contact_torque": ("N.m", "mean over the last step, on the sliding ring"),
}
#: Outputs of a block with an actuator.
ACTUATOR_OUTPUTS = {
    "actuator_force": ("N", "force of the actuator at the fork"),
    "actuator_travel": ("m", "displacement of the fork into engagement"),
}
#: Output of a logged channel, by its key at a bench.
CHANNEL_OUTPUTS = {
    "pressure_bar": ("actuator_pressure", "Pa", "pressure of the cylinder above the ambient one"),
    "current_A": ("actuator_current", "A", "current of the coil"),
}
PHASES = ", ".join(f"{phase.value} {phase.name.lower().replace('_', ' ')}" for phase in StepPhase)


def packed_study(folder: Path) -> Setup:
    """Read the study of an FMU from the folder of its resources, in the compiled engine."""
    path = folder / RESOURCE
    tables = json.loads(path.read_text(encoding="utf-8"))
    return build_study(validate(StudyFile, tables, str(path))).in_engine("planar")


def parameters_of(clutch: Clutch) -> dict[str, tuple[float, str]]:
    """List the parameters of a clutch by name with value and key in a study file, SI units."""
    parameters: dict[str, tuple[float, str]] = {}
    for part in PARTS:
        value = getattr(clutch, part)
        if value is None:  # no actuator
            continue
        kind: Any = type(value)
        for name, declared in quantities_of(kind).items():
            number = getattr(value, name)
            if number is None or (part == "drive" and name not in DRIVE_PARAMETERS):
                continue
            parameters[f"{part}.{name}"] = number, declared.key
    return parameters


def actuation_parameters_of(actuation: Actuation) -> dict[str, tuple[float, str]]:
    """List the parameters between a command and its force, as ``parameters_of``."""
    keys = quantities_of(Actuation)
    return {
        f"actuation.{name}": (getattr(actuation, name), keys[name].key)
        for name in ACTUATION_PARAMETERS
    }


def clutch_with(clutch: Clutch, parameters: dict[str, float]) -> Clutch:
    """Replace parameters of a clutch by name; InputError or GeometryError out of range."""
    fields: dict[str, dict[str, float]] = {}
    for name, value in parameters.items():
        part, field = name.split(".")
        fields.setdefault(part, {})[field] = value
    parts = {part: replace(getattr(clutch, part), **values) for part, values in fields.items()}
    return replace(clutch, **parts)


@dataclass(frozen=True)
class BlockVariable:
    """A variable of the block; enumerations of FMI by the names that all versions have."""

    kind: type  #: float, int or bool
    name: str
    unit: str  #: of SI, empty for a pure number
    meaning: str
    causality: str
    variability: str
    getter: Callable[[], Any]
    setter: Callable[[float], None] | None = None
    is_share: bool = False  #: from 0 to 1


class BlockState(NamedTuple):
    """State of a block as values of JSON, SI units."""

    time: float
    begin: float | None  #: time of the first step; None before it
    loads: dict[str, float]  #: inputs by name
    start: dict[str, float]  #: starts by name
    parameters: dict[str, float]
    shift: dict[str, Any]  #: fields of ``SavedShift``


class ClutchBlock:
    """Dog clutch of a study; parameters are fixed once the initialization is left.

    Parameters
    ----------
    folder
        Resources of the FMU, with the study.
    log
        Receiver of sentences about errors. No error may leave the block: the loader of pythonfmu3
        0.3.4 then frees it twice.

    """

    def __init__(self, folder: Path, log: Callable[[str], None]) -> None:
        study = packed_study(folder)
        #: Attributes of the model description.
        self.identity: dict[str, Any] = {
            "modelName": MODEL,
            "guid": uuid5(NAMESPACE_URL, (folder / RESOURCE).read_text(encoding="utf-8")),
            "author": "dogshape",
            "version": program_versions()["dogshape"],
            "description": f"{DESCRIPTION} Study {study.name}.",
        }
        #: Units of the variables with the exponents of their base units.
        self.units = UNITS if study.clutch.actuator is None else UNITS | ACTUATOR_UNITS
        self.time = 0.0
        self._log = log
        self._begin: float | None = None  # time of the first step, s
        self._clutch = study.clutch
        self._actuation = study.actuation
        self._loads = dict.fromkeys(INPUTS, 0.0)
        start = start_of(study.clutch, study.points[0].mismatch, relative_angle=0.0)
        self._start: dict[str, float] = dict(zip(STARTS, start, strict=True))
        self._declared = parameters_of(self._clutch)
        if self._clutch.actuator is not None:
            self._loads[COMMAND] = 0.0
            self._declared |= actuation_parameters_of(self._actuation)
        self._parameters = {name: value for name, (value, _) in self._declared.items()}
        self._full_force = 0.0  # static, of the full command, N
        self._shift: SteppedShift | None = None
        self._fault = ""  # of the parameters

    @property
    def shift(self) -> SteppedShift:
        """Shift of the present parameters, of those of the study where they are wrong."""
        if self._shift is None:
            self._fault = ""
            try:
                self._shift = self._built_shift(self._parameters)
            except DogshapeError as error:
                self._fault = str(error)
                self._log(self._fault)
                self._shift = self._built_shift({})
        return self._shift

    def _built_shift(self, parameters: dict[str, float]) -> SteppedShift:
        """Build a shift of parameters by name; InputError or GeometryError out of range."""
        actuation_numbers: dict[str, Any] = {}
        clutch_numbers: dict[str, float] = {}
        for name, value in parameters.items():
            part, field = name.split(".")
            if part == "actuation":
                actuation_numbers[field] = value
            else:
                clutch_numbers[name] = value
        clutch = clutch_with(self._clutch, clutch_numbers)
        start = ShiftStart(*self._start.values())
        actuator = clutch.actuator
        if actuator is None:
            return SteppedShift(clutch, start)
        actuation = replace(self._actuation, actuator=actuator, **actuation_numbers)
        self._full_force = actuation.factor * actuator.full_force
        actuator.require_reach(self._full_force, clutch.shift_travel)
        course = CommandCourse(actuation.delay, actuation.lag, actuation.loss)
        return SteppedShift(clutch, start, course)

    def variables(self) -> Iterator[BlockVariable]:
        """Yield time, inputs, parameters and outputs."""
        yield BlockVariable(
            float,
            "time",
            unit="s",
            meaning="time of the simulation",
            causality="independent",
            variability="continuous",
            getter=lambda: self.time,
        )
        for name, (unit, meaning) in INPUTS.items():
            yield BlockVariable(
                float,
                name,
                unit=unit,
                meaning=meaning,
                causality="input",
                variability="continuous",
                getter=partial(self._loads.get, name),
                setter=partial(self._loads.__setitem__, name),
            )
        if COMMAND in self._loads:
            yield self._command_variable()
        for name, (unit, meaning) in STARTS.items():
            yield self._parameter(name, unit, meaning, self._start)
        meanings = MEANINGS | ACTUATOR_MEANINGS
        for name, (_, key) in self._declared.items():
            unit = SI_UNITS.get(suffix_of(key), "")
            meaning = f"{meanings[name]}; {key} of a study file"
            yield self._parameter(name, unit, meaning, self._parameters)
        yield from self._outputs()

    def _command_variable(self) -> BlockVariable:
        return BlockVariable(
            float,
            COMMAND,
            unit="",
            meaning=COMMAND_MEANING,
            causality="input",
            variability="continuous",
            getter=partial(self._loads.get, COMMAND),
            setter=partial(self._loads.__setitem__, COMMAND),
            is_share=True,
        )

    def _parameter(
        self, name: str, unit: str, meaning: str, values: dict[str, float]
    ) -> BlockVariable:
        def write(value: float) -> None:
            values[name] = value
            self._shift = None

        return BlockVariable(
            int if isinstance(values[name], int) else float,
            name,
            unit=unit,
            meaning=meaning,
            causality="parameter",
            variability="fixed",
            getter=partial(values.get, name),
            setter=write,
        )

    def _outputs(self) -> Iterator[BlockVariable]:
        for name, (unit, meaning) in OUTPUTS.items():
            yield self._output(float, name, unit, meaning, self._motion_getter(name))
        meaning = f"time of the engagement, {NOT_ENGAGED_S:g} before it"
        yield self._output(float, "engagement_time", "s", meaning, self._engagement_time)
        yield self._output(int, "phase", "", PHASES, lambda: int(self.shift.phase))
        meaning = "whether ring and actuator made the travel"
        yield self._output(bool, "engaged", "", meaning, lambda: self.shift.engaged)
        if COMMAND in self._loads:
            yield from self._actuator_outputs()

    def _actuator_outputs(self) -> Iterator[BlockVariable]:
        for name, (unit, meaning) in ACTUATOR_OUTPUTS.items():
            field = name.removeprefix("actuator_")
            yield self._output(float, name, unit, meaning, self._reading_getter(field))
        actuator = self._clutch.actuator
        if actuator is not None and actuator.logged_key:
            name, unit, meaning = CHANNEL_OUTPUTS[actuator.logged_key]
            yield self._output(float, name, unit, meaning, self._reading_getter("channel"))

    def _output(
        self, kind: type, name: str, unit: str, meaning: str, getter: Callable[[], Any]
    ) -> BlockVariable:
        return BlockVariable(
            kind,
            name,
            unit=unit,
            meaning=meaning,
            causality="output",
            variability="continuous" if kind is float else "discrete",
            getter=getter,
        )

    def _motion_getter(self, name: str) -> Callable[[], float]:
        return lambda: getattr(self.shift.motion, name)

    def _reading_getter(self, field: str) -> Callable[[], float]:
        return lambda: getattr(self.shift.actuator_reading, field)

    def _engagement_time(self) -> float:
        """Compute the time of the engagement in the time of the simulation, s."""
        if not self.shift.engaged:
            return NOT_ENGAGED_S
        return self.shift.engagement_time + (self._begin or 0.0)

    def initialize(self) -> None:
        """Build the clutch, and log wrong parameters."""
        self._shift = self.shift

    def step(self, current_time: float, step_size: float) -> bool:
        """Advance by a communication step, s; False with a sentence in the log if impossible."""
        shift = self.shift
        if self._fault:
            return False
        try:
            self._require_step(current_time, step_size)
            if self._begin is None:
                self._begin = current_time
            end = current_time + step_size
            shift.advance(end - self._begin, self._step_loads())
        except DogshapeError as error:
            self._log(str(error))
            return False
        self.time = end
        return True

    def _require_step(self, current_time: float, step_size: float) -> None:
        """Raise InputError unless a step has a length and continues the last one."""
        remedy = "give steps above 0, each from the end of the last one"
        require_between("communication_step_s", step_size, MIN_STEP_S, MAX_STEP_S, remedy)
        if self._begin is not None:
            low, high = self.time - MIN_STEP_S, self.time + MIN_STEP_S
            require_between("communication_point_s", current_time, low, high, remedy)

    def _step_loads(self) -> StepLoads:
        """Build the loads of a step; InputError if one is not finite, a command not 0 to 1."""
        for name in INPUTS:
            require_between(name, self._loads[name], -MAX_LOAD, MAX_LOAD, "give a finite value")
        force, sliding_torque, output_torque = (self._loads[name] for name in INPUTS)
        command = self._loads.get(COMMAND, 0.0)
        require_between(COMMAND, command, 0.0, 1.0, "give a share of the full force, 0 for off")
        return StepLoads(force, sliding_torque, output_torque, command * self._full_force)

    def save(self) -> dict[str, Any]:
        """Copy inputs, parameters and the state of the shift as values of JSON."""
        state = BlockState(
            time=self.time,
            begin=self._begin,
            loads=dict(self._loads),
            start=dict(self._start),
            parameters=dict(self._parameters),
            shift=asdict(self.shift.save()),
        )
        return state._asdict()

    def restore(self, record: dict[str, Any]) -> None:
        """Go to a state of ``save``."""
        state = BlockState(**record)
        self.time = state.time
        self._begin = state.begin
        self._loads.update(state.loads)
        self._start.update(state.start)
        self._parameters.update(state.parameters)
        self._shift = None
        self.shift.restore(SavedShift(**state.shift))
