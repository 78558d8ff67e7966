"""The live page in Chromium: the figures of the command line, offline."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.check import Check, check_design, simulate_quickly
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.reports.whatif_checks import Desk, known_of, with_known
from dogshape.pipeline.reports.whatif_page import designs_of, modules, readable
from dogshape.pipeline.train.filling import filling_designs
from dogshape.pipeline.train.training import validate
from dogshape.pipeline.train.training_rows import study_mix, with_rows
from dogshape.sim.errors import DogshapeError
from dogshape.sim.strength.manufacture import losses
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset, reference_of
from dogshape.surrogate.learning import Effort, condition, fit, fitted
from dogshape.surrogate.mix_times import MixTimes
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import ask
from dogshape.surrogate.store import Stored, load, save
from dogshape.whatif import write_what_if
from tests.browser import look, print_pdf
from tests.conftest import Said

Call = Callable[..., Said]
ROWS = 4  #: of each design of the made-up surrogate
#: A strike, a spectrum and a scatter of the dogs: all that a browser cannot work out by itself.
WHOLE = [
    "strike.ring_inertia_kgm2=0.0003", "strike.input_stiffness_Nm_rad=8000",
    "strike.mismatch_rpm=[100.0, -60.0]", "strike.backlash_deg=0.5",
    "load.accuracy=6", "load.run_out_um=10", "load.spectrum=[[1.0, 1e4], [-0.4, 1e5]]",
]  # fmt: skip

#: Put into the page: waits for its checks, asks for designs and says what it answered.
PROBE = """
<script>
const said = document.body.dataset;
window.addEventListener("error", e => said.error = e.message);
console.error = (...words) => said.error = words.join(" ");
const waiting = setInterval(() => {
  if (said.ready !== "yes") return;
  clearInterval(waiting);
  const answers = QUESTIONS.map(({x, mix, ...more}) => {
    const found = Times.expected(x, mix ?? data.model.mix);
    const near = Times.nearest(x);
    return {times: [found.time, found.low, found.high, found.engaged], distance: near.distance,
      split: [found.bareError, found.retriesError], refused: Times.refusal(x, found),
            warnings: Times.warnings(x, mix ?? data.model.mix).length, ...asked(x, more)};
  });
  said.answers = JSON.stringify(answers);
  said.wide = document.documentElement.scrollWidth > window.innerWidth;
  said.loads = performance.getEntriesByType("resource").length;
  said.rows = document.querySelectorAll("#checks tr").length;
  said.shown = ["time", "margin", "distance", "landing"]
    .map(id => document.getElementById(id).textContent).join("|");
  said.bare = present.time - present.retries;
  said.command = document.getElementById("check").textContent;
}, 50);
</script>
"""


@pytest.fixture(scope="module")
def study() -> Setup:
    """The paper's study with everything that is judged."""
    return load_study("mq200_paper", WHOLE)


