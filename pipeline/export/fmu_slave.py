"""Slave of the co-simulation FMU: one engagement as FMI 3.0 has it.

``pipeline.export.fmu`` puts this file into the FMU beside ``study.json``, the study whose clutch it
simulates; the physics is that of the installed package (``sim.shift.stepped_shift``). All values
are in SI units. Speeds, angles and torques count positive in the sense in which the engine turns.
"""

from __future__ import annotations

import ctypes
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

from pythonfmu3 import (
    Boolean,
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3Slave,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Int32,
    Unit,
)

from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study
from dogshape.sim.clutch_tables import validate
from dogshape.sim.errors import DogshapeError
from dogshape.sim.quantity import quantities_of
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.stepped_shift import (
    SavedShift,
    ShiftStart,
    StepLoads,
    SteppedShift,
    StepPhase,
    start_of,
)
from dogshape.sim.units import suffix_of
from dogshape.sim.versions import engine

RESOURCE = "study.json"  #: study file within the FMU
STEP_S = 1e-3  #: communication step that the FMU proposes
NOT_ENGAGED_S = -1.0  #: time of an engagement that has not happened
DESCRIPTION = (
    "One engagement of a dog clutch by the compiled engine of dogshape. Needs Python with the "
    "package dogshape."
)
#: Exponents of kg, m, s and rad by the name of an SI unit.
UNITS = {
    "m": (0, 1, 0, 0),
    "m/s": (0, 1, -1, 0),
    "s": (0, 0, 1, 0),
    "rad": (0, 0, 0, 1),
    "rad/s": (0, 0, -1, 1),
    "N": (1, 1, -2, 0),
    "N.m": (1, 2, -2, 0),
    "kg": (1, 0, 0, 0),
    "kg.m2": (1, 2, 0, 0),
    "N.s/m": (1, 0, -1, 0),
    "m/N": (-1, 0, 2, 0),
    "s/m": (0, -1, 1, 0),
    "Pa/m": (1, -2, -2, 0),
    "N.m/rad": (1, 2, -2, -1),
    "N.m.s/rad": (1, 2, -1, -1),
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
}
#: Parts of a clutch whose quantities are parameters; of a drive those that follow the speeds.
PARTS = ("dog", "rings", "contact", "mechanism", "drive")
DRIVE_PARAMETERS = ("pack_torque", "pack_viscous", "pack_speed", "synchroniser")
INPUTS = {
    "shift_force": ("N", "force on actuator or sliding ring into engagement"),
    "sliding_torque": ("N.m", "torque on the side of the sliding ring"),
    "output_torque": ("N.m", "torque on the side of the output ring"),
}
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
        kind: Any = type(value)
        for name, declared in quantities_of(kind).items():
            number = getattr(value, name)
            if number is None or (part == "drive" and name not in DRIVE_PARAMETERS):
                continue
            parameters[f"{part}.{name}"] = number, declared.key
    return parameters


def clutch_with(clutch: Clutch, parameters: dict[str, float]) -> Clutch:
    """Replace parameters of a clutch by name; InputError or GeometryError out of range."""
    fields: dict[str, dict[str, float]] = {}
    for name, value in parameters.items():
        part, field = name.split(".")
        fields.setdefault(part, {})[field] = value
    parts = {part: replace(getattr(clutch, part), **values) for part, values in fields.items()}
    return replace(clutch, **parts)


def hold_loader(resources: Path) -> None:
    """Instantiate the loader of an FMU on Linux once more, and never free that instance.

    At the end of a process the loader of pythonfmu3 0.3.4 releases its last reference twice
    (``pyState``), which may abort the process; an instance that stays has one reference more.
    """
    library = resources.parent / "binaries" / "x86_64-linux" / f"{DogClutch.__name__}.so"
    on_linux = sys.platform.startswith("linux") and library.is_file()
    if library in _held_loaders or not on_linux:
        return
    _held_loaders.add(library)
    instantiate = ctypes.CDLL(str(library)).fmi3InstantiateCoSimulation
    instantiate.restype = ctypes.c_void_p
    flags = [ctypes.c_bool(False)] * 4  # visible, logging, event mode, early return
    no_variables = None, ctypes.c_size_t(0)
    no_callbacks = (None,) * 3
    folder = f"{resources}/".encode()
    instantiate(b"held", b"", folder, *flags, *no_variables, *no_callbacks)


_held_loaders: set[Path] = set()  # of this process


