"""Schema of ``gap.json``: kept and new records fit it, and any other key is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.diagnosis.diagnosis import diagnose
from dogshape.pipeline.diagnose.gap_schema import InferenceRecord, require_gap
from dogshape.sim.errors import InputError
from tests.toy import EFFECTS, Toy, bench_of, points_of

SOME = {"drift", "nominal_errors"}  #: keys of data sets that say more than their times
EVIDENCE = Path(__file__).parents[2] / "docs" / "evidence"


@pytest.fixture(scope="module")
def found() -> ds.Diagnosis:
    """Diagnosis of a toy bench with two operating points and two effects."""
    points = points_of()[:2]
    bench = bench_of({"delay_s": 0.08}, np.random.default_rng(1), points=points)
    effects = {name: EFFECTS[name] for name in ("actuation_delay", "sleeve_friction")}
    return ds.Diagnosis(diagnose(bench, Toy(points), effects, pairs=[]))


@pytest.fixture
def record(found: ds.Diagnosis) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    return loaded


@pytest.mark.parametrize("name", ["gap_stand.json", "gap_adams.json"])
def test_kept_records_fit(name: str) -> None:
    require_gap(json.loads((EVIDENCE / name).read_text(encoding="utf-8")), name)


def test_a_new_record_fits_with_and_without_its_report(
    found: ds.Diagnosis, record: dict[str, Any]
) -> None:
    require_gap(record, "gap")
    inference = json.loads(json.dumps(found.inference.as_dict(), allow_nan=False))
    require_gap(inference, "gap.json")
    assert set(inference) == set(InferenceRecord.model_fields) - SOME


@pytest.mark.parametrize("place", [(), ("gap",), ("hypotheses", 0), ("next_test",), ("where", 1)])
def test_an_additional_key_fails(record: dict[str, Any], place: tuple[Any, ...]) -> None:
    inner = record
    for step in place:
        inner = inner[step]
    inner["more"] = 1.0
    with pytest.raises(InputError, match="more"):
        require_gap(record, "gap.json")


#: Keys that earlier versions did not write.
LATER = {
    *("classes", "margin_s", "discrepancy", "settings", "engine", "range_ends"),
    "together",
    "influence",
    "foretold",
} | SOME


@pytest.mark.parametrize("key", sorted(set(InferenceRecord.model_fields) - LATER))
def test_a_missing_key_fails(record: dict[str, Any], key: str) -> None:
    del record[key]
    with pytest.raises(InputError, match=f"'{key}' is missing"):
        require_gap(record, "gap.json")


def test_a_mistyped_value_fails(record: dict[str, Any]) -> None:
    record["hypotheses"][0]["probability"] = "high"
    with pytest.raises(InputError, match=r"hypotheses.*probability"):
        require_gap(record, "gap.json")
