"""Calibrated studies with draws from the posterior, and the effect of a cause on the choice."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dogshape as ds
from dogshape.bench.bench_data import load_bench
from dogshape.diagnosis.terms import NONE, UNKNOWN, Hypothesis
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import toml_text
from dogshape.pipeline.diagnose.consequence import load_candidates, simulate_consequence
from dogshape.pipeline.diagnose.study_keys import effect_settings, has_keys_for
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.errors import DataError, InputError
from dogshape.sim.setting import Setting
from dogshape.sim.shift.trace import OVERLAPS
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.hangs import weak_priors
from dogshape.sim.statistics.shift_records import Record
from dogshape.sim.units import MM
from dogshape.sim.versions import bundled_root
from tests.conftest import Call
from tests.diagnoses import EFFECTS, diagnosis_of
from tests.search_results import bundled_folder

BENCH = load_bench("mq200_adams")
CLUTCH = BENCH.clutch
DELAY: Hypothesis = ("actuation_delay",)
RUBBED: Hypothesis = ("actuation_delay", "sleeve_friction")


def _found(*hypotheses: Hypothesis) -> ds.Diagnosis:
    """Diagnose by hand: the first hypothesis has 97 %, the others and none share the rest."""
    others = [h for h in (*hypotheses[1:], NONE, UNKNOWN) if h != hypotheses[0]]
    posterior = {hypotheses[0]: 0.97} | dict.fromkeys(others, 0.03 / len(others))
    return ds.Diagnosis(diagnosis_of(posterior, BENCH))


def test_a_study_has_the_posterior_mean_and_its_draws_the_interval(tmp_path: Path) -> None:
    found, path = _found(DELAY), tmp_path / "stand.toml"
    made = found.calibrated(path, draws=2000)
    interval = found.inference.fits[DELAY].intervals["delay_s"]
    study = load_study(path)
    assert study.name == "stand"
    assert study.actuation.delay == pytest.approx(interval.mean, rel=1e-5)
    assert len(study.points) == len(BENCH.cells)
    drawn = pd.read_csv(path.with_name("stand-draws.csv"))["effects.actuation_delay"].to_numpy()
    assert len(drawn) == 2000
    sd = drawn.std()
    assert drawn.mean() == pytest.approx(interval.mean, abs=4.0 * sd / np.sqrt(2000))
    inside = ((drawn >= interval.low) & (drawn <= interval.high)).mean()
    assert inside == pytest.approx(0.9, abs=4.0 * np.sqrt(0.9 * 0.1 / 2000))
    assert made.study.config_hash == study.config_hash


def test_another_set_of_effects_is_written_where_it_is_asked_for(tmp_path: Path) -> None:
    found, path = _found(DELAY, RUBBED), tmp_path / "other.toml"
    assert found.calibrated(path, draws=20, causes=RUBBED[::-1]).hypothesis == RUBBED
    interval = found.inference.fits[RUBBED].intervals["friction_N"]
    assert load_study(path).clutch.mechanism.friction == pytest.approx(interval.mean, rel=1e-5)
    assert "; open (" in path.read_text(encoding="utf-8")


def test_the_gap_is_one_of_the_dog_and_the_friction_one_of_the_contact(tmp_path: Path) -> None:
    found = _found(("contact_friction",))
    assert found.causes == ("contact_friction",)
    study = found.calibrated(tmp_path / "rubbing.toml").study
    mean = found.inference.fits["contact_friction",].intervals["dynamic_friction"].mean
    assert study.clutch.contact.dynamic_friction == pytest.approx(mean, rel=1e-5)
    wider = effect_settings(CLUTCH, EFFECTS["axial_gap"], {"gap_offset_mm": 0.3})
    assert wider == {"dog.axial_gap_mm": pytest.approx(CLUTCH.dog.axial_gap / MM + 0.3)}


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("force_loss", {"loss_N": 25.0}),
        ("force_rise", {"rise_factor": 1.4}),
        ("linkage_compliance", {"compliance_mm_kN": 3.0, "mass_behind_kg": 2.0}),
        ("sliding_inertia", {"inertia_factor": 2.5}),
    ],
)
def test_force_linkage_and_inertia_are_written_as_effects(
    name: str, values: dict[str, float]
) -> None:
    plain = load_study("mq200_paper")
    assert has_keys_for(plain.clutch, EFFECTS[name])
    for other in ("relative_angle", "reversed_mismatch", "mismatch_speed"):
        assert not has_keys_for(plain.clutch, EFFECTS[other])
    study = load_study("mq200_paper", effect_settings(plain.clutch, EFFECTS[name], values))
    there = EFFECTS[name].apply(Setting(plain.clutch, plain.points[0]), values)
    assert (study.clutch, study.points[0]) == (there.clutch, there.point)


def test_what_a_base_sets_itself_gives_way(tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    text = load_study("mq200_paper").file.model_dump(exclude_none=True)
    base.write_text(toml_text({**text, "mechanism": {"delay_s": 0.5, "added_mass_kg": 0.3}}, {}))
    made = _found(DELAY).calibrated(tmp_path / "both.toml", base=str(base))
    assert made.study.actuation.delay == pytest.approx(0.078, abs=0.005)
    assert made.study.mechanism["added_mass_kg"] == 0.3
    assert "mechanism.delay_s of the study is replaced by that of the bench" in made.remarks


@pytest.mark.parametrize(
    ("posterior", "causes", "words"),
    [
        ({NONE: 0.97, DELAY: 0.03}, None, "No effect needed.*take the study as it is"),
        ({UNKNOWN: 0.97, DELAY: 0.03}, None, r"Unknown: .*make the next test \(traces of 10"),
        ({DELAY: 0.97, NONE: 0.03}, RUBBED[1:], r"lack a part of the cause \(act.*of: actuation"),
        ({DELAY: 0.97, NONE: 0.03}, ["sleeve_fricton"], "did you mean 'sleeve_friction'"),
    ],
)
def test_where_nothing_fits_nothing_is_written(
    tmp_path: Path, posterior: dict[Hypothesis, float], causes: list[str] | None, words: str
) -> None:
    found = ds.Diagnosis(diagnosis_of(posterior, BENCH))
    with pytest.raises(InputError, match=words):
        found.calibrated(tmp_path / "stand.toml", causes=causes)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A diagnosis of a toy's dead time, or of no effect for the bench ``none``."""

    def diagnose_bench(bench: str, **_: Any) -> ds.Diagnosis:
        return _found(NONE if bench == "none" else DELAY)

    monkeypatch.setattr("dogshape.gap.diagnose", diagnose_bench)


