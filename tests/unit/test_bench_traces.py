"""Traces of bench shifts, CSV, TDMS and MDF: what is read, and errors with file, row and column."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.trace_files import COLUMNS, read_trace
from dogshape.diagnosis.bench.traces import BenchTrace
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.units import MM, RPM
from tests.benches import good_set
from tests.conftest import needed


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return good_set(tmp_path)


def lines(change: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    def spoil(path: Path) -> None:
        path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")

    return spoil


def cell(row: int, place: int, text: str) -> Callable[[Path], None]:
    """Write a text into a cell; row as an editor counts."""

    def change(given: list[str]) -> list[str]:
        cells = given[row - 1].split(",")
        cells[place] = text
        return [*given[: row - 1], ",".join(cells), *given[row:]]

    return lines(change)


BROKEN: list[tuple[Callable[[Path], object], str]] = [
    (Path.unlink, "there is no trace"),
    (lambda p: p.write_text(""), "is not a table of comma separated values"),
    (cell(1, 1, "displacement_m"), "row 1: the column 'displacement_mm' is missing; add it"),
    (cell(7, 1, "abc"), "row 7, column displacement_mm is 'abc', but it must be a number"),
    (cell(7, 0, ""), "row 7, column t_s is '', but it must be a number"),
    (cell(7, 2, "nan"), "row 7, column force_N is 'nan', but it must be a finite number"),
    (cell(7, 0, "0.001"), "row 7, column t_s is '0.001' after '0.004', but time must grow"),
    (
        lines(lambda given: given[:9]),
        "has 8 samples of displacement_mm, but a trace needs at least 10",
    ),
]


def test_of_a_trace_that_ends_early_the_beginning_counts(folder: Path) -> None:
    path = folder / "traces" / "0041.csv"
    before = load_bench(folder).readings[0]
    lines(lambda given: given[:21])(path)
    bench = load_bench(folder)
    (warning,) = [one for one in bench.warnings if one.quantity == "traces"]
    assert "a trace ends before the shift is over: that of row 2 by" in warning.sentence
    assert "1 of 1 end before the first touch and tell its beginning only" in warning.sentence
    after = bench.readings[0].trace
    assert after is not None
    assert before.trace is not None
    assert np.array_equal(after.time, before.trace.time[:20])
    assert bench.readings[0].time == before.time


@pytest.mark.parametrize(("spoil", "words"), BROKEN, ids=[words for _, words in BROKEN])
def test_broken_traces(folder: Path, spoil: Callable[[Path], object], words: str) -> None:
    spoil(folder / "traces" / "0041.csv")
    with pytest.raises(DataError) as refused:
        load_bench(folder)
    assert words in str(refused.value)
    assert "0041.csv" in str(refused.value)
    assert "shifts.csv, row 2" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_unknown_is_kept_apart(folder: Path) -> None:
    head = ",".join(("mismatch_rpm", "force_N", "force_rise_s", "n_shifts"))
    rows = [
        "50,469.0,0.1766,1,0.05,true,",
        "50,469.0,0.1766,3,0.07,,",
        "50,469.0,0.1766,2,,false,",
        "50,469.0,0.1766,4,,,",
        "50,469.0,0.1766,5,,true,",
    ]
    text = "\n".join([head + ",shift_time_s,engaged,trace", *rows])
    (folder / "shifts.csv").write_text(text)
    (cell,) = load_bench(folder).cells
    assert (cell.n, cell.engaged, cell.failed, cell.unknown, cell.tried) == (4, 9, 2, 4, 11)
    assert cell.time == pytest.approx((0.05 + 3 * 0.07) / 4)
    assert cell.times.tolist() == [0.05]


def tdms(
    path: Path, trace: BenchTrace, *, waveform: bool, group: str = "shift", **extra: Any
) -> None:
    """Write a trace as LabVIEW would, in the units of its channels."""
    nptdms = importlib.import_module("nptdms")
    units = (1.0, MM, 1.0, RPM, RPM)
    series = (
        trace.time, trace.displacement, trace.force, trace.sliding_speed, trace.output_speed
    )  # fmt: skip
    given = dict(zip(COLUMNS, (s / u for s, u in zip(series, units, strict=True)), strict=True))
    time = given.pop("t_s")
    properties = {"wf_start_offset": float(time[0]), "wf_increment": trace.step} if waveform else {}
    if not waveform and "t_s" not in extra:
        given["t_s"] = time
    given |= extra
    with nptdms.TdmsWriter(str(path)) as writer:
        channels = [
            nptdms.ChannelObject(group, name, np.asarray(values), properties=properties)
            for name, values in given.items()
            if values is not None
        ]
        writer.write_segment(channels)


def test_broken_tdms(folder: Path) -> None:
    needed(find_spec("nptdms") is not None, "npTDMS")
    path = folder / "x.tdms"
    known = read_trace(folder / "traces" / "0041.csv")
    bad = known.displacement / MM
    bad[4] = np.nan
    cases: list[tuple[dict[str, Any], str]] = [
        ({"waveform": True, "force_N": None}, "the channel 'force_N' is missing"),
        (
            {"waveform": True, "displacement_mm": None, "weg_mm": bad},
            "'displacement_mm' is missing",
        ),
        ({"waveform": False, "t_s": None}, "nor the waveform properties wf_increment"),
        ({"waveform": True, "force_N": [1.0, 2.0]}, "the channels have 2 samples of"),
        ({"waveform": False, "force_N": [1.0, 2.0]}, "channel force_N has 2 samples and"),
        ({"waveform": True, "force_N": ["a", "b"]}, "does not hold numbers"),
        ({"waveform": True, "displacement_mm": bad}, "row 4, column displacement_mm is 'nan'"),
    ]
    for options, words in cases:
        tdms(path, known, **options)
        with pytest.raises(DataError) as refused:
            read_trace(path)
        assert words in str(refused.value)
        assert str(path) in str(refused.value)
    path.write_bytes(b"no TDMS at all, whatever its name says")
    with pytest.raises(DataError, match="is not a TDMS file"):
        read_trace(path)


def mdf(path: Path, trace: BenchTrace, units: dict[str, str] | None = None, **extra: Any) -> None:
    """Write a trace as a measurement system would, in the units of its channels."""
    asammdf = importlib.import_module("asammdf")
    factors = (MM, 1.0, RPM, RPM)
    series = (trace.displacement, trace.force, trace.sliding_speed, trace.output_speed)
    given = dict(
        zip(COLUMNS[1:], (s / u for s, u in zip(series, factors, strict=True)), strict=True)
    )
    given |= extra
    named = {"displacement_mm": "mm", "force_N": "N"} | (units or {})
    with asammdf.MDF(version="4.10") as file:
        for name, samples in given.items():
            if samples is not None:
                time = trace.time[: len(samples)]
                unit = named.get(name, "1/min")
                file.append([asammdf.Signal(np.asarray(samples), time, name=name, unit=unit)])
        file.save(path, overwrite=True)


def test_broken_mdf(folder: Path) -> None:
    needed(find_spec("asammdf") is not None, "asammdf")
    path = folder / "x.mf4"
    known = read_trace(folder / "traces" / "0041.csv")
    cases: list[tuple[dict[str, Any], str]] = [
        ({"force_N": None}, "the channel 'force_N' is missing"),
        ({"force_N": known.force[:5]}, "the channels have 5 samples of displacement_mm in common"),
        ({"units": {"force_N": "kN"}}, "channel force_N is in 'kN'"),
    ]
    for options, words in cases:
        mdf(path, known, **options)
        with pytest.raises(DataError) as refused:
            read_trace(path)
        assert words in str(refused.value)
        assert str(path) in str(refused.value)
    path.write_bytes(b"no MDF at all, whatever its name says" * 10)
    with pytest.raises(DataError, match="is not an MDF file"):
        read_trace(path)


@pytest.mark.parametrize(("name", "extra"), [("x.mf4", "mdf"), ("x.tdms", "tdms")])
def test_without_the_extra_a_sentence_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, extra: str
) -> None:
    def missing(name: str) -> None:
        raise ImportError(f"No module named '{name}'")

    monkeypatch.setattr("dogshape.diagnosis.bench.trace_files.import_module", missing)
    (folder / name).write_bytes(b"")
    with pytest.raises(InputError, match=rf"cannot be loaded.*'\.\[{extra}\]'"):
        read_trace(folder / name)
