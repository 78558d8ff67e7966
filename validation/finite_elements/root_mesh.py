r"""Mesh of one pitch of a ring for the stress at the root of its dog.

The section at a radius is unrolled: x along the circumference from the middle of the dog, z along
the axis, floor of the slot at -h/2. A fillet joins the floor to either flank; edges of the tip are
sharp, and a ridge between them is left out. It is cut halfway to the next dog, and reaches
``depth`` below the floor. Blocks: a surface layer over floor, fillet and flank of either side; the
core of the dog between them; the body below dog and floors. They are ruled between two curves and
keep their numbers of cells at every radius: planes of nodes, each turned by x/R about the axis,
make hexahedra with 27 nodes. Flanks are planes through radial lines to within a thousandth of their
lean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from dogshape.sim.errors import GeometryError, Refusal, require_between
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.units import MM

Points = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDES: dict[Flank, int] = {"traction": +1, "braking": -1}
#: Cells of the coarsest mesh.
HALF_FILLET_CELLS = 2
LAYER_CELLS = 1
FLOOR_CELLS = 1
FLANK_CELLS = 3
CORE_CELLS = 2
DEPTH_CELLS = 3
RADIAL_CELLS = 3
MIN_FLOOR = 0.05  #: half of the floor between two fillets, of the fillet radius
GROWTH = 1.5  #: of a cell over the neighbouring finer one, where cells are graded
MATCH_TOLERANCE = 1e-6  #: of coinciding nodes, of the fillet radius


@dataclass(frozen=True)
class RootShape:
    """Dog with its root fillet on a body."""

    dog: Dog
    root_radius: float  #: of the fillet, m
    depth: float  #: of the body below the floor, m

    def __post_init__(self) -> None:
        require_between("root_radius_mm", self.root_radius / MM, 0.01, 10.0, "correct the fillet")
        require_between("depth_mm", self.depth / MM, 0.1, 1e3, "correct the depth of the body")
        for flank in SIDES:
            self._require_room(flank)

    def _require_room(self, flank: Flank) -> None:
        radius = self.dog.inner_radius
        floor = 0.5 * (self.dog.tip_width_at(radius) + self.dog.backlash_angle * radius)
        min_floor = (1.0 + MIN_FLOOR) * self.root_radius * math.tan(0.5 * self.sweep(flank))
        remedy = "use a smaller root radius, fewer dogs or smaller side angles"
        if floor < min_floor:
            rule = f"half a fillet and a little floor need {min_floor * 1e3:.4g} mm"
            name = "half the slot's floor at the inner radius"
            raise GeometryError(Refusal(name, floor * 1e3, "mm", rule=rule, remedy=remedy))
        height = self.top(flank, self.dog.outer_radius) + 0.5 * self.dog.height
        if height < 1.5 * self.fillet_height(flank):
            rule = "the fillet may take at most two thirds of it"
            name = f"{flank} flank"
            raise GeometryError(Refusal(name, height * 1e3, "mm high", rule=rule, remedy=remedy))

    def sweep(self, flank: Flank) -> float:
        """Compute the angle of the fillet, rad."""
        return 0.5 * math.pi - side_angle(self.dog, flank)

    def fillet_height(self, flank: Flank) -> float:
        """Compute the height above the floor at which the fillet ends on the flank, m."""
        return self.root_radius * (1.0 - math.sin(side_angle(self.dog, flank)))

    def top(self, flank: Flank, radius: float) -> float:
        """Compute the height of a flank's upper end above the median plane at a radius, m."""
        return 0.5 * self.dog.height - self.dog.drops_at(radius)[FLANKS.index(flank)]

    @property
    def layer(self) -> float:
        """Depth of the surface layer, m."""
        return min(0.75 * self.root_radius, 0.2 * self.dog.tip_width_at(self.dog.inner_radius))


@dataclass(frozen=True)
class Section:
    """Topology of a section: cells of nine nodes, and its boundaries."""

    cells: Ints  #: node numbers, first along the surface, then away from it, (m, 3, 3)
    fillet: dict[Flank, Ints]  #: cell numbers by flank
    flank: dict[Flank, Ints]  #: cell numbers by flank
    bottom: Ints  #: node numbers
    left: Ints  #: node numbers from the floor down
    right: Ints  #: node numbers from the floor down
    tip: Ints  #: node numbers from the braking to the traction edge
    order: Ints  #: of each node the number of its first point among those of all blocks, (n,)

    @property
    def nodes(self) -> int:
        """Number of nodes of the plane."""
        return len(self.order)


