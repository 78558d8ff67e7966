"""A field set: its data, the yardstick of each case, and the seal over both.

    DIR/cases/case_000/     a data set; its name says nothing
    DIR/stands/half/        clutch and all operating points of the cases on it, without times
    DIR/manifest.json       hashes of key, data and scoring code, and the list of headline figures
    DIR/key.json            truths, yardsticks and a salt
    DIR/making/             while a set is made: what is finished; gone once it is sealed

The yardstick (``validation.blind.yardstick``) is computed before anything is diagnosed, and sealed
with the truth that it belongs to.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from dogshape.diagnosis.bench.stand_file import USUAL_MARGIN, Margin
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Array
from dogshape.sim.bundled import bundled_root
from dogshape.sim.errors import StorageError
from dogshape.sim.files import write_whole
from dogshape.validation.blind.case_marks import timely
from dogshape.validation.blind.cases import (
    CLUTCHES,
    COUNTS,
    WHICH,
    Case,
    case_of,
    field_cases,
)
from dogshape.validation.blind.data import (
    bench_text,
    simulated,
    swapped,
    write_field_case,
    write_stand_file,
)
from dogshape.validation.blind.expected_means import (
    ANGLES,
    Expected,
    expected,
    fades_of,
    moments,
    pooled,
    times_at,
)
from dogshape.validation.blind.figures import HEADLINES, scoring_code
from dogshape.validation.blind.sealed import FORMAT, Advance, hash_of, ignore, pool, read
from dogshape.validation.blind.stand import Point, Truth, read_points, read_stand
from dogshape.validation.blind.yardstick import (
    Seen,
    Series,
    Yardstick,
    asked_of,
    power_of,
    rivals_of,
    seen_as,
)

Record = dict[str, Any]  #: key, manifest and parts of them, as they are kept in JSON

MAKING, STANDS = "making", "stands"
STEP = 0.05  #: by which force and mismatch are changed for what their errors do


@dataclass(frozen=True)
class FieldWanted:
    """Request of a field set: its size and its seed."""

    size: str = "full"
    seed: int | None = None

    @property
    def cases(self) -> tuple[Case, ...]:
        """Draw the cases; InputError for an unknown size."""
        clutches = CLUTCHES[:1] if self.size == "small" else CLUTCHES
        grids = {name: read_points(base(name)) for name in clutches}
        return field_cases(self.size, grids, self.seed)


def base(stand: str) -> Path:
    """Locate the folder of a clutch that the package brings."""
    return bundled_root() / "blind" / stand


def make_field(
    folder: Path,
    wanted: FieldWanted,
    seen: Callable[[Path, int], Seen],
    jobs: int = 1,
    advance: Advance | None = None,
) -> Record:
    """Write a sealed field set and return its manifest; goes on where it was stopped.

    ``seen`` says with what the folder of a clutch is diagnosed, and makes its bank where there is
    none; it has to be picklable where ``jobs`` is above one. ``advance`` counts cases twice: their
    data, and their yardsticks.

    Raises StorageError where the folder has a set already, InputError for an unknown size.
    """
    if (folder / "manifest.json").exists():
        raise StorageError(f"{folder} has a set of cases already; give another folder")
    cases = {f"case_{k:03d}": case for k, case in enumerate(wanted.cases)}
    stands = sorted({case.stand for case in cases.values()})
    for stand in stands:
        _write_stand(folder / STANDS / stand, stand)
    pairs = sorted({(case.engine, case.stand) for case in cases.values()})
    with pool(jobs) as submit:
        references = [submit(_reference, folder, *pair) for pair in pairs]
        made = [submit(_data, folder, name, case.record()) for name, case in cases.items()]
        for future in (*references, *made):
            future.result()
            (advance or ignore)(int(future in made))
    for stand in stands:
        seen(folder / STANDS / stand, jobs)
    with pool(jobs) as submit:
        parts = {
            stand: submit(
                _yardsticks, folder, stand, [n for n, c in cases.items() if c.stand == stand], seen
            )
            for stand in stands
        }
        for part in parts.values():
            (advance or ignore)(part.result())
    return _seal(folder, wanted, cases, pairs)


def _write_stand(folder: Path, stand: str) -> None:
    """Write clutch and operating points of the cases on it."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "bench.toml", bench_text(base(stand), stand))
    write_whole(folder / "shifts.csv", (base(stand) / "shifts.csv").read_text(encoding="utf-8"))


