"""The FMU of a study in FMPy: its interface, and a driveline of own inertias around it."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import points_of
from dogshape.pipeline.export.clutch_block import (
    ACTUATOR_MEANINGS,
    MEANINGS,
    SI_UNITS,
    ClutchBlock,
    actuation_parameters_of,
    parameters_of,
)
from dogshape.sim.quantity import record_quantities
from dogshape.sim.shift.actuators import EXAMPLES, KINDS, STROKE_TOLERANCE_M
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.drive import NO_DRIVE
from dogshape.sim.shift.stepped_shift import StepLoads, SteppedShift, start_of
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, RPM, suffix_of
from tests.conftest import require_program

STEP_S = 2e-4  #: communication step
TORQUE_NM = 5.0  #: of the source on the sliding side
#: Rings, and the shafts and inertias behind them that the driveline model has.
DRIVELINE = {
    "mechanism.ring_inertia_kgm2": 0.002,
    "mechanism.input_stiffness_Nm_rad": 300.0,
    "mechanism.wheel_inertia_kgm2": 0.1,
    "mechanism.output_stiffness_Nm_rad": 2000.0,
}
#: Largest deviation of a shift by command from that of the study: impacts in other steps.
COMMAND_TOLERANCE_S = 1e-4

VERSIONS = pytest.mark.parametrize("fmi", [2, 3])


class Block:
    """An instance of an FMU of either version, its variables by name."""

    def __init__(self, path: Path) -> None:
        import fmpy
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        description = fmpy.read_model_description(str(path), validate=True)
        self.variables = {v.name: v for v in description.modelVariables}
        self.is_fmi2 = description.fmiVersion == "2.0"
        slave = FMU2Slave if self.is_fmi2 else FMU3Slave
        self.fmu = slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="clutch",
        )
        self.fmu.instantiate(loggingOn=True)

    def __getitem__(self, name: str) -> Any:
        variable = self.variables[name]
        getter = getattr(self.fmu, f"get{variable.type}")
        return getter([variable.valueReference])[0]

    def __setitem__(self, name: str, value: float) -> None:
        variable = self.variables[name]
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def initialize(self, **start: float) -> None:
        for name, value in start.items():
            self[f"start.{name}"] = value
        if self.is_fmi2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def step(self, count: int, step: float = STEP_S, **inputs: float) -> None:
        for name, value in inputs.items():
            self[name] = value
        self.fmu.doStep(count * step, step)

    def save(self) -> bytes:
        if self.is_fmi2:
            return bytes(self.fmu.serializeFMUstate(self.fmu.getFMUstate()))
        return bytes(self.fmu.serializeFMUState(self.fmu.getFMUState()))

    def restore(self, saved: bytes) -> None:
        if self.is_fmi2:
            self.fmu.setFMUstate(self.fmu.deSerializeFMUstate(saved))
        else:
            self.fmu.setFMUState(self.fmu.deserializeFMUState(saved))


@pytest.fixture
def load() -> Iterator[Callable[[Path], Block]]:
    """Instantiate FMUs, and free them afterwards."""
    blocks: list[Block] = []

    def instantiate(path: Path) -> Block:
        blocks.append(Block(path))
        return blocks[-1]

    yield instantiate
    for block in blocks:
        block.fmu.freeInstance()


@pytest.fixture
def study() -> ds.Study:
    for name in ("pythonfmu", "pythonfmu3", "fmpy"):
        require_program(find_spec(name) is not None, name)
    return ds.Study("mq200_paper")


def _with_actuator(study: ds.Study, kind: str, **changes: Any) -> ds.Study:
    """Give a study the example of an actuator at full command."""
    numbers = record_quantities(EXAMPLES[kind])
    keys = {f"actuation.{key}": value for key, value in numbers.items() if value}
    settings = {"actuation.kind": kind, "operating.force_N": None, **keys, **changes}
    return study.replace_keys({"variables.height_mm": [1.6, 5.0], **settings})


def _start(clutch: Clutch, mismatch_rpm: float, angle_deg: float) -> dict[str, float]:
    return start_of(clutch, mismatch_rpm * RPM, angle_deg * DEG)._asdict()


@VERSIONS
def test_the_block_declares_the_clutch_in_si_units(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], fmi: int
) -> None:
    from fmpy.validation import validate_fmu

    path = study.export_fmu(tmp_path / "clutch.fmu", fmi)
    assert validate_fmu(str(path)) == []
    block = load(path)
    assert block["dog.chamfer"] == pytest.approx(8.0 * DEG)
    assert block["dog.count"] == 15
    assert block["rings.output_inertia"] == 0.6048
    assert block["contact.dynamic_friction"] == study.config.clutch.contact.dynamic_friction
    units = {name: variable.unit for name, variable in block.variables.items()}
    assert units["dog.height"] == "m"
    assert units["shift_force"] == "N"
    assert units["sliding_torque"] == "N.m"
    assert units["mechanism.input_stiffness"] == "N.m/rad"
    for name, variable in block.variables.items():
        pure = name in {"dog.count", "dog.crest", "phase", "engaged"} or "friction" in name
        assert variable.unit or pure, name
    with zipfile.ZipFile(path) as files:
        tables = json.loads(files.read("resources/study.json"))
        description = files.read("modelDescription.xml").decode()
    assert tables["dog"]["count"] == 15
    assert "Needs Python with the package dogshape" in description
    assert str(tmp_path) not in description
    assert "crest above root; height_mm of a study file" in description


def test_both_versions_have_the_same_variables_and_shift_times(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block]
) -> None:
    """To the last digit; FMI 2.0 has no independent variable."""
    clutch = study.config.in_engine("planar").clutch
    paths = {fmi: study.export_fmu(tmp_path / f"clutch{fmi}.fmu", fmi) for fmi in (2, 3)}
    for mismatch_rpm, force, angle_deg in [(50, 469.0, 10), (-25, 235.2, 4), (149, 641.5, 20)]:
        blocks = {fmi: load(path) for fmi, path in paths.items()}
        for block in blocks.values():
            block["dog.chamfer"] = 10.0 * DEG
            block.initialize(**_start(clutch, mismatch_rpm, angle_deg))
        for count in range(300):
            for block in blocks.values():
                block.step(count, 1e-3, shift_force=force, sliding_torque=TORQUE_NM)
            if blocks[3]["engaged"]:
                break
        names = list(blocks[3].variables)
        assert ["time", *blocks[2].variables] == names
        values = [{name: block[name] for name in names[1:]} for block in blocks.values()]
        assert values[0] == values[1]
        assert values[0]["engagement_time"] > 0.0


@pytest.mark.parametrize(
    "point",
    [(50, 469.0, 10), (25, 469.0, 4), (25, 235.2, 8), (50, 641.5, 20)],
)
def test_a_driveline_around_the_block_shifts_as_the_study_with_its_shafts(
    study: ds.Study,
    tmp_path: Path,
    load: Callable[[Path], Block],
    point: tuple[float, float, float],
) -> None:
    """Both sides and their shafts are outside; the shift time is that of ``shift``."""
    whole = study.replace_keys({**DRIVELINE, "drive.sliding_torque_Nm": [TORQUE_NM]})
    config = whole.config.in_engine("planar")
    mismatch_rpm, force, angle_deg = point
    (operating_point,) = points_of(config, (mismatch_rpm, force, None))
    reference = engage(config.clutch, operating_point, angle_deg * DEG)
    block = load(study.export_fmu(tmp_path / "clutch.fmu"))
    shafts = config.clutch.shafts
    block["rings.sliding_inertia"] = shafts[0].ring_inertia
    block["rings.output_inertia"] = shafts[1].ring_inertia
    start = _start(config.clutch, mismatch_rpm, angle_deg)
    block.initialize(**start)
    names = ("sliding", "output")
    angles = [block[f"{name}_angle"] for name in names]
    speeds = [block[f"{name}_speed"] for name in names]
    sources = (TORQUE_NM, 0.0)
    count = 0
    while not block["engaged"] and count * STEP_S < 0.5:
        torques = {}
        for side, (name, shaft) in enumerate(zip(names, shafts, strict=True)):
            rate = speeds[side] - block[f"{name}_speed"]
            lead = angles[side] - block[f"{name}_angle"] + 0.5 * STEP_S * rate
            torque = shaft.torque(lead, rate)
            gain = STEP_S * (sources[side] - torque) / shaft.side_inertia
            angles[side] += STEP_S * (speeds[side] + 0.5 * gain)
            speeds[side] += gain
            torques[f"{name}_torque"] = torque
        push = float(operating_point.profile.at((count + 0.5) * STEP_S))
        block.step(count, shift_force=push, **torques)
        count += 1
    assert reference.shift_time is not None
    assert block["engagement_time"] == pytest.approx(reference.shift_time, abs=STEP_S)
    assert count * STEP_S == pytest.approx(block["engagement_time"], abs=STEP_S)
    assert block["phase"] == 4
    assert block["travel"] >= config.clutch.shift_travel


def test_each_parameter_has_a_meaning(study: ds.Study) -> None:
    clutch = study.config.clutch
    contact = replace(clutch.contact, face_friction=0.05)
    names = parameters_of(replace(clutch, contact=contact))
    assert MEANINGS.keys() == names.keys()


@VERSIONS
def test_the_block_steps_as_the_package(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], fmi: int
) -> None:
    """To the last digit, and again after a step back."""
    block = load(study.export_fmu(tmp_path / "clutch.fmu", fmi))
    clutch = study.config.in_engine("planar").clutch
    start = start_of(clutch, 100 * RPM, 5 * DEG)
    block.initialize(**start._asdict())
    shift = SteppedShift(clutch, start)
    for count in range(60):
        if count == 40:
            saved = block.save()
            travel = block["travel"]
        block.step(count, 1e-3, shift_force=400.0, sliding_torque=3.0, output_torque=-2.0)
        shift.advance(count * 1e-3 + 1e-3, StepLoads(400.0, 3.0, -2.0))
        motion = shift.motion._asdict()
        assert {name: block[name] for name in motion} == motion
    block.restore(saved)
    assert block["travel"] == travel
    if fmi == 3:
        assert block["time"] == 0.04
    for count in range(40, 60):
        block.step(count, 1e-3, shift_force=400.0, sliding_torque=3.0, output_torque=-2.0)
    assert {name: block[name] for name in motion} == motion


@VERSIONS
def test_two_blocks_in_one_process_have_their_own_clutches(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], fmi: int
) -> None:
    first = load(study.export_fmu(tmp_path / "first.fmu", fmi))
    second = load(study.replace_keys(count=18).export_fmu(tmp_path / "second.fmu", fmi))
    assert (first["dog.count"], second["dog.count"]) == (15, 18)


@VERSIONS
def test_parameters_act_and_wrong_ones_are_refused(
    study: ds.Study,
    tmp_path: Path,
    load: Callable[[Path], Block],
    capfd: pytest.CaptureFixture[str],
    fmi: int,
) -> None:
    from fmpy.fmi1 import FMICallException

    path = study.export_fmu(tmp_path / "clutch.fmu", fmi)
    light, heavy = load(path), load(path)
    heavy["rings.mass"] = 2.0 * heavy["rings.mass"]
    for block in (light, heavy):
        block.initialize(**_start(study.config.clutch, 50, 0))
        block.step(0, 1e-3, shift_force=10.0)
    assert heavy["travel"] == pytest.approx(0.5 * light["travel"])
    wrong = load(path)
    wrong["dog.height"] = -1.0
    wrong.initialize(**_start(study.config.clutch, 50, 0))
    assert "dog.height_mm is -1000 mm" in capfd.readouterr().out
    with pytest.raises(FMICallException):
        wrong.step(0, 1e-3)


def test_a_study_with_a_drive_starts_as_its_shift(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block]
) -> None:
    """Speeds of the first operating point; tables and control of the drive stay outside."""
    turning = ds.Study("ev_disconnect")
    drive = turning.config.clutch.drive
    assert drive.control is not None
    assert drive != NO_DRIVE
    block = load(turning.export_fmu(tmp_path / "turning.fmu"))
    speeds = block["start.output_speed"] - block["start.sliding_speed"]
    mismatch = turning.config.points[0].mismatch
    assert drive.sense * speeds == pytest.approx(mismatch)
    wheels = {"sliding": "output", "output": "sliding"}[drive.engine_side]
    assert block[f"start.{wheels}_speed"] == pytest.approx(drive.shaft_speed)
    block.initialize()
    assert block["sliding_speed"] == block["start.sliding_speed"]
    block.step(0, 1e-3)
    assert block["sliding_speed"] == pytest.approx(block["start.sliding_speed"], abs=0.01)
    assert block["engagement_time"] == -1.0


@VERSIONS
def test_processes_with_a_block_end_cleanly(study: ds.Study, tmp_path: Path, fmi: int) -> None:
    """Without ``release_at_exit`` some of them abort at their end."""
    study.export_fmu(tmp_path / "clutch.fmu", fmi)
    code = "import fmpy; fmpy.simulate_fmu('clutch.fmu', stop_time=0.002, output_interval=0.001)"
    for _ in range(6):
        subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True)


@VERSIONS
@pytest.mark.parametrize("kind", KINDS)
def test_a_command_shifts_as_the_study_with_its_actuator(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], kind: str, fmi: int
) -> None:
    """Full command from a second step on, with linkage, loss and dead time of the mechanism."""
    from fmpy.validation import validate_fmu

    changes = {
        "mechanism.compliance_mm_kN": 2.0,
        "mechanism.free_play_mm": 0.2,
        "mechanism.force_loss_N": 20.0,
        "mechanism.delay_s": 0.0123,
    }
    moved = _with_actuator(study, kind, **changes)
    config = moved.config.in_engine("planar")
    clutch = config.clutch
    (operating_point,) = points_of(config, (50.0, None, None))
    reference = engage(clutch, operating_point, 10.0 * DEG)
    assert reference.shift_time is not None
    path = moved.export_fmu(tmp_path / "clutch.fmu", fmi)
    assert validate_fmu(str(path)) == []
    block = load(path)
    # The relative angle of a shift is that at the start of the force.
    begin, step = 2e-3, 1e-3
    lead = operating_point.mismatch * (begin + config.actuation.delay)
    start = start_of(clutch, operating_point.mismatch, 10.0 * DEG - lead)
    block.initialize(**start._asdict())
    for count in range(300):
        block.step(count, step, command=float(count * step >= begin))
        if block["engaged"]:
            break
    time = block["engagement_time"] - begin
    assert time == pytest.approx(reference.shift_time, abs=COMMAND_TOLERANCE_S)
    assert block["actuator_travel"] >= clutch.shift_travel - STROKE_TOLERANCE_M


@VERSIONS
def test_variables_of_an_actuator_are_declared(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], fmi: int
) -> None:
    moved = _with_actuator(study, "solenoid", **{"mechanism.delay_s": 0.005})
    block = load(moved.export_fmu(tmp_path / "clutch.fmu", fmi))
    command = block.variables["command"]
    assert (command.causality, float(command.start)) == ("input", 0.0)
    assert (float(command.min), float(command.max)) == (0.0, 1.0)
    units = {name: variable.unit for name, variable in block.variables.items()}
    assert units["actuator.inductance"] == "H"
    assert units["actuator.voltage"] == "V"
    assert units["actuator.stroke"] == "m"
    assert units["actuator_current"] == "A"
    assert block["actuator.inductance"] == pytest.approx(9e-3)
    assert block["actuation.delay"] == 0.005
    for variable in block.variables.values():
        assert variable.description
        if variable.causality in {"input", "parameter"}:
            assert variable.start is not None


def test_a_study_without_an_actuator_has_no_command(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block]
) -> None:
    block = load(study.export_fmu(tmp_path / "clutch.fmu"))
    inputs = [name for name, v in block.variables.items() if v.causality == "input"]
    assert inputs == ["shift_force", "sliding_torque", "output_torque"]
    assert not [name for name in block.variables if name.startswith("actuat")]


def test_each_parameter_of_an_actuator_has_a_meaning_and_a_unit(study: ds.Study) -> None:
    names = set()
    for kind in KINDS:
        config = _with_actuator(study, kind).config
        parameters = parameters_of(config.clutch) | actuation_parameters_of(config.actuation)
        for name, (_, key) in parameters.items():
            assert key in {"efficiency", "gear_ratio", "critical_ratio", "force_factor"} or (
                suffix_of(key) in SI_UNITS or not name.startswith("actuat")
            ), key
        names |= {name for name in parameters if name.startswith("actuat")}
    assert names == ACTUATOR_MEANINGS.keys()


def _unpack_block(path: Path, folder: Path, said: list[str]) -> ClutchBlock:
    """Unpack the block of an FMU, which logs into ``said``."""
    with zipfile.ZipFile(path) as files:
        files.extractall(folder / "files")
    return ClutchBlock(folder / "files" / "resources", said.append)


def test_wrong_commands_are_refused(study: ds.Study, tmp_path: Path) -> None:
    """One sentence with value, rule and remedy, and a failed step."""
    path = _with_actuator(study, "spring").export_fmu(tmp_path / "clutch.fmu")
    said: list[str] = []
    block = _unpack_block(path, tmp_path, said)
    inputs = {variable.name: variable for variable in block.variables()}

    def step(**values: float) -> bool:
        for name, value in values.items():
            write = inputs[name].setter
            assert write is not None
            write(value)
        return block.step(block.time, 1e-3)

    assert not step(command=1.2)
    assert said.pop() == (
        "command is 1.2, but it must lie between 0 and 1; give a share of the full force, 0 for off"
    )
    assert not step(command=float("nan"))
    assert "command is nan, but it must lie between 0 and 1" in said.pop()
    assert not step(command=1.0, shift_force=10.0)
    assert "shift force is 10 N, but the command of the actuator takes its place" in said.pop()
    assert step(shift_force=0.0)
    assert not step(command=0.0, shift_force=10.0)
    assert "shift force is 10 N" in said.pop()
    assert step(shift_force=0.0)
    assert not said


def test_steps_out_of_order_and_endless_inputs_are_refused(study: ds.Study, tmp_path: Path) -> None:
    path = study.export_fmu(tmp_path / "clutch.fmu")
    said: list[str] = []
    block = _unpack_block(path, tmp_path, said)
    assert block.step(0.0, 1e-3)
    for time, size in ((1e-3, 0.0), (1e-3, -1e-3), (1e-3, float("nan"))):
        assert not block.step(time, size)
        assert "communication_step_s is" in said.pop()
    for time in (0.0, 0.05):
        assert not block.step(time, 1e-3)
        assert "each from the end of the last one" in said.pop()
    (write,) = (v.setter for v in block.variables() if v.name == "shift_force")
    assert write is not None
    write(float("nan"))
    assert not block.step(1e-3, 1e-3)
    assert "shift_force is nan" in said.pop()
    write(469.0)
    assert block.step(1e-3, 1e-3)
    assert not said


def test_a_block_with_an_actuator_takes_a_shift_force_as_before(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block]
) -> None:
    """Without a command the actuator does nothing; its channel shows nothing."""
    with_actuator = _with_actuator(study, "pneumatic")
    clutch = study.config.in_engine("planar").clutch
    times = []
    for each in (study, with_actuator):
        block = load(each.export_fmu(tmp_path / f"{len(times)}.fmu"))
        block.initialize(**_start(clutch, 50, 10))
        for count in range(300):
            block.step(count, 1e-3, shift_force=469.0)
            if block["engaged"]:
                break
        times.append(block["engagement_time"])
    assert times[0] > 0.0
    assert times[1] == pytest.approx(times[0], abs=COMMAND_TOLERANCE_S)
    assert block["actuator_force"] == block["actuator_pressure"] == 0.0


@VERSIONS
def test_a_commanded_block_goes_back(
    study: ds.Study, tmp_path: Path, load: Callable[[Path], Block], fmi: int
) -> None:
    """To the last digit, with a command on its way through the dead time."""
    moved = _with_actuator(study, "pneumatic", **{"mechanism.delay_s": 0.0123})
    block = load(moved.export_fmu(tmp_path / "clutch.fmu", fmi))
    block.initialize(**_start(moved.config.clutch, 50, 10))
    names = ["travel", "output_angle", "actuator_force", "actuator_pressure"]

    def run(counts: range) -> list[list[float]]:
        values = []
        for count in counts:
            block.step(count, 1e-3, command=0.8 if count < 15 else 0.5)
            values.append([block[name] for name in names])
        return values

    run(range(20))  # 0.8 acts, 0.5 is on its way
    saved = block.save()
    first = run(range(20, 40))
    block.restore(saved)
    assert run(range(20, 40)) == first
    assert first[-1][2] > 0.0
