"""Evidence of the published stand's hypotheses by quadrature and sampling, and by nested sampling.

Both must agree within their errors: what is compared is Z of single effects (quadrature) and of
what leads (importance sampling), from the bank that the package brings.
"""

from __future__ import annotations

import math
import time

from dogshape.diagnosis.bench.bench_data import load_bench, setting_of
from dogshape.diagnosis.inference.evidence import evidence
from dogshape.diagnosis.likelihood.observations import observe
from dogshape.diagnosis.likelihood.scores import Problem
from dogshape.diagnosis.prediction.emulator import BankEmulator
from dogshape.diagnosis.prediction.hypotheses import spaces_for
from dogshape.diagnosis.settings import USUAL
from dogshape.diagnosis.terms import Hypothesis
from dogshape.pipeline.diagnose.bank_diagnosis import Means, bank_of, with_bank_engine
from dogshape.sim.effects import load
from dogshape.validation.nested_sampling import nested_evidence

COMPARED: tuple[Hypothesis, ...] = (
    ("actuation_delay",),
    ("actuation_lag",),
    ("contact_friction",),
    ("detent_force",),
    ("actuation_delay", "sleeve_friction"),
    ("actuation_delay", "drag_torque"),
    ("actuation_delay", "actuation_lag", "drag_torque"),
    ("actuation_delay", "drag_torque", "sleeve_friction"),
)


def main() -> None:
    """Print the table."""
    effects, means = load(), Means()
    bench = with_bank_engine(load_bench("mq200_stand"), effects, means)
    problem = Problem(observe(bench), BankEmulator(bank_of(bench, effects, means)), USUAL)
    print(f"{'effects':52} {'ln Z':>9} {'error':>6} {'nested':>9} {'error':>6} {'apart':>6} s : s")
    for space in spaces_for(COMPARED, effects, setting_of(bench)):
        start = time.process_time()
        mine = evidence(problem, space)
        middle = time.process_time()
        log, error = nested_evidence(problem, space)
        end = time.process_time()
        apart = (mine.log_evidence - log) / math.hypot(mine.error, error)
        print(
            f"{' + '.join(space.hypothesis):52} {mine.log_evidence:9.2f} {mine.error:6.2f} "
            f"{log:9.2f} {error:6.2f} {apart:+6.1f} {middle - start:.1f} : {end - middle:.0f}",
            flush=True,
        )
    print("\napart: difference over both errors; the last column has processor times")


if __name__ == "__main__":
    main()