class DogClutch(Fmi3Slave):  # type: ignore[misc]
    """Dog clutch of a study; parameters are fixed once the initialization is left."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        folder = Path(self.resources)
        if "logger" in arguments:  # from the loader, not from the builder of an FMU
            hold_loader(folder)
        study = packed_study(folder)
        self.guid = uuid5(NAMESPACE_URL, (folder / RESOURCE).read_text(encoding="utf-8"))
        self.author = "dogshape"
        self.version = engine()["dogshape"]
        self.description = f"{DESCRIPTION} Study {study.name}."
        self.default_experiment = DefaultExperiment(start_time=0.0, step_size=STEP_S)
        self.time = 0.0
        self._begin: float | None = None  # time of the first step, s
        self._clutch = study.clutch
        self._loads = dict.fromkeys(INPUTS, 0.0)
        start = start_of(study.clutch, study.points[0].mismatch, relative_angle=0.0)
        self._start: dict[str, float] = dict(zip(STARTS, start, strict=True))
        self._parameters = {name: value for name, (value, _) in parameters_of(self._clutch).items()}
        self._shift: SteppedShift | None = None
        self._fault = ""  # of the parameters
        for name, (mass, length, time, angle) in UNITS.items():
            self.register_units([Unit(name, kg=mass, m=length, s=time, rad=angle)])
        self._register_time()
        self._register_inputs()
        self._register_parameters()
        self._register_outputs()

    @property
    def shift(self) -> SteppedShift:
        """Shift of the present parameters, of those of the study where they are wrong.

        No error may leave the slave: the loader of pythonfmu3 0.3.4 then frees it twice.
        """
        if self._shift is None:
            self._fault = ""
            clutch = self._clutch
            try:
                clutch = clutch_with(clutch, self._parameters)
            except DogshapeError as error:
                self._fault = str(error)
                self.log(self._fault, Fmi3Status.error)
            self._shift = SteppedShift(clutch, ShiftStart(*self._start.values()))
        return self._shift

    def _add(self, kind: type[Any], name: str, unit: str, meaning: str, **options: Any) -> None:
        """Register a variable; a pure number has no unit."""
        if unit:
            options["unit"] = unit
        self.register_variable(kind(name, description=meaning, **options), nested=False)

    def _register_time(self) -> None:
        self._add(
            Float64,
            "time",
            unit="s",
            meaning="time of the simulation",
            causality=Fmi3Causality.independent,
            variability=Fmi3Variability.continuous,
            getter=lambda: self.time,
        )

    def _register_inputs(self) -> None:
        for name, (unit, meaning) in INPUTS.items():
            self._add(
                Float64,
                name,
                unit=unit,
                meaning=meaning,
                causality=Fmi3Causality.input,
                variability=Fmi3Variability.continuous,
                getter=partial(self._loads.get, name),
                setter=partial(self._loads.__setitem__, name),
            )

    def _register_parameters(self) -> None:
        """Register motion at the start and quantities of the clutch."""
        for name, (unit, meaning) in STARTS.items():
            self._register_parameter(name, unit, meaning, self._start)
        for name, (_, key) in parameters_of(self._clutch).items():
            unit = SI_UNITS.get(suffix_of(key), "")
            meaning = f"key {key} of a study file, in SI units"
            self._register_parameter(name, unit, meaning, self._parameters)

    def _register_parameter(
        self, name: str, unit: str, meaning: str, values: dict[str, float]
    ) -> None:
        def write(value: float) -> None:
            values[name] = value
            self._shift = None

        self._add(
            Int32 if isinstance(values[name], int) else Float64,
            name,
            unit=unit,
            meaning=meaning,
            causality=Fmi3Causality.parameter,
            variability=Fmi3Variability.fixed,
            initial=Fmi3Initial.exact,
            getter=partial(values.get, name),
            setter=write,
        )

    def _register_outputs(self) -> None:
        for name, (unit, meaning) in OUTPUTS.items():
            self._register_output(Float64, name, unit, meaning, self._motion_getter(name))
        meaning = f"time of the engagement, {NOT_ENGAGED_S:g} before it"
        self._register_output(Float64, "engagement_time", "s", meaning, self._engagement_time)
        self._register_output(Int32, "phase", "", PHASES, lambda: int(self.shift.phase))
        meaning = "whether ring and actuator made the travel"
        self._register_output(Boolean, "engaged", "", meaning, lambda: self.shift.engaged)

    def _register_output(
        self, kind: type[Any], name: str, unit: str, meaning: str, getter: Callable[[], Any]
    ) -> None:
        is_real = kind is Float64
        self._add(
            kind,
            name,
            unit=unit,
            meaning=meaning,
            causality=Fmi3Causality.output,
            variability=Fmi3Variability.continuous if is_real else Fmi3Variability.discrete,
            getter=getter,
        )

    def _motion_getter(self, name: str) -> Callable[[], float]:
        return lambda: getattr(self.shift.motion, name)

    def _engagement_time(self) -> float:
        """Compute the time of the engagement in the time of the simulation, s."""
        if not self.shift.engaged:
            return NOT_ENGAGED_S
        return self.shift.engagement_time + (self._begin or 0.0)

    def exit_initialization_mode(self) -> None:
        """Build the clutch, and log wrong parameters."""
        self._shift = self.shift

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """Advance by a communication step, or log the reason why it is impossible."""
        if self._begin is None:
            self._begin = current_time
        end = current_time + step_size
        shift = self.shift
        if self._fault:
            return Fmi3StepResult(status=Fmi3Status.error)
        try:
            shift.advance(end - self._begin, StepLoads(*self._loads.values()))
        except DogshapeError as error:
            self.log(str(error), Fmi3Status.error)
            return Fmi3StepResult(status=Fmi3Status.error)
        self.time = end
        return Fmi3StepResult(status=Fmi3Status.ok)

    def _get_fmu_state(self) -> dict[str, Any]:
        """Copy inputs, parameters and the state of the shift as values of JSON."""
        return {
            "time": self.time,
            "begin": self._begin,
            "loads": dict(self._loads),
            "start": dict(self._start),
            "parameters": dict(self._parameters),
            "shift": asdict(self.shift.save()),
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Go to a state of ``_get_fmu_state``."""
        self.time = state["time"]
        self._begin = state["begin"]
        self._loads.update(state["loads"])
        self._start.update(state["start"])
        self._parameters.update(state["parameters"])
        self._shift = None
        self.shift.restore(SavedShift(**state["shift"]))
