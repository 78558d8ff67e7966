"""Clocks and zeros of traces: where the force begins, what is said of it, and what corrects it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.traces import BenchTrace, find_force_start
from dogshape.sim.errors import DataError
from dogshape.sim.shift.actuation import cubic_step
from tests.benches import good_set

Series = NDArray[np.float64]
Frame = Callable[[pd.DataFrame, int], pd.DataFrame]

RISE, FORCE, NOISE = 0.15, 600.0, 1.5


def ramp(tau: Series) -> Series:
    return np.clip(tau / RISE, 0.0, 1.0)


SHAPES: dict[str, Callable[[Series], Series]] = {
    "cubic step": lambda tau: cubic_step(tau / RISE, 1.0),
    "ramp": ramp,
    "jump": lambda tau: (tau > 0.0).astype(float),
    "first order": lambda tau: 1.0 - np.exp(-np.maximum(tau, 0.0) / 0.01),
    "released": lambda tau: cubic_step(tau / RISE, 1.0) * (tau < 0.25),
    "peak of the contact": lambda tau: (
        cubic_step(tau / RISE, 1.0) + 1.5 * np.exp(-(((tau - 0.045) / 0.002) ** 2))
    ),
}


def record(shape: str, time: Series, start: float, rest: float, seed: int) -> BenchTrace:
    """Make a trace whose force begins at ``start``, with noise and an offset."""
    rng = np.random.default_rng(seed)
    tau = time - start
    force = rest + FORCE * np.where(tau > 0.0, SHAPES[shape](tau), 0.0)
    way = 4e-3 * np.clip(tau / 0.06, 0.0, 1.0) ** 4
    still = np.zeros(time.size)
    return BenchTrace(Path(), time, way, force + NOISE * rng.normal(size=time.size), still, still)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("begin", "count", "step", "start", "rest"),
    [
        (0.0, 400, 1e-3, 0.05, 0.0),
        (-0.2, 2500, 2e-4, 0.0, 20.0),
        (1716472800.0, 600, 5e-4, 1716472800.02, 5.0),
    ],
)
def test_the_start_of_a_force_comes_back(
    *, shape: str, begin: float, count: int, step: float, start: float, rest: float
) -> None:
    time = np.asarray(begin + step * np.arange(count), dtype=float)
    found = [find_force_start(record(shape, time, start, rest, seed), RISE) for seed in range(6)]
    known = [one for one in found if one is not None]
    assert len(known) == 6
    apart = np.array([one.time - start for one in known])
    # First order and jump begin with a slope that a step of the samples hides.
    assert abs(apart).max() < 1.0e-3 + 0.6 * step
    errors = np.array([one.error for one in known])
    assert abs(np.median(apart)) < 2.0 * np.median(errors) + 0.3e-3
    assert [one.force for one in known] == pytest.approx([rest] * 6, abs=2.0)


def test_noise_without_a_rise_has_no_start() -> None:
    time, still = np.arange(0.0, 0.3, 1e-3), np.zeros(300)
    noise = np.random.default_rng(1).normal(size=time.size)
    assert find_force_start(BenchTrace(Path(), time, still, noise, still, still), RISE) is None
    rise = noise + 12.0 * cubic_step((time - 0.1) / RISE, 1.0)
    weak = BenchTrace(Path(), time, still, rise, still, still)
    found = find_force_start(weak, RISE)
    assert found is not None
    assert found.time == pytest.approx(0.1, abs=5.0 * found.error)


def spoilt(tmp_path: Path, change: Frame) -> Path:
    """Copy the good set and change its traces, each with its number."""
    folder = good_set(tmp_path, sensor=False)
    for number, path in enumerate(sorted((folder / "traces").glob("*.csv"))):
        change(pd.read_csv(path), number).to_csv(path, index=False)
    return folder


def later(time: float, each: float = 0.0) -> Frame:
    return lambda frame, number: frame.assign(t_s=frame.t_s + time + each * number)


def recorded_before(time: float) -> Frame:
    """Put a record at rest before the force; it begins at zero."""

    def change(frame: pd.DataFrame, number: int) -> pd.DataFrame:
        rng, count = np.random.default_rng(number), round(time / 1e-3)
        rest = pd.DataFrame({
            "t_s": frame.t_s.iloc[0] - 1e-3 * np.arange(count, 0, -1),
            "displacement_mm": 0.01 * rng.normal(size=count),
            "force_N": 0.5 * rng.normal(size=count),
            "sliding_speed_rpm": 0.2 * rng.normal(size=count),
            "output_speed_rpm": frame.output_speed_rpm.iloc[0] + 0.2 * rng.normal(size=count),
        })  # fmt: skip
        return pd.concat([rest, frame]).assign(t_s=lambda both: both.t_s + time)

    return change


def in_ms(frame: pd.DataFrame, _: int) -> pd.DataFrame:
    return frame.assign(t_s=2000.0 + 1e3 * frame.t_s)


CLOCKS: list[tuple[str, Frame, list[str], float]] = [
    ("epoch", later(1716472800.5, 37.1), ["trace_time=from_force"], 1716472800.5),
    ("pre-trigger", recorded_before(0.3), ["trace_time=from_force"], 0.3),
    ("one trace", lambda f, k: later(2.0 * (k == 3))(f, k), ["trace_time=from_force"], 2.0),
    ("ms", in_ms, ["trace_time=ms", "trace_time=from_force"], 2.0),
]


@pytest.mark.parametrize(("change", "asked", "start"), [c[1:] for c in CLOCKS],
                         ids=[c[0] for c in CLOCKS])  # fmt: skip
def test_a_recorders_clock_is_refused_and_corrected_as_asked(
    tmp_path: Path, change: Frame, asked: list[str], start: float
) -> None:
    (tmp_path / "good").mkdir()
    good = load_bench(good_set(tmp_path / "good", sensor=False))
    folder = spoilt(tmp_path, change)
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    said = str(refused.value)
    first = float(said.split("does not begin at t_s = 0 but at ")[1].split(maxsplit=1)[0])
    assert first == pytest.approx(start, abs=5e-3)
    assert "this looks like the recorder's clock" in said
    assert "wrong scale" not in said
    for correction in asked:
        assert f"--correct {correction} takes it as that" in said
    bench = load_bench(folder, asked)
    assert bench.warnings == ()
    for mine, theirs in zip(bench.readings, good.readings, strict=True):
        if mine.trace is not None and theirs.trace is not None:
            apart = mine.trace.time[-1] - theirs.trace.time[-1]
            assert abs(apart) < 4.0 * mine.trace.start_error + 1e-3
            assert 1e-4 < mine.trace.start_error < 5e-3


def test_a_pre_trigger_or_a_dead_time_in_table_and_traces_is_no_clock(tmp_path: Path) -> None:
    (tmp_path / "early").mkdir()
    early = spoilt(tmp_path / "early", lambda f, k: later(-0.05)(recorded_before(0.05)(f, k), k))
    assert load_bench(early).warnings == ()
    late = 0.012
    folder = spoilt(tmp_path, recorded_before(late))
    table = pd.read_csv(folder / "shifts.csv")
    table.assign(shift_time_s=table.shift_time_s + late).to_csv(folder / "shifts.csv", index=False)
    (warning,) = load_bench(folder).warnings
    assert "this looks like a dead time or slow rise of the force" in warning.sentence
    assert "from_force" not in warning.sentence
    state_zero(folder, "force")
    (warning,) = load_bench(folder).warnings
    assert "count from another instant than the force" in warning.sentence


@pytest.mark.parametrize("late", [-0.009, 0.02, 0.3])
def test_a_constant_between_table_and_traces_is_said(tmp_path: Path, late: float) -> None:
    folder = good_set(tmp_path, sensor=False)
    table = pd.read_csv(folder / "shifts.csv")
    table.assign(shift_time_s=table.shift_time_s + late).to_csv(folder / "shifts.csv", index=False)
    bench = load_bench(folder, ["time=given"])
    (warning,) = [one for one in bench.warnings if one.quantity == "trace_time"]
    size = float(warning.found.split(" ends ")[1].split(" ms ")[0])
    assert size == pytest.approx(1e3 * abs(late), abs=1.5)
    assert ("before" if late > 0.0 else "after") in warning.found
    assert "count from another instant than the force" in warning.sentence
    state_zero(folder, "command")
    (warning,) = [w for w in load_bench(folder, ["time=given"]).warnings if "travel" in w.found]
    assert ("a dead time between command and force" in warning.sentence) == (late > 0.0)


def state_zero(folder: Path, event: str) -> None:
    path = folder / "bench.toml"
    path.write_text(f'{path.read_text()}\n[record]\ntime_zero = "{event}"\n')


@pytest.mark.parametrize(
    ("column", "offset", "correction"),
    [
        ("displacement_mm", 0.3, "displacement=zeroed"),
        ("force_N", -60.0, "trace_force=zeroed"),
    ],
)
def test_an_offset_at_rest_is_said_and_taken_away_as_asked(
    tmp_path: Path, column: str, offset: float, correction: str
) -> None:
    (tmp_path / "good").mkdir()
    good = load_bench(good_set(tmp_path / "good", sensor=False))
    folder = spoilt(tmp_path, lambda frame, _: frame.assign(**{column: frame[column] + offset}))
    (warning,) = load_bench(folder).warnings
    middle = float(warning.found.split(" is ")[1].split()[0])
    assert middle == pytest.approx(offset, abs=1.0 if column == "force_N" else 0.02)
    assert warning.correction == correction
    bench = load_bench(folder, [correction])
    assert bench.warnings == ()
    for mine, theirs in zip(bench.readings, good.readings, strict=True):
        if mine.trace is not None and theirs.trace is not None:
            assert mine.trace.force == pytest.approx(theirs.trace.force, abs=2.0)
            assert mine.trace.displacement == pytest.approx(theirs.trace.displacement, abs=3e-5)


def test_without_a_force_its_start_is_not_invented(tmp_path: Path) -> None:
    folder = spoilt(tmp_path, lambda f, _: f.assign(t_s=f.t_s + 2.0, force_N=0.0 * f.force_N))
    (warning,) = load_bench(folder).warnings
    assert "no rise of force_N stands out from its noise" in warning.sentence
    assert "ends 2.00" in warning.sentence
    with pytest.raises(DataError, match=r"0041.csv: no rise of force_N stands out"):
        load_bench(folder, ["trace_time=from_force"])
