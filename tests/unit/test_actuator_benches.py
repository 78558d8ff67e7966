"""Benches whose set value is a pressure, a voltage or a current, and traces that log them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dogshape as ds
from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.flight_marks import WAYS, flights_of, trace_marks
from dogshape.bench.traces import BenchTrace, read_trace
from dogshape.diagnosis.prediction.flights import fly
from dogshape.diagnosis.report.wording import remarks
from dogshape.diagnosis.settings import USUAL
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.diagnose.study_keys import study_of
from dogshape.sim.errors import DataError
from dogshape.sim.kernel_layout import ACTUATOR_LEVEL, AMBIENT_PA
from dogshape.sim.quantity import record_quantities
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import COMMAND_RISE_S, EXAMPLES, Pneumatic
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import DEG, MM, RPM
from tests.diagnoses import POSTERIOR, STAND, diagnosis_of

HEAD = "Differenzdrehzahl [1/min];{};Schaltzeit [ms]"
DELAY_S = 0.03  #: of the traces
STEP_S = 5e-4  #: of their samples


def _actuation(kind: str) -> dict[str, Any]:
    numbers = record_quantities(EXAMPLES[kind])
    return {"actuation.kind": kind, **{f"actuation.{key}": v for key, v in numbers.items() if v}}


def _table(folder: Path, head: str, *cells: str) -> Path:
    path = folder / "measured.csv"
    rows = [f"{50 * (k + 1)};{cell};{150 - 10 * k}" for k, cell in enumerate(cells)]
    path.write_text("\n".join([HEAD.format(head), *rows]) + "\n")
    return path


def _bench(folder: Path, table: Path, values: dict[str, Any], **draft: Any) -> Bench:
    ds.write_bench(folder / "own", ds.BenchDraft(table, values=values, **draft))
    return load_bench(folder / "own")


@pytest.mark.parametrize(
    ("kind", "head", "cells", "levels"),
    [
        ("pneumatic", "p [bar]", ("4,5", "6,0", "7,5"), (4.5, 6.0, 7.5)),
        ("pneumatic", "Versorgungsdruck [kPa]", ("450", "600,5"), (4.5, 6.005)),
        ("hydraulic", "supply pressure", ("1.2 MPa", "0.8 MPa"), (12.0, 8.0)),
        ("hydraulic", "Druck in mbar;Gegendruck [bar]", ("12000;0", "8000;0,1"), (12.0, 8.0)),
        ("solenoid", "Spannung [V]", ("9,5", "12"), (9.5, 12.0)),
        ("solenoid", "coil current [mA]", ("4000", "5500"), (4.0, 5.5)),
    ],
)
def test_a_set_value_gives_the_force_of_its_row(
    tmp_path: Path, kind: str, head: str, cells: tuple[str, ...], levels: tuple[float, ...]
) -> None:
    bench = _bench(tmp_path, _table(tmp_path, head, *cells), _actuation(kind))
    actuator = EXAMPLES[kind]
    key = {"V]": "voltage_V", "A]": "current_A"}.get(head[-2:], actuator.set_keys[0])
    forces = [actuator.set_force(key, level) for level in levels]
    profiles = [reading.point.profile for reading in bench.readings]
    assert [profile.force for profile in profiles] == pytest.approx(forces)
    assert {profile.rise for profile in profiles} == {COMMAND_RISE_S}
    assert bench.clutch.actuator is not None
    assert bench.clutch.actuator.record == pytest.approx(actuator.record)
    head_line = (tmp_path / "own" / "shifts.csv").read_text().splitlines()[0]
    assert key in head_line
    assert "force_rise_s" not in head_line
    study = study_of(bench, "own")
    assert study["actuation"]["kind"] == kind
    assert "rise_s" not in study["actuation"]


@pytest.mark.parametrize(
    ("head", "cell", "values", "words"),
    [
        (
            "p [bar]",
            "6",
            {},
            "'p [bar]' is a pressure and no force_N, and the stand has no actuator; say the "
            'actuator, values={"actuation.kind": "pneumatic"} or',
        ),
        ("p [bar]", "6", {}, 'columns={"force_N": "p [bar] * 4.9 cm2"}'),
        (
            "p [bar]",
            "6",
            _actuation("solenoid"),
            "'p [bar]' is a pressure and no force_N, and the solenoid actuator takes no supply_bar",
        ),
        (
            "p [bar]",
            "9,5",
            _actuation("pneumatic"),
            "row 2: supply_bar is 9.5 bar, but its 1137.5 N exceed the 950 N of the pneumatic "
            "actuator at its full supply pressure; correct it, or raise the supply pressure in",
        ),
        (
            "p [bar]",
            "0,3",
            _actuation("pneumatic"),
            "supply_bar is 0.3 bar, but it leaves -12.5 N at the fork of the pneumatic actuator",
        ),
        (
            "p Ventil [bar];p Kolben [bar]",
            "6;5",
            _actuation("pneumatic"),
            "supply_bar may be the column 'p Ventil [bar]' or 'p Kolben [bar]'; say which",
        ),
        (
            "p [bar]",
            "6",
            {"actuation.kind": "pneumatic", "actuation.area_cm2": 12.5},
            "'actuation.supply_bar' is missing; add it",
        ),
        (
            "Schaltkraft [N]",
            "1200",
            _actuation("pneumatic"),
            "force_N is 1200 N, but the pneumatic actuator gives 950 N at its full supply",
        ),
    ],
)
def test_what_an_actuator_lacks_is_refused_with_its_remedy(
    tmp_path: Path, head: str, cell: str, values: dict[str, Any], words: str
) -> None:
    with pytest.raises(ds.DogshapeError) as refused:
        _bench(tmp_path, _table(tmp_path, head, cell), values)
    assert words in str(refused.value)


def test_columns_of_the_folder_are_checked(tmp_path: Path) -> None:
    _bench(tmp_path, _table(tmp_path, "p [bar]", "6", "7"), _actuation("pneumatic"))
    path = tmp_path / "own" / "shifts.csv"
    plain = pd.read_csv(path)
    for changes, words in (
        ({"force_N": 700.0}, "the columns supply_bar and force_N, but one sets the force; leave"),
        ({"force_rise_s": 0.2}, "must be empty, as the pneumatic actuator of the stand has no ri"),
        ({"supply_bar": ""}, "column supply_bar is '', but it must be a number"),
    ):
        plain.assign(**changes).to_csv(path, index=False)
        with pytest.raises(DataError, match=words):
            load_bench(tmp_path / "own")
    plain.rename(columns={"supply_bar": "voltage_V"}).to_csv(path, index=False)
    with pytest.raises(DataError, match="has a pneumatic actuator, which supply_bar or force_N"):
        load_bench(tmp_path / "own")
    plain.to_csv(path, index=False)
    toml = tmp_path / "own" / "bench.toml"
    toml.write_text(toml.read_text().partition("[actuation]")[0])
    with pytest.raises(
        DataError, match=r"the stand has no actuator; state in \[actuation\] of ben"
    ):
        load_bench(tmp_path / "own")


def test_a_stand_takes_the_actuator_of_its_origin(tmp_path: Path) -> None:
    """Of a study with a cylinder; a kind "profile" leaves it out."""
    table = _table(tmp_path, "Schaltkraft [N]", "500", "600")
    bench = _bench(tmp_path, table, {}, origin="amt")
    assert bench.clutch.actuator == load_study("amt").clutch.actuator
    ds.write_bench(
        tmp_path / "plain",
        ds.BenchDraft(table, "amt", rise_s=0.1, values={"actuation.kind": "profile"}),
    )
    plain = load_bench(tmp_path / "plain")
    assert plain.clutch.actuator is None
    assert {reading.point.profile.rise for reading in plain.readings} == {0.1}


@pytest.fixture(scope="module")
def shift() -> Engagement:
    """A shift of the stand's clutch at 6 bar."""
    clutch = replace(load_bench("mq200_stand").clutch, actuator=EXAMPLES["pneumatic"])
    force = EXAMPLES["pneumatic"].set_force("supply_bar", 6.0)
    point = OperatingPoint(50.0 * RPM, ForceProfile(force, COMMAND_RISE_S))
    return engage(clutch.with_engine("planar"), point, 3.0 * DEG)


