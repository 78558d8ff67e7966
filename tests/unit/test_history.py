"""The table of computing times has one row for each version."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import pytest

from benchmarks import figures, history


def _row(version: str, check_s: str) -> history.Row:
    names = (
        "date",
        "compiled_shift_ms",
        "drake_shift_ms",
        "ratio",
        "first_use_s",
        "expect_s",
        "load_per_core",
    )
    return {"version": version, "check_s": check_s, "processor": "Z80", **dict.fromkeys(names, "1")}


def test_a_version_replaces_its_row_and_a_new_one_is_appended() -> None:
    rows = [_row("1.0.0", "2.0"), _row("1.1.0", "3.0")]
    assert history.with_version(rows, _row("1.0.0", "1.5")) == [_row("1.0.0", "1.5"), rows[1]]
    assert history.with_version(rows, _row("2.0.0", "1.0")) == [*rows, _row("2.0.0", "1.0")]
    assert history.with_version([], rows[0]) == rows[:1]


def test_rows_are_kept_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history, "TABLE", tmp_path / "history.csv")
    monkeypatch.setattr(figures, "EVIDENCE", tmp_path)
    for version, check_s in (("1.0.0", "2.0"), ("1.1.0", "3.0"), ("1.1.0", "2.5")):
        monkeypatch.setattr(history, "measure_version", partial(_row, version, check_s))
        history.main()
    assert history.read_rows() == [_row("1.0.0", "2.0"), _row("1.1.0", "2.5")]
    lines = figures.history().splitlines()
    assert [line.split(" | ")[5] for line in lines[2:]] == ["2.0 s", "2.5 s"]


def test_a_command_is_measured_with_caches_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text('#!/bin/sh\n[ "$NUMBA_CACHE_DIR" = here ] && [ -d "$XDG_CACHE_HOME" ]\n')
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    assert 0.0 <= history.measure_command(["check"], Path("here")) < 1.0
