"""Decisions of people about a study's designs: which one, when, why, on which result.

They are kept in ``decision.json`` of the study's folder, the last one counts; none is taken out.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.sim.errors import StorageError

FORMAT = 1
AGAIN = "move it away, then decide again"


@dataclass(frozen=True)
class Decision:
    """A decision for a design.

    ``time`` is in UTC; ``result_sha256`` is that of the ``result.json`` which it was taken on.
    """

    design: int
    why: str
    time: str
    result_sha256: str
    config_hash: str
    physics_hash: str

    @property
    def day(self) -> str:
        """Day of the decision."""
        return self.time.partition("T")[0]


def result_hash(folder: StudyFolder) -> str:
    """Return the SHA-256 of a folder's ``result.json``."""
    return hashlib.sha256(folder.result.read_bytes()).hexdigest()


def decisions_of(folder: StudyFolder) -> list[Decision]:
    """Read the decisions of a folder, the oldest first; raise StorageError where damaged."""
    path = folder.decision
    if not path.exists():
        return []
    stored = read_json(path, AGAIN)
    try:
        return [Decision(**one) for one in stored["decisions"]]
    except (KeyError, TypeError) as error:
        raise StorageError(f"{path} is damaged; {AGAIN}") from error


def keep_decision(folder: StudyFolder, decision: Decision) -> None:
    """Add a decision to those of the folder."""
    every = [*decisions_of(folder), decision]
    write_json(folder.decision, {"format": FORMAT, "decisions": [asdict(one) for one in every]})


def record_of(decision: Decision) -> dict[str, Any]:
    """Give a decision as a record, fit for JSON."""
    return asdict(decision)


def workshop_folder(folder: StudyFolder) -> Path:
    """Return the folder with what the workshop needs of the last decision."""
    return folder.root / "decision"
