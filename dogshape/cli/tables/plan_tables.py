"""A plan of shifts in tables."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table

from dogshape.cli.console import columns
from dogshape.plan import Plan
from dogshape.sim.errors import number
from dogshape.sim.units import RPM

SHOWN = 4  #: rivals in a row


def plan_table(found: Plan) -> RenderableType:
    """Return a plan for the console."""
    plan = found.inference
    total, cells = sum(plan.shifts), plan.field.cells
    used = sum(n > 0 for n in plan.shifts)
    shares = f"{found.told_apart:.0%} of pairs and strengths distinguished"
    evenly = found.to_dict()["all_points"]
    return Group(
        _order(found),
        "",
        _causes(found),
        "",
        f"{total} shifts at {used} of {cells} operating points, about {number(plan.hours)} h: "
        f"chance to decide a pair of causes rightly {plan.worth:.1%}, {shares}",
        f"as many spread evenly over all {cells}, about {number(plan.hours_evenly)} h: "
        f"{plan.evenly:.1%}, {evenly['told_apart']:.0%}",
        "distinguished: expected odds of 4.5 : 1 and more for the true cause, over the strengths "
        "of the priors. Combinations of effects are not planned for.",
        *([f"table to fill in: {found.sheet}"] if found.sheet else []),
    )


def _order(found: Plan) -> Table:
    plan = found.inference
    table = columns("visit", "mismatch, 1/min", "force, N", "shifts", "")
    for k, (place, count) in enumerate(plan.order, start=1):
        point = found.bench.cells[place].point
        again = "reference" if place == plan.reference else ""
        row = f"{k}", number(point.mismatch / RPM), number(point.profile.force), f"{count}"
        table.add_row(*row, again)
    return table


def _causes(found: Plan) -> Table:
    effects = found.inference.field.hypotheses
    table = columns(
        "true cause", "seen", "rivals distinguished", "not distinguished in most strengths"
    )
    for place, hypothesis in enumerate(effects):
        if not hypothesis:
            continue
        seen, apart, left = found.unlike(place)
        names = ", ".join(effects[k][0] for k in left[:SHOWN])
        more = f" and {len(left) - SHOWN} more" if len(left) > SHOWN else ""
        whole = f"{len(apart)} of {len(apart) + len(left)}"
        table.add_row(hypothesis[0], f"{seen:.0%}", whole, f"{names}{more}" or "-")
    return table
