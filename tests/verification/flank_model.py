r"""Line of pressure of two flanks with an angle error, and deflection of the dogs.

Plane finite elements of one dog on its body, one pitch wide, in plane strain, unrolled at the mean
radius: biquadratic, root and tip sharp, the lower face fixed, the sides moving alike. The traction
flank is cut into strips; a uniform pressure on one moves all by their mean: the flexibility
:math:`G`, and that of the mate turned over, :math:`G'`. At an angle :math:`\delta`, :math:`s` from
the end that touches first, forces :math:`f` and approach :math:`a` obey, without friction,
:math:`w = \delta s + g + (G + G') f - a \ge 0, f \ge 0, f^T w = 0, \sum f = F/\cos\beta`, found by
an active set. What touches ends where the roundings begin ("cut"), or with their true gap :math:`g
= \varrho - \sqrt{\varrho^2 - d^2}`, :math:`d` beyond that end ("rounded").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from skfem import Basis, ElementQuad2, ElementVector, MeshQuad
from skfem.models.elasticity import lame_parameters, linear_elasticity

from dogshape.sim.shift.geometry import Dog, FlankContact, flank_contact, section
from dogshape.sim.strength.materials import POISSON, YOUNG
from dogshape.sim.units import MM

Array = NDArray[np.float64]
Ends = Literal["cut", "rounded"]

ROOT_RADIUS = 0.3 * MM
STRIPS = 48  #: over what touches
DEPTH = 0.6  #: of the body below the floor, pitches
NODE_DECIMALS = 7  #: decimals of coordinates in mm, so that dog and body share their nodes


@dataclass(frozen=True)
class Contact:
    """Contact of two flanks."""

    height: float  #: of the resultant over the contact, on the ring loaded nearer its tip
    approach: float  #: of the rings along the circumference, m
    force: Array  #: normal forces of the strips, N/m


@dataclass(frozen=True)
class FlankModel:
    """One dog on its body (``depth`` in pitches), with the flexibility of its traction flank."""

    dog: Dog
    root_radius: float = ROOT_RADIUS
    strips: int = STRIPS
    depth: float = DEPTH

    @cached_property
    def contact(self) -> FlankContact:
        """Contact of the flanks at full depth."""
        return flank_contact(self.dog, self.root_radius, "traction")

    @cached_property
    def levels(self) -> Array:
        """Ends of the strips above the floor, m, symmetric in height."""
        band = self.contact
        span = math.acos(max(-1.0, 1.0 - 2.0 * band.low / band.height))
        angles = np.linspace(span, 0.0, math.ceil(self.strips * span / math.pi) + 1)[:-1]
        lower_levels = band.low * (1.0 - (1.0 - np.cos(angles)) / (1.0 - math.cos(span)))
        contact_levels = band.low + band.height * _dense_ends(self.strips)
        return np.concatenate([lower_levels, contact_levels, self.dog.height - lower_levels[::-1]])

    @property
    def middles(self) -> Array:
        """Middles of the strips above the floor, m."""
        return 0.5 * (self.levels[1:] + self.levels[:-1])

    @cached_property
    def corners(self) -> Array:
        """Braking root and edge, crest and traction root from the floor up, (4, 2) in mm."""
        rise = np.array([0.0, 0.5 * self.dog.height])
        return np.asarray((np.array(section(self.dog)) + rise) / MM)

    @cached_property
    def mesh(self) -> Any:
        """The dog on its body, mm."""
        shares = _dense_ends(self.strips)
        left = self.corners[0, 0]
        right = self.corners[3, 0]
        slot = 0.5 * self.dog.tip_width / MM * _dense_start(max(4, self.strips // 4))
        root = left + (right - left) * shares
        body_x = np.concatenate([left - slot[:0:-1], root, right + slot[1:]])
        body_z = self.depth * self.dog.pitch / MM * _dense_start(self.strips)
        body = MeshQuad.init_tensor(np.round(body_x, NODE_DECIMALS), -body_z[::-1])
        dog = MeshQuad.init_tensor(shares, self.levels / self.dog.height)
        return body + MeshQuad(np.round(_between(self.corners, *dog.p), NODE_DECIMALS), dog.t)

    @cached_property
    def basis(self) -> Any:
        """Biquadratic displacements."""
        return Basis(self.mesh, ElementVector(ElementQuad2()))

    @cached_property
    def strip_edges(self) -> Any:
        """Edges of elements that are the strips, from the root up."""
        slope = math.tan(self.dog.traction)
        edge = self.corners[3, 0]
        edges = self.mesh.facets_satisfying(
            lambda p: (np.abs(p[0] - edge + p[1] * slope) < 1e-5) & (p[1] > 0.0),
            boundaries_only=True,
        )
        if len(edges) != len(self.middles):
            raise ValueError("every strip must be one edge of an element")
        return edges[np.argsort(self.mesh.p[1][self.mesh.facets[:, edges]].mean(axis=0))]

    @cached_property
    def loads(self) -> Array:
        """Loads of one newton per millimetre of width on each strip, (unknowns, strips)."""
        edges = self.strip_edges
        lean = self.dog.traction
        ends = self.basis.nodal_dofs[:, self.mesh.facets[:, edges]]  # (2, 2, strips)
        middle = self.basis.facet_dofs[:, None, edges]
        loads = np.zeros((self.basis.N, len(edges)))
        for share, unknowns in ((1.0 / 6.0, ends), (2.0 / 3.0, middle)):
            loads[unknowns[0], np.arange(len(edges))] = -share * math.cos(lean)
            loads[unknowns[1], np.arange(len(edges))] = -share * math.sin(lean)
        return loads

    @cached_property
    def reduction(self) -> Any:
        """Matrix from free unknowns to all, (unknowns, free)."""
        positions = self.basis.doflocs
        count = self.basis.N
        fixed = positions[1] < positions[1].min() + 1e-6
        leader = np.arange(count)
        leader[self._side(positions[0].max())] = self._side(positions[0].min())
        matrix = sp.csc_matrix((np.ones(count), (np.arange(count), leader)), (count, count))
        return matrix[:, np.unique(leader[~fixed])]

    def _side(self, x: float) -> NDArray[np.int64]:
        """List the unknowns of the body's side at ``x`` in mm, from the bottom up."""
        positions = self.basis.doflocs
        unknowns = np.flatnonzero((np.abs(positions[0] - x) < 1e-6) & (positions[1] < 1e-6))
        return np.asarray(unknowns[np.lexsort((unknowns, np.round(positions[1][unknowns], 6)))])

    @cached_property
    def flexibility(self) -> Array:
        """Mean displacements of the strips into the material under unit forces, m per N/m."""
        form = linear_elasticity(*lame_parameters(YOUNG * 1e-6, POISSON))
        stiffness = self.reduction.T @ form.assemble(self.basis) @ self.reduction
        loads = self.reduction.T @ self.loads
        displacements = loads.T @ splu(stiffness.tocsc()).solve(loads)
        return np.asarray(0.5 * (displacements + displacements.T)) * MM / 1e3

    def gap(self, angle: float, ends: Ends) -> Array:
        """Compute the gap of the strips at an angle in rad, m, infinite outside the contact."""
        band = self.contact
        slant = math.cos(self.dog.traction)
        tilt = angle * (band.high - self.middles) / slant
        distance = np.maximum(band.low - self.middles, self.middles - band.high) / slant
        if ends == "cut":
            return np.where(distance > 0.0, np.inf, tilt)
        rounding = np.clip(distance / self.root_radius, 0.0, 1.0)
        gap = tilt + self.root_radius * (1.0 - np.sqrt(1.0 - rounding**2))
        return np.where(rounding < 1.0, gap, np.inf)

    def press(self, angle: float, force: float, ends: Ends = "rounded") -> Contact:
        """Press the pair together with ``force`` along the circumference, N/m."""
        slant = math.cos(self.dog.traction)
        band = self.contact
        pair_flexibility = self.flexibility + self.flexibility[::-1, ::-1]
        forces, approach = active_set(pair_flexibility, self.gap(angle, ends), force / slant)
        level = forces @ self.middles / forces.sum()
        return Contact(
            height=float((level - band.low) / band.height), approach=approach / slant, force=forces
        )


