"""A search over the dogs of both rings: every part of it, and its limit case of equal rings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import dogshape as ds
from dogshape.pipeline.config.study_file import load_study, pair_of
from dogshape.pipeline.reports.named_design import named_design
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.pipeline.study import run_study
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.units import MM
from tests.conftest import SMALL, search_run
from tests.integration.studies import Finished, designs_of, lines_of, make_once

RANGES = {"height_mm": [2.0, 4.5], "chamfer_deg": [6.0, 16.0], "backlash_mm": [0.0, 0.6]}
KEYS = {
    **dict(map(pair_of, SMALL)),
    **{f"variables.output_dog.{key}": ends for key, ends in RANGES.items()},
}
NAMES = tuple(f"output_dog_{key}" for key in ("chamfer_deg", "height_mm", "backlash_mm"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """The small study of both rings, searched."""

    def search(folder: Path) -> None:
        run_study(load_study("mq200_paper", KEYS), search_run(folder, jobs=1))

    return make_once(tmp_path_factory, "both_rings", search)


def test_both_rings_are_in_every_part_of_a_search(finished: Finished) -> None:
    """Designs, shifts, surrogate and folder; Drake agrees on the chosen design and at random."""
    study = load_study("mq200_paper", KEYS)
    result = finished.result
    assert [result["trials"][0][name] for name in NAMES] == [8.0, 3.7, 0.0]
    for row in result["trials"][1:]:
        assert all(low <= row[key] <= high for key, (low, high) in study.variables.items())
        assert row["axial_length_mm"] == pytest.approx(
            1.0 + row["height_mm"] + row["output_dog_height_mm"]
        )
    kept = [json.loads(line) for line in lines_of(finished.folder, "shifts.jsonl")]
    assert kept
    assert all(set(NAMES) <= row.keys() for row in kept)
    confirmation = result["confirmation"]
    assert confirmation["best"]["drake"]["agrees"]
    assert result["audit"]["agrees"]
    stored, path = stored_surrogate(study, finished.folder / "surrogate.json")
    assert stored.surrogate.data.variables == tuple(study.variables)
    designs = pd.DataFrame({"output_dog_height_mm": [3.2, 3.6], "output_dog_chamfer_deg": 9.0})
    predictions = ds.Study.from_config(study).predict(designs, surrogate=path)
    assert (predictions.times.time > 0.03).all()
    command = predictions.command(dict(zip(study.variables, predictions.designs[0], strict=True)))
    assert command.endswith("--set output_dog.chamfer_deg=9 --set output_dog.height_mm=3.2")


def test_a_search_of_both_rings_goes_on(finished: Finished, tmp_path: Path) -> None:
    """One that ended with fewer trials proposes the same designs as the whole one."""
    run_study(load_study("mq200_paper", KEYS | {"search.trials": 4}), search_run(tmp_path, jobs=1))
    longer = run_study(
        load_study("mq200_paper", KEYS), search_run(tmp_path, jobs=1, resume=True)
    ).to_dict()
    assert designs_of(longer) == designs_of(finished.result)


def test_report_and_design_have_the_output_ring(finished: Finished, tmp_path: Path) -> None:
    folder = finished.copy(tmp_path / "folder")
    report = ds.load_result(folder).report().read_text("utf-8")
    assert "output ring, height h" in report
    designs = pd.read_csv(folder / "designs.csv")
    assert set(NAMES) <= set(designs.columns)
    best = finished.result["best"]
    design = named_design(f"{folder}#{best['trial']}")
    heights = (best["height_mm"], best["output_dog_height_mm"])
    for study in (design.design_study, design.prototype_study):
        pair = study.clutch.pair
        assert (pair.sliding.height, pair.output.height) == pytest.approx(
            [height * MM for height in heights]
        )
        assert study.limits.output_dog == study.clutch.output_dog
    text = ds.compare(f"{folder}#{best['trial']}", f"{folder}#0").to_dict()
    assert "output_dog_height_mm" in json.dumps(text)


def test_a_design_of_both_rings_is_keys_of_a_study() -> None:
    """Keys as a prediction and a result have them."""
    design = {"height_mm": 3.4, "output_dog_height_mm": 3.1, "output_dog_chamfer_deg": 10.0}
    study = ds.Study("mq200_paper", **design)
    changed = ds.Study("mq200_paper", KEYS).replace_keys(**design)
    for config in (study.config, changed.config):
        assert config.clutch.pair.output.height == pytest.approx(3.1 * MM)
        assert config.file.output_dog.chamfer_deg == 10.0
    assert changed.config.prototype["output_dog_height_mm"] == 3.1


def _evaluation(settings: dict[str, Any], params: dict[str, float]) -> Any:
    study = load_study("mq200_paper", dict(map(pair_of, SMALL)) | settings).in_engine("planar")
    (evaluation,) = evaluate(study, [params], scratch_executor(1), 6, 1)
    return evaluation


@pytest.mark.parametrize("height", [3.7, 3.1])
def test_an_output_dog_as_high_as_the_sliding_one_changes_no_digit(height: float) -> None:
    """A searched height that equals the sliding one's: times and landings of equal rings."""
    searched = {"variables.output_dog.height_mm": [height - 0.1, height + 0.1]}
    equal = _evaluation({}, {"height_mm": height})
    same = _evaluation(searched, {"height_mm": height, "output_dog_height_mm": height})
    assert same.expectation == equal.expectation
    assert same.check_inputs.demand == equal.check_inputs.demand
    unlike = _evaluation(searched, {"height_mm": height, "output_dog_height_mm": height - 0.05})
    assert unlike.expectation.mean != equal.expectation.mean
