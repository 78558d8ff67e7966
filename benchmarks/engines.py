"""The compiled engine against Drake, shift by shift.

    python -m benchmarks.engines [--seed N] [--designs N]

Clutches of three sizes (prototype, small, large), both contact sets, designs drawn over the
search space, seven mismatch speeds of either sign at a random force of the paper's study, eight
even angles from a random start: 3 x 2 x designs x 7 x 8 shifts in each engine, in turn. The
published set is Drake's ``cenic`` at its default accuracy.
Where both differ by more than a percent, up to ``--causes`` shifts drawn at random are simulated
again, one change at a time: finer steps of Drake, of the compiled engine, of both.
One process; takes a quarter of an hour, with both parts below.

    python -m benchmarks.engines --mujoco N

MuJoCo at equal error: both engines with steps from coarse to fine, *N* angles of the prototype at
the paper's points from 25 1/min up, shift by shift in turn, with one coefficient of friction. The
error of a setting is the median of single shifts against the finest setting of its own engine.
MuJoCo's contact stays the same while its step shrinks. Needs the extra ``blind``.

    python -m benchmarks.engines --batch N

The cost of a shift in a search: the prototype of ``mq200`` at its operating points with
draws, *N* angles each, every block by the compiled engine and then its first shift in Drake.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import paper_study
from benchmarks.work_precision import Setting, mujoco_shift, rows_of, run
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.evaluation import design_blocks, evaluate
from dogshape.pipeline.simulate.executor import scratch_executor
from dogshape.sim import kernel
from dogshape.sim.errors import DogshapeError
from dogshape.sim.shift import conclusion
from dogshape.sim.shift.clutch import (
    CONTACT_SETS,
    PLANAR_ACCURACY,
    Clutch,
    OperatingPoint,
    Rings,
    solver_for,
)
from dogshape.sim.shift.conclusion import Engagement
from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.planar import PlanarClutch
from dogshape.sim.statistics.blocks import engage, run_block
from dogshape.sim.units import DEG, RPM
from dogshape.validation.second_engine import FINE, EngineSettings

ANGLES = 8
SPEEDS = (5.0, 10.0, 25.0, 50.0, 100.0, 149.0, 249.0)
#: Diameters in m, mass in kg, both inertias in kg m2, numbers of dogs, heights in m.
SIZES = {
    "prototype": (52e-3, 44e-3, Rings(0.3, 0.01, 0.6048), (6, 36), (1.6e-3, 6e-3)),
    "small": (40e-3, 32e-3, Rings(0.2, 0.003, 0.2), (6, 28), (1.4e-3, 5e-3)),
    "large": (120e-3, 100e-3, Rings(2.0, 0.12, 4.0), (8, 36), (2e-3, 9e-3)),
}
#: Contact sets that Drake has.
SETS = {name: contact for name, contact in CONTACT_SETS.items() if not contact.impact}
HELD = 5e-3  #: s that friction holds faces on faces, from which a shift counts as held
APART = 0.01  #: deviation from which two shifts count as different
Pair = tuple[Engagement, Engagement]
Series = NDArray[np.float64]


def drawn(rng: np.random.Generator, size: str) -> Dog:
    """Draw a dog that can be made at all and that faces other dogs over a millimetre."""
    outer, inner, _, counts, heights = SIZES[size]
    while True:
        angles = rng.uniform([0.0, 4.0, 4.0], [20.0, 30.0, 30.0]) * DEG
        count = int(rng.integers(counts[0], counts[1] + 1))
        try:
            dog = Dog(count, *map(float, angles), float(rng.uniform(*heights)), outer, inner, 1e-3)
        except DogshapeError:
            continue
        if dog.tip_width_at(dog.inner_radius) > 1e-3:
            return dog


def sampled(seed: int, designs: int) -> list[tuple[str, str, float, list[Pair], Series]]:
    """Simulate: size, contact set, speed in 1/min, pairs of shifts and CPU time of each, s."""
    rng, study, found = np.random.default_rng(seed), paper_study(), []
    forces = sorted({point.profile.force for point in study.points})
    profiles = {point.profile.force: point.profile for point in study.points}
    for size, (_, _, rings, _, _) in SIZES.items():
        for name, contact in SETS.items():
            for _ in range(designs):
                dog = drawn(rng, size)
                clutch = Clutch(dog, rings, contact, solver_for(contact))
                for speed in SPEEDS:
                    sign, force = rng.choice([-1.0, 1.0]), float(rng.choice(forces))
                    point = OperatingPoint(sign * speed * RPM, profiles[force])
                    found.append((size, name, speed, *shifts(clutch, point, rng.random())))
    return found


def shifts(clutch: Clutch, point: OperatingPoint, start: float) -> tuple[list[Pair], Series]:
    """Simulate even angles with either engine in turn; CPU times (n, 2), s."""
    pairs, spent = [], []
    compiled = clutch.with_engine("planar")
    for angle in (np.arange(ANGLES) + start) / ANGLES * clutch.dog.pitch_angle:
        begin = time.process_time()
        first = engage(compiled, point, float(angle))
        middle = time.process_time()
        pairs.append((first, engage(clutch, point, float(angle))))
        spent.append((middle - begin, time.process_time() - middle))
    return pairs, np.array(spent)


def print_table(groups: list[tuple[str, str, float, list[Pair], Series]]) -> None:
    """Print a line for each speed: deviation, variance left, bias, loads, CPU time."""
    print("1/min  shifts  outcome  deviation of a shift  variance  bias of   peak  landing  CPU ms")
    print(
        "              the same  median   90 %   > 1 %     left    a mean  force    load  planar"
        "  Drake  ratio"
    )
    for speed in SPEEDS:
        mine = [(pairs, spent) for _, _, s, pairs, spent in groups if s == speed]
        print(f"{speed:5.0f} {row(mine)}")
    print(f"  all {row([(pairs, spent) for *_, pairs, spent in groups])}")


def row(groups: list[tuple[list[Pair], Series]]) -> str:
    """Format the figures of groups of shifts of one design at one point."""
    deviations, left, whole, biases, peaks, landings, same, count = [], 0.0, 0.0, [], [], [], 0, 0
    for pairs, _ in groups:
        same += sum(a.outcome is b.outcome for a, b in pairs)
        count += len(pairs)
        both = [(a, b) for a, b in pairs if a.shift_time and b.shift_time]
        if len(both) < 3:
            continue
        mine, drake = np.array([(a.shift_time, b.shift_time) for a, b in both]).T
        deviations += (np.abs(mine / drake - 1.0)).tolist()
        left += float(((mine - drake - (mine - drake).mean()) ** 2).sum())
        whole += float(((drake - drake.mean()) ** 2).sum())
        biases.append(float(mine.mean() / drake.mean() - 1.0))
        peaks += [abs(a.loads.peak_axial_force / b.loads.peak_axial_force - 1.0) for a, b in both]
        for a, b in both:
            ours, theirs = max(a.loads.landing_loads), max(b.loads.landing_loads)
            if theirs > 0.0:
                landings.append(abs(ours / theirs - 1.0))
    cpu = np.median(np.concatenate([spent for _, spent in groups]), axis=0) * 1e3
    total = np.concatenate([spent for _, spent in groups]).sum(axis=0)
    off = np.array(deviations)
    return (
        f"{count:8d} {same / count:9.2%} {np.median(off):9.3%} {np.quantile(off, 0.9):7.2%} "
        f"{(off > 0.01).mean():7.2%} {left / whole:9.2%} {np.median(np.abs(biases)):8.3%} "
        f"{np.median(peaks):8.2%} {np.median(landings) if landings else math.nan:7.2%} "
        f"{cpu[0]:7.2f} {cpu[1]:6.1f} {total[1] / total[0]:7.0f}"
    )


def events_alike(mine: Engagement, drake: Engagement) -> str:
    """Name what a pair of shifts went through, the first that holds."""
    own, other = mine.events, drake.events
    kinds = {
        "other outcome": mine.outcome is not drake.outcome,
        "another slot": own.slots_skipped != other.slots_skipped,
        "another bounce": own.face_contacts != other.face_contacts,
        "slots skipped": other.slots_skipped > 0,
        "faces, with bounces": other.face_contacts > 1,
        "faces, held": other.time_blocked > HELD,
        "faces, sliding": other.face_contacts > 0,
        "flanks alone": True,
    }
    return next(name for name, holds in kinds.items() if holds)


def print_events(pairs: list[Pair]) -> None:
    """Print how both differ by what the shifts went through."""
    print("\nwhat happens           shifts  median deviation   90 %   > 1 %  of all squares")
    classes: dict[str, list[float]] = {}
    for mine, drake in pairs:
        if mine.shift_time and drake.shift_time:
            off = mine.shift_time / drake.shift_time - 1.0
            classes.setdefault(events_alike(mine, drake), []).append(off)
    whole = sum(off**2 for offs in classes.values() for off in offs)
    for name, offs in sorted(classes.items(), key=lambda item: -len(item[1])):
        off = np.abs(offs)
        print(
            f"{name:20s} {len(off):8d} {np.median(off):17.3%} {np.quantile(off, 0.9):6.2%} "
            f"{(off > APART).mean():7.2%} {(off**2).sum() / whole:15.1%}"
        )


def print_causes(pairs: list[Pair], most: int, seed: int) -> None:
    """Refine either engine where both differ, and print what is left."""
    apart = [(a, b) for a, b in pairs if off_of(a, b) > APART]
    rng = np.random.default_rng(seed)
    chosen = [apart[i] for i in rng.permutation(len(apart))[:most]]
    found = []
    for mine, drake in chosen:
        fine = [
            engage(one.clutch.refined(), one.point, one.relative_angle) for one in (mine, drake)
        ]
        both = (off_of(mine, fine[1]), off_of(fine[0], drake), off_of(*fine))
        found.append((off_of(mine, drake), *both, off_of(fine[0], mine), off_of(fine[1], drake)))
    told = "shifts that differ by more than 1 % or in outcome"
    print(f"\n{told}: {len(apart)}, of which {len(chosen)} again")
    print("                                                     median   > 1 %")
    for name, offs in zip(
        (
            "compiled engine against Drake",
            "compiled engine against Drake with finer steps",
            "compiled engine with finer steps against Drake",
            "both with finer steps",
            "compiled engine against itself with finer steps",
            "Drake against itself with finer steps",
        ),
        np.array(found).T,
        strict=True,
    ):
        print(f"{name:50s} {np.median(offs):8.2%} {(offs > APART).mean():7.1%}")


def off_of(one: Engagement, other: Engagement) -> float:
    """Compare the times of two shifts; infinite where one of them has none."""
    if one.outcome is not other.outcome:
        return math.inf
    if one.shift_time is None or other.shift_time is None:
        return 0.0
    return abs(one.shift_time / other.shift_time - 1.0)


def timed(name: str, spent: dict[str, float]) -> None:
    """Add up the CPU time in a compiled function, s."""
    inner = getattr(kernel, name)

    def measured(*given: Any) -> Any:
        begin = time.process_time()
        found = inner(*given)
        spent[name] += time.process_time() - begin
        return found

    setattr(kernel, name, measured)


def print_batch(angles: int) -> None:
    """Print the CPU time of a shift in a search, by parts, and its ratio to Drake's."""
    study, names = load_study("mq200"), ("advance", "summarize")
    study = replace(study, clutch=study.clutch.with_engine("planar"))
    params = {key: study.prototype[key] for key in study.variables}
    evaluate(study, [params], scratch_executor(1), 1, 0)  # compiled before it is timed
    spent = dict.fromkeys((*names, "records", "Drake"), 0.0)
    for name in names:
        timed(name, spent)
    blocks, drake = design_blocks(study, params, angles, 1), solver_for(study.clutch.contact)
    for block in blocks:
        begin = time.process_time()
        rows = list(run_block(block))
        middle = time.process_time()
        reference = replace(block.only([0]), clutch=replace(block.clutch, solver=drake))
        list(run_block(reference))
        spent["records"] += middle - begin
        spent["Drake"] += (time.process_time() - middle) * len(rows)
    begin, count = time.process_time(), len(blocks) * angles
    (found,) = evaluate(study, [params], scratch_executor(1), angles, 1)
    spent["search"] = (time.process_time() - begin) * count / found.shifts
    for name in names:  # in both runs
        spent[name] *= count / (count + found.shifts)
    print(f"CPU of a shift, ms; {count} shifts, every {angles}th in Drake too")
    for name, value in spent.items():
        print(f"{name:10s} {1e3 * value / count:8.3f}")
    print(f"Drake over records {spent['Drake'] / spent['records']:.1f}")


