"""A field set: its data, the yardstick of each case, and the seal over both.

    DIR/cases/case_000/     a data set; its name says nothing
    DIR/stands/large/       clutch and all operating points of the cases on it, without times
    DIR/manifest.json       hashes of key, data and scoring code, and the list of headline figures
    DIR/key.json            truths, yardsticks and a salt
    DIR/making/             while a set is made: what is finished; gone once it is sealed

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
from dogshape.validation.blind.data import bench_text, expected, expected_of, simulated, write_case
from dogshape.validation.blind.score import CLEAR, HEADLINES, scoring_code
from dogshape.validation.blind.sealed import FORMAT, Advance, hash_of, ignore, read, run_all
from dogshape.validation.blind.stand import read_points, read_stand
from dogshape.validation.blind.yardstick import Yardstick, power_of, rivals_of, seen_as

Record = dict[str, Any]  #: key, manifest and parts of them, as they are kept in JSON
#: Likelihood of a data set's folder, with the sensor at a side of the linkage; and its model,
#: where that is known.
LikelihoodOf = Callable[[Path, str, Model | None], Likelihood]

MAKING, STANDS = "making", "stands"


def base(stand: str) -> Path:
    """Locate the folder of a clutch that the package brings."""
    return bundled_root() / CLUTCHES[stand]


def cases_of(seed: int | None = None, *, small: bool = False) -> dict[str, tuple[Case, ...]]:
    """Draw the cases of a set, each as its candidates."""
    clutches = list(CLUTCHES)[:1] if small else CLUTCHES
    grids = {name: read_points(base(name)) for name in clutches}
    return {f"case_{k:03d}": one for k, one in enumerate(field_cases(grids, seed, small=small))}


def make_field(
    folder: Path,
    cases: dict[str, tuple[Case, ...]],
    likelihood_of: LikelihoodOf,
    jobs: int = 1,
    advance: Advance = ignore,
) -> Record:
    """Write a sealed field set and return its manifest; goes on where it was stopped.

    ``likelihood_of`` simulates a clutch where that was never done; with ``jobs`` above one it has
    to be picklable. ``advance`` counts cases.

    Raises StorageError where the folder has a set already.
    """
    if (folder / "manifest.json").exists():
        raise StorageError(f"{folder} has a set of cases already; give another folder")
    for stand in sorted({some[0].stand for some in cases.values()}):
        where = folder / STANDS / stand
        where.mkdir(parents=True, exist_ok=True)
        write_whole(where / "bench.toml", bench_text(base(stand), stand))
        write_whole(where / "shifts.csv", (base(stand) / "shifts.csv").read_text(encoding="utf-8"))
        likelihood_of(where, "sleeve", None)
    made = [
        (folder, name, [one.record() for one in some], likelihood_of)
        for name, some in cases.items()
    ]
    run_all(_made, made, jobs, advance)
    return _seal(folder, list(cases))


def _made(folder: Path, name: str, asked: list[Record], likelihood_of: LikelihoodOf) -> None:
    """Make a case of its candidates, unless an interrupted run has made it of the same ones."""
    path = folder / MAKING / f"{name}.json"
    asked = json.loads(json.dumps(asked))
    if path.exists() and read(path, "remove it")["asked"] == asked:
        return
    cases = [case_of(record) for record in asked]
    where = base(cases[0].stand)
    stand, every = read_stand(where), read_points(where)
    points = [every[k] for k in cases[0].places]
    # Candidates differ in their causes alone.
    plain, model, made = expected(cases[0].engine, stand, points, cases[0].plain), None, []
    for k, case in enumerate(cases):
        data = folder / MAKING / f"{name}_{k}" / name
        times = write_case(data, where, case, points, simulated(case, stand, points))
        truth = plain if case.kind == "none" else expected_of(case, stand, points)
        likelihood = likelihood_of(data, case.sensor, model)
        model = likelihood.model
        yardstick = yardstick_of(Yardstick(likelihood, truth, plain), case)
        expectation = {key: part.tolist() for key, part in asdict(truth).items()}
        more = {"times_s": times, "expected": expectation, "yardstick": yardstick}
        made.append(case.record() | more)
        if yardstick.get("noncentrality", 0.0) >= CLEAR:
            break
    best = max(range(len(made)), key=lambda k: float(made[k]["yardstick"].get("noncentrality", 0)))
    rmtree(folder / "cases" / name, ignore_errors=True)
    (folder / "cases").mkdir(exist_ok=True)
    (folder / MAKING / f"{name}_{best}" / name).rename(folder / "cases" / name)
    for k in range(len(made)):
        rmtree(folder / MAKING / f"{name}_{k}", ignore_errors=True)
    write_whole(path, json.dumps({"asked": asked, "made": made[best]}))


def yardstick_of(stick: Yardstick, case: Case) -> Record:
    """Compute the yardstick of a case.

    Without any effect it has how often data of that size can show that the gap is within its
    margin. Else the noncentrality that is left by the best rival, and the part of the truth that
    the data can show.
    """
    if case.kind == "none":
        return {"power": power_of(stick)}
    left = stick.left(rivals_of(case.kind, case.causes, stick.likelihood.model.effects))
    rival = min(left, key=lambda h: left[h])
    seen = [] if case.outside else seen_as(stick, case.causes, left)
    return {"noncentrality": left[rival], "rival": list(rival), "seen_as": list(map(list, seen))}


def _seal(folder: Path, names: Sequence[str]) -> Record:
    """Write the key and the manifest."""
    truths = {n: read(folder / MAKING / f"{n}.json", "remove it")["made"] for n in names}
    key = {"format": FORMAT, "salt": secrets.token_hex(16), "cases": truths}
    text = json.dumps(key, indent=1)
    manifest = {
        "format": FORMAT,
        "cases": {name: hash_of(folder / "cases" / name) for name in truths},
        "key_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "figures": [asdict(one) for one in HEADLINES],
        "scoring_sha256": scoring_code(),
    }
    write_whole(folder / "key.json", text)
    write_whole(folder / "manifest.json", json.dumps(manifest, indent=1))
    rmtree(folder / MAKING, ignore_errors=True)
    return manifest
