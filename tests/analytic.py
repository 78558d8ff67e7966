r"""A clutch of closed form, for tests that need exact and fast shift times.

Free flight takes :math:`\tau = T_l + T ((m + m_a) x/((F - R) T^2))^{1/4}` with lag, added mass and
friction of the mechanism; then the dogs wait until the next slot comes, if they meet a face: a
share :math:`1 - b` of the pitch. The relative angle at the touch is uniform, so the mean wait
is :math:`b^2/2` of the time in which a pitch passes, whatever the flight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dogshape.bench.bench_data import Bench, load_bench
from dogshape.bench.stand_file import BenchRecord
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.prediction.model import Model
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.effects import load
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.sim.strength.landing import NO_LANDING
from dogshape.sim.units import RPM

FACE_SHARE = 0.4  #: share of the pitch in which the dogs meet a face
TRAVEL_M = 0.01


def flight_time(clutch: Clutch, point: OperatingPoint) -> float:
    """Compute the time of the free flight, s."""
    profile = point.profile
    mechanism = clutch.mechanism
    force = max(profile.force - mechanism.friction, 1e-3)
    mass = clutch.rings.mass + mechanism.added_mass
    lag = getattr(profile, "lag", 0.0)
    return lag + profile.rise * float((mass * TRAVEL_M / (force * profile.rise**2)) ** 0.25)


def mean_time(clutch: Clutch, point: OperatingPoint) -> float:
    """Compute the mean shift time over all relative angles, s."""
    return flight_time(clutch, point) + 0.5 * FACE_SHARE**2 * _pass(clutch, point)


def _pass(clutch: Clutch, point: OperatingPoint) -> float:
    return clutch.dog.pitch_angle / abs(point.mismatch)


def simulate_analytic(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks (a ``Runner``)."""
    rows = []
    for block in blocks:
        rows.append([_shift(block, angle) for angle in block.angles])
    return rows


def _shift(block: Block, angle: float) -> Record:
    clutch = block.clutch
    point = block.point
    flight_duration = flight_time(clutch, point)
    pass_time = _pass(clutch, point)
    phase = (angle / clutch.dog.pitch_angle + flight_duration / pass_time) % 1.0
    time = flight_duration + max(0.0, FACE_SHARE - phase) * pass_time
    if time > clutch.timeout:
        return {"outcome": "timed_out", "shift_time_s": None, "face_contacts": 1}
    return {
        "outcome": "engaged",
        "shift_time_s": time,
        "face_contacts": int(phase < FACE_SHARE),
        "slots_skipped": 0,
    }


class AnalyticShifts:
    """Shifts of closed form in place of simulated ones, stopped after ``stop`` shifts."""

    def __init__(self) -> None:
        self.done = 0
        self.stop: int | None = None

    def __call__(self, block: Block) -> Iterator[Record]:
        """Yield the records of a block's shifts, as workers write them."""
        for inputs, row in zip(block.inputs, simulate_analytic([block])[0], strict=True):
            if self.done == self.stop:
                raise KeyboardInterrupt
            self.done += 1
            landing = {"landing_loads_N_mm": list(NO_LANDING)}
            yield {"key": content_key(inputs), **inputs, **row, "actuator_time_s": None, **landing}


def select_cells(bench: Bench, points: Sequence[tuple[float, float]]) -> Bench:
    """Select operating points of a bench by mismatch in 1/min and force in N."""
    cells_by_point = {
        (round(c.point.mismatch / RPM, 6), c.point.profile.force): c for c in bench.cells
    }
    return replace(bench, cells=tuple(cells_by_point[key] for key in points))


def pitch_shares(count: int) -> np.ndarray:
    """Return even shares of the pitch, (count,)."""
    return (np.arange(count) + 0.5) / count


#: A record that leaves nothing open.
RECORD = BenchRecord(
    time_zero="command", displacement_at="sleeve", empty_cells="not_made", sense="known"
)
#: Effects whose shift times are of closed form here.
ANALYTIC_EFFECTS = (
    "actuation_delay",
    "actuation_lag",
    "force_scale",
    "mismatch_speed",
    "moving_mass",
)


def small_model() -> tuple[Bench, Model]:
    """Build the model of six operating points with the effects of ``KNOWN``, and its bench."""
    bench = load_bench("mq200_adams")
    cells = [cell for cell in bench.cells if cell.n]
    cells = [cells[k] for k in (1, 6, 11, 12, 19, 22)]
    bench = replace(bench, record=RECORD, cells=tuple(cells))
    effects = load(None)
    models = build_models(
        bench, {name: effects[name] for name in ANALYTIC_EFFECTS}, USUAL, simulate_analytic
    )
    return bench, models["sleeve"]
