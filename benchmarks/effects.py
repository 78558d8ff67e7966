"""What each effect does to shifts of the prototype, and what it costs to simulate.

    python -m benchmarks.effects

Each parameter at nine tenths of its prior, alone and in some pairs; six shifts (two
angles at three operating points). CPU time over that without effect; a shift that does
not engage counts with its run. Takes some minutes.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

from benchmarks.common import paper_study, point_of
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from dogshape.sim.shift.clutch import solver_for
from dogshape.sim.shift.contact import CONTACT_SETS
from dogshape.sim.shift.engagement import engage
from dogshape.sim.shift.outcome import Outcome
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import DEG

POINTS = ((10.0, 235.2), (50.0, 469.0), (249.0, 641.5))
ANGLES = (0.0, 13.0)
PAIRS = (
    ("sleeve_friction", "linkage_compliance"),
    ("sleeve_friction", "free_play"),
    ("spline_friction", "sleeve_friction"),
)
QUIET = ("actuation_delay", "relative_angle")  # no simulation of their own


def _changed(setting: Setting, names: tuple[str, ...]) -> Setting:
    """Return the setting with effects at nine tenths of their priors."""
    effects = load()
    for name in names:
        effect = effects[name]
        values = {p.name: p.at(0.9) for p in effect.parameters}
        setting = effect.apply(setting, values)
    return setting


def _measured(settings: list[Setting]) -> tuple[float, int, float, float]:
    """Return mean shift time in ms, how many engage, steps and CPU time of a shift in ms."""
    times, steps = [], 0
    start = time.process_time()
    for setting in settings:
        plant = ClutchPlant(setting.clutch)
        for angle in ANGLES:
            result = engage(plant, setting.point, angle * DEG)
            steps += result.steps
            if result.outcome is Outcome.ENGAGED and result.shift_time is not None:
                times.append(result.shift_time)
    cpu = time.process_time() - start
    count = len(settings) * len(ANGLES)
    mean = sum(times) / len(times) if times else math.nan
    return mean * 1e3, len(times), steps / count, cpu / count * 1e3


def main() -> None:
    """Print the table."""
    study = paper_study()
    names = [(name,) for name in load() if name not in QUIET]
    for contact in CONTACT_SETS.values():
        clutch = replace(study.clutch, contact=contact, solver=solver_for(contact))
        plain = [Setting(clutch, point_of(study, *point)) for point in POINTS]
        print(f"\n{contact.name}, {clutch.solver.scheme}")
        print(f"{'effect':<40} mean ms  engaged   steps  CPU ms  CPU over none")
        least = math.nan
        for effects in [(), *names, *PAIRS]:
            mean, engaged, steps, cpu = _measured([_changed(one, effects) for one in plain])
            least = cpu if not effects else least
            row = f"{' + '.join(effects) or 'none':<40}{mean:8.1f}{engaged:6d}/6"
            print(f"{row}{steps:9.0f}{cpu:8.0f}{cpu / least:10.1f}", flush=True)


if __name__ == "__main__":
    main()
