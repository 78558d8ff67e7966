r"""Where the pressure of two flanks that are out of angle acts, and how far dogs give way.

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
GRAIN = 7  #: decimals of coordinates in mm, so that dog and body share their nodes


@dataclass(frozen=True)
class Contact:
    """How two flanks touch.

    Height of the resultant as a share of what touches, on the ring loaded nearer its tip; approach
    of the rings along the circumference, m; normal forces of the strips, N/m.
    """

    height: float
    approach: float
    force: Array


@dataclass(frozen=True)
class FlankModel:
    """One dog on its body (``depth`` in pitches), with the flexibility of its traction flank."""

    dog: Dog
    root_radius: float = ROOT_RADIUS
    strips: int = STRIPS
    depth: float = DEPTH

    @cached_property
    def contact(self) -> FlankContact:
        """What touches at full depth."""
        return flank_contact(self.dog, self.root_radius, "traction")

    @cached_property
    def levels(self) -> Array:
        """Ends of the strips above the floor, m; the same from above as from below."""
        band = self.contact
        span = math.acos(max(-1.0, 1.0 - 2.0 * band.low / band.height))
        turns = np.linspace(span, 0.0, math.ceil(self.strips * span / math.pi) + 1)[:-1]
        below = band.low * (1.0 - (1.0 - np.cos(turns)) / (1.0 - math.cos(span)))
        inside = band.low + band.height * _dense_ends(self.strips)
        return np.concatenate([below, inside, self.dog.height - below[::-1]])

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
        across = _dense_ends(self.strips)
        left, right = self.corners[0, 0], self.corners[3, 0]
        slot = 0.5 * self.dog.tip_width / MM * _dense_start(max(4, self.strips // 4))
        root = left + (right - left) * across
        wide = np.concatenate([left - slot[:0:-1], root, right + slot[1:]])
        deep = self.depth * self.dog.pitch / MM * _dense_start(self.strips)
        body = MeshQuad.init_tensor(np.round(wide, GRAIN), -deep[::-1])
        dog = MeshQuad.init_tensor(across, self.levels / self.dog.height)
        return body + MeshQuad(np.round(_between(self.corners, *dog.p), GRAIN), dog.t)

    @cached_property
    def basis(self) -> Any:
        """Biquadratic displacements."""
        return Basis(self.mesh, ElementVector(ElementQuad2()))

    @cached_property
    def strip_edges(self) -> Any:
        """Edges of elements that are the strips, from the root up."""
        slope, edge = math.tan(self.dog.traction), self.corners[3, 0]
        found = self.mesh.facets_satisfying(
            lambda p: (np.abs(p[0] - edge + p[1] * slope) < 1e-5) & (p[1] > 0.0),
            boundaries_only=True,
        )
        if len(found) != len(self.middles):
            raise ValueError("every strip must be one edge of an element")
        return found[np.argsort(self.mesh.p[1][self.mesh.facets[:, found]].mean(axis=0))]

    @cached_property
    def loads(self) -> Array:
        """Loads of one newton per millimetre of width on each strip, (unknowns, strips)."""
        edges, lean = self.strip_edges, self.dog.traction
        ends = self.basis.nodal_dofs[:, self.mesh.facets[:, edges]]  # (2, 2, strips)
        middle = self.basis.facet_dofs[:, None, edges]
        loads = np.zeros((self.basis.N, len(edges)))
        for part, unknowns in ((1.0 / 6.0, ends), (2.0 / 3.0, middle)):
            loads[unknowns[0], np.arange(len(edges))] = -part * math.cos(lean)
            loads[unknowns[1], np.arange(len(edges))] = -part * math.sin(lean)
        return loads

    @cached_property
    def reduction(self) -> Any:
        """Which free unknown each unknown follows, (unknowns, free)."""
        places, count = self.basis.doflocs, self.basis.N
        held, leader = places[1] < places[1].min() + 1e-6, np.arange(count)
        leader[self._side(places[0].max())] = self._side(places[0].min())
        follows = sp.csc_matrix((np.ones(count), (np.arange(count), leader)), (count, count))
        return follows[:, np.unique(leader[~held])]

    def _side(self, x: float) -> NDArray[np.int64]:
        """Return the unknowns of the body's side at ``x`` in mm, from the bottom up."""
        places = self.basis.doflocs
        found = np.flatnonzero((np.abs(places[0] - x) < 1e-6) & (places[1] < 1e-6))
        return np.asarray(found[np.lexsort((found, np.round(places[1][found], 6)))])

    @cached_property
    def flexibility(self) -> Array:
        """Mean displacements of the strips into the material under unit forces, m per N/m."""
        form = linear_elasticity(*lame_parameters(YOUNG * 1e-6, POISSON))
        stiffness = self.reduction.T @ form.assemble(self.basis) @ self.reduction
        loads = self.reduction.T @ self.loads
        found = loads.T @ splu(stiffness.tocsc()).solve(loads)
        return np.asarray(0.5 * (found + found.T)) * MM / 1e3

    def gap(self, angle: float, ends: Ends) -> Array:
        """Return the gap of the strips at an angle in rad, m; infinite where none can touch."""
        band, slant = self.contact, math.cos(self.dog.traction)
        tilt = angle * (band.high - self.middles) / slant
        beyond = np.maximum(band.low - self.middles, self.middles - band.high) / slant
        if ends == "cut":
            return np.where(beyond > 0.0, np.inf, tilt)
        rounding = np.clip(beyond / self.root_radius, 0.0, 1.0)
        gap = tilt + self.root_radius * (1.0 - np.sqrt(1.0 - rounding**2))
        return np.where(rounding < 1.0, gap, np.inf)

    def press(self, angle: float, force: float, ends: Ends = "rounded") -> Contact:
        """Press the pair together with ``force`` along the circumference, N/m."""
        slant, band = math.cos(self.dog.traction), self.contact
        both = self.flexibility + self.flexibility[::-1, ::-1]
        forces, approach = active_set(both, self.gap(angle, ends), force / slant)
        level = forces @ self.middles / forces.sum()
        return Contact(
            height=float((level - band.low) / band.height), approach=approach / slant, force=forces
        )


