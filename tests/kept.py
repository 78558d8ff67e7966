"""A folder of results made of a study's kept result: all but its single shifts."""

from __future__ import annotations

import shutil
from pathlib import Path

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.bundled import bundled_root


def kept_folder(root: Path, name: str = "mq200_paper") -> StudyFolder:
    """Make the folder of a bundled study."""
    root.mkdir(parents=True)
    folder = StudyFolder(root)
    folder.open(load_study(bundled_root() / name / "study.toml"), resume=False)
    shutil.copy(bundled_root() / name / "result.json", folder.result)
    return folder