def _kept(folder: Path, name: str, asked: Record, make: Callable[[], Record]) -> Record:
    """Read a part that an interrupted run made of the same request, or make and keep it."""
    path = folder / MAKING / f"{name}.json"
    if path.exists() and (found := read(path, "remove it"))["asked"] == asked:
        return dict(found["made"])
    made = make()
    path.parent.mkdir(exist_ok=True)
    write_whole(path, json.dumps({"asked": asked, "made": made}))
    return made


def _reference(folder: Path, engine: str, stand: str) -> Record:
    """Simulate an engine without any effect at all operating points of a clutch.

    The record has times in s at even angles, means and spreads, and the slopes of the means over
    the logarithms of force and mismatch.
    """

    def make() -> Record:
        bench, points = read_stand(base(stand)), read_points(base(stand))
        truth = Truth()
        times = times_at(engine, bench, points, truth)
        plain = moments(times, np.ones(times.shape[1]))
        changed = {
            "force": [replace(p, force=p.force * (1.0 + STEP)) for p in points],
            "mismatch": [replace(p, mismatch=p.mismatch * (1.0 + STEP)) for p in points],
        }
        slopes = {
            name: ((expected(engine, bench, those, truth).mean - plain.mean) / STEP).tolist()
            for name, those in changed.items()
        }
        found = [[None if np.isnan(t) else t for t in mine] for mine in times.tolist()]
        return {"times_s": found, **_plain(plain), "slopes": slopes}

    return _kept(folder, f"{engine}_{stand}", {"angles": ANGLES[engine]}, make)


def _plain(found: Expected) -> Record:
    return {name: part.tolist() for name, part in asdict(found).items()}


def _expected_of(record: Record, places: Sequence[int] | None = None) -> Expected:
    mean, sd = (np.array(record[name], dtype=float) for name in ("mean", "sd"))
    where = slice(None) if places is None else list(places)
    return Expected(mean[where], sd[where])


def _data(folder: Path, name: str, record: Record) -> Record:
    """Make the data of a case, and the expectation of its engine for the truth."""

    def make() -> Record:
        case = case_of(record)
        stand, points = read_stand(base(case.stand)), _points(case)
        shifts = simulated(case, stand, points)
        times = write_field_case(folder / "cases" / name, base(case.stand), case, points, shifts)
        return {"times_s": times, "expected": _truth(case, points)}

    return _kept(folder, name, record, make)


def _points(case: Case) -> tuple[Point, ...]:
    points = read_points(base(case.stand))
    return tuple(points[k] for k in case.places)


def _truth(case: Case, points: Sequence[Point]) -> Record | None:
    """Simulate what the engine of a case expects of its truth; None without any effect."""
    if case.kind == "none":
        return None
    stand, truth = read_stand(base(case.stand)), case.truth
    steady = replace(truth, drift=0.0)
    found = (
        pooled([expected(case.engine, stand, points, steady, fades) for fades in fades_of(case)])
        if truth.drift
        else expected(case.engine, stand, points, steady)
    )
    if case.swapped:
        order = swapped(points)
        found = Expected(found.mean[order], found.sd[order])
    return _plain(found)


def _yardsticks(
    folder: Path, stand: str, names: Sequence[str], seen: Callable[[Path, int], Seen]
) -> int:
    """Compute the yardstick of each case on a clutch, and return how many these are."""
    stick: list[Yardstick] = []

    def make(name: str) -> Record:
        if not stick:
            stick.append(Yardstick(seen(folder / STANDS / stand, 1)))
        made = read(folder / MAKING / f"{name}.json", "remove it")
        case = case_of(made["asked"])
        reference = read(folder / MAKING / f"{case.engine}_{stand}.json", "remove it")["made"]
        return yardstick_of(stick[0], case, made["made"], reference)

    errors = USUAL.as_dict()["likelihood"]  # with others it is another yardstick
    for name in names:
        _kept(folder, f"{name}_yardstick", {"name": name, **errors}, partial(make, name))
    return len(names)


