"""Designs by their names, and their data sheets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dogshape.check import check_design
from dogshape.pipeline.reports.data_sheet import write_sheet
from dogshape.pipeline.reports.design_record import (
    DesignSheet,
    SimulatedValues,
    WeakestCheck,
    design_sheet,
    searched_checks,
    searched_sheet,
)
from dogshape.pipeline.reports.named_design import NamedDesign
from dogshape.pipeline.store.check_records import CheckRow, LandingRow, VerdictRow
from dogshape.pipeline.store.folder import require_targets
from dogshape.pipeline.store.result_records import hang_keys
from dogshape.sim.strength.manufacture import Kind


def sheet_of(design: NamedDesign) -> tuple[DesignSheet, list[CheckRow]]:
    """Record a design and its checks; a dog that was not searched is simulated as by ``check``."""
    study = design.study
    if design.result is not None and design.row is not None:
        sheet = searched_sheet(study, design.result, design.row)
        return sheet, searched_checks(design.design_study, design.result, design.row)
    check = check_design(study)
    expected = check.expected
    landing = check.landing_load
    simulated = SimulatedValues(
        expected_shift_time_s=None if expected is None else expected.time,
        standard_error_s=None if expected is None else expected.error,
        **(check.hangs or hang_keys(None)).to_dict(),
        source=check.refusal or "compiled engine",
        engaged=check.engaged if check.shifts else None,
        decisive_landing=None if landing is None else LandingRow.of(landing),
    )

    def weakest_check(kind: Kind) -> WeakestCheck:
        return WeakestCheck(*check.design.weakest_within(kind))

    sheet = design_sheet(
        study,
        study.prototype,
        {strength.name: strength.margin for strength in check.design.checks},
        worst_case=weakest_check("worst_case"),
        root_sum_square=weakest_check("root_sum_square"),
        verdict=VerdictRow.of(check.verdict),
        simulated=simulated,
        engine="planar",
    )
    return sheet, check.rows


def write_data_sheet(design: NamedDesign, path: str | Path, block: Mapping[str, str]) -> Path:
    """Write the data sheet of a design, A4 or by its ending JSON, with a ``write_sheet`` block."""
    require_targets({"the data sheet": Path(path)})
    write_sheet(design, *sheet_of(design), block, Path(path))
    return Path(path)
