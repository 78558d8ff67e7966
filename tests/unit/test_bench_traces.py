"""Traces as CSV, TDMS and MDF: one time axis, errors, and marks found in spite of scatter."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

from dogshape.bench.bench_data import Reading, gather, load_bench
from dogshape.bench.flight_marks import (
    FORCE_FLOOR,
    FORCES,
    SIZE,
    WAYS,
    flights_of,
    mark_of,
    trace_marks,
)
from dogshape.bench.traces import COLUMNS, BenchTrace, read_trace
from dogshape.diagnosis.prediction.flights import fly
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.actuation import ForceProfile
from dogshape.sim.shift.actuators import EXAMPLES
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import MM, RPM
from tests.benches import good_set
from tests.conftest import require_program
from tests.trace_benches import sample_trace, settings, trace_bench

GAP = 1e-3
Drawn = Callable[[float, float, int], list[BenchTrace]]


@pytest.fixture(scope="module")
def setting() -> Setting:
    """The slow one of two operating points at 315.5 N."""
    return next(s for s in settings() if s.point.profile.force == 315.5)


@pytest.fixture(scope="module")
def drawn(setting: Setting) -> Drawn:
    """Sample a shift that waits for its slot again and again, its start anywhere within a step."""
    shift = engage(ClutchPlant(setting.clutch), setting.point, 0.05).trace

    def draw(step: float, noise: float, count: int) -> list[BenchTrace]:
        rng = np.random.default_rng(3)
        found = []
        for early in step * rng.random(count):
            late = replace(setting, delay=float(early))
            trace = sample_trace(shift, late, step, noise, rng)
            found.append(replace(trace, time=trace.time - early))
        return found

    return draw


@pytest.mark.parametrize(("step", "noise"), [(1e-3, 1.0), (5e-4, 1.0), (1e-3, 3.0), (2e-3, 0.5)])
def test_marks_of_a_noisy_trace_come_back_within_their_errors(
    setting: Setting, drawn: Drawn, step: float, noise: float
) -> None:
    profile = setting.point.profile
    exact = fly([setting], GAP, profile.force, USUAL.flight_creep)[0][0]
    table = np.array([trace_marks(trace, profile, GAP) for trace in drawn(step, noise, 60)])
    for place in range(SIZE):
        marks = table[np.isfinite(table[:, place, 0]), place]
        if len(marks) < 0.8 * len(table):
            continue
        apart, errors = marks[:, 0] - exact[place], marks[:, 1]
        score = apart / np.hypot(errors, 2e-5)
        assert 0.4 < np.sqrt((score**2).mean()) < 1.5
        # What the mean is off by stays below the model error that every mark has.
        assert abs(np.median(apart)) < 1.5e-4 + 0.3 * np.median(errors)


def test_marks_of_straight_rises_are_exact_and_few_have_none(
    setting: Setting, drawn: Drawn
) -> None:
    time, around = np.linspace(0.0, 0.1, 101), (0.75, 1.3)
    assert mark_of(time, 2000.0 * time, 50.5, around)[[0, 2]] == pytest.approx(0.02525)
    for values in (np.zeros(101), np.full(101, 100.0), 100.0 * time):
        assert np.isnan(mark_of(time, values, 50.0, around)).all()
    quiet, usual, loud = (
        trace_marks(drawn(1e-3, f, 1)[0], setting.point.profile, GAP)[:, 0] for f in (0.1, 1.0, 5)
    )
    # 0.3, 0.6 and 0.9 of the gap, and a tenth of the force.
    assert np.isfinite(usual[[2, 3, 4, len(WAYS)]]).all()
    assert (np.isnan(quiet[0]), np.isnan(loud[0])) == (False, True)


def _early(trace: BenchTrace) -> BenchTrace:
    """Return a trace whose ring was thrown back at 0.4 of the gap."""
    way = trace.displacement
    first = int(np.argmax(way > 0.4 * GAP))
    back = np.concatenate([way[:first], np.full(20, 0.35 * GAP), way[first:]])[: way.size]
    return replace(trace, displacement=back)


def test_traces_of_one_profile_are_averaged_and_odd_ones_left_out(
    setting: Setting, drawn: Drawn
) -> None:
    traces = drawn(1e-3, 1.0, 12)
    exact = fly([setting], GAP, setting.point.profile.force, USUAL.flight_creep)[0][0]
    for odd in (0, 2):
        mixed = [_early(trace) if k < odd else trace for k, trace in enumerate(traces)]
        rows = [Reading(k + 2, setting.point, 1, 0.1, True, t) for k, t in enumerate(mixed)]
        bench = replace(trace_bench(None, {}, shifts=0), cells=gather(rows))
        (seen,) = flights_of(bench)
        apart = seen.times - exact[seen.places]
        assert abs(apart[seen.places < len(WAYS)]).max() < 3e-4
        assert np.sqrt(np.diag(seen.covariance)).min() > 2e-4
        assert np.linalg.eigvalsh(seen.covariance).min() > 0.0


def test_the_shares_are_those_of_the_nominal_force() -> None:
    profile = ForceProfile(400.0, 0.1)
    time = np.arange(0.0, 0.12, 1e-3)
    still = np.zeros(time.size)
    trace = BenchTrace(Path(), time, still, profile.at(time), still, still)
    marks = trace_marks(trace, profile, GAP)[len(WAYS) :, 0]
    exact = [float(brentq(lambda t, s=s: profile.at(t) - s * 400.0, 0.0, 0.1)) for s in FORCES]
    assert marks == pytest.approx(exact, abs=0.5 * FORCE_FLOOR)


BEGIN = np.datetime64("2024-05-31T14:05:09", "us")


def curve(name: str, time: Array) -> Array:
    """Quantities that bend little within a sample step, in the units of the columns."""
    shapes = {
        "displacement_mm": 4.0 * (time / 0.06) ** 4,
        "force_N": 2e4 * time**2,
        "pressure_bar": 2e3 * time**2,
        "sliding_speed_rpm": 40.0 * time,
        "output_speed_rpm": 100.0 - 30.0 * time,
    }
    return shapes[name]


def regular(late: float = 0.0, step: float = 1e-3, count: int = 61) -> Array:
    return np.asarray(late + step * np.arange(count), dtype=float)


def write_tdms(path: Path, times: Mapping[str, Array], how: str, **changed: Any) -> None:
    """Write channels, each with its own times told by one of the waveform properties.

    ``changed`` are other samples of a channel, None for none; ``t_s`` is a channel of times.
    """
    nptdms = importlib.import_module("nptdms")
    channels = []
    for name, time in times.items():
        late, step = float(time[0]), float(time[1] - time[0])
        told = {"wf_increment": step, "wf_start_offset": late, "wf_start_time": BEGIN}
        if how == "wf_start_time":
            micro = np.timedelta64(round(late * 1e6), "us")
            told |= {"wf_start_offset": 0.0, "wf_start_time": BEGIN + micro}
        told = {} if how == "nothing" else told
        if (values := changed.get(name, curve(name, time))) is not None:
            channels.append(nptdms.ChannelObject("shift", name, np.asarray(values), told))
    if "t_s" in changed:
        channels.append(nptdms.ChannelObject("shift", "t_s", changed["t_s"]))
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(channels)


def write_mdf(path: Path, times: Mapping[str, Array], how: str, **changed: Any) -> None:
    """Write channels, each in a group with a master of its own; ``how`` is the unit of the force.

    ``changed`` are other samples of a channel, None for none.
    """
    asammdf = importlib.import_module("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for name, time in times.items():
            unit = how if name == "force_N" else ""
            if (values := changed.get(name, curve(name, time))) is not None:
                file.append([asammdf.Signal(values, time[: len(values)], name=name, unit=unit)])
        file.save(path, overwrite=True)


def write_csv(path: Path, times: Mapping[str, Array], _: str) -> None:
    """Write a table of all times of all channels, with empty cells where one has no sample."""
    every = {name: pd.Series(curve(name, t), np.round(t, 9)) for name, t in times.items()}
    table = pd.DataFrame(every).rename_axis("t_s")[[*COLUMNS[1:]]]
    table.to_csv(path, float_format="%.9g", lineterminator="\n")


def check_values(trace: BenchTrace) -> None:
    """Compare all channels with the curves at the times of the trace."""
    speeds = trace.sliding_speed / RPM, trace.output_speed / RPM
    every = trace.displacement / MM, trace.force, *speeds
    for name, values in zip(COLUMNS[1:], every, strict=True):
        known = curve(name, trace.time)
        assert values == pytest.approx(known, abs=2e-3 * float(abs(known).max()))


def some(late: float = 0.0, step: float = 1e-3, count: int = 61) -> dict[str, Array]:
    """Times of the channels: both speeds have other ones."""
    own = regular(late, step, count)
    return {name: own if name in COLUMNS[3:] else regular() for name in COLUMNS[1:]}


#: Times of the channels, first and last time of the trace in ms, samples that are cut.
APART = {
    "5 ms later": (some(late=5e-3), (5, 60), 5),
    "8 ms earlier and shorter": (some(late=-8e-3), (0, 52), 8),
    "at ten times the rate": (some(step=1e-4, count=601), (0, 60), 0),
    "at another rate and start": (some(late=3.3e-3, step=2.7e-3, count=21), (4, 57), 7),
}
WRITERS: dict[str, tuple[str, Callable[..., None], str]] = {
    "wf_start_time": ("x.tdms", write_tdms, "nptdms"),
    "wf_start_offset": ("x.tdms", write_tdms, "nptdms"),
    "": ("x.mf4", write_mdf, "asammdf"),
    "csv": ("x.csv", write_csv, "csv"),
}


@pytest.mark.parametrize("kind", APART)
@pytest.mark.parametrize("how", WRITERS)
def test_all_channels_get_the_times_of_the_displacement(
    tmp_path: Path, kind: str, how: str
) -> None:
    times, (first, last), cut = APART[kind]
    name, write, library = WRITERS[how]
    require_program(find_spec(library) is not None, library)
    write(tmp_path / name, times, how)
    trace = read_trace(tmp_path / name)
    assert trace.time == pytest.approx(1e-3 * np.arange(first, last + 1))
    check_values(trace)
    said = "; ".join(trace.notes)
    # Samples that lie at the times of the displacement need no interpolation, whenever they begin.
    words = "interpolated on the times of displacement_mm (every 1 ms)"
    assert (words in said and "output_speed_rpm" in said) == kind.startswith("at ")
    assert (f"{cut} of 61 samples of displacement_mm cut" in said) == (cut > 0)


@pytest.mark.parametrize("how", ["wf_start_offset", ""])
def test_a_recorder_logs_the_pressure_of_an_actuator(tmp_path: Path, how: str) -> None:
    """In place of the force, which is piston area times pressure less the spring."""
    name, write, library = WRITERS[how]
    require_program(find_spec(library) is not None, library)
    times = some()
    times["pressure_bar"] = times.pop("force_N")
    write(tmp_path / name, times, how)
    trace = read_trace(tmp_path / name, EXAMPLES["pneumatic"])
    pressed = 12.5e-4 * 1e5 * curve("pressure_bar", trace.time) - 50.0
    assert trace.force == pytest.approx(np.maximum(pressed, 0.0))
    assert trace.signal == pytest.approx(1e5 * curve("pressure_bar", trace.time))
    with pytest.raises(DataError, match="pressure_bar in place of force_N"):
        read_trace(tmp_path / name)


@pytest.mark.parametrize("late", [-4.36e-9, 9e-5])
def test_masters_that_differ_by_a_small_share_of_the_step_are_alike(
    tmp_path: Path, late: float
) -> None:
    require_program(find_spec("asammdf") is not None, "asammdf")
    write_mdf(tmp_path / "x.mf4", some(late=late), "")
    trace = read_trace(tmp_path / "x.mf4")
    assert trace.time.size == 61
    assert trace.notes == ()
    check_values(trace)


def test_samples_of_mdf_that_are_marked_invalid_are_left_out(tmp_path: Path) -> None:
    require_program(find_spec("asammdf") is not None, "asammdf")
    asammdf = importlib.import_module("asammdf")
    bad = (regular() > 0.02) & (regular() < 0.04)
    with asammdf.MDF(version="4.10") as file:
        for name in COLUMNS[1:]:
            values = curve(name, regular())
            marked = bad if name == "force_N" else np.zeros(61, dtype=bool)
            values[marked] = 1e9
            file.append([asammdf.Signal(values, regular(), name=name, invalidation_bits=marked)])
        file.save(tmp_path / "x.mf4")
    trace = read_trace(tmp_path / "x.mf4")
    assert trace.force.max() < 100.0
    assert "force_N (42 samples, every 1 ms) interpolated" in trace.notes[0]
    assert "force_N without a sample from 0.02 to 0.04 s" in trace.notes[1]


def test_lost_samples_are_said_and_unsorted_ones_refused(tmp_path: Path) -> None:
    path, time = tmp_path / "x.csv", regular()
    lost = np.concatenate([time[:20], time[40:]])
    write_csv(path, dict.fromkeys(COLUMNS[1:], lost), "")
    assert read_trace(path).notes == ("displacement_mm without a sample from 0.019 to 0.04 s",)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:12], lines[14], lines[12], *lines[13:]]))
    with pytest.raises(DataError, match=r"must grow from sample to sample; .*sort the rows"):
        read_trace(path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return good_set(tmp_path)


def cell(row: int, place: int, text: str) -> Callable[[list[str]], list[str]]:
    """Write a text into a cell; row as an editor counts."""

    def change(given: list[str]) -> list[str]:
        cells = given[row - 1].split(",")
        cells[place] = text
        return [*given[: row - 1], ",".join(cells), *given[row:]]

    return change


BROKEN: list[tuple[Callable[[list[str]], list[str]], str]] = [
    (cell(1, 1, "displacement_m"), "row 1: the column 'displacement_mm' is missing; add it"),
    (cell(7, 1, "abc"), "row 7, column displacement_mm is 'abc', but it must be a number"),
    (cell(7, 0, ""), "row 7, column t_s is '', but it must be a number"),
    (cell(7, 2, "nan"), "row 7, column force_N is 'nan', but it must be a finite number"),
    (cell(7, 0, "0.001"), "row 7, column t_s is '0.001' after '0.004', but time must grow"),
    (lambda given: given[:9], "has 8 samples of displacement_mm, but a trace needs at least 10"),
]


@pytest.mark.parametrize(("spoil", "words"), BROKEN, ids=[words for _, words in BROKEN])
def test_broken_traces(folder: Path, spoil: Callable[[list[str]], list[str]], words: str) -> None:
    path = folder / "traces" / "0041.csv"
    path.write_text("\n".join(spoil(path.read_text().splitlines())))
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    for word in (words, "0041.csv", "shifts.csv, row 2"):
        assert word in str(refused.value)
    path.unlink()
    with pytest.raises(DataError, match="there is no trace"):
        load_bench(folder)


def test_of_a_trace_that_ends_early_the_beginning_counts(folder: Path) -> None:
    path, before = folder / "traces" / "0041.csv", load_bench(folder).readings[0]
    path.write_text("\n".join(path.read_text().splitlines()[:21]))
    bench = load_bench(folder)
    (warning,) = [one for one in bench.warnings if one.quantity == "traces"]
    assert "0041.csv: ends " in warning.sentence
    assert "before the shift of row 2 is over and before the first touch, if" in warning.sentence
    after = bench.readings[0]
    assert after.trace is not None
    assert before.trace is not None
    assert np.array_equal(after.trace.time, before.trace.time[:20])
    assert after.time == before.time


NAN = np.where(np.arange(61) == 4, np.nan, curve("displacement_mm", regular()))
WRONG: list[tuple[str, str, dict[str, Any], str]] = [
    ("x.tdms", "", {"force_N": None}, "the channel 'force_N' is missing"),
    ("x.tdms", "nothing", {}, "nor the waveform properties wf_increment"),
    ("x.tdms", "", {"force_N": [1.0, 2.0]}, "the channels have 2 samples of"),
    ("x.tdms", "", {"t_s": regular(), "force_N": [1.0, 2.0]}, "channel force_N has 2 samples and"),
    ("x.tdms", "", {"force_N": ["a", "b"]}, "does not hold numbers"),
    ("x.tdms", "", {"displacement_mm": NAN}, "row 4, column displacement_mm is 'nan'"),
    ("x.mf4", "N", {"force_N": None}, "the channel 'force_N' is missing"),
    ("x.mf4", "N", {"force_N": np.ones(5)}, "the channels have 5 samples of displacement_mm in"),
    ("x.mf4", "kN", {}, "channel force_N is in 'kN'"),
]


@pytest.mark.parametrize(("name", "how", "changed", "words"), WRONG)
def test_broken_files(
    tmp_path: Path, name: str, how: str, changed: dict[str, Any], words: str
) -> None:
    write, library = (write_mdf, "asammdf") if name == "x.mf4" else (write_tdms, "nptdms")
    require_program(find_spec(library) is not None, library)
    path = tmp_path / name
    write(path, some(), how, **changed)
    with pytest.raises(DataError) as refused:
        read_trace(path)
    assert words in str(refused.value)
    assert str(path) in str(refused.value)
    path.write_bytes(b"nothing of that kind, whatever its name says" * 10)
    with pytest.raises(DataError, match=r"is not an? (MDF|TDMS) file"):
        read_trace(path)


@pytest.mark.parametrize(("name", "extra"), [("x.mf4", "mdf"), ("x.tdms", "tdms")])
def test_without_the_extra_a_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, extra: str
) -> None:
    def missing(name: str) -> None:
        raise ImportError(f"No module named '{name}'")

    monkeypatch.setattr("dogshape.bench.traces.import_module", missing)
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(InputError, match=rf"cannot be loaded.*'\.\[{extra}\]'"):
        read_trace(tmp_path / name)
