"""Numerical error of shift times: accuracy, contact mesh, designs and stiction velocity.

    python -m benchmarks.convergence

**Accuracy and mesh**: four designs at eight operating points, the error of the mean shift time over
twelve even angles at each accuracy against 1e-5 with half the largest step; then the observed
order, and the same for contact meshes cut finer.

**Designs** fill the feasible space of the paper's study (``pipeline.train.training``), each at one
operating point of either sign, eight even angles each, at the default accuracy and at 1e-5 with
half the largest step. A shift *flips* where only one of the two engages or where their times differ
by more than 5 %: a dog caught another slot or was thrown back once more. The rest is the error of
shifts that went the same way. Intervals hold 95 %: those of rates after Clopper and Pearson, all
others from designs drawn again with replacement.

**Stiction velocity**: mean shift time of the prototype over twelve even angles in both contact
sets, and how many of them stay blocked. Takes about twenty minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

import dogshape.sim.shift.plant
from benchmarks.common import DESIGNS, Cell, angles_of, clutch_of, measure, paper_study, point_of
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.train.training import first_designs
from dogshape.sim.shift.clutch import CONTACT_SETS, Clutch, OperatingPoint, solver_for
from dogshape.sim.shift.mesh import Mesh, rigid_dog
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import even_block
from dogshape.sim.units import RPM

POINTS = (
    (5.0, 235.2),
    (10.0, 469.0),
    (25.0, 641.5),
    (50.0, 315.5),
    (-50.0, 469.0),
    (100.0, 235.2),
    (149.0, 641.5),
    (249.0, 469.0),
)
ACCURACIES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
REFERENCE_ACCURACY = 1e-5
ANGLES = 12
SEED = 2024
DRAWN_DESIGNS = 40  #: that fill the space
DRAWN_ANGLES = 8  #: of each of these designs
BOOTSTRAP_DRAWS = 2000
FLIP_RATIO = 0.05  #: relative difference of two times from which a shift flipped
MAX_SLOW_RPM = 50.0  #: of the slow class of mismatch
MIN_FAST_RPM = 149.0  #: of the fast class of mismatch
STICTION_VELOCITIES = {
    "adams2019": (0.1, 0.03, 0.01, 0.001),
    "lubricated_steel": (2e-3, 5e-4, 2e-4, 1e-4),
}  #: stiction velocities, m/s
STICTION_POINTS = ((5.0, 235.2), (10.0, 641.5), (50.0, 469.0))

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]


def with_accuracy(clutch: Clutch, accuracy: float) -> Clutch:
    """Set the accuracy of a clutch; the reference also halves the largest step."""
    step = clutch.solver.max_step * (0.5 if accuracy == REFERENCE_ACCURACY else 1.0)
    return replace(clutch, solver=replace(clutch.solver, accuracy=accuracy, max_step=step))


def refine_mesh(mesh: Mesh) -> Mesh:
    """Cut every triangle into four at the middles of its edges."""
    corners = mesh.vertices[mesh.cells]
    a = corners[:, 0]
    b = corners[:, 1]
    c = corners[:, 2]
    ab = (a + b) / 2
    bc = (b + c) / 2
    ca = (c + a) / 2
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    vertices = np.concatenate([np.stack(q, axis=1) for q in quarters]).reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))


def plant_with(clutch: Clutch, levels: int) -> ClutchPlant:
    """Build a plant with its rigid surface refined ``levels`` times."""

    def cut(dog: object) -> Mesh:
        mesh = rigid_dog(dog)  # type: ignore[arg-type]
        for _ in range(levels):
            mesh = refine_mesh(mesh)
        return mesh

    dogshape.sim.shift.plant.rigid_dog = cut  # type: ignore[assignment]
    try:
        return ClutchPlant(clutch)
    finally:
        dogshape.sim.shift.plant.rigid_dog = rigid_dog


def compare_cells(cell: Cell, reference: Cell) -> tuple[float, float]:
    """Compute the errors of the mean and, as median, of single shifts, percent."""
    engaged = np.isfinite(cell.times) & np.isfinite(reference.times)
    times = cell.times[engaged]
    reference_times = reference.times[engaged]
    median_error = np.median(np.abs(times / reference_times - 1.0))
    return 100.0 * abs(times.mean() / reference_times.mean() - 1.0), 100.0 * float(median_error)


def print_accuracy_errors() -> None:
    """Print the table of tolerances."""
    study = paper_study()
    print("error of the mean shift time, %, by accuracy")
    head = "".join(f"{a:>9.0e}" for a in ACCURACIES)
    print(f"{'design':<10} {'1/min':>6} {'N':>6} {'mean, ms':>9}{head}")
    errors: list[list[tuple[float, float]]] = []
    evaluations = np.zeros(len(ACCURACIES) + 1)
    for design in DESIGNS:
        clutch = clutch_of(study, design)
        plants = [ClutchPlant(with_accuracy(clutch, a)) for a in (*ACCURACIES, REFERENCE_ACCURACY)]
        for index, (mismatch, force) in enumerate(POINTS):
            point = point_of(study, mismatch, force)
            angles = angles_of(clutch, ANGLES, index)
            cells = [measure(plant, point, angles) for plant in plants]
            evaluations += [c.evaluations for c in cells]
            row = [compare_cells(c, cells[-1]) for c in cells[:-1]]
            errors.append(row)
            text = "".join(f"{e:9.3f}" for e, _ in row)
            line = f"{design:<10} {mismatch:6.0f} {force:6.1f} {cells[-1].mean * 1e3:9.2f}{text}"
            print(line, flush=True)
    table = np.array(errors)
    print_summary(table, evaluations / len(errors))


def print_summary(table: np.ndarray, evaluations: np.ndarray) -> None:
    """Print largest and typical errors, the observed order, and the cost."""
    largest = table[..., 0].max(axis=0)
    typical = np.median(table[..., 1], axis=0)
    rows = {
        "largest error of a mean, %": largest,
        "root mean square of them, %": np.sqrt((table[..., 0] ** 2).mean(axis=0)),
        "median error of a shift, %": typical,
        "derivatives a shift": evaluations[:-1],
    }
    for name, values in rows.items():
        text = "".join(f"{v:9.4f}" if v < 100 else f"{v:9.0f}" for v in values)
        print(f"{name:<34}{text}")
    fitted = np.array(ACCURACIES) <= 3e-3
    order = np.polyfit(np.log(np.array(ACCURACIES)[fitted]), np.log(typical[fitted]), 1)[0]
    print(f"observed order of the median error in the accuracy, 3e-3 to 1e-4: {order:.2f}")
    print(
        f"(reference: accuracy {REFERENCE_ACCURACY:.0e}, {evaluations[-1]:.0f} derivatives a shift)"
    )


def print_mesh_errors() -> None:
    """Print the error of the default contact mesh against finer ones."""
    study = paper_study()
    print("\nerror of the mean shift time by the mesh of the rigid side, %: against 384 triangles")
    print(f"{'design':<10} {'1/min':>6} {'N':>6} {'6 triangles':>12} {'24':>9} {'96':>9}")
    for design in DESIGNS:
        clutch = with_accuracy(clutch_of(study, design), 1e-4)
        plants = [plant_with(clutch, level) for level in (0, 1, 2, 3)]
        for index in (0, 3, 7):
            mismatch, force = POINTS[index]
            point = point_of(study, mismatch, force)
            angles = angles_of(clutch, 4, index)
            cells = [measure(plant, point, angles) for plant in plants]
            row = [compare_cells(c, cells[-1])[0] for c in cells[:-1]]
            text = f"{row[0]:12.4f} {row[1]:9.4f} {row[2]:9.4f}"
            print(f"{design:<10} {mismatch:6.0f} {force:6.1f} {text}", flush=True)


@dataclass(frozen=True)
class Pair:
    """Shifts of one design at one point by two accuracies; NaN where a shift did not engage."""

    design: dict[str, float]
    point: OperatingPoint
    times: Values  #: by the default accuracy, s, (n,)
    reference: Values  #: by the fine accuracy, s, (n,)

    @cached_property
    def both(self) -> Flags:
        """Mask of shifts that engaged with both accuracies, (n,)."""
        flags: Flags = np.isfinite(self.times) & np.isfinite(self.reference)
        return flags

    @cached_property
    def flipped(self) -> Flags:
        """Mask of shifts that flipped, (n,)."""
        only_one = np.isfinite(self.times) != np.isfinite(self.reference)
        flags: Flags = only_one | (
            self.both & (np.abs(self.times / self.reference - 1.0) > FLIP_RATIO)
        )
        return flags

    @cached_property
    def errors(self) -> Values:
        """Relative errors of the shifts that did not flip, percent."""
        unflipped = self.both & ~self.flipped
        return 100.0 * np.abs(self.times[unflipped] / self.reference[unflipped] - 1.0)

    @cached_property
    def error(self) -> float:
        """Relative error of the mean of shifts that engaged with both, percent, signed."""
        return self._error(self.both)

    @cached_property
    def smooth_error(self) -> float:
        """Relative error of the mean of shifts that did not flip, percent, signed."""
        return self._error(self.both & ~self.flipped)

    def _error(self, shifts: Flags) -> float:
        return 100.0 * float(self.times[shifts].mean() / self.reference[shifts].mean() - 1.0)


def simulate_pairs(study: Setup, designs: int, angles: int, seed: int = SEED) -> list[Pair]:
    """Simulate ``designs`` designs at one point of either sign, with both accuracies."""
    pairs = []
    rng = np.random.default_rng(seed)
    seed_offset = seed - study.file.surrogate.seed
    mismatches = list(dict.fromkeys(round(point.mismatch / RPM, 9) for point in study.points))
    for index, design in enumerate(first_designs(study, designs, seed_offset, border=False)):
        clutch = study.clutch_with(design)
        plants = ClutchPlant(clutch), ClutchPlant(with_accuracy(clutch, REFERENCE_ACCURACY))
        for sign in (1.0, -1.0):
            mismatch = sign * rng.choice(mismatches)
            force = rng.choice(study.forces)
            profile = next(p.profile for p in study.points if p.profile.force == force)
            point = OperatingPoint(mismatch * RPM, profile)
            block = even_block(clutch, point, angles, (seed, 2 * index + int(sign < 0)))
            default, fine = (measure(plant, point, block.angles).times for plant in plants)
            pairs.append(Pair(design, point, default, fine))
    return pairs


def format_rate(count: int, total: int) -> str:
    """Write a share in percent with its exact interval."""
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    share = count / total if total else 0.0
    return f"{count:4d} of {total:5d}, {100 * share:5.2f} % ({100 * low:.2f} to {100 * high:.2f})"


def format_interval(pairs: Sequence[Pair], statistic: Callable[[Sequence[Pair]], float]) -> str:
    """Write a statistic of pairs with its interval from designs drawn with replacement."""
    rng = np.random.default_rng(1)
    groups: dict[tuple[float, ...], list[Pair]] = {}
    for pair in pairs:
        groups.setdefault(tuple(pair.design.values()), []).append(pair)
    designs = list(groups.values())
    samples = []
    for _ in range(BOOTSTRAP_DRAWS):
        drawn_pairs = []
        for k in rng.integers(len(designs), size=len(designs)):
            drawn_pairs += designs[k]
        samples.append(statistic(drawn_pairs))
    low, high = np.quantile(samples, [0.025, 0.975])
    return f"{statistic(pairs):9.4f} ({low:.4f} to {high:.4f})"


def shift_error_quantile(pairs: Sequence[Pair], share: float) -> float:
    """Compute a quantile of the errors of shifts that did not flip, percent."""
    return float(np.quantile(np.concatenate([p.errors for p in pairs]), share))


def mean_error_quantile(pairs: Sequence[Pair], share: float, *, smooth: bool) -> float:
    """Compute a quantile of the errors of means, percent, without flips if ``smooth``."""
    return float(np.quantile([abs(p.smooth_error if smooth else p.error) for p in pairs], share))


def print_errors(pairs: Sequence[Pair]) -> None:
    """Print rates of flips, and errors with and without them."""
    print("shifts that flip, by mismatch")
    for sign, name in ((1.0, "positive"), (-1.0, "negative")):
        signed_pairs = [p for p in pairs if sign * p.point.mismatch > 0.0]
        for low, high in (
            (0.0, MAX_SLOW_RPM),
            (MAX_SLOW_RPM, MIN_FAST_RPM),
            (MIN_FAST_RPM, np.inf),
        ):
            group = [p for p in signed_pairs if low < round(abs(p.point.mismatch) / RPM, 6) <= high]
            label = f"{low:.0f} to {high:.0f} 1/min" if high < np.inf else f"above {low:.0f} 1/min"
            print(f"  {name}, {label:<20} {format_rate(count_flips(group), count_shifts(group))}")
    print(f"  all {'':<27} {format_rate(count_flips(pairs), count_shifts(pairs))}")
    flipped_means = sum(p.flipped.any() for p in pairs)
    print(f"  means with one or more {'':<8} {format_rate(flipped_means, len(pairs))}")
    errors = np.concatenate([p.errors for p in pairs])
    large_errors = int((errors > 0.5).sum())
    print(f"  no flip, but 0.5 to 5 % off {'':<3} {format_rate(large_errors, errors.size)}")
    print("\nerror, %, with its interval")
    median = format_interval(pairs, lambda m: shift_error_quantile(m, 0.5))
    print(f"  single shift, no flip: median        {median}")
    quantile_99 = format_interval(pairs, lambda m: shift_error_quantile(m, 0.99))
    print(f"  single shift, no flip: 99 % below    {quantile_99}")
    for smooth, name in ((True, "without flips"), (False, "all shifts")):
        for share, text in ((0.5, "median"), (0.95, "95 % below"), (1.0, "largest")):
            label = f"mean of {DRAWN_ANGLES}, {name}: {text}"

            def statistic(m: Sequence[Pair], s: float = share, without: bool = smooth) -> float:
                return mean_error_quantile(m, s, smooth=without)

            print(f"  {label:<36} {format_interval(pairs, statistic)}")
    bias = format_interval(pairs, lambda m: float(np.mean([p.error for p in m])))
    print(f"  {'all means together, with sign':<36} {bias}")


def count_shifts(pairs: Sequence[Pair]) -> int:
    """Count the shifts of pairs."""
    return sum(p.times.size for p in pairs)


def count_flips(pairs: Sequence[Pair]) -> int:
    """Count the shifts of pairs that flipped."""
    return sum(int(p.flipped.sum()) for p in pairs)


def print_stiction() -> None:
    """Print the effect of the regularisation of friction in both contact sets."""
    study = paper_study()
    print("\nmean shift time of those that engage, ms, and how many of twelve stay blocked")
    for name, velocities in STICTION_VELOCITIES.items():
        head = "".join(f"{v * 1e3:>11.1f} mm/s" for v in velocities)
        print(f"\n{name:<18} stiction velocity{head}")
        for mismatch, force in STICTION_POINTS:
            row = ""
            for velocity in velocities:
                contact = replace(CONTACT_SETS[name], stiction_velocity=velocity)
                clutch = replace(study.clutch, contact=contact, solver=solver_for(contact))
                point = point_of(study, mismatch, force)
                angles = angles_of(clutch, 12, 0)
                cell = measure(ClutchPlant(clutch), point, angles)
                blocked = int(np.isnan(cell.times).sum())
                time = f"{cell.mean * 1e3:.1f}" if blocked < 12 else "-"
                row += f"{time:>10} ({blocked:2d})"
            print(f"{mismatch:7.0f} 1/min {force:7.1f} N           {row}", flush=True)


def print_design_errors() -> None:
    """Print the errors of designs drawn over the space."""
    print(
        f"\n{DRAWN_DESIGNS} designs, a point of either sign, {DRAWN_ANGLES} angles; "
        "accuracy 3e-4 and 1e-5"
    )
    print_errors(simulate_pairs(paper_study(), DRAWN_DESIGNS, DRAWN_ANGLES))


if __name__ == "__main__":
    print_accuracy_errors()
    print_mesh_errors()
    print_design_errors()
    print_stiction()