def print_equal_error(angles: int) -> None:
    """Print cost and error of both engines by step, and MuJoCo's cost at equal error."""
    clutch = paper_study().clutch
    one = replace(clutch.contact, static_friction=clutch.contact.dynamic_friction)
    clutch = replace(clutch, contact=one).with_engine("planar")
    made = []
    for accuracy, step in ((1e-7, 1e-4), (1e-6, 1e-3), (1e-5, 1e-3), (1e-4, 1e-3), (1e-3, 1e-3)):
        finer = replace(clutch.solver, accuracy=accuracy, max_step=step)
        shift = partial(compiled_time, PlanarClutch(replace(clutch, solver=finer)))
        made.append(Setting("compiled", f"{accuracy:.0e} m/s", shift))
    for step in (1e-6, 2e-6, 4e-6, 8e-6, 1.6e-5, 3.2e-5):
        shift = mujoco_shift(clutch, EngineSettings(step, FINE.damping))
        made.append(Setting("MuJoCo", f"{step * 1e6:.3g} us", shift))
    rows = rows_of(run(made, angles))
    print("\nsteps coarse to fine          CPU ms  error of a shift, median   of the mean   lost")
    for r in rows:
        print(f"{r['family']:10s} {r['label']:>12s} {r['cpu_ms']:12.2f} {r['median']:24.4f}% "
              f"{r['mean']:12.4f}% {r['lost']:6d}")  # fmt: skip
    own = next(r for r in rows if r["label"] == f"{PLANAR_ACCURACY:.0e} m/s")
    theirs = sorted((r["median"], r["cpu_ms"]) for r in rows if r["family"] == "MuJoCo")[1:]
    errors, costs = np.log(theirs).T
    cost = math.exp(np.interp(math.log(own["median"]), errors, costs))
    least = " at least" if own["median"] < theirs[0][0] else ""
    print(f"MuJoCo over compiled engine at an error of {own['median']:.4f} %: "
          f"{cost:.1f} ms, {cost / own['cpu_ms']:.0f} times{least}")  # fmt: skip