def active_set(flexibility: Array, gap: Array, force: float) -> tuple[Array, float]:
    """Return the forces that sum to ``force`` where bodies may push only, and the approach."""
    on = np.isfinite(gap)
    for _ in range(100 + 10 * len(gap)):
        forces = np.zeros(len(gap))
        forces[on], approach = _closed(flexibility[np.ix_(on, on)], gap[on], force)
        pulled = forces < 0.0
        if pulled.any():
            on &= ~pulled
            continue
        through = ~on & (gap + flexibility @ forces - approach < -1e-9 * abs(approach))
        if not through.any():
            return forces, approach
        on |= through
    raise RuntimeError("the contact does not settle")


def _closed(flexibility: Array, gap: Array, force: float) -> tuple[Array, float]:
    """Return forces and approach with every strip in touch."""
    unit = np.linalg.solve(flexibility, np.column_stack([np.ones_like(gap), gap]))
    approach = (force + unit[:, 1].sum()) / unit[:, 0].sum()
    return approach * unit[:, 0] - unit[:, 1], float(approach)


def _between(corners: Array, x: Array, z: Array) -> Array:
    """Return points (2, n) of the quadrilateral of ``corners`` at shares of its sides."""
    shares = np.stack([(1.0 - x) * (1.0 - z), (1.0 - x) * z, x * z, x * (1.0 - z)])
    return np.asarray(corners.T @ shares)


def _dense_ends(cells: int) -> Array:
    """Return knots on [0, 1], denser at both ends."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, cells + 1)))


def _dense_start(cells: int) -> Array:
    """Return knots on [0, 1], denser at the start."""
    return np.asarray(np.linspace(0.0, 1.0, cells + 1) ** 2)
