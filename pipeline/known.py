"""Surrogates that are there already: of a study's results, or brought by the package."""

from __future__ import annotations

from pathlib import Path

from pipeline.config import Study
from pipeline.folder import StudyFolder
from pipeline.options import default_out
from sim.bundled import bundled_root
from sim.records import content_key
from surrogate.store import Stored, load


def space_out(study: Study) -> Path:
    """Return the folder of designs that fill the space of a study."""
    return Path("results") / f"{study.name}-space"


def brought_file(study: Study) -> Path:
    """Return the surrogate that the package may bring for a study."""
    return bundled_root() / study.name / "surrogate.json"


def known_surrogate(study: Study) -> Stored | None:
    """Return the surrogate that the package brings for the study's physics, None if it has none."""
    path = brought_file(study)
    if not path.is_file():
        return None
    stored = load(path)
    same = content_key(stored.surrogate.data.physics) == study.physics_hash
    return stored if same else None


def surrogate_file(study: Study) -> Path:
    """Return the surrogate to ask: of the study's search, of its space, or the package's."""
    own = StudyFolder(default_out(study)).surrogate
    candidates = (own, StudyFolder(space_out(study)).surrogate, brought_file(study))
    return next((path for path in candidates if path.is_file()), own)
