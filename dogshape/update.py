"""Update of a diagnosis: new readings join its data set, and the record keeps both answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.diagnosis.bench.bench_data import require_times
from dogshape.gap import Diagnosis
from dogshape.pipeline.diagnose.bank_diagnosis import BANK, Means, diagnosed
from dogshape.pipeline.diagnose.consequence import extras_of
from dogshape.pipeline.diagnose.gap_update import (
    asked_of,
    before_of,
    joined,
    update_record,
    updates_of,
    write_updates,
)
from dogshape.pipeline.progress import SILENT, Progress
from dogshape.pipeline.reports.gap.gap_page import publish
from dogshape.result import Result
from dogshape.sim.files import writing

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Update(Result):
    """Change of a diagnosis by new readings.

    Parameters
    ----------
    diagnosis : with the new readings.
    record : of this update: new readings, before, after, and why in a sentence.
    folder : of the diagnosis.
    """

    diagnosis: Diagnosis
    record: dict[str, Any]
    folder: Path

    @property
    def facts(self) -> dict[str, str]:
        """Verdict before and after, and why."""
        return {
            "before": self.record["before"]["headline"],
            "now": self.record["after"]["headline"],
            "why": self.record["sentence"],
        }

    def to_dict(self) -> dict[str, Any]:
        """Give the record that ``dogshape gap update --json`` prints."""
        return {
            **self.record,
            "next_test": self.diagnosis.to_dict()["next_test"],
            "report": str(self.folder / "report.html"),
        }

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each hypothesis: probability before and after."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        both = {when: self.record[when]["probabilities"] for when in ("before", "after")}
        return pd.DataFrame(both).fillna(0.0).rename_axis("hypothesis")


def update_diagnosis(
    folder: str | Path,
    new: str | Path,
    *,
    bank: str | Path = BANK,
    effects: str | Path | None = None,
    jobs: int = 0,
    progress: Progress = SILENT,
) -> Update:
    """Join new readings to the data set of an earlier diagnosis, and diagnose again.

    Parameters
    ----------
    folder : of the earlier diagnosis (``diagnose`` with ``out``).
    new : table with the columns of ``shifts.csv``, in the same units.
    effects : folder with effects of the user's own; that of the earlier diagnosis by default.
    bank, jobs, progress : as in ``diagnose``. The engine is that of the earlier diagnosis, so that
        before and now differ by the readings alone.

    Raises
    ------
    DataError, StorageError
        For a table or a folder that cannot be used, with the remedy. Nothing is changed then.
    """
    place = Path(folder)
    asked = asked_of(place)
    with writing(place):
        data = joined(place, Path(new), asked)
        require_times(data.bench)
        count = len(asked.joined)
        before, cells = before_of(place, count)
        own = effects if effects is not None else asked.effects
        folders = Path(bank), None if own is None else Path(own)
        means = Means(*folders, jobs, progress, before["engine"])
        inference = diagnosed(data.bench, means)
        record = update_record(before, cells, inference, data.new, count)
        updates = [*updates_of(place, count), record]
        history = {f"update {one['update']}": one["sentence"] for one in updates}
        extras = extras_of(inference)
        extras = replace(extras, provenance={**extras.provenance, **history})
        publish(inference, place, extras)
        write_updates(place, updates)
        data.settle()
    return Update(Diagnosis(inference, None, place), record, place)
