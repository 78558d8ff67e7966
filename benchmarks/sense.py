"""Gap of the stand with nothing fitted, in either sense of rotation.

From the bundled bank, at its dense angles, without any effect: bench mean less simulated mean of
the shifts that engage. Neither source says in which sense the stand's wheel turned.
"""

from __future__ import annotations

import numpy as np

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.diagnosis.prediction.bank import Bank
from dogshape.pipeline.diagnose.bank_diagnosis import Means, banks_of, with_bank_engine
from dogshape.sim.effects import load
from dogshape.sim.units import RPM

FAST = 25.0  #: 1/min from which a shift seldom waits for the next slot


def gaps_of(bench: Bench, bank: Bank) -> tuple[float, float, float]:
    """Give root mean squares over all points and the fast ones, and the mean gap, ms."""
    times = np.where(np.isfinite(bank.baseline), bank.baseline, np.nan)
    gaps = np.array([np.nan if c.time is None else c.time for c in bench.cells])
    gaps = 1e3 * (gaps - np.nanmean(times, axis=1))
    fast = np.array([c.point.mismatch / RPM > FAST - 0.5 for c in bench.cells])
    rms = [float(np.sqrt(np.nanmean(part**2))) for part in (gaps, gaps[fast])]
    return rms[0], rms[1], float(np.nanmean(gaps))


def main() -> None:
    """Print the table."""
    effects, means = load(None), Means()
    bench = with_bank_engine(load_bench("mq200_stand"), effects, means)
    print(f"{'sense':<14}{'rms, ms':>10}{'from 25 1/min':>16}{'mean, ms':>12}")
    for name, bank in zip(
        ("of the table", "reversed"), banks_of(bench, effects, means), strict=True
    ):
        rms, fast, mean = gaps_of(bench, bank)
        print(f"{name:<14}{rms:>10.1f}{fast:>16.1f}{mean:>12.1f}")


if __name__ == "__main__":
    main()
