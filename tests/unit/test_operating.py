"""Operating points as grid, list and draw; uncertainty, objectives, and variables of control."""

from __future__ import annotations

import numpy as np
import pytest

from dogshape.bench.texts import read_toml
from dogshape.pipeline.config.operating import OPERATED, POINT_SETS, nominal_operation
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.sampler import Guide, Space
from dogshape.pipeline.search.state import Trial, not_dominated
from dogshape.pipeline.simulate.design import leading_objective
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.simulate.plausibility import notes_of
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.errors import DogshapeError
from dogshape.sim.statistics.blocks import even_blocks
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from dogshape.surrogate.query import require_same_physics

TWO = "[{mismatch_rpm=-50, force_N=300, weight=3}, {mismatch_rpm=80, force_N=469}]"
NORMAL = "{distribution='normal', mean=60, sd=20}"
FORCE = "{distribution='uniform', low=240, high=640}"
FRICTION = {"distribution": "uniform", "low": 0.7, "high": 1.3}
NARROW = {"distribution": "uniform", "low": 0.8, "high": 1.2}
HALF = {"distribution": "lognormal", "median": 0.5, "factor": 2.0, "low": 0.1, "high": 3.0}


def _points(study: Setup) -> list[tuple[float, float, float]]:
    return [(round(p.mismatch / RPM, 9), p.profile.force, p.weight) for p in study.points]


def _listed(*more: str) -> Setup:
    """The paper's study with other operating points alone."""
    return load_study("mq200_paper", [f"operating={{{', '.join(more)}}}"])


def test_grid_weights_multiply() -> None:
    weights = ["mismatch_weight=[1, 3]", "force_weight=[2, 0.5]"]
    study = _listed("mismatch_rpm=[-20, 60]", "force_N=[300, 469]", *weights)
    assert _points(study) == [(-20, 300, 2), (-20, 469, 0.5), (60, 300, 6), (60, 469, 1.5)]
    assert study_mix(study).weights == pytest.approx([0.2, 0.05, 0.6, 0.15])
    assert study.operating_text == "4 with -20 to 60 1/min, 300 to 469 N at the sleeve"
    assert _points(_listed(f"points={TWO}")) == [(-50, 300, 3), (80, 469, 1)]


def test_drawn_points_are_fixed_and_follow_their_distributions() -> None:
    study = _listed(f"mismatch_rpm={NORMAL}", f"force_N={FORCE}", "samples=64", "seed=3")
    points = np.array(_points(study))
    assert (points[:, 2] == 1.0).all()
    assert points[:, 0].mean() == pytest.approx(60, abs=1)
    assert points[:, 0].std() == pytest.approx(20, abs=1.5)
    assert points[:, 1].mean() == pytest.approx(440, abs=5)
    # A Sobol sequence has as many values in each part of the range.
    assert np.histogram(points[:, 1], 8, (240, 640))[0].tolist() == [8] * 8
    again = _listed(f"mismatch_rpm={NORMAL}", f"force_N={FORCE}", "samples=64", "seed=3")
    assert _points(again) == _points(study)
    # A list goes with every draw.
    mixed = _points(_listed(f"mismatch_rpm={NORMAL}", "force_N=[300, 469]", "samples=5"))
    assert len(mixed) == 10
    assert {force for _, force, _ in mixed} == {300, 469}


def test_flanks_strike_at_the_bounds_of_a_drawn_mismatch() -> None:
    """The largest of six draws lies within; a set-point moves the bounds with the points."""
    strike = {"strike.ring_inertia_kgm2": 5e-4, "strike.input_stiffness_Nm_rad": 15e3}
    bounded = {"distribution": "uniform", "low": -20.0, "high": 60.0}
    drawn = {"operating": {"mismatch_rpm": bounded, "force_N": [469.0], "samples": 6}}
    study = load_study("mq200_paper", drawn | strike)
    (limits,) = study.limits.strikes
    assert max(point.mismatch for point in study.points) < 58.0 * RPM
    assert limits.speed("traction") == pytest.approx(60.0 * RPM)
    assert limits.speed("braking") == pytest.approx(20.0 * RPM)
    assert not any("without bounds" in note for note in notes_of(study))
    set_point = nominal_operation(study.points)["mismatch_set_rpm"] + 10.0
    moved = study.with_design({"mismatch_set_rpm": set_point})
    assert moved.limits.strikes[0].speed("traction") == pytest.approx(70.0 * RPM)
    drawn["operating"]["mismatch_rpm"] = {"distribution": "normal", "mean": 50.0, "sd": 5.0}
    unbounded = load_study("mq200_paper", drawn | strike)
    largest = max(point.mismatch for point in unbounded.points)
    assert unbounded.limits.strikes[0].speed("traction") == largest
    words = f"flanks strike at {largest / RPM:.4g} 1/min, the largest mismatch of 6 operating"
    assert any(words in note for note in notes_of(unbounded))


