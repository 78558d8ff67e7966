"""Does the bundled bank need a correction: the compiled engine against Drake, effect by effect.

    python -m benchmarks.bank_engines [EFFECT ... | all]

The clutch of the published tables as the bundled bank has it, in both engines at the same angles:
two even angles at three operating points. Without names, the effects that the stand's answer hangs
on, at the end of their ranges, and linkage and play at the middle as well; with ``all`` every
effect. The compiled engine has its own accuracy, Drake 1e-9, where its steps count least
(``benchmarks.linkage_steps``); the published set's own is 1e-7. A line has the mean shift time of
the compiled engine, how far it is from Drake's (with the standard error of that mean difference,
since engines part at single angles), and the largest difference of a single shift. Levels at which
the mean differs by more than 0.5 % are marked, where a bank would ask for a correction. Some
minutes of one processor.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.prediction.bank import settings_of
from dogshape.diagnosis.prediction.levels import only_read
from dogshape.sim.effect import Effect
from dogshape.sim.effects import load
from dogshape.sim.engines import engage
from dogshape.sim.setting import Setting
from dogshape.sim.units import RPM

POINTS = ((10, 235.2), (50, 469.0), (149, 641.5))  #: 1/min and N
ANGLES = 2
FINE = 1e-9  #: accuracy of Drake
#: Effects whose engines differ most in their steps, at the middle of their range as well.
STEPS = ("linkage_compliance", "free_play")
LEADING = (*STEPS, "actuation_lag", "drag_torque", "moving_mass", "sleeve_friction")
ASKED = 0.005  #: of the mean, from which a correction is worth its shifts


def times(settings: list[Setting], engine: str, accuracy: float | None = None) -> NDArray:
    """Simulate even angles at all points, s; the time-out where a shift does not engage, (C, n)."""
    found = []
    for setting in settings:
        clutch = setting.clutch.with_engine(engine)
        if accuracy is not None:
            clutch = replace(clutch, solver=replace(clutch.solver, accuracy=accuracy))
        turns = (np.arange(ANGLES) + 0.37) / ANGLES
        rows = [engage(clutch, setting.point, float(t * clutch.dog.pitch_angle)) for t in turns]
        found.append([clutch.timeout if r.shift_time is None else r.shift_time for r in rows])
    return np.array(found)


def levels(effect: Effect, base: Setting) -> list[dict[str, float]]:
    """Return the values at which an effect is compared."""
    if not effect.parameters:
        return [{}]
    first = effect.parameters[0]
    inside = first.neutral_of(base) > first.low
    shares = (0.0, 1.0) if inside else (0.5, 1.0) if effect.name in STEPS else (1.0,)
    rows = [{p.name: p.at(share) for p in effect.parameters} for share in shares]
    return [row for row in rows if effect.possible(base, row)]


def main() -> None:
    """Simulate and print."""
    every = {
        (round(s.point.mismatch / RPM), s.point.profile.force): s
        for s in settings_of(load_bench("mq200_adams"))
    }
    base, effects = [every[point] for point in POINTS], load()
    asked = sys.argv[1:] or list(LEADING)
    print(
        f"mean over {len(POINTS)} operating points and {ANGLES} angles, ms; compiled less Drake's"
    )
    print(f"{'effect':<21}{'at':<28}{'mean':>8}{'apart':>8}{'error':>7}{'largest':>9}")
    marked: list[str] = []
    rows = [("none", {}, base)]
    for name, effect in effects.items():
        if (name in asked or asked == ["all"]) and not only_read(effect, base[0]):
            rows += [(name, v, [effect.apply(s, v) for s in base]) for v in levels(effect, base[0])]
    for name, values, changed in rows:
        compiled = times(changed, "planar")
        fine = compiled - times(changed, "drake", FINE)
        mean, error = float(fine.mean()), float(fine.std(ddof=1)) / fine.size**0.5
        at = " ".join(f"{value:.3g}" for value in values.values())
        beyond = abs(mean) > ASKED * compiled.mean()
        marked += [f"{name} {at}"] if beyond else []
        print(
            f"{name:<21}{at:<28}{1e3 * compiled.mean():8.2f}"
            f"{1e3 * mean:8.3f}{1e3 * error:7.3f}{1e3 * np.abs(fine).max():9.2f}"
            f"{'  > 0.5 %' if beyond else ''}",
            flush=True,
        )
    print(f"\n{len(marked)} of {len(rows)} levels differ by more than 0.5 % of the mean")


if __name__ == "__main__":
    main()
