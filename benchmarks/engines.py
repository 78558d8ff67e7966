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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import paper_study
from benchmarks.work_precision import Setting, mujoco_shift, rows_of, run
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.simulate.evaluation import OperatedDesign, evaluate
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
MIN_HELD_S = 5e-3  #: time that friction holds faces, from which a shift counts as held
MAX_DEVIATION = 0.01  #: of two shifts that count as equal
Pair = tuple[Engagement, Engagement]
Series = NDArray[np.float64]


def draw_dog(rng: np.random.Generator, size: str) -> Dog:
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


def simulate_groups(seed: int, designs: int) -> list[tuple[str, str, float, list[Pair], Series]]:
    """Simulate: size, contact set, speed in 1/min, pairs of shifts and CPU time of each, s."""
    rng = np.random.default_rng(seed)
    study = paper_study()
    groups = []
    forces = sorted({point.profile.force for point in study.points})
    profiles = {point.profile.force: point.profile for point in study.points}
    for size, (_, _, rings, _, _) in SIZES.items():
        for name, contact in SETS.items():
            for _ in range(designs):
                dog = draw_dog(rng, size)
                clutch = Clutch(dog, rings, contact, solver_for(contact))
                for speed in SPEEDS:
                    sign = rng.choice([-1.0, 1.0])
                    force = float(rng.choice(forces))
                    point = OperatingPoint(sign * speed * RPM, profiles[force])
                    groups.append(
                        (size, name, speed, *simulate_shifts(clutch, point, rng.random()))
                    )
    return groups


def simulate_shifts(
    clutch: Clutch, point: OperatingPoint, offset: float
) -> tuple[list[Pair], Series]:
    """Simulate even angles with both engines in turn; pairs of shifts, and CPU times, s, (n, 2).

    ``offset`` is the share of a step at which the angles begin.
    """
    pairs = []
    cpu = []
    compiled = clutch.with_engine("planar")
    for angle in (np.arange(ANGLES) + offset) / ANGLES * clutch.dog.pitch_angle:
        start = time.process_time()
        first = engage(compiled, point, float(angle))
        middle = time.process_time()
        pairs.append((first, engage(clutch, point, float(angle))))
        cpu.append((middle - start, time.process_time() - middle))
    return pairs, np.array(cpu)


def print_table(groups: list[tuple[str, str, float, list[Pair], Series]]) -> None:
    """Print a line for each speed: deviation, variance left, bias, loads, CPU time."""
    print("1/min  shifts  outcome  deviation of a shift  variance  bias of   peak  landing  CPU ms")
    print(
        "              the same  median   90 %   > 1 %     left    a mean  force    load  planar"
        "  Drake  ratio"
    )
    for speed in SPEEDS:
        group = [(pairs, cpu) for _, _, s, pairs, cpu in groups if s == speed]
        print(f"{speed:5.0f} {format_row(group)}")
    print(f"  all {format_row([(pairs, cpu) for *_, pairs, cpu in groups])}")


def format_row(groups: list[tuple[list[Pair], Series]]) -> str:
    """Format the figures of groups of shifts of one design at one point."""
    deviations = []
    residual_squares = 0.0
    total_squares = 0.0
    biases = []
    peaks = []
    landings = []
    same_outcomes = 0
    count = 0
    for pairs, _ in groups:
        same_outcomes += sum(a.outcome is b.outcome for a, b in pairs)
        count += len(pairs)
        engaged = [(a, b) for a, b in pairs if a.shift_time and b.shift_time]
        if len(engaged) < 3:
            continue
        compiled, drake = np.array([(a.shift_time, b.shift_time) for a, b in engaged]).T
        deviations += (np.abs(compiled / drake - 1.0)).tolist()
        residual_squares += float(((compiled - drake - (compiled - drake).mean()) ** 2).sum())
        total_squares += float(((drake - drake.mean()) ** 2).sum())
        biases.append(float(compiled.mean() / drake.mean() - 1.0))
        peaks += [
            abs(a.loads.peak_axial_force / b.loads.peak_axial_force - 1.0) for a, b in engaged
        ]
        for a, b in engaged:
            compiled_load = max(a.loads.landing_loads)
            drake_load = max(b.loads.landing_loads)
            if drake_load > 0.0:
                landings.append(abs(compiled_load / drake_load - 1.0))
    shift_cpu = np.concatenate([cpu for _, cpu in groups])
    median_cpu = np.median(shift_cpu, axis=0) * 1e3
    total_cpu = shift_cpu.sum(axis=0)
    errors = np.array(deviations)
    landing = np.median(landings) if landings else math.nan
    return (
        f"{count:8d} {same_outcomes / count:9.2%} {np.median(errors):9.3%} "
        f"{np.quantile(errors, 0.9):7.2%} {(errors > 0.01).mean():7.2%} "
        f"{residual_squares / total_squares:9.2%} {np.median(np.abs(biases)):8.3%} "
        f"{np.median(peaks):8.2%} {landing:7.2%} "
        f"{median_cpu[0]:7.2f} {median_cpu[1]:6.1f} {total_cpu[1] / total_cpu[0]:7.0f}"
    )


