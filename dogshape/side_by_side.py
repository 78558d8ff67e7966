"""Designs, studies or contact sets side by side: a frame with a column for each."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.data_sheet import record_of
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.study.design_record import difference
from dogshape.pipeline.reports.study.named_design import named_design
from dogshape.pipeline.store.folder import comparable
from dogshape.result import Result, ms
from dogshape.sim.errors import InputError
from dogshape.sim.shift.contact import CONTACT_SETS, ContactSet

if TYPE_CHECKING:
    import pandas as pd

#: Tables of a study file that shifts do not depend on, or that the dog itself is.
APART = ("name", "format", "dog", "variables", "search", "surrogate", "expectation")
PARAMETERS = (
    "static_friction", "dynamic_friction", "stiction_velocity", "stiffness", "dissipation",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class SideBySide(Result):
    """Items side by side; the first is what the others are compared with.

    Parameters
    ----------
    kind : ``designs`` or ``contact_sets``.
    items : a record for each, keys with their units.
    """

    kind: str
    items: tuple[dict[str, Any], ...]

    @property
    def facts(self) -> dict[str, str]:
        """Items with their times, where they have one."""
        return {
            item["label"]: ms(item.get("expected_shift_time_s"), item.get("standard_error_s"))
            for item in self.items
        }

    def to_dict(self) -> dict[str, Any]:
        """Give the kind and the items."""
        return {"kind": self.kind, "items": list(self.items)}

    def to_frame(self) -> pd.DataFrame:
        """Give a column for each item and a row for each quantity, dotted where keys are nested."""
        import pandas as pd  # noqa: PLC0415  # half a second that other results do not need

        return pd.DataFrame([_flat(item) for item in self.items]).set_index("label").T


def compare(*names: str) -> SideBySide:
    """Compare designs, studies, folders of results, or contact sets.

    Of a design that was not simulated the time is that of ``check``. ``settings`` of an item are
    the keys of the study files that differ between the items, beside dog and search.

    Parameters
    ----------
    names : such as ``"results/mq200#43"``, ``"mq200"``, ``"results/mine"`` or
        ``"lubricated_steel"``; the first is what the others are compared with.

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
    sets = _contact_sets(names)
    if sets:
        items = [{key: getattr(one, key) for key in ("name", *PARAMETERS)} for one in sets]
        found = tuple({"label": item.pop("name"), **item} for item in items)
        return SideBySide("contact_sets", found)
    designs = [named_design(name) for name in names]
    records = [record_of(one)[0] for one in designs]
    settings = _differing([one.study for one in designs])
    items = []
    for one, record, given in zip(designs, records, settings, strict=True):
        alike = one is not designs[0] and one.study.points == designs[0].study.points
        value, error = (difference(records[0], record) if alike else None) or (None, None)
        margins = record.pop("margins")
        items.append({
            "label": one.label, **record, "difference_s": value,
            "difference_standard_error_s": error, "settings": given, "margins": margins,
        })  # fmt: skip
    return SideBySide("designs", tuple(items))


def _contact_sets(names: Sequence[str]) -> list[ContactSet]:
    """Return the contact sets of the names; empty where none of them is one."""
    sets = [name for name in names if name in CONTACT_SETS and not Path(name).exists()]
    others = [name for name in names if name not in sets]
    if sets and others:
        raise InputError(
            f"'{sets[0]}' is a contact set and '{others[0]}' is none, so that they have nothing to "
            "compare; give contact sets alone, or designs and studies alone"
        )
    return [CONTACT_SETS[name] for name in sets]


def _differing(studies: Sequence[Setup]) -> list[dict[str, Any]]:
    """Select the dotted keys of study files that differ, with the value of each study."""
    files = [comparable(study.file) for study in studies]
    flat = [_flat({k: v for k, v in file.items() if k not in APART}) for file in files]
    keys = dict.fromkeys(key for one in flat for key in one)
    values = {key: [one.get(key) for one in flat] for key in keys}
    unlike = [k for k, every in values.items() if len(set(map(json.dumps, every))) > 1]
    return [{key: values[key][index] for key in unlike} for index in range(len(studies))]


def _flat(record: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested records as one, keys joined by dots."""
    found: dict[str, Any] = {}
    for key, value in record.items():
        inner = _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else None
        found |= {f"{prefix}{key}": value} if inner is None else inner
    return found
