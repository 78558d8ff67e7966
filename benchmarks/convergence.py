"""Mean shift time against tolerance and mesh, for four designs at eight operating points.

    python -m benchmarks.convergence

Prints, for every design and point, the error of the mean shift time over twelve even
angles at each accuracy, against accuracy 1e-5 with half the largest step; then the
observed order, and the same for contact meshes cut finer. Takes about ten minutes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dogshape.sim.shift.plant
from benchmarks.common import DESIGNS, Cell, angles_of, clutch_of, measure, paper_study, point_of
from dogshape.sim.shift.clutch import Clutch
from dogshape.sim.shift.mesh import Mesh, rigid_dog
from dogshape.sim.shift.plant import ClutchPlant

POINTS = (
    (5.0, 235.2),
    (10.0, 469.0),
    (25.0, 641.5),
    (50.0, 315.5),
    (-50.0, 469.0),
    (100.0, 235.2),
    (149.0, 641.5),
    (249.0, 469.0),
)
ACCURACIES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
REFERENCE = 1e-5
ANGLES = 12


def with_accuracy(clutch: Clutch, accuracy: float) -> Clutch:
    """Return the clutch at another accuracy; the reference also halves the largest step."""
    step = clutch.solver.max_step * (0.5 if accuracy == REFERENCE else 1.0)
    return replace(clutch, solver=replace(clutch.solver, accuracy=accuracy, max_step=step))


def refined(mesh: Mesh) -> Mesh:
    """Cut every triangle into four at the middles of its edges."""
    corners = mesh.vertices[mesh.cells]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    vertices = np.concatenate([np.stack(q, axis=1) for q in quarters]).reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))


def plant_with(clutch: Clutch, levels: int) -> ClutchPlant:
    """Return a plant whose rigid surface is cut finer ``levels`` times."""

    def cut(dog: object) -> Mesh:
        mesh = rigid_dog(dog)  # type: ignore[arg-type]
        for _ in range(levels):
            mesh = refined(mesh)
        return mesh

    dogshape.sim.shift.plant.rigid_dog = cut  # type: ignore[assignment]
    try:
        return ClutchPlant(clutch)
    finally:
        dogshape.sim.shift.plant.rigid_dog = rigid_dog


def error(cell: Cell, reference: Cell) -> tuple[float, float]:
    """Return the error of the mean and the median one of single shifts, in percent."""
    both = np.isfinite(cell.times) & np.isfinite(reference.times)
    one, other = cell.times[both], reference.times[both]
    single = np.median(np.abs(one / other - 1.0))
    return 100.0 * abs(one.mean() / other.mean() - 1.0), 100.0 * float(single)


def tolerance() -> None:
    """Print the table of tolerances."""
    study = paper_study()
    print("error of the mean shift time, %, by accuracy")
    head = "".join(f"{a:>9.0e}" for a in ACCURACIES)
    print(f"{'design':<10} {'1/min':>6} {'N':>6} {'mean, ms':>9}{head}")
    errors: list[list[tuple[float, float]]] = []
    spent = np.zeros(len(ACCURACIES) + 1)
    for design in DESIGNS:
        clutch = clutch_of(study, design)
        plants = [ClutchPlant(with_accuracy(clutch, a)) for a in (*ACCURACIES, REFERENCE)]
        for index, (mismatch, force) in enumerate(POINTS):
            point, angles = point_of(study, mismatch, force), angles_of(clutch, ANGLES, index)
            cells = [measure(plant, point, angles) for plant in plants]
            spent += [c.evaluations for c in cells]
            row = [error(c, cells[-1]) for c in cells[:-1]]
            errors.append(row)
            text = "".join(f"{e:9.3f}" for e, _ in row)
            line = f"{design:<10} {mismatch:6.0f} {force:6.1f} {cells[-1].mean * 1e3:9.2f}{text}"
            print(line, flush=True)
    table = np.array(errors)
    summary(table, spent / len(errors))


def summary(table: np.ndarray, evaluations: np.ndarray) -> None:
    """Print largest and typical errors, the observed order, and the cost."""
    largest, typical = table[..., 0].max(axis=0), np.median(table[..., 1], axis=0)
    rows = {
        "largest error of a mean, %": largest,
        "root mean square of them, %": np.sqrt((table[..., 0] ** 2).mean(axis=0)),
        "median error of a shift, %": typical,
        "derivatives a shift": evaluations[:-1],
    }
    for name, values in rows.items():
        text = "".join(f"{v:9.4f}" if v < 100 else f"{v:9.0f}" for v in values)
        print(f"{name:<34}{text}")
    keep = np.array(ACCURACIES) <= 3e-3
    order = np.polyfit(np.log(np.array(ACCURACIES)[keep]), np.log(typical[keep]), 1)[0]
    print(f"observed order of the median error in the accuracy, 3e-3 to 1e-4: {order:.2f}")
    print(f"(reference: accuracy {REFERENCE:.0e}, {evaluations[-1]:.0f} derivatives a shift)")


def meshes() -> None:
    """Print the error of the default contact mesh against finer ones."""
    study = paper_study()
    print("\nerror of the mean shift time by the mesh of the rigid side, %: against 384 triangles")
    print(f"{'design':<10} {'1/min':>6} {'N':>6} {'6 triangles':>12} {'24':>9} {'96':>9}")
    for design in DESIGNS:
        clutch = with_accuracy(clutch_of(study, design), 1e-4)
        plants = [plant_with(clutch, level) for level in (0, 1, 2, 3)]
        for index in (0, 3, 7):
            mismatch, force = POINTS[index]
            point, angles = point_of(study, mismatch, force), angles_of(clutch, 4, index)
            cells = [measure(plant, point, angles) for plant in plants]
            row = [error(c, cells[-1])[0] for c in cells[:-1]]
            text = f"{row[0]:12.4f} {row[1]:9.4f} {row[2]:9.4f}"
            print(f"{design:<10} {mismatch:6.0f} {force:6.1f} {text}", flush=True)


if __name__ == "__main__":
    tolerance()
    meshes()