def classify_events(compiled: Engagement, drake: Engagement) -> str:
    """Return the first kind of events that applies to a pair of shifts."""
    compiled_events = compiled.events
    drake_events = drake.events
    kinds = {
        "other outcome": compiled.outcome is not drake.outcome,
        "another slot": compiled_events.slots_skipped != drake_events.slots_skipped,
        "another bounce": compiled_events.face_contacts != drake_events.face_contacts,
        "slots skipped": drake_events.slots_skipped > 0,
        "faces, with bounces": drake_events.face_contacts > 1,
        "faces, held": drake_events.time_blocked > MIN_HELD_S,
        "faces, sliding": drake_events.face_contacts > 0,
        "flanks alone": True,
    }
    return next(name for name, applies in kinds.items() if applies)


def print_events(pairs: list[Pair]) -> None:
    """Print the deviation between the engines by kind of events."""
    print("\nwhat happens           shifts  median deviation   90 %   > 1 %  of all squares")
    classes: dict[str, list[float]] = {}
    for compiled, drake in pairs:
        if compiled.shift_time and drake.shift_time:
            deviation = compiled.shift_time / drake.shift_time - 1.0
            classes.setdefault(classify_events(compiled, drake), []).append(deviation)
    total_squares = sum(deviation**2 for deviations in classes.values() for deviation in deviations)
    for name, deviations in sorted(classes.items(), key=lambda item: -len(item[1])):
        sizes = np.abs(deviations)
        print(
            f"{name:20s} {len(sizes):8d} {np.median(sizes):17.3%} {np.quantile(sizes, 0.9):6.2%} "
            f"{(sizes > MAX_DEVIATION).mean():7.2%} {(sizes**2).sum() / total_squares:15.1%}"
        )


def print_causes(pairs: list[Pair], max_shifts: int, seed: int) -> None:
    """Print the deviations of differing shifts with finer steps of either engine."""
    different = [(a, b) for a, b in pairs if deviation_of(a, b) > MAX_DEVIATION]
    rng = np.random.default_rng(seed)
    sample = [different[i] for i in rng.permutation(len(different))[:max_shifts]]
    rows = []
    for compiled, drake in sample:
        fine_compiled, fine_drake = (
            engage(shift.clutch.refined(), shift.point, shift.relative_angle)
            for shift in (compiled, drake)
        )
        rows.append(
            (
                deviation_of(compiled, drake),
                deviation_of(compiled, fine_drake),
                deviation_of(fine_compiled, drake),
                deviation_of(fine_compiled, fine_drake),
                deviation_of(fine_compiled, compiled),
                deviation_of(fine_drake, drake),
            )
        )
    head = "shifts that differ by more than 1 % or in outcome"
    print(f"\n{head}: {len(different)}, of which {len(sample)} again")
    print("                                                     median   > 1 %")
    names = (
        "compiled engine against Drake",
        "compiled engine against Drake with finer steps",
        "compiled engine with finer steps against Drake",
        "both with finer steps",
        "compiled engine against itself with finer steps",
        "Drake against itself with finer steps",
    )
    for name, deviations in zip(names, np.array(rows).T, strict=True):
        print(f"{name:50s} {np.median(deviations):8.2%} {(deviations > MAX_DEVIATION).mean():7.1%}")


def deviation_of(first: Engagement, second: Engagement) -> float:
    """Compute the relative deviation of two shift times, infinite for different outcomes."""
    if first.outcome is not second.outcome:
        return math.inf
    if first.shift_time is None or second.shift_time is None:
        return 0.0
    return abs(first.shift_time / second.shift_time - 1.0)


def count_cpu(name: str, cpu: dict[str, float]) -> None:
    """Add up the CPU time in a compiled function, s."""
    function = getattr(kernel, name)

    def measured(*arguments: Any, **options: Any) -> Any:
        start = time.process_time()
        result = function(*arguments, **options)
        cpu[name] += time.process_time() - start
        return result

    setattr(kernel, name, measured)


class BatchCost(NamedTuple):
    """CPU time of a shift of a search by parts, s, and the number of measured shifts."""

    parts: dict[str, float]
    shifts: int

    @property
    def compiled(self) -> float:
        """CPU time of a shift by the compiled engine with its record, s."""
        return self.parts["records"]

    @property
    def drake(self) -> float:
        """CPU time of a shift by Drake with its record, s."""
        return self.parts["Drake"]


