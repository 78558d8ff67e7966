"""Slips of units, axes, clocks and zeros: each is found, named and taken back as asked."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.force_start import find_force_start
from dogshape.bench.traces import BenchTrace
from dogshape.diagnosis.terms import Array
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.shift.actuation import cubic_step
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import good_set, scale, scale_traces, state, swap

ARM = 3.1914 * 0.80

Spoil = Callable[[Path], object]


def table(**factors: float) -> Spoil:
    return lambda folder: scale(folder / "shifts.csv", **factors)


def traces(**factors: float) -> Spoil:
    return lambda folder: scale_traces(folder, **factors)


def swapped(folder: Path) -> None:
    swap(folder / "shifts.csv")


def both(*spoils: Spoil) -> Spoil:
    return lambda folder: [spoil(folder) for spoil in spoils]


SPEED = {"sliding_speed_rpm": RPM, "output_speed_rpm": RPM}

#: What is spoilt, the corrections that are asked for, and words of the sentence.
CERTAIN: list[tuple[Spoil, list[str], str]] = [
    (table(shift_time_s=1e3), ["time=ms"], "shift_time_s runs from"),
    (table(force_rise_s=1e3), ["rise=ms"], "this looks like milliseconds"),
    (table(force_N=1e-3), ["force=kN"], "this looks like kilonewtons"),
    (table(force_N=1 / ARM), ["force=arm"], "robot arm instead of that at the sleeve"),
    (swapped, ["axes=swapped"], "mismatch_rpm and force_N swapped"),
    (table(mismatch_rpm=RPM), ["mismatch=rad_s"], "mismatch_rpm in radians a second"),
    (table(mismatch_rpm=-1.0), ["mismatch=reversed"], "sliding less output speed"),
    (traces(displacement_mm=1e-3), ["displacement=m"], "this looks like metres"),
    (traces(displacement_mm=3.1914), ["displacement=arm"], "3.1914 times the sleeve's"),
    (traces(t_s=1e3), ["trace_time=ms"], "by t_s the travel of the traces takes"),
    (traces(force_N=1e-3), ["trace_force=kN"], "force_N of the traces ends at"),
    (traces(**SPEED), ["speeds=rad_s"], "speeds of the traces in radians a second"),
    (both(table(shift_time_s=1e3), traces(t_s=1e3)), ["time=ms", "trace_time=ms"], "Also: "),
    (both(swapped, table(shift_time_s=1e3)), ["axes=swapped", "time=ms"], "Also: "),
]  # fmt: skip


def same(one: Bench, other: Bench) -> bool:
    """Whether two sets hold the same numbers."""
    mine, theirs = (
        [(r.point.mismatch, r.point.profile.force, r.point.profile.rise, r.n, r.time, r.engaged)
         for r in bench.readings] for bench in (one, other)
    )  # fmt: skip
    return np.allclose(np.array(mine, float), np.array(theirs, float), rtol=1e-6, equal_nan=True)


@pytest.mark.parametrize(
    ("spoil", "asked", "words"), CERTAIN, ids=[", ".join(asked) for _, asked, _ in CERTAIN]
)
def test_a_slip_is_refused_and_taken_back_as_asked(
    tmp_path: Path, spoil: Spoil, asked: list[str], words: str
) -> None:
    folder = good_set(tmp_path)
    good = load_bench(folder)
    spoil(folder)
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
    for correction in asked:
        assert f'correct=["{correction}"] applies this correction' in str(refused.value)
    again = load_bench(folder, asked)
    assert same(again, good)
    assert {str(correction) for correction in again.corrections} == set(asked)
    assert again.warnings == ()
    for mine, theirs in zip(again.readings, good.readings, strict=True):
        if mine.trace is not None and theirs.trace is not None:
            for name in ("time", "displacement", "force", "output_speed"):
                ours, known = getattr(mine.trace, name), getattr(theirs.trace, name)
                assert np.allclose(ours, known, rtol=1e-6, atol=1e-12)


def test_good_sets_raise_no_alarm_and_published_ones_with_swapped_axes_do(tmp_path: Path) -> None:
    shutil.copytree(bundled_root() / "bench" / "mq200_stand", tmp_path / "stand")
    swap(tmp_path / "stand" / "shifts.csv")
    with pytest.raises(DataError, match=r'correct=\["axes=swapped"\] applies this correction'):
        load_bench(tmp_path / "stand")
    assert same(load_bench(tmp_path / "stand", ["axes=swapped"]), load_bench("mq200_stand"))
    for bench in (load_bench("mq200_stand"), load_bench("mq200_adams")):
        assert bench.warnings == ()
    for place, sensor in enumerate((True, False)):
        assert load_bench(good_set(tmp_path / str(place), sensor=sensor)).warnings == ()


def test_a_wrong_correction_is_not_believed(tmp_path: Path) -> None:
    """Corrections are made first; what is then impossible is refused as it would be anyway."""
    folder = good_set(tmp_path)
    with pytest.raises(DataError, match=r"shift_time_s is .*not far below .* free flight"):
        load_bench(folder, ["time=ms"])
    with pytest.raises(DataError, match="speeds=rad_s"):
        load_bench(folder, ["mismatch=rad_s"])
    file = folder / "bench.toml"
    file.write_text('corrections = ["time=ms"]\n' + file.read_text())
    for text, words in [
        ("tiem=ms", r"did you mean 'time'\?"),
        ("time=s", "valid are time=ms, time=given"),
        ("time", "valid are time=ms, time=given"),
        ("time=given", "time=ms and time=given contradict each other"),
    ]:
        with pytest.raises(InputError, match=words):
            load_bench(folder, [text])


def test_measured_set_values_are_joined_to_operating_points(tmp_path: Path) -> None:
    folder = good_set(tmp_path, sensor=False)
    file, cells = folder / "shifts.csv", load_bench(folder).cells
    table = pd.read_csv(file)
    # The second half of the rows again, each of its force measured, a little off.
    more = table.iloc[len(table) // 2 :].assign(trace="")
    more["force_N"] *= 1.0 + 0.002 * np.linspace(-1.0, 1.0, len(more)).round(2)
    more["shift_time_s"] *= 1.01
    pd.concat([table, more]).to_csv(file, index=False)
    words = r'nearly the set values of others: row .*correct=\["points=joined"\] applies this'
    with pytest.raises(DataError, match=words):
        load_bench(folder)
    joined = load_bench(folder, ["points=joined"])
    assert joined.warnings == ()
    assert sum(cell.n for cell in joined.cells) == sum(cell.n for cell in cells) + len(more)
    for one, before in zip(joined.cells, cells, strict=True):
        assert one.point.mismatch == pytest.approx(before.point.mismatch)
        assert one.point.profile.force == pytest.approx(before.point.profile.force, rel=2e-3)
    assert len(load_bench(folder, ["points=given"]).cells) > len(cells)


def test_times_before_the_free_flight(tmp_path: Path) -> None:
    """Half of the free flight is impossible, nine tenths of it odd."""
    folder = good_set(tmp_path, traces=False, sensor=False)
    bench = load_bench(folder)
    profile = bench.cells[-1].point.profile
    free = profile.free_flight_time(bench.clutch.shift_travel, bench.clutch.rings.mass)
    shortest = min(float(cell.times.min()) for cell in bench.cells)
    scale(folder / "shifts.csv", shift_time_s=0.6 * free / shortest)
    (odd,) = load_bench(folder).warnings
    assert "shorter than the free flight" in odd.sentence
    scale(folder / "shifts.csv", shift_time_s=0.5)
    with pytest.raises(DataError, match="free flight alone takes"):
        load_bench(folder)
    times = [r.time for r in load_bench(folder, ["time=given"]).readings]
    assert min(t for t in times if t is not None) == pytest.approx(0.3 * free, rel=1e-6)


def test_the_arm_needs_a_linkage(tmp_path: Path) -> None:
    folder = good_set(tmp_path, sensor=False)
    for correction in ("force=arm", "displacement=arm"):
        with pytest.raises(InputError, match="give linkage_ratio"):
            load_bench(folder, [correction])
    scale_traces(folder, displacement_mm=3.2)
    with pytest.raises(DataError, match="give linkage_ratio in the table"):
        load_bench(folder)


Frame = Callable[[pd.DataFrame, int], pd.DataFrame]

RISE, FORCE, NOISE = 0.15, 600.0, 1.5


def ramp(tau: Array) -> Array:
    return np.clip(tau / RISE, 0.0, 1.0)


SHAPES: dict[str, Callable[[Array], Array]] = {
    "cubic step": lambda tau: cubic_step(tau / RISE, 1.0),
    "ramp": ramp,
    "jump": lambda tau: (tau > 0.0).astype(float),
    "first order": lambda tau: 1.0 - np.exp(-np.maximum(tau, 0.0) / 0.01),
    "released": lambda tau: cubic_step(tau / RISE, 1.0) * (tau < 0.25),
    "peak of the contact": lambda tau: (
        cubic_step(tau / RISE, 1.0) + 1.5 * np.exp(-(((tau - 0.045) / 0.002) ** 2))
    ),
}


def record(shape: str, time: Array, start: float, rest: float, seed: int) -> BenchTrace:
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


def pairs(bench: Bench, tmp_path: Path) -> list[tuple[BenchTrace, BenchTrace]]:
    """Pair the traces of a corrected bench, of which nothing is odd, with those of the good set."""
    assert bench.warnings == ()
    good = load_bench(good_set(tmp_path / "good", sensor=False))
    both = zip(bench.readings, good.readings, strict=True)
    return [(a.trace, b.trace) for a, b in both if a.trace is not None and b.trace is not None]


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
    folder = spoilt(tmp_path, change)
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    said = str(refused.value)
    first = float(said.split("does not begin at t_s = 0 but at ")[1].split(maxsplit=1)[0])
    assert first == pytest.approx(start, abs=5e-3)
    assert "this looks like the recorder's clock" in said
    assert "wrong scale" not in said
    for correction in asked:
        assert f'correct=["{correction}"] applies this correction' in said
    for mine, theirs in pairs(load_bench(folder, asked), tmp_path):
        assert abs(mine.time[-1] - theirs.time[-1]) < 4.0 * mine.start_error + 1e-3
        assert 1e-4 < mine.start_error < 5e-3


def test_a_pre_trigger_or_a_dead_time_in_table_and_traces_is_no_clock(tmp_path: Path) -> None:
    early = spoilt(tmp_path / "early", lambda f, k: later(-0.05)(recorded_before(0.05)(f, k), k))
    assert load_bench(early).warnings == ()
    late = 0.012
    folder = spoilt(tmp_path, recorded_before(late))
    table = pd.read_csv(folder / "shifts.csv")
    table.assign(shift_time_s=table.shift_time_s + late).to_csv(folder / "shifts.csv", index=False)
    (warning,) = load_bench(folder).warnings
    assert "this looks like a dead time or slow rise of the force" in warning.sentence
    assert "from_force" not in warning.sentence
    state(folder, '[record]\ntime_zero = "force"')
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
    state(folder, '[record]\ntime_zero = "command"')
    (warning,) = [w for w in load_bench(folder, ["time=given"]).warnings if "travel" in w.found]
    assert ("a dead time between command and force" in warning.sentence) == (late > 0.0)


@pytest.mark.parametrize(
    ("column", "offset", "correction"),
    [("displacement_mm", 0.3, "displacement=zeroed"), ("force_N", -60.0, "trace_force=zeroed")],
)
def test_an_offset_at_rest_is_said_and_taken_away_as_asked(
    tmp_path: Path, column: str, offset: float, correction: str
) -> None:
    folder = spoilt(tmp_path, lambda frame, _: frame.assign(**{column: frame[column] + offset}))
    (warning,) = load_bench(folder).warnings
    middle = float(warning.found.split(" is ")[1].split()[0])
    assert middle == pytest.approx(offset, abs=1.0 if column == "force_N" else 0.02)
    assert warning.correction == correction
    for mine, theirs in pairs(load_bench(folder, [correction]), tmp_path):
        assert mine.force == pytest.approx(theirs.force, abs=2.0)
        assert mine.displacement == pytest.approx(theirs.displacement, abs=3e-5)


def test_without_a_force_its_start_is_not_invented(tmp_path: Path) -> None:
    folder = spoilt(tmp_path, lambda f, _: f.assign(t_s=f.t_s + 2.0, force_N=0.0 * f.force_N))
    (warning,) = load_bench(folder).warnings
    assert "no rise of force_N stands out from its noise" in warning.sentence
    assert "ends 2.00" in warning.sentence
    with pytest.raises(DataError, match=r"0041.csv: no rise of force_N stands out"):
        load_bench(folder, ["trace_time=from_force"])
