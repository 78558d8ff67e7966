r"""Solver of a symmetric system whose unknowns lie in planes, each tied to its neighbours.

Conjugate gradients, preconditioned by symmetric block Gauss-Seidel over groups of
planes. One group that holds all of them is a direct solution, in one step.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from dogshape.sim.errors import DogshapeError

Vector = NDArray[np.float64]
Matrix = Any  #: scipy's sparse matrix in compressed rows
TOLERANCE = 1e-8  #: relative residual
MAX_STEPS = 500


class SolverError(DogshapeError):
    """The linear solver did not reach its tolerance."""


class PlaneSolver:
    """Conjugate gradients with symmetric block Gauss-Seidel over blocks of unknowns.

    Cells are small in the section and long along the radius, so neighbours in a plane
    are tied closely and planes loosely; with planes solved exactly the steps needed
    hardly grow with the mesh.
    """

    def __init__(self, matrix: Matrix, ends: NDArray[np.int64]) -> None:
        self.matrix = matrix.tocsr()
        self.ends = ends
        self.blocks = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self.before = [self.matrix[b, : b.start] for b in self.blocks]
        self.after = [self.matrix[b, b.stop :] for b in self.blocks]
        self.factors: list[SuperLU] = [
            splu(
                self.matrix[b, b].tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            for b in self.blocks
        ]

    def precondition(self, residual: Vector) -> Vector:
        """Return one forward and one backward sweep on ``residual`` (n,)."""
        found = np.zeros_like(residual)
        for block, before, factor in zip(self.blocks, self.before, self.factors, strict=True):
            found[block] = factor.solve(residual[block] - before @ found[: block.start])
        parts = list(zip(self.blocks, self.after, self.factors, strict=True))
        for block, after, factor in reversed(parts[:-1]):
            found[block] -= factor.solve(after @ found[block.stop :])
        return found

    def solve(self, load: Vector) -> tuple[Vector, int]:
        """Return the solution (n,) and the number of steps; raise SolverError without one."""
        found, residual = np.zeros_like(load), load.copy()
        better = self.precondition(residual)
        direction, old = better.copy(), float(residual @ better)
        goal = TOLERANCE * float(np.linalg.norm(load))
        for step in range(1, MAX_STEPS + 1):
            image = self.matrix @ direction
            length = old / float(direction @ image)
            found += length * direction
            residual -= length * image
            if float(np.linalg.norm(residual)) <= goal:
                return found, step
            better = self.precondition(residual)
            new = float(residual @ better)
            direction, old = better + (new / old) * direction, new
        raise SolverError(
            f"the solver of the root stress left a residual above {TOLERANCE:g} after "
            f"{MAX_STEPS} steps; use a coarser mesh or another shape."
        )