def _log(shift: Engagement, offset: float = 0.0, unit: str = "bar") -> pd.DataFrame:
    """Sample a shift as a bench that logs the pressure, with scatter."""
    rng = np.random.default_rng(2)
    time = np.arange(0.0, shift.trace.time[-1] + DELAY_S + 4.0 * STEP_S, STEP_S)
    supply = AMBIENT_PA + 6e5
    pressure = (shift.run.states[:, ACTUATOR_LEVEL] * supply - AMBIENT_PA) / 1e5 + offset  # bar
    columns = {
        "displacement_mm": (shift.trace.displacement / MM, 0.005),
        "pressure_bar": (pressure, 0.01),
        "sliding_speed_rpm": (shift.trace.sliding_speed / RPM, 0.1),
        "output_speed_rpm": (shift.trace.output_speed / RPM, 0.1),
    }
    table = {"t_s": time}
    for name, (values, noise) in columns.items():
        series = np.interp(time - DELAY_S, shift.trace.time, values)
        table[name] = series + noise * rng.standard_normal(time.size)
    if unit != "bar":
        table[f"Druck [{unit}]"] = table.pop("pressure_bar") * {"kPa": 100.0, "MPa": 0.1}[unit]
    return pd.DataFrame(table)


def _traced(tmp_path: Path, shift: Engagement, log: pd.DataFrame, **draft: Any) -> Bench:
    log.to_csv(tmp_path / "rec.csv", index=False)
    assert shift.shift_time is not None
    time_ms = 1e3 * (shift.shift_time + DELAY_S)
    table = tmp_path / "measured.csv"
    table.write_text(f"mismatch [rpm],p [bar],shift time [ms],trace\n50,6,{time_ms:.2f},rec.csv\n")
    return _bench(tmp_path, table, _actuation("pneumatic") | draft.pop("values", {}), **draft)


