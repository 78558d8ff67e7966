"""Settings of a diagnosis: they decide it, they are kept with it, and the page has all of them."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.constants import PAGE, constants, with_constants, written
from benchmarks.diagnosis_graph import ARROWS, BOXES, drawing
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.posterior import probabilities
from dogshape.diagnosis.prediction.hypotheses import NONE, UNKNOWN
from dogshape.diagnosis.settings import USUAL, Decision, Priors, Rules, Settings, Unlisted, told
from tests.toy import EFFECTS, Toy, bench_of, points_of

ROOT = Path(__file__).parents[2]
DELAY = ("actuation_delay",)
NAMES = ("actuation_delay", "sleeve_friction")


def _found(settings: Settings = USUAL) -> Diagnosis:
    points = points_of()[::6]  # of all forces and several mismatches
    bench = bench_of({"delay_s": 0.02}, np.random.default_rng(1), points=points)
    effects = {name: EFFECTS[name] for name in NAMES}
    return diagnose(bench, Toy(points), effects, pairs=[], settings=settings)


@pytest.fixture(scope="module")
def usual() -> Diagnosis:
    return _found()


def test_a_record_keeps_its_settings(usual: Diagnosis) -> None:
    other = replace(USUAL, decision=Decision(named=0.5))
    kept = json.loads(json.dumps(_found(other).as_dict(), allow_nan=False))["settings"]
    assert kept == json.loads(json.dumps(other.as_dict()))
    assert kept["decision"]["named"] == 0.5
    assert usual.as_dict()["settings"]["decision"]["named"] == 0.8


def test_a_prior_moves_odds_by_as_much(usual: Diagnosis) -> None:
    """Evidence is the same, so odds of a hypothesis against none move by the prior's odds."""
    rarer = Priors(included={"actuation_delay": 0.03})
    moved = _found(replace(USUAL, priors=rarer))
    odds = [found.raw[DELAY] / found.raw[NONE] for found in (usual, moved)]
    assert odds[1] / odds[0] == pytest.approx((0.03 / 0.97) / (0.3 / 0.7), rel=1e-9)


def test_unlisted_is_the_share_of_unknown_before_the_data() -> None:
    logs = dict.fromkeys((NONE, DELAY, UNKNOWN), 0.0)
    assert probabilities(logs)[UNKNOWN] == pytest.approx(0.15)
    assert probabilities(logs, before=Priors(unlisted=0.4))[UNKNOWN] == pytest.approx(0.4)


@pytest.mark.parametrize(
    "other",
    [
        Settings(likelihood=Rules(discrepancy=0.3)),
        Settings(likelihood=Rules(odd_share=0.2)),
        Settings(likelihood=Rules(discrepancy_length=0.1)),
        Settings(likelihood=Rules(discrepancy_shapes=((0.1, 0.1, 0.8, 1.0),))),
    ],
    ids=["scale", "odd cells", "length", "shapes"],
)
def test_errors_of_the_simulation_move_evidences(usual: Diagnosis, other: Settings) -> None:
    moved = _found(other).scored[DELAY].log_evidence
    assert abs(moved - usual.scored[DELAY].log_evidence) > 1e-3


def test_limits_of_the_answer_hold(usual: Diagnosis) -> None:
    """A limit that nothing reaches names nothing; a set of 99.99 % is larger than one of 10 %."""
    never = _found(replace(USUAL, decision=Decision(named=1.0, part=1.0)))
    assert never.verdict.kind == "ambiguous"
    assert never.verdict.causes == ()
    sizes = [
        len(_found(replace(USUAL, decision=Decision(credible=share))).verdict.credible)
        for share in (0.1, 0.9999)
    ]
    assert sizes[0] == 1 < sizes[1]
    blind = _found(replace(USUAL, decision=Decision(visible=1e9)))
    assert set(blind.as_dict()["no_information"]) == set(NAMES)
    assert not usual.as_dict()["no_information"]


def test_offsets_of_unknown_move_its_evidence(usual: Diagnosis) -> None:
    """Offsets of a second and more are less probable, so less speaks for unknown."""
    wide = _found(replace(USUAL, unlisted=Unlisted(least_offset=1.0, most_offset=9.0)))
    odds = [found.raw[UNKNOWN] / found.raw[DELAY] for found in (usual, wide)]
    assert odds[1] < 0.5 * odds[0]


def test_each_setting_says_what_it_is() -> None:
    for section, name, _, metadata in told(USUAL):
        assert metadata["meaning"], f"{section}.{name}"
        assert metadata["unit"], f"{section}.{name}"
        assert metadata["status"] in {"measured", "judged"}, f"{section}.{name}"
    shares = [shape[:3] for shape in USUAL.likelihood.discrepancy_shapes]
    assert [sum(one) for one in shares] == pytest.approx([1.0] * len(shares))
    for table in (USUAL.likelihood.discrepancy_shapes, USUAL.unlisted.stretches):
        assert sum(row[-1] for row in table) == pytest.approx(1.0)
    assert {f.name for f in fields(Settings)} == set(USUAL.as_dict())


def test_the_page_has_all_constants() -> None:
    """``python -m benchmarks.constants`` writes them."""
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_constants(page)
    assert all(one.meaning and one.unit for one in constants())
    assert {one.status for one in constants()} == {"measured", "judged", "numerical"}


def test_a_number_that_no_list_has_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.constants.NUMERICAL", {})
    with pytest.raises(ValueError, match=r"inference\.evidence\.DRAWS"):
        constants()


def test_values_are_written_short() -> None:
    assert written(np.geomspace(1e-3, 3.0, 12)) == "0.001 to 3, 12 values"
    assert written(((0.5, None), (2.0, 1.5))) == "0.5, own; 2, 1.5"
    assert written({"way": (0.5, 1.7)}) == "way: 0.5, 1.7"


def test_the_graph_is_the_kept_one_and_names_what_is_there() -> None:
    """``python -m benchmarks.diagnosis_graph`` draws it."""
    kept = ROOT / "docs" / "diagnosis_model.svg"
    assert kept.read_text(encoding="utf-8") == drawing() + "\n"
    assert all((ROOT / "diagnosis" / box[-1]).is_file() for box in BOXES.values())
    assert {name for pair in ARROWS for name in pair.split()} == set(BOXES)
