"""Replication in the report: more relative angles where a place on the front was unclear."""

from __future__ import annotations

from dataclasses import dataclass

from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.kit.text import percent
from dogshape.pipeline.reports.study.designs import failed_at_new_angles
from dogshape.pipeline.reports.study.goals import Goal, goals_of


@dataclass(frozen=True)
class Replicated:
    """A design before and after replication, in words."""

    trial: int
    shifts: str
    interval: str
    probability: str
    on_front: str


def replicated_words(result: Row) -> str:
    """Summarise the shifts and the result of replication; empty without any."""
    done = result.get("replication")
    if not done:
        return ""
    before, after = len(done["unclear_before"]), len(done["unclear"])
    keys = ("shifts", "compiled_shifts")
    more = sum(
        any(one.get(key, 0) > one.get(f"{key}_before", 0) for key in keys)
        for one in done["designs"]
    )
    if not before:
        return "No place on the front was unclear after the search, so nothing was replicated."
    left = "none is" if not after else "1 is" if after == 1 else f"{after} are"
    return (
        f"After the search it was unclear of {_designs(before)} whether they are on the front "
        f"(probability between 5 and 95 %). Replication gave {_designs(more)} more relative "
        f"angles, {_spent(done)}; {left} unclear now. "
        "Designs expected to be wrongly on the front or wrongly off it: "
        f"{done['misplaced_before']:.1f} before, {done['misplaced']:.1f} now."
    )


def _spent(done: Row) -> str:
    compiled = done.get("compiled_shifts")
    if compiled is None:
        return f"{done['shifts']} shifts of at most {done['budget_shifts']}"
    return (
        f"{done['shifts']} shifts of Drake and {compiled} compiled ones, which count 1/25 of the "
        f"{done['budget_shifts']} at most"
    )


def _designs(count: int) -> str:
    return "1 design" if count == 1 else f"{count} designs"


def replicated_rows(result: Row) -> list[Replicated]:
    """List the designs of the front, before or after, and others that were replicated."""
    done, lead = result.get("replication"), goals_of(result).leading
    if not done or not (done["shifts"] or done.get("compiled_shifts")):
        return []
    failed = {row["trial"] for row in failed_at_new_angles(result)}
    return [
        Replicated(
            one["trial"],
            _counts(one),
            _both(_interval(lead, one, "_before"), _interval(lead, one, "")),
            _both(_chance(one, "_before"), _chance(one, "")),
            _both(*("yes" if one[key] else "no" for key in ("on_front_before", "on_front")))
            + (", then failed at the new angles" if one["trial"] in failed else ""),
        )
        for one in done["designs"]
    ]


def _counts(one: Row) -> str:
    """Count a design's shifts before and after, in two levels the compiled ones too."""
    own = _both(f"{one['shifts_before']}", f"{one['shifts']}")
    if "compiled_shifts" not in one:
        return own
    before, after = one["compiled_shifts_before"], one["compiled_shifts"]
    return f"{own}; compiled {_both(f'{before}', f'{after}')}"


def _both(before: str, after: str) -> str:
    return before if before == after else f"{before} → {after}"


def _interval(lead: Goal, one: Row, when: str) -> str:
    low, high = one[f"low{when}"], one[f"high{when}"]
    if low is None:
        return "fails when simulated"
    return f"{lead.number(lead.factor * low)} to {lead.number(lead.factor * high)}"


def _chance(one: Row, when: str) -> str:
    chance = one[f"probability_on_front{when}"]
    return "none" if chance is None else percent(chance)
