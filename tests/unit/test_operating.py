"""Operating points as grid, list and draw; uncertainty and objectives of the study file."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.pipeline.config.operating import duty_cycles
from dogshape.pipeline.config.study_file import Setup, bundled_studies, load_study
from dogshape.pipeline.search.state import Trial, not_dominated
from dogshape.pipeline.simulate.design import exact_losses, leading, objectives_of
from dogshape.pipeline.simulate.evaluation import FIRST
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.errors import DogshapeError
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.sim.units import RPM
from dogshape.surrogate.query import require_same_physics

TWO = "[{mismatch_rpm=-50, force_N=300, weight=3}, {mismatch_rpm=80, force_N=469}]"
NORMAL = "{distribution='normal', mean=60, sd=20}"
FORCE = "{distribution='uniform', low=240, high=640}"
FRICTION = "{distribution='uniform', low=0.7, high=1.3}"


def _points(study: Setup) -> list[tuple[float, float, float]]:
    return [(round(p.mismatch / RPM, 9), p.profile.force, p.weight) for p in study.points]


def _listed(*more: str) -> Setup:
    """The paper's study with other operating points alone."""
    return load_study("mq200_paper", [f"operating={{{', '.join(more)}}}"])


def test_grid_weights_multiply() -> None:
    study = load_study(
        "mq200_paper",
        [
            "operating.mismatch_rpm=[-20, 60]",
            "operating.force_N=[300, 469]",
            "operating.mismatch_weight=[1, 3]",
            "operating.force_weight=[2, 0.5]",
        ],
    )
    assert _points(study) == [(-20, 300, 2), (-20, 469, 0.5), (60, 300, 6), (60, 469, 1.5)]
    assert study_mix(study).weights == pytest.approx([0.2, 0.05, 0.6, 0.15])
    assert study.operating_text == "-20, 60 1/min, each with 300, 469 N, weighted"


def test_points_are_listed_with_their_weights() -> None:
    study = _listed(f"points={TWO}")
    assert _points(study) == [(-50, 300, 3), (80, 469, 1)]
    assert (study.mismatches, study.forces) == ([-50, 80], [300, 469])
    assert study.operating_text == "2 listed, -50 to 80 1/min with 300 to 469 N, by weight"


def test_drawn_points_are_fixed_and_follow_their_distributions() -> None:
    study = _listed(f"mismatch_rpm={NORMAL}", f"force_N={FORCE}", "samples=64", "seed=3")
    points = np.array(_points(study))
    assert points.shape == (64, 3)
    assert (points[:, 2] == 1.0).all()
    assert points[:, 0].mean() == pytest.approx(60, abs=1)
    assert points[:, 0].std() == pytest.approx(20, abs=1.5)
    assert points[:, 1].mean() == pytest.approx(440, abs=5)
    # A Sobol sequence has as many values in each part of the range.
    assert np.histogram(points[:, 1], 8, (240, 640))[0].tolist() == [8] * 8
    again = _listed(f"mismatch_rpm={NORMAL}", f"force_N={FORCE}", "samples=64", "seed=3")
    assert _points(again) == _points(study)
    assert "60, sd 20 1/min, each with uniform, low 240, high 640 N; 64" in study.operating_text


