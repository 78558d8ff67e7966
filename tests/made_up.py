r"""A clutch of closed form, for what must be known exactly and simulated fast.

Free flight takes :math:`\tau = T_l + T ((m + m_a) x/((F - R) T^2))^{1/4}` with lag, added mass and
friction of the mechanism; then the dogs wait until the next slot comes, if they meet a face: a
share :math:`1 - b` of the pitch. The relative angle at the touch is uniform, so the mean wait
is :math:`b^2/2` of the time in which a pitch passes, whatever the flight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.bench.stand_file import BenchRecord
from dogshape.diagnosis.prediction.model import Model, build_models
from dogshape.diagnosis.settings import USUAL
from dogshape.sim.effects import load
from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.statistics.blocks import Block
from dogshape.sim.statistics.shift_records import Record, content_key
from dogshape.sim.strength.landing import NO_LANDING
from dogshape.sim.units import RPM

FACE = 0.4  #: share of the pitch in which the dogs meet a face
WAY = 0.01  #: m


def flight(clutch: Clutch, point: OperatingPoint) -> float:
    """Return the time of the free flight, s."""
    profile, mechanism = point.profile, clutch.mechanism
    force = max(profile.force - mechanism.friction, 1e-3)
    mass = clutch.rings.mass + mechanism.added_mass
    lag = getattr(profile, "lag", 0.0)
    return lag + profile.rise * float((mass * WAY / (force * profile.rise**2)) ** 0.25)


def mean_time(clutch: Clutch, point: OperatingPoint) -> float:
    """Return the mean shift time over all relative angles, s."""
    return flight(clutch, point) + 0.5 * FACE**2 * _pass(clutch, point)


def _pass(clutch: Clutch, point: OperatingPoint) -> float:
    return clutch.dog.pitch_angle / abs(point.mismatch)


def made_up(blocks: Sequence[Block]) -> list[list[Record]]:
    """Simulate blocks (a ``Runner``)."""
    return [[_shift(block, angle) for angle in block.angles] for block in blocks]


def _shift(block: Block, angle: float) -> Record:
    clutch, point = block.clutch, block.point
    free, whole = flight(clutch, point), _pass(clutch, point)
    turned = (angle / clutch.dog.pitch_angle + free / whole) % 1.0
    time = free + max(0.0, FACE - turned) * whole
    if time > clutch.timeout:
        return {"outcome": "timed_out", "shift_time_s": None, "face_contacts": 1}
    return {
        "outcome": "engaged",
        "shift_time_s": time,
        "face_contacts": int(turned < FACE),
        "slots_skipped": 0,
    }


class Quick:
    """Made-up shifts in place of simulated ones, stopped by Ctrl-C after some of them."""

    def __init__(self) -> None:
        self.done = 0
        self.stop: int | None = None

    def __call__(self, block: Block) -> Iterator[Record]:
        """Yield whole records of a block's shifts, as workers write them."""
        for given, row in zip(block.inputs, made_up([block])[0], strict=True):
            if self.done == self.stop:
                raise KeyboardInterrupt
            self.done += 1
            landing = {"landing_loads_N_mm": list(NO_LANDING)}
            yield {"key": content_key(given), **given, **row, "actuator_time_s": None, **landing}


def few_cells(bench: Bench, wanted: Sequence[tuple[float, float]]) -> Bench:
    """Return a bench with the operating points of some mismatches in 1/min and forces in N."""
    known = {(round(c.point.mismatch / RPM, 6), c.point.profile.force): c for c in bench.cells}
    return replace(bench, cells=tuple(known[key] for key in wanted))


def pitches(count: int) -> np.ndarray:
    """Return even places in the pitch, (count,)."""
    return (np.arange(count) + 0.5) / count


#: A record that leaves nothing open.
RECORD = BenchRecord(
    time_zero="command", displacement_at="sleeve", empty_cells="not_made", sense="known"
)
#: Effects whose shift times are of closed form here.
KNOWN = ("actuation_delay", "actuation_lag", "force_scale", "mismatch_speed", "moving_mass")


def small_model() -> tuple[Bench, Model]:
    """Build the model of six operating points with the effects of ``KNOWN``, and its bench."""
    bench = load_bench("mq200_adams")
    cells = [cell for cell in bench.cells if cell.n]
    cells = [cells[k] for k in (1, 6, 11, 12, 19, 22)]
    bench = replace(bench, record=RECORD, cells=tuple(cells))
    effects = load(None)
    models = build_models(bench, {name: effects[name] for name in KNOWN}, USUAL, made_up)
    return bench, models["sleeve"]
