"""New readings that join a diagnosis: the joint answer, the record of both, and refusals."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dogshape as ds
from dogshape.diagnosis.bench.bench_data import Bench
from dogshape.diagnosis.bench.table import COLUMNS
from dogshape.diagnosis.terms import NONE, UNKNOWN
from dogshape.pipeline.diagnose.gap_update import sentence
from dogshape.sim.errors import DataError, StorageError
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import GOOD
from tests.conftest import Said
from tests.diagnosed import EFFECTS, diagnosis_of
from tests.toy import bench_of, points_of

Call = Callable[..., Said]
FRICTION, MASS = ("sleeve_friction",), ("moving_mass",)
MIDDLE = 0.02  #: s, mean time at which a reading says nothing
NATS = 1.0  #: per second and shift, log odds of friction over mass
POINTS = points_of((235.2, 641.5))[2:10]


def _log_odds(rows: Any) -> float:
    """Compute the log odds of friction over mass by the times of some rows."""
    return sum(NATS * row.n * (row.time - MIDDLE) for row in rows if row.time is not None)


def _diagnosed(bench: Bench, _: Any) -> Any:
    """Diagnose by a rule: slow readings are evidence of friction, fast ones of mass."""
    log = float(np.clip(_log_odds(bench.readings), -30.0, 30.0))
    friction, mass = 1.0 / (1.0 + math.exp(-log)), 1.0 / (1.0 + math.exp(log))
    every = {FRICTION: 0.96 * friction, MASS: 0.96 * mass, NONE: 0.02, UNKNOWN: 0.02}
    return diagnosis_of(dict(sorted(every.items(), key=lambda one: -one[1])), bench)


@pytest.fixture(autouse=True)
def _by_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dogshape.gap.diagnosed", _diagnosed)


def _table(
    path: Path, seed: int, shifts: int, points: Any = POINTS, friction: float = 40.0
) -> Path:
    """Write mean times of the toy with a dry friction as a table."""
    truth = {"friction_N": friction}
    bench = bench_of(truth, np.random.default_rng(seed), shifts=shifts, points=points)
    rows = [
        {
            "mismatch_rpm": f"{r.point.mismatch / RPM:.9g}",
            "force_N": r.point.profile.force,
            "force_rise_s": r.point.profile.rise,
            "n_shifts": r.n,
            "shift_time_s": f"{r.time:.6f}",
            "engaged": "true",
            "trace": "",
        }
        for r in bench.readings
    ]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
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
    new = _table(stand / "new.csv", 2, 20)
    earlier = _record(stand / "out")
    found = ds.update_diagnosis(stand / "out", new)
    lines = (stand / "bench" / "shifts.csv").read_text() + new.read_text().partition("\n")[2]
    whole = stand / "whole"
    whole.mkdir()
    (whole / "bench.toml").write_text((stand / "bench" / "bench.toml").read_text())
    (whole / "shifts.csv").write_text(lines)
    at_once = ds.diagnose(whole)
    assert found.diagnosis.probabilities.to_dict() == at_once.probabilities.to_dict()
    assert found.diagnosis.causes == ("sleeve_friction",)
    assert _record(stand / "out")["hypotheses"] == at_once.inference.to_dict()["hypotheses"]
    # Both answers stay.
    assert json.loads((stand / "out" / "gap-0.json").read_text()) == earlier
    (update,) = json.loads((stand / "out" / "updates.json").read_text())
    before = {" + ".join(h["effects"]) or "none": h["probability"] for h in earlier["hypotheses"]}
    for name, chance in update["before"]["probabilities"].items():
        assert chance == before[name]
    assert update["after"]["causes"] == ["sleeve_friction"]
    assert update["shifts"] == 20 * len(POINTS)
    assert escape(update["sentence"]) in (stand / "out" / "report.html").read_text()


def test_updates_add_up(stand: Path) -> None:
    for seed in (2, 3):
        ds.update_diagnosis(stand / "out", _table(stand / f"new{seed}.csv", seed, 5))
    updates = json.loads((stand / "out" / "updates.json").read_text())
    assert [one["update"] for one in updates] == [1, 2]
    assert updates[1]["before"] == updates[0]["after"]
    rows = (stand / "out" / "data" / "shifts.csv").read_text().count("\n")
    assert rows == 1 + 2 + 2 * len(POINTS)
    assert not (stand / "out" / "joining").exists()


def test_where_it_was_stopped_the_same_command_gives_the_same(
    stand: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed before the joined data settle, and between the two names of the folder."""
    new = _table(stand / "new.csv", 2, 20)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    earlier = _record(stand / "out")
    with monkeypatch.context() as patch:
        patch.setattr("dogshape.gap.settle_data", killed)
        with pytest.raises(KeyboardInterrupt):
            ds.update_diagnosis(stand / "out", new)
    (stand / "out" / "data").rename(stand / "out" / "data.before")
    found = ds.update_diagnosis(stand / "out", new)
    assert found.record["update"] == 1
    assert json.loads((stand / "out" / "gap-0.json").read_text()) == earlier
    assert len(json.loads((stand / "out" / "updates.json").read_text())) == 1
    rows = (stand / "out" / "data" / "shifts.csv").read_text().count("\n")
    assert rows == 1 + 2 + len(POINTS)


