"""Designs, operating points and shifts with their cost, for the benchmarks."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dogshape.pipeline.config.study_file import VARIABLES, Setup, load_study
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.statistics.expectation import even_phases
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root

#: Chamfer, traction and braking angle in deg, height in mm, dogs: the prototype, two
#: shapes far from it, and the neighbourhood of the best design of the paper's study.
DESIGNS = {
    "prototype": (8.0, 12.0, 22.0, 3.7, 15),
    "steep": (6.0, 20.5, 13.3, 2.54, 11),
    "blunt": (17.4, 26.6, 16.0, 4.63, 12),
    "fine": (11.4, 7.2, 22.3, 1.95, 34),
}


@dataclass(frozen=True)
class Cell:
    """Shifts of a design at an operating point."""

    times: np.ndarray  #: at even angles, NaN where a shift did not engage, s, (n,)
    cpu: float  #: of a shift, s
    evaluations: float = math.nan  #: of the derivatives in a shift

    @property
    def mean(self) -> float:
        """Mean over the shifts that engaged, s."""
        return float(np.nanmean(self.times))


def clutch_of(study: Setup, design: str) -> Clutch:
    """Return the study's clutch with one of the designs."""
    values = dict(zip(VARIABLES, DESIGNS[design], strict=True))
    return study.clutch_with(values)


def point_of(study: Setup, mismatch_rpm: float, force: float) -> OperatingPoint:
    """Return an operating point of the study with another mismatch."""
    profile = next(p.profile for p in study.points if p.profile.force == force)
    return OperatingPoint(mismatch_rpm * RPM, profile)


def angles_of(clutch: Clutch, count: int, index: int) -> np.ndarray:
    """Return even relative angles over one pitch, rad, (count,)."""
    return even_phases(count, 7, index) * clutch.dog.pitch_angle


def measure(plant: ClutchPlant, point: OperatingPoint, angles: Iterable[float]) -> Cell:
    """Simulate shifts in Drake at angles, rad, with their cost."""
    times = []
    evaluations = 0
    start = time.process_time()
    for angle in angles:
        result = engage(plant, point, float(angle))
        times.append(np.nan if result.shift_time is None else result.shift_time)
        evaluations += result.evaluations
    cpu = time.process_time() - start
    return Cell(np.array(times), cpu / len(times), evaluations / len(times))


def paper_study() -> Setup:
    """Return the paper's study."""
    return load_study("mq200_paper")


def read_result(name: str) -> dict[str, Any]:
    """Read the result of a bundled study."""
    text = (bundled_root() / name / "result.json").read_text(encoding="utf-8")
    record: dict[str, Any] = json.loads(text)
    return record
