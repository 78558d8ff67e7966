"""Tables of the report: every simulated design as CSV, and the margins in parts that fit a page."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

import pandas as pd

from dogshape.pipeline.reports.study.design_names import failed_afresh
from dogshape.pipeline.simulate.design import SIMULATED

Row = dict[str, Any]

BESIDE = 8  #: designs beside each other in a table of margins


def designs_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate every simulated design with all that is known of it, a row each."""
    simulated = [row for row in result["trials"] if row[SIMULATED] is not None]
    return _frame(result, variables, simulated)


def all_designs_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate every design of the search, those too that fail a check before a simulation."""
    return _frame(result, variables, result["trials"])


def front_frame(result: Row, variables: list[str]) -> pd.DataFrame:
    """Tabulate the front: variables, objectives with standard errors, place, smallest margin."""
    told = list(dict.fromkeys([*result["objectives"], SIMULATED]))
    ends = [f"{end}_of_{result['leading']}" for end in ("low", "high")]
    best = None if result["best"] is None else result["best"]["trial"]
    columns = [
        *("trial", "prototype", "chosen", *variables),
        *(name for one in told for name in (one, f"standard_error_of_{one}")),
        *(*ends, "probability_on_front", "smallest_margin", "weakest_check"),
    ]
    rows = [
        {
            **row,
            "chosen": row["trial"] == best,
            **{f"standard_error_of_{k}": error for k, error in row["standard_errors"].items()},
            **dict(zip(ends, (row.get("low"), row.get("high")), strict=True)),
        }
        for row in result["front"]
    ]
    exact = {f"standard_error_of_{one}" for one in told} - {name for r in rows for name in r}
    kept = [name for name in dict.fromkeys(columns) if name not in exact]
    return pd.DataFrame(rows, columns=kept)


def _frame(result: Row, variables: list[str], rows: list[Row]) -> pd.DataFrame:
    front = {row["trial"] for row in result["front"]}
    failed = {row["trial"] for row in failed_afresh(result)}
    best = None if result["best"] is None else result["best"]["trial"]
    return pd.DataFrame([_flat(row, variables, front, failed, best) for row in rows])


def _flat(
    row: Row, variables: list[str], front: set[int], failed: set[int], best: int | None
) -> Row:
    nested = ("margins", "failed", "time_within_tolerances", "standard_errors")
    plain = {k: v for k, v in row.items() if k not in (*nested, *variables, "trial", "prototype")}
    errors = {k: v for k, v in row["standard_errors"].items() if k != SIMULATED}
    within = row.get("time_within_tolerances") or {}
    return {
        "trial": row["trial"],
        "prototype": row["prototype"],
        "on_front": row["trial"] in front,
        "failed_at_fresh_angles": row["trial"] in failed,
        "chosen": row["trial"] == best,
        **{name: row[name] for name in variables},
        **{k: v for k, v in plain.items() if not isinstance(v, (dict, list))},
        **{f"standard_error_of_{name}": error for name, error in errors.items()},
        "failed": " ".join(row["failed"]),
        **{f"within_tolerances_{key}": v for key, v in within.items() if not isinstance(v, dict)},
        **{f"margin_of_{name}": margin for name, margin in row["margins"].items()},
    }


def csv_link(text: str) -> str:
    """Return a data URL that holds a table and needs no network."""
    return "data:text/csv;charset=utf-8," + quote(text)


def in_parts(rows: list[Row], size: int = BESIDE) -> list[list[Row]]:
    """Return rows in parts of nearly equal length, none longer than ``size``."""
    parts = -(-len(rows) // size)
    each = -(-len(rows) // parts) if parts else 1
    return [rows[start : start + each] for start in range(0, len(rows), each)]