def test_a_list_goes_with_every_draw() -> None:
    points = _points(_listed(f"mismatch_rpm={NORMAL}", "force_N=[300, 469]", "samples=5"))
    assert len(points) == 10
    assert {force for _, force, _ in points} == {300, 469}


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["operating.mismatch_rpm={distribution='norml', mean=1}"], "did you mean 'normal'?"),
        (["operating.mismatch_rpm={distribution='normal', mean=1}"], "lacks 'sd'"),
        (
            ["operating.mismatch_rpm={distribution='uniform', low=1, high=2, sd=3}"],
            "operating.mismatch_rpm.sd is nothing that a uniform distribution has",
        ),
        (
            ["operating.force_N={distribution='uniform', low=500, high=300}"],
            "operating.force_N.low is 500, but it must lie below high = 300",
        ),
        (
            ["operating.force_N={distribution='triangular', low=300, mode=200, high=400}"],
            "operating.force_N.mode is 200, but it must lie between low = 300 and high = 400",
        ),
        (
            ["operating.mismatch_rpm={distribution='normal', mean=9, sd=0}"],
            "operating.mismatch_rpm.sd is 0, but it must be more than 0",
        ),
        (
            ["operating.mismatch_rpm={distribution='normal', mean=nan, sd=1}"],
            "operating.mismatch_rpm.mean is nan, but it must be finite",
        ),
        (
            ["operating.mismatch_rpm={distribution='normal', mean=0, sd=1, low=9}"],
            "next to nothing of the normal distribution lies between",
        ),
        (
            ["operating.force_N={distribution='normal', mean=300, sd=100}"],
            "the rise times of the study cover 235.2 to 641.5 N",
        ),
        (["operating.seed=8"], "operating.seed is for a distribution"),
        (["operating.mismatch_weight=[1]"], "operating.mismatch_weight has 1 and"),
        (["operating.force_weight=[1, 1, 0, 1]"], "weights must be positive"),
        (
            [f"operating.mismatch_rpm={NORMAL}", "operating.force_weight=[1, 1, 1, 1]"],
            "operating.force_weight goes with a grid of lists",
        ),
        (["operating={set='ampt'}"], "operating.set is 'ampt', which is not a set of points; did"),
        (["operating.set='amt'"], "operating.mismatch_rpm cannot stand beside operating.set"),
        ([f"operating={{set='amt', points={TWO}}}"], "operating.points cannot stand beside"),
        (
            ["operating={set='amt'}", "actuation={force_N=[200, 500], rise_s=[0.2, 0.1]}"],
            "operating.set 'amt': shift force is 611 N",
        ),
        ([f"operating.points={TWO}"], "operating.mismatch_rpm cannot stand beside"),
        (["operating={force_N=[300]}"], "'operating.mismatch_rpm' is missing"),
        (
            ["operating={points=[{mismatch_rpm=5, force_N=300, wight=1}]}"],
            "did you mean 'operating.points.0.weight'?",
        ),
        (["operating={points=[{mismatch_rpm=5, force_N=300, weight=0}]}"], "weight is 0, but it"),
        (
            ["operating={points=[{mismatch_rpm=5, force_N=300}, {mismatch_rpm=5, force_N=300}]}"],
            "operating.points has 5 1/min with 300 N twice",
        ),
        (
            ["uncertain.friction_factor={distribution='normal', mean=1, sd=0.1}"],
            "a factor must be positive and at most 10; give low and high",
        ),
        ([f"uncertain.force_factor={FRICTION}"], "narrow uncertain.force_factor"),
        (
            ["uncertain.friction_factor={distribution='uniform', low=1, high=9.9}",
             "contact.static_friction=0.3"],
            "contact.static_friction is 2.97",
        ),
    ],
)  # fmt: skip
def test_every_mistake_is_one_sentence(more: list[str], sentence: str) -> None:
    with pytest.raises(DogshapeError) as refused:
        load_study("mq200_paper", more)
    text = str(refused.value)
    assert sentence in text
    assert "\n" not in text


def test_uncertainty_belongs_to_the_physics_and_a_surrogate_without_it_is_refused() -> None:
    plain = load_study("mq200_paper")
    unsure = load_study("mq200_paper", [f"uncertain.friction_factor={FRICTION}"])
    other = load_study(
        "mq200_paper", [f"uncertain.friction_factor={FRICTION.replace('1.3', '1.2')}"]
    )
    assert len({s.physics_hash for s in (plain, unsure, other)}) == 3
    data = with_rows(plain, np.zeros((0, 13)))
    with pytest.raises(
        DogshapeError,
        match=r"friction_factor is uniform, low 0\.7, high 1\.3 here and absent there",
    ):
        require_same_physics(data, unsure.physics)


