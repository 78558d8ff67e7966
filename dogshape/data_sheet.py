"""Data sheet of a design, from a study's results or as its own dog."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.check import check_design
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.study.data_sheet import sheet_record, write_sheet
from dogshape.pipeline.reports.study.design_record import searched_record
from dogshape.pipeline.reports.study.named_design import NamedDesign
from dogshape.pipeline.store.folder import write_json
from dogshape.pipeline.store.output_files import require_targets
from dogshape.result import Result, ms
from dogshape.side_by_side import checked_record

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class DataSheet(Result):
    """Dimensions, times, margins and provenance of a design.

    Parameters
    ----------
    config : the study with the design as its own dog.
    record : content of the sheet, keys with their units.
    """

    config: Setup
    record: dict[str, Any]

    @property
    def facts(self) -> dict[str, str]:
        """Design, expected shift time, smallest margin and reason of the decision."""
        record = self.record
        return {
            "design": record["name"],
            "shift time": ms(record["expected_shift_time_s"], record["standard_error_s"]),
            "smallest margin": f"{record['smallest_margin']:.1%}, {record['weakest_check']}",
            **({"decision": record["why"]} if record["why"] else {}),
        }

    def to_dict(self) -> dict[str, Any]:
        """Give the content of the sheet."""
        return dict(self.record)

    def to_frame(self) -> pd.DataFrame:
        """Give a row for each check: value and limit in ``unit``, margins as shares."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame(self.record["checks"])

    def report(self, path: str | Path) -> Path:
        """Write the sheet as a page for A4, or as JSON where the path ends in ``.json``."""
        target = Path(path)
        require_targets({"the data sheet": target})
        if target.suffix.lower() == ".json":
            write_json(target, self.record)
        else:
            write_sheet(self.config, self.record, target)
        return target


def sheet_of(one: NamedDesign, why: str = "") -> DataSheet:
    """Make the data sheet of a design; one that was not searched is simulated as by ``check``.

    ``why`` is the reason of a decision for it.
    """
    if one.result is not None and one.row is not None:
        record, checks = searched_record(one.study, one.result, one.row), None
    else:
        found = check_design(one.study)
        record, checks = checked_record(found), found.record["checks"]
    return DataSheet(one.own_study, sheet_record(one, record, checks, why.strip()))
