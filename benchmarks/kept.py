"""Read what published figures come from: kept results, tables of docs/evidence, diagnoses."""

from __future__ import annotations

import json
import re
from functools import cache
from typing import Any

from benchmarks.entries import ROOT

NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


@cache
def result(study: str) -> Any:
    """Read the result that ``make studies`` keeps of a bundled study."""
    return json.loads((ROOT / "studies" / study / "result.json").read_text(encoding="utf-8"))


@cache
def surrogate() -> Any:
    """Read the figures of the surrogate that the package brings."""
    path = ROOT / "studies" / "mq200_paper" / "surrogate.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    return {key: document[key] for key in ("validation", "comparison")}


@cache
def gap(bench: str) -> Any:
    """Read the diagnosis that ``make gaps`` keeps of the bench ``stand`` or ``adams``."""
    path = ROOT / "docs" / "evidence" / f"gap_{bench}.json"
    return json.loads(path.read_text(encoding="utf-8"))


def bank_shifts() -> int:
    """Count the shifts of the bundled bank."""
    path = ROOT / "studies" / "bench" / "bank.json"
    found = json.loads(path.read_text(encoding="utf-8"))
    return sum(len(series["t"]) for series in found["series"].values())


def trial(study: str, number: int) -> Any:
    """Give a confirmed design of a study by the number of its trial.

    Raises
    ------
    LookupError : the study did not confirm that design.
    """
    for design in result(study)["confirmation"]["designs"]:
        if design["trial"] == number:
            return design
    raise LookupError(f"{study} has not confirmed design {number}")


def numbers(table: str, *labels: str) -> list[float]:
    """Give the numbers behind a label in a table of docs/evidence.

    Parameters
    ----------
    table : name of the file without its ending.
    labels : what lines begin with, spaces aside: the first line with the last label that comes
        after lines with the others in their order.

    Raises
    ------
    LookupError : the table has no such line.
    """
    lines = iter((ROOT / "docs" / "evidence" / f"{table}.txt").read_text("utf-8").splitlines())
    for label in labels:
        for line in lines:
            if line.strip().startswith(label):
                break
        else:
            raise LookupError(f"{table}.txt has no line that begins with {label!r}")
    return [float(word) for word in NUMBER.findall(line.strip()[len(labels[-1]) :])]
