r"""Stress at the root of one dog by finite elements, linear elastic, in three dimensions.

One pitch of a ring (``root_mesh``) in isoparametric hexahedra with 27 nodes. The body's lower face
is fixed, its inner face rests on a hub that holds it radially, both cuts move alike in cylindrical
coordinates (every dog is loaded the same), the outer face is free. A band of one flank carries a
uniform pressure: "whole", what touches at full depth, evenly about the median plane, or "tip", the
top fifth, the worst case. Force and lever are sum and moment of the load vector. Stress is that of
the fillet's own stretch in plane stress, at the 2 x 2 Gauss points of each cell's face; its largest
value counts, ends of the dog included. Mesh, depth of the body, cuts and hub: ``python -m
benchmarks.root_stress``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from dogshape.pipeline.record import Record, Table, key
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank
from dogshape.sim.shift.mesh import rotation
from dogshape.sim.strength.dog_strength import Limits, Load, root_load, root_tension
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import MM, MPA
from dogshape.validation.finite_elements.root_mesh import (
    SIDES,
    Points,
    RootShape,
    Section,
    make_section,
    radial_planes,
    ring_points,
)

Band = Literal["whole", "tip"]
BANDS: tuple[Band, ...] = ("whole", "tip")
Cut = Literal["periodic", "free", "fixed"]
Matrix = Any  #: scipy's sparse matrix in compressed rows
TIP_PART = 0.2  #: of the flank's height that the band at the tip takes
FINENESS = 2  #: default: 8 cells over a fillet, 6 along the radius
HUB_STIFFNESS = 1e11  #: N/m a node: thousands of times that of a cell


@dataclass(frozen=True)
class RootStress:
    """Largest first principal stress in the fillet of the loaded flank, Pa, and its load.

    ``radius`` (m) and ``angle`` (rad along the fillet from the floor) are its place; ``force`` is
    tangential, N, ``lever`` the height of its line above the floor, m, ``axial`` the force of the
    flank towards the body, N.
    """

    tension: float
    radius: float
    angle: float
    force: float
    lever: float
    axial: float


def fem_available() -> bool:
    """Test that scikit-fem can be imported."""
    try:
        _skfem()
    except InputError:
        return False
    return True


def _skfem() -> Any:
    try:
        return import_module("skfem")
    except ImportError as error:
        message = "the finite elements need scikit-fem; install dogshape[fem]."
        raise InputError(message) from error


@dataclass(frozen=True)
class _Surface:
    """Points on the surface of cells: nodes (c, 27), places and n dA (c, q, 3), shapes."""

    nodes: NDArray[np.int64]
    places: Points
    area: Points
    value: Points  # (27, 1 or c, q)
    slope: Points  # (27, 3, c, q), 1/m


class RootModel:
    """One pitch of a ring, assembled and ready for any number of loads.

    ``fineness`` multiplies the coarsest mesh's cells each way; ``cut`` holds the middle of slots.
    """

    def __init__(
        self, shape: RootShape, fineness: int = FINENESS, cut: Cut = "periodic", hub: bool = True
    ) -> None:
        self.shape = shape
        self.section: Section = make_section(shape, fineness)
        self.radii = radial_planes(shape.dog, fineness)
        self.points = ring_points(shape, self.section, self.radii, fineness)
        self.cells = self._connect()
        self.mesh, self.element = hexahedra(self.points, self.cells)
        self.stiffness = assemble(self.mesh, self.element, self.cells, len(self.points))
        if hub:
            self.stiffness = self.stiffness + self._hub()
        self.reduction = self._reduction(cut)
        matrix = self.reduction.T @ self.stiffness @ self.reduction
        symmetric = {"SymmetricMode": True}
        self.factor = splu(matrix.tocsc(), "MMD_AT_PLUS_A", 0.0, options=symmetric)

    def _connect(self) -> NDArray[np.int64]:
        """Return the nodes (cells, 3, 3, 3) of each cell: along, away from the surface, radius."""
        plane, layers = self.section.cells, (len(self.radii) - 1) // 2
        steps = self.section.nodes * np.arange(3)
        stack = [plane[..., None] + 2 * k * self.section.nodes + steps for k in range(layers)]
        cells = np.concatenate(stack)
        corner = self.points[cells[:, 0, 0, 0]]
        edges = [self.points[cells[(slice(None), *e)]] - corner for e in np.eye(3, dtype=int) * 2]
        mirrored = np.linalg.det(np.stack(edges, axis=1)) < 0.0
        cells[mirrored] = cells[mirrored][:, ::-1]
        return np.asarray(cells)

    def _hub(self) -> Matrix:
        """Return stiff radial springs on the body's inner face, below the surface layer, N/m."""
        inner = self.points[: self.section.nodes]
        floor = -0.5 * self.shape.dog.height
        held = np.flatnonzero(inner[:, 2] < floor - 1.01 * self.shape.layer)
        radial = inner[held, :2] / np.hypot(*inner[held, :2].T)[:, None]
        spring = HUB_STIFFNESS * radial[:, :, None] * radial[:, None, :]
        unknown = 3 * held[:, None] + np.arange(2)
        rows, columns = np.repeat(unknown, 2, axis=1), np.tile(unknown, (1, 2))
        size = 3 * len(self.points)
        return sp.csr_matrix((spring.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))

    def _reduction(self, cut: Cut) -> Matrix:
        """Build the matrix from free unknowns to all; the free unknowns keep their order."""
        section, nodes = self.section, self.section.nodes
        fixed, turned = np.zeros(nodes, dtype=bool), np.zeros(nodes, dtype=bool)
        fixed[section.bottom] = True
        if cut == "fixed":
            fixed[section.left] = fixed[section.right] = True
        if cut == "periodic":
            turned[section.left] = True
        leader = np.arange(nodes)
        leader[section.left] = section.right
        turns = np.broadcast_to(np.eye(3), (nodes, 3, 3)).copy()
        turns[turned] = rotation(-self.shape.dog.pitch_angle)
        follows = np.where(turned, leader, np.arange(nodes))
        there = np.flatnonzero(~fixed)
        rows, columns = (
            3 * node[there, None] + np.arange(3) for node in (np.arange(nodes), follows)
        )
        plane = sp.csr_matrix(
            (
                turns[there].ravel(),
                (np.repeat(rows, 3, axis=1).ravel(), np.tile(columns, (1, 3)).ravel()),
            ),
            shape=(3 * nodes, 3 * nodes),
        )[:, np.repeat(~(fixed | turned), 3)]
        return sp.block_diag([plane] * len(self.radii), format="csr")

    def _surface(self, plane_cells: NDArray[np.int64], along: int, radial: int) -> _Surface:
        """Evaluate Gauss points on the surface of cells of the section."""
        every, layers = len(self.section.cells), (len(self.radii) - 1) // 2
        cells = np.concatenate([plane_cells + k * every for k in range(layers)])
        (x, wx), (y, wy) = _gauss(along), _gauss(radial)
        grid = [g.ravel() for g in np.meshgrid(x, [0.0], y, indexing="ij")]
        rule = np.stack(grid), np.outer(wx, wy).ravel()
        basis = _skfem().CellBasis(self.mesh, self.element, elements=cells, quadrature=rule)
        inverse = np.moveaxis(basis.mapping.invDF(rule[0], tind=cells), (0, 1), (2, 3))
        # n dA = -det(J) J^-T e for the face that the second local axis e leaves.
        area = -basis.dx[..., None] * inverse[..., 1, :]
        return _Surface(
            _by_local(self.cells)[cells],
            np.moveaxis(np.asarray(basis.global_coordinates()), 0, 2),
            area,
            np.stack([np.asarray(shape[0]) for shape in basis.basis]),
            np.stack([shape[0].grad for shape in basis.basis]),
        )

    def load(self, flank: Flank, band: Band) -> Points:
        """Return the nodal forces (nodes, 3) of a pressure of 1 Pa on a band, N."""
        skin = self._surface(self.section.flank[flank], 24, 3)
        x, y, z = np.moveaxis(skin.places, 2, 0)
        low, high = self._band(flank, band, np.hypot(x, y))
        pressed = skin.area * ((z >= low) & (z <= high))[..., None]
        force = np.zeros((len(self.points), 3))
        for local, value in enumerate(skin.value):
            np.add.at(force, skin.nodes[:, local], -np.einsum("cq,cqi->ci", value, pressed))
        return force

    def _band(self, flank: Flank, band: Band, radius: Points) -> tuple[Points, Points]:
        dog = self.shape.dog
        ends = [dog.inner_radius, dog.outer_radius]
        tops = np.interp(radius, ends, [self.shape.top(flank, r) for r in ends])
        half = 0.5 * dog.height
        if band == "tip":
            return tops - TIP_PART * (tops + half), tops
        reach = np.minimum(tops, half - self.shape.fillet_height(flank))
        return -reach, reach

    def solve(self, force: Points) -> Points:
        """Return the displacements (nodes, 3), m."""
        free = self.factor.solve(self.reduction.T @ force.reshape(-1))
        return np.asarray(self.reduction @ free).reshape(-1, 3)

    def surface_stress(
        self, displacement: Points, plane_cells: NDArray[np.int64]
    ) -> tuple[Points, Points]:
        """Return places (n, 3) and stresses (n, 3, 3) on a part of the surface, m and Pa.

        ``plane_cells`` are those of a fillet or a flank of the section.
        """
        skin = self._surface(plane_cells, 2, 2)
        gradient = np.einsum("cni,njcq->cqij", displacement[skin.nodes], skin.slope, optimize=True)
        normal = skin.area / np.linalg.norm(skin.area, axis=2, keepdims=True)
        stress = skin_stress(gradient, normal)
        return skin.places.reshape(-1, 3), stress.reshape(-1, 3, 3)

    def stress(self, flank: Flank, band: Band, force: float) -> RootStress:
        """Return the stress under a tangential ``force`` in N on a band of a flank."""
        load = self.load(flank, band)
        angle = np.arctan2(self.points[:, 1], self.points[:, 0])
        tangential = -SIDES[flank] * (load[:, 1] * np.cos(angle) - load[:, 0] * np.sin(angle))
        total = float(tangential.sum())
        height = self.points[:, 2] + 0.5 * self.shape.dog.height
        displacement = self.solve(load * (force / total))
        places, stress = self.surface_stress(displacement, self.section.fillet[flank])
        first = np.linalg.eigvalsh(stress)[:, -1]
        peak = int(first.argmax())
        risen = (places[peak, 2] + 0.5 * self.shape.dog.height) / self.shape.root_radius
        return RootStress(
            tension=float(first[peak]),
            radius=float(np.hypot(*places[peak, :2])),
            angle=min(math.acos(min(max(1.0 - risen, -1.0), 1.0)), self.shape.sweep(flank)),
            force=force,
            lever=float(tangential @ height) / total,
            axial=-float(load[:, 2].sum()) * force / total,
        )


