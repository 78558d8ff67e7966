"""Every check of a design with its margins."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.cli.console import columns
from dogshape.pipeline.simulate.design import KINDS, Within
from dogshape.sim.strength.checks import GROUPS, Check, feasible, smallest_margin
from dogshape.sim.strength.dog_strength import UNJUDGED


def strength_table(
    checks: Sequence[Check],
    within: Within,
    held: float,
    notes: Sequence[str] = (),
    *,
    explain: bool = False,
    said: Sequence[str] = (),
) -> RenderableType:
    """Return every check with value, limit and margins, by group.

    ``within`` has the margins left within the tolerances by the check's name, ``held`` is
    what the blocking mechanism has to hold, N; ``notes`` are warnings; ``said`` is what
    else there is to say of the loads.
    """
    table = columns("check", "value", "", "limit", "unit", "margin", "worst case", "rss", "passed")
    for group, title in GROUPS.items():
        members = [c for c in checks if c.rule.group == group]
        if members:
            table.add_row(title, style="bold")
        for c in members:
            left = within.get(c.name, {})
            table.add_row(
                "  " + c.name,
                f"{c.value:.4g}",
                "<=" if c.rule.at_most else ">=",
                f"{c.limit:.4g}",
                c.unit,
                percentage(c.margin),
                *(percentage(left[k]) if k in left else "-" for k in KINDS),
                "yes" if c.passed else "NO",
            )
    weakest = smallest_margin(checks)
    verdict = "feasible" if feasible(checks) else "not feasible"
    if not any(c.rule.group == "impact" for c in checks):
        verdict += " before its landing, dog on dog, is simulated"
    lines = [
        "",
        "margin: distance to the limit over the limit, at nominal size, with every tolerance at "
        "its worst, and by root sum of squares (no tolerances for the landing)",
        f"{verdict}; smallest margin {percentage(weakest.margin, 1)}, {weakest.name}",
        *_within_line(within),
        *(f"warning: {note}" for note in notes),
        f"the blocking mechanism has to hold {held:.0f} N",
        *said,
    ]
    told = [_rules_table(checks), *_unjudged(checks)] if explain else []
    return Group(table, *lines, *told)


def _unjudged(checks: Sequence[Check]) -> list[str]:
    """Return in words which checks the study leaves out, and the keys that they want."""
    made = {check.name for check in checks}
    return [
        f"not judged: {name}; give {keys}" for name, keys in UNJUDGED.items() if name not in made
    ]


def _within_line(within: Within) -> list[str]:
    """Return the smallest margin in the worst case, in words."""
    if not within:
        return []
    name = min(within, key=lambda n: within[n]["worst_case"])
    worst = percentage(within[name]["worst_case"], 1)
    return [f"at worst-case tolerances {worst}, {name}"]


def percentage(share: float, digits: int = 0) -> str:
    """Return a margin in percent; what is beyond -999 % says no more than that."""
    if math.isinf(share):
        return "no dog"
    return f"{max(share, -9.99):.{digits}%}"


def _rules_table(checks: Sequence[Check]) -> RenderableType:
    table = Table(box=None, pad_edge=False, header_style="bold", title_justify="left")
    for column in ("check", "meaning", "formula", "source", "limit set by"):
        table.add_column(column, overflow="fold")
    for rule in sorted((c.rule for c in checks), key=lambda r: list(GROUPS).index(r.group)):
        table.add_row(rule.name, rule.meaning, rule.formula, rule.source, rule.key)
    return table
