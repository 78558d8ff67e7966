"""A folder of results made of a study's kept result: all but its single shifts."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.versions import bundled_root


def kept_folder(root: Path, name: str = "mq200_paper", settings: Sequence[str] = ()) -> StudyFolder:
    """Make the folder of a bundled study; ``settings`` override keys of its study alone."""
    root.mkdir(parents=True)
    folder = StudyFolder(root)
    folder.open(load_study(bundled_root() / name / "study.toml", settings), resume=False)
    shutil.copy(bundled_root() / name / "result.json", folder.result)
    return folder


def let_land_too_hard(folder: StudyFolder, *trials: int) -> None:
    """Let confirmed designs fail the landing check in the stored result."""
    result = folder.stored_result()
    for design in result["confirmation"]["designs"]:
        if design["trial"] in trials:
            edge = next(c for c in design["checks"] if c["name"] == "edge_pressure_impact")
            edge["passed"], edge["margin"] = False, -0.02
    folder.result.write_text(json.dumps(result))
