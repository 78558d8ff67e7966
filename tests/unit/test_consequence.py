"""What an effect means for the choice of a design."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.diagnose.consequence import consequence, studied
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.effects import load
from dogshape.sim.errors import DataError
from dogshape.sim.shift.loads import OVERLAPS
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.versions import bundled_root
from tests.kept import kept_folder

EFFECTS = load()


@pytest.fixture(scope="module")
def study() -> Setup:
    return load_study("mq200_paper")


def _run(blocks: Sequence[Block]) -> list[list[Record]]:
    """Time is the height, and with added mass a tenth of a second for each degree of chamfer."""
    return [[_row(block)] * len(block.angles) for block in blocks]


def _row(block: Block) -> Record:
    dog, heavy = block.clutch.dog, block.clutch.mechanism.added_mass > 0.0
    time = dog.height * 10.0 + (0.1 * math.degrees(dog.chamfer) if heavy else 0.0)
    loads = [0.0] * (len(OVERLAPS) - 1) + [20000.0 if heavy and dog.height < 3.1e-3 else 1.0]
    return {
        "outcome": "engaged",
        "shift_time_s": time,
        "actuator_time_s": 9.0,
        "landing_loads_N_mm": loads,
    }


def _designs(study: Setup) -> dict[str, dict[str, float]]:
    flat = {**study.prototype, "height_mm": 3.0, "chamfer_deg": 9.0}
    blunt = {**study.prototype, "height_mm": 3.2, "chamfer_deg": 6.0}
    return {"prototype": dict(study.prototype), "flat": flat, "blunt": blunt}


def test_an_effect_that_turns_the_order_has_its_price(study: Setup) -> None:
    low = {**study.prototype, "height_mm": 3.0, "chamfer_deg": 5.0}
    designs = {**_designs(study), "low": low}
    found = consequence(study, designs, {"moving_mass": {"added_mass_kg": 1.0}}, EFFECTS, _run)
    # Low dogs are the fastest, but land too hard.
    assert min(found.candidates, key=lambda one: one.with_effect.mean).name == "low"
    assert (found.chosen.name, found.best.name) == ("flat", "blunt")
    assert found.regret == pytest.approx((0.03 + 0.9) - (0.032 + 0.6))
    # The lowest dogs land on a face that takes less than that.
    margins = [one["with_landing_margin"] < 0.0 for one in found.record["candidates"]]
    assert margins == [False, True, False, True]
    assert found.sentence == (
        "With the cause blunt is best. Landings with the cause overload flat, low."
    )
    assert found.record["best_with"] == "blunt"


def test_a_design_that_failed_at_the_new_angles_is_left_out(tmp_path: Path) -> None:
    folder = kept_folder(tmp_path / "mine")
    _, before = studied(folder.root)
    result = folder.stored_result()
    chosen = result["confirmation"]["chosen"]
    other = next(d for d in result["confirmation"]["designs"] if d["trial"] != chosen)
    assert f"design {other['trial']}" in before
    other["checks"][-1]["passed"] = False
    folder.result.write_text(json.dumps(result), encoding="utf-8")
    _, after = studied(folder.root)
    assert list(after)[:2] == ["prototype", f"design {chosen}"]
    assert f"design {other['trial']}" not in after


def test_a_folder_of_results_is_a_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever its study file lies, and however the folder is called."""
    monkeypatch.chdir(tmp_path)
    own = load_study("mq200_paper", ["name=truck"])
    folder = StudyFolder(Path("runs") / "first")
    folder.root.mkdir(parents=True)
    folder.open(own, resume=False)
    with pytest.raises(
        DataError, match=r"no result of the study truck in runs/first; run .*--resume"
    ):
        studied(folder.root)
    shutil.copy(bundled_root() / "mq200_paper" / "result.json", folder.result)
    found, designs = studied(folder.root)
    assert found.name == "truck"
    assert designs == studied("mq200_paper")[1]