def _graded(cells: int, length: float, first: float) -> Points:
    """Compute graded knots on [0, 1] with mid-nodes, (2 cells + 1,).

    ``length`` and the ``first`` cell are in m. The map is exponential and, as ``first`` falls with
    the number of cells, the same at each refinement.
    """
    ratio = min(cells * first / length, 1.0)
    knots = np.linspace(0.0, 1.0, cells + 1)
    if ratio < 0.999:
        rate = float(brentq(lambda a: a / math.expm1(a) - ratio, 1e-9, 60.0))
        knots = np.expm1(rate * knots) / math.expm1(rate)
    return _with_middles(knots)


def _with_middles(knots: Points) -> Points:
    """Insert midpoints between knots (n,), (2 n - 1,)."""
    nodes = np.empty(2 * len(knots) - 1)
    nodes[::2] = knots
    nodes[1::2] = 0.5 * (knots[1:] + knots[:-1])
    return nodes


def _ruled(start: Points, end: Points, shares: Points) -> Points:
    """Compute points (n, m, 2) at shares (m,) of the lines from ``start`` to ``end``, (n, 2)."""
    return np.asarray(start[:, None] + shares[None, :, None] * (end - start)[:, None])


class _Strip(NamedTuple):
    """Corresponding points on a surface and on the layer below it, m, (n, 2) each."""

    surface: Points
    below: Points


class _Side(NamedTuple):
    """Strips of one side at one radius from the cut inwards; y points outwards from the dog."""

    floor: _Strip
    fillet: _Strip
    flank: _Strip


def _line(start: Points, end: Points, shares: Points) -> Points:
    """Compute points at shares (n,) of the line between two points (2,), (n, 2)."""
    return start + shares[:, None] * (end - start)


def _side(shape: RootShape, flank: Flank, radius: float, fineness: int) -> _Side:
    """Compute the strips of one side at a radius, m."""
    dog = shape.dog
    rho = shape.root_radius
    layer = shape.layer
    lean = side_angle(shape.dog, flank)
    sweep = shape.sweep(flank)
    play = dog.backlash_angle * radius
    floor = -0.5 * dog.height
    quarter = 0.25 * (dog.pitch_angle * radius - play)
    foot = quarter - floor * math.tan(lean) + rho * math.tan(0.5 * sweep)
    cut = quarter - floor * math.tan(lean) + 0.5 * (dog.tip_width_at(radius) + play)
    knots = np.linspace(0.0, 1.0, 2 * HALF_FILLET_CELLS * fineness + 1)
    angles = sweep * _with_middles(knots)
    rays = np.column_stack([-np.sin(angles), -np.cos(angles)])
    centre = np.array([foot, floor + rho])
    fillet = _Strip(centre + rho * rays, centre + (rho + layer) * rays)
    top = shape.top(flank, radius)
    rise = math.tan(dog.falls[FLANKS.index(flank)])
    edge = np.array([quarter - top * math.tan(lean), top])
    # Gradings belong to the mean radius, so that they are the same at every radius.
    cell = rho * sweep / (2 * HALF_FILLET_CELLS * fineness)
    floor_length = 0.5 * (dog.tip_width + dog.backlash) - rho * math.tan(0.5 * sweep)
    flank_height = shape.top(flank, dog.mean_radius) - floor - shape.fillet_height(flank)
    flank_length = flank_height / math.cos(lean)
    floor_shares = 1.0 - _graded(FLOOR_CELLS * fineness, floor_length, GROWTH * cell)[::-1]
    flank_shares = _graded(FLANK_CELLS * fineness, flank_length, GROWTH * cell)
    edge_below = edge + layer * np.array([-1.0, rise])
    return _Side(
        floor=_Strip(
            _line(np.array([cut, floor]), fillet.surface[0], floor_shares),
            _line(np.array([cut, floor - layer]), fillet.below[0], floor_shares),
        ),
        fillet=fillet,
        flank=_Strip(
            _line(fillet.surface[-1], edge, flank_shares),
            _line(fillet.below[-1], edge_below, flank_shares),
        ),
    )


