"""Designs by their names: data sheet, and frames of several side by side."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from markupsafe import Markup

from dogshape.check import check_design
from dogshape.pipeline.record import Figure, Frame, Table, frame_of, percent
from dogshape.pipeline.reports.data_sheet import TIME, flat_keys, words_of, write_sheet
from dogshape.pipeline.reports.design_record import (
    DesignSheet,
    SimulatedValues,
    WeakestCheck,
    design_sheet,
    searched_checks,
    searched_sheet,
    time_difference,
)
from dogshape.pipeline.reports.named_design import NamedDesign, named_design
from dogshape.pipeline.reports.text import axis, check_name, minus, ms_with_error
from dogshape.pipeline.store.check_records import CheckRow, VerdictRow
from dogshape.pipeline.store.folder import comparable, require_targets
from dogshape.pipeline.store.result_records import hang_keys
from dogshape.result import Result
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import CONTACT_SETS, IMPACT_LAYER, ContactSet
from dogshape.sim.strength.manufacture import Kind


def sheet_of(design: NamedDesign) -> tuple[DesignSheet, list[CheckRow]]:
    """Record a design and its checks; a dog that was not searched is simulated as by ``check``."""
    study = design.study
    if design.result is not None and design.row is not None:
        sheet = searched_sheet(study, design.result, design.row)
        return sheet, searched_checks(design.design_study, design.result, design.row)
    check = check_design(study)
    expected = check.expected
    simulated = SimulatedValues(
        expected_shift_time_s=None if expected is None else expected.time,
        standard_error_s=None if expected is None else expected.error,
        **(check.hangs or hang_keys(None)).to_dict(),
        source=check.refusal or "compiled engine",
        engaged=check.engaged if check.shifts else None,
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


#: Tables of a study file that are not compared: the dog itself, and those without effect on shifts.
UNCOMPARED_TABLES = ("name", "format", "dog", "variables", "search", "surrogate", "expectation")


@dataclass(frozen=True)
class ComparedDesign:
    """A compared design with its values as printed."""

    design: NamedDesign
    sheet: DesignSheet
    difference: str  #: ms, time less that of the first design; a dash if unknown
    settings: Mapping[str, Any]  #: keys of the study files that differ

    def groups(self) -> dict[str, dict[str, str]]:
        """Print dog, answers, margins and differing settings by name with unit."""
        sheet = self.sheet
        words = words_of(sheet)
        del words["state"]  # the verdict has it
        answers = {
            "verdict": words.pop("verdict"),
            TIME: words.pop(TIME),
            "less that of the first, ms": self.difference,
            **words,
            "engine": sheet.engine,
            "operating points": str(sheet.operating_points),
        }
        return {
            "dog": {axis(name): _cell(size) for name, size in sheet.dog.items()},
            "answers": answers,
            "margins": {check_name(name): _margin(value) for name, value in sheet.margins.items()},
            "keys of the study files that differ": {
                key: _cell(value) for key, value in self.settings.items()
            },
        }


@dataclass(frozen=True, repr=False)
class SideBySide(Result):
    """Compared items; differences are to the first one.

    ``kind`` is ``designs`` or ``contact_sets``, ``items`` a record for each, keys with their units.
    """

    kind: str
    items: tuple[dict[str, Any], ...]
    designs: tuple[ComparedDesign, ...] = ()  #: of the kind ``designs``

    def to_parts(self) -> list[str | Table]:
        """Tabulate the items, a column each, with the quantities that any of them has."""
        heads = ["", *(item["label"] for item in self.items)]
        text_columns = range(1, len(heads))
        if not self.designs:
            return [Table(heads, _rows_of([*map(_contact_cells, self.items)]), words=text_columns)]
        groups = [design.groups() for design in self.designs]
        rows: list[list[str]] = []
        looks = {}
        for title in groups[0]:
            group_rows = _rows_of([group[title] for group in groups])
            if group_rows:
                looks[len(rows)] = "group"
                rows += [[title], *group_rows]
        return [Table(heads, rows, looks, text_columns)]

    def to_dict(self) -> dict[str, Any]:
        """Convert kind and items to values of JSON."""
        return {"kind": self.kind, "items": list(self.items)}

    def plot(self) -> Figure:
        """Draw the expected shift times of designs, or contact sets over the first of them."""
        from dogshape.pipeline.reports import result_figures  # noqa: PLC0415

        labels = [item["label"] for item in self.items]
        if self.kind == "designs":
            times = [item.get("expected_shift_time_s") for item in self.items]
            errors = [item.get("standard_error_s") for item in self.items]
            return result_figures.times_figure(labels, times, errors)
        numbers = [
            {key: value for key, value in flat_keys(item).items() if isinstance(value, int | float)}
            for item in self.items
        ]
        return result_figures.ratios_figure(dict(zip(labels, numbers, strict=True)))

    def _picture(self) -> Markup | None:
        """Draw the section of each design over the dashed dogs of the first one."""
        from dogshape.pipeline.export.drawing import open_section_svg  # noqa: PLC0415

        if not self.designs:
            return None
        first = self.designs[0].design
        figures = []
        for compared in self.designs:
            study = compared.design.design_study
            svg = open_section_svg(
                study.clutch.pair,
                first.design_study.clutch.pair,
                first.label,
                is_sleeve=study.limits.sleeve is not None,
            )
            figure = Markup("<figure>{}<figcaption>{}</figcaption></figure>")
            figures.append(figure.format(Markup(svg), compared.design.label))
        return Markup('<div class="pictures">{}</div>').format(Markup("").join(figures))

    def to_frame(self) -> Frame:
        """Tabulate the items, a column each; nested quantities have dotted keys."""
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
        items = tuple(_contact_record(CONTACT_SETS[name]) for name in sets)
        return SideBySide("contact_sets", items)
    designs, records = _compare_designs(names)
    return SideBySide("designs", tuple(records), tuple(designs))


def _contact_record(contact: ContactSet) -> dict[str, Any]:
    """Record a contact set; an impact law stands for the keys of its layer, which are None."""
    values = dict(vars(contact))
    law = values.pop("impact")
    if law is not None:
        values.update(dict.fromkeys(dict(IMPACT_LAYER)))
        values["impact"] = vars(law)
    return {"label": values.pop("name"), **values}


def _compare_designs(names: Sequence[str]) -> tuple[list[ComparedDesign], list[dict[str, Any]]]:
    """Compare designs with the first one, and record times, margins and differing settings."""
    designs = [named_design(name) for name in names]
    sheets = [sheet_of(design)[0] for design in designs]
    settings = [_compared_settings(design) for design in designs]
    differing = [
        key
        for key in dict.fromkeys(chain.from_iterable(settings))
        if len({json.dumps(keys.get(key)) for keys in settings}) > 1
    ]
    compared = []
    items = []
    for design, sheet, keys in zip(designs, sheets, settings, strict=True):
        change = None
        if design is not designs[0] and design.study.points == designs[0].study.points:
            change = time_difference(sheets[0].simulated, sheet.simulated)
        value, error = change or (None, None)
        different_keys = {key: keys.get(key) for key in differing}
        difference = ms_with_error(value, error, "+")
        compared.append(ComparedDesign(design, sheet, difference, different_keys))
        record = sheet.to_dict()
        margins = record.pop("margins")
        items.append(
            {
                "label": design.label,
                **record,
                "difference_s": value,
                "difference_standard_error_s": error,
                "settings": different_keys,
                "margins": margins,
            }
        )
    return compared, items


def _compared_settings(design: NamedDesign) -> dict[str, Any]:
    """Flatten the tables of a study file that comparisons list."""
    tables = comparable(design.study.file)
    return flat_keys({key: v for key, v in tables.items() if key not in UNCOMPARED_TABLES})


def _rows_of(columns: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """List the quantities that any column has, a cell for each column."""
    rows = []
    for name in dict.fromkeys(chain.from_iterable(columns)):
        cells = [column.get(name, "-") for column in columns]
        if set(cells) != {"-"}:
            rows.append([name, *cells])
    return rows


def _contact_cells(item: Mapping[str, Any]) -> dict[str, str]:
    """Print the values of a contact set by key."""
    return {key: _cell(value) for key, value in flat_keys(item).items() if key != "label"}


def _margin(margin: float | None) -> str:
    """Print a margin; one without a limit as infinite."""
    return "infinite" if margin is None else percent(margin)


def _cell(value: Any) -> str:
    """Print a value of a key; None as a dash."""
    if isinstance(value, float):
        return minus(f"{value:.4g}")
    return "-" if value is None else str(value)
