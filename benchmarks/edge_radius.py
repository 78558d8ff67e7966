r"""Rounded edges: what they do to shift times and to crests that cross, against another method.

    python -m benchmarks.edge_radius [--angles N] [--jobs N]

*Ridge.* Rounded with :math:`\varrho`, a crest of the angle :math:`\psi = 90° + \beta - \alpha`
loses the height
:math:`c = \varrho(\sin(45° + \tfrac{\alpha + \beta}{2})/\sin\tfrac{\psi}{2} - 1)`, and its ridge
stands :math:`s = \varrho \cos(45° + \tfrac{\alpha + \beta}{2})/\sin\tfrac{\psi}{2}` behind the
sharp crest. So ridge meets ridge after the gap and :math:`2 c`, at an overlap of :math:`2 s`.

*Sections.* Across the crests two ridges that are :math:`e` beside each other are two circles. Where
they overlap by *d* along their common normal it leans by :math:`\sin\theta = e/(2\varrho - d)`, and
on the contact's bed of springs *k* they press with :math:`\tfrac{4}{3} k \sqrt{2 R}\, d^{3/2}`,
:math:`R = \varrho/2`.

*Window.* A ridge stands :math:`\tfrac{h}{2} \tan\beta + s` off a radial line, so two of them cross
under :math:`(h \tan\beta + 2 s)/r`, and *e* runs over :math:`W = (h \tan\beta + 2 s) b/r` along a
dog. Where the crossing lies on both dogs, its normal is the axis. Beyond, the ends touch
with a slope that friction of the angle :math:`\rho` holds while :math:`e \le 2 \varrho \sin\rho`.
Stiff dogs so hang over :math:`W + 4 \varrho \sin\rho` of overlap, more than with sharp crests.
Softer ones sink in, and touch with faces too: ``Ridges`` sums the pressure over sections of the
exact profile, arcs and all, with nothing of the engines' planes and polygons.

*Line contact.* The bed *k* stands for a dog that bends and is pressed. Two steel edges on each
other are a line contact in series with the dog: half width :math:`a = \sqrt{4 w R/(\pi E^*)}`,
stiffness :math:`\pi E^*/(2 \ln(4 \varrho/a) - 2)` for each length (Hertz; Johnson, *Contact
Mechanics*, 1985, 5.57, for both halves). A blow of the energy :math:`\tfrac{2}{5} w d` that the bed
takes, with *w* its load per length and *d* its depth, so peaks with more load on a narrower strip.

Printed are shares of a pitch that hang beside those of shifts without mismatch in the compiled
engine, what a line contact makes of the load on edges, times and hangs of three designs at the
operating points of the paper's study by the radius, landings on steel edges, what a finer polygon
changes, and both engines on the same shifts. Takes some minutes.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

import dogshape.sim.shift.planes
from benchmarks.common import paper_study, point_of
from benchmarks.contact_sets import kept
from benchmarks.crest_hang import LONG, clutch_of, time_on_crests
from benchmarks.ranking import expected
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.simulate.executor import Executor, scratch_executor
from dogshape.pipeline.simulate.point_plans import whole_plan
from dogshape.sim.engines import engage as engage_by
from dogshape.sim.planar.engagement import engage
from dogshape.sim.planar.plant import PlanarClutch, planar_clutch
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.flank import crest_setback
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.statistics.expectation import Expectation
from dogshape.sim.strength.line_contact import LineContact, edge_pressure, line_load
from dogshape.sim.units import MM, MPA

Array = NDArray[np.float64]
RADII = (0.0, 0.1, 0.2, 0.3)  #: mm
POINTS = 120  #: of a profile's arc, and of a radius along its faces
HUNG = 40  #: shifts over a window
WIDER = 1.6  #: of a window, over which shifts land


@dataclass(frozen=True)
class Ridges:
    """Two rounded crests that cross, by sections of their exact profile.

    Parameters
    ----------
    chamfer, traction : rad.
    radius : of the crests, m.
    width : lateral way of one ridge against the other along a dog, m, where they meet half way.
    length, middle : of a dog along the radius, and its mean radius, m.
    stiffness : of the contact, Pa/m.
    """

    chamfer: float
    traction: float
    radius: float
    width: float
    length: float
    middle: float
    stiffness: float

    @cached_property
    def profile(self) -> tuple[Array, Array, Array]:
        """Points (n, 2) of flank, arc and face about the ridge, m; their normals and lengths.

        The first axis points to the traction side, the second up; the ridge is the origin.
        """
        radius = self.radius
        step, (low, high) = radius / POINTS, self.leans
        tilt = -low + (high + low) * (np.arange(POINTS) + 0.5) / POINTS
        face, flank = ((math.sin(lean), math.cos(lean)) for lean in (-low, high))
        lengths = np.full(POINTS, radius * (high + low) / POINTS)
        ways = {count: step * (np.arange(count * POINTS) + 0.5) for count in (1, 4)}
        normals = np.column_stack([np.sin(tilt), np.cos(tilt)])
        places = [
            radius * normals,
            radius * np.array(face) - ways[4][:, None] * [face[1], -face[0]],
            radius * np.array(flank) + ways[1][:, None] * [flank[1], -flank[0]],
        ]
        sides = [normals, np.tile(face, (4 * POINTS, 1)), np.tile(flank, (POINTS, 1))]
        sizes = [lengths, np.full(5 * POINTS, step)]
        return np.concatenate(places) - [0.0, radius], np.concatenate(sides), np.concatenate(sizes)

    @property
    def leans(self) -> tuple[float, float]:
        """Angles of the normals of face and flank to the axis, either way, rad."""
        return self.chamfer, 0.5 * math.pi - self.traction

    def depth(self, places: Array) -> Array:
        """Compute the depth below the profile of places (..., 2), m; negative above it.

        Within the arc the normal is the place's own, beyond it that of the nearer face.
        """
        low, high = self.leans
        x, z = places[..., 0], places[..., 1] + self.radius
        tilt = np.clip(np.arctan2(x, z), -low, high)
        depth: Array = self.radius - x * np.sin(tilt) - z * np.cos(tilt)
        return depth

    def sections(self, aside: Array, depth: float) -> tuple[Array, Array]:
        """Return loads along and across the axis of sections, N/m, each (m,).

        ``aside`` is how far the ridges overlap, (m,), ``depth`` how deep one stands below the
        other, m. The other ring is turned over: half a turn about the normal of the section.
        """
        places, normals, lengths = self.profile
        theirs = -np.column_stack([aside, np.full(len(aside), depth)])[:, None] - places
        loads = np.maximum(self.depth(theirs), 0.0) * lengths * self.stiffness
        return loads @ normals[:, 1], loads @ normals[:, 0]

    def pressed(self, overlap: float, depth: float, sections: int = 41) -> tuple[float, float]:
        """Return loads along and across the axis on a dog, N, at an overlap of the ridges, m."""
        width = self.width + overlap * self.length / self.middle
        aside = overlap + width * ((np.arange(sections) + 0.5) / sections - 0.5)
        along, across = self.sections(aside, depth)
        return float(along.mean()) * self.length, float(across.mean()) * self.length

    def ratio(self, overlap: float, force: float) -> float:
        """Return load across over load along the axis under a force on one dog, N."""
        low, high = 1e-8, 1e-3
        for _ in range(15):
            depth = math.sqrt(low * high)
            along, across = self.pressed(overlap, depth)
            low, high = (depth, high) if along < force else (low, depth)
        return across / along

    def window(self, force: float, friction: float) -> float:
        """Return the width of overlap, m, over which friction holds one dog under a force, N."""
        return self._end(force, friction, +1) + self._end(force, friction, -1)

    def _end(self, force: float, friction: float, side: int) -> float:
        low, high = 0.0, 0.5 * self.width + 4.0 * self.radius * friction
        for _ in range(10):
            middle = 0.5 * (low + high)
            held = abs(self.ratio(side * middle, force)) <= friction
            low, high = (middle, high) if held else (low, middle)
        return low

    def hung_window(
        self, force: float, friction: float, stiction: float, left: float, places: int = 12
    ) -> float:
        """Return the width of overlap, m, from which creep does not lead out of the window in time.

        Regularised friction (``sim.planar.kernel.friction_at``) holds the load across at the slip
        ``stiction tan(pi ratio / (2 friction))``, m/s; ``left`` in s.
        """
        width = 0.0
        for side in (+1, -1):
            end = self._end(force, friction, side)
            aside = end * (np.arange(places) + 0.5) / places
            ratios = np.array([abs(self.ratio(side * float(a), force)) for a in aside])
            slip = stiction * np.tan(0.5 * math.pi * np.minimum(ratios / friction, 0.999))
            # Time to the end of the window, from the start of each place.
            rest = np.cumsum((end / places / slip)[::-1])[::-1]
            starts = end * np.arange(places) / places
            width += float(np.interp(-left, -rest, starts)) if rest[0] > left else 0.0
        return width

    def stiff_window(self, friction: float) -> float:
        """Return the width of overlap over which friction holds stiff dogs, m."""
        return self.width + 4.0 * self.radius * math.sin(math.atan(friction))


def ridges_of(clutch: Clutch) -> Ridges:
    """Return the rounded crests of a clutch."""
    dog = clutch.dog
    off = dog.height * math.tan(dog.traction) + 2.0 * crest_setback(dog, dog.edge_radius)
    width = off / dog.mean_radius * dog.radial_width
    return Ridges(
        dog.chamfer, dog.traction, dog.edge_radius, width, dog.radial_width, dog.mean_radius,
        clutch.contact.stiffness,
    )  # fmt: skip


def rounded(clutch: Clutch, radius: float) -> Clutch:
    """Return a clutch with edges of another radius, m."""
    return clutch.with_dog(replace(clutch.dog, edge_radius=radius))


def share_held(
    clutch: Clutch, point: OperatingPoint, over: float, shifts: int = HUNG
) -> tuple[float, float]:
    """Return the widths of overlap, m, over which shifts hang and over which they engage late.

    They land without mismatch at even overlaps over the width ``over`` about ridge on ridge.
    """
    dog, plant = clutch.dog, planar_clutch(clutch.with_engine("planar"))
    middle, hung, late = 2.0 * crest_setback(dog, dog.edge_radius), 0, 0
    for share in (np.arange(shifts) + 0.5) / shifts - 0.5:
        angle = (middle + over * float(share) - dog.crest_overlap) / dog.mean_radius
        found = engage(plant, point, angle)
        hung += found.outcome is Outcome.BLOCKED
        late += found.outcome is Outcome.ENGAGED and time_on_crests(found) > LONG
    return over * hung / shifts, over * late / shifts


def windows(study: Setup) -> None:
    """Print windows of overlap in which dogs hang."""
    force = 235.2
    point = point_of(study, 0.0, force)
    print(f"hung at {force} N without mismatch, share of a pitch, %")
    print("                     ridges  slopes  by sections:  less   engine:")
    print("design        radius  cross    held      friction  creep  hangs / is late")
    for name in ("prototype", "lean"):
        clutch = clutch_of(study, name)
        pitch, contact = clutch.dog.pitch, clutch.contact
        friction, left = contact.dynamic_friction, clutch.timeout - point.profile.rise
        for radius in RADII[1:]:
            own = rounded(clutch, radius * MM)
            ridges, each = ridges_of(own), force / clutch.dog.count
            stiff = ridges.stiff_window(friction)
            widths = (
                ridges.width,
                stiff,
                ridges.window(each, friction),
                ridges.hung_window(each, friction, contact.stiction_velocity, left),
                *share_held(own, point, WIDER * stiff),
            )
            cross, stiff, held, creeps, hung, late = (100.0 * width / pitch for width in widths)
            print(
                f"{name:<12}{radius:8.1f}{cross:7.2f}{stiff:8.2f}{held:14.2f}{creeps:7.2f}"
                f"{hung:7.2f} / {late:4.2f}",
                flush=True,
            )


def lines(study: Setup) -> None:
    """Print what a line contact makes of loads on edges."""
    dog, bed = study.clutch.dog, study.clutch.contact.stiffness
    column = bed * dog.tip_width
    print("\nedge on edge, prototype: bed of springs, and a blow of equal energy on a line contact")
    print(
        "radius, mm  load, N/mm  width, um    line: N/mm  width, um  pressure, MPa  at bed's load"
    )
    for radius in RADII[1:]:
        for load in (2e4, 1e5):
            depth = (0.75 * load / (bed * math.sqrt(radius * MM))) ** (2.0 / 3.0)
            width = 2.0 * math.sqrt(radius * MM * depth)
            line = LineContact(radius * MM, line_load(load, radius * MM, bed, column))
            print(
                f"{radius:10.1f}{load * MM:12.0f}{width * 1e6:11.0f}{line.load * MM:14.0f}"
                f"{2e6 * line.half_width:11.0f}{line.pressure / 1e6:15.0f}"
                f"{edge_pressure(load, radius * MM) / 1e6:19.0f}"
            )


def designs_of() -> dict[str, dict[str, float]]:
    """Collect prototype and the designs that both studies chose."""
    study = load_study("mq200_paper")
    found = {"prototype": study.prototype}
    for name in ("mq200", "mq200_paper"):
        best = kept(name)["best"]
        found[f"{name}, {best['trial']}"] = {key: best[key] for key in study.variables}
    return found


def times(angles: int, run: Executor) -> None:
    """Print expected times and hangs by the radius."""
    print(f"\nexpected shift time at 28 operating points, {angles} angles each, compiled engine")
    designs = designs_of()
    print("radius, mm" + "".join(f"{name:>34}" for name in designs))
    for radius in RADII:
        keys = {"dog.edge_radius_mm": radius, "manufacturing.root_radius_mm": radius or 0.3}
        print(row(radius, list(expected(keys, designs, angles, run).values())), flush=True)


def steel(angles: int, run: Executor) -> None:
    """Print the largest pressure on edges as simulated, and of the same blows on steel edges."""
    name = f"edge pressure that one landing in a hundred exceeds, MPa, {angles} angles"
    print(f"\n{name}: as simulated, and line contact")
    designs = designs_of()
    print("radius, mm" + "".join(f"{name:>22}" for name in designs) + "   limit")
    for radius in (0.3, 0.5):
        cells = {"bed": [], "line": []}  # type: dict[str, list[float]]
        for contact, found in cells.items():
            keys = {"manufacturing.root_radius_mm": radius, "load.edge_contact": contact}
            study = load_study("mq200", {**keys, "solver.engine": "planar"})
            dogs = [study.dog_with(design) for design in designs.values()]
            plans = [whole_plan(study, angles)] * len(dogs)
            for one in evaluate(study, dogs, run, plans, study.file.expectation.seed):
                found.append(one.measured.demand.edge / MPA)
        limit = study.limits.material.edge_pressure / MPA
        pairs = zip(*cells.values(), strict=True)
        told = "".join(f"{f'{bed:.0f} {line:.0f}':>22}" for bed, line in pairs)
        print(f"{radius:<10}{told}{limit:8.0f}", flush=True)


def row(radius: float, found: list[Expectation]) -> str:
    """Format the expected times of designs with one radius in mm."""
    cells = [
        f"{one.mean * 1e3:8.2f} +- {one.standard_error * 1e3:4.2f} ms, "
        f"{sum(p.lost for p in one.points)} of {sum(p.n for p in one.points)} lost"
        for one in found
    ]
    return f"{radius:<10}" + "".join(f"{cell:>34}" for cell in cells)


def finer(study: Setup, shifts: int = 84) -> None:
    """Print what more planes on an edge change, on shifts of the prototype."""
    print("\nprototype, 0.2 mm: mean of the same shifts by how far planes stand out of the edge")
    planes = dogshape.sim.shift.planes
    usual = planes.DEVIATION
    clutch = rounded(study.clutch.with_engine("planar"), 0.2 * MM)
    for deviation in (1e-5, 4e-6, 1e-6, 2.5e-7):
        planes.DEVIATION = deviation
        plant = planar_clutch(clutch)
        found = [time for time in _times(plant, study, shifts) if time is not None]
        print(
            f"{deviation * 1e6:6.2f} um, {len(plant.surfaces[1]):3d} surfaces: "
            f"{np.mean(found) * 1e3:8.3f} ms of {len(found)}"
        )
    planes.DEVIATION = usual


def _times(plant: PlanarClutch, study: Setup, shifts: int) -> list[float | None]:
    each = max(1, shifts // len(study.points))
    angles = (np.arange(each) + 0.37) / each * study.clutch.dog.pitch_angle
    return [engage(plant, point, float(a)).shift_time for point in study.points for a in angles]


def both(study: Setup, each: int = 1) -> None:
    """Print how well both engines agree by the radius, on shifts at all operating points."""
    print("\nboth engines: mean of the same shifts, and deviation of a shift, prototype")
    for radius in RADII:
        clutch = rounded(study.clutch, radius * MM)
        mine, drake = [], []
        for point in study.points:
            for share in (np.arange(each) + 0.37) / each:
                angle = float(share) * clutch.dog.pitch_angle
                mine.append(engage_by(clutch.with_engine("planar"), point, angle).shift_time)
                drake.append(engage_by(clutch, point, angle).shift_time)
        one, other = np.array(
            [pair for pair in zip(mine, drake, strict=True) if None not in pair]
        ).T
        apart = np.abs(one / other - 1.0)
        print(
            f"{radius:4.1f} mm, {len(one)} shifts: {one.mean() * 1e3:7.2f} and "
            f"{other.mean() * 1e3:7.2f} ms; median {np.median(apart):.1e}, 90 % "
            f"{np.quantile(apart, 0.9):.1e}, largest {apart.max():.1e}",
            flush=True,
        )


PARTS = ("windows", "lines", "times", "steel", "finer", "both")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=24)
    parser.add_argument("--jobs", type=int, default=0)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    given = parser.parse_args()
    study = paper_study()
    tables = {
        "windows": partial(windows, study),
        "lines": partial(lines, study),
        "times": partial(times, given.angles, scratch_executor(given.jobs)),
        "steel": partial(steel, 2 * given.angles, scratch_executor(given.jobs)),
        "finer": partial(finer, study),
        "both": partial(both, study),
    }
    for part in given.parts:
        tables[part]()


if __name__ == "__main__":
    main()
