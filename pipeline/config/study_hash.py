"""Content of a study file: what its hashes are of, and what an earlier version wrote of it."""

from __future__ import annotations

from dogshape.pipeline.config.schema import StudyFile
from dogshape.sim.statistics.shift_records import Record

GONE = "use_known"  #: key of ``[search]`` that studies no longer have


def hashed(file: StudyFile) -> Record:
    """Return a study file as its hashes have it.

    A key that is gone keeps the value that studies had, so that searches and results of earlier
    versions are still those of their study.
    """
    content = file.model_dump()
    content["search"][GONE] = True
    return content


def without_gone(content: Record) -> Record:
    """Return the content of a study file that an earlier version wrote, as it is read today."""
    search = {key: value for key, value in content.get("search", {}).items() if key != GONE}
    return {**content, "search": search} if search else content