@pytest.mark.usefixtures("_toy")
def test_the_verb_writes_a_study_and_prints_the_diagnosis_where_it_cannot(
    dogshape: Call, tmp_path: Path
) -> None:
    said = dogshape("diagnose", "late", "--write", "late.toml", "--draws", 7, "--json")
    assert said.status == 0
    told: Mapping[str, Any] = said.json["calibrated"]
    assert (told["study"], told["n_draws"]) == ("late.toml", 7)
    assert load_study(tmp_path / "late.toml").name == "late"
    assert "7 draws" in dogshape("diagnose", "late", "--write", "again.toml", "--draws", 7).out
    refused = dogshape("diagnose", "none", "--write", "none.toml", "--json")
    assert (refused.status, refused.json["verdict"]) == (2, "none")
    assert "names no effect" in refused.sentence
    for arguments, words in (
        (("--write", "late.toml"), "there already"),
        (("--write", "late.json"), "name it NAME.toml"),
        (("--write", "a b.toml"), "name is 'a b'"),
        (("--write", "nowhere/late.toml"), "there is no folder nowhere"),
        (("--base", "mq200_paper"), "give --write FILE too"),
        (("--write", "new.toml", "--base", "mq20"), "there is no study at mq20"),
    ):
        said = dogshape("diagnose", "late", *arguments)
        assert (said.status, words in said.sentence) == (2, True), said.err


