"""Faults of a recording: each kind is named or refused, and a good one raises no alarm."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dogshape.bench.bench_data import load_bench
from dogshape.bench.samples import dropouts, frozen_runs, held_step, rounded_clock
from dogshape.bench.traces import COLUMNS, BenchTrace, read_trace
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError
from dogshape.sim.units import MM, RPM
from tests.benches import good_set
from tests.conftest import require_program

TIME, WAY, FORCE, SLIDING, OUTPUT = COLUMNS
NOISE = {WAY: 4e-3, FORCE: 1.2, SLIDING: 0.2, OUTPUT: 0.3}
Spoil = Callable[[pd.DataFrame], pd.DataFrame]


def recording(seed: int = 1, step: float = 2e-4, noise: float = 1.0) -> pd.DataFrame:
    """Make a shift of 50 ms as a recorder of the stand has it, in the units of the columns."""
    time = step * np.arange(round(0.06 / step))
    random = np.random.default_rng(seed)
    share = np.minimum(time / 0.0495, 1.0)
    clean = {
        WAY: 4.7 * share**3,
        FORCE: 90.0 * share**2,
        SLIDING: 4.0 * share**2,
        OUTPUT: 100.0 - 2.0 * share,
    }
    channels = {
        name: np.round(values + noise * NOISE[name] * random.normal(size=time.size), 4)
        for name, values in clean.items()
    }
    return pd.DataFrame({TIME: np.round(time, 9), **channels})


def put(column: str, values: Any, first: int, end: int) -> Spoil:
    """Write values into samples ``first`` to ``end`` of a column."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[first : end - 1, column] = values
        return table

    return change


def with_times(change: Callable[[Array], Array], step: float = 2e-4) -> Spoil:
    """Change the times of a recording with another sample step."""

    def spoil(_: pd.DataFrame) -> pd.DataFrame:
        table = recording(step=step)
        return table.assign(**{TIME: change(table[TIME].to_numpy())})

    return spoil


def held(column: str, count: int) -> Spoil:
    """Let a recorder repeat each value of a column ``count`` times."""
    return lambda table: table.assign(
        **{column: np.repeat(table[column].to_numpy()[::count], count)[: len(table)]}
    )


def read(folder: Path, spoil: Spoil) -> BenchTrace:
    spoil(recording()).to_csv(folder / "x.csv", index=False, float_format="%.9g")
    return read_trace(folder / "x.csv")


def noisy(count: int, column: str) -> Array:
    return NOISE[column] * np.random.default_rng(7).normal(size=count)


