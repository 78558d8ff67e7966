"""Error of the mean shift time against CPU time: Drake's integrators and MuJoCo.

    python -m benchmarks.work_precision [--angles N]

All settings run interleaved, shift by shift, on the prototype at the seeds' operating points
from 25 1/min up, three even angles each. Every setting is judged against accuracy 1e-6
of the same model; MuJoCo against its own finest setting, since it models the
contact differently. Takes about twenty minutes; needs the extra ``blind``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.common import angles_of, paper_study
from dogshape.sim.shift.clutch import SCHEMES, Clutch, OperatingPoint, Solver
from dogshape.sim.shift.conclusion import engage
from dogshape.sim.shift.plant import ClutchPlant
from dogshape.sim.units import RPM
from dogshape.validation.second_engine import EngineSettings, SecondEngine

# Schemes that the product does not offer, because this benchmark decided against them.
for _name in ("bogacki_shampine3", "runge_kutta5", "implicit_euler"):
    SCHEMES.setdefault(_name, 1e-4)

Shift = Callable[[OperatingPoint, float], float | None]


@dataclass
class Setting:
    """A way to simulate a shift; ``family`` shares a line and the reference."""

    family: str
    label: str
    shift: Shift
    times: list[float] = field(default_factory=list)
    cpu: float = 0.0

    def run(self, point: OperatingPoint, angle: float) -> None:
        """Simulate one shift and keep its time and cost."""
        start = time.process_time()
        shift_time = self.shift(point, angle)
        self.cpu += time.process_time() - start
        self.times.append(np.nan if shift_time is None else shift_time)


def _drake(clutch: Clutch) -> Shift:
    plant = ClutchPlant(clutch)
    return lambda point, angle: engage(plant, point, angle).shift_time


def mujoco_shift(clutch: Clutch, settings: EngineSettings) -> Shift:
    """Build a function of point and angle that simulates a shift time in MuJoCo, s."""
    engine = SecondEngine(clutch, settings)
    return lambda point, angle: engine.engage(point, angle).time


def settings_of(clutch: Clutch) -> list[Setting]:
    """Return all settings, the reference of each family first."""

    def with_solver(**changes: Any) -> Clutch:
        return replace(clutch, solver=replace(clutch.solver, **changes))

    # One coefficient for all: cenic alone knows two.
    contact = replace(clutch.contact, static_friction=clutch.contact.dynamic_friction)
    fine = {"accuracy": 1e-6, "max_step": 2e-4}
    settings = [Setting("Drake rk3", "1e-6", _drake(with_solver(**fine)))]
    for accuracy in (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5):
        settings.append(
            Setting("Drake rk3", f"{accuracy:.0e}", _drake(with_solver(accuracy=accuracy)))
        )
    for scheme, accuracies in (
        ("bogacki_shampine3", (1e-3, 1e-4)),
        ("runge_kutta5", (1e-3, 1e-4)),
        ("implicit_euler", (1e-3,)),
    ):
        for accuracy in accuracies:
            changed = with_solver(scheme=scheme, accuracy=accuracy)
            settings.append(Setting(f"Drake {scheme}", f"{accuracy:.0e}", _drake(changed)))
    for accuracy in (1e-5, 1e-6, 1e-7):
        solver = Solver("cenic", accuracy)
        changed = replace(clutch, contact=contact, solver=solver)
        settings.append(Setting("Drake cenic", f"{accuracy:.0e}", _drake(changed)))
    settings.append(Setting("Drake rk3, all dogs", "3e-04", _drake(with_solver(all_dogs=True))))
    return settings + second_settings(replace(clutch, contact=contact))


def second_settings(clutch: Clutch) -> list[Setting]:
    """Return MuJoCo by step and damping of its contact, the finest first."""
    pairs = ((2e-6, 5e4), (5e-6, 2.5e4), (1e-5, 2.5e4), (2e-5, 1.25e4), (4e-5, 1.25e4))
    return [
        Setting(
            "MuJoCo", f"{step * 1e6:.3g} us", mujoco_shift(clutch, EngineSettings(step, damping))
        )
        for step, damping in pairs
    ]


def run(settings: list[Setting], angles: int) -> list[Setting]:
    """Simulate all settings, interleaved."""
    study = paper_study()
    points = [p for p in study.points if p.mismatch >= 24.0 * RPM]
    for index, point in enumerate(points):
        for angle in angles_of(study.clutch, angles, index):
            for setting in settings:
                setting.run(point, float(angle))
    return settings


def rows_of(settings: list[Setting]) -> list[dict[str, Any]]:
    """Return a row for each setting: cost in ms, errors in percent."""
    references: dict[str, np.ndarray] = {}
    for setting in settings:
        references.setdefault(setting.family, np.array(setting.times))
    rows = []
    for setting in settings:
        family = setting.family
        reference = references["Drake rk3" if family.startswith("Drake") else family]
        times = np.array(setting.times)
        engaged = np.isfinite(times) & np.isfinite(reference)
        deviations = np.abs(times[engaged] / reference[engaged] - 1.0)
        rows.append(
            {
                "family": family,
                "label": setting.label,
                "cpu_ms": 1e3 * setting.cpu / len(times),
                "mean": 100 * abs(times[engaged].mean() / reference[engaged].mean() - 1.0),
                "median": 100 * float(np.median(deviations)),
                "worst": 100 * float(deviations.max()),
                "lost": int((~engaged).sum()),
            }
        )
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=3)
    arguments = parser.parse_args()
    rows = rows_of(run(settings_of(paper_study().clutch), arguments.angles))
    unit = next(r["cpu_ms"] for r in rows if (r["family"], r["label"]) == ("Drake rk3", "3e-04"))
    print("CPU of a shift and error against the converged value; ratio to the default")
    print(f"{'family':<26}{'setting':>9}{'CPU, ms':>9}{'ratio':>7}", end="")
    print(f"{'mean, %':>9}{'median, %':>11}{'worst, %':>10}{'lost':>6}")
    for r in rows:
        print(
            f"{r['family']:<26}{r['label']:>9}{r['cpu_ms']:9.1f}{r['cpu_ms'] / unit:7.2f}", end=""
        )
        print(f"{r['mean']:9.3f}{r['median']:11.4f}{r['worst']:10.2f}{r['lost']:6d}")


if __name__ == "__main__":
    main()
