"""New readings that join a diagnosis: the joint answer, the record of both, and refusals."""

from __future__ import annotations

import json
import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dogshape as ds
from dogshape.bench.bench_data import Bench
from dogshape.bench.table import COLUMNS
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.pipeline.diagnose.gap_update import DiagnosisRecord, HypothesisRecord, sentence
from dogshape.sim.errors import DataError, StorageError
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import GOOD
from tests.diagnoses import EFFECTS, diagnosis_of
from tests.toy import bench_of, points_of

FRICTION, MASS = ("sleeve_friction",), ("moving_mass",)
POINTS = points_of((235.2, 641.5))[2:10]


def _diagnosed(bench: Bench, _: Any) -> Any:
    """Diagnose by a rule: readings above 20 ms are evidence of friction, others of mass."""
    odds = sum(row.n * (row.time - 0.02) for row in bench.readings if row.time is not None)
    log = float(np.clip(odds, -30.0, 30.0))
    friction, mass = 1.0 / (1.0 + math.exp(-log)), 1.0 / (1.0 + math.exp(log))
    every = {FRICTION: 0.96 * friction, MASS: 0.96 * mass, NONE: 0.02, UNKNOWN: 0.02}
    return diagnosis_of(dict(sorted(every.items(), key=lambda one: -one[1])), bench)


@pytest.fixture(autouse=True)
def _by_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dogshape.gap.diagnose_bench", _diagnosed)


def _table(
    path: Path, seed: int, shifts: int, points: Any = POINTS, friction: float = 40.0
) -> Path:
    """Write mean times of the toy with a dry friction as a table."""
    truth = {"friction_N": friction}
    bench = bench_of(truth, np.random.default_rng(seed), shifts=shifts, points=points)
    rows = [
        (f"{r.point.mismatch / RPM:.9g}", r.point.profile.force, r.point.profile.rise, r.n,
         f"{r.time:.6f}", "true")
        for r in bench.readings
    ]  # fmt: skip
    table = pd.DataFrame(rows, columns=[*COLUMNS[:6]]).reindex(columns=[*COLUMNS])
    table.to_csv(path, index=False)
    return path


@pytest.fixture
def stand(tmp_path: Path) -> Path:
    """A data set of few shifts at two points, and the folder of its diagnosis, ``out``."""
    folder = tmp_path / "bench"
    folder.mkdir()
    head = (bundled_root() / "bench" / "mq200_adams" / "bench.toml").read_text()
    (folder / "bench.toml").write_text(head)
    _table(folder / "shifts.csv", 1, 4, POINTS[:2])
    ds.diagnose(folder, out=tmp_path / "out")
    return tmp_path


def _record(folder: Path) -> Any:
    return json.loads((folder / "gap.json").read_text())


def test_an_update_is_the_diagnosis_of_all_readings_at_once(stand: Path) -> None:
    earlier = _record(stand / "out")
    lines = (stand / "bench" / "shifts.csv").read_text()
    for seed in (2, 3):
        new = _table(stand / f"new{seed}.csv", seed, 20)
        lines += new.read_text().partition("\n")[2]
        found = ds.update_diagnosis(stand / "out", new)
    (stand / "bench" / "shifts.csv").write_text(lines)
    at_once = ds.diagnose(stand / "bench")
    assert found.diagnosis.inference.posterior == at_once.inference.posterior
    assert found.diagnosis.causes == ("sleeve_friction",)
    assert _record(stand / "out")["hypotheses"] == at_once.inference.to_dict()["hypotheses"]
    # All answers stay.
    assert json.loads((stand / "out" / "gap-0.json").read_text()) == earlier
    first, second = json.loads((stand / "out" / "updates.json").read_text())
    before = {" + ".join(h["effects"]) or "none": h["probability"] for h in earlier["hypotheses"]}
    assert first["before"]["probabilities"].items() <= before.items()
    assert (first["update"], second["update"], second["before"]) == (1, 2, first["after"])
    assert second["shifts"] == 20 * len(POINTS)
    page = (stand / "out" / "report.html").read_text().replace("\xa0", " ")
    assert escape(second["sentence"]) in page