def _only_trace(bench: Bench) -> BenchTrace:
    (trace,) = bench.cells[0].traces
    return trace


@pytest.mark.parametrize("unit", ["bar", "kPa"])
def test_a_logged_pressure_makes_the_force_of_a_trace(
    tmp_path: Path, shift: Engagement, unit: str
) -> None:
    """Piston area times pressure less the spring; it starts after the dead time."""
    trace = _only_trace(_traced(tmp_path, shift, _log(shift, unit=unit)))
    assert trace.logged is not None
    pressed = np.maximum(12.5e-4 * trace.logged.values - 50.0, 0.0)
    assert trace.force == pytest.approx(pressed)
    acting = np.interp(trace.time - DELAY_S, shift.trace.time, shift.trace.shift_force)
    assert abs(trace.force - acting).max() < 5.0 * 12.5e-4 * 0.01e5  # five scatters


def test_the_dead_time_is_read_from_the_pressure(tmp_path: Path, shift: Engagement) -> None:
    """Not from the force, which the return spring holds back for some milliseconds more."""
    bench = _traced(tmp_path, shift, _log(shift))
    (found,) = [w.found for w in bench.warnings if w.quantity == "trace_time"]
    start = float(found.partition("but at ")[2].partition(" s")[0])
    assert start == pytest.approx(DELAY_S, abs=1e-3)
    trace = _only_trace(bench)
    assert trace.time[np.argmax(trace.force > 20.0)] > DELAY_S + 5e-3


