"""Shifts in Drake and in MuJoCo, and causes of their differences.

    python -m benchmarks.second_engine [--angles N]

The first table has the mean shift time of either engine over even angles, the median
difference of single shifts, the share of angles that flip (differ by more than a tenth:
another slot, or another bounce) and the CPU time a shift. The second changes one thing at a time in
the cells that differ most. A last one has all three engines, each at its fine settings. Takes about
five minutes; needs the extra ``blind``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common import DESIGNS, Cell, angles_of, clutch_of, measure, paper_study, point_of
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.blocks import engage
from dogshape.sim.units import MM
from dogshape.validation.second_engine import FINE, EngineSettings, SecondEngine

#: Mismatch in 1/min and force in N.
POINTS = (
    (10.0, 235.2),
    (25.0, 641.5),
    (50.0, 469.0),
    (100.0, 315.5),
    (249.0, 469.0),
    (-50.0, 469.0),
)
FLIP_RATIO = 0.1  #: relative difference from which a shift counts as another one

Change = Callable[[Clutch], Clutch]


@dataclass(frozen=True)
class Agreement:
    """Agreement of two cells at equal angles; relative numbers, second over first."""

    first: Cell
    second: Cell

    @property
    def single(self) -> np.ndarray:
        """Relative difference of each shift, (n,); NaN where either did not engage."""
        return self.second.times / self.first.times - 1.0

    @property
    def size(self) -> np.ndarray:
        """Size of the difference of each shift, (n,); 1 where one engaged alone, 0 where none."""
        first_engaged = np.isfinite(self.first.times)
        second_engaged = np.isfinite(self.second.times)
        return np.where(
            first_engaged & second_engaged, np.abs(self.single), first_engaged != second_engaged
        )

    @property
    def mean(self) -> float:
        """Relative difference of the means."""
        return self.second.mean / self.first.mean - 1.0

    @property
    def median(self) -> float:
        """Median size of the difference of single shifts."""
        return float(np.nanmedian(np.abs(self.single)))

    @property
    def flipped(self) -> float:
        """Share of shifts that differ by more than a tenth or in outcome."""
        return float(np.mean(self.size > FLIP_RATIO))

    @property
    def kept(self) -> float:
        """Relative difference of the means over the shifts that did not flip."""
        same = self.size <= FLIP_RATIO
        return float(np.nansum(self.second.times[same]) / np.nansum(self.first.times[same]) - 1.0)


def measure_second(engine: SecondEngine, point: OperatingPoint, angles: np.ndarray) -> Cell:
    """Simulate shifts in MuJoCo and return their times and cost."""
    start = time.process_time()
    times = [engine.engage(point, float(angle)).time for angle in angles]
    cpu = time.process_time() - start
    return Cell(np.array(times, dtype=float), cpu / len(times))


def print_agreement(count: int) -> None:
    """Print the agreement of every design and operating point."""
    print(f"\nMuJoCo at {FINE.time_step * 1e6:g} us, damping {FINE.damping:g} 1/s; ", end="")
    print(f"{count} angles")
    for head in (
        ("design", "point", "Drake", "MuJoCo", "mean", "median", "flipped", "Drake", "MuJoCo"),
        ("", "1/min, N", "ms", "ms", "%", "%", "%", "CPU ms", "CPU ms"),
    ):
        widths = (14, 9, 9, 8, 8, 9, 9, 9)
        cells = [f"{text:>{width}}" for text, width in zip(head[1:], widths, strict=True)]
        print(f"{head[0]:<10}" + "".join(cells))
    study = paper_study()
    rows = []
    for design in DESIGNS:
        clutch = clutch_of(study, design)
        plant = ClutchPlant(clutch)
        engine = SecondEngine(clutch, FINE)
        for index, (mismatch, force) in enumerate(POINTS):
            point = point_of(study, mismatch, force)
            angles = angles_of(clutch, count, index)
            row = Agreement(measure(plant, point, angles), measure_second(engine, point, angles))
            rows.append(row)
            print(
                f"{design:<10}{mismatch:>7.0f}{force:>7.1f}{row.first.mean * 1e3:>9.2f}"
                f"{row.second.mean * 1e3:>9.2f}{row.mean * 100:>+8.2f}{row.median * 100:>8.2f}"
                f"{row.flipped * 100:>9.0f}{row.first.cpu * 1e3:>9.1f}{row.second.cpu * 1e3:>9.1f}",
                flush=True,
            )
    singles = np.abs(np.concatenate([row.single for row in rows]))
    print(
        f"all: means {np.mean([r.mean for r in rows]) * 100:+.2f} % on average, median of "
        f"single shifts {np.nanmedian(singles) * 100:.2f} %, "
        f"{np.mean([r.flipped for r in rows]) * 100:.0f} % flipped"
    )


def print_three_engines(count: int) -> None:
    """Print how all three engines agree, each at its fine settings."""
    study = paper_study()
    cells: dict[str, list[Cell]] = {"Drake": [], "MuJoCo": [], "compiled": []}
    for design in DESIGNS:
        clutch = clutch_of(study, design)
        plant = ClutchPlant(clutch.refined())
        engine = SecondEngine(clutch, FINE)
        compiled = clutch.with_engine("planar").refined()
        for index, (mismatch, force) in enumerate(POINTS):
            point = point_of(study, mismatch, force)
            angles = angles_of(clutch, count, index)
            cells["Drake"].append(measure(plant, point, angles))
            cells["MuJoCo"].append(measure_second(engine, point, angles))
            cells["compiled"].append(measure_compiled(compiled, point, angles))
    print(f"\nThree engines at finer steps, the same {count * len(DESIGNS) * len(POINTS)} shifts")
    print("                     mean %  median %   90 %  flipped %")
    for first, second in (("Drake", "MuJoCo"), ("Drake", "compiled"), ("MuJoCo", "compiled")):
        rows = [Agreement(a, b) for a, b in zip(cells[first], cells[second], strict=True)]
        differences = np.abs(np.concatenate([row.single for row in rows]))
        print(
            f"{first + ', ' + second:<18}{np.mean([r.mean for r in rows]) * 100:>+9.2f}"
            f"{np.nanmedian(differences) * 100:>10.3f}"
            f"{np.nanquantile(differences, 0.9) * 100:>7.2f}"
            f"{np.mean([r.flipped for r in rows]) * 100:>11.1f}",
            flush=True,
        )


def measure_compiled(clutch: Clutch, point: OperatingPoint, angles: np.ndarray) -> Cell:
    """Simulate shifts in the compiled engine and return their times and cost."""
    start = time.process_time()
    results = [engage(clutch, point, float(a)) for a in angles]
    cpu = time.process_time() - start
    times = np.array(
        [np.nan if result.shift_time is None else result.shift_time for result in results]
    )
    return Cell(
        times, cpu / len(results), sum(result.evaluations for result in results) / len(results)
    )


def unchanged(clutch: Clutch) -> Clutch:
    """Change nothing."""
    return clutch


def narrow_rings(clutch: Clutch) -> Clutch:
    """Make the rings so narrow that the radius of every contact is known."""
    dog = replace(clutch.dog, inner_diameter=47.8 * MM, outer_diameter=48.2 * MM)
    return replace(clutch, dog=dog)


def with_contact(**changes: float) -> Change:
    """Return a change of contact parameters."""
    return lambda clutch: replace(clutch, contact=replace(clutch.contact, **changes))


def narrow_stiff_rings(clutch: Clutch) -> Clutch:
    """Narrow rings with a layer that makes up for their small faces, and twenty times over."""
    return with_contact(stiffness=400.0 * clutch.contact.stiffness)(narrow_rings(clutch))


low_creep = with_contact(stiction_velocity=2e-5)
#: Label, change for both engines, change for Drake, and settings of MuJoCo.
Case = tuple[str, Change, Change, EngineSettings]
CASES: tuple[tuple[str, int, tuple[Case, ...]], ...] = (
    (
        "prototype",
        1,
        (
            ("as it is", unchanged, unchanged, FINE),
            ("Drake: tolerance 30 times tighter", unchanged, Clutch.refined, FINE),
            ("MuJoCo: half the step", unchanged, unchanged, replace(FINE, time_step=2e-6)),
            ("Drake: stiffness times 20", unchanged, with_contact(stiffness=1e14), FINE),
            ("both: rings 0.2 mm wide", narrow_rings, unchanged, FINE),
            ("both: narrow, Drake 400 times as stiff", narrow_rings, narrow_stiff_rings, FINE),
        ),
    ),
    (
        "steep",
        5,
        (
            ("as it is", unchanged, unchanged, FINE),
            ("Drake: stiction velocity a tenth", unchanged, low_creep, FINE),
        ),
    ),
    (
        "fine",
        2,
        (
            ("as it is", unchanged, unchanged, FINE),
            ("MuJoCo: half the step", unchanged, unchanged, replace(FINE, time_step=2e-6)),
            ("both: dissipation halved", with_contact(dissipation=10.0), unchanged, FINE),
            ("Drake: dissipation halved", unchanged, with_contact(dissipation=10.0), FINE),
        ),
    ),
    (
        "prototype",
        4,
        (
            ("as it is", unchanged, unchanged, FINE),
            ("Drake: tolerance 30 times tighter", unchanged, Clutch.refined, FINE),
            ("MuJoCo: half the step", unchanged, unchanged, replace(FINE, time_step=2e-6)),
            ("MuJoCo: a fifth of the damping", unchanged, unchanged, replace(FINE, damping=5e3)),
            ("both: dissipation doubled", with_contact(dissipation=40.0), unchanged, FINE),
            ("Drake: dissipation doubled", unchanged, with_contact(dissipation=40.0), FINE),
        ),
    ),
)


def print_causes(count: int) -> None:
    """Print the cells that differ most under single changes."""
    study = paper_study()
    for design, index, cases in CASES:
        mismatch, force = POINTS[index]
        point = point_of(study, mismatch, force)
        print(
            f"\n{design} at {mismatch:g} 1/min, {force:g} N{'Drake ms':>24}{'MuJoCo ms':>11}",
            end="",
        )
        print(f"{'mean %':>9}{'median %':>10}{'flipped %':>11}")
        angles = angles_of(clutch_of(study, design), count, index)
        for label, change, drake_change, settings in cases:
            clutch = change(clutch_of(study, design))
            row = Agreement(
                measure(ClutchPlant(drake_change(clutch)), point, angles),
                measure_second(SecondEngine(clutch, settings), point, angles),
            )
            print(
                f"  {label:<40}{row.first.mean * 1e3:>9.2f}{row.second.mean * 1e3:>11.2f}"
                f"{row.mean * 100:>+9.2f}{row.median * 100:>10.2f}{row.flipped * 100:>11.0f}",
                flush=True,
            )


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=8)
    count = parser.parse_args().angles
    print_agreement(count)
    print_causes(count)
    print_three_engines(count)


if __name__ == "__main__":
    main()
