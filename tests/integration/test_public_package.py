"""The public package: what a notebook asks gives what the command line prints."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

import dogshape as ds
from tests.conftest import Said

Dogshape = Callable[..., Said]

ONE = {"mismatch_rpm": 100, "force_N": 469}


@pytest.fixture(scope="module")
def shift() -> ds.Shift:
    return ds.Study("mq200_paper", chamfer_deg=11, count=18).shift(**ONE, angle_deg=10)


def test_a_shift_is_what_the_command_line_prints(shift: ds.Shift, dogshape: Dogshape) -> None:
    said = dogshape(
        *("shift", "mq200_paper", "--mismatch-rpm", "100", "--force-N", "469"),
        *("--relative-angle-deg", "10", "--set", "dog.chamfer_deg=11", "--set", "dog.count=18"),
        "--json",
    )
    assert json.loads(said.out) == shift.to_dict()


def test_a_shift_carries_its_problem_and_does_not_change(shift: ds.Shift) -> None:
    assert shift.config.clutch.dog.count == 18
    assert shift.engagement.clutch.dog == shift.config.clutch.dog
    with pytest.raises(FrozenInstanceError):
        shift.engagement = None  # type: ignore[assignment,misc]


def test_a_shift_as_table_figure_and_page(shift: ds.Shift, tmp_path: Path) -> None:
    frame = shift.to_frame()
    assert shift.time_s is not None
    assert frame["t_s"].iloc[-1] == pytest.approx(shift.time_s, abs=2e-3)
    assert [axis.title.text for axis in shift.plot().select_yaxes()] == [*("mm", "1/min", "N")]
    page = shift.report(tmp_path / "shift.html")
    assert page.stat().st_size > 1_000_000


def test_results_show_themselves(shift: ds.Shift) -> None:
    assert f"shift time {1e3 * (shift.time_s or 0):.1f} ms" in repr(shift)
    assert "<th" in shift._repr_html_()
    assert "chamfer_deg=11" in repr(ds.Study("mq200_paper", chamfer_deg=11))


def test_expectation_is_what_the_command_line_prints(dogshape: Dogshape) -> None:
    found = ds.Study("mq200_paper").expect(**ONE, angles=[0, 8, 16], jobs=1)
    said = dogshape(
        *("expect", "mq200_paper", "--mismatch-rpm", "100", "--force-N", "469"),
        *("--angles", "0,8,16", "--jobs", "1", "--json"),
    )
    assert json.loads(said.out) == found.to_dict()
    assert list(found.to_frame()["n"]) == [3]
    (line,) = found.plot().data
    assert line.x[0] == pytest.approx(1e3 * found.to_frame()["mean_s"][0])


def test_settings_are_keys_of_the_study_file() -> None:
    study = ds.Study("mq200_paper", {"contact.set": "adams2019"}, height_mm=3.5)
    assert study.config.clutch.contact.name == "adams2019"
    assert study.dog["height_mm"] == 3.5
    with pytest.raises(ds.InputError, match=r"did you mean 'dog[.]chamfer_deg'"):
        ds.Study("mq200_paper", chamfr_deg=11)


def test_a_library_is_silent_and_tells_its_progress(capfd: pytest.CaptureFixture[str]) -> None:
    told: list[int] = []

    class Mine:
        def update(self, count: object) -> None:
            told.append(count.done)  # type: ignore[attr-defined]

        def say(self, line: str) -> None:
            raise AssertionError(line)

    ds.Study("mq200_paper").expect(**ONE, angles=4, jobs=1, progress=Mine())
    assert max(told) == 8
    assert capfd.readouterr() == ("", "")


def test_names_are_loaded_when_asked_for() -> None:
    code = "import sys, dogshape; print(*{'pydrake', 'plotly', 'pandas'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
    assert all(getattr(ds, name) for name in ds.__all__)
    with pytest.raises(AttributeError, match="dogshape has no 'Shfit'"):
        ds.Shfit  # noqa: B018


def test_a_folder_of_the_users_own_shadows_nothing(tmp_path: Path) -> None:
    for name in ("sim", "studies", "pipeline"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise RuntimeError('not mine')\n")
    code = "import dogshape as ds; print(ds.Study('mq200_paper').name)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "mq200_paper", done.stderr
