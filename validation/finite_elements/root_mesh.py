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
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from dogshape.sim.errors import GeometryError, refusal, require_between
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank, side_angle
from dogshape.sim.units import MM

Points = NDArray[np.float64]
Ints = NDArray[np.int64]
Curve = Callable[[Points], Points]  #: parameters (n,) to points (n, 2)

SIDES: dict[Flank, int] = {"traction": +1, "braking": -1}
#: Cells of the coarsest mesh: half a fillet, surface layer, floor, flank, core, depth, radius.
_ARC, _LAYER, _FLOOR, _FLANK, _CORE, _DEPTH, _RADIAL = 2, 1, 1, 3, 2, 3, 3
_SMALLEST_FLOOR = 0.05  #: of the fillet radius: half of the floor left between two fillets


@dataclass(frozen=True)
class RootShape:
    """A dog with its root fillet (``root_radius``, m), on a body ``depth`` (m) below the floor."""

    dog: Dog
    root_radius: float
    depth: float

    def __post_init__(self) -> None:
        require_between("root_radius_mm", self.root_radius / MM, 0.01, 10.0, "correct the fillet")
        require_between("depth_mm", self.depth / MM, 0.1, 1e3, "correct the depth of the body")
        for flank in SIDES:
            self._require_room(flank)

    def _require_room(self, flank: Flank) -> None:
        radius = self.dog.inner_radius
        room = 0.5 * (self.dog.tip_width_at(radius) + self.dog.backlash_angle * radius)
        need = (1.0 + _SMALLEST_FLOOR) * self.root_radius * math.tan(0.5 * self.sweep(flank))
        remedy = "use a smaller root radius, fewer dogs or smaller side angles"
        if room < need:
            rule = f"half a fillet and a little floor need {need * 1e3:.4g} mm"
            name = "half the slot's floor at the inner radius"
            raise GeometryError(refusal(name, room * 1e3, "mm", rule, remedy))
        high = self.top(flank, self.dog.outer_radius) + 0.5 * self.dog.height
        if high < 1.5 * self.fillet_height(flank):
            rule = "the fillet may take at most two thirds of it"
            raise GeometryError(refusal(f"{flank} flank", high * 1e3, "mm high", rule, remedy))

    def sweep(self, flank: Flank) -> float:
        """Angle that the fillet covers, rad."""
        return 0.5 * math.pi - side_angle(self.dog, flank)

    def fillet_height(self, flank: Flank) -> float:
        """Height above the floor at which the fillet runs into the flank, m."""
        return self.root_radius * (1.0 - math.sin(side_angle(self.dog, flank)))

    def top(self, flank: Flank, radius: float) -> float:
        """Upper end of a flank at a radius above the median plane, m."""
        return 0.5 * self.dog.height - self.dog.drops_at(radius)[FLANKS.index(flank)]

    @property
    def layer(self) -> float:
        """Depth of the surface layer, m."""
        return min(0.75 * self.root_radius, 0.2 * self.dog.tip_width_at(self.dog.inner_radius))


@dataclass(frozen=True)
class Section:
    """Topology of a section: cells of nine nodes, and which of them bound what.

    ``cells`` (m, 3, 3) node numbers, first index along the surface, second away from it. ``fillet``
    and ``flank`` are cell numbers by flank; ``bottom``, ``left`` and ``right`` node numbers, the
    last two in the same order from the floor down.
    """

    cells: Ints
    fillet: dict[Flank, Ints]
    flank: dict[Flank, Ints]
    bottom: Ints
    left: Ints
    right: Ints
    order: Ints

    @property
    def nodes(self) -> int:
        """Number of nodes of the plane."""
        return len(self.order)


def _graded(cells: int, length: float, first: float) -> Points:
    """Return knots on [0, 1], mid-nodes between them, (2 cells + 1,); ``first`` cell in m.

    The map is exponential and, ``first`` falling with the number of cells, the same at
    each refinement.
    """
    ratio = min(cells * first / length, 1.0)
    knots = np.linspace(0.0, 1.0, cells + 1)
    if ratio < 0.999:
        rate = float(brentq(lambda a: a / math.expm1(a) - ratio, 1e-9, 60.0))
        knots = np.expm1(rate * knots) / math.expm1(rate)
    return _with_middles(knots)


def _with_middles(knots: Points) -> Points:
    full = np.empty(2 * len(knots) - 1)
    full[::2] = knots
    full[1::2] = 0.5 * (knots[1:] + knots[:-1])
    return full


def _ruled(start: Points, end: Points, across: Points) -> Points:
    """Return points (n, m, 2) on straight lines from ``start`` to ``end``, both (n, 2)."""
    return np.asarray(start[:, None] + across[None, :, None] * (end - start)[:, None])


@dataclass(frozen=True)
class _Side:
    """Curves of one side at one radius; y points outwards from the dog's middle."""

    floor: tuple[Points, Points]  # on the floor and one layer below it, from the cut inwards
    arc: tuple[Points, Points]
    flank: tuple[Points, Points]


def _line(start: Points, end: Points, at: Points) -> Points:
    return start + at[:, None] * (end - start)


