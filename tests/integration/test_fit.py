"""A surrogate of a clutch that the package has not seen."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import dogshape as ds
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.surrogate.query import require_same_physics
from tests.integration.studies import SETTINGS, Finished, make_once

FEW = SETTINGS | {
    "surrogate.references": 3,
    "surrogate.best_references": 1,
    "surrogate.reference_angles": 6,
    "surrogate.mix_shifts": 18 * 128,
}
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

    return make_once(tmp_path_factory, "fitted", make)


@pytest.fixture
def fitted(begun: Finished, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Output of the fit; the test stands in a copy of its folder."""
    monkeypatch.chdir(begun.copy(tmp_path / "own"))
    found: dict[str, Any] = json.loads(Path("said.json").read_text())
    return found


def test_the_rows_are_of_the_compiled_engine(fitted: dict[str, Any]) -> None:
    assert fitted["shifts"] == fitted["shifts_planar"] == 18 * 128
    assert fitted["engine"] == "planar"
    assert fitted["seconds"] > 0.0
    assert fitted["designs"] == 18  # with the study's own dog
    assert (fitted["n"], fitted["source"]) == (3, "references")
    study = ds.Study("mq200_paper", FEW).config
    stored, path = stored_surrogate(study, None)
    assert path == SPACE / "surrogate.json"
    require_same_physics(stored.surrogate.data, study.physics)
    assert stored.surrogate.data.physics["scheme"] == study.physics["scheme"]


def test_it_goes_on_where_it_was_stopped(fitted: dict[str, Any]) -> None:
    path = SPACE / "simulated.jsonl"
    whole = path.read_bytes().splitlines(keepends=True)
    assert len(whole) == 18 + 3 + 1
    path.write_bytes(b"".join(whole[: len(whole) // 2]) + b'{"key": "torn')
    again = ds.fit(ds.Study("mq200_paper", FEW), jobs=1).to_dict()
    del again["seconds"], fitted["seconds"]
    assert json.loads(json.dumps(again)) == fitted
    assert path.read_bytes().splitlines(keepends=True) == whole
