"""Records and data sheets of designs: of a result, or as ``check`` judges a study's own dog."""

from __future__ import annotations

from pathlib import Path

from dogshape.check import check_design
from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.data_sheet import searched_checks, write_sheet
from dogshape.pipeline.reports.study.design_record import design_record, searched_record
from dogshape.pipeline.reports.study.named_design import NamedDesign
from dogshape.pipeline.simulate.design import weakest_within
from dogshape.pipeline.store.folder import require_targets


def record_of(one: NamedDesign) -> tuple[Row, list[Row]]:
    """Record a design and its checks; a dog that was not searched is simulated as by ``check``."""
    if one.result is not None and one.row is not None:
        record = searched_record(one.study, one.result, one.row)
        return record, searched_checks(one.own_study, one.result, one.row)
    found = check_design(one.study)
    expected = found.expected
    record = design_record(
        one.study,
        one.study.prototype,
        {check.name: check.margin for check in found.design.checks},
        weakest_within(one.study, found.design),
        expected_shift_time_s=None if expected is None else expected.time,
        standard_error_s=None if expected is None else expected.error,
        engaged=None if found.quick is None else found.quick.engaged,
        source=found.refusal or "compiled engine",
        engine="planar",
    )
    return record, found.record["checks"]


def write_data_sheet(one: NamedDesign, path: str | Path, why: str = "") -> Path:
    """Write the data sheet of a design: a page for A4, or JSON where the path ends in ``.json``.

    ``why`` is the reason of a decision for it.
    """
    require_targets({"the data sheet": Path(path)})
    write_sheet(one, *record_of(one), why.strip(), Path(path))
    return Path(path)
