"""An argument of a wrong type is an InputError that names the argument and the rule."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.progress import SILENT
from dogshape.running import in_radians, receiver
from dogshape.sim.units import DEG
from dogshape.terminal import ProgressBar

ANY: Any = ds  # calls here break the types


def shift(**arguments: Any) -> Any:
    return ANY.Study("mq200_paper").shift(**arguments)


def expect(**arguments: Any) -> Any:
    return ANY.Study("mq200_paper").expect(**arguments)


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        (lambda: ANY.Study(5), "where is 5, but it must be a text or a path; help(dogshape.Study)"),
        (lambda: ANY.Study("mq200", 5), "settings is 5, but it must be a dictionary or a list of"),
        (lambda: ANY.Study("mq200", count=[15]), "count is [15], but it must be a number or a t"),
        (
            lambda: shift(mismatch_rpm=[50], angle_deg=3),
            "mismatch_rpm is [50], but it must be a nu",
        ),
        (lambda: shift(mismatch_rpm=True, angle_deg=3), "mismatch_rpm is True, but it must be a n"),
        (lambda: shift(mismatch_rpm=50, angle_deg="3°"), "number; give it without quotes and unit"),
        (lambda: expect(angles=8.5), "angles is 8.5, but it must be a whole number or a list of n"),
        (lambda: expect(angles=["a"]), "angles is ['a'], but it must be a whole number or a list"),
        (
            lambda: expect(jobs=1.5),
            "jobs is 1.5, but it must be a whole number; help(dogshape.Study",
        ),
        (
            lambda: expect(progress=3),
            "progress is 3, but it must be a Progress or True or False or",
        ),
        (lambda: ANY.validate("mq200_stand", "8"), "angles is '8', but it must be a whole number"),
        (
            lambda: ANY.validate("mq200_stand", correct="time=ms"),
            "correct is 'time=ms', but it mus",
        ),
        (lambda: ANY.diagnose(7), "bench is 7, but it must be a text or a path or a BenchDraft or"),
        (
            lambda: ANY.compare("mq200", 3),
            "items[1] is 3, but it must be a text or a Study; help(",
        ),
        (lambda: ANY.load_result(None), "folder is None, but it must be a text or a path"),
        (
            lambda: ANY.Study("mq200").data_sheet("x.html", number=7),
            "number is 7, but it must be a",
        ),
        (
            lambda: ANY.load_result("mq200").plot(3),
            "objective is 3, but it must be a text or None; h",
        ),
    ],
)
def test_a_wrong_type_is_refused(verb: Callable[[], Any], words: str) -> None:
    with pytest.raises(ds.InputError, match=re.escape(words)):
        verb()


def test_an_unknown_argument_keeps_the_message_of_python() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'mismatch'"):
        shift(mismatch=50, angle_deg=3)


def test_numbers_of_numpy_are_numbers() -> None:
    assert in_radians(np.int64(8)) == 8
    assert in_radians(np.array([0.0, 3.0])) == (0.0, 3.0 * DEG)
    times = expect(mismatch_rpm=np.float64(100), force_N=469, angles=np.arange(2.0), jobs=1)
    assert times.time_s > 0.0


def test_progress_is_shown_where_a_person_watches(monkeypatch: pytest.MonkeyPatch) -> None:
    assert receiver(None) is receiver(False) is SILENT
    assert isinstance(receiver(True), ProgressBar)
    monkeypatch.setattr(ProgressBar, "is_watched", True)
    assert isinstance(receiver(None), ProgressBar)
    assert receiver(SILENT) is SILENT


def test_completion_shows_public_names_alone() -> None:
    assert dir(ds) == ds.__all__
    assert all(not name.startswith("_") for name in dir(ds))