DRAWN = ["operating.mismatch_rpm=[50]", "operating.force_N=[469.0]", "solver.engine=planar"]


def test_draws_of_a_dead_time_move_the_mean_by_themselves(tmp_path: Path) -> None:
    """Times are later by each draw's dead time to the digit, so their interval is its own.

    A try that hangs costs it once more: by 1/(1 - q) with the probability of hangs not seen.
    """
    made = _found(DELAY).calibrated(tmp_path / "late.toml", base="mq200_paper", draws=6)
    words = "friction of the bench is 0.3 and 0.16, that of the study 0.12 and 0.1"
    assert made.remarks == (words,)
    delays = pd.read_csv(tmp_path / "late-draws.csv")["effects.actuation_delay"].to_numpy()
    spread = ds.expect_draws(tmp_path / "late.toml", tmp_path / "late-draws.csv", DRAWN, angles=3)
    points = len(spread.studies[0].points)
    hang = weak_priors(points)[0].posterior(0, 3).mean  # a retry costs the dead time again
    later = delays / (1.0 - hang)
    apart = spread.times - later
    assert np.ptp(apart) < 1e-9
    low, high = np.quantile(later, (0.05, 0.95)) + apart[0]
    # All draws have the same few angles, whose error comes on top.
    assert spread.error_s > 0.0
    assert spread.interval_s[0] < low < high < spread.interval_s[1]


def _run(blocks: Sequence[Block]) -> list[list[Record]]:
    """Time is the height, and with added mass a tenth of a second for each degree of chamfer."""
    return [[_row(block)] * len(block.angles) for block in blocks]


def _row(block: Block) -> Record:
    dog, heavy = block.clutch.dog, block.clutch.mechanism.added_mass > 0.0
    time = dog.height * 10.0 + (0.1 * math.degrees(dog.chamfer) if heavy else 0.0)
    loads = [0.0] * (len(OVERLAPS) - 1) + [20000.0 if heavy and dog.height < 3.1e-3 else 1.0]
    entry = {"relative_angle_deg": 0.0, "count": dog.count, "face_contacts": 0, "slots_skipped": 0}
    times = {"outcome": "engaged", "shift_time_s": time, "actuator_time_s": 9.0}
    return {**times, **entry, "landing_loads_N_mm": loads}


def test_an_effect_that_turns_the_order_has_its_price(study: Setup) -> None:
    flat = {**study.prototype, "height_mm": 3.0, "chamfer_deg": 9.0}
    blunt = {**study.prototype, "height_mm": 3.2, "chamfer_deg": 6.0}
    low = {**study.prototype, "height_mm": 3.0, "chamfer_deg": 5.0}
    designs = {"prototype": dict(study.prototype), "flat": flat, "blunt": blunt, "low": low}
    found = simulate_consequence(
        study, designs, {"moving_mass": {"added_mass_kg": 1.0}}, EFFECTS, _run
    )
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
    folder = bundled_folder(tmp_path / "mine")
    _, before = load_candidates(folder.root)
    result = folder.stored_result()
    chosen = result["confirmation"]["chosen"]
    other = next(d for d in result["confirmation"]["designs"] if d["trial"] != chosen)
    assert f"design {other['trial']}" in before
    other["checks"][-1]["passed"] = False
    folder.result.write_text(json.dumps(result), encoding="utf-8")
    _, after = load_candidates(folder.root)
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
        DataError,
        match=r"no result of the study truck in runs/first; run study.search\(resume=True",
    ):
        load_candidates(folder.root)
    shutil.copy(bundled_root() / "mq200_paper" / "result.json", folder.result)
    found, designs = load_candidates(folder.root)
    assert found.name == "truck"
    assert designs == load_candidates("mq200_paper")[1]
