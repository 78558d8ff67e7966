"""Sentences name options on the command line, and arguments in Python."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from dogshape.sim.interface import (
    argument,
    command_line,
    key_argument,
    key_arguments,
    listed_argument,
    text_value,
    verb,
)

WORDS: list[tuple[Callable[[], str], str, str]] = [
    (lambda: argument("force_rise_s"), "--force-rise-s", "force_rise_s"),
    (lambda: argument("rise_s", 0.1), "--rise-s 0.1", "rise_s=0.1"),
    (lambda: argument("resume", value=True), "--resume", "resume=True"),
    (lambda: argument("jobs", 1), "--jobs 1", "jobs=1"),
    (lambda: argument("origin", "mq 200"), "--from 'mq 200'", 'origin="mq 200"'),
    (lambda: listed_argument("drop", "gear=*"), "--drop 'gear=*'", 'drop=["gear=*"]'),
    (lambda: listed_argument("keep", "row=2", quoted=True), "--keep 'row=2'", 'keep=["row=2"]'),
    (lambda: text_value("b - a"), "'b - a'", '"b - a"'),
    (
        lambda: key_argument("columns", "force_N", "F [N]:kN"),
        "--column force_N='F [N]:kN'",
        'columns={"force_N": "F [N]:kN"}',
    ),
    (
        lambda: key_argument("columns", "order", "Nr", quoted=True),
        "--column order='Nr'",
        'columns={"order": "Nr"}',
    ),
    (
        lambda: key_argument("columns", "order", "Leo's", quoted=True),
        """--column order='Leo'"'"'s'""",
        'columns={"order": "Leo\'s"}',
    ),
    (lambda: key_argument("columns", "force_N"), "--column force_N", 'columns["force_N"]'),
    (
        lambda: key_arguments("columns", {"force_N": "column 1", "shift_time_s": "column 2"}),
        "--column force_N='column 1' --column shift_time_s='column 2'",
        'columns={"force_N": "column 1", "shift_time_s": "column 2"}',
    ),
    (
        lambda: key_argument("values", "corrections", ["time=ms"]),
        """--set 'corrections=["time=ms"]'""",
        'values={"corrections": ["time=ms"]}',
    ),
    (
        lambda: key_argument("values", "timeout_s", 2.0),
        "--set timeout_s=2",
        'values={"timeout_s": 2.0}',
    ),
    (
        lambda: key_argument("limits", "rows", 300_000),
        "--limit rows=300000",
        "limits=ds.TableLimits(rows=300000)",
    ),
    (
        lambda: key_argument("settings", "dog.count", "18"),
        "--set dog.count=18",
        'settings={"dog.count": "18"}',
    ),
    (
        lambda: key_argument("settings", "operating.seed", ""),
        "--set operating.seed=",
        'settings={"operating.seed": None}',
    ),
    (lambda: verb("fit"), "'dogshape fit'", "ds.fit()"),
    (
        lambda: verb("search", "mq200", resume=True),
        "'dogshape search mq200 --resume'",
        'ds.Study("mq200").search(resume=True)',
    ),
    (
        lambda: verb("update-diagnosis", "results/gap"),
        "'dogshape update-diagnosis results/gap'",
        'ds.update_diagnosis("results/gap")',
    ),
]


@pytest.mark.parametrize(
    ("write", "option", "python"), WORDS, ids=[option for _, option, _ in WORDS]
)
def test_words_of_both_interfaces(write: Callable[[], str], option: str, python: str) -> None:
    assert write() == python
    with command_line():
        assert write() == option
    assert write() == python
