"""Gain of the best design under other contact, other friction and with a mechanism.

    python -m benchmarks.contact_sets [--angles N] [--jobs N]

The prototype, the design that ``mq200_paper`` chose, and the one that ``mq200`` chose under the
question of a gearbox are simulated at all operating points by the compiled engine, whose means are
Drake's to 0.8 % at most (``benchmarks/engines``): under both contact sets, under the
design set with both coefficients of friction a third smaller and a third larger, with friction in
the ring's toothing (alone, and with a fork's mass and the drag of oil), and with other dissipation.
Restitution of an impact at 0.2 m/s stands beside each. Angles are the same under each, and none
that search or confirmation used. Last comes the friction above which a flank would no longer let go
under load, whatever its shift times are. Finished shifts are kept in ``build/contact_sets``. Takes
three minutes on two cores.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from benchmarks.common import paper_study, read_result
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.study_record import DesignRow
from dogshape.pipeline.simulate.evaluation import NEW_ANGLES, evaluate
from dogshape.pipeline.simulate.executor import Executor
from dogshape.pipeline.store.folder import ShiftJournal
from dogshape.sim.shift.clutch import CONTACT_SETS, ContactSet
from dogshape.sim.statistics.expectation import MixExpectation
from dogshape.sim.units import DEG
from dogshape.validation.impact import restitution

FACTORS = (0.667, 1.333)  #: of friction, the ends of its range in the study mq200_robust

DISSIPATIONS = (1.0, 3.0, 60.0)  #: s/m; the design set has 20, dry steel about 1
#: What stands around the ring of the stand and of any gearbox, with values of docs/studies.md.
MECHANISMS = {
    "toothing": ("spline_friction=0.1",),
    "toothing, fork, drag": ("spline_friction=0.1", "added_mass_kg=0.3", "drag_torque_Nm=0.1"),
}
IMPACT_SPEED_M_S = 0.2  #: of the printed restitution, of a ring that lands on the other

Designs = dict[str, dict[str, float]]


def designs_of(study: Setup) -> Designs:
    """Read the prototype, the design that the study chose, and the one that ``mq200`` chose."""
    best, gearbox_best = (DesignRow(**read_result(name)["best"]) for name in (study.name, "mq200"))
    return {
        "prototype": study.prototype,
        "chosen": best.params(study.variables),
        "gearbox's": gearbox_best.params(study.variables),
    }


def settings() -> dict[str, Setup]:
    """Load the paper's study under each contact set, friction, mechanism and dissipation."""
    studies = {
        name: _study(f"contact.set={name}")
        for name, contact in CONTACT_SETS.items()
        if not contact.impact
    }
    design_set = CONTACT_SETS["lubricated_steel"]
    for factor in FACTORS:
        static = design_set.static_friction * factor
        dynamic = design_set.dynamic_friction * factor
        studies[f"friction {static:.3f} / {dynamic:.3f}"] = _study(
            f"contact.static_friction={static}", f"contact.dynamic_friction={dynamic}"
        )
    for name, keys in MECHANISMS.items():
        studies[name] = _study(*(f"mechanism.{key}" for key in keys))
    for dissipation in DISSIPATIONS:
        studies[f"dissipation {dissipation:g} s/m"] = _study(
            f"contact.dissipation_s_m={dissipation}"
        )
    return studies


def _study(*overrides: str) -> Setup:
    return load_study("mq200_paper", [*overrides, "solver.engine=planar"])


def expectations(
    study: Setup, designs: Designs, angles: int, executor: Executor
) -> dict[str, MixExpectation]:
    """Simulate the expected shift time of each design."""
    seed = study.file.expectation.seed + 2 * NEW_ANGLES
    evaluations = evaluate(study, [*designs.values()], executor, angles, seed)
    expectations = [evaluation.expectation for evaluation in evaluations]
    return dict(zip(designs, expectations, strict=True))


def print_times(name: str, contact: ContactSet, expectations: dict[str, MixExpectation]) -> None:
    """Print the times under one setting, the prototype's first, then gains."""
    prototype = expectations["prototype"]
    ratio = restitution(contact.dissipation * IMPACT_SPEED_M_S)
    print(f"\n{name}; restitution {ratio:.2f} at {IMPACT_SPEED_M_S:g} m/s")
    for design, expectation in expectations.items():
        gain = prototype.mean - expectation.mean
        error = math.hypot(prototype.standard_error, expectation.standard_error)
        gain_text = f"gain {gain * 1e3:+6.1f} +- {error * 1e3:.1f} ms, {gain / prototype.mean:+.0%}"
        time = f"{expectation.mean * 1e3:7.1f} +- {expectation.standard_error * 1e3:.1f} ms"
        lost = ""
        if expectation.lost and expectation.unaided_mean is not None:
            without_retries = f"{expectation.unaided_mean * 1e3:.1f} ms without its retries"
            lost = f"; {expectation.lost} lost, {without_retries};"
        if expectation is prototype:
            gain_text = ""
        line = f"  {design:<14}{time}  engaged {expectation.engaged:.3f}{lost}  {gain_text}"
        print(line.rstrip(" ;"))


def print_release(designs: Designs) -> None:
    """Print above which friction a flank of each design would lock."""
    print("\nfriction above which the flank of the smaller side angle lets go no more under load")
    for name, params in designs.items():
        smallest_angle = min(params["traction_deg"], params["braking_deg"])
        print(f"  {name:<14}{math.tan(smallest_angle * DEG):.3f}")


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--angles", type=int, default=48)
    parser.add_argument("--jobs", type=int, default=0)
    arguments = parser.parse_args()
    folder = Path("build/contact_sets")
    folder.mkdir(parents=True, exist_ok=True)
    executor = Executor(ShiftJournal(folder / "shifts.jsonl"), arguments.jobs)
    designs = designs_of(paper_study())
    print(f"expected shift time over 28 operating points, {arguments.angles} angles each")
    for name, study in settings().items():
        times = expectations(study, designs, arguments.angles, executor)
        print_times(name, study.clutch.contact, times)
    print_release(designs)


if __name__ == "__main__":
    main()
