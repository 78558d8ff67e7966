"""Designs, studies and contact sets side by side."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from dogshape.designs import sheet_of
from dogshape.pipeline.record import Figure, Frame, Table, frame_of, percent
from dogshape.pipeline.reports.data_sheet import TIME, flat_keys, words_of
from dogshape.pipeline.reports.design_record import DesignSheet, time_difference
from dogshape.pipeline.reports.named_design import NamedDesign, named_design
from dogshape.pipeline.reports.text import axis, check_name, minus, ms_with_error
from dogshape.pipeline.store.folder import comparable
from dogshape.result import Result
from dogshape.sim.errors import InputError
from dogshape.sim.shift.clutch import CONTACT_SETS, IMPACT_LAYER, ContactSet

if TYPE_CHECKING:
    from dogshape.study import Study

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


def compare(*items: str | Study) -> SideBySide:
    """Compare designs, studies, folders of results, or contact sets with the first of them.

    Example: ``ds.compare(study, study.replace_keys(height_mm=4), "results/mine#12")``

    ``items`` are studies or names such as ``"results/mq200#43"``, ``"mq200"``, ``"results/mine"``
    or ``"lubricated_steel"``. Of a design that was not simulated the time is that of ``check``.
    ``settings`` of an item are the keys of the study files that differ, beside dog and search.
    InputError for fewer than two items, unknown names, or contact sets beside others.
    """
    if len(items) < 2:
        remedy = "name for instance mq200#19 and mq200#43"
        raise InputError(f"compare is given {len(items)} item, but it needs two or more; {remedy}")
    names = [item for item in items if isinstance(item, str)]
    sets = [name for name in names if name in CONTACT_SETS and not Path(name).exists()]
    if not sets:
        designs, records = _compare_designs(_named_designs(items))
        return SideBySide("designs", tuple(records), tuple(designs))
    others = [item for item in items if item not in sets]
    if others:
        other = others[0] if isinstance(others[0], str) else others[0].name
        raise InputError(
            f"'{sets[0]}' is a contact set and '{other}' is none, so that they have nothing to "
            "compare; give contact sets alone, or designs and studies alone"
        )
    contact_items = tuple(_contact_record(CONTACT_SETS[name]) for name in sets)
    return SideBySide("contact_sets", contact_items)


def _named_designs(items: Sequence[str | Study]) -> list[NamedDesign]:
    """Resolve names and studies to designs; studies of one name get a number from the second on."""
    designs: list[NamedDesign] = []
    counts: Counter[str] = Counter()
    for item in items:
        if isinstance(item, str):
            designs.append(named_design(item))
            counts[item] += 1
            continue
        counts[item.name] += 1
        count = counts[item.name]
        label = item.name if count == 1 else f"{item.name} ({count})"
        designs.append(NamedDesign(label, item.config))
    return designs


def _contact_record(contact: ContactSet) -> dict[str, Any]:
    """Record a contact set; an impact law stands for the keys of its layer, which are None."""
    values = dict(vars(contact))
    law = values.pop("impact")
    if law is not None:
        values.update(dict.fromkeys(dict(IMPACT_LAYER)))
        values["impact"] = vars(law)
    return {"label": values.pop("name"), **values}


def _compare_designs(
    designs: Sequence[NamedDesign],
) -> tuple[list[ComparedDesign], list[dict[str, Any]]]:
    """Compare designs with the first one, and record times, margins and differing settings."""
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