def yardstick_of(
    stick: Yardstick, case: Case, made: Mapping[str, Any], reference: Mapping[str, Any]
) -> Record:
    """Compute the yardstick of a case from what its engine expects.

    Without any effect it has by how many margins the engine is off the simulation, and how often
    data of that size can show that this is within the margin. Else the noncentrality that is left
    by the best rival, and what the data can show of the truth.
    ``made`` has times and expectation of the case, ``reference`` those of its engine without any
    effect at all operating points of its clutch.
    """
    places = list(case.places)
    plain = _expected_of(dict(reference), places)
    slopes = {n: np.array(part, dtype=float)[places] for n, part in reference["slopes"].items()}
    nominal = (slopes["force"] * case.force_error) ** 2
    nominal += (slopes["mismatch"] * case.speed_error) ** 2
    counts = np.array([timely(times).size for times in made["times_s"]], dtype=float)
    simulated = stick.baseline[places]
    off = {"engine_off_in_margins": in_margins(plain.mean, simulated)}
    series = Series(places, counts, case.form != "means", np.nan_to_num(nominal))
    if case.kind == "none":
        return {**off, "power": power_of(stick, series, plain, USUAL_MARGIN.of(simulated))}
    truth = _expected_of(dict(made["expected"]))
    asked = asked_of(stick, series, truth, plain)
    rivals = rivals_of(case.kind, case.causes, stick.seen.effects)
    own = None if case.outside else stick.at_truth(case.parameters)
    left = stick.left(asked, rivals, own)
    found = seen_as(stick, asked, case.causes, own, known=left.refitted)
    return {
        **off,
        "noncentrality": left.noncentrality,
        "rival": list(left.rival),
        "seen_as": [list(part) for part in found],
    }


def in_margins(means: Array, baseline: Array, margin: Margin = USUAL_MARGIN) -> float:
    """Compute a gap in margins below which nothing needs doing, root mean square over points.

    Both are mean times in s, (points,).
    """
    return float(np.sqrt(np.nanmean(((means - baseline) / margin.of(baseline)) ** 2)))


def kept_of(cases: Mapping[str, Case], yards: Mapping[str, Record]) -> set[str]:
    """List the cases of a set: of each group of draws the one that the yardstick has clearest."""
    groups: dict[int, list[str]] = {}
    for name, case in cases.items():
        groups.setdefault(case.group, []).append(name)
    best = (
        max(names, key=lambda n: float(yards[n]["noncentrality"]))
        for group, names in groups.items()
        if group
    )
    return {*groups.get(0, []), *best}


def _seal(
    folder: Path,
    wanted: FieldWanted,
    cases: Mapping[str, Case],
    pairs: Sequence[tuple[str, str]],
) -> Record:
    """Write the key and the manifest."""
    making = folder / MAKING
    yards = {n: read(making / f"{n}_yardstick.json", "remove it")["made"] for n in cases}
    truths = {}
    for name, case in cases.items():
        if name not in kept_of(cases, yards):
            rmtree(folder / "cases" / name, ignore_errors=True)
            continue
        made, yard = read(making / f"{name}.json", "remove it")["made"], yards[name]
        truths[name] = {**case.record(), **made, "yardstick": yard}
        # A stand says what the diagnosis of today reads, whenever the shifts were made.
        write_stand_file(folder / "cases" / name, base(case.stand), case)
    key = {
        "format": FORMAT,
        "salt": secrets.token_hex(16),
        "set": WHICH,
        "seed": wanted.seed,
        "references": {
            f"{engine}_{stand}": read(making / f"{engine}_{stand}.json", "remove it")["made"]
            for engine, stand in pairs
        },
        "cases": truths,
    }
    text = json.dumps(key, indent=1)
    manifest = {
        "format": FORMAT,
        "set": WHICH,
        "engine": "+".join(COUNTS),
        "size": wanted.size,
        "cases": {name: hash_of(folder / "cases" / name) for name in truths},
        "key_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "figures": [asdict(one) for one in HEADLINES],
        "scoring_sha256": scoring_code(),
    }
    write_whole(folder / "key.json", text)
    write_whole(folder / "manifest.json", json.dumps(manifest, indent=1))
    rmtree(making, ignore_errors=True)
    return manifest
