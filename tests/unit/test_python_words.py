"""Errors of the public package: arguments in place of options, numbers in place of text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import dogshape as ds
from dogshape.python_words import python_words
from tests.conftest import Said


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: ds.Study("mq200").check(mismatch_rpm=50), "needs mismatch_rpm and force_N"),
        (lambda: ds.Study("mq200", chamfer=11), "with settings: 'dog.chamfer' is not a known key"),
        (lambda: ds.Study("mq200", chamfer_deg="11x"), "with settings: dog.chamfer_deg is '11x'"),
        (lambda: ds.Study("mq200").expect(precision="2%"), "precision is '2%', but it must be"),
        (lambda: ds.Study("mq200").expect(angles="24"), "angles is '24', but it must be a number"),
        (lambda: ds.Study("mq200").search(trials="5"), "trials is '5', but it must be a number"),
        (
            lambda: ds.Study("mq200").expect(precision=0.01, angles=3),
            "precision finds the number of angles itself; leave out angles",
        ),
        (
            lambda: ds.Study("mq200").shift(mismatch_rpm="50", force_N=469, angle_deg=1),
            "mismatch_rpm is '50', but it must be a number; give it without quotes",
        ),
    ],
)
def test_an_error_names_arguments(asked: Callable[[], Any], words: str) -> None:
    with pytest.raises(ds.InputError) as refused:
        asked()
    assert words in str(refused.value)
    assert "--" not in str(refused.value)


def test_the_command_line_keeps_its_options(dogshape: Callable[..., Said]) -> None:
    said = dogshape("check", "mq200_paper", "--mismatch-rpm", 80)
    assert "needs --mismatch-rpm and --force-N" in said.sentence
    said = dogshape("check", "mq200_paper", "--set", "dog.chamfer=11")
    assert "with --set: 'dog.chamfer'" in said.sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("give --set dog.count=18, or wait", 'give {"dog.count": 18}, or wait'),
        ("or give --engine drake", 'or give {"solver.engine": "drake"}'),
        ("add --resume to go on", "add resume to go on"),
        ("correct it with --correct time=ms", 'correct it with correct=["time=ms"]'),
        ("'dogshape expect' simulates it", "study.expect() simulates it"),
    ],
)
def test_options_become_arguments(text: str, words: str) -> None:
    assert python_words(text) == words