def test_uncertainty_belongs_to_the_physics_and_a_surrogate_without_it_is_refused() -> None:
    more = [{}, *({"uncertain.friction_factor": one} for one in (FRICTION, NARROW))]
    plain, unsure, other = (load_study("mq200_paper", one) for one in more)
    assert len({s.physics_hash for s in (plain, unsure, other)}) == 3
    data = with_rows(plain, np.zeros((0, 13)))
    with pytest.raises(DogshapeError, match=r"uniform, low 0\.7, high 1\.3 here and absent"):
        require_same_physics(data, unsure.physics)


def test_uncertain_shifts_say_what_was_drawn() -> None:
    points = {"operating": {"mismatch_rpm": [-149.0], "force_N": [469.0]}}
    factors = dict.fromkeys(("friction_factor", "force_factor", "inertia_factor"), NARROW)
    unsure = {"uncertain": {**factors, "dissipation_factor": HALF}}
    executor = scratch_executor(1)
    for more in (points | unsure, points):
        one = load_study("mq200_paper", more)
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


def test_what_is_to_be_maximised_turns_its_sign_once() -> None:
    names = "['smallest_margin', 'axial_length_mm']"
    study = load_study("mq200_paper", [f"search.objectives={names}"])
    assert leading_objective(study).name == "smallest_margin"
    values = (0.2, 8.0), (0.1, 8.0), (0.1, 7.0)
    rows = np.array([Trial(0, {}, pair).losses(study)[0] for pair in values])
    assert rows[0].tolist() == [-0.2, 8.0]
    assert not_dominated(rows).tolist() == [True, False, True]
    assert Guide(study).exact_losses([study.prototype]) == pytest.approx(np.array([[np.inf, 8.4]]))


def test_sets_name_their_points() -> None:
    """Every bundled set serves the bundled studies; that of the paper is the study's grid."""
    for name, table in read_toml(bundled_root() / POINT_SETS).items():
        assert _points(_listed(f"set='{name}'")) == [pytest.approx(row) for row in table["rows"]]
    grid, named = load_study("mq200_paper"), _listed("set='paper'")
    assert named.points == grid.points
    assert named.physics_hash == grid.physics_hash
    assert named.file.model_dump()["operating"] == {"set": "paper"}


SPREAD = "operating={mismatch_rpm={distribution='normal',mean=40,sd=10}, force_N=[300], samples=16}"
SEARCHED = (
    "variables.mismatch_set_rpm=[-100, 100]",
    "variables.force_factor=[0.8, 2.0]",
    "variables.rise_factor=[0.5, 1.5]",
)


def _study(*more: str) -> Setup:
    return load_study("mq200_paper", [SPREAD, *SEARCHED, "search.sampler='space_filling'", *more])


def _mismatches(study: Setup) -> np.ndarray:
    return np.array([point.mismatch / RPM for point in study.points])


@pytest.mark.parametrize("target", [-70.0, 0.0, 25.0])
def test_the_set_point_is_the_mean_and_the_spread_stays(target: float) -> None:
    study = _study()
    moved = _mismatches(study.with_design({"mismatch_set_rpm": target}))
    assert moved.mean() == pytest.approx(target, abs=1e-5)
    own = _mismatches(study)
    assert moved - moved.mean() == pytest.approx(own - own.mean(), abs=1e-9)


def test_the_force_takes_the_rise_time_of_the_table() -> None:
    study = _study()
    (profile, *_) = [p.profile for p in study.with_design({"force_factor": 469.0 / 300.0}).points]
    assert (profile.force, profile.rise) == (pytest.approx(469.0), pytest.approx(0.1766))
    (slow, *_) = [p.profile for p in study.with_design({"rise_factor": 1.5}).points]
    assert slow.force == 300.0
    assert slow.rise == pytest.approx(1.5 * study.points[0].profile.rise)


def test_a_study_is_operated_as_it_says() -> None:
    study = _study()
    assert study.with_design(study.prototype).points == study.points
    assert study.with_design({"chamfer_deg": 9.0}) is study
    assert study.shape_keys == ("chamfer_deg", "traction_deg", "braking_deg", "height_mm", "count")
    trial = Space(study.variables).trial(study.prototype)
    assert [*trial.params][-3:] == [*OPERATED]
    assert study.dog_with(study.prototype) == study.clutch.dog
    # What a shift depends on is known by its operating point: variables of it change no hash.
    assert study.physics_hash == load_study("mq200_paper").physics_hash


def test_shifts_are_those_of_the_operation() -> None:
    """A design that is operated otherwise is simulated as a study of that operation is."""
    moved = {"mismatch_set_rpm": -30.0, "force_factor": 1.5}
    study = _study("solver.engine='planar'")
    named = [
        {"mismatch_rpm": p.mismatch / RPM, "force_N": p.profile.force}
        for p in study.with_design(moved).points
    ]
    other = load_study("mq200_paper", {"operating": {"points": named}, "solver.engine": "planar"})
    times = []
    for one, params in ((study, moved), (other, {})):
        (found,) = evaluate(one, [params], scratch_executor(), 3, 1)
        times.append([p.mean for p in found.expectation.points])
    assert times[0] == pytest.approx(times[1], rel=1e-6)
