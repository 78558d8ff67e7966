"""The public package: what a notebook asks gives what the command line prints."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import chdir
from dataclasses import FrozenInstanceError, fields
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
import pytest

import dogshape as ds
from tests.conftest import Call

ROOT = Path(__file__).parents[2]
PAPER, BROUGHT = "mq200_paper", ROOT / "studies" / "mq200_paper" / "surrogate.json"
ONE = {"mismatch_rpm": 100, "force_N": 469}
SMALL = {
    "operating.mismatch_rpm": [50], "operating.force_N": [469.0], "expectation.angles": 3,
}  # fmt: skip
FEW = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s,engaged,trace\n"
#: A question in Python, and the same on the command line.
ASKED: dict[str, tuple[Callable[[], Any], str]] = {
    "shift": (
        lambda: ds.Study(PAPER, chamfer_deg=11, count=18).shift(**ONE, angle_deg=10),
        "shift mq200_paper --mismatch-rpm 100 --force-N 469 --angle-deg 10 "
        "--set dog.chamfer_deg=11 --set dog.count=18",
    ),
    "expect": (
        lambda: ds.Study(PAPER).expect(**ONE, angles=[0, 8, 16], jobs=1),
        "expect mq200_paper --mismatch-rpm 100 --force-N 469 --angles 0,8,16 --jobs 1",
    ),
    "strength": (
        lambda: ds.Study(PAPER, SMALL).strength(jobs=1),
        "strength mq200_paper --jobs 1 --set operating.mismatch_rpm=[50] "
        "--set operating.force_N=[469.0] --set expectation.angles=3",
    ),
    "check": (
        lambda: ds.Study(PAPER, chamfer_deg=14, height_mm=6).check(mismatch_rpm=50, force_N=469),
        "check mq200_paper --mismatch-rpm 50 --force-N 469 --set dog.chamfer_deg=14 "
        "--set dog.height_mm=6",
    ),
    "compare": (
        lambda: ds.compare("lubricated_steel", "adams2019"), "compare lubricated_steel adams2019"
    ),
}  # fmt: skip


def test_variants_of_a_study_are_compared() -> None:
    study = ds.Study(PAPER, SMALL)
    taller = study.replace_keys({"load.torque_Nm": 300.0}, height_mm=4.2)
    first, second = ds.compare(study, taller).items
    assert (first["label"], second["label"]) == ("mq200_paper", "mq200_paper (2)")
    assert (first["height_mm"], second["height_mm"]) == (3.7, 4.2)
    assert second["settings"] == {"load.torque_Nm": 300.0}
    assert second["difference_s"] is not None
    with pytest.raises(ds.InputError, match="'mq200_paper' is none"):
        ds.compare("adams2019", study)


@cache
def found(verb: str) -> Any:
    """Ask in Python, in an empty folder: beside results of a study its own surrogate counts."""
    with TemporaryDirectory() as empty, chdir(empty):
        return ASKED[verb][0]()


@pytest.mark.parametrize("verb", ASKED)
def test_a_result_is_what_the_command_line_prints(verb: str, dogshape: Call) -> None:
    result, words = found(verb), ASKED[verb][1].split()
    said = dogshape(*words, "--json")
    assert said.json == json.loads(json.dumps(result.to_dict()))
    verdict = getattr(result, "verdict", None)
    assert said.status == int(verdict is not None and bool(verdict.failed))
    assert dogshape(*words).out.split() == repr(result).split()
    with pytest.raises(FrozenInstanceError):
        setattr(result, fields(result)[0].name, None)


def test_times_as_table_and_figure() -> None:
    (line,) = found("expect").plot().data
    assert line.x[0] == pytest.approx(1e3 * found("expect").to_frame()["mean_s"][0])
    shift = found("shift")
    assert shift.to_frame()["t_s"].iloc[-1] == pytest.approx(shift.time_s, abs=2e-3)
    assert [axis.title.text for axis in shift.plot().select_yaxes()] == [*("mm", "1/min", "N")]


@pytest.mark.parametrize("verb", ["check", "strength"])
def test_margins_as_table(verb: str) -> None:
    frame = found(verb).to_frame().set_index("name")
    assert set(found(verb).failed) == set(frame.index[frame["passed"].eq(False)])
    assert frame.attrs["verdict"] == found(verb).verdict.line
    assert list(frame.index[frame["passed"].isna()]) == ["flank_strike"]
    assert (frame["group"] == "impact").sum() == 3
    # A surrogate knows no landing.
    at_once = ds.Study(PAPER).check(surrogate=BROUGHT).verdict.not_judged
    assert [one.check for one in at_once] == ["flank_strike", "landing", "engagement"]


def test_many_designs_are_what_the_command_line_prints(tmp_path: Path, dogshape: Call) -> None:
    table, out = tmp_path / "d.csv", tmp_path / "o.csv"
    table.write_text("chamfer_deg,count,note\n9,14,a\n11,18,b\n8,200,c\n")
    said = dogshape("predict", PAPER, table, "--out", out, "--json")
    many = ds.Study(PAPER).predict(table)
    assert many.to_dict() == said.json | {"file": None}
    frame, written = many.to_frame(), pd.read_csv(out)
    assert list(frame.index) == [2, 3, 4]
    assert list(written) == list(frame)
    for name in ("chamfer_deg", "expected_shift_time_s", "low_s", "distance"):
        assert list(frame[name]) == pytest.approx(list(written[name]), rel=1e-5, nan_ok=True)
    assert list(frame["reason"])[2] == written["reason"][2] != ""
    asked = pd.DataFrame({"chamfer_deg": [11.0], "count": [18]})
    one = ds.Study(PAPER, chamfer_deg=11, count=18).check(**ONE, surrogate=BROUGHT)
    times = ds.Study(PAPER).predict(asked, **ONE).to_frame()["expected_shift_time_s"]
    # To what surrogate.expected_time promises of many designs at once.
    assert times.iloc[0] == pytest.approx(one.time_s, rel=1e-3)
    with pytest.raises(ds.InputError, match=r"row 2, column count is '18[.]5'"):
        ds.Study(PAPER).predict(pd.DataFrame({"count": [14, 18.5]}))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data set of three operating points, of which one has no time."""
    brought = ROOT / "studies" / "bench" / "mq200_adams" / "bench.toml"
    (tmp_path / "bench.toml").write_text(brought.read_text(encoding="utf-8"))
    rows = ("20,469,0.1766,10,0.12,true,", "50,469,0.1766,10,0.09,true,", "50,641.5,0.12614,1,,,")
    (tmp_path / "shifts.csv").write_text(FEW + "\n".join(rows) + "\n")
    return tmp_path