def active_set(flexibility: Array, gap: Array, force: float) -> tuple[Array, float]:
    """Solve for forces of sum ``force`` without tension, and the approach, m."""
    touching = np.isfinite(gap)
    for _ in range(100 + 10 * len(gap)):
        forces = np.zeros(len(gap))
        forces[touching], approach = _solve_closed(
            flexibility[np.ix_(touching, touching)], gap[touching], force
        )
        pulling = forces < 0.0
        if pulling.any():
            touching &= ~pulling
            continue
        penetrating = ~touching & (gap + flexibility @ forces - approach < -1e-9 * abs(approach))
        if not penetrating.any():
            return forces, approach
        touching |= penetrating
    raise RuntimeError("the contact does not settle")


def _solve_closed(flexibility: Array, gap: Array, force: float) -> tuple[Array, float]:
    """Compute forces and approach with contact of all strips."""
    unit = np.linalg.solve(flexibility, np.column_stack([np.ones_like(gap), gap]))
    approach = (force + unit[:, 1].sum()) / unit[:, 0].sum()
    return approach * unit[:, 0] - unit[:, 1], float(approach)


def _between(corners: Array, x: Array, z: Array) -> Array:
    """Compute points (2, n) of the quadrilateral of ``corners`` at shares of its sides."""
    shares = np.stack([(1.0 - x) * (1.0 - z), (1.0 - x) * z, x * z, x * (1.0 - z)])
    return np.asarray(corners.T @ shares)


def _dense_ends(cells: int) -> Array:
    """Return knots on [0, 1], denser at both ends."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, cells + 1)))


def _dense_start(cells: int) -> Array:
    """Return knots on [0, 1], denser at the start."""
    return np.asarray(np.linspace(0.0, 1.0, cells + 1) ** 2)
