"""Exploring a surrogate of a known additive time: effects, indices, slices and their page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.surrogate.slices import RIVALS, bases_of, rivals_of
from dogshape.pipeline.train.filling import filling_designs
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.bundled import bundled_root
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit
from dogshape.surrogate.main_effects import accumulate, effects
from dogshape.surrogate.mix import Mix
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.sobol_indices import EVEN, LOG, WHOLE, Input, indices
from dogshape.surrogate.store import Stored, load, save
from dogshape.surrogate.time_curves import at_points, times_at
from dogshape.surrogate.validation_figures import Validation
from tests.browser import PROBE, look

#: Ends of the search ranges of the paper's study, and what each variable adds across them, s.
LOW, HIGH = np.array([0.0, 4.0, 4.0, 1.6, 6.0]), np.array([20.0, 30.0, 30.0, 6.0, 36.0])
SLOPES = np.array([-0.012, 0.0, 0.01, 0.02, -0.05])
BEND = 0.03  #: of the square of the chamfer's share of its range, s
DESIGNS = 70


def terms(x: Array) -> Array:
    """What each variable of designs (n, 5) adds to the time, (n, 5), s."""
    u = (x - LOW) / (HIGH - LOW)
    added: Array = u * SLOPES
    added[:, 0] += BEND * u[:, 0] ** 2
    return added


def pace(points: Array) -> Array:
    """How much longer than at 50 1/min and 400 N a shift takes at points (n, 2), (n,)."""
    slower: Array = (points[:, 0] / 50.0) ** -0.1 * (points[:, 1] / 400.0) ** -0.2
    return slower


def truth(x: Array, points: Array) -> Array:
    """The time of designs (n, 5) at operating points (n, 2), (n,), s."""
    time: Array = (0.09 + terms(x).sum(axis=1)) * pace(points)
    return time


@pytest.fixture(scope="module")
def study() -> Setup:
    """The paper's study."""
    return load_study("mq200_paper")


def feasible(study: Setup, count: int, seed: int) -> Array:
    """Designs that pass every check, (n, 5)."""
    designs = islice(filling_designs(study, seed, border=False), count)
    return np.array([list(design.values()) for design in designs], dtype=float)


@pytest.fixture(scope="module")
def surrogate(study: Setup) -> Surrogate:
    """A surrogate of the known time, with some noise."""
    rng, count = np.random.default_rng(1), 4 * DESIGNS
    x = np.repeat(feasible(study, DESIGNS, 1), 4, axis=0)
    points = np.column_stack([5.0 * 50.0 ** rng.random(count), 235.2 * 2.73 ** rng.random(count)])
    mean = truth(x, points) * np.exp(0.005 * rng.standard_normal(count))
    eight = np.full(count, 8.0)
    columns = (mean, 0.005 * mean, 0.3 * mean, eight, eight, np.ones(count))
    data = with_rows(study, np.column_stack([x, points, *columns]))
    return fit(data, effort=Effort(rows=200, steps=25))


@pytest.fixture(scope="module")
def over(study: Setup, surrogate: Surrogate) -> Over:
    """The same over the study's operating points."""
    return Over(surrogate, study_mix(study))


def test_effects_of_an_additive_time_are_its_terms(
    study: Setup, surrogate: Surrogate, over: Over
) -> None:
    mix, x = study_mix(study), feasible(study, 100, 9)
    found = effects(over, surrogate.data.variables, x)
    assert [one.variable for one in found] == list(surrogate.data.variables)
    mean = float(mix.weights @ pace(mix.points))
    inside = []
    for column, one in enumerate(found):
        asked = accumulate(x, column)
        known = asked.form @ (mean * terms(asked.moved).sum(axis=1))
        along = np.tile(x[:1], (len(one.values), 1))
        along[:, column] = one.values
        # What the form adds up is the term itself but for a constant.
        assert np.ptp(known - mean * terms(along)[:, column]) < 1e-12
        assert one.effect == pytest.approx(known, abs=1.5e-3)
        assert (one.high - one.low).max() < 8e-3
        inside += list((one.low <= known) & (known <= one.high))
    assert np.mean(inside) >= 0.9
    by_name = {one.variable: one for one in found}
    assert not by_name["traction_deg"].clear
    assert by_name["count"].clear
    assert by_name["count"].fastest == x[:, 4].max()
    assert by_name["count"].values.tolist() == [round(v) for v in by_name["count"].values]


def test_an_effect_is_not_that_of_what_comes_along() -> None:
    first = np.linspace(0.0, 1.0, 60)
    x = np.column_stack([first, first + 0.01 * np.sin(50.0 * first), np.ones(60)])
    asked = accumulate(x, 1)
    assert asked.form @ asked.moved[:, 0] == pytest.approx(0.0, abs=1e-12)
    own = accumulate(x, 0)
    assert own.form @ own.moved[:, 0] == pytest.approx(own.values - own.values.mean(), abs=0.01)