def test_an_absolute_pressure_is_asked_about_and_set_to_zero(
    tmp_path: Path, shift: Engagement
) -> None:
    bench = _traced(tmp_path, shift, _log(shift, offset=1.0))
    (warning,) = [w for w in bench.warnings if "pressure_bar" in w.found]
    assert "bar (median) before the force begins" in warning.sentence
    assert "this looks like an absolute pressure" in warning.sentence
    zeroed = load_bench(tmp_path / "own", ["trace_force=zeroed"])
    true_trace = np.interp(
        _only_trace(zeroed).time - DELAY_S, shift.trace.time, shift.trace.shift_force
    )
    assert abs(_only_trace(zeroed).force - true_trace).max() < 10.0


def test_other_units_and_stands_of_a_log_are_refused(tmp_path: Path, shift: Engagement) -> None:
    wrong = _log(shift)
    wrong["pressure_bar"] *= 100.0
    path = tmp_path / "rec.csv"
    _log(shift).to_csv(path, index=False)
    with pytest.raises(DataError, match=r"pressure_bar in place of force_N, .* stand has none"):
        read_trace(path)
    with pytest.raises(DataError, match="has a solenoid one; state"):
        read_trace(path, EXAMPLES["solenoid"])
    with pytest.raises(DataError, match=r"pressure_bar of the traces ends at 17\.\d times the va"):
        _traced(tmp_path, shift, wrong)


def test_marks_of_a_logged_flight_are_those_of_the_simulated_one(
    tmp_path: Path, shift: Engagement
) -> None:
    """Displacement up to the first touch, and the pressure of a fork at rest."""
    bench = _traced(tmp_path, shift, _log(shift))
    setting = Setting(replace(bench.clutch), bench.cells[0].point)
    profile = setting.point.profile
    gap = bench.clutch.dog.axial_gap
    exact = fly([setting], gap, profile.force, USUAL.flight_creep)[0][0]
    marks = trace_marks(_only_trace(bench), profile, gap, has_actuator=True)
    found = np.flatnonzero(np.isfinite(marks[:, 0]))
    assert (found < len(WAYS)).any()
    assert (found >= len(WAYS)).any()
    assert marks[found, 0] - DELAY_S == pytest.approx(exact[found], abs=5e-4)
    (flight,) = flights_of(bench)
    assert set(flight.places) == set(found.tolist())
    measured = replace(_only_trace(bench), logged=None)
    unmarked = trace_marks(measured, profile, gap, has_actuator=True)[len(WAYS) :, 0]
    assert np.isnan(unmarked).all()


def test_the_time_of_a_pressure_goes_with_the_inverse_of_the_conductance(
    shift: Engagement,
) -> None:
    cylinder = EXAMPLES["pneumatic"]
    assert isinstance(cylinder, Pneumatic)
    times = []
    for conductance in (cylinder.conductance, 0.5 * cylinder.conductance):
        slow = replace(cylinder, conductance=conductance)
        clutch = replace(shift.clutch, actuator=slow)
        setting = Setting(clutch, shift.point)
        marks = fly([setting], clutch.dog.axial_gap, shift.point.profile.force, 0.0)[0][0]
        times.append(marks[len(WAYS) :])
    assert times[1] == pytest.approx(2.0 * times[0], rel=1e-3)


def test_a_report_says_which_effects_are_not_tried() -> None:
    cylinder = replace(STAND.clutch, actuator=EXAMPLES["pneumatic"])
    sentences = remarks(diagnosis_of(POSTERIOR, replace(STAND, clutch=cylinder)))
    assert (
        "Not tried is slow rise of the shift force: the pneumatic actuator has a course of its "
        "own, the filling of its cylinder."
    ) in sentences
    assert not any("Not tried" in sentence for sentence in remarks(diagnosis_of(POSTERIOR)))