@pytest.fixture(scope="module", params=[False, True], ids=["rows", "own-mix"])
def surrogate(
    study: Setup, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    """A surrogate of made-up times, some of whose shifts do not engage.

    Once with a process of the study's own mix, too.
    """
    rng = np.random.default_rng(2)
    designs = [list(one.values()) for one in islice(filling_designs(study, 3, border=False), 30)]
    x = np.repeat(np.array(designs, dtype=float), ROWS, axis=0)
    count = len(x)
    points = np.column_stack([5.0 * 50.0 ** rng.random(count), 235.2 * 2.73 ** rng.random(count)])
    mean = 0.08 * (x[:, 4] / 15.0) ** -0.3 * (points[:, 0] / 50.0) ** -0.1
    mean *= np.exp(0.01 * rng.standard_normal(count))
    engaged = np.maximum(rng.binomial(8, np.clip(1.0 - 0.002 * points[:, 0], 0.3, 1.0)), 1)
    columns = (mean, 0.01 * mean, 0.3 * mean, engaged, np.full(count, 8), np.ones(count))
    data = with_rows(study, np.column_stack([x, points, *columns]))
    model = fit(data, effort=Effort(rows=120, steps=15))
    if request.param:
        model = replace(model, own=_own(study, data))
    path = tmp_path_factory.mktemp("made") / "surrogate.json"
    save(path, Stored(model, validate(model, study_mix(study), _reference(study, model.data.x))))
    return path


def _own(study: Setup, data: Dataset) -> MixTimes:
    """Times over the study's mix that are of other designs than the rows."""
    mix = study_mix(study)
    x = study.rows(list(islice(filling_designs(study, 5, border=False), 24)))
    time = 0.07 * (x[:, 4] / 15.0) ** -0.2 * (1.0 + 0.01 * x[:, 0])
    means = time[:, None] * np.linspace(0.7, 1.3, len(mix.points))
    noise = np.full(1 + len(mix.points), 1e-4)
    return fitted(MixTimes(mix, data, x, means, noise, 9), Effort(rows=24, steps=10))


def _reference(study: Setup, x: Array) -> Any:
    mix = study_mix(study)
    few = np.unique(x, axis=0)[:12] + 0.01
    count = len(mix.points)
    rows = np.repeat(few, count, axis=0)
    points = np.tile(mix.points, (len(few), 1))
    mean = 0.08 * (rows[:, 4] / 15.0) ** -0.3 * (points[:, 0] / 50.0) ** -0.1
    eight = np.full(len(rows), 8.0)
    columns = (mean, 0.01 * mean, 0.3 * mean, eight, eight, np.ones(len(rows)))
    return reference_of(with_rows(study, np.column_stack([rows, points, *columns])), mix)


@pytest.fixture(scope="module")
def page(study: Setup, surrogate: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the study."""
    out = tmp_path_factory.mktemp("page") / "whatif.html"
    return write_what_if(study, out, surrogate).page


def _questions(study: Setup) -> list[dict[str, Any]]:
    """Random designs of the search range: at all points and at one, with other friction."""
    rng = np.random.default_rng(8)
    low, high = (np.array(ends) for ends in zip(*study.variables.values(), strict=True))
    asked: list[dict[str, Any]] = []
    for k, row in enumerate(low + rng.random((24, len(low))) * (high - low)):
        x = [*row[:-1].tolist(), float(round(row[-1]))]
        one: dict[str, Any] = {"x": x, "tolerances": True}
        if k % 3 == 1:
            point = [float(5 + 10 * k), 300.0] if k % 2 else [25.0, 469.0]  # or of the study
            one["mix"] = {"points": [point], "weights": [1]}
        if k % 3 == 2:
            one |= {"friction_release": 0.1 + 0.005 * k, "friction_hold": 0.002 * k}
        asked.append(one)
    return asked


@pytest.fixture(scope="module")
def told(study: Setup, surrogate: Path) -> Surrogate:
    """The surrogate of the page, which knows the simulated time of the study's own design."""
    return condition(load(surrogate).surrogate, simulate_quickly(study).rows)


def _as_command(study: Setup, surrogate: Path, asked: dict[str, Any]) -> Check | str:
    """Check a design as the command line does; where it refuses, its sentence."""
    design = study.named(asked["x"])
    sets = [f"dog.{key}={value!r}" for key, value in design.items()]
    sets += [f"load.{key}={asked[key]}" for key in asked if key.startswith("friction")]
    point = asked["mix"]["points"][0] if "mix" in asked else (None, None)
    try:
        return check_design(load_study("mq200_paper", [*WHOLE, *sets]), *point, surrogate=surrogate)
    except DogshapeError as error:
        return str(error)


def test_the_page_has_the_figures_of_the_command_line(
    study: Setup, surrogate: Path, told: Surrogate, page: Path, tmp_path: Path
) -> None:
    asked = _questions(study)
    seen = look(page, tmp_path, PROBE.replace("QUESTIONS", json.dumps(asked)), window="1280,900")
    assert "error" not in seen
    answers = json.loads(seen["answers"])
    compared = 0
    for one, answer in zip(asked, answers, strict=True):
        found = _as_command(study, surrogate, one)
        if isinstance(found, str):
            assert answer["refusal"] == found
            continue
        x = np.array(one["x"])
        expected = told.expected(x, found.mix)
        times = (expected.time, expected.low, expected.high, expected.engaged)
        assert answer["times"] == pytest.approx(times, rel=2e-4)
        assert answer["split"] == pytest.approx(
            [expected.without_retries[1], expected.retries_error], rel=1e-3, abs=1e-6
        )
        reply = ask(told, study.named(x), found.mix, study.physics)
        assert (answer["refused"] == "") == (reply.expected is not None)
        assert answer["distance"] == pytest.approx(reply.distance, rel=1e-6)
        assert answer["warnings"] == len(reply.warnings)
        record = {check["name"]: check for check in found.to_dict()["checks"]}
        assert set(record) == {check["name"] for check in answer["checks"]}
        for check in answer["checks"]:
            known = record[check["name"]]
            assert check["value"] == pytest.approx(known["value"], rel=1e-6, abs=1e-9)
            assert check["limit"] == pytest.approx(known["limit"], rel=1e-6)
            assert check["margin"] == pytest.approx(known["margin"], rel=1e-6, abs=1e-7)
            worst = check["margin"] - answer["lost"].get(check["name"], 0.0)
            assert worst == pytest.approx(known["margin_worst_case"], rel=1e-5, abs=1e-6)
        compared += 1
    assert compared >= 12


def test_the_page_opens_offline_fits_and_begins_with_the_studys_design(
    study: Setup, surrogate: Path, page: Path, tmp_path: Path
) -> None:
    seen = look(page, tmp_path, PROBE.replace("QUESTIONS", "[]"), window="1280,900")
    assert "error" not in seen
    assert (seen["wide"], seen["loads"]) == ("false", "0")
    found = check_design(study)
    weakest = min(check.margin for check in found.design.checks)
    time, margin, _, landing = seen["shown"].split("|")
    # The page is conditioned on the simulated time, whatever the surrogate said before.
    assert found.expected is not None
    assert float(time.split()[0]) >= 1e3 * float(seen["bare"]) - 0.05
    assert float(seen["bare"]) == pytest.approx(found.expected.without_retries[0], rel=0.02)
    assert landing == "landing judged"
    assert {"edge_pressure_impact", "face_pressure_impact"} <= {
        check.name for check in found.design.checks
    }
    assert float(margin.replace("\N{MINUS SIGN}", "-").split()[0]) == pytest.approx(
        100 * weakest, abs=0.5
    )
    assert int(seen["rows"]) > len(found.design.checks)
    assert seen["command"] == "dogshape check mq200_paper"


def test_the_page_prints(page: Path, tmp_path: Path) -> None:
    pages = print_pdf(page, tmp_path).count(b"/Type /Page\n")
    assert 1 <= pages <= 3


def test_what_a_browser_cannot_work_out_is_known_for_every_design(study: Setup) -> None:
    counts = study.variables["count"]
    known = known_of(study.clutch.dog, study.limits, range(int(counts[0]), int(counts[1]) + 1))
    desk, count = Desk(study.clutch.dog, with_known(study.limits, known)), len(known)
    for design in islice(filling_designs(study, 5, border=False), 40):
        answer = json.loads(desk.answer(json.dumps({"design": design, "tolerances": True})))
        assert answer["checks"]
    assert {key.split()[0] for key in known} == {"load", "landing", "strike"}
    assert len(known) == count


def test_modules_of_the_page_are_those_of_the_package() -> None:
    found = modules()
    name = losses.__module__
    assert found[name][1] == Path(losses.__code__.co_filename).read_text("utf-8")
    imported = {one for module in found.values() for one in module[2]}
    assert imported <= set(found)
    assert not any("import scipy" in module[1] for module in found.values())
    assert readable(r'"\N{MINUS SIGN}"') == r'"\u2212"'


def test_the_verb_writes_the_page_and_says_what_it_offers(
    surrogate: Path, dogshape: Call, tmp_path: Path
) -> None:
    asked = ("whatif", "mq200_paper", "--surrogate", surrogate, "--out", "live.html", "--json")
    said = dogshape(*asked, *(f"--set={one}" for one in WHOLE))
    assert said.status == 0, said.err
    record = json.loads(said.out)
    assert Path(record["file"]).is_file()
    assert record["operating_points"] == 28
    assert record["designs"][0]["values"] == [8.0, 12.0, 22.0, 3.7, 15.0]


def test_designs_of_other_physics_are_left_out(study: Setup) -> None:
    front = [{"trial": 7, **study.prototype, "height_mm": 3.0, "expected_shift_time_s": 0.06}]
    front.append({"trial": 8, **study.prototype})
    found = {"physics_hash": study.physics_hash, "front": front}
    own = {"expected_shift_time_s": 0.07}
    both = designs_of(study, found, own)
    assert [one["name"] for one in both] == ["the study's own design", "design 7"]
    assert [one["simulated_s"] for one in both] == [0.07, 0.06]
    assert both[1]["values"] == [8.0, 12.0, 22.0, 3.0, 15.0]
    assert designs_of(study, {**found, "physics_hash": "other"}, own) == both[:1]
    assert designs_of(study, None, own) == both[:1]


def test_a_study_that_moves_its_points_is_refused(dogshape: Call) -> None:
    said = dogshape("whatif", "mq200_actuation")
    assert said.status == 2
    assert "which moves its operating points" in said.sentence
