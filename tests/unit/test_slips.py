"""Slips of units and axes: each kind is found, named and taken back; good data raise none."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import good_set, scale, scale_traces, swap

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

    def numbers(bench: Bench) -> list[list[float]]:
        return [[r.point.mismatch, r.point.profile.force, r.point.profile.rise, r.n,
                 np.nan if r.time is None else r.time] for r in bench.readings]  # fmt: skip

    engaged = [[r.engaged for r in bench.readings] for bench in (one, other)]
    close = np.allclose(numbers(one), numbers(other), rtol=1e-6, equal_nan=True)
    return close and engaged[0] == engaged[1]


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
        assert f"--correct {correction} takes it as that" in str(refused.value)
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
    with pytest.raises(DataError, match="--correct axes=swapped takes it as that"):
        load_bench(tmp_path / "stand")
    assert same(load_bench(tmp_path / "stand", ["axes=swapped"]), load_bench("mq200_stand"))
    for bench in (load_bench("mq200_stand"), load_bench("mq200_adams")):
        assert bench.warnings == ()
    for place, sensor in enumerate((True, False)):
        (tmp_path / str(place)).mkdir()
        assert load_bench(good_set(tmp_path / str(place), sensor=sensor)).warnings == ()


def test_the_data_set_itself_may_ask_for_corrections(tmp_path: Path) -> None:
    folder = good_set(tmp_path)
    scale(folder / "shifts.csv", shift_time_s=1e3)
    file = folder / "bench.toml"
    file.write_text('corrections = ["time=ms"]\n' + file.read_text())
    assert [str(c) for c in load_bench(folder).corrections] == ["time=ms"]
    assert [str(c) for c in load_bench(folder, ["time=ms"]).corrections] == ["time=ms"]
    with pytest.raises(InputError, match="time=ms and time=given contradict each other"):
        load_bench(folder, ["time=given"])


def test_a_wrong_correction_is_not_believed(tmp_path: Path) -> None:
    """Corrections are made first; what is then impossible is refused as it would be anyway."""
    folder = good_set(tmp_path)
    with pytest.raises(DataError, match=r"shift_time_s is .*not far below .* free flight"):
        load_bench(folder, ["time=ms"])
    with pytest.raises(DataError, match="speeds=rad_s"):
        load_bench(folder, ["mismatch=rad_s"])
    for text, words in [
        ("tiem=ms", "did you mean 'time'?"),
        ("time=s", "valid are time=ms, time=given"),
        ("time", "valid are time=ms, time=given"),
    ]:
        with pytest.raises(InputError) as refused:
            load_bench(folder, [text])
        assert words in str(refused.value)


def test_measured_set_values_are_joined_to_operating_points(tmp_path: Path) -> None:
    folder = good_set(tmp_path, sensor=False)
    file, cells = folder / "shifts.csv", load_bench(folder).cells
    table = pd.read_csv(file)
    # The second half of the rows again, each of its force measured, a little off.
    more = table.iloc[len(table) // 2 :].assign(trace="")
    more["force_N"] *= 1.0 + 0.002 * np.linspace(-1.0, 1.0, len(more)).round(2)
    more["shift_time_s"] *= 1.01
    pd.concat([table, more]).to_csv(file, index=False)
    words = "nearly the set values of others: row .*--correct points=joined takes it as that"
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
