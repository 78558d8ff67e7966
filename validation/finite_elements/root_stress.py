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
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from dogshape.pipeline.record import Record, Table
from dogshape.sim.clutch_tables import key
from dogshape.sim.errors import InputError
from dogshape.sim.shift.geometry import FLANKS, Dog, Flank
from dogshape.sim.shift.mesh import rotation
from dogshape.sim.strength.dog_stiffness import FlankLoad
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
CHUNK_CELLS = 1000  #: that are assembled at a time


@dataclass(frozen=True)
class RootStress:
    """Largest first principal stress in the fillet of the loaded flank, and its load."""

    tension: float  #: Pa
    radius: float  #: of its place, m
    angle: float  #: of its place along the fillet from the floor, rad
    force: float  #: tangential, N
    lever: float  #: height of the force's line above the floor, m
    axial: float  #: force of the flank towards the body, N


class FlankCompliance(NamedTuple):
    """Work-conjugate displacement over the tangential force on a flank, and its load."""

    compliance: float  #: m/N
    load: FlankLoad


def fem_available() -> bool:
    """Test whether scikit-fem can be imported."""
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
    """Gauss points on the surface of cells."""

    nodes: NDArray[np.int64]  # of the cells, (c, 27)
    position: Points  # m, (c, q, 3)
    area: Points  # outward normal times area, m2, (c, q, 3)
    value: Points  # of the shape functions, (27, 1 or c, q)
    slope: Points  # of the shape functions, 1/m, (27, 3, c, q)