def measure_batch(angles: int) -> BatchCost:
    """Measure the shifts of a search, ``angles`` at each operating point, one of them in Drake."""
    study = load_study("mq200")
    names = ("advance", "summarize")
    study = replace(study, clutch=study.clutch.with_engine("planar"))
    params = study.prototype
    evaluate(study, [params], scratch_executor(1), 1, 0)  # compiled before it is timed
    cpu = dict.fromkeys((*names, "records", "Drake"), 0.0)
    for name in names:
        count_cpu(name, cpu)
    blocks = OperatedDesign.of(study, params).blocks(angles, 1)
    drake = solver_for(study.clutch.contact)
    references = [
        replace(block.only([0]), clutch=replace(block.clutch, solver=drake)) for block in blocks
    ]
    list(run_block(references[0]))  # Drake is loaded before it is timed
    for block, reference in zip(blocks, references, strict=True):
        start = time.process_time()
        rows = list(run_block(block))
        middle = time.process_time()
        list(run_block(reference))
        cpu["records"] += middle - start
        cpu["Drake"] += (time.process_time() - middle) * len(rows)
    start = time.process_time()
    count = len(blocks) * angles
    (evaluation,) = evaluate(study, [params], scratch_executor(1), angles, 1)
    cpu["search"] = (time.process_time() - start) * count / evaluation.shifts
    for name in names:  # in both runs
        cpu[name] *= count / (count + evaluation.shifts)
    return BatchCost({name: value / count for name, value in cpu.items()}, count)


def print_batch(angles: int) -> None:
    """Print the CPU time of a shift in a search, by parts, and its ratio to Drake's."""
    cost = measure_batch(angles)
    print(f"CPU of a shift, ms; {cost.shifts} shifts, every {angles}th in Drake too")
    for name, value in cost.parts.items():
        print(f"{name:10s} {1e3 * value:8.3f}")
    print(f"Drake over records {cost.drake / cost.compiled:.1f}")


def print_equal_error(angles: int) -> None:
    """Print cost and error of both engines by step, and MuJoCo's cost at equal error."""
    clutch = paper_study().clutch
    contact = replace(clutch.contact, static_friction=clutch.contact.dynamic_friction)
    clutch = replace(clutch, contact=contact).with_engine("planar")
    settings = []
    for accuracy, step in ((1e-7, 1e-4), (1e-6, 1e-3), (1e-5, 1e-3), (1e-4, 1e-3), (1e-3, 1e-3)):
        solver = replace(clutch.solver, accuracy=accuracy, max_step=step)
        shift = partial(compiled_time, PlanarClutch(replace(clutch, solver=solver)))
        settings.append(Setting("compiled", f"{accuracy:.0e} m/s", shift))
    for step in (1e-6, 2e-6, 4e-6, 8e-6, 1.6e-5, 3.2e-5):
        shift = mujoco_shift(clutch, EngineSettings(step, FINE.damping))
        settings.append(Setting("MuJoCo", f"{step * 1e6:.3g} us", shift))
    rows = rows_of(run(settings, angles))
    print("\nsteps coarse to fine          CPU ms  error of a shift, median   of the mean   lost")
    for r in rows:
        print(
            f"{r['family']:10s} {r['label']:>12s} {r['cpu_ms']:12.2f} {r['median']:24.4f}% "
            f"{r['mean']:12.4f}% {r['lost']:6d}"
        )
    compiled = next(r for r in rows if r["label"] == f"{PLANAR_ACCURACY:.0e} m/s")
    mujoco = sorted((r["median"], r["cpu_ms"]) for r in rows if r["family"] == "MuJoCo")[1:]
    errors, costs = np.log(mujoco).T
    cost = math.exp(np.interp(math.log(compiled["median"]), errors, costs))
    bound = " at least" if compiled["median"] < mujoco[0][0] else ""
    print(
        f"MuJoCo over compiled engine at an error of {compiled['median']:.4f} %: "
        f"{cost:.1f} ms, {cost / compiled['cpu_ms']:.0f} times{bound}"
    )


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
    arguments = parser.parse_args()
    study = paper_study()
    engage(study.clutch.with_engine("planar"), study.points[0], 0.1)  # compiled before it is timed
    if arguments.batch or arguments.mujoco:
        if arguments.batch:
            print_batch(arguments.batch)
        if arguments.mujoco:
            print_equal_error(arguments.mujoco)
        return
    groups = simulate_groups(arguments.seed, arguments.designs)
    print(
        f"seed {arguments.seed}, {arguments.designs} designs of each clutch and contact set, "
        f"{ANGLES} angles; median of the bias's size"
    )
    print_table(groups)
    for size in SIZES:
        for name in SETS:
            group = [(p, c) for s, n, _, p, c in groups if (s, n) == (size, name)]
            print(f"{size}, {name}\n      {format_row(group)}")
    pairs = [pair for *_, group, _ in groups for pair in group]
    print_events(pairs)
    print_causes(pairs, arguments.causes, arguments.seed)
    print()
    print_batch(12)
    print_equal_error(3)


if __name__ == "__main__":
    main()
