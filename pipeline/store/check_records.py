"""Records of checks and verdicts, and their tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from dogshape.pipeline.record import (
    SHARE,
    Bad,
    FileRecord,
    Record,
    Table,
    number_or_none,
    percent,
    tabulate,
)
from dogshape.sim.clutch_tables import key
from dogshape.sim.strength.checks import GROUPS, RULES, LimitCheck, references_of, safety_factor
from dogshape.sim.strength.landing import LandingLoad
from dogshape.sim.strength.verdict import STANDARD, AssumedValue, HangShare, State, Verdict
from dogshape.sim.units import MM, short

#: Tables of a study file whose assumed values are listed, the most influential first.
LISTED_TABLES = ("actuation", "operating", "drive", "contact", "load", "material")


class CheckRow(FileRecord):
    """A check of a design against its limit."""

    name: str = key("name of the check", head="check")
    value: float | None = key("checked value, in `unit`; null where infinite", head="value")
    limit: float | None = key("limit, in `unit`; null where nothing is judged", head="limit")
    unit: str = key("unit of value and limit", head="unit")
    margin: float | None = key(
        "distance to the limit over the limit; at least 0 passes", "1", head="margin"
    )
    passed: bool | None = key("whether `margin` is at least 0; null: not judged", head="passed")
    group: str = key("kind of check: `make`, `load`, `lock`, `impact` or `tolerance`")
    at_most: bool = key("whether the limit is an upper one")
    meaning: str = key("what is checked", head="meaning")
    formula: str = key("formula of the value", head="formula")
    source: str = key("source of the limit", head="source")
    limit_key: str = key("key of the study file that sets the limit", head="limit set by")
    margin_worst_case: float | None = key(
        "margin at worst-case tolerances; null without any or a dog", "1", None, head="worst case"
    )
    margin_root_sum_square: float | None = key(
        "margin by root sum of squares of the tolerances, at the reject rate",
        "1",
        None,
        head="rss",
    )
    margin_interval: list[float] | None = key(
        "ends of the 95 % interval of the margin; absent where it is exact", "1", None, head="95 %"
    )
    ends: str | None = key(
        "ends of ranges at which the margin is smallest; absent without ranges", "", None
    )
    ring: str | None = key(
        "ring with the smaller margin; absent of equal rings", "", None, head="ring"
    )
    safety: float | None = key(
        "safety factor, upper limit of a stress or force over its value; null for other checks",
        "1",
        None,
        head="S",
        form=".2f",
    )

    @classmethod
    def of(cls, check: LimitCheck) -> CheckRow:
        """Record a check at nominal size."""
        rule = check.rule
        optional: dict[str, Any] = {}
        if check.margin_interval is not None:
            optional["margin_interval"] = list(check.margin_interval)
        if check.ends:
            optional["ends"] = check.ends
        if check.ring:
            optional["ring"] = check.ring
        return cls(
            name=check.name,
            value=number_or_none(check.value),
            limit=check.limit,
            unit=rule.unit,
            margin=number_or_none(check.margin),
            passed=check.passed,
            group=rule.group,
            at_most=rule.at_most,
            meaning=rule.meaning,
            formula=rule.formula,
            source=rule.source,
            limit_key=rule.key,
            **optional,
            safety=safety_factor(rule, check.margin),
        )

    @property
    def unclear(self) -> bool:
        """Whether the interval of the margin holds zero."""
        low, high = self.margin_interval or (0.0, 0.0)
        return low < 0.0 <= high

    @property
    def references(self) -> str:
        """Standards and authors of the source, of a check without one those of its rule."""
        if not self.source and self.name in RULES:
            return RULES[self.name].references
        return references_of(self.source or "")

    def within(self, worst_case: float | None, root_sum_square: float | None) -> CheckRow:
        """Add the margins within the tolerances."""
        margins: dict[str, Any] = {
            "margin_worst_case": worst_case,
            "margin_root_sum_square": root_sum_square,
        }
        return CheckRow(**self.to_dict(), **margins)

    def cell(self, name: str) -> str:
        """Print a value, the limit with its sense; a failure or an unclear margin as ``Bad``."""
        if name == "margin_interval":
            return " to ".join(map(percent, self.margin_interval or ())) or "-"
        if self.passed is None:
            return self._unjudged_cell(name)
        value = getattr(self, name)
        if "margin" in name and value is not None:
            return Bad(percent(value)) if value < 0.0 else percent(value)
        text = super().cell(name)
        if name == "limit":
            text = f"{'≤' if self.at_most else '≥'} {text}"
        elif name == "passed" and (self.unclear or not value):
            text = Bad("not clear" if self.unclear else "NO")
        return text

    def _unjudged_cell(self, name: str) -> str:
        """Print a value of a check without a verdict, or a dash."""
        if name == "margin":
            return Bad("not judged")
        if name in ("name", "limit_key", "meaning"):
            return str(getattr(self, name))
        return "-"


def check_table(rows: Sequence[CheckRow], *names: str) -> Table:
    """Tabulate checks by group.

    By default with value, limit, safety factor, margins and the references of the sources.
    """
    columns = names or _check_columns(rows)
    has_references = not names
    cells = list[Sequence[str]]()
    looks = dict[int, str]()
    for group, title in GROUPS.items():
        members = [row for row in rows if row.group == group]
        if members:
            looks[len(cells)] = "group"
            cells.append([title])
            lines = tabulate(CheckRow, members, *columns).rows
            if has_references:
                lines = [
                    [*line, row.references or "-"] for line, row in zip(lines, members, strict=True)
                ]
            cells += lines
    text_columns = ("unit", "meaning", "formula", "source")
    heads = tabulate(CheckRow, (), *columns).heads
    words = _places(columns, text_columns)
    if has_references:
        words.append(len(heads))
        heads = [*heads, "follows"]
    return Table(heads, cells, looks, words)


def _places(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """List the places of wanted names."""
    return [index for index, name in enumerate(names) if name in wanted]


def _check_columns(rows: Sequence[CheckRow]) -> tuple[str, ...]:
    """List the default columns of checks; intervals and rings only where a check has one."""
    values = ("name", "value", "limit", "unit", "safety", "margin")
    interval = ("margin_interval",) if any(row.margin_interval for row in rows) else ()
    ring = ("ring",) if any(row.ring for row in rows) else ()
    return (*values, *interval, "margin_root_sum_square", "margin_worst_case", "passed", *ring)


class HingeRow(Record):
    """An assumption that decides a verdict, with its effect on the smallest margin."""

    assumption: str = key("key of the study file", head="assumption")
    value: int | float = key("its value, in `unit`", head="value")
    range: list[float] = key("ends of its range, in `unit`", head="range")
    unit: str = key("unit of value and range", head="unit")
    source: str = key("source of the range", head="source of the range")
    status: str = key("`standard`, `estimate` or `assumption`", head="status")
    smallest_margin: list[float] = key(
        "smallest margin at either end of the range", "1", head="smallest margin"
    )
    weakest_check: list[str] = key("check with that margin at either end", head="check")
    flips: bool = key("whether the smallest margin changes its sign", head="flips")

    def cell(self, name: str) -> str:
        """Print a value, the ends of a range in one cell; margins below zero as ``Bad``."""
        if name == "range":
            return f"{' to '.join(map(short, self.range))} {self.unit}".rstrip()
        if name == "smallest_margin":
            text = " to ".join(map(percent, self.smallest_margin))
            return Bad(text) if min(self.smallest_margin) < 0.0 else text
        if name == "weakest_check":
            checks = (check.replace("_", " ") for check in self.weakest_check)
            return " to ".join(dict.fromkeys(checks))  # in the order of the margins
        return super().cell(name)


class LandingRow(Record):
    """Landing, dog on dog, that decides a check."""

    check: str = key("check with the smallest margin of a landing")
    overlap_mm: float = key("overlap of the faces, middle of its class", "mm")
    force_per_dog_N: float = key("force on the most loaded of elastic dogs", "N")
    simulated_force_per_dog_N: float = key("force on each dog in the softer simulated layer", "N")

    @classmethod
    def of(cls, load: LandingLoad) -> LandingRow:
        """Record the load of a landing."""
        return cls(
            check=load.check,
            overlap_mm=load.overlap / MM,
            force_per_dog_N=load.force,
            simulated_force_per_dog_N=load.simulated_force,
        )

    @property
    def text(self) -> str:
        """Force and overlap in words."""
        return f"{self.force_per_dog_N:.0f} N on the worst dog, overlap {self.overlap_mm:.2g} mm"


class NotJudged(Record):
    """A standard check that nobody judged."""

    check: str = key("name of the check")
    key: str = key("key of the study file that judges it")


def not_judged_row(missing: NotJudged) -> CheckRow:
    """Return the row of a standard check that nobody judged, with the key that judges it."""
    standard = next(standard for standard in STANDARD if standard.name == missing.check)
    return CheckRow(
        name=missing.check,
        value=None,
        limit=None,
        unit="",
        margin=None,
        passed=None,
        group=RULES[standard.rules[0]].group,
        at_most=True,
        meaning=standard.reason,
        formula="",
        source="",
        limit_key=missing.key,
    )


class AssumedRow(Record):
    """A value of the study file that nobody gave for its clutch."""

    value: Any = key("value in the unit of the key; null: the default of an absent key")
    source: str = key("origin of the value")
    key: str = key("key of the study file")


class AssumedGroup(NamedTuple):
    """Assumed values of one table of a study file and one source."""

    table: str
    source: str
    values: str  #: in words


def assumed_groups(rows: Iterable[AssumedValue | AssumedRow]) -> list[AssumedGroup]:
    """Group assumed values by table and source; of other tables than listed ones count them."""
    texts = dict[tuple[str, str], list[str]]()
    counts = Counter[str]()
    for row in rows:
        table, _, name = row.key.partition(".")
        if table in LISTED_TABLES:
            texts.setdefault((table, row.source), []).append(_assumed_text(name, row.value))
        else:
            counts[table] += 1
    groups = [
        AssumedGroup(table, source, ", ".join(values)) for (table, source), values in texts.items()
    ]
    groups.sort(key=lambda group: LISTED_TABLES.index(group.table))
    if counts:
        numbers = ", ".join(f"{count} of {table}" for table, count in counts.items())
        words = f"{counts.total()} more, listed in [assumed] of the study file: {numbers}"
        groups.append(AssumedGroup("other tables", "", words))
    return groups


def _assumed_text(name: str, value: Any) -> str:
    """Print a key without its table, and its value; an absent key has none."""
    from dogshape.pipeline.config.toml_text import toml_value  # noqa: PLC0415  loads tomlkit

    if value is None:
        return name
    return f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {toml_value(value)}"


def assumed_table(rows: Sequence[AssumedRow]) -> Table:
    """Tabulate assumed values by table and source."""
    return Table(("table", "source", "not given"), assumed_groups(rows), words=(1, 2))


class HangRow(Record):
    """Share of shifts that hang at the operating point where most do, with its limits."""

    share: float = key("posterior mean", SHARE)
    low: float = key("lower end of its 95 % interval", SHARE)
    high: float = key("upper end", SHARE)
    warning_share: float = key("share above which the verdict warns", SHARE)
    max_share: float = key("share above which `engagement` fails", SHARE)

    @property
    def text(self) -> str:
        """Share with both limits in words."""
        return HangShare(**self.to_dict()).limits_text


class VerdictRow(Record):
    """Verdict on a design (`docs/strength.md`)."""

    state: State = key("`passes`, `fails`, `not_judged` or `not_clear`")
    line: str = key("the verdict in a sentence")
    failed: list[str] = key("checks with a negative margin")
    not_clear: list[str] = key("checks whose interval of 95 % holds the limit")
    not_judged: list[NotJudged] = key("standard checks that nobody judged")
    hangs_on: list[HingeRow] = key("assumptions with an effect, the strongest first")
    assumed: list[AssumedRow] | None = key("values that nobody gave", late=True)
    hangs: HangRow | None = key("shifts that hang; null without simulated shifts", late=True)

    @classmethod
    def of(cls, verdict: Verdict) -> VerdictRow:
        """Record a verdict."""
        return cls(**verdict.to_dict())

    @property
    def passes(self) -> bool:
        """Whether every standard check is judged and clearly passes."""
        return self.state == "passes"


def hinge_table(rows: Sequence[HingeRow], *names: str) -> Table:
    """Tabulate the assumptions of a verdict, the strongest first; by default with their sources."""
    names = names or (
        "assumption",
        "value",
        "range",
        "smallest_margin",
        "weakest_check",
        "flips",
        "status",
        "source",
    )
    text_columns = ("weakest_check", "status", "source")
    note = (
        "Smallest margin at either end of the range of an assumption, the others as given, by the "
        "closed forms; landings scale with the root of the contact's stiffness."
    )
    table = tabulate(HingeRow, rows, *names)
    return replace(table, words=_places(names, text_columns), note=note)
