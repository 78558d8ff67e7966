"""Check, strength and bench comparison in the public package: what the command line prints."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

import dogshape as ds
from tests.conftest import Said

Dogshape = Callable[..., Said]

ANGLES = [0.0, 5.0, 10.0]
FEW = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s,engaged,trace\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of three operating points, of which one has no time."""
    made = tmp_path_factory.mktemp("few")
    brought = Path(__file__).parents[2] / "studies" / "bench" / "mq200_adams"
    (made / "bench.toml").write_text((brought / "bench.toml").read_text(encoding="utf-8"))
    rows = ("20,469,0.1766,10,0.12,true,", "50,469,0.1766,10,0.09,true,", "50,641.5,0.12614,1,,,")
    (made / "shifts.csv").write_text(FEW + "\n".join(rows) + "\n")
    return made


@pytest.fixture(scope="module")
def comparison(folder: Path) -> ds.Comparison:
    return ds.Bench(folder).validate(ANGLES, jobs=1)


def test_a_bench_shows_what_it_holds(folder: Path) -> None:
    bench = ds.Bench(folder)
    assert repr(bench).endswith("21 shifts at 3 operating points)")
    frame = bench.to_frame()
    assert ",".join(frame.columns) == FEW.strip()
    assert list(frame["shift_time_s"].dropna()) == [0.12, 0.09]
    assert list(frame.index) == [2, 3, 4]  # lines of the file
    with pytest.raises(FrozenInstanceError):
        bench.data = None  # type: ignore[assignment,misc]


def test_a_bench_is_read_with_its_corrections(folder: Path, tmp_path: Path) -> None:
    for name in ("bench.toml", "shifts.csv"):
        text = (folder / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace(",0.12,", ",120,").replace(",0.09,", ",90,"))
    with pytest.raises(ds.DogshapeError, match="time=ms"):
        ds.Bench(tmp_path)
    bench = ds.Bench(tmp_path, correct=["time=ms"])
    assert list(bench.to_frame()["shift_time_s"].dropna()) == pytest.approx([0.12, 0.09])
    assert "time=ms" in repr(bench)
    with pytest.raises(ds.InputError, match="was read already"):
        ds.diagnose(bench, correct=["time=ms"])


def test_a_comparison_is_what_the_command_line_prints(
    comparison: ds.Comparison, folder: Path, dogshape: Dogshape
) -> None:
    said = dogshape("validate", folder, "--angles", "0,5,10", "--jobs", 1, "--json")
    assert json.loads(said.out) == comparison.to_dict()
    with pytest.raises(FrozenInstanceError):
        comparison.compared = None  # type: ignore[assignment,misc]


def test_a_comparison_as_table_and_figure(comparison: ds.Comparison) -> None:
    frame = comparison.to_frame()
    assert {"mismatch_rpm", "force_N", "bench_s", "simulated_s", "standard_error_s"} < set(frame)
    drawn = {trace.name: trace for trace in comparison.plot().data if trace.name}
    assert set(drawn) == {"simulated", "bench"}
    for name, column in (("simulated", "simulated_s"), ("bench", "bench_s")):
        values = sorted(1e3 * frame[column].dropna())
        assert sorted(drawn[name].x) == pytest.approx(values)
    assert comparison.rmse_s == comparison.to_dict()["rmse_s"]
    assert f"gap {1e3 * (comparison.rmse_s or 0):.1f} ms" in repr(comparison)


@pytest.mark.parametrize("angles", [2, [0.0, 8.0], []], ids=str)
def test_a_comparison_needs_three_angles(folder: Path, angles: int | list[float]) -> None:
    with pytest.raises(ds.InputError, match="at least three"):
        ds.Bench(folder).validate(angles)


def test_angles_are_finite(folder: Path) -> None:
    with pytest.raises(ds.InputError, match="must be a finite angle"):
        ds.Bench(folder).validate([0.0, float("nan"), 5.0])
