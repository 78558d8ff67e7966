"""One engagement: from the start of the force to full depth.

Outcomes are values, not exceptions: a shift that blocks, runs out of time or
diverges is a result like any other. The simulator's monitor records every step
and stops the run; everything else is worked out afterwards from the record.
"""

from __future__ import annotations

import math
import time

from pydrake.systems.framework import Context, EventStatus

from dogshape.sim.shift.clutch import Clutch, OperatingPoint
from dogshape.sim.shift.conclusion import TIME_LIMIT, Engagement, Run, engaged
from dogshape.sim.shift.events import STILL_WINDOW, stands_still
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.shift.trace import Series


class _Record:
    """Monitor of a run: keeps every step and says when to stop."""

    def __init__(self, plant: ClutchPlant, point: OperatingPoint) -> None:
        clutch = plant.clutch
        self.plant = plant
        self.point = point
        self.travel = clutch.shift_travel
        #: Places in the state of what has not made its travel: ring, actuator.
        self.under_way = {1, 6} if clutch.mechanism.has_linkage else {1}
        self.clutch = clutch
        self.times: list[float] = []
        self.states: list[Series] = []
        self.blocked = False
        self.failure = ""
        self._solver = clutch.solver
        self._end = time.monotonic() + clutch.solver.time_limit
        self._check_at = STILL_WINDOW
        self._last: Series | None = None

    def begin(self) -> None:
        """Take up the time in which the ring was held, and where the run begins."""
        times, states = self.plant.held
        self.times += times[:-1].tolist()
        self.states += [*states[:-1, : self.plant.state_size]]
        self(self.plant.context)

    def __call__(self, context: Context) -> EventStatus | None:
        now = context.get_time()
        state = self.plant.state()
        self.times.append(now)
        self.states.append(state)
        self.under_way -= {i for i in self.under_way if state[i] >= self.travel}
        if not self.under_way:
            return self._stop("engaged")
        self._require_within_limits(now, state)
        if now >= self._check_at:
            last, self._last, self._check_at = self._last, state, now + STILL_WINDOW
            if stands_still(self.clutch, self.point, now, last, state):
                self.blocked = True
                return self._stop("blocked")
        return None

    def _require_within_limits(self, now: float, state: Series) -> None:
        if len(self.times) < 2:
            return
        if not math.isfinite(state[1]):
            raise RuntimeError(f"the motion is not finite at {now:.6g} s")
        if len(self.times) > self._solver.max_steps:
            limit = f"solver.max_steps = {self._solver.max_steps}"
            raise RuntimeError(f"no end after {limit}, at {now:.6g} s of the shift")
        if time.monotonic() > self._end:
            limit = f"{TIME_LIMIT} = {self._solver.time_limit:.6g}"
            raise RuntimeError(f"{limit}, at {now:.6g} s of the shift")

    def _stop(self, reason: str) -> EventStatus:
        return EventStatus.ReachedTermination(self.plant.plant, reason)


def engage(plant: ClutchPlant, point: OperatingPoint, relative_angle: float) -> Engagement:
    """Simulate one shift.

    Times count from the command: a dead time comes before the phases, while the time-out counts
    from the start of the force.

    Parameters
    ----------
    plant : built once for a clutch and used again.
    point : mismatch and force.
    relative_angle : output ring's lead over dogs facing dogs at the start of the force, rad.

    Returns
    -------
    Engagement
        Never raises for physical failure; a failed integration is an outcome.
    """

    def run(clutch: Clutch) -> Run:
        mine = plant if clutch is plant.clutch else ClutchPlant(clutch)
        return _run(mine, point, relative_angle)

    return engaged(plant.clutch, point, relative_angle, run)


def _run(plant: ClutchPlant, point: OperatingPoint, relative_angle: float) -> Run:
    record = _Record(plant, point)
    simulator = plant.start(point, relative_angle)
    simulator.set_monitor(record)
    try:
        record.begin()
        simulator.AdvanceTo(plant.clutch.timeout)
    except RuntimeError as error:
        if len(record.times) < 2:
            raise  # not a step was made: the model is wrong, not the motion
        record.failure = str(error).split("\n")[0]
    finally:
        simulator.clear_monitor()
    spent = simulator.get_integrator().get_num_derivative_evaluations()
    return Run(record.times, record.states, record.blocked, record.failure, spent)
