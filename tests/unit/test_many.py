"""A table of designs for ``check``: what is refused, what is filled in, what cannot be."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.design import design_of
from tests.conftest import Said

Call = Callable[..., Said]


def _asked(dogshape: Call, text: str, *more: object) -> Said:
    Path("designs.csv").write_text(text)
    return dogshape("check", "mq200_paper", "--designs", "designs.csv", *more)


def _answers() -> list[dict[str, str]]:
    with Path("designs-times.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hight_mm\n3\n", "row 1: 'hight_mm' is no variable; did you mean 'height_mm'?"),
        ("note\nx\n", "there is no column of a variable; valid are chamfer_deg"),
        ("count,count\n15,16\n", "the column 'count' is there twice; keep one"),
        ("count,outer_diameter_mm\n15,52\n", "'outer_diameter_mm' is the same for all designs"),
        ("count,feasible\n15,True\n", "'feasible' is a column of the answers; take it away"),
        ("count\n15.5\n", "row 2, column count is '15.5', but it must be a whole number"),
        ("height_mm\nabc\n", "row 2, column height_mm is 'abc', but it must be a number"),
        ("count\n", "holds no design below its line of names"),
        ("", "it is empty"),
    ],
)
def test_bad_tables_are_one_sentence(dogshape: Call, text: str, words: str) -> None:
    said = _asked(dogshape, text)
    assert said.status == 2
    assert words in said.sentence
    assert not Path("designs-times.csv").exists()


def test_what_the_study_fills_in_is_said(dogshape: Call) -> None:
    said = _asked(dogshape, "name,count,height_mm\na,18,3.5\n", "--json")
    assert said.status == 0
    filled = said.json["filled"]
    assert filled == {"chamfer_deg": 8.0, "traction_deg": 12.0, "braking_deg": 22.0}
    assert said.json["kept"] == ["name"]
    assert "the study gives, chamfer_deg = 8, traction_deg = 12, braking_deg = 22" in said.err
    assert "columns copied, and no part of the question: name" in said.err


def test_what_cannot_be_a_dog_has_a_reason_and_no_time(dogshape: Call) -> None:
    said = _asked(dogshape, "count,height_mm\n18,-3\n100000,3.7\n15,3.7\n15,3.0\n")
    assert said.status == 1
    assert "row 2 is no design: dog.height_mm is -3 mm" in said.out
    assert "wrote designs-times.csv: designs 4" in said.out
    assert "impossible 2" in said.out
    negative, crowded, prototype, low = _answers()
    for row, reason in ((negative, "dog.height_mm is -3 mm"), (crowded, "tip width")):
        assert reason in row["reason"]
        assert row["feasible"] == "False"
        assert row["expected_shift_time_s"] == row["worst_check"] == ""
        assert row["in_range"] == "False"
    study = load_study("mq200_paper")
    for row, params in ((prototype, {}), (low, {"height_mm": 3.0})):
        design = design_of(study, params)
        worst = min(design.checks, key=lambda check: check.margin)
        assert float(row["expected_shift_time_s"]) > 0.0
        assert row["feasible"] == str(design.feasible)
        assert row["worst_check"] == worst.name
        assert float(row["smallest_margin"]) == pytest.approx(worst.margin, rel=1e-3)
        assert row["reason"] == ""
    record = _asked(dogshape, "count,height_mm\n18,-3\n15,3.7\n", "--json").json
    assert [one["row"] for one in record["impossible"]] == [2]
    assert record["best"]["row"] == 3
    none = _asked(dogshape, "count,height_mm\n18,-3\n", "--json")
    assert (none.status, none.json["best"], none.json["best_feasible"]) == (1, None, None)