def test_joint_errors_are_those_of_one_design_at_a_time(study: Setup, over: Over) -> None:
    x = feasible(study, 12, 3)
    time, covariance = over.joint(x, rough=True)
    alone, error = over.predict(x)
    assert time == pytest.approx(alone)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(error, rel=1e-6)
    smooth = over.joint(x)[1]
    assert (np.diag(smooth) <= np.diag(covariance)).all()
    assert np.linalg.eigvalsh(smooth).min() > -1e-12


def test_errors_of_two_designs_go_together(study: Setup, surrogate: Surrogate) -> None:
    """Against the joint logarithms of both designs at every point, nothing summed before."""
    mix, x = replace(study_mix(study), retry=0.0), feasible(study, 3, 3)
    size = len(mix.points)
    inputs = surrogate.inputs(np.repeat(x, size, axis=0), np.tile(mix.points, (3, 1)))
    mean, covariance = surrogate.times.joint(inputs)
    parts = np.tile(mix.weights, 3) * np.exp(mean + 0.5 * np.diag(covariance))
    whole = parts[:, None] * np.expm1(covariance) * parts[None, :]
    known = whole.reshape(3, size, 3, size).sum(axis=(1, 3))
    assert Over(surrogate, mix).joint(x, rough=True)[1] == pytest.approx(known, rel=0.1, abs=1e-8)


def test_times_at_points_are_those_of_a_mix_of_one(study: Setup, surrogate: Surrogate) -> None:
    mix, x = study_mix(study), feasible(study, 1, 3)
    places = np.array([0, 13, 27])
    alike = np.repeat(x, 3, axis=0)
    found = at_points(surrogate, alike, mix.points[places], mix.retry)
    known = [surrogate.expected(x[0], mix.at(place)) for place in places]
    assert found.time == pytest.approx([one.time for one in known])
    assert found.low == pytest.approx([one.low for one in known], rel=1e-4)
    means = times_at(surrogate, alike, mix.points[places], mix.retry)
    assert means == pytest.approx([surrogate.mean(x[0], mix.at(place)) for place in places])


def test_indices_of_ishigami() -> None:
    """Closed form of Ishigami and Homma 1990 with a = 7, b = 0.1."""

    def ishigami(x: Array) -> Array:
        result: Array = np.sin(x[:, 0]) * (1 + 0.1 * x[:, 2] ** 4) + 7 * np.sin(x[:, 1]) ** 2
        return result

    found = indices([Input(name, -np.pi, np.pi) for name in "abc"], ishigami, samples=4096)
    assert found.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.03)
    assert found.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.03)
    assert (found.first_half > 0.0).all()
    assert found.sd == pytest.approx(3.7208, rel=0.01)


def test_indices_of_an_additive_time(study: Setup, over: Over) -> None:
    low, high = np.array([7.0, 10.0, 18.0, 3.2, 12.0]), np.array([11.0, 16.0, 24.0, 4.2, 20.0])
    scales = [EVEN, EVEN, EVEN, EVEN, WHOLE]
    box = [Input(*one) for one in zip(study.variables, low, high, scales, strict=True)]
    found = indices(box, lambda x: over.predict(x)[0], samples=512)
    variance = terms(found.values).var(axis=0)
    assert found.first == pytest.approx(variance / variance.sum(), abs=0.06)
    assert found.total == pytest.approx(found.first, abs=0.06)
    assert np.argmax(found.total) == 4


def test_inputs_keep_to_their_scale() -> None:
    share = np.array([0.0, 0.25, 0.5, 0.999, 1.0])
    assert Input("count", 12, 15, WHOLE).at(share).tolist() == [12, 13, 14, 15, 15]
    assert Input("force_N", 10, 1000, LOG).at(share)[[0, 2, 4]] == pytest.approx([10, 100, 1000])
    still = indices([Input("a", 0, 1)], lambda x: np.ones(len(x)), samples=8)
    assert still.total.tolist() == [0.0]


#: Put into the page: choose another design and operating point, and see the curves move.
CHOOSE = """
<script>
function probe(said) {
  const drawn = () => JSON.stringify(document.getElementById("slices").data.map(one => one.y));
  const before = drawn();
  for (const [name, place] of [["base", 1], ["operating", 4]]) {
    const choice = document.getElementById(name);
    choice.value = place;
    choice.onchange();
    said[name] = choice.selectedOptions[0].textContent;
  }
  said.moved = before !== drawn();
  said.words = document.getElementById("said").textContent;
}
</script>
"""


def _stored(surrogate: Surrogate) -> Stored:
    figures: dict[str, Any] = {"q2": 0.9, "coverage_95": 0.95, "rmse_s": 0.003, "n": 39}
    figures |= {"noise_s": 0.001, "q2_points": 0.8, "coverage_points": 0.9, "rank_best": None}
    figures |= {"bias_s": 0.001, "spread_error": 0.2, "lost": 3, "lost_expected": 2.5, "n_best": 0}
    figures |= {"rmse_points_s": 0.008, "source": "references", "shifts": 1120}
    form = {"form": "smooth", "log_density": 1.0, "log_rmse": 0.1, "coverage_95": 0.9}
    return Stored(surrogate, Validation(**figures), (form,))


