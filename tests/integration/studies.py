"""Finished studies, each made once a session, whichever process of it asks first."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import pair_of
from dogshape.sim.files import writing
from tests.conftest import SMALL

#: Keys of the study file that make a study small, with their values; None takes a key out.
SETTINGS = dict(map(pair_of, SMALL))


@dataclass(frozen=True)
class Finished:
    """A study that has ended. Tests that change its folder take a copy."""

    folder: Path

    @property
    def result(self) -> dict[str, Any]:
        """What it found."""
        found: dict[str, Any] = json.loads((self.folder / "result.json").read_text())
        return found

    def copy(self, folder: Path, *without: str) -> Path:
        """Copy its folder, but for files of some names."""
        ignored = shutil.ignore_patterns(*without)
        return Path(shutil.copytree(self.folder, folder, ignore=ignored, dirs_exist_ok=True))


def made_once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]
) -> Finished:
    """Make a folder once a session, also where several processes run its tests."""
    base = factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent
    ended = base / "shared" / f"{name}.ended"
    with writing(ended.with_suffix(".lock"), patience=3600.0):
        if not ended.exists():
            shutil.rmtree(ended.with_suffix(""), ignore_errors=True)
            make(ended.with_suffix(""))
            ended.touch()
    return Finished(ended.with_suffix(""))


def finished_study(factory: pytest.TempPathFactory, name: str, **more: Any) -> Finished:
    """Run the small study, with other settings of its search or another engine, once a session."""
    engine = {"solver.engine": more.pop("engine")} if "engine" in more else {}
    settings = SETTINGS | engine | {f"search.{key}": value for key, value in more.items()}

    def search(folder: Path) -> None:
        ds.Study("mq200_paper", settings).search(folder, jobs=1, report=False)

    return made_once(factory, name, search)
