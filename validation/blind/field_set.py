"""A field set: its data, the yardstick of each case, and the seal over both.

    DIR/cases/case_000/     a data set; its name says nothing
    DIR/stands/large/       clutch and all operating points of the cases on it, without times
    DIR/manifest.json       hashes of key, data and scoring code, and the list of headline figures
    DIR/key.json            truths, yardsticks and a salt
    DIR/making/             finished cases while a set is made; removed once it is sealed

Of several candidates of a case the first one that is clear is kept, else the one with the largest
yardstick. The yardstick (``validation.blind.yardstick``) is computed before anything is diagnosed,
and sealed with the truth that it belongs to.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from shutil import rmtree
from typing import Any

from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.prediction.model import Model
from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.cases import CLUTCHES, Case, case_of, field_cases
from dogshape.validation.blind.data import (
    bench_text,
    expect,
    expect_case,
    mean_progress,
    simulate_case,
    write_case,
)
from dogshape.validation.blind.score import CLEAR, HEADLINES, scoring_code
from dogshape.validation.blind.sealed import FORMAT, Advance, hash_of, ignore, read, run_all
from dogshape.validation.blind.stand import read_points, read_stand
from dogshape.validation.blind.yardstick import Yardstick, power_of, rivals_of, visible_causes

Record = dict[str, Any]  #: key, manifest and parts of them, as they are kept in JSON
#: Likelihood of a data set: its folder, the side of the linkage of its sensor, and a known model.
LikelihoodOf = Callable[[Path, str, Model | None], Likelihood]

MAKING = "making"
STANDS = "stands"


def base(stand: str) -> Path:
    """Return the folder of a bundled clutch."""
    return bundled_root() / CLUTCHES[stand]


def cases_of(seed: int | None = None, *, small: bool = False) -> dict[str, tuple[Case, ...]]:
    """Draw the cases of a set by name, each as a tuple of its candidates."""
    clutches = list(CLUTCHES)[:1] if small else CLUTCHES
    grids = {name: read_points(base(name)) for name in clutches}
    cases = field_cases(grids, seed, small=small)
    return {f"case_{k:03d}": candidates for k, candidates in enumerate(cases)}


def make_field(
    folder: Path,
    cases: dict[str, tuple[Case, ...]],
    likelihood_of: LikelihoodOf,
    jobs: int = 1,
    advance: Advance = ignore,
) -> Record:
    """Write a sealed field set and return its manifest; a stopped run goes on.

    ``likelihood_of`` simulates a clutch that no bank has; with ``jobs`` above 1 it has to be
    picklable. ``advance`` counts cases.

    StorageError where the folder has a set already.
    """
    if (folder / "manifest.json").exists():
        raise StorageError(f"{folder} has a set of cases already; give another folder")
    for stand in sorted({candidates[0].stand for candidates in cases.values()}):
        stand_folder = folder / STANDS / stand
        stand_folder.mkdir(parents=True, exist_ok=True)
        table = (base(stand) / "shifts.csv").read_text(encoding="utf-8")
        write_whole(stand_folder / "bench.toml", bench_text(base(stand), stand))
        write_whole(stand_folder / "shifts.csv", table)
        likelihood_of(stand_folder, "sleeve", None)
    calls = []
    for name, candidates in cases.items():
        records = [candidate.record() for candidate in candidates]
        calls.append((folder, name, records, likelihood_of))
    run_all(_make_case, calls, jobs, advance)
    return _seal(folder, list(cases))


def _make_case(
    folder: Path, name: str, candidates: list[Record], likelihood_of: LikelihoodOf
) -> None:
    """Make a case of its candidates, unless an interrupted run made it of the same ones."""
    path = folder / MAKING / f"{name}.json"
    candidates = json.loads(json.dumps(candidates))
    if path.exists() and read(path, "remove it")["asked"] == candidates:
        return
    records = _make_candidates(folder, name, candidates, likelihood_of)
    noncentralities = [float(r["yardstick"].get("noncentrality", 0)) for r in records]
    best = noncentralities.index(max(noncentralities))
    rmtree(folder / "cases" / name, ignore_errors=True)
    (folder / "cases").mkdir(exist_ok=True)
    (folder / MAKING / f"{name}_{best}" / name).rename(folder / "cases" / name)
    for k in range(len(records)):
        rmtree(folder / MAKING / f"{name}_{k}", ignore_errors=True)
    write_whole(path, json.dumps({"asked": candidates, "made": records[best]}))


def _make_candidates(
    folder: Path, name: str, candidates: list[Record], likelihood_of: LikelihoodOf
) -> list[Record]:
    """Write the data of candidates up to a clear one; return their entries of the key."""
    cases = [case_of(record) for record in candidates]
    base_folder = base(cases[0].stand)
    stand = read_stand(base_folder)
    stand_points = read_points(base_folder)
    points = [stand_points[k] for k in cases[0].places]
    # Candidates differ in their causes alone.
    baseline = expect(cases[0].engine, stand, points, cases[0].baseline, mean_progress(cases[0]))
    model = None
    records = []
    for k, case in enumerate(cases):
        data = folder / MAKING / f"{name}_{k}" / name
        shifts = simulate_case(case, stand, points)
        times = write_case(data, base_folder, case, points, shifts)
        truth = baseline if case.kind == "none" else expect_case(case, stand, points)
        likelihood = likelihood_of(data, case.sensor, model)
        model = likelihood.model
        yardstick = yardstick_of(Yardstick(likelihood, truth, baseline), case)
        record = case.record() | {
            "times_s": times,
            "expected": {"mean": truth.mean.tolist(), "sd": truth.sd.tolist()},
            "yardstick": yardstick,
        }
        records.append(record)
        if yardstick.get("noncentrality", 0.0) >= CLEAR:
            break
    return records


def yardstick_of(yardstick: Yardstick, case: Case) -> Record:
    """Compute the yardstick of a case.

    Without any effect it has the share of data sets of that size that show that the gap is within
    its margin. Else it has the noncentrality under the best rival, and the smallest part of the
    truth that the data cannot tell from the truth.
    """
    if case.kind == "none":
        return {"power": power_of(yardstick)}
    rivals = rivals_of(case.kind, case.causes, yardstick.likelihood.model.effects)
    noncentrality = yardstick.noncentralities(rivals)
    rival = min(noncentrality, key=lambda hypothesis: noncentrality[hypothesis])
    visible = [] if case.outside else visible_causes(yardstick, case.causes, noncentrality)
    return {
        "noncentrality": noncentrality[rival],
        "rival": list(rival),
        "seen_as": [list(causes) for causes in visible],
    }


def _seal(folder: Path, names: Sequence[str]) -> Record:
    """Write the key and the manifest; return the manifest."""
    truths = {n: read(folder / MAKING / f"{n}.json", "remove it")["made"] for n in names}
    key = {"format": FORMAT, "salt": secrets.token_hex(16), "cases": truths}
    text = json.dumps(key, indent=1)
    manifest = {
        "format": FORMAT,
        "cases": {name: hash_of(folder / "cases" / name) for name in truths},
        "key_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "figures": [asdict(headline) for headline in HEADLINES],
        "scoring_sha256": scoring_code(),
    }
    write_whole(folder / "key.json", text)
    write_whole(folder / "manifest.json", json.dumps(manifest, indent=1))
    rmtree(folder / MAKING, ignore_errors=True)
    return manifest
