"""Finished studies, each made once a session, also with several processes."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import pair_of
from tests.conftest import SMALL

#: Keys of the study file that make a study small, with their values; None takes a key out.
SETTINGS = dict(map(pair_of, SMALL))


def result_of(folder: Path) -> dict[str, Any]:
    """Read the result of a study."""
    record: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return record


def designs_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """List designs without trial numbers: a trial that a kill cut off has a number too."""
    ignored_keys = ("trial", "time_within_tolerances")
    return [{k: v for k, v in row.items() if k not in ignored_keys} for row in result["trials"]]


def lines_of(folder: Path, name: str = "running.jsonl") -> list[bytes]:
    """Read the lines of a journal, none without a file."""
    journal = folder / name
    return journal.read_bytes().splitlines(keepends=True) if journal.exists() else []


def wait_until(ready: Callable[[], object], process: subprocess.Popen[Any] | None = None) -> None:
    """Wait until ``ready``; fail if the process ends before."""
    end = time.monotonic() + 300.0
    while not ready():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


@dataclass(frozen=True)
class Finished:
    """Finished study. Tests that change its folder take a copy."""

    folder: Path

    @property
    def result(self) -> dict[str, Any]:
        """Result of the study."""
        return result_of(self.folder)

    def copy(self, folder: Path, *without: str) -> Path:
        """Copy the folder without files of some names."""
        ignored = shutil.ignore_patterns(*without)
        return Path(shutil.copytree(self.folder, folder, ignore=ignored, dirs_exist_ok=True))


def make_once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]
) -> Finished:
    """Make a folder once a session, also where several processes run its tests."""
    base = factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = base / "shared" / name
    end_mark = folder.with_suffix(".ended")
    folder.parent.mkdir(exist_ok=True)
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not end_mark.exists():
            shutil.rmtree(folder, ignore_errors=True)
            make(folder)
            end_mark.touch()
    return Finished(folder)


def finished_study(
    factory: pytest.TempPathFactory, name: str, overrides: Mapping[str, Any]
) -> Finished:
    """Run the small study with other keys, once a session."""
    study = ds.Study("mq200_paper", SETTINGS | dict(overrides))
    return make_once(factory, name, lambda folder: study.search(folder, jobs=1, report=False))