class RootModel:
    """Assembled model of one pitch of a ring for any number of loads.

    ``fineness`` multiplies the coarsest mesh's cells each way; ``cut`` is the condition in the
    middle of slots; a ``hub`` holds the body radially.
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
        options = {"SymmetricMode": True}
        self.factor = splu(matrix.tocsc(), "MMD_AT_PLUS_A", 0.0, options=options)

    @property
    def _layers(self) -> int:
        """Number of cells along the radius."""
        return (len(self.radii) - 1) // 2

    def _connect(self) -> NDArray[np.int64]:
        """List the nodes of each cell: along, away from the surface, radius, (cells, 3, 3, 3)."""
        plane = self.section.cells
        plane_size = self.section.nodes
        steps = plane_size * np.arange(3)
        layers = [plane[..., None] + 2 * k * plane_size + steps for k in range(self._layers)]
        cells = np.concatenate(layers)
        corner = self.points[cells[:, 0, 0, 0]]
        edges = [
            self.points[cells[:, 2, 0, 0]] - corner,
            self.points[cells[:, 0, 2, 0]] - corner,
            self.points[cells[:, 0, 0, 2]] - corner,
        ]
        mirrored = np.linalg.det(np.stack(edges, axis=1)) < 0.0
        cells[mirrored] = cells[mirrored][:, ::-1]
        return np.asarray(cells)

    def _hub(self) -> Matrix:
        """Build stiff radial springs on the body's inner face, below the surface layer, N/m."""
        inner = self.points[: self.section.nodes]
        floor = -0.5 * self.shape.dog.height
        nodes = np.flatnonzero(inner[:, 2] < floor - 1.01 * self.shape.layer)
        radial = inner[nodes, :2] / np.hypot(*inner[nodes, :2].T)[:, None]
        spring = HUB_STIFFNESS * radial[:, :, None] * radial[:, None, :]
        unknowns = 3 * nodes[:, None] + np.arange(2)
        rows = np.repeat(unknowns, 2, axis=1).ravel()
        columns = np.tile(unknowns, (1, 2)).ravel()
        size = 3 * len(self.points)
        return sp.csr_matrix((spring.ravel(), (rows, columns)), shape=(size, size))

    def _reduction(self, cut: Cut) -> Matrix:
        """Build the matrix from free unknowns to all; the free unknowns keep their order."""
        section = self.section
        nodes = section.nodes
        fixed = np.zeros(nodes, dtype=bool)
        fixed[section.bottom] = True
        periodic = np.zeros(nodes, dtype=bool)
        if cut == "fixed":
            fixed[section.left] = True
            fixed[section.right] = True
        if cut == "periodic":
            periodic[section.left] = True
        opposite = np.arange(nodes)
        opposite[section.left] = section.right
        rotations = np.broadcast_to(np.eye(3), (nodes, 3, 3)).copy()
        rotations[periodic] = rotation(-self.shape.dog.pitch_angle)
        leader = np.where(periodic, opposite, np.arange(nodes))
        moving = np.flatnonzero(~fixed)
        rows = 3 * moving[:, None] + np.arange(3)
        columns = 3 * leader[moving, None] + np.arange(3)
        indices = np.repeat(rows, 3, axis=1).ravel(), np.tile(columns, (1, 3)).ravel()
        plane = sp.csr_matrix((rotations[moving].ravel(), indices), shape=(3 * nodes, 3 * nodes))
        free = np.repeat(~(fixed | periodic), 3)
        return sp.block_diag([plane[:, free]] * len(self.radii), format="csr")

    def _surface(self, plane_cells: NDArray[np.int64], along: int, radial: int) -> _Surface:
        """Evaluate the Gauss points on the surface of cells of the section.

        ``along`` and ``radial`` are numbers of points along the surface and the radius.
        """
        plane_size = len(self.section.cells)
        cells = np.concatenate([plane_cells + k * plane_size for k in range(self._layers)])
        x, x_weights = _gauss(along)
        y, y_weights = _gauss(radial)
        grid = [g.ravel() for g in np.meshgrid(x, [0.0], y, indexing="ij")]
        rule = np.stack(grid), np.outer(x_weights, y_weights).ravel()
        basis = _skfem().CellBasis(self.mesh, self.element, elements=cells, quadrature=rule)
        inverse = np.moveaxis(basis.mapping.invDF(rule[0], tind=cells), (0, 1), (2, 3))
        return _Surface(
            nodes=_by_local(self.cells)[cells],
            position=np.moveaxis(np.asarray(basis.global_coordinates()), 0, 2),
            # n dA = -det(J) J^-T e for the face that the second local axis e leaves.
            area=-basis.dx[..., None] * inverse[..., 1, :],
            value=np.stack([np.asarray(shape[0]) for shape in basis.basis]),
            slope=np.stack([shape[0].grad for shape in basis.basis]),
        )

    def load(self, flank: Flank, band: Band) -> Points:
        """Compute the nodal forces of a pressure of 1 Pa on a band of a flank, N, (nodes, 3)."""
        surface = self._surface(self.section.flank[flank], 24, 3)
        x, y, z = np.moveaxis(surface.position, 2, 0)
        low, high = self._band(flank, band, np.hypot(x, y))
        area = surface.area * ((z >= low) & (z <= high))[..., None]
        force = np.zeros((len(self.points), 3))
        for local, value in enumerate(surface.value):
            np.add.at(force, surface.nodes[:, local], -np.einsum("cq,cqi->ci", value, area))
        return force

    def _band(self, flank: Flank, band: Band, radius: Points) -> tuple[Points, Points]:
        """Compute the lower and upper end of a band at radii, m, same shape."""
        dog = self.shape.dog
        ends = [dog.inner_radius, dog.outer_radius]
        tops = np.interp(radius, ends, [self.shape.top(flank, r) for r in ends])
        half_height = 0.5 * dog.height
        if band == "tip":
            return tops - TIP_PART * (tops + half_height), tops
        reach = np.minimum(tops, half_height - self.shape.fillet_height(flank))
        return -reach, reach

    def flank_compliance(self, flank: Flank, band: Band) -> FlankCompliance:
        """Compute the compliance of dog and ring sector under a pressure on a band of a flank."""
        load = self.load(flank, band)
        tangential = self._tangential(load, flank)
        total = float(tangential.sum())
        work = float((load * self.solve(load)).sum())
        dog = self.shape.dog
        top = self.shape.top(flank, dog.mean_radius) + 0.5 * dog.height
        if band == "whole":  # evenly about the median plane
            top = min(top, dog.height - self.shape.fillet_height(flank))
        level = float(tangential @ self._heights) / total
        return FlankCompliance(work / total**2, FlankLoad(level, top))

    def face_compliance(self, overlap: float | None = None) -> float:
        """Compute the compliance of dog and ring sector under a pressure on the face, m/N.

        ``overlap`` is the width of the pressed strip from the crest, m; None: the whole face.
        """
        load = self.face_load(overlap)
        return float((load * self.solve(load)).sum()) / float(load[:, 2].sum()) ** 2

    def face_load(self, overlap: float | None) -> Points:
        """Compute the nodal forces of a pressure of 1 Pa on a strip of the face, N, (nodes, 3)."""
        numbers = self.section.tip[:, None] + self.section.nodes * np.arange(len(self.radii))
        points, weights = _gauss(12)
        value = _quadratic(points)
        slope = _quadratic(points, derivative=True)
        crest = self.points[numbers[-1]]
        crest_radii = np.hypot(crest[:, 0], crest[:, 1])
        crest_angles = np.arctan2(crest[:, 1], crest[:, 0])
        force = np.zeros((len(self.points), 3))
        for along in range(0, numbers.shape[0] - 2, 2):
            for across in range(0, numbers.shape[1] - 2, 2):
                patch = numbers[along : along + 3, across : across + 3]
                nodes = self.points[patch]
                position = np.einsum("ap,bq,abk->pqk", value, value, nodes)
                first = np.einsum("ap,bq,abk->pqk", slope, value, nodes)
                second = np.einsum("ap,bq,abk->pqk", value, slope, nodes)
                area = np.cross(first, second) * np.outer(weights, weights)[..., None]
                area *= -np.sign(area[..., 2:])
                if overlap is not None:
                    radius = np.hypot(position[..., 0], position[..., 1])
                    angle = np.arctan2(position[..., 1], position[..., 0])
                    width = (np.interp(radius, crest_radii, crest_angles) - angle) * radius
                    area *= (width <= overlap)[..., None]
                np.add.at(force, patch, np.einsum("ap,bq,pqk->abk", value, value, area))
        return force

    @property
    def _heights(self) -> Points:
        """Heights of the nodes above the floor, m, (nodes,)."""
        return self.points[:, 2] + 0.5 * self.shape.dog.height

    def _tangential(self, load: Points, flank: Flank) -> Points:
        """Compute the tangential part of nodal forces (nodes, 3) on a flank, N, (nodes,)."""
        angle = np.arctan2(self.points[:, 1], self.points[:, 0])
        return -SIDES[flank] * (load[:, 1] * np.cos(angle) - load[:, 0] * np.sin(angle))

    def solve(self, force: Points) -> Points:
        """Compute the displacements under nodal forces (nodes, 3), N, m, (nodes, 3)."""
        free = self.factor.solve(self.reduction.T @ force.reshape(-1))
        return np.asarray(self.reduction @ free).reshape(-1, 3)

    def surface_stress(
        self, displacement: Points, plane_cells: NDArray[np.int64]
    ) -> tuple[Points, Points]:
        """Compute positions, m, (n, 3), and stresses, Pa, (n, 3, 3), on a part of the surface.

        ``plane_cells`` are those of a fillet or a flank of the section.
        """
        surface = self._surface(plane_cells, 2, 2)
        nodal = displacement[surface.nodes]
        gradient = np.einsum("cni,njcq->cqij", nodal, surface.slope, optimize=True)
        normal = surface.area / np.linalg.norm(surface.area, axis=2, keepdims=True)
        stress = skin_stress(gradient, normal)
        return surface.position.reshape(-1, 3), stress.reshape(-1, 3, 3)

    def stress(self, flank: Flank, band: Band, force: float) -> RootStress:
        """Compute the stress under a tangential ``force`` in N on a band of a flank."""
        load = self.load(flank, band)
        tangential = self._tangential(load, flank)
        total = float(tangential.sum())
        displacement = self.solve(load * (force / total))
        positions, stress = self.surface_stress(displacement, self.section.fillet[flank])
        principal = np.linalg.eigvalsh(stress)[:, -1]
        peak = int(principal.argmax())
        peak_height = positions[peak, 2] + 0.5 * self.shape.dog.height
        cosine = min(max(1.0 - peak_height / self.shape.root_radius, -1.0), 1.0)
        return RootStress(
            tension=float(principal[peak]),
            radius=float(np.hypot(*positions[peak, :2])),
            angle=min(math.acos(cosine), self.shape.sweep(flank)),
            force=force,
            lever=float(tangential @ self._heights) / total,
            axial=-float(load[:, 2].sum()) * force / total,
        )