@pytest.fixture
def searched(study: Setup, tmp_path: Path) -> dict[str, float]:
    """A design of the front of a search in the folder of results."""
    (design,) = islice(filling_designs(study, 5, border=False), 1)
    rest = dict.fromkeys(("best", "confirmation", "surrogate", "versions"))
    result = {**rest, "trials": [], "objectives": [], "physics_hash": study.physics_hash}
    folder = tmp_path / "results" / "mq200_paper"
    folder.mkdir(parents=True)
    content = {**result, "front": [{"trial": 7, **design}]}
    (folder / "result.json").write_text(json.dumps(content))
    return design


def test_page_of_a_surrogate(
    dogshape: Callable[..., Any],
    surrogate: Surrogate,
    searched: dict[str, float],
    tmp_path: Path,
) -> None:
    save(Path("mine.json"), _stored(surrogate))
    said = dogshape("explore", "mq200_paper", "--surrogate", "mine.json", "--json")
    assert said.status == 0, said.err
    assert said.err.count("\n") == 4
    found = said.json
    assert found["file"] == "results/mq200_paper/explore.html"
    assert {"effects", "indices", "slices", "validation", "comparison", "data"} <= set(found)
    assert found["data"]["hash"] == surrogate.data.digest
    _assert_slices(found["slices"], searched)
    assert [len(table["inputs"]) for table in found["indices"]] == [5, 7]
    page = Path(found["file"])
    text = page.read_text()
    assert not re.search(r'<(script|link|img|iframe)[^>]*(src|href)="?(http|//)', text)
    assert page.stat().st_size < 10_000_000
    seen = look(page, tmp_path, PROBE + CHOOSE)
    assert "error" not in seen
    assert seen["figures"] == seen["drawn"] == "4"
    assert (seen["wide"], seen["loads"], seen["moved"]) == ("false", "0", "true")
    assert (seen["base"], seen["operating"]) == ("design 7", "249 1/min, 469 N")
    assert f"N {searched['count']}." in seen["words"]
    assert "not distinguishable from none" in seen["dom"]
    assert "Forms of the model that were compared" in seen["dom"]


def _assert_slices(slices: list[dict[str, Any]], searched: dict[str, float]) -> None:
    """All curves lie within their bands and have a value for each place."""
    assert [one["base"] for one in slices] == ["the study's own design", "design 7"]
    assert slices[1]["design"] == searched
    assert slices[1]["failed"] == []
    for base in slices:
        for choice in base["operating"]:
            assert list(choice["curves"])[5:] == ["mismatch_rpm", "force_N"]
            for name, curve in choice["curves"].items():
                values = curve.get("values") or base["variables"][name]["values"]
                low, time, high = (curve[key] for key in ("low_s", "time_s", "high_s"))
                assert len(low) == len(time) == len(high) == len(values)
                assert (np.array(low) <= time).all()
                assert (np.array(time) <= high).all()
    counts = slices[0]["variables"]["count"]
    assert counts["values"] == [round(value) for value in counts["values"]]
    assert any(counts["failed"])
    assert not all(counts["failed"])


def test_other_physics_is_refused(dogshape: Callable[..., Any], surrogate: Surrogate) -> None:
    save(Path("mine.json"), _stored(surrogate))
    said = dogshape(
        "explore", "mq200_paper", "--surrogate", "mine.json", "--set", "contact.set=adams2019"
    )
    assert said.status == 2
    assert "other physics" in said.sentence


def test_a_slice_has_no_peak_at_a_design_that_was_simulated(study: Setup) -> None:
    """Where the data of a design stray most, its slice is as smooth as anywhere."""
    whole = load(bundled_root() / "mq200_paper" / "surrogate.json").surrogate
    kept = replace(whole, own=None)  # as at an operating point that is none of the study's own
    over = Over(kept, Mix(np.array([[249.0, 469.0]]), np.ones(1), 0.0))
    every = kept.data.designs
    strays = np.abs(over.predict(every)[0] / over.predict(every, alone=False)[0] - 1.0)
    line = np.repeat(every[[strays.argmax()]], 41, axis=0)
    line[:, 0] += np.linspace(-2.0, 2.0, 41)
    pinned, smooth = over.predict(line), over.predict(line, alone=False)
    bends = [np.abs(np.diff(np.log(time), 2)).max() for time in (pinned[0], smooth[0])]
    assert strays.max() > 0.05, "the bundled surrogate has peaks to leave out"
    assert bends[1] < 0.1 * bends[0]
    assert (smooth[1] >= pinned[1] * 0.999).all(), "what is left out of the line is in its error"


def test_all_of_a_front_is_offered(study: Setup) -> None:
    designs = list(islice(filling_designs(study, 5, border=False), RIVALS + 3))
    front = [{"trial": number, **design} for number, design in enumerate(designs)]
    found = {"physics_hash": study.physics_hash, "front": front[:8]}
    assert [base.name for base in bases_of(study, found)[1:]] == [f"design {k}" for k in range(8)]
    assert len(rivals_of(study, {**found, "front": front})) == RIVALS + 3
    assert len(bases_of(study, {**found, "front": front})) == 1 + RIVALS
    assert bases_of(study, {**found, "physics_hash": "other"})[1:] == []
