"""A surrogate of a clutch that the package has not seen."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.train.mix_rows import angles_of, mix_rows
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.statistics.blocks import even_block, run_block
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.units import RPM
from dogshape.surrogate.dataset import COLUMNS
from dogshape.surrogate.query import require_same_physics
from tests.conftest import SMALL, Said
from tests.integration.studies import SETTINGS, Finished, made_once

FEW = SETTINGS | {
    "surrogate.designs": 12,
    "surrogate.points": 2,
    "surrogate.angles": 8,
    "surrogate.references": 3,
    "surrogate.best_references": 0,
    "surrogate.reference_angles": 6,
    "surrogate.reference_error": 0.2,
    "surrogate.mix_shifts": 18 * 128,
}
OWN = 1344  #: shifts of the study's own dog
SPACE = Path("results/mq200_paper-space")


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """A folder in which such a fit has ended."""

    def make(folder: Path) -> None:
        with pytest.MonkeyPatch.context() as patch:
            folder.mkdir(parents=True)
            patch.chdir(folder)
            fitted = ds.fit(ds.Study("mq200_paper", FEW), jobs=1)
            Path("said.json").write_text(json.dumps(fitted.to_dict()))

    return made_once(tmp_path_factory, "fitted", make)


@pytest.fixture
def fitted(begun: Finished, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the fit said; the test stands in a copy of its folder."""
    monkeypatch.chdir(begun.copy(tmp_path / "own"))
    found: dict[str, Any] = json.loads(Path("said.json").read_text())
    return found


def test_the_rows_are_of_the_compiled_engine(fitted: dict[str, Any]) -> None:
    assert fitted["shifts"] == OWN + 12 * 2 * 8
    assert fitted["engine"] == "planar"
    assert fitted["seconds"] > 0.0
    assert (fitted["designs"], fitted["mix_designs"]) == (13, 19)  # with the study's own dog
    assert (fitted["n"], fitted["source"]) == (3, "references")
    study = ds.Study("mq200_paper", FEW).config
    stored, path = stored_surrogate(study, None)
    assert path == SPACE / "surrogate.json"
    require_same_physics(stored.surrogate.data, study.physics)
    assert stored.surrogate.data.physics["scheme"] == study.physics["scheme"]


def test_the_own_dog_of_the_study_has_its_simulated_time(fitted: dict[str, Any]) -> None:
    found = ds.Study("mq200_paper", FEW).check()
    assert found.guess is not None
    assert found.guess.path == SPACE / "surrogate.json"
    told, seen = found.guess.answer.expected, found.expected
    assert told is not None
    assert seen is not None
    assert told.without_retries[0] == pytest.approx(seen.without_retries[0], rel=0.04)
    assert not found.missed
    assert not found.design.not_checked


def test_rows_have_the_mean_of_many_even_angles(fitted: dict[str, Any]) -> None:
    """Half of a design's angles are where its times jump: they say what 512 even ones say."""
    study = ds.Study("mq200_paper", FEW).config.working
    rows = mix_rows(study, StudyFolder(SPACE))
    size, first = len(study.points), len(study.variables)
    there = [(point.mismatch / RPM, point.profile.force) for point in study.points]
    ratios = []
    for row in rows[: 3 * size]:
        clutch = study.clutch.with_dog(study.dog_with(study.named(row[:first])))
        found = dict(zip(COLUMNS, row[first:], strict=True))
        place = there.index((found["mismatch_rpm"], found["force_N"]))
        shifts = run_block(even_block(clutch, study.points[place], 512, (5, place)))
        times = np.array([shift["shift_time_s"] for shift in shifts], dtype=float)
        parts = [times[::step] for step in (1, 512 // angles_of(study))]
        many, few = (variance_of_mean(part[np.isfinite(part)]) for part in parts)
        own = found["standard_error_s"]
        assert found["shifts"] == angles_of(study)
        assert found["mean_s"] == pytest.approx(np.nanmean(times), abs=4.0 * (many + own**2) ** 0.5)
        ratios.append(own**2 / few)
    assert np.mean(ratios) < 0.25, "of the variance of as many even angles"


def test_a_check_asks_it(fitted: dict[str, Any], dogshape: Callable[..., Said]) -> None:
    own = [part for text in SMALL for part in ("--set", text)]
    said = dogshape("check", "mq200_paper", *own, "--json")
    assert said.json["low_s"] < said.json["expected_shift_time_s"] < said.json["high_s"]


def test_it_goes_on_where_it_was_stopped(fitted: dict[str, Any]) -> None:
    files = ("shifts.jsonl", "references.jsonl", "mix.jsonl")
    whole = {name: (SPACE / name).read_bytes() for name in files}
    for name, content in whole.items():
        lines = content.splitlines(keepends=True)
        (SPACE / name).write_bytes(b"".join(lines[: len(lines) // 2]))
    again = ds.fit(ds.Study("mq200_paper", FEW), jobs=1).to_dict()
    del again["seconds"], fitted["seconds"]
    assert json.loads(json.dumps(again)) == fitted
    for name, content in whole.items():
        kept = (SPACE / name).read_bytes()
        assert len(kept.splitlines()) == len(content.splitlines())