def test_readings_that_cannot_join_change_nothing(stand: Path) -> None:
    out, new = stand / "out", _table(stand / "new.csv", 2, 5)
    ds.update_diagnosis(out, new)
    before = sorted((p.name, p.stat().st_mtime_ns) for p in out.iterdir() if p.name != ".lock")
    with pytest.raises(DataError, match=r"joined this diagnosis already \(update 1\)"):
        ds.update_diagnosis(out, new)
    text = new.read_text()
    for changed, words in (
        (
            text.replace("0.251,", "0.25,"),
            "nearly the set values of others",
        ),
        (text.replace("force_N", "force"), "'force' is not a known column"),
        (text.splitlines()[0] + "\n", "has no rows"),
        (text + "50,235.2,0.251,1,9.0,true,\n", "row 10"),
    ):
        (stand / "bad.csv").write_text(changed)
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


def test_readings_that_the_bench_has_already_are_no_new_ones(stand: Path) -> None:
    """A file that a stand appends to, and shifts whose set values were measured."""
    singles = [POINTS[0], POINTS[3]]
    generator = np.random.default_rng(3)
    bench = bench_of({}, generator, shifts=8, single=True, points=singles)
    times = [float(one.time or 0.0) + generator.uniform(0.0, 0.02) for one in bench.readings]
    head = ("mismatch_rpm", "force_N", "force_rise_s", "n_shifts", "shift_time_s")

    def write(name: str, count: int, force: float = 1.0) -> Path:
        lines = [",".join(head)]
        for one, time in zip(bench.readings[:count], times[:count], strict=True):
            profile = one.point.profile
            numbers = one.point.mismatch / RPM, profile.force * force, profile.rise, 1, time
            lines.append(",".join(f"{number:.6g}" for number in numbers))
        (stand / name).write_text("\n".join(lines) + "\n")
        return stand / name

    ds.update_diagnosis(stand / "out", write("some.csv", 12))
    before = _record(stand / "out")
    with pytest.raises(DataError, match="rows 2 to 13 repeat rows of the bench") as refused:
        ds.update_diagnosis(stand / "out", write("all.csv", 16))
    assert "timestamp" in str(refused.value)
    with pytest.raises(DataError, match="nearly the set values of others") as refused:
        ds.update_diagnosis(stand / "out", write("measured.csv", 5, 1.004))
    assert _record(stand / "out") == before
    head_line, *rows = _table(stand / "ms.csv", 2, 20).read_text().splitlines()
    parts = [row.split(",") for row in rows]
    scaled = [[*row[:4], str(1e3 * float(row[4])), *row[5:]] for row in parts]
    (stand / "ms.csv").write_text("\n".join([head_line, *map(",".join, scaled)]) + "\n")
    with pytest.raises(DataError, match="write them as the data set of the diagnosis") as refused:
        ds.update_diagnosis(stand / "out", stand / "ms.csv")
    assert "--correct" not in str(refused.value)


def test_traces_go_along(tmp_path: Path) -> None:
    found = ds.diagnose(GOOD, out=tmp_path / "out")
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / "0041.csv").write_bytes((GOOD / "traces" / "0041.csv").read_bytes())
    line = "10,235.2,0.251,1,0.0461,true,traces/0041.csv"
    (tmp_path / "new.csv").write_text(",".join(COLUMNS) + "\n" + line + "\n")
    update = ds.update_diagnosis(tmp_path / "out", tmp_path / "new.csv")
    bench = update.diagnosis.inference.bench
    count = len(found.inference.bench.readings)
    traced = [r.trace.path for r in bench.readings if r.trace is not None]
    assert len(bench.readings) == count + 1
    assert traced[-1].parts[-3:] == ("traces", "update-1", "0041.csv") or any(
        "update-1" in path.parts for path in traced
    )
    assert (tmp_path / "out" / "data" / "traces" / "update-1" / "traces" / "0041.csv").is_file()


def test_the_verb_says_before_now_and_why(stand: Path, dogshape: Call) -> None:
    new = _table(stand / "new.csv", 2, 20)
    said = dogshape("gap", "update", stand / "out", new, "--json")
    assert said.status == 0, said.err
    assert said.json["after"]["causes"] == ["sleeve_friction"]
    assert said.json["next_test"]["name"]
    again = dogshape("gap", "update", stand / "out", new)
    assert (again.status, "joined this diagnosis already" in again.sentence) == (2, True)
    text = dogshape("gap", "update", stand / "out", _table(stand / "more.csv", 5, 3)).out
    assert "before" in text
    assert "The answer stays dry friction of the sliding ring" in " ".join(text.split())
    assert "Example: dogshape gap update" in dogshape("gap", "update", "--help").out


def _state(*chances: tuple[tuple[str, ...], float, float]) -> dict[str, Any]:
    names = "effects", "probability", "evidence_probability"
    return {"hypotheses": [dict(zip(names, (list(h), *p), strict=True)) for h, *p in chances]}


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
