"""Designs by their names: data sheet, and frames of several side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dogshape.check import check_design
from dogshape.pipeline.record import Frame, Result, Table, frame_of
from dogshape.pipeline.reports.data_sheet import (
    NamedDesign,
    design_record,
    flat_keys,
    named_design,
    searched_checks,
    searched_record,
    time_difference,
    write_sheet,
)
from dogshape.pipeline.reports.designs import Row
from dogshape.pipeline.reports.text import minus
from dogshape.pipeline.simulate.design import KINDS, weakest_within
from dogshape.pipeline.store.folder import comparable, require_targets
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import CONTACT_SETS, IMPACT_LAYER


def record_of(one: NamedDesign) -> tuple[Row, list[Row]]:
    """Record a design and its checks; a dog that was not searched is simulated as by ``check``."""
    if one.result is not None and one.row is not None:
        record = searched_record(one.study, one.result, one.row)
        return record, searched_checks(one.design_study, one.result, one.row)
    found = check_design(one.study)
    expected = found.expected
    record = design_record(
        one.study,
        one.study.prototype,
        {check.name: check.margin for check in found.design.checks},
        {kind: weakest_within(one.study, found.design, kind) for kind in KINDS},
        found.verdict.to_dict(),
        expected_shift_time_s=None if expected is None else expected.time,
        standard_error_s=None if expected is None else expected.error,
        **found.hangs,
        engaged=found.engaged if found.shifts else None,
        source=found.refusal or "compiled engine",
        engine="planar",
    )
    return record, found.to_dict()["checks"]


def write_data_sheet(one: NamedDesign, path: str | Path, block: Mapping[str, str]) -> Path:
    """Write the data sheet of a design, A4 or by its ending JSON, with a ``write_sheet`` block."""
    require_targets({"the data sheet": Path(path)})
    write_sheet(one, *record_of(one), block, Path(path))
    return Path(path)


#: Tables of a study file that shifts do not depend on, or that the dog itself is.
APART = ("name", "format", "dog", "variables", "search", "surrogate", "expectation")


@dataclass(frozen=True, repr=False)
class SideBySide(Result):
    """Items side by side; the first is what the others are compared with.

    ``kind`` is ``designs`` or ``contact_sets``, ``items`` a record for each, keys with their units.
    """

    kind: str
    items: tuple[dict[str, Any], ...]

    def to_parts(self) -> list[str | Table]:
        """Give a column for each item, a row for each quantity that one of them has."""
        every = [flat_keys(item) for item in self.items]
        rows = [
            [key, *(_cell(item.get(key)) for item in every)]
            for key in dict.fromkeys(key for item in every for key in item)
            if key != "label" and any(item.get(key) is not None for item in every)
        ]
        return [Table(("", *(item["label"] for item in self.items)), rows)]

    def to_dict(self) -> dict[str, Any]:
        """Give the kind and the items."""
        return {"kind": self.kind, "items": list(self.items)}

    def to_frame(self) -> Frame:
        """Give a column for each item and a row for each quantity, dotted where keys are nested."""
        return frame_of([flat_keys(item) for item in self.items]).set_index("label").T


def compare(*names: str) -> SideBySide:
    """Compare designs, studies, folders of results, or contact sets with the first of them.

    Example: ``ds.compare("mq200#33", "results/mine#12")``

    ``names`` are such as ``"results/mq200#43"``, ``"mq200"``, ``"results/mine"`` or
    ``"lubricated_steel"``. Of a design that was not simulated the time is that of ``check``.
    ``settings`` of an item are the keys of the study files that differ, beside dog and search.
    InputError for fewer than two names, unknown ones, or contact sets beside others.
    """
    if len(names) < 2:
        remedy = "name for instance mq200#19 and mq200#43"
        raise InputError(f"compare is given {len(names)} item, but it needs two or more; {remedy}")
    sets = [name for name in names if name in CONTACT_SETS and not Path(name).exists()]
    others = [name for name in names if name not in sets]
    if sets and others:
        raise InputError(
            f"'{sets[0]}' is a contact set and '{others[0]}' is none, so that they have nothing to "
            "compare; give contact sets alone, or designs and studies alone"
        )
    if sets:
        found = []
        for contact in (CONTACT_SETS[name] for name in sets):
            own = dict(vars(contact))
            if (law := own.pop("impact")) is not None:  # in the place of its layer
                own |= {**dict.fromkeys(dict(IMPACT_LAYER)), "impact": vars(law)}
            found.append({"label": own.pop("name"), **own})
        return SideBySide("contact_sets", tuple(found))
    designs = [named_design(name) for name in names]
    records = [record_of(one)[0] for one in designs]
    files = [comparable(one.study.file) for one in designs]
    flat = [flat_keys({k: v for k, v in file.items() if k not in APART}) for file in files]
    keys = dict.fromkeys(key for one in flat for key in one)
    unlike = [k for k in keys if len({json.dumps(one.get(k)) for one in flat}) > 1]
    items = []
    for one, record, file in zip(designs, records, flat, strict=True):
        alike = one is not designs[0] and one.study.points == designs[0].study.points
        value, error = (time_difference(records[0], record) if alike else None) or (None, None)
        margins = record.pop("margins")
        items.append({
            "label": one.label, **record, "difference_s": value,
            "difference_standard_error_s": error, "settings": {k: file.get(k) for k in unlike},
            "margins": margins,
        })  # fmt: skip
    return SideBySide("designs", tuple(items))


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return minus(f"{value:.4g}")
    return "-" if value is None else str(value)