def _by_local(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return nodes (cells, 27) in scikit-fem's local order."""
    # Place of each local node on the lattice 0, 1, 2 of a cell.
    i, j, k = np.round(2.0 * _skfem().ElementHex2().doflocs).astype(np.int64).T
    return np.asarray(cells[:, i, j, k])


def hexahedra(points: Points, cells: NDArray[np.int64]) -> tuple[Any, Any]:
    """Return scikit-fem's mesh and element of cells (m, 3, 3, 3) of nodes ``points`` (n, 3)."""
    skfem = _skfem()
    local = _by_local(cells)
    vertices, t = np.unique(local[:, :8], return_inverse=True)
    straight = skfem.MeshHex(
        np.ascontiguousarray(points[vertices].T), np.ascontiguousarray(t.reshape(-1, 8).T)
    )
    curved = skfem.MeshHex2.from_mesh(straight)
    element = skfem.ElementHex2()
    places = np.empty((3, len(points)))
    places[:, skfem.Dofs(curved, element).element_dofs] = points[local].transpose(2, 1, 0)
    return skfem.MeshHex2(places, curved.t), element


def assemble(mesh: Any, element: Any, cells: NDArray[np.int64], nodes: int) -> Matrix:
    """Return the stiffness matrix, unknown ``3 node + direction``, N/m."""
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    lame = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    unknown = (3 * _by_local(cells)[:, :, None] + np.arange(3)).reshape(len(cells), 81)
    total = sp.csr_matrix((3 * nodes, 3 * nodes))
    for some in np.array_split(np.arange(len(cells)), max(1, len(cells) // 1000)):
        basis = _skfem().CellBasis(mesh, element, elements=some, intorder=5)
        slope = np.stack([shape[0].grad for shape in basis.basis])  # (27, 3, cells, points)
        flat = slope.transpose(2, 0, 1, 3).reshape(len(some), 81, -1)
        pair = (flat * basis.dx[:, None, :]) @ flat.transpose(0, 2, 1)
        pair = pair.reshape(-1, 27, 3, 27, 3)
        trace = np.einsum("eiaja->eij", pair)
        local = lame * pair + shear * pair.transpose(0, 1, 4, 3, 2)
        for a in range(3):
            local[:, :, a, :, a] += shear * trace
        rows = np.repeat(unknown[some], 81, axis=1).ravel()
        columns = np.tile(unknown[some], (1, 81)).ravel()
        total = total + sp.csr_matrix((local.ravel(), (rows, columns)), shape=total.shape)
    return total


def skin_stress(gradient: Points, normal: Points) -> Points:
    """Return stresses (..., 3, 3) in Pa on a free surface with unit ``normal`` (..., 3).

    What the surface's own stretch (of the displacement ``gradient`` (..., 3, 3)) makes in
    plane stress: no traction holds exactly, and gradients into the depth, which a mesh
    resolves last, do not enter.
    """
    flat = np.eye(3) - normal[..., :, None] * normal[..., None, :]
    strain = flat @ (0.5 * (gradient + np.swapaxes(gradient, -1, -2))) @ flat
    trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
    return np.asarray(YOUNG / (1.0 + POISSON) * (strain + POISSON / (1.0 - POISSON) * trace * flat))


def _gauss(count: int) -> tuple[Points, Points]:
    points, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (points + 1.0), 0.5 * weights


#: Words of what is pressed.
PRESSED: dict[Band | Literal["load"], str] = {
    "whole": "all that touches", "tip": "top fifth of the flank",
    "load": "at the load height, interpolated",
}  # fmt: skip


class RootCheck(Record):
    """Tension in the fillet of a loaded flank, by finite elements and by closed form."""

    flank: Flank = key("loaded flank")
    band: Band | Literal["load"] = key("pressed part; load: at the load height, between the others")
    lever_mm: float = key("height of the load's line above the floor", "mm")
    finite_elements_MPa: float = key("tension by finite elements", "MPa")
    closed_form_MPa: float = key("tension by closed form", "MPa")


def root_checks(dog: Dog, limits: Limits) -> list[RootCheck]:
    """Return both flanks under the design load, on all that touches and at the tip.

    Takes some ten seconds; raises InputError where scikit-fem is missing.
    """
    radius = limits.root_radius
    model = RootModel(RootShape(dog, radius, dog.pitch))
    rows = []
    for flank in FLANKS:
        force = limits.load.force_per_dog(dog, flank)
        found = [model.stress(flank, band, force) for band in BANDS]
        own = [Load(force, flank, one.lever) for one in found]
        loads = [*own, root_load(dog, limits, flank)]
        formulas = [root_tension(dog, radius, load) for load in loads]
        # The ratio to the closed form runs straight over the height of the load.
        ratios = [one.tension / formula for one, formula in zip(found, formulas, strict=False)]
        ratio = float(np.interp(loads[-1].lever, [load.lever for load in own], ratios))
        tensions = [*(one.tension for one in found), ratio * formulas[-1]]
        rows += [
            RootCheck(
                flank=flank, band=band, lever_mm=load.lever / MM,
                finite_elements_MPa=tension / MPA, closed_form_MPa=formula / MPA,
            )
            for band, load, tension, formula in zip(
                PRESSED, loads, tensions, formulas, strict=True
            )
        ]  # fmt: skip
    return rows


def root_table(checks: Sequence[RootCheck]) -> Table:
    """Tabulate the tension by finite elements beside the closed form."""
    heads = "tension at the root", "lever, mm", "finite elements, MPa", "closed form, MPa", "ratio"
    rows = [
        (
            f"{one.flank} flank, {PRESSED[one.band]}", f"{one.lever_mm:.2f}",
            f"{one.finite_elements_MPa:.0f}", f"{one.closed_form_MPa:.0f}",
            f"{one.closed_form_MPa / one.finite_elements_MPa:.2f}",
        )
        for one in checks
    ]  # fmt: skip
    return Table(heads, rows)
