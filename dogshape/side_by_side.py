"""Designs, studies, folders of results or contact sets side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.check import check_design
from dogshape.pipeline.reports.comparison.items import Item, contact_sets, item_of
from dogshape.pipeline.reports.comparison.page import write_comparison
from dogshape.pipeline.reports.comparison.rows import notes_of, rows_of
from dogshape.pipeline.reports.comparison.side_by_side import contacts_record, designs_record
from dogshape.pipeline.store.output_files import require_targets
from dogshape.result import Result, ms
from dogshape.sim.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class SideBySide(Result):
    """Items side by side, with the differences of the others to the first.

    Parameters
    ----------
    record : items and differences, keys with their units.
    """

    record: dict[str, Any]

    @property
    def facts(self) -> dict[str, str]:
        """Items with their times, where they have one."""
        return {
            item["label"]: ms(item.get("expected_shift_time_s"), item.get("standard_error_s"))
            for item in self.record["items"]
        }

    @property
    def rows(self) -> list[list[str]]:
        """Table in words: the head, then a row for each quantity."""
        return rows_of(self.record)

    @property
    def notes(self) -> list[str]:
        """Sentences on what the differences cover."""
        return notes_of(self.record)

    def to_dict(self) -> dict[str, Any]:
        """Give items and differences."""
        return dict(self.record)

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each item."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame(self.record["items"]).set_index("label")

    def report(self, path: str | Path) -> Path:
        """Write the page of the comparison; give its path."""
        require_targets({"the page": Path(path)})
        write_comparison(self.record, Path(path))
        return Path(path)


def compare(*names: str) -> SideBySide:
    """Compare designs, studies, folders of results, or contact sets.

    Parameters
    ----------
    names : such as ``"results/mq200#43"``, ``"mq200"``, ``"results/mine"`` or
        ``"lubricated_steel"``; the first is what the others are compared with. Of a design that
        was not simulated the time is predicted, as by ``check``.

    Raises
    ------
    InputError
        For fewer than two names, names that are nothing known, or contact sets beside others.
    """
    if len(names) < 2:
        raise InputError(
            f"compare is given {len(names)} item, but it needs two or more; name for instance "
            "mq200#19 and mq200#43"
        )
    sets = contact_sets(names)
    if sets is not None:
        return SideBySide(contacts_record(sets))
    return SideBySide(designs_record([_with_time(item_of(name)) for name in names]))


def _with_time(item: Item) -> Item:
    """Predict the time of a design of which nothing was simulated, as ``check`` does."""
    if item.standing.row.get("expected_shift_time_s") is not None:
        return item
    found = check_design(item.study)
    margins = {check.name: check.margin for check in found.design.checks}
    expected, by = found.expected, "compiled engine"
    if expected is None:
        standing = replace(item.standing, margins=margins)
        return replace(item, standing=standing, source=f"{item.source}; {found.refusal}")
    standing = replace(item.standing, time=(expected.time, expected.error), margins=margins)
    source = f"{item.source}; time by the {by}"
    return replace(item, standing=standing, predicted=by, source=source)