def _by_local(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order the nodes of cells (cells, 3, 3, 3) as scikit-fem does, (cells, 27)."""
    # Position of each local node on the lattice 0, 1, 2 of a cell.
    i, j, k = np.round(2.0 * _skfem().ElementHex2().doflocs).astype(np.int64).T
    return np.asarray(cells[:, i, j, k])


def hexahedra(points: Points, cells: NDArray[np.int64]) -> tuple[Any, Any]:
    """Build scikit-fem's mesh and element of cells (m, 3, 3, 3) of nodes ``points`` (n, 3)."""
    skfem = _skfem()
    local = _by_local(cells)
    vertices, t = np.unique(local[:, :8], return_inverse=True)
    straight = skfem.MeshHex(
        np.ascontiguousarray(points[vertices].T), np.ascontiguousarray(t.reshape(-1, 8).T)
    )
    curved = skfem.MeshHex2.from_mesh(straight)
    element = skfem.ElementHex2()
    positions = np.empty((3, len(points)))
    positions[:, skfem.Dofs(curved, element).element_dofs] = points[local].transpose(2, 1, 0)
    return skfem.MeshHex2(positions, curved.t), element


def assemble(mesh: Any, element: Any, cells: NDArray[np.int64], nodes: int) -> Matrix:
    """Assemble the stiffness matrix of unknowns ``3 node + direction``, N/m."""
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    lame = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    unknowns = (3 * _by_local(cells)[:, :, None] + np.arange(3)).reshape(len(cells), 81)
    total = sp.csr_matrix((3 * nodes, 3 * nodes))
    chunks = np.array_split(np.arange(len(cells)), max(1, len(cells) // CHUNK_CELLS))
    for chunk in chunks:
        basis = _skfem().CellBasis(mesh, element, elements=chunk, intorder=5)
        slope = np.stack([shape[0].grad for shape in basis.basis])  # (27, 3, cells, points)
        flat = slope.transpose(2, 0, 1, 3).reshape(len(chunk), 81, -1)
        pair = (flat * basis.dx[:, None, :]) @ flat.transpose(0, 2, 1)
        pair = pair.reshape(-1, 27, 3, 27, 3)
        trace = np.einsum("eiaja->eij", pair)
        local = lame * pair + shear * pair.transpose(0, 1, 4, 3, 2)
        for a in range(3):
            local[:, :, a, :, a] += shear * trace
        rows = np.repeat(unknowns[chunk], 81, axis=1).ravel()
        columns = np.tile(unknowns[chunk], (1, 81)).ravel()
        total = total + sp.csr_matrix((local.ravel(), (rows, columns)), shape=total.shape)
    return total


def skin_stress(gradient: Points, normal: Points) -> Points:
    """Compute stresses on a free surface with unit ``normal`` (..., 3), Pa, (..., 3, 3).

    They are the plane stress of the surface's stretch, from the displacement ``gradient``
    (..., 3, 3): the surface is exactly free of traction, and gradients into the depth, which a
    mesh resolves last, do not enter.
    """
    plane = np.eye(3) - normal[..., :, None] * normal[..., None, :]
    strain = plane @ (0.5 * (gradient + np.swapaxes(gradient, -1, -2))) @ plane
    trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
    volumetric = POISSON / (1.0 - POISSON) * trace * plane
    return np.asarray(YOUNG / (1.0 + POISSON) * (strain + volumetric))


def _gauss(count: int) -> tuple[Points, Points]:
    """Return Gauss-Legendre points and weights on [0, 1], (count,) each."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (points + 1.0), 0.5 * weights


def _quadratic(points: Points, derivative: bool = False) -> Points:
    """Evaluate the shape functions of a side with three nodes on [0, 1], (3, points)."""
    rows = np.array([[2.0, -3.0, 1.0], [-4.0, 4.0, 0.0], [2.0, -1.0, 0.0]])
    return np.array([np.polyval(np.polyder(row) if derivative else row, points) for row in rows])


#: Words of a loaded band.
BAND_WORDS: dict[Band | Literal["load"], str] = {
    "whole": "all that touches",
    "tip": "top fifth of the flank",
    "load": "at the load height, interpolated",
}


class RootCheck(Record):
    """Tension in the fillet of a loaded flank, by finite elements and by closed form."""

    flank: Flank = key("loaded flank")
    band: Band | Literal["load"] = key("pressed part; load: at the load height, between the others")
    lever_mm: float = key("height of the load's line above the floor", "mm")
    finite_elements_MPa: float = key("tension by finite elements", "MPa")
    closed_form_MPa: float = key("tension by closed form", "MPa")


def root_checks(dog: Dog, limits: Limits) -> list[RootCheck]:
    """Check both flanks under the design load, on all that touches and at the tip.

    Takes some ten seconds; InputError where scikit-fem is missing.
    """
    radius = limits.root_radius
    model = RootModel(RootShape(dog, radius, dog.pitch))
    checks = []
    for flank in FLANKS:
        force = limits.load.force_per_dog(dog, flank)
        levers = []
        ratios = []
        for band in BANDS:
            result = model.stress(flank, band, force)
            formula = root_tension(dog, radius, Load(force, flank, result.lever))
            checks.append(_root_check(flank, band, result.lever, result.tension, formula))
            levers.append(result.lever)
            ratios.append(result.tension / formula)
        load = root_load(dog, limits, flank)
        formula = root_tension(dog, radius, load)
        # The ratio to the closed form is linear in the height of the load.
        ratio = float(np.interp(load.lever, levers, ratios))
        checks.append(_root_check(flank, "load", load.lever, ratio * formula, formula))
    return checks


def _root_check(
    flank: Flank, band: Band | Literal["load"], lever: float, tension: float, formula: float
) -> RootCheck:
    return RootCheck(
        flank=flank,
        band=band,
        lever_mm=lever / MM,
        finite_elements_MPa=tension / MPA,
        closed_form_MPa=formula / MPA,
    )


def root_table(checks: Sequence[RootCheck]) -> Table:
    """Tabulate the tension by finite elements beside the closed form."""
    heads = "tension at the root", "lever, mm", "finite elements, MPa", "closed form, MPa", "ratio"
    rows = []
    for check in checks:
        ratio = check.closed_form_MPa / check.finite_elements_MPa
        row = (
            f"{check.flank} flank, {BAND_WORDS[check.band]}",
            f"{check.lever_mm:.2f}",
            f"{check.finite_elements_MPa:.0f}",
            f"{check.closed_form_MPa:.0f}",
            f"{ratio:.2f}",
        )
        rows.append(row)
    return Table(heads, rows)