def _side(shape: RootShape, flank: Flank, radius: float, fineness: int) -> _Side:
    dog, rho, layer = shape.dog, shape.root_radius, shape.layer
    lean, sweep = side_angle(shape.dog, flank), shape.sweep(flank)
    play, floor = dog.backlash_angle * radius, -0.5 * dog.height
    quarter = 0.25 * (dog.pitch_angle * radius - play)
    foot = quarter - floor * math.tan(lean) + rho * math.tan(0.5 * sweep)
    cut = quarter - floor * math.tan(lean) + 0.5 * (dog.tip_width_at(radius) + play)
    angles = sweep * _with_middles(np.linspace(0.0, 1.0, 2 * _ARC * fineness + 1))
    ray = np.column_stack([-np.sin(angles), -np.cos(angles)])
    centre = np.array([foot, floor + rho])
    arc, inner = centre + rho * ray, centre + (rho + layer) * ray
    top = shape.top(flank, radius)
    rise = math.tan(dog.falls[FLANKS.index(flank)])
    edge = np.array([quarter - top * math.tan(lean), top])
    # Gradings belong to the mean radius, so that they are the same at every radius.
    cell = rho * sweep / (2 * _ARC * fineness)
    long = 0.5 * (dog.tip_width + dog.backlash) - rho * math.tan(0.5 * sweep)
    high = (shape.top(flank, dog.mean_radius) - floor - shape.fillet_height(flank)) / math.cos(lean)
    along_floor = 1.0 - _graded(_FLOOR * fineness, long, 1.5 * cell)[::-1]
    along_flank = _graded(_FLANK * fineness, high, 1.5 * cell)
    end, below = np.array([cut, floor]), np.array([cut, floor - layer])
    return _Side(
        (_line(end, arc[0], along_floor), _line(below, inner[0], along_floor)),
        (arc, inner),
        (
            _line(arc[-1], edge, along_flank),
            _line(inner[-1], edge + layer * np.array([-1.0, rise]), along_flank),
        ),
    )


def _blocks(shape: RootShape, radius: float, fineness: int) -> dict[str, Points]:
    """Return the blocks of a section; corresponding points of all radii match."""
    layer = _with_middles(np.linspace(0.0, 1.0, _LAYER * fineness + 1) ** 2)
    cell = shape.layer / (_LAYER * fineness)
    down = _graded(_DEPTH * fineness, shape.depth - shape.layer, 1.5 * cell)
    bottom = -0.5 * shape.dog.height - shape.depth
    middle = 2 * _ARC * fineness
    found, inside, hips = dict[str, Points](), {}, {}
    for flank, sign in SIDES.items():
        side = _side(shape, flank, radius, fineness)
        turn = np.array([sign, 1.0])
        for name, (outer, inner) in (
            ("floor", side.floor),
            ("fillet", side.arc),
            ("flank", side.flank),
        ):
            found[f"{name} {flank}"] = _ruled(outer * turn, inner * turn, layer)
        inside[flank] = np.concatenate([side.arc[1][middle:], side.flank[1][1:]]) * turn
        hips[flank] = np.concatenate([side.floor[1], side.arc[1][1 : middle + 1]]) * turn
    across = _with_middles(np.linspace(0.0, 1.0, _CORE * fineness + 1))
    found["core"] = _ruled(inside["braking"], inside["traction"], across)
    waist = _line(inside["braking"][0], inside["traction"][0], across)
    for name, top in (("body", waist), *((f"body {flank}", hips[flank]) for flank in SIDES)):
        low = np.column_stack([top[:, 0], np.full(len(top), bottom)])
        found[name] = _ruled(top, low, down)
    return found


def make_section(shape: RootShape, fineness: int) -> Section:
    """Number the nodes and cells of a section."""
    blocks = _blocks(shape, shape.dog.mean_radius, fineness)
    points = np.concatenate([block.reshape(-1, 2) for block in blocks.values()])
    grain = 1e-6 * shape.root_radius
    _, order, number = np.unique(
        np.round(points / grain + 0.137).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    number = number.reshape(-1)
    cells: list[Ints] = []
    lattice, start, rows = {}, 0, {}
    for name, block in blocks.items():
        n, m = block.shape[:2]
        lattice[name] = number[start : start + n * m].reshape(n, m)
        start += n * m
        found = _cells(lattice[name])
        first = sum(map(len, cells))
        cells.append(found)
        # Cells run fastest away from the surface.
        rows[name] = np.arange(first, first + len(found), (m - 1) // 2)
    cuts = {
        flank: np.concatenate([lattice[f"floor {flank}"][0], lattice[f"body {flank}"][0][1:]])
        for flank in SIDES
    }
    names = ("body", "body traction", "body braking")
    return Section(
        cells=np.concatenate(cells),
        fillet={flank: rows[f"fillet {flank}"] for flank in SIDES},
        flank={flank: rows[f"flank {flank}"] for flank in SIDES},
        bottom=np.unique(np.concatenate([lattice[name][:, -1] for name in names])),
        left=cuts["braking"],
        right=cuts["traction"],
        order=order,
    )


def _cells(lattice: Ints) -> Ints:
    n, m = lattice.shape
    return np.array(
        [lattice[i : i + 3, j : j + 3] for i in range(0, n - 2, 2) for j in range(0, m - 2, 2)]
    )


def radial_planes(dog: Dog, fineness: int) -> Points:
    """Return the radii of the planes of nodes, (2 n + 1,) m, denser towards both ends."""
    knots = np.linspace(-1.0, 1.0, _RADIAL * fineness + 1)
    knots = knots + 0.2 * np.sin(math.pi * knots)
    return dog.mean_radius + 0.5 * dog.radial_width * _with_middles(knots)


def ring_points(shape: RootShape, section: Section, radii: Points, fineness: int) -> Points:
    """Return the nodes of one pitch, (planes * n, 3) in m, plane by plane."""
    planes = []
    for radius in radii:
        blocks = _blocks(shape, float(radius), fineness).values()
        plane = np.concatenate([points.reshape(-1, 2) for points in blocks])[section.order]
        angle = plane[:, 0] / radius
        planes.append(
            np.column_stack([radius * np.cos(angle), radius * np.sin(angle), plane[:, 1]])
        )
    return np.concatenate(planes)