LEFT_OUT: dict[str, tuple[Spoil, str, str]] = {
    "displacement to zero": (
        put(WAY, 0.0, 150, 190),
        "40 of 300 samples of displacement_mm lie at 0 between 0.03 and 0.0378 s",
        "dropouts",
    ),
    "force to zero with its noise": (
        put(FORCE, noisy(20, FORCE), 220, 240), "20 of 300 samples of force_N lie at 0", "dropouts",
    ),
    "speed to a code": (
        put(OUTPUT, -999.0, 100, 105), "5 of 300 samples of output_speed_rpm lie at -999",
        "dropouts",
    ),
    "speed to zero twice": (
        lambda table: put(OUTPUT, 0.0, 20, 30)(put(OUTPUT, 0.0, 200, 230)(table)),
        "40 of 300 samples of output_speed_rpm lie at 0", "dropouts",
    ),
    "zeros to the end": (
        put(WAY, 0.0, 260, 300), "40 of 300 samples of displacement_mm lie at 0", "dropouts",
    ),
    "a row twice": (
        lambda table: table.loc[[*range(12), *range(11, 300)]],
        "1 of 301 samples are there twice (row 14)", "written twice",
    ),
    "rows twice": (
        lambda table: table.loc[[*range(40), *range(30, 300)]].sort_values(TIME, kind="stable"),
        "10 of 310 samples are there twice (row 33)", "written twice",
    ),
    "force of half the rate": (held(FORCE, 2), "force_N repeats each value 2 times", "faster than"),
    "way of a fifth of the rate": (
        held(WAY, 5), "displacement_mm repeats each value 5 times", "faster than",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", LEFT_OUT)
def test_samples_that_are_none_are_left_out_with_a_word(tmp_path: Path, kind: str) -> None:
    spoil, words, cause = LEFT_OUT[kind]
    trace = read(tmp_path, spoil)
    (fault,) = trace.faults
    assert words in fault.text
    assert cause in fault.cause
    good = recording()
    for name, values, unit in ((WAY, trace.displacement, MM), (FORCE, trace.force, 1.0)):
        known = np.interp(trace.time, good[TIME], unit * good[name])
        assert abs(values - known).max() < 0.1 * np.ptp(known)


NAMED: dict[str, tuple[Spoil, str, str]] = {
    "load cell": (
        lambda table: table.assign(**{FORCE: table[FORCE].clip(upper=60.0)}),
        "force_N stands at 60, its largest value,", "end of its range",
    ),
    "load cell of a coarse converter": (
        lambda table: table.assign(**{FORCE: (2.0 * table[FORCE]).round().clip(upper=90.0) / 2.0}),
        "force_N stands at 45, its largest value,", "end of its range",
    ),
    "potentiometer": (
        lambda table: table.assign(**{WAY: table[WAY].clip(upper=3.0)}),
        "displacement_mm stands at 3, its largest value,", "end of its range",
    ),
    "tachometer": (
        lambda table: table.assign(**{OUTPUT: table[OUTPUT].clip(lower=98.5)}),
        "output_speed_rpm stands at 98.5, its smallest value,", "end of its range",
    ),
    "hanging sensor": (put(FORCE, 33.21, 150, 190), "force_N stands at 33.21 from", "hangs"),
    "times in whole milliseconds": (
        with_times(lambda time: np.round(time, 3), 1.25e-3),
        "t_s is rounded to 1 ms, but the samples lie 1.25 ms apart", "too few digits",
    ),
    "times in tens of milliseconds": (
        with_times(lambda time: np.round(10.0 * time, 2), 1.7e-3),
        "t_s is rounded to 10 ms, but the samples lie 17", "too few digits",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", NAMED)
def test_values_that_stand_still_and_rounded_times_are_named(tmp_path: Path, kind: str) -> None:
    spoil, words, cause = NAMED[kind]
    faults = read(tmp_path, spoil).faults
    assert any(words in fault.text and cause in fault.cause for fault in faults), faults


REFUSED: dict[str, tuple[Spoil, str]] = {
    "wraps": (
        with_times(lambda time: np.where(time < 0.03, 65.506 + time, time - 0.03)),
        "a counter does that wraps after 65.5358 s; add 65.536 s",
    ),
    "wraps at a power of two": (
        with_times(lambda time: (time + 4.28) % 4.294967296),
        "as a counter does that wraps after 4.2948 s; add 4.29497 s",
    ),
    "starts again": (
        with_times(lambda time: time % 0.03),
        "two records stand one below the other; write a file",
    ),
    "copied below itself": (
        lambda table: pd.concat([table, table]),
        "repeat those from the first on; delete the copy",
    ),
    "backwards": (lambda table: table[::-1], "the trace runs backwards; sort the rows by time"),
    "out of order": (
        lambda table: table.loc[[*range(10), 12, 10, 11, *range(13, 300)]],
        "sort the rows by time",
    ),
    "stands still": (with_times(lambda time: 0.0 * time), "the clock stands still"),
    "rounded to 1 ms": (
        with_times(lambda time: np.floor(1e3 * time + 1e-9) / 1e3),
        "rounded to 1 ms, as 300 samples have 60 times and lie 0.2 ms apart",
    ),
    "rounded to 10 ms": (
        with_times(lambda time: np.round(time, 2)),
        "rounded to 10 ms, as 300 samples have 7 times",
    ),
    "mostly dropped out": (
        put(WAY, 0.0, 150, 280),
        "130 of 300 samples of displacement_mm lie at 0",
    ),
    "no samples": (lambda table: table.assign(**{FORCE: np.nan}), "has 0 samples of force_N"),
    "too slow": (lambda table: table[::50], "they lie 10 ms apart: sample faster"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_recording_without_a_clock_or_samples_is_refused_with_its_cause(
    tmp_path: Path, kind: str
) -> None:
    spoil, words = REFUSED[kind]
    with pytest.raises(DataError) as refused:
        read(tmp_path, spoil)
    assert words in str(refused.value)


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0, 3.0])
@pytest.mark.parametrize("step", [2e-4, 1e-3])
def test_good_recordings_raise_no_alarm(step: float, noise: float) -> None:
    """Neither noise nor its absence, nor coarse converters, nor counters of pulses at rest."""
    for seed in range(20):
        table = recording(seed, step, noise)
        assert rounded_clock(table[TIME].to_numpy()) is None
        for name in COLUMNS[1:]:
            fine = table[name].to_numpy()
            for resolution in (1e-9, 0.2 * NOISE[name], NOISE[name], 5.0 * NOISE[name]):
                values = resolution * np.round(fine / resolution)
                assert not dropouts(values).any()
                assert frozen_runs(values) == []
                assert held_step(values) == 1
        still = np.where(table[TIME] < 0.02, 0.0, table[OUTPUT])
        assert not dropouts(still).any()
        assert frozen_runs(still) == []


def test_runs_of_equal_readings_are_as_frequent_as_the_noise_lets_them() -> None:
    """The probability of equal neighbours is that of its closed form, at 0.5 steps at most that."""
    random = np.random.default_rng(2)
    for sigma in (0.5, 1.0, 3.0, 10.0):
        readings = np.round(sigma * random.normal(size=200_000))
        share = float((np.diff(readings) == 0.0).mean())
        bound = 1.0 / (2.0 * np.sqrt(np.pi) * sigma)
        assert share < 1.02 * bound
        assert sigma < 1.0 or share == pytest.approx(bound, rel=0.05)
        assert frozen_runs(readings[:5000]) == []


def spoilt_set(folder: Path, change: Spoil) -> Path:
    """Change all traces of a good set."""
    target = good_set(folder)
    for path in sorted((target / "traces").glob("*.csv")):
        change(pd.read_csv(path)).to_csv(path, index=False, float_format="%.9g")
    return target


SIGNS: dict[str, tuple[Spoil, list[str], str]] = {
    "force": (
        lambda table: table.assign(**{FORCE: -table[FORCE]}),
        ["trace_force=turned"], "force_N falls in",
    ),
    "displacement": (
        lambda table: table.assign(**{WAY: 10.0 - table[WAY]}),
        ["displacement=turned"], "displacement_mm falls in",
    ),
    "both": (
        lambda table: table.assign(**{FORCE: -table[FORCE], WAY: -table[WAY]}),
        ["trace_force=turned", "displacement=turned"], "Also: displacement_mm falls in",
    ),
    "metres and sign": (
        lambda table: table.assign(**{WAY: -1e-3 * table[WAY]}),
        ["displacement=m", "displacement=turned"], "displacement_mm falls in",
    ),
    "sliding speed in rad/s, the ring at rest": (
        lambda table: table.assign(**{SLIDING: table[SLIDING] * RPM}),
        ["speeds=sliding_rad_s"], "engaged rings turn at one speed",
    ),
    "output speed in rad/s": (
        lambda table: table.assign(**{OUTPUT: table[OUTPUT] * RPM}),
        ["speeds=output_rad_s"], "output_speed_rpm in radians a second beside",
    ),
    "exchanged speeds": (
        lambda table: table.rename(columns={SLIDING: OUTPUT, OUTPUT: SLIDING}),
        ["speeds=exchanged"], "with -1 times the mismatch_rpm",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SIGNS)
def test_signs_and_exchanged_speeds_are_named_and_turned_as_asked(
    tmp_path: Path, kind: str
) -> None:
    spoil, ways, words = SIGNS[kind]
    good = load_bench(good_set(tmp_path / "good"))
    folder = spoilt_set(tmp_path, spoil)
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    assert words in str(refused.value)
    for way in ways:
        assert f'correct=["{way}"]' in str(refused.value)
    bench = load_bench(folder, ways)
    assert bench.warnings == ()
    for reading, known in zip(bench.readings, good.readings, strict=True):
        if reading.trace is None or known.trace is None:
            continue
        for name in ("displacement", "force", "sliding_speed", "output_speed"):
            ours, theirs = getattr(reading.trace, name), getattr(known.trace, name)
            assert np.allclose(ours, theirs, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize(("column", "way"), [(SLIDING, "sliding"), (OUTPUT, "output")])
def test_turning_rings_with_speeds_in_two_units_are_named_without_their_lock(
    tmp_path: Path, column: str, way: str
) -> None:
    def spoil(table: pd.DataFrame) -> pd.DataFrame:
        table[[SLIDING, OUTPUT]] += 150.0
        table[column] *= RPM
        return table[: int(np.argmax(table[WAY] > 4.66))]

    with pytest.raises(DataError) as refused:
        load_bench(spoilt_set(tmp_path, spoil))
    assert f'correct=["speeds={way}_rad_s"]' in str(refused.value)
    assert "speeds=rad_s" not in str(refused.value)


def test_a_resting_ring_leaves_open_which_speeds_are_in_radians(tmp_path: Path) -> None:
    def spoil(table: pd.DataFrame) -> pd.DataFrame:
        table[[SLIDING, OUTPUT]] *= RPM
        return table[: int(np.argmax(table[SLIDING] > 0.2))]

    with pytest.raises(DataError) as refused:
        load_bench(spoilt_set(tmp_path, spoil))
    assert 'correct=["speeds=rad_s"]' in str(refused.value)


def jumped(table: pd.DataFrame) -> pd.DataFrame:
    """Let a counter of the displacement lose 1.5 mm for a while."""
    place = int(np.argmax(table[WAY] > 0.5 * table[WAY].max()))
    return put(WAY, table[WAY].to_numpy()[place : place + 10] - 1.5, place, place + 10)(table)


def test_jumps_and_slow_recorders_are_warnings(tmp_path: Path) -> None:
    folder = spoilt_set(tmp_path / "jumps", jumped)
    texts = [warning.sentence for warning in load_bench(folder).warnings]
    assert any("displacement_mm jumps from" in text for text in texts), texts
    folder = spoilt_set(tmp_path / "slow", lambda table: table[::5])
    texts = [warning.sentence for warning in load_bench(folder).warnings]
    assert any("displacement_mm is sampled every 5 ms" in text for text in texts), texts


UNITS = [("force_N", "kN"), ("sliding_speed_rpm", "rad/s"), ("output_speed_rpm", "1/s"),
         ("displacement_mm", "m"), ("force_N", "Volts"), ("force_N", "mm")]  # fmt: skip


@pytest.mark.parametrize(("channel", "unit"), UNITS)
@pytest.mark.parametrize("library", ["nptdms", "asammdf"])
def test_a_unit_beside_a_channel_is_the_one_of_its_name(
    tmp_path: Path, library: str, channel: str, unit: str
) -> None:
    require_program(find_spec(library) is not None, library)
    path = tmp_path / ("x.tdms" if library == "nptdms" else "x.mf4")
    own = dict(zip(COLUMNS, ("s", "mm", "N", "rpm", "1/min"), strict=True))
    write_units(path, library, own)
    assert read_trace(path).faults == ()
    write_units(path, library, {**own, channel: unit})
    with pytest.raises(DataError, match=f"channel {channel} is in '{unit}'"):
        read_trace(path)


def write_units(path: Path, library: str, units: dict[str, str]) -> None:
    """Write a recording with units beside its channels."""
    table, module = recording(), importlib.import_module(library)
    if library == "nptdms":
        channels = [
            module.ChannelObject(
                "shift", name, table[name].to_numpy(), {"unit_string": units[name]}
            )
            for name in COLUMNS
        ]
        with module.TdmsWriter(str(path)) as writer:
            writer.write_segment(channels)
        return
    with module.MDF(version="4.10") as file:
        for name in COLUMNS[1:]:
            values, time = table[name].to_numpy(), table[TIME].to_numpy()
            file.append([module.Signal(values, time, name=name, unit=units[name])])
        file.save(path, overwrite=True)


def test_a_tdms_file_that_is_cut_short_is_read_as_far_as_it_goes_or_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    require_program(find_spec("nptdms") is not None, "nptdms")
    nptdms, path, table = importlib.import_module("nptdms"), tmp_path / "x.tdms", recording()
    with nptdms.TdmsWriter(str(path)) as writer:
        for part in (table[:100], table[100:200], table[200:]):
            writer.write_segment(
                [nptdms.ChannelObject("shift", name, part[name].to_numpy()) for name in COLUMNS]
            )
    whole = path.read_bytes()
    assert read_trace(path).faults == ()
    for share, words in ((0.9, "cut short, its last samples are lost"), (0.75, "are lost")):
        path.write_bytes(whole[: round(share * len(whole))])
        trace = read_trace(path)
        assert any(words in fault.text for fault in trace.faults)
        assert trace.displacement == pytest.approx(MM * table[WAY][: trace.time.size])
    for size in (round(0.2 * len(whole)), 60, 5):
        path.write_bytes(whole[:size])
        with pytest.raises(DataError, match="cut short"):
            read_trace(path)
    assert capfd.readouterr() == ("", "")


def test_tdms_times_may_be_dates(tmp_path: Path) -> None:
    require_program(find_spec("nptdms") is not None, "nptdms")
    nptdms, path, table = importlib.import_module("nptdms"), tmp_path / "x.tdms", recording()
    micro = np.round(1e6 * table[TIME].to_numpy()).astype("timedelta64[us]")
    dates = np.datetime64("2024-05-31T14:05:09", "us") + micro
    channels = [nptdms.ChannelObject("shift", name, table[name].to_numpy()) for name in COLUMNS[1:]]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([*channels, nptdms.ChannelObject("shift", TIME, dates)])
    trace = read_trace(path)
    assert trace.time == pytest.approx(table[TIME], abs=2e-6)
    assert [fault.text for fault in trace.faults] == [
        "t_s holds dates, and its seconds count from the first, 2024-05-31T14:05:09.000000"
    ]


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.99])
def test_an_mdf_file_that_is_cut_short_never_passes_in_silence(
    tmp_path: Path, share: float
) -> None:
    require_program(find_spec("asammdf") is not None, "asammdf")
    path = tmp_path / "x.mf4"
    write_units(path, "asammdf", dict.fromkeys(COLUMNS, ""))
    whole = path.read_bytes()
    path.write_bytes(whole[: round(share * len(whole))])
    try:
        trace = read_trace(path)
    except DataError:
        return
    assert trace.faults or trace.time.size == 300
