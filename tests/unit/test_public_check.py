"""Check, strength and bench comparison in the public package: what the command line prints."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import chdir
from dataclasses import FrozenInstanceError
from pathlib import Path

import pandas as pd
import pytest

import dogshape as ds
from tests.conftest import Said

Dogshape = Callable[..., Said]

BROUGHT = Path(__file__).parents[2] / "studies" / "mq200_paper" / "surrogate.json"
ANGLES = [0.0, 5.0, 10.0]
SMALL = {
    "operating.mismatch_rpm": [50], "operating.force_N": [469.0], "expectation.angles": 3,
}  # fmt: skip
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
    assert repr(bench).endswith("20 shifts at 3 operating points)")
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
    assert set(drawn) == {"simulation", "bench"}
    for name, column in (("simulation", "simulated_s"), ("bench", "bench_s")):
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


@pytest.fixture(scope="module")
def check(tmp_path_factory: pytest.TempPathFactory) -> ds.Check:
    # Beside the results of a study its own surrogate would count, not the package's.
    with chdir(tmp_path_factory.mktemp("empty")):
        return ds.Study("mq200_paper", chamfer_deg=14, height_mm=6).check(
            mismatch_rpm=50, force_N=469
        )


def test_a_check_is_what_the_command_line_prints(check: ds.Check, dogshape: Dogshape) -> None:
    said = dogshape(
        *("check", "mq200_paper", "--mismatch-rpm", "50", "--force-N", "469"),
        *("--set", "dog.chamfer_deg=14", "--set", "dog.height_mm=6", "--json"),
    )
    assert json.loads(said.out) == check.to_dict()
    assert said.status == int(not check.feasible)


def test_a_check_carries_its_problem_and_does_not_change(check: ds.Check) -> None:
    assert check.config.clutch.dog.height == pytest.approx(6e-3)
    assert check.time_s is not None
    assert f"shift time by the compiled engine {1e3 * check.time_s:.1f} ms" in repr(check)
    assert all(name in check._repr_html_() for name in check.failed)
    with pytest.raises(FrozenInstanceError):
        check.quick = None  # type: ignore[assignment,misc]


def drawn_margins(
    found: ds.Check | ds.Strength,
) -> tuple[dict[str, float], dict[str, float], set[str]]:
    """Margins and worst cases that a figure draws, %, and the names of what it draws as failed."""
    passed, failed, worst = (dict(zip(t.y, t.x, strict=True)) for t in found.plot().data)
    return passed | failed, worst, set(failed)


def test_margins_as_table_and_figure(check: ds.Check) -> None:
    frame = check.to_frame().set_index("name")
    margins, worst, failed = drawn_margins(check)
    assert margins == pytest.approx(dict(100 * frame["margin"]))
    assert worst == pytest.approx(dict(100 * frame["margin_worst_case"].dropna()))
    assert failed == set(check.failed) == set(frame.index[~frame["passed"]])
    assert failed
    assert {"value", "unit", "limit", "margin_root_sum_square"} < set(frame)


def test_many_designs_are_what_the_command_line_prints(tmp_path: Path, dogshape: Dogshape) -> None:
    table, out = tmp_path / "d.csv", tmp_path / "o.csv"
    table.write_text("chamfer_deg,count,note\n9,14,a\n11,18,b\n8,200,c\n")
    said = dogshape("check", "mq200_paper", "--designs", table, "--out", out, "--json")
    found = ds.Study("mq200_paper").predict(table)
    assert found.to_dict() == json.loads(said.out) | {"file": None}
    frame = found.to_frame()
    written = pd.read_csv(out)
    assert list(frame.index) == [2, 3, 4]
    assert set(written) < set(frame)
    for name in ("chamfer_deg", "expected_shift_time_s", "low_s", "distance"):
        assert list(frame[name]) == pytest.approx(list(written[name]), rel=1e-5, nan_ok=True)
    assert list(frame["in_range"][:2]) == [bool(one) for one in written["in_range"][:2]]
    assert list(frame["reason"])[2] == written["reason"][2] != ""
    assert "designs 3" in repr(found)


def test_many_designs_from_a_frame(tmp_path: Path) -> None:
    asked = pd.DataFrame({"chamfer_deg": [9.25, 11.0], "count": [14, 18]})
    study = ds.Study("mq200_paper")
    found = study.predict(asked, out=tmp_path / "o.csv", mismatch_rpm=50, force_N=469)
    assert list(found.to_frame()["chamfer_deg"]) == [9.25, 11.0]
    assert found.to_dict()["file"] == str(tmp_path / "o.csv")
    own = ds.Study("mq200_paper", chamfer_deg=11, count=18)
    one = own.check(mismatch_rpm=50, force_N=469, surrogate=BROUGHT)
    assert found.to_frame()["expected_shift_time_s"][2] == pytest.approx(
        one.time_s,
        rel=1e-3,  # what surrogate.expected_time promises of many designs at once
    )
    with pytest.raises(ds.InputError, match=r"row 2, column count is '18[.]5'"):
        study.predict(pd.DataFrame({"count": [14, 18.5]}))


@pytest.fixture(scope="module")
def strength() -> ds.Strength:
    return ds.Study("mq200_paper", SMALL).strength(jobs=1)


def test_strength_is_what_the_command_line_prints(
    strength: ds.Strength, dogshape: Dogshape
) -> None:
    sets = [part for key, value in SMALL.items() for part in ("--set", f"{key}={value}")]
    said = dogshape("strength", "mq200_paper", *sets, "--jobs", 1, "--json")
    assert json.loads(said.out) == strength.to_dict()
    assert said.status == int(not strength.feasible)


def test_strength_has_its_landing_in_table_and_figure(strength: ds.Strength) -> None:
    frame = strength.to_frame().set_index("name")
    margins, worst, _ = drawn_margins(strength)
    landing = set(frame.index[frame["group"] == "impact"])
    assert (
        landing
        == set(margins) - set(worst) - {"engagement"}
        == set(ds.Study("mq200_paper").check(surrogate=BROUGHT).design.not_checked)
    )
    assert margins == pytest.approx(dict(100 * frame["margin"]))
    with pytest.raises(FrozenInstanceError):
        strength.design = None  # type: ignore[assignment,misc]


def test_strength_without_simulation(dogshape: Dogshape) -> None:
    found = ds.Study("mq200_paper").strength(simulate=False)
    said = dogshape("strength", "mq200_paper", "--no-simulation", "--json")
    assert json.loads(said.out) == found.to_dict()
    assert "before its landing is simulated" in repr(found)
