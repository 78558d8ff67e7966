"""Decision for a design of a searched study, and what the workshop needs of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.reports.decision.workshop import choose
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.result import Result

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Decision(Result):
    """A decision that was recorded, with the files for the workshop.

    Parameters
    ----------
    record : design, reason, time in UTC, hashes, files, and notes on what speaks against it.
    """

    record: dict[str, Any]

    @property
    def folder(self) -> Path:
        """Folder with drawing, solids and data sheet."""
        return Path(self.record["folder"])

    @property
    def facts(self) -> dict[str, str]:
        """Design, reason, time and folder."""
        told = {key: str(self.record[key]) for key in ("design", "why", "time", "folder")}
        return told | {"notes": "; ".join(self.record["notes"]) or "none"}

    def to_dict(self) -> dict[str, Any]:
        """Give the record."""
        return dict(self.record)

    def to_frame(self) -> pd.DataFrame:
        """Give the files that were written, a row each."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame({"file": [str(self.folder / name) for name in self.record["files"]]})


def choose_design(folder: str | Path, design: int, why: str, *, force: bool = False) -> Decision:
    """Decide for a design of a study's results.

    Raises
    ------
    InputError
        For a design that the study has not simulated, or an empty reason.
    StorageError
        For a folder without a result, or with a decision already, without ``force``.
    """
    return Decision(choose(StudyFolder(Path(folder)), design, why, force=force))