def test_uncertain_shifts_say_what_was_drawn() -> None:
    more = [
        "operating.mismatch_rpm=[-149]",
        "operating.force_N=[469]",
        f"uncertain.friction_factor={FRICTION}",
        "uncertain.force_factor={distribution='uniform', low=0.8, high=1.2}",
        "uncertain.inertia_factor={distribution='uniform', low=0.8, high=1.2}",
        "uncertain.dissipation_factor="
        "{distribution='lognormal', median=0.5, factor=2, low=0.1, high=3}",
    ]
    study = load_study("mq200_paper", more)
    plain = load_study("mq200_paper", more[:2])
    executor = scratch_executor(1)
    for one in (study, plain):
        executor.run(even_blocks(one.clutch, one.points, 3, 1, uncertainty=one.uncertainty))
    shifts = list(executor.journal.rows.values())
    assert len(shifts) == 6
    drawn = shifts[0]
    assert drawn["drawn_force_N"] == pytest.approx(469 * drawn["force_factor"])
    assert drawn["drawn_dynamic_friction"] == pytest.approx(0.1 * drawn["friction_factor"])
    assert drawn["drawn_dissipation_s_m"] == pytest.approx(20.0 * drawn["dissipation_factor"])
    assert 0.0 < drawn["dissipation_factor"] != 1.0
    assert drawn["force_N"] == 469.0
    assert "drawn_force_N" not in shifts[3]


def test_a_finer_draw_repeats_no_uncertain_shift() -> None:
    study = load_study("mq200_robust")
    coarse, fine = (
        even_blocks(study.clutch, study.points, n, 5, FIRST, uncertainty=study.uncertainty)
        for n in (FIRST, 4 * FIRST)
    )
    for few, many in zip(coarse, fine, strict=True):
        assert set(few.keys) < set(many.keys)
    designs = [study.clutch, study.clutch.with_dog(study.dog_with({"count": 18}))]
    first, second = (
        even_blocks(c, study.points, 6, 5, uncertainty=study.uncertainty)[0] for c in designs
    )
    assert first.variants == second.variants


def test_what_is_to_be_maximised_turns_its_sign_once() -> None:
    names = "['smallest_margin', 'axial_length_mm']"
    study = load_study("mq200_paper", [f"search.objectives={names}"])
    assert leading(study).name == "smallest_margin"
    assert [o.maximise for o in objectives_of(study)] == [True, False]
    losses, errors = Trial(0, {}, (0.2, 8.0)).losses(study)
    assert losses.tolist() == [-0.2, 8.0]
    assert errors.tolist() == [0.0, 0.0]
    exact = exact_losses(study, [study.prototype])
    # A round of a search may ask for nothing new, where no design has passed yet.
    assert exact_losses(study, []).shape == (0, 2)
    assert np.isnan(exact[0, 0])
    assert exact[0, 1] == pytest.approx(8.4)
    values = (0.2, 8.0), (0.1, 8.0), (0.1, 7.0)
    rows = np.array([Trial(0, {}, pair).losses(study)[0] for pair in values])
    assert not_dominated(rows).tolist() == [True, False, True]


def test_every_bundled_study_can_be_read_and_searched() -> None:
    names = bundled_studies()
    assert {"mq200_paper", "mq200_robust", "mq200_three"} <= set(names)
    for name in names:
        study = load_study(name)
        assert study.name == name
        assert any(objective.simulated for objective in objectives_of(study))


@pytest.mark.parametrize("name", [*duty_cycles()])
def test_a_set_names_its_points(name: str) -> None:
    """Every bundled set serves the bundled studies."""
    rows, study = duty_cycles()[name], _listed(f"set='{name}'")
    assert _points(study) == [pytest.approx(row) for row in rows]
    assert len({row[:2] for row in rows}) == len(rows)
    assert study.operating_text.startswith(f"{len(rows)} of the set {name}, ")


def test_the_set_of_the_paper_is_the_grid_of_the_bundled_study() -> None:
    grid, named = load_study("mq200_paper"), _listed("set='paper'")
    assert named.points == grid.points
    assert named.physics_hash == grid.physics_hash
    assert named.file.model_dump()["operating"] == {"set": "paper"}
