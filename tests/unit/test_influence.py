"""Influence of operating points: closed forms, refits, and the tail of importance weights."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import genpareto

from dogshape.diagnosis.bench.bench_data import Bench, setting_of
from dogshape.diagnosis.bench.reading import gather
from dogshape.diagnosis.diagnosis import Diagnosis, diagnose
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.inference.influence import UNEVEN, refitted, without_each
from dogshape.diagnosis.inference.pareto_tail import pareto_shape, tail_shape
from dogshape.diagnosis.inference.predictive_check import p_value
from dogshape.diagnosis.inference.ranking import rank
from dogshape.diagnosis.likelihood.discrepancy import Discrepancy, Slopes, marginals
from dogshape.diagnosis.likelihood.left_out import left_out, totals_without
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.hypotheses import spaces_for
from dogshape.diagnosis.report.influence_words import influence_in_words
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.units import RPM
from tests.toy import EFFECTS, Toy, bench_of, points_of

POINTS = points_of((235.2, 641.5))
NAMES = ("actuation_delay", "moving_mass", "force_scale")
PAIR = ("actuation_delay", "moving_mass")
EFFECT = {name: EFFECTS[name] for name in NAMES}


def _random(cells: int, values: int, seed: int) -> tuple[Slopes, Discrepancy, np.ndarray]:
    generator = np.random.default_rng(seed)
    first = generator.normal(0.0, 80.0, (values, cells))
    second = generator.uniform(0.0, 6e3, (values, cells))
    roots = tuple(generator.normal(0.0, 0.3, (cells, r)) for r in (3, 5))
    prior = np.array([[0.2, 0.3], [0.4, 0.1]])
    joint = generator.normal(0.0, 0.01, (values, cells))
    return Slopes(first, second), Discrepancy(roots, np.array([0.02, 0.1]), prior), joint


@pytest.mark.parametrize("joined", [False, True])
@pytest.mark.parametrize("drifting", [False, True])
def test_left_out_is_the_sum_over_the_others(joined: bool, drifting: bool) -> None:
    slopes, prior, joint = _random(6, 4, seed=1)
    joint = joint if joined else np.zeros_like(joint)
    if drifting:
        prior = replace(prior, beside=np.linspace(-0.01, 0.02, 12).reshape(6, 2))
    found = left_out(slopes, prior, joint).log
    for place in range(6):
        others = np.arange(6) != place
        alone = marginals(slopes.of(others), prior.of(others), joint[:, others])
        assert found[:, place] == pytest.approx(alone.log, abs=1e-9)


def test_offset_of_a_cell_is_told_by_the_others() -> None:
    """By the normal law of all offsets, conditioned on data of the other cells."""
    slopes, prior, joint = _random(5, 2, seed=2)
    found = left_out(slopes, prior, joint)
    for value, place, shape, size in [(0, 1, 0, 1), (1, 4, 1, 0)]:
        root = prior.roots[shape] * prior.amplitudes[size]
        before = root @ root.T + np.outer(joint[value], joint[value])
        others = np.arange(5) != place
        bent = np.diag(slopes.second[value] * others)
        after = np.linalg.inv(np.eye(5) + before @ bent) @ before
        mean = after @ (slopes.first[value] * others)
        member = 2 * shape + size
        assert found.mean[value, place, member] == pytest.approx(mean[place], rel=1e-8)
        assert found.variance[value, place, member] == pytest.approx(after[place, place], rel=1e-8)


def _problem(bench: Bench) -> Problem:
    points = tuple(cell.point for cell in bench.cells)
    return Problem(observe(bench), Toy(points), USUAL, bench.mismatch_sense)


def _without(bench: Bench, place: int) -> Bench:
    kept = bench.cells[place].point
    return replace(bench, cells=gather([r for r in bench.readings if r.point != kept]))


@pytest.fixture(scope="module")
def bench() -> Bench:
    extra = np.zeros(len(POINTS))
    extra[3] = 0.012
    generator = np.random.default_rng(5)
    return bench_of({"delay_s": 0.04}, generator, shifts=20, extra=extra, points=POINTS)


@pytest.fixture(scope="module")
def found(bench: Bench) -> Diagnosis:
    return diagnose(bench, Toy(POINTS), EFFECT)


def test_new_weights_are_those_of_a_refit(bench: Bench) -> None:
    """Of a quadrature and of a sum over draws, within their errors."""
    problem = _problem(bench)
    spaces = spaces_for([("actuation_delay",), PAIR], EFFECT, setting_of(bench))
    for space in spaces:
        one = evidence(problem, space)
        quick = without_each(one)
        every = np.ones(len(POINTS), dtype=bool)
        slow = refitted(problem, one, quick, every)
        assert slow.refitted.all()
        errors = np.hypot(quick.error, slow.error)
        assert (np.abs(quick.elpd - slow.elpd) < 4.0 * np.maximum(errors, 0.003)).all()
        assert (quick.draws > 5.0).all()
        assert (quick.uneven == (quick.k_hat > UNEVEN)).all()


def test_leaving_a_cell_out_is_a_diagnosis_without_it(bench: Bench, found: Diagnosis) -> None:
    """The whole diagnosis again: probabilities to 0.05, log Bayes factors to 0.15 nat.

    It standardises the forces of the cells that are left, which is beside the error of the sums.
    """
    here = found.influence
    assert here is not None
    for place in (0, 3, 9):
        one = here.cells[place]
        assert one is not None
        fewer = _without(bench, place)
        points = tuple(cell.point for cell in fewer.cells)
        again = diagnose(fewer, Toy(points), EFFECT)
        assert one.probability == pytest.approx(again.posterior[here.leading], abs=0.05)
        assert one.verdict.kind == again.verdict.kind
        logs = [
            which.scored[here.leading].log_evidence - which.scored[here.rival].log_evidence
            for which in (found, again)
        ]
        assert one.log_bayes == pytest.approx(logs[0] - logs[1], abs=0.15 + 3.0 * one.error)


def test_record_has_sums_and_a_sentence(found: Diagnosis) -> None:
    record = json.loads(json.dumps(found.as_dict(), allow_nan=False))["influence"]
    cells = record["cells"]
    assert len(cells) == len(POINTS)
    assert record["elpd"] == pytest.approx(sum(one["elpd"] for one in cells))
    apart = [one["elpd"] - one["rival_elpd"] for one in cells]
    assert [one["log_bayes_factor"] for one in cells] == pytest.approx(apart)
    assert record["elpd_difference"] == pytest.approx(sum(apart))
    assert record["verdict_holds"] == all(
        (one["verdict_without"], one["causes_without"]) == (found.verdict.kind, ["actuation_delay"])
        for one in cells
    )
    assert "dead time of the actuation" in record["sentence"]


def test_one_wrong_entry_is_named(bench: Bench) -> None:
    """A delay at a single point is what the answer hangs on."""
    extra = np.zeros(len(POINTS))
    extra[-1] = 0.05
    generator = np.random.default_rng(2)
    odd = bench_of({"delay_s": 0.08}, generator, shifts=40, extra=extra, points=POINTS)
    problem = _problem(odd)
    ranking = rank(problem, odd, EFFECT, [PAIR])
    single = without_each(ranking.scored["actuation_delay",])
    assert int(np.argmin(single.elpd)) == len(POINTS) - 1


def test_what_only_refits_refuse_is_refused_without_a_cell_too() -> None:
    """Cells that err each on its own: the check at the posterior alone lets the effect pass."""
    generator = np.random.default_rng(3)
    far = 0.02 + 0.03 * generator.random()
    odd = 0.004 * generator.standard_normal(len(POINTS))
    odd[3] = far
    wild = bench_of({"delay_s": 0.04}, generator, shifts=15, extra=odd, points=POINTS)
    here = diagnose(wild, Toy(POINTS), EFFECT).influence
    assert here is not None
    assert here.verdict.kind == "ambiguous"
    for place in (0, 1):
        fewer = _without(wild, place)
        points = tuple(cell.point for cell in fewer.cells)
        again = diagnose(fewer, Toy(points), EFFECT)
        one, hypothesis = here.cells[place], ("actuation_delay",)
        assert one is not None
        assert one.verdict.answer == again.verdict.answer
        by_posterior = p_value(_problem(fewer), again.scored[hypothesis])
        assert by_posterior > USUAL.decision.adequate > again.fits[hypothesis]


def test_points_without_data_and_single_points_have_none(bench: Bench, found: Diagnosis) -> None:
    readings = [
        replace(r, time=None, engaged=None) if r.point == POINTS[2] else r for r in bench.readings
    ]
    holes = replace(bench, cells=gather(readings))
    here = diagnose(holes, Toy(POINTS), EFFECT, pairs=[]).influence
    assert here is not None
    assert [place for place, one in enumerate(here.cells) if one is None] == [2]
    alone = bench_of({"delay_s": 0.04}, np.random.default_rng(1), points=POINTS[:1])
    assert diagnose(alone, Toy(POINTS[:1]), EFFECT, pairs=[]).influence is None


def test_unknown_without_each_cell_adds_up(bench: Bench) -> None:
    """The evidence by a chain of cells is that of all."""
    problem = _problem(bench)
    free = rank(problem, bench, EFFECT, []).free
    every = np.ones(len(POINTS), dtype=bool)
    assert free.log_evidence_of(every) == pytest.approx(free.log_evidence)
    one, two = every.copy(), every.copy()
    one[0], two[[0, 1]] = False, False
    assert free.log_evidence_of(one) != pytest.approx(free.log_evidence_of(two), abs=1e-3)


def test_rows_of_some_cells_have_the_likelihood_of_these(bench: Bench) -> None:
    problem = _problem(bench)
    one = rank(problem, bench, EFFECT, []).scored["moving_mass",]
    left = totals_without(one.rows)
    for place in (0, 7):
        others = np.arange(len(POINTS)) != place
        assert one.rows.of(others).whole == pytest.approx(left[:, place], abs=1e-8)
        mine = problem.of(others)
        assert mine.seen.cells == len(POINTS) - 1
        there = problem.predictions(("moving_mass",), np.array([[1.0]])).mean[others]
        assert mine.predictions(("moving_mass",), np.array([[1.0]])).mean == pytest.approx(there)


@pytest.mark.parametrize("shape", [-0.3, 0.2, 0.6, 1.1])
def test_shape_of_a_pareto_tail(shape: float) -> None:
    """That of draws from the law, within four standard errors (1 + k)/root n, and its prior."""
    size = 4000
    draws = np.sort(genpareto.rvs(shape, size=size, random_state=3))
    assert pareto_shape(draws) == pytest.approx(shape, abs=4.0 * (1.0 + abs(shape)) / size**0.5)


def test_tail_of_weights_is_told() -> None:
    generator = np.random.default_rng(1)
    even, heavy = generator.normal(0.0, 0.3, 2000), generator.normal(0.0, 6.0, 2000)
    assert tail_shape(even) < 0.5
    assert tail_shape(heavy) > UNEVEN
    assert np.isnan(tail_shape(np.zeros(3)))


def test_words_name_points_and_verdict(found: Diagnosis) -> None:
    here = found.influence
    assert here is not None
    points = [(c.point.mismatch / RPM, c.point.profile.force) for c in found.bench.cells]
    first = here.cells[0]
    assert first is not None
    sure = replace(first, probability=here.probability, verdict=here.verdict)
    same = replace(here, cells=(sure, sure, *[None] * (len(points) - 2)))
    said = influence_in_words(same, points, found.effects)
    assert said.startswith("No operating point carries the answer")
    assert said.endswith("The verdict is the same without any single one.")
    other = replace(sure, probability=0.4, verdict=replace(here.verdict, kind="unknown", causes=()))
    said = influence_in_words(replace(same, cells=(sure, other)), points, found.effects)
    assert "5 1/min and 641.5 N (without it 40 %)" in said
    assert "hangs on one point: without 5 1/min and 641.5 N no known effect would explain" in said
