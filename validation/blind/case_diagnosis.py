"""Diagnosis of a blind case, as a user gets it, and what judges it by the same predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import Place
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.model import Model
from dogshape.pipeline.diagnose.bank_diagnosis import Means, diagnosed, models_of
from dogshape.sim.effects import load
from dogshape.validation.blind.advised_test import Advised, Names, judged_by_test
from dogshape.validation.blind.cases import case_of

PATIENCE = 600.0  #: s to wait for the bank that another case has to complete
ENGINE = "planar"  #: that simulates for the diagnosis


def diagnose_folder(folder: Path) -> dict[str, Any]:
    """Diagnose a blind case."""
    return diagnosed(load_bench(folder), _means(1)).to_dict()


def likelihood_of(folder: Path, sensor: str, model: Model | None = None) -> Likelihood:
    """Build the likelihood of a data set whose displacement is read at a side of the linkage.

    ``model`` is that of its clutch and points, where it is known. A clutch is simulated where no
    bank has it.
    """
    bench: Bench = load_bench(folder)
    record = bench.record.model_copy(update={"displacement_at": cast(Place, sensor)})
    bench = replace(bench, clutch=bench.clutch.with_engine(ENGINE), record=record)
    means = _means(0)
    if model is None:
        (model,) = models_of(bench, load(None), means).values()
    return Likelihood(bench, observe(bench, model), model, means.settings)


def advised(folder: Path, truth: Mapping[str, Any], right: Sequence[Names]) -> Advised | None:
    """Diagnose a case again, make the test that it advises by the truth, and judge the outcome."""
    return judged_by_test(folder, case_of(truth), diagnosed(load_bench(folder), _means(1)), right)


def _means(jobs: int) -> Means:
    return Means(jobs=jobs, patience=PATIENCE, engine=ENGINE)
