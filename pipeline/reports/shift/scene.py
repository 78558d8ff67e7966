"""The rings as solids for the page of a shift, and the viewer that shows them.

The viewer is Drake's own, Meshcat with three.js inside, taken from the library
as it is installed, so that a page needs no network.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common import FindResourceOrThrow

from dogshape.sim.shift.geometry import Dog
from dogshape.sim.shift.mesh import Mesh, dog_solid
from dogshape.sim.units import MM

BODY = 0.11  #: axial length of the ring behind its dogs over the outer radius


def viewer_code() -> str:
    """Read the JavaScript of Meshcat, which Drake installs."""
    return Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_text(encoding="utf-8")


def ring_body(dog: Dog, length: float) -> Mesh:
    """Mesh the ring behind the dogs, from their roots ``length`` m backwards.

    The frame is the ring's (see ``sim.shift.mesh``); a closed surface, normals outwards.
    """
    sides = 12 * dog.count
    angle = 2.0 * np.pi * np.arange(sides) / sides
    root = -0.5 * dog.height
    inner, outer = dog.inner_radius, dog.outer_radius
    rim = [(inner, root - length), (outer, root - length), (outer, root), (inner, root)]
    circles = [
        np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(sides, z)], axis=1)
        for radius, z in rim
    ]
    here = np.arange(sides)
    after = (here + 1) % sides
    cells = []
    for edge in range(4):
        a, b = edge * sides, (edge + 1) % 4 * sides
        cells.append(np.stack([here + a, after + a, after + b], axis=1))
        cells.append(np.stack([here + a, after + b, here + b], axis=1))
    return Mesh(np.concatenate(circles), np.concatenate(cells))


def solids(dog: Dog) -> dict[str, Any]:
    """Return one dog and the body of a ring, mm, as the page wants them.

    The triangles of the dog come in the order traction flank, face, braking
    flank (two each), then what cannot touch.
    """
    return {
        "dog": _plain(dog_solid(dog)),
        "body": _plain(ring_body(dog, BODY * dog.outer_radius)),
        "count": dog.count,
        "radius": dog.outer_radius / MM,
    }


def _plain(mesh: Mesh) -> dict[str, Any]:
    return {
        "vertices": np.round(mesh.vertices / MM, 4).ravel().tolist(),
        "cells": mesh.cells.ravel().tolist(),
    }
