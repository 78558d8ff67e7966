"""The verb ``gap plan``: its record, its table to fill in, and its refusals."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.inference.outcome import Field
from dogshape.pipeline.diagnose.bank_diagnosis import Means
from tests.conftest import Said
from tests.fits import field_at

Call = Callable[..., Said]


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy in the place of a bank, at the operating points of the published tables."""

    def predicted_field(bench: Bench, means: Means) -> Field:
        points = [cell.point for cell in bench.cells]
        return field_at(("actuation_delay", "moving_mass"), points)

    monkeypatch.setattr("dogshape.gap.predicted_field", predicted_field)


@pytest.mark.usefixtures("_toy")
def test_the_verb_plans_and_writes_a_table_to_fill_in(dogshape: Call, tmp_path: Path) -> None:
    said = dogshape("gap", "plan", "mq200_adams", "--shifts", 40, "--out", "s.csv", "--json")
    assert said.status == 0, said.err
    record = said.json
    assert sum(visit["shifts"] for visit in record["order"]) == record["shifts"] == 40
    assert [v["reference"] for v in record["order"]].count(True) == 3
    assert {pair["truth"] for pair in record["pairs"]} == {"none", "actuation_delay", "moving_mass"}
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    first = record["order"][0]
    assert len(rows) == 40
    assert float(rows[0]["mismatch_rpm"]) == pytest.approx(first["mismatch_rpm"])
    assert rows[0]["shift_time_s"] == ""
    assert [row["order"] for row in rows] == [str(k) for k in range(1, 41)]
    text = dogshape("gap", "plan", "mq200_paper", "--shifts", 40, "--points", 2).out
    assert "operating points, about" in text


@pytest.mark.usefixtures("_toy")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere", "--shifts", 40), "there is no data set and no study at nowhere"),
        (("mq200_adams", "--shifts", 19), "number of shifts is 19, but it must lie between 20"),
        (("mq200_adams", "--shifts", 40, "--points", 99), "give 1 to 28"),
        (("mq200_adams", "--shifts", 40, "--out", "no/s.csv"), "there is no folder no"),
    ],
)
def test_a_plan_that_cannot_be_is_a_sentence(
    dogshape: Call, arguments: tuple[object, ...], words: str
) -> None:
    said = dogshape("gap", "plan", *arguments)
    assert (said.status, words in said.sentence) == (2, True), said.err
