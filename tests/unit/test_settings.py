"""Settings of a diagnosis: they decide it and are kept with it (docs/api/diagnosis.md)."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, replace

import pytest

from dogshape.diagnosis.settings import USUAL, Settings, described
from tests.diagnosed import simulated_bench, simulated_diagnosis

MOST = 40  #: constants that decide an answer


def test_a_record_keeps_its_settings_and_they_decide() -> None:
    """A limit that nothing reaches names nothing."""
    bench = simulated_bench({"actuation_delay": {"delay_s": 0.08}})
    usual = simulated_diagnosis(bench)
    assert (usual.verdict.kind, usual.verdict.causes) == ("effect", ("actuation_delay",))
    other = replace(USUAL, named=1.0, part=1.0)
    never = simulated_diagnosis(bench, other)
    assert (never.verdict.kind, never.verdict.causes) == ("ambiguous", ())
    kept = json.loads(json.dumps(never.to_dict(), allow_nan=False))["settings"]
    assert kept == json.loads(json.dumps(asdict(other)))
    assert (kept["named"], usual.to_dict()["settings"]["named"]) == (1.0, 0.8)


def test_each_setting_has_unit_meaning_and_status() -> None:
    for name, _, metadata in described(USUAL):
        assert metadata["meaning"], name
        assert metadata["unit"], name
        assert metadata["status"] in {"measured", "judged"}, name
    assert sum(USUAL.discrepancy_shape) == pytest.approx(1.0)
    assert len(fields(Settings)) <= MOST
