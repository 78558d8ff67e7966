r"""Compliance of the face of one dog by finite elements, linear elastic, in plane strain.

The section of one pitch at the mean radius (``root_mesh``), in triangles with six nodes that are
refined towards the crest. The body's lower side is fixed and both cuts move alike, as in
``root_stress``. A uniform pressure acts on a strip of the face. The compliance conjugate to its
axial force *F* is work over square, :math:`c = \int p\,u_n/F^2`, here times length of the dog and
:math:`E/(1 - \nu^2)`: a number.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from dogshape.sim.strength.materials import POISSON
from dogshape.validation.finite_elements.root_mesh import (
    Points,
    RootShape,
    make_section,
    section_points,
)

FINENESS = 1  #: of the section before it is refined
SMALLEST_CELL = 4e-6  #: m, at the crest
CELL_GROWTH = 0.35  #: size of a cell over its distance from the crest
FACE_TOLERANCE = 1e-9  #: m, of a side's distance from the face
CUT_TOLERANCE = 2e-9  #: m, of a node's distance from a cut
#: Constants of Lame over E/(1 - nu2).
LAME = POISSON * (1.0 - POISSON) / (1.0 - 2.0 * POISSON), 0.5 * (1.0 - POISSON)


def refined(mesh: Any, centres: Points, floor: float) -> Any:
    """Refine a mesh of triangles above the height ``floor`` towards points (n, 2), m."""
    while True:
        corners = mesh.p[:, mesh.t]
        sides = corners - np.roll(corners, 1, axis=1)
        sizes = np.hypot(*sides).max(axis=0)
        distances = np.min(
            [np.hypot(*(corners - centre[:, None, None])).min(axis=0) for centre in centres], axis=0
        )
        coarse = sizes > np.maximum(SMALLEST_CELL, CELL_GROWTH * (distances + sizes))
        coarse &= corners[1].min(axis=0) > floor
        if not coarse.any():
            return mesh
        mesh = mesh.refined(np.flatnonzero(coarse))


class FaceModel:
    """Assembled section of one pitch for strips of pressure on the face.

    ``edge_radius`` rounds the crest of a dog with a ridge on its traction edge, m.
    """

    def __init__(self, shape: RootShape, edge_radius: float = 0.0) -> None:
        self.shape = shape
        skfem = import_module("skfem")
        section = make_section(shape, FINENESS)
        points = section_points(shape, section, shape.dog.mean_radius, FINENESS)
        quads = np.concatenate(
            [section.cells[:, i : i + 2, j : j + 2].reshape(-1, 4) for i in (0, 1) for j in (0, 1)]
        )
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [1, 3, 2]]])
        self.crest = points[section.tip[-1]]
        run = points[section.tip[0]] - self.crest
        self.face_width = float(abs(run[0]))
        self.along = run / np.hypot(*run)
        cut = edge_radius * shape.dog.crest_cut
        centres = self.crest + np.linspace(0.0, cut, 5)[:, None] * self.along
        mesh = skfem.MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))
        mesh = refined(mesh, centres, -0.5 * shape.dog.height)
        self.sides = self._face_sides(mesh)
        self.distance = np.abs(mesh.p[0] - self.crest[0])  # from the sharp crest
        if edge_radius > 0.0:
            mesh = self._round(mesh, edge_radius)
        self.mesh = mesh
        self.basis = skfem.Basis(self.mesh, skfem.ElementVector(skfem.ElementTriP2()))
        elasticity = import_module("skfem.models.elasticity").linear_elasticity
        self.stiffness = elasticity(*LAME).assemble(self.basis)
        self.reduction = self._reduction(points[section.left[0], 0], points[section.right[0], 0])
        matrix = self.reduction.T @ self.stiffness @ self.reduction
        self.factor = splu(matrix.tocsc(), "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})

    def _face_sides(self, mesh: Any) -> Any:
        """List the sides of cells on the face."""
        sides = mesh.boundary_facets()
        ends = mesh.p[:, mesh.facets[:, sides]] - self.crest[:, None, None]
        offset = self.along[0] * ends[1] - self.along[1] * ends[0]
        return sides[np.abs(offset).max(axis=0) < FACE_TOLERANCE]

    def _round(self, mesh: Any, radius: float) -> Any:
        """Move the boundary beside the crest onto a rounding; inner nodes follow smoothly."""
        skfem = import_module("skfem")
        laplace = import_module("skfem.models.poisson").laplace
        lean = self.shape.dog.traction
        down = np.array([math.sin(lean), -math.cos(lean)])  # along the flank from the crest
        half_angle = math.atan(1.0 / self.shape.dog.crest_cut)
        cut = radius / math.tan(half_angle)
        inward = self.along + down
        inward /= np.hypot(*inward)
        centre = self.crest + radius / math.sin(half_angle) * inward
        boundary = mesh.boundary_nodes()
        target = mesh.p.copy()
        for direction in (self.along, down):
            relative = mesh.p[:, boundary] - self.crest[:, None]
            run = direction @ relative
            offset = np.abs(direction[0] * relative[1] - direction[1] * relative[0])
            nodes = boundary[(offset < FACE_TOLERANCE) & (run < cut)]
            share = 1.0 - direction @ (mesh.p[:, nodes] - self.crest[:, None]) / cut
            angle = share * (0.5 * math.pi - half_angle)
            tangent = self.crest + cut * direction - centre
            tangent /= np.hypot(*tangent)
            target[:, nodes] = centre[:, None] + radius * (
                np.cos(angle) * tangent[:, None] - np.sin(angle) * direction[:, None]
            )
        basis = skfem.Basis(mesh, skfem.ElementTriP1())
        matrix = laplace.assemble(basis)
        moved = mesh.p.copy()
        for component in (0, 1):
            moved[component] += skfem.solve(
                *skfem.condense(matrix, x=(target - mesh.p)[component], D=boundary)
            )
        return skfem.MeshTri(moved, mesh.t)

    def _reduction(self, left: float, right: float) -> Any:
        """Build the matrix from free unknowns to all."""
        x, y = self.basis.doflocs
        bottom = -0.5 * self.shape.dog.height - self.shape.depth
        moving = np.flatnonzero(y > bottom + CUT_TOLERANCE)
        leader = np.arange(len(x))
        leader[self._cut(left)] = self._cut(right)
        ones = np.ones(len(moving))
        shape = (len(x), len(x))
        matrix = sp.csr_matrix((ones, (moving, leader[moving])), shape=shape)
        return matrix[:, np.unique(leader[moving])]

    def _cut(self, place: float) -> NDArray[np.int64]:
        """List the unknowns of a cut by height and direction."""
        x, y = self.basis.doflocs
        unknowns = np.flatnonzero(np.abs(x - place) < CUT_TOLERANCE)
        order = np.lexsort((unknowns, np.round(y[unknowns] / CUT_TOLERANCE)))
        return np.asarray(unknowns[order])

    def load(self, start: float, end: float) -> Points:
        """Compute the forces of a pressure of 1 on the face, per length of the dog, (unknowns,).

        The strip is ``start`` to ``end`` from the sharp crest along the circumference, m.
        """
        first, second = self.mesh.facets[:, self.sides]
        ends = np.array([[start], [end]])
        shares = (ends - self.distance[first]) / (self.distance[second] - self.distance[first])
        low, high = np.sort(shares, axis=0).clip(0.0, 1.0)
        side = self.mesh.p[:, second] - self.mesh.p[:, first]
        normal = np.array([side[1], -side[0]])
        normal = np.where(normal[1] > 0.0, -normal, normal)  # into the dog, as long as the side
        force = np.zeros(self.stiffness.shape[0])
        middle = self.basis.facet_dofs[:, self.sides]
        points, weights = np.polynomial.legendre.leggauss(3)
        for point, weight in zip(points.tolist(), weights.tolist(), strict=True):
            t = low + 0.5 * (1.0 + point) * (high - low)
            pressure = 0.5 * weight * (high - low) * normal
            np.add.at(
                force, self.basis.nodal_dofs[:, first], pressure * (1.0 - t) * (1.0 - 2.0 * t)
            )
            np.add.at(force, self.basis.nodal_dofs[:, second], pressure * t * (2.0 * t - 1.0))
            np.add.at(force, middle, pressure * 4.0 * t * (1.0 - t))
        return force

    def compliance(self, start: float, end: float) -> float:
        """Compute the compliance under a strip of the face, a number."""
        force = self.load(start, end)
        reduced = self.reduction.T @ force
        work = float(reduced @ self.factor.solve(reduced))
        axial = force[self.basis.nodal_dofs[1]].sum() + force[self.basis.facet_dofs[1]].sum()
        return work / float(axial) ** 2