def _blocks(shape: RootShape, radius: float, fineness: int) -> dict[str, Points]:
    """Compute the blocks of a section at a radius by name, (n, m, 2) each.

    Corresponding points of all radii match.
    """
    layer = _with_middles(np.linspace(0.0, 1.0, LAYER_CELLS * fineness + 1) ** 2)
    cell = shape.layer / (LAYER_CELLS * fineness)
    depth = _graded(DEPTH_CELLS * fineness, shape.depth - shape.layer, GROWTH * cell)
    bottom = -0.5 * shape.dog.height - shape.depth
    middle = 2 * HALF_FILLET_CELLS * fineness
    blocks: dict[str, Points] = {}
    core_sides = {}
    tops = {}
    for flank, sign in SIDES.items():
        side = _side(shape, flank, radius, fineness)
        mirror = np.array([sign, 1.0])
        for name, strip in side._asdict().items():
            blocks[f"{name} {flank}"] = _ruled(strip.surface * mirror, strip.below * mirror, layer)
        core_side = np.concatenate([side.fillet.below[middle:], side.flank.below[1:]])
        top = np.concatenate([side.floor.below, side.fillet.below[1 : middle + 1]])
        core_sides[flank] = core_side * mirror
        tops[f"body {flank}"] = top * mirror
    core_shares = _with_middles(np.linspace(0.0, 1.0, CORE_CELLS * fineness + 1))
    blocks["core"] = _ruled(core_sides["braking"], core_sides["traction"], core_shares)
    waist = _line(core_sides["braking"][0], core_sides["traction"][0], core_shares)
    for name, top in {"body": waist, **tops}.items():
        foot = np.column_stack([top[:, 0], np.full(len(top), bottom)])
        blocks[name] = _ruled(top, foot, depth)
    return blocks


def make_section(shape: RootShape, fineness: int) -> Section:
    """Number the nodes and cells of a section."""
    blocks = _blocks(shape, shape.dog.mean_radius, fineness)
    points = np.concatenate([block.reshape(-1, 2) for block in blocks.values()])
    tolerance = MATCH_TOLERANCE * shape.root_radius
    _, order, numbers = np.unique(
        np.round(points / tolerance + 0.137).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    numbers = numbers.reshape(-1)
    cells: list[Ints] = []
    lattices = {}
    surface_cells = {}
    start = 0
    cell_count = 0
    for name, block in blocks.items():
        n, m = block.shape[:2]
        lattices[name] = numbers[start : start + n * m].reshape(n, m)
        start += n * m
        block_cells = _cells(lattices[name])
        cells.append(block_cells)
        # Cells run fastest away from the surface.
        end = cell_count + len(block_cells)
        surface_cells[name] = np.arange(cell_count, end, (m - 1) // 2)
        cell_count = end
    cuts = {}
    for flank in SIDES:
        body = lattices[f"body {flank}"]
        cuts[flank] = np.concatenate([lattices[f"floor {flank}"][0], body[0][1:]])
    bodies = [lattices[name] for name in ("body", "body traction", "body braking")]
    braking_tip = lattices["flank braking"][-1]
    core_tip = lattices["core"][-1]
    traction_tip = lattices["flank traction"][-1][::-1]
    return Section(
        cells=np.concatenate(cells),
        fillet={flank: surface_cells[f"fillet {flank}"] for flank in SIDES},
        flank={flank: surface_cells[f"flank {flank}"] for flank in SIDES},
        bottom=np.unique(np.concatenate([body[:, -1] for body in bodies])),
        left=cuts["braking"],
        right=cuts["traction"],
        tip=np.concatenate([braking_tip, core_tip[1:], traction_tip[1:]]),
        order=order,
    )


def _cells(lattice: Ints) -> Ints:
    """List the cells of a lattice of nodes (n, m), (cells, 3, 3)."""
    n, m = lattice.shape
    return np.array(
        [lattice[i : i + 3, j : j + 3] for i in range(0, n - 2, 2) for j in range(0, m - 2, 2)]
    )


def radial_planes(dog: Dog, fineness: int) -> Points:
    """Compute the radii of the planes of nodes, m, (2 n + 1,), denser towards both ends."""
    knots = np.linspace(-1.0, 1.0, RADIAL_CELLS * fineness + 1)
    knots = knots + 0.2 * np.sin(math.pi * knots)
    return dog.mean_radius + 0.5 * dog.radial_width * _with_middles(knots)


def section_points(shape: RootShape, section: Section, radius: float, fineness: int) -> Points:
    """Compute the nodes of a section, unrolled at a radius, m, (n, 2)."""
    blocks = _blocks(shape, radius, fineness).values()
    return np.concatenate([points.reshape(-1, 2) for points in blocks])[section.order]


def ring_points(shape: RootShape, section: Section, radii: Points, fineness: int) -> Points:
    """Compute the nodes of one pitch plane by plane, m, (planes * n, 3)."""
    planes = []
    for radius in radii:
        plane = section_points(shape, section, float(radius), fineness)
        angle = plane[:, 0] / radius
        planes.append(
            np.column_stack([radius * np.cos(angle), radius * np.sin(angle), plane[:, 1]])
        )
    return np.concatenate(planes)