def test_where_it_was_stopped_the_same_command_gives_the_same(
    stand: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed before the joined data settle, and between the two names of the folder."""
    new = _table(stand / "new.csv", 2, 20)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    earlier = _record(stand / "out")
    with monkeypatch.context() as patch:
        patch.setattr("dogshape.pipeline.diagnose.gap_update.settle_data", killed)
        with pytest.raises(KeyboardInterrupt):
            ds.update_diagnosis(stand / "out", new)
    (stand / "out" / "data").rename(stand / "out" / "data.before")
    assert ds.update_diagnosis(stand / "out", new).record.update == 1
    assert json.loads((stand / "out" / "gap-0.json").read_text()) == earlier
    assert len(json.loads((stand / "out" / "updates.json").read_text())) == 1
    rows = (stand / "out" / "data" / "shifts.csv").read_text().count("\n")
    assert rows == 1 + 2 + len(POINTS)


def test_readings_that_cannot_join_change_nothing(stand: Path) -> None:
    out, new = stand / "out", _table(stand / "new.csv", 2, 5)
    ds.update_diagnosis(out, new)
    before = sorted((p.name, p.stat().st_mtime_ns) for p in out.iterdir() if p.name != ".lock")
    head, *rows = new.read_text().splitlines()
    scaled = [
        [*row[:4], str(1e3 * float(row[4])), *row[5:]] for row in (r.split(",") for r in rows)
    ]
    for lines, words in (
        ([head, *rows], r"joined this diagnosis already \(update 1\)"),
        ([head, rows[0]], "rows from row 2 on repeat rows of the bench"),
        ([head, *(row.replace("0.251,", "0.25,") for row in rows)], "nearly the set values of"),
        ([head.replace("force_N", "force"), *rows], "'force' is not a known column"),
        ([head], "has no rows"),
        ([head, *rows, "50,235.2,0.251,1,9.0,true,"], "row 10"),
        ([head, *map(",".join, scaled)], "write them as the data set of the diagnosis"),
    ):
        (stand / "bad.csv").write_text("\n".join(lines) + "\n")
        with pytest.raises(DataError, match=words):
            ds.update_diagnosis(out, stand / "bad.csv")
    with pytest.raises(DataError, match=r"nowhere.csv cannot be read"):
        ds.update_diagnosis(out, stand / "nowhere.csv")
    with pytest.raises(StorageError, match="holds no diagnosis with its data"):
        ds.update_diagnosis(stand / "bench", new)
    with pytest.raises(StorageError, match="holds a diagnosis with updates"):
        ds.diagnose(stand / "bench", out=out)
    after = sorted((p.name, p.stat().st_mtime_ns) for p in out.iterdir() if p.name != ".lock")
    assert [a for a in after if a[0] != "joining"] == before


def test_single_shifts_that_a_stand_appends_to_its_file_are_copies(stand: Path) -> None:
    bench = bench_of({}, np.random.default_rng(3), shifts=8, single=True, points=POINTS[:2])
    head = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s"
    rows = [
        f"{r.point.mismatch / RPM:.6g},{r.point.profile.force},{r.point.profile.rise},1,"
        f"{(r.time or 0.0) + 0.001 * k:.6f}"
        for k, r in enumerate(bench.readings)
    ]
    for count in (12, 16):
        (stand / f"{count}.csv").write_text("\n".join([head, *rows[:count]]) + "\n")
    ds.update_diagnosis(stand / "out", stand / "12.csv")
    with pytest.raises(DataError, match="rows from row 2 on repeat rows of the bench"):
        ds.update_diagnosis(stand / "out", stand / "16.csv")


def test_traces_go_along(tmp_path: Path) -> None:
    found = ds.diagnose(GOOD, out=tmp_path / "out")
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / "0041.csv").write_bytes((GOOD / "traces" / "0041.csv").read_bytes())
    line = "10,235.2,0.251,1,0.0461,true,traces/0041.csv"
    (tmp_path / "new.csv").write_text(",".join(COLUMNS) + "\n" + line + "\n")
    bench = ds.update_diagnosis(tmp_path / "out", tmp_path / "new.csv").diagnosis.inference.bench
    assert len(bench.readings) == len(found.inference.bench.readings) + 1
    assert (tmp_path / "out" / "data" / "traces" / "update-1" / "traces" / "0041.csv").is_file()


def _state(*chances: tuple[tuple[str, ...], float, float]) -> DiagnosisRecord:
    entries = [
        HypothesisRecord(effects=effects, probability=probability, evidence_probability=evidence)
        for effects, probability, evidence in chances
    ]
    return DiagnosisRecord(
        engine="planar", verdict="unknown", causes=[], credible_set=[], hypotheses=entries
    )


def test_the_sentence_has_odds_in_closed_form() -> None:
    """Odds of evidence that go from 2 : 1 to 1 : 10 make a factor of 20."""
    delay, mass, unknown = ("actuation_delay",), ("moving_mass",), ("unknown",)
    before = _state((delay, 0.6, 0.6), (mass, 0.3, 0.3), (unknown, 0.1, 0.1))
    after = _state((mass, 0.9, 0.8), (delay, 0.1, 0.08), (unknown, 0.0, 0.12))
    said = sentence(before, after, EFFECTS)
    assert "The answer moves from dead time of the actuation (60 % before, 10 % now)" in said
    assert "the new shifts alone are 20 : 1 for mass of actuator and linkage against dead" in said
    lost = _state((unknown, 0.9, 0.9), (delay, 0.1, 0.1))
    assert " : 1" not in sentence(before, lost, EFFECTS)
    stays = _state((delay, 0.9, 0.9), (mass, 0.1, 0.1))
    said = sentence(before, stays, EFFECTS)
    assert said.startswith("The answer stays dead time of the actuation (60 % before, 90 % now)")
    assert said.endswith("are 4.5 : 1 for dead time of the actuation against mass of actuator "
                         "and linkage.")  # fmt: skip