def test_a_comparison_is_what_the_command_line_prints(folder: Path, dogshape: Call) -> None:
    result = ds.validate(folder, [0.0, 5.0, 10.0], jobs=1)
    asked = ("validate", folder, "--angles", "0,5,10", "--jobs", 1)
    assert dogshape(*asked, "--json").json == result.to_dict()
    assert dogshape(*asked).out.split() == repr(result).split()
    # The same in milliseconds wants a correction.
    table = folder / "shifts.csv"
    table.write_text(table.read_text().replace(",0.12,", ",120,").replace(",0.09,", ",90,"))
    with pytest.raises(ds.DogshapeError, match=r'correct=\["time=ms"\]'):
        ds.validate(folder)
    corrected = ds.validate(folder, [0.0, 5.0, 10.0], correct=["time=ms"], jobs=1)
    assert corrected.to_dict()["points"] == result.to_dict()["points"]
    assert "corrected as asked: time=ms" in repr(corrected)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: ds.Study(PAPER, chamfr_deg=11), "did you mean 'dog.chamfer_deg'"),
        (lambda: ds.Study(PAPER).check(mismatch_rpm=50), "needs mismatch_rpm and force_N"),
        (lambda: ds.Study(PAPER, chamfer=11), "with settings: 'dog.chamfer' is not a known key"),
        (lambda: ds.Study(PAPER).expect(precision="2%"), "precision is '2%', but it must be"),
        (
            lambda: ds.Study(PAPER).expect(angles="24"),
            "angles is '24', but it must be a whole number",
        ),
        (lambda: ds.Study(PAPER).expect(angles=0), "angles is 0, but it must lie between 1 and"),
        (lambda: ds.update_diagnosis("no", "new.csv"), 'ds.diagnose("BENCH", out="no")'),
        (lambda: ds.validate("mq200_adams", [0.0, 8.0]), "at least three"),
        (lambda: ds.validate("mq200_adams", [0.0, float("nan"), 5.0]), "must be a finite angle"),
        (
            lambda: ds.Study(PAPER).expect(precision=0.01, angles=3),
            "precision finds the number of angles itself; leave out angles",
        ),
    ],
)
def test_an_error_names_arguments(asked: Callable[[], Any], words: str) -> None:
    with pytest.raises(ds.DogshapeError) as refused:
        asked()
    assert words in str(refused.value)
    assert "--" not in str(refused.value)


def test_a_library_is_silent_and_tells_its_progress(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[int] = []

    class Mine(ds.Progress):
        def update(self, count: object) -> None:
            told.append(count.done)  # type: ignore[attr-defined]

        def say(self, line: str) -> None:
            raise AssertionError(line)

    study, four = ds.Study(PAPER), {**ONE, "angles": 4, "jobs": 1}
    study.expect(**four, progress=Mine())
    assert max(told) == 8
    assert capfd.readouterr() == ("", "")
    monkeypatch.setattr("dogshape.terminal.LINE_INTERVAL_S", 0.0)
    study.expect(**four, progress=True)
    assert "of 8 shifts" in capfd.readouterr().err


def test_names_are_loaded_when_asked_for_and_a_users_folder_shadows_none(tmp_path: Path) -> None:
    for name in ("sim", "studies", "pipeline"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise RuntimeError('not mine')\n")
    code = (
        "import sys, dogshape; print(*{'pydrake', 'plotly', 'pandas'} & set(sys.modules)); "
        "print(dogshape.Study('mq200_paper').name)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines() == ["", PAPER], done.stderr
    assert all(getattr(ds, name) for name in ds.__all__)
    with pytest.raises(AttributeError, match="dogshape has no 'Shfit'"):
        ds.Shfit  # noqa: B018