def compiled_time(engine: PlanarClutch, point: OperatingPoint, angle: float) -> float | None:
    """Simulate a shift in the compiled engine; its time, s."""
    return conclusion.engage(engine, point, angle).shift_time


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=20261126)
    parser.add_argument("--designs", type=int, default=9)
    parser.add_argument("--causes", type=int, default=100)
    parser.add_argument("--batch", type=int, metavar="ANGLES")
    parser.add_argument("--mujoco", type=int, metavar="ANGLES")
    given = parser.parse_args()
    study = paper_study()
    engage(study.clutch.with_engine("planar"), study.points[0], 0.1)  # compiled before it is timed
    if given.batch or given.mujoco:
        if given.batch:
            print_batch(given.batch)
        if given.mujoco:
            print_equal_error(given.mujoco)
        return
    groups = sampled(given.seed, given.designs)
    print(f"seed {given.seed}, {given.designs} designs of each clutch and contact set, "
          f"{ANGLES} angles; median of the bias's size")  # fmt: skip
    print_table(groups)
    for size in SIZES:
        for name in SETS:
            few = [(p, c) for s, n, _, p, c in groups if (s, n) == (size, name)]
            print(f"{size}, {name}\n      {row(few)}")
    pairs = [pair for *_, group, _ in groups for pair in group]
    print_events(pairs)
    print_causes(pairs, given.causes, given.seed)
    print()
    print_batch(12)
    print_equal_error(3)


if __name__ == "__main__":
    main()
